"""The small language of the kernel files: typed Python that `translate` and `compiler` turn into code.

A kernel is a function on numbers, flat arrays and records with every parameter annotated: `float`, `int`,
`bool`, `Vector` (doubles), `Indices` (64-bit integers), a record (see `records`), `Rows` or `Lanes` of one.
Allowed are assignments, `if`, `while`, `for ... in range`,
`break`, `continue`, `return` of a number or a tuple of numbers, arithmetic, comparisons, and calls of other
kernels and of the functions below. Matrices are flat, row by row. Run by Python itself a kernel gives the
same numbers, only slower, which is how its parts are tested.

A lane kernel (`lanes`) runs several trajectories side by side: its floats are vectors with a number for each,
its `Vector`s are arrays of them, its integers and its `Shared` arrays of numbers are common to all. A plain
kernel called from a lane kernel is widened in the same way. Comparisons give a mask: `a if mask else b`
blends, both sides computed; `if` takes `anywhere(mask)` or `everywhere(mask)`.
"""

import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Shared = Vector
Function = TypeVar("Function", bound=Callable[..., object])


NAN, INF = math.nan, math.inf


class KernelError(TypeError):
    """A kernel uses something outside the language."""


def kernel(function: Function) -> Function:
    """Mark a function to be compiled."""
    return function


def lanes(function: Function) -> Function:
    """Mark a kernel of several trajectories side by side, in place of a plain one of the same name."""
    return function


def entry(function: Function) -> Function:
    """Mark a kernel that is called from outside its unit (besides `kernel`)."""
    return function


def inline(function: Function) -> Function:
    """Mark a kernel to be copied into every place that calls it (besides `kernel` or `contract`)."""
    return function


def apart(function: Function) -> Function:
    """Mark a kernel that is never copied into its callers (besides `kernel` ...)."""
    return function


def seldom(function: Function) -> Function:
    """Mark a kernel that few steps and few events call (besides `kernel` ...).

    In a unit that serves all systems it is translated as it stands: most of a first solve is optimising.
    """
    return function


def contract(function: Function) -> Function:
    """Mark a kernel whose products may be fused with the sums they enter: faster, with one rounding less."""
    return function


def shift(array: Vector, offset: int) -> Vector:
    """The array from an offset on, as a view."""
    return array[offset:]


def shift_indices(array: Indices, offset: int) -> Indices:
    """The integer array from an offset on, as a view."""
    return array[offset:]


def anywhere(mask: bool) -> bool:
    """Whether a mask holds in any lane."""
    return bool(mask)


def everywhere(mask: bool) -> bool:
    """Whether a mask holds in all lanes."""
    return bool(mask)


def mask_bits(mask: bool) -> int:
    """A mask as an integer, one bit per lane."""
    return int(mask)


_NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh"}
_NUMPY |= {"atanh": "arctanh", "atan2": "arctan2"}


def each(name: str, *values: float) -> float:
    """A function of the C library, lane by lane: where math raises, the infinity or NaN of C."""
    try:
        return float(getattr(math, name)(*values))
    except (OverflowError, ValueError):
        with np.errstate(all="ignore"):
            return float(getattr(np, _NUMPY.get(name, name))(*map(np.float64, values)))


def claim(counters: Indices, place: int) -> int:
    """Increment a number and return its previous value; threads that share it never get the same."""
    counters[place] += 1
    return int(counters[place]) - 1


def call_at(address: int, *arguments: object) -> int:
    """Call a compiled function by its address (compiled code only)."""
    raise RuntimeError("call_at exists in compiled code only")


def truncate(value: float) -> int:
    """The integer part."""
    return int(value)


def sqrt(value: float) -> float:
    """The square root, NaN below 0."""
    return math.sqrt(value) if value >= 0.0 else math.nan


def rint(value: float) -> float:
    """The nearest whole number, ties to even."""
    return float(np.rint(value))


def two_to(exponent: int) -> float:
    """2**exponent, |exponent| < 1023."""
    return math.ldexp(1.0, exponent)


def to_bits(value: float) -> int:
    """The bits of a double as an integer."""
    return int(np.float64(value).view(np.int64))


def from_bits(bits: int) -> float:
    """The double with these bits."""
    return float(np.int64(bits).view(np.float64))


def fma(a: float, b: float, c: float) -> float:
    """a b + c (rounded once in compiled code)."""
    return a * b + c


def power(base: float, exponent: float) -> float:
    """base**exponent as C's pow computes it, with NaN and infinities."""
    with np.errstate(all="ignore"):
        return float(np.power(np.float64(base), np.float64(exponent)))


def call_field(address: int, t: float, x: Vector, p: Vector, s: Vector, m: Vector, out: Vector) -> int:
    """Call a user's field by its address (compiled code only)."""
    raise RuntimeError("call_field exists in compiled code only")


def call_guard(address: int, t: float, x: Vector, p: Vector, m: Vector, out: Vector) -> int:
    """Call a user's switching functions, gradients or radii by address (compiled code only)."""
    raise RuntimeError("call_guard exists in compiled code only")
