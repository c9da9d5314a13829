"""Derivatives of functions by central differences of order 4, over a length on which they are straight."""

from __future__ import annotations

from collections.abc import Callable

EPS = 2.220446049250313e-16
# Part of its argument, or of what stands for its size, that a difference reaches at first; then shorter.
REACH, SHORTER, ROUNDS = 2e-3, 8.0, 7
# Of the slope: how far the differences over one and over two such lengths may differ; the error of order 4 is
# about the square of that.
STRAIGHT = 1e-5


def slope(function: Callable[[float], float], at: float, size: float) -> float:
    """f'(at), the error about 1e-11 for smooth f; size: that of the argument.

    f may turn faster than its argument is large (sin(t) at t = 1000): the length is shortened until f is
    straight, or until rounding is more than what is left.
    """
    reach = max(REACH * size, 1e-9)
    best, least = 0.0, float("inf")
    for _ in range(ROUNDS):
        high, low, higher, lower = (function(at + place * reach) for place in (1.0, -1.0, 2.0, -2.0))
        one, two = (high - low) / (2.0 * reach), (higher - lower) / (4.0 * reach)
        found = (8.0 * (high - low) - (higher - lower)) / (12.0 * reach)
        largest, bend = max(abs(one), abs(two)), abs(one - two)
        rounding = EPS * (abs(high) + abs(low) + abs(higher) + abs(lower)) / reach
        # What is left: the next power of the length, and rounding of the argument and of the values over it.
        error = 0.2 * bend * bend / (largest + 1e-300) + rounding + EPS * abs(at) * largest / reach
        if error < least:
            best, least = found, error
        if bend <= STRAIGHT * largest + 64.0 * rounding:
            break
        reach /= SHORTER
    return best
