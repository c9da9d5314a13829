"""The entry points of a unit and what they take, by name: the one description of the border to machine code.

Values are handed over by name, in any order, and their kinds are looked at: an address says nothing of what
lies there. A test holds the names and kinds to those of the kernels.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from filippov.kernel.language.primitives import KernelError

# Kinds of arguments: a double, an integer, an array of doubles, one of integers.
_KINDS: dict[str, Any] = {"float": ctypes.c_double, "int": ctypes.c_int64}
_KINDS |= dict.fromkeys(("Vector", "Indices"), ctypes.c_void_p)
_SHORT = {"d": "float", "i": "int", "v": "Vector", "k": "Indices"}
_STATE = "clock:v count:k x:v m:v order:k hit:k lam:v p:v atol:v stop:k zeno:v"
_ROWS = "clocks:v counts:k xs:v ms:v orders:k hits:k lams:v ps:v atol:v stops:k zenos:v kinds:k"
_OUT, _SCRATCH = "events:v marks:k", "w:v iw:k ctx:k"
_TEXTS = {
    "advance": f"{_STATE} rec:v rec_coef:v {_OUT} {_SCRATCH}",
    "ensemble": f"last:i steps:i queue:k mine:k {_ROWS} {_OUT} codes:k {_SCRATCH}",
    "launch": f"clock:v x:v m:v order:k lam:v p:v {_SCRATCH}",
    "turn": f"steps:i {_STATE} kinds:k {_OUT} {_SCRATCH}",
    "open_segment": f"clock:v x:v p:v m:v order:k atol:v {_SCRATCH}",
    "begin": f"t:d direction:d x:v p:v m:v order:k lam:v {_SCRATCH}",
    "probe": f"t:d step:d x:v m:v p:v lam:v out:v {_SCRATCH}",
    "rhs": "t:d x:v p:v s:v m:v out:v ctx:k",
    "guards": "t:d x:v p:v m:v out:v ctx:k",
    "gradients": "t:d x:v p:v m:v g:v gt:v ctx:k",
    "radii": "t:d x:v p:v out:v ctx:k",
    "resets": "i:i t:d x:v p:v m:v out:v ctx:k",
    "derive": "p:v",
    "lane_run": (
        "last:i steps:i queue:k rows:k entries:k clock_l:v tally_l:v x_l:v m_l:v order_l:v p_l:v atol_l:v "
        f"w_l:v iw_l:k {_ROWS} {_OUT} codes:k {_SCRATCH}"
    ),
}
# By entry point, the name and kind of every argument, in order.
ARGUMENTS: dict[str, tuple[tuple[str, str], ...]] = {
    name: tuple((part[:-2], _SHORT[part[-1]]) for part in text.split()) for name, text in _TEXTS.items()
}
IN_LANES = ("lane_run",)
PLAIN = tuple(name for name in ARGUMENTS if name not in IN_LANES)
# Those that a unit of lanes calls by address.
CALLED_BY_LANES = ("launch", "turn", "open_segment")
_DTYPES = {"Vector": np.dtype(np.float64), "Indices": np.dtype(np.int64)}
_ROWS_OF = {name: [(word, _DTYPES.get(kind)) for word, kind in row] for name, row in ARGUMENTS.items()}


def prototype(name: str) -> Any:
    """The C type of an entry point."""
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[_KINDS[kind] for _, kind in ARGUMENTS[name]])


def ordered(name: str, values: Mapping[str, Any], given: Callable[[Any], Any] | None) -> list[Any]:
    """The values in the order of the entry point, arrays as `given` makes them; a whole number is an address.

    Raises KernelError for a name too many or too few, and for an array of the wrong kind.
    """
    row, out = _ROWS_OF[name], []
    for argument, dtype in row:
        try:
            value = values[argument]
        except KeyError:
            break
        if isinstance(value, np.ndarray):
            if value.dtype is not dtype and (dtype is None or value.dtype != dtype):
                said = f"{argument} is an array of {value.dtype}, expected {dtype or 'a number'}"
                raise KernelError(f"entry point {name}: {said}")
            value = value if given is None else given(value)
        out.append(value)
    if not len(out) == len(row) == len(values):
        odd = sorted(values.keys() ^ {argument for argument, _ in row})
        raise KernelError(f"entry point {name}: {', '.join(odd)} given too much or missing")
    return out
