"""The elementary functions, in one place: what formulas, stored systems, kernels and backends know of them.

To add one: a row here. It is then read in formulas, stored, printed into kernels, and called in the C library
by compiled code and in `math` or `numpy` by Python; `tests/test_elementary.py` asks for each of these.
"""

from __future__ import annotations

from typing import NamedTuple


class Elementary(NamedTuple):
    """A function by its name in formulas, as a class of sympy and in the C library.

    formula     whether it may stand in a formula: the others jump, and are written with Heaviside and sign
    """

    name: str
    symbolic: str
    library: str
    arguments: int = 1
    formula: bool = True


_SAME = (
    "sin", "cos", "tan", "exp", "log", "tanh", "sinh", "cosh", "asin", "acos", "atan", "asinh", "acosh",
    "atanh", "erf",
)  # fmt: skip
ELEMENTARY = (
    *(Elementary(name, name, name) for name in _SAME),
    Elementary("atan2", "atan2", "atan2", 2),
    Elementary("floor", "floor", "floor", formula=False),
    Elementary("ceiling", "ceiling", "ceil", formula=False),
)
# Functions of the C library that kernels call, but no formula has.
IN_KERNELS = ("expm1", "log1p")
# Their numbers of arguments by the names of the C library.
LIBRARY = {f.library: f.arguments for f in ELEMENTARY} | dict.fromkeys(IN_KERNELS, 1)
