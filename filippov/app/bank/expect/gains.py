"""Which values of a polynomial's one parameter make it stable, and where its roots meet the axis."""

from __future__ import annotations

import itertools
import re
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.app.bank.expect.roots import ROOT, stable_at
from filippov.app.bank.outcome import Ask, Either, reads
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.reason import MissingError, NotUnderstoodError

_GAIN = r"gain|parameter"
_ON_AXIS = 1e-9
_DIGITS = 30


def critical_values(polynomial: Polynomial, k: Symbol) -> list[Expr]:
    """Real values of a parameter at which a root is on the imaginary axis or at infinity, in order.

    With P(j w) = A(w) + j w B(w), roots j w, w != 0, belong to zeros of the resultant of A and B by w.
    """
    w = Symbol("w", real=True)
    degree = len(polynomial.coefficients) - 1
    real, imaginary = sympy.Integer(0), sympy.Integer(0)
    for place, c in enumerate(polynomial.coefficients):
        power = degree - place
        turned = sympy.nsimplify(c, rational=True) * (-1) ** (power // 2)
        if power % 2:
            imaginary += turned * w ** (power - 1)
        else:
            real += turned * w**power
    ends = polynomial.coefficients[0], polynomial.coefficients[-1]
    found: list[Expr] = []
    for condition in (sympy.resultant(real, imaginary, w), *ends):
        numerator = sympy.numer(sympy.together(sympy.nsimplify(condition, rational=True)))
        if numerator.has(k):
            for factor, _ in sympy.factor_list(numerator, k)[1]:
                roots = sympy.Poly(factor, k).nroots(n=_DIGITS, maxsteps=500)
                found += [root for root in roots if root.is_real]
    return sorted(set(found))


def stable_intervals(ask: Ask) -> tuple[Symbol, list[tuple[Any, Any]]]:
    """The one parameter, and the open intervals of its values for which all roots are left of the axis."""
    symbols = sorted(set().union(*(c.free_symbols for c in ask.polynomial.coefficients)), key=str)
    if len(symbols) != 1:
        raise NotUnderstoodError(f"the polynomial has {len(symbols)} parameters, not one")
    k = symbols[0]
    edges = [-sympy.oo, *critical_values(ask.polynomial, k), sympy.oo]
    out: list[tuple[Any, Any]] = []
    for low, high in itertools.pairwise(edges):
        if stable_at(ask.polynomial, {k: _between(low, high)}) is sympy.true:
            joined = bool(out) and out[-1][1] == low and stable_at(ask.polynomial, {k: low}) is sympy.true
            out[-1:] = [(out[-1][0], high)] if joined else [*out[-1:], (low, high)]
    if not out:
        raise MissingError(f"the polynomial is stable for no {k}")
    return k, out


def _between(low: Any, high: Any) -> Expr:
    if low == -sympy.oo:
        middle = (high if high != sympy.oo else sympy.Integer(1)) - 1
    else:
        middle = low + 1 if high == sympy.oo else (low + high) / 2
    return sympy.Rational(str(middle)) if middle.is_Float else middle


@reads(
    r"(?P<name>\w+?)_(?P<what>max|min|range)(?:_stable)?|(?P<what2>max|min)_(?P<name2>\w+)|stable_(?P<name3>\w+)_range",
    "largest, least value, or [least, largest], of the one parameter for which the polynomial is stable",
    ROOT,
)
def _extreme(ask: Ask, match: re.Match[str]) -> Any:
    k, intervals = stable_intervals(ask)
    _named(k, match["name"] or match["name2"] or match["name3"])
    if len(intervals) != 1:
        raise NotUnderstoodError(f"{k} has {len(intervals)} intervals of stability")
    low, high = intervals[0]
    what = match["what"] or match["what2"] or "range"
    found = [low, high] if what == "range" else [high if what == "max" else low]
    if any(not value.is_finite for value in found):
        raise MissingError(f"the polynomial is stable for {low} < {k} < {high}")
    numbers = [float(value) for value in found]
    return numbers if what == "range" else numbers[0]


@reads(
    r"(?P<name>\w+?)_(?:critical|crit|marginal|limit)|(?:critical|marginal|ultimate|limiting)_(?P<name2>\w+)",
    "a value of the one parameter between stable and not; frequency: that of the roots on the axis there",
    ROOT,
)
def _critical(ask: Ask, match: re.Match[str]) -> Any:
    name = match["name"] or match["name2"]
    if name in ("frequency", "omega", "w"):
        return _frequency(ask, match)
    k, intervals = stable_intervals(ask)
    _named(k, name)
    return Either([float(end) for pair in intervals for end in pair if end.is_finite])


@reads(
    r"(?:oscillation|axis|crossover|jw)_frequency|axis_omega",
    "frequency of the roots on the axis, at a value of the one parameter between stable and not",
    ROOT,
)
def _frequency(ask: Ask, _match: re.Match[str]) -> Any:
    polynomials = [ask.polynomial]
    if any(c.free_symbols for c in ask.polynomial.coefficients):
        k, intervals = stable_intervals(ask)
        ends = {end for pair in intervals for end in pair if end.is_finite}
        polynomials = [ask.polynomial.at({k.name: sympy.Rational(str(end))}) for end in sorted(ends)]
    roots = [root for polynomial in polynomials for root in polynomial.roots()]
    found = sorted({r.imag for r in roots if r.imag > 0 and abs(r.real) <= _ON_AXIS * (1 + abs(r))})
    if not found:
        raise MissingError("no roots are on the axis")
    return Either(found)


def _named(k: Symbol, name: str) -> None:
    if name not in (k.name, *_GAIN.split("|")):
        raise NotUnderstoodError(f"the parameter of the polynomial is {k}")
