"""Derivatives by central differences of order 4, over a length on which the function is nearly linear."""

from __future__ import annotations

from collections.abc import Callable

EPS = 2.220446049250313e-16
# The first length of a difference, relative to the magnitude of the argument; later ones are shorter.
REACH, SHORTER, ROUNDS = 2e-3, 8.0, 10
# How far the slopes over one and over two such lengths may differ, relatively; the error of order 4 is
# about the square of that.
STRAIGHT = 1e-5
# Slopes over far shorter lengths show what varies over these alone: 1/(1 + (t - 1e6)^2) is flat over
# thousands. The ratio of such lengths, their greatest number, and the part of a slope that rounding may be.
APART, MOST, ROUGH = 100.0, 4, 1e-3


def slope(
    function: Callable[[float], float], at: float, size: float, others: float = 0.0, grain: float = EPS
) -> float:
    """f'(at), with an error of about 1e-11 for smooth f.

    size    magnitude of the argument; others: of what else f adds to it
    grain   relative rounding of f

    f may vary over lengths much shorter than its argument (sin(t) at t = 1000): the length is shortened until
    f is nearly linear there and over all shorter ones, or until rounding exceeds the remaining error.
    """
    reach = REACH * size
    lengths = (reach / APART**k for k in range(1, MOST + 1))
    level = abs(at) + others
    probes = [_Probe(function, at, p, level, grain) for p in lengths if 64.0 * grain * abs(at) <= ROUGH * p]
    best, least = float("nan"), float("inf")
    for _ in range(ROUNDS):
        high, low, higher, lower = (function(at + place * reach) for place in (1.0, -1.0, 2.0, -2.0))
        one, two = (high - low) / (2.0 * reach), (higher - lower) / (4.0 * reach)
        found = (8.0 * (high - low) - (higher - lower)) / (12.0 * reach)
        largest, bend = max(abs(one), abs(two)), abs(one - two)
        rounding = grain * (abs(high) + abs(low) + abs(higher) + abs(lower)) / reach
        # The remaining error: the next power of the length, and rounding of argument and values over it.
        error = 0.2 * bend * (bend / (largest or 1.0)) + rounding + EPS * abs(at) / reach * largest
        beside = max((probe.off(found) for probe in probes if probe.length < reach), default=0.0)
        if max(error, beside) < least:
            best, least = found, max(error, beside)
        if beside == 0.0 and bend <= STRAIGHT * largest + 64.0 * rounding:
            break
        reach /= SHORTER
    return best


class _Probe:
    """The slope of a function over a short length, and what rounding makes of it."""

    def __init__(
        self, function: Callable[[float], float], at: float, length: float, level: float, grain: float
    ) -> None:
        self.function, self.at, self.length = function, at, length
        self.high, self.low = function(at + length), function(at - length)
        self.slope = (self.high - self.low) / (2.0 * length)
        terms = abs(self.high) + abs(self.low) + level * abs(self.slope)
        self.rounding = 64.0 * grain * terms / length
        self._scatter: float | None = None

    def off(self, found: float) -> float:
        """By how much a slope over a longer length is wrong; 0.0 within rounding."""
        away = abs(self.slope - found)
        if away - self.rounding <= STRAIGHT * max(abs(self.slope), abs(found)):
            return 0.0
        return away if away > self._scattered() else 0.0

    def _scattered(self) -> float:
        """Rounding of the terms of the function, which need not show in its values, as neighbours show it."""
        if self._scatter is None:
            wide = [self.function(self.at + place * self.length) for place in (-2.0, 0.0, 2.0)]
            double = (wide[2] - wide[0]) / (4.0 * self.length)
            bends = [abs(ends - 2.0 * wide[1]) for ends in (self.high + self.low, wide[0] + wide[2])]
            self._scatter = 8.0 * max(*bends, abs(self.slope - double) * self.length) / self.length
        return self._scatter
