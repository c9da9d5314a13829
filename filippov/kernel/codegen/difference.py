"""Derivatives by central differences of order 4, over a length on which the function is nearly linear."""

from __future__ import annotations

from collections.abc import Callable

EPS = 2.220446049250313e-16
# The first length of a difference, relative to the magnitude of the argument; later ones are shorter.
REACH, SHORTER, ROUNDS = 2e-3, 8.0, 7
# How far the slopes over one and over two such lengths may differ, relatively; the error of order 4 is
# about the square of that.
STRAIGHT = 1e-5


def slope(function: Callable[[float], float], at: float, size: float) -> float:
    """f'(at), with an error of about 1e-11 for smooth f; size: magnitude of the argument.

    f may vary over lengths much shorter than its argument (sin(t) at t = 1000): the length is shortened until
    f is nearly linear there, or until rounding exceeds the remaining error.
    """
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
        if error < least:
            best, least = found, error
        if bend <= STRAIGHT * largest + 64.0 * rounding:
            break
        reach /= SHORTER
    return best
