"""Lookup tables of a state: measured curves whose knots are kinks."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr

from filippov.base.errors import ModelError
from filippov.base.given import number_array
from filippov.base.keywords import keywords
from filippov.model.check import as_expression
from filippov.model.table import dynamic

# Each inner knot is a surface of the system.
MOST_KNOTS = 64
OUTSIDE = ("hold", "extend")
# Of the slopes in an expression.
DIGITS = 15


class Table:
    """A curve y(x) through measured points, linear between them: force = Table(v_data, F_data); force(v).

    x, y      increasing places and the values there, finite numbers, at most 64 of them
    outside   beyond the first and the last point: "hold" its value, or "extend" the last straight line

    In an expression it is a + b u + sum_k c_k |u - x_k|, so that every knot at which the slope changes is a
    kink: a surface at which steps end and on which nothing can slide. Write a jump of the curve, as of dry
    friction at v = 0, as an additional term with sign(v). Raises ModelError.
    """

    __slots__ = ("outside", "x", "y")
    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    outside: str

    @keywords("keyword", error=ModelError, answers={
        "*": "a Table is made of its points alone, and called with what goes in: Table(x, y)(u).",
    })  # fmt: skip
    def __init__(self, x: Any, y: Any, *, outside: str = "hold") -> None:
        if outside not in OUTSIDE:
            raise ModelError(f"table: outside is {outside!r}, expected one of {', '.join(OUTSIDE)}.")
        places, values = number_array("table: x", x, ModelError), number_array("table: y", y, ModelError)
        if places.ndim != 1 or places.shape != values.shape or len(places) < 2:
            raise ModelError(
                f"table: x has shape {places.shape} and y {values.shape}, expected two lists of one length, "
                "at least 2."
            )
        if not (np.all(np.isfinite(places)) and np.all(np.isfinite(values))):
            k = int(np.argmin(np.isfinite(places) & np.isfinite(values)))
            raise ModelError(
                f"table: point {k} is ({places[k]}, {values[k]}), expected finite numbers. Leave out what "
                "was not "
                "measured."
            )
        if np.any(np.diff(places) <= 0):
            k = int(np.argmax(np.diff(places) <= 0))
            raise ModelError(
                f"table: x[{k}] = {places[k]:g} is followed by {places[k + 1]:g}, expected increasing "
                "places. A jump of the curve is a term with sign(...)."
            )
        if len(places) > MOST_KNOTS:
            raise ModelError(
                f"table: it has {len(places)} points, expected at most {MOST_KNOTS}: each is a surface. Thin "
                "it out, fit a formula, or use System(field=f) with np.interp."
            )
        self.x, self.y, self.outside = places, values, outside

    def __call__(self, u: Any) -> Expr:
        """The curve at an expression in states, parameters and time; a number at a number."""
        at = as_expression(u, "the argument of a table")
        if not dynamic(at) and at.is_number:
            return sympy.Float(self.values(float(at)))
        x, y = ([Fraction(repr(q)) for q in row.tolist()] for row in (self.x, self.y))
        slopes = [(q - p) / (b - a) for (a, b), (p, q) in zip(pairwise(x), pairwise(y), strict=True)]
        if self.outside == "hold":
            slopes, knots = [Fraction(0), *slopes, Fraction(0)], x
        else:
            knots = x[1:-1]
        # y = c + b u + sum of bends |u - x_k|, where beyond the ends the slopes are what they are, such as 0:
        # what rounding left of it would be a line that meets any level, far away.
        bends, mean = _rounded([(q - p) / 2 for p, q in pairwise(slopes)], slopes[0], slopes[-1])
        parts = (c * abs(x[0] - knot) for c, knot in zip(bends, knots, strict=True))
        constant = y[0] - mean * x[0] - sum(parts)
        terms = [
            _number(bend) * sympy.Abs(at - float(knot))
            for bend, knot in zip(bends, knots, strict=True)
            if bend != 0
        ]
        return sympy.Add(_number(constant), _number(mean) * at if mean != 0 else 0, *terms)

    def values(self, u: Any) -> Any:
        """The curve at numbers, as an array like u."""
        u = np.asarray(u, dtype=float)
        out = np.interp(u, self.x, self.y)
        if self.outside == "extend":
            first, last = np.diff(self.y)[[0, -1]] / np.diff(self.x)[[0, -1]]
            out = np.where(u < self.x[0], self.y[0] + first * (u - self.x[0]), out)
            out = np.where(u > self.x[-1], self.y[-1] + last * (u - self.x[-1]), out)
        return out if out.ndim else float(out)

    def __repr__(self) -> str:
        return f"Table({len(self.x)} points on [{self.x[0]:g}, {self.x[-1]:g}], outside={self.outside!r})"


def _rounded(bends: list[Fraction], first: Fraction, last: Fraction) -> tuple[list[Fraction], Fraction]:
    """Bends as decimals of DIGITS digits and the mean of the first and the last slope, which they lead to."""
    largest = max((abs(c) for c in (*bends, first, last)), default=Fraction(0))
    if largest == 0:
        return bends, Fraction(0)
    unit = Fraction(10) ** (math.floor(math.log10(largest)) + 1 - DIGITS)

    def short(q: Fraction) -> Fraction:
        return round(q / unit) * unit

    first, last, out = short(first), short(last), [short(c) for c in bends]
    if out:
        k = max(range(len(out)), key=lambda i: abs(out[i]))
        out[k] += (last - first) / 2 - sum(out)
    return out, (first + last) / 2


def _number(q: Fraction) -> Expr:
    """A float where it stands for the number, as 0.1 does for 1/10, else the fraction."""
    near = float(q)
    return sympy.Float(near) if Fraction(repr(near)) == q else sympy.Rational(q.numerator, q.denominator)
