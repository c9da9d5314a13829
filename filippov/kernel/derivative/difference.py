"""Derivatives by central differences of order 4, over a length on which the function is nearly linear."""

from __future__ import annotations

from collections.abc import Callable

from filippov.kernel.tables.layout import EPS

# The first length of a difference, relative to the magnitude of the argument; later ones are shorter.
REACH, SHORTER, ROUNDS = 2e-3, 8.0, 9
# How far the slopes over one and over two such lengths may differ, relatively; the error of order 4 is
# about the square of that.
STRAIGHT = 1e-5
# A far shorter length, relative as the first; by how much differences of order 4 over it may be off a smooth
# f, and slopes over it off those over a longer one, relative to the change of f over it.
SHORTEST, ALIKE = 1e-8, 1e-2
Function = Callable[[float], float]


def slope(function: Function, at: float, size: float) -> float:
    """f'(at), with an error of about 1e-11 for smooth f; size: magnitude of the argument.

    f may vary over lengths much shorter than its argument (sin(t) at t = 1000): the length is shortened until
    f is nearly linear there, or until rounding exceeds the remaining error.
    """
    return _shortened(function, at, size)


def local_slope(function: Function, at: float, size: float) -> float:
    """`slope` of f that may be flat over its argument's size but near `at`, as 1/(1 + (t - 1e6)^2) is.

    Such f show in differences over a far shorter length, if these are more than rounding of f.
    """
    reach = SHORTEST * size
    values = [function(at + k * reach) for k in (-2.0, -1.0, 0.0, 1.0, 2.0)]
    lower, low, middle, high, higher = values
    change, largest = max(values) - min(values), max(abs(v) for v in values)
    rough = abs(lower - 4.0 * low + 6.0 * middle - 4.0 * high + higher)
    if not 64.0 * EPS * largest < change or not rough <= ALIKE * change:
        return _shortened(function, at, size)
    near = (8.0 * (high - low) - (higher - lower)) / (12.0 * reach)
    return _shortened(function, at, size, near, ALIKE * change / (4.0 * reach))


def _shortened(
    function: Function, at: float, size: float, near: float | None = None, within: float = 0.0
) -> float:
    """The slope over the length of least error; near: what it is about, None where that is not known."""
    reach = max(REACH * size, 1e-9)
    best, least = 0.0, float("inf")
    for _ in range(ROUNDS):
        high, low, higher, lower = (function(at + place * reach) for place in (1.0, -1.0, 2.0, -2.0))
        one, two = (high - low) / (2.0 * reach), (higher - lower) / (4.0 * reach)
        found = (8.0 * (high - low) - (higher - lower)) / (12.0 * reach)
        largest, bend = max(abs(one), abs(two)), abs(one - two)
        rounding = EPS * (abs(high) + abs(low) + abs(higher) + abs(lower)) / reach
        # The remaining error: the next power of the length, and rounding of argument and values over it.
        error = 0.2 * bend * bend / (largest + 1e-300) + rounding + EPS * abs(at) * largest / reach
        away = 0.0 if near is None else abs(found - near) - within
        error = max(error, away)
        if error < least:
            best, least = found, error
        if away <= 0.0 and bend <= STRAIGHT * largest + 64.0 * rounding:
            break
        reach /= SHORTER
    return best
