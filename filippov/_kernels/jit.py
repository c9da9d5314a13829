"""Plain Python fields as machine code where numba can compile them: the same numbers, only faster."""

from __future__ import annotations

import dis
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CompiledField:
    """Address of a C function with the signature of `call_field`, and the object that keeps it alive."""

    address: int
    owner: object


def compile_field(field: Callable[..., Any], names: tuple[str, ...], n: int, m: int) -> CompiledField | None:
    """The user's f(t, x, p, s) as a C function, or None where numba cannot compile it or it raises.

    p is a named tuple in compiled code: p.mass and p[0] work, p["mass"] does not.
    """
    plain = getattr(field, "py_func", field)
    if not isinstance(plain, FunctionType) or _raises(plain):
        return None
    from numba import carray, cfunc, njit, types
    from numba.core.errors import NumbaError
    from numba.np.unsafe.ndarray import to_fixed_tuple

    record: Any = namedtuple("Parameters", names)  # type: ignore[misc]  # noqa: PYI024
    count = len(names)
    double = types.CPointer(types.float64)
    signature = types.int64(types.float64, double, double, double, double, double)
    inner = njit(error_model="numpy")(plain)

    def call(t, x, p, s, m_, out):  # type: ignore[no-untyped-def]
        values = carray(p, (count,))
        result = inner(t, carray(x, (n,)), record(*to_fixed_tuple(values, count)), carray(s, (m,)))
        for i in range(n):
            out[i] = result[i]
        return 0

    try:
        compiled = cfunc(signature)(call)
    except (NumbaError, TypeError, ValueError, NotImplementedError, AttributeError, KeyError):
        return None
    return CompiledField(int(compiled.address), compiled)


def _raises(function: FunctionType) -> bool:
    """Whether the function raises or asserts: compiled code would swallow it."""
    return any(
        item.opname in ("RAISE_VARARGS", "LOAD_ASSERTION_ERROR") for item in dis.get_instructions(function)
    )
