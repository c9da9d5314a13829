"""The entry points of a unit: the kernels marked `entry`, with the arguments of their signatures.

Values are passed by name, in any order, and their kinds are checked: an address says nothing of its
target.
"""

from __future__ import annotations

import ast
import ctypes
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from filippov.kernel.files import kernel_file
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.records import Rows, Struct

_HEAD = re.compile(r"^@entry\n(?:@\w+\n)*(def \w+\(.*?\) -> int:)", re.MULTILINE | re.DOTALL)
_NUMBERS: dict[str, Any] = {"float": ctypes.c_double, "int": ctypes.c_int64}
_DTYPES = {"Vector": np.dtype(np.float64), "Indices": np.dtype(np.int64)}


def _heads(*files: str) -> dict[str, tuple[tuple[str, str], ...]]:
    """For every entry point in some kernel files, the name and annotation of each argument, in order."""
    found = {}
    for file in files:
        for head in _HEAD.findall(kernel_file(file).read_text(encoding="utf-8")):
            (node,) = ast.parse(f"{head} ...").body
            assert isinstance(node, ast.FunctionDef)
            found[node.name] = tuple((a.arg, ast.unparse(a.annotation or node)) for a in node.args.args)
    return found


_ENTERED = ("model", "advance", "ensemble", "segment", "start", "probe", "corner", "event_cycle", "limit")
_BY_FILE = {file: _heads(file) for file in _ENTERED}
PLAIN_ARGUMENTS = {name: row for rows in _BY_FILE.values() for name, row in rows.items()}
# The kernel file of every entry point.
PLAIN_FILES = {name: file for file, rows in _BY_FILE.items() for name in rows}
IN_LANES = ("lane_run",)
PLAIN = tuple(PLAIN_ARGUMENTS)
OF_SYSTEM = tuple(name for name in PLAIN if PLAIN_FILES[name] == "model")
# By entry point, the name and annotation of every argument, in order.
ARGUMENTS = PLAIN_ARGUMENTS | _heads(*IN_LANES)
_ROWS_OF = {name: [(word, _DTYPES.get(kind)) for word, kind in row] for name, row in ARGUMENTS.items()}


def prototype(name: str) -> Any:
    """The C type of an entry point."""
    kinds = [_NUMBERS.get(kind, ctypes.c_void_p) for _, kind in ARGUMENTS[name]]
    return ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)


def ordered(name: str, values: Mapping[str, Any], given: Callable[[Any], Any] | None) -> list[Any]:
    """The values in the order of the entry point's arguments, arrays and records converted by `given`.

    Raises KernelError for a name too many or too few, and for a value of the wrong kind.
    """
    row, out = _ROWS_OF[name], []
    for place, (argument, dtype) in enumerate(row):
        try:
            value = values[argument]
        except KeyError:
            break
        kind = ARGUMENTS[name][place][1]
        if isinstance(value, np.ndarray):
            if value.dtype is not dtype and (dtype is None or value.dtype != dtype):
                said = f"{argument} is an array of {value.dtype}"
                raise KernelError(f"entry point {name}: {said}, expected {kind}")
            value = value if given is None else given(value)
        elif kind not in _NUMBERS:
            value = _of_record(name, argument, kind, value, given)
        out.append(value)
    if not len(out) == len(row) == len(values):
        odd = sorted(values.keys() ^ {argument for argument, _ in row})
        raise KernelError(f"entry point {name}: {', '.join(odd)} given too much or missing")
    return out


def _of_record(name: str, argument: str, kind: str, value: Any, given: Callable[[Any], Any] | None) -> Any:
    said = f"Rows[{value.kind.__name__}]" if isinstance(value, Rows) else type(value).__name__
    if said != kind or not isinstance(value, Rows | Struct):
        raise KernelError(f"entry point {name}: {argument} is a {said}, expected {kind}")
    return value if given is None else given(value.array)
