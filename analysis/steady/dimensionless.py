"""Numerical search where states or rates are small: in units in which both are of order 1, and back.

The box tells the units, unless the equations say others: those in which the terms of each equation are of one
size. Source: Meintjes, Morgan 1987, A methodology for solving chemical equilibrium systems.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra import linalg
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.base.arrays import Array

# States of the default ranges are of this size in their units.
RANGE = 10.0
DIGITS = 12
# Units by the equations that differ from those by the box by less than this factor are not taken.
APART = 30.0
# Changes of a function below this part of it are rounding.
ROUNDING = 1e-13

# The terms of one equation: the size of each coefficient, and the powers of the states in it.
Terms = tuple[tuple[float, tuple[int, ...]], ...]


def units(box: Array, states: int) -> Array:
    """Of each unknown: below 1 for a state whose range is smaller than +-10."""
    sizes = np.max(np.abs(box), axis=1) / RANGE
    state = np.arange(len(box)) < states
    return np.where((sizes > 0.0) & state, np.minimum(sizes, 1.0), 1.0)


def balanced_units(equations: Sequence[Terms], unit: Array) -> Array:
    """Units of the states in which the terms of each equation are of one size, the nearest to those given."""
    states, base = len(unit), np.log2(unit)
    rows, levels = list[Array](), list[Array]()
    for terms in equations:
        if len(terms) > 1:
            powers = np.array([q for _, q in terms], dtype=float).reshape(len(terms), states)
            size = np.log2([c for c, _ in terms]) + powers @ base
            rows.append(powers - powers.mean(axis=0))
            levels.append(size - size.mean())
    if not rows:
        return unit
    change = linalg.lstsq(np.vstack(rows), -np.concatenate(levels), rcond=1e-9)[0]
    return np.asarray(unit * 2.0**change)


def apart(unit: Array, plain: Array, balanced: Array) -> bool:
    """Whether balanced units differ from those of the box, or among each other from those that are taken."""
    change, spread = np.log2(balanced / unit), np.log2(balanced / plain)
    return bool(max(np.max(np.abs(change)), np.ptp(spread)) >= np.log2(APART))


def polynomial_terms(equations: Sequence[Expr], unknowns: Sequence[Symbol], states: int) -> list[Terms]:
    """The terms of polynomials with numbers as coefficients, [] where one equation is none."""
    out: list[Terms] = []
    try:
        for e in equations:
            found = [(abs(float(c)), q[:states]) for q, c in sympy.Poly(e, *unknowns).terms()]
            out.append(tuple((c, q) for c, q in found if c > 0.0 and np.isfinite(c)))
    except (sympy.PolynomialError, TypeError, ValueError, OverflowError):
        return []
    return out


def slope_terms(f: Callable[[Array], Array], places: Sequence[Array], steps: Array) -> list[Terms]:
    """The terms of equations linearised, of the middle size of their slopes over wide steps at places."""
    known = list[Array]()
    for place in places:
        aside = np.eye(len(steps), len(place)) * steps[:, None]
        ends = [(f(place + d), f(place - d)) for d in aside]
        high, low = np.array([p for p, _ in ends]).T, np.array([m for _, m in ends]).T
        change = np.abs(high - low)
        if np.all(np.isfinite(change)):
            change[change <= ROUNDING * np.maximum(np.abs(high), np.abs(low))] = 0.0
            known.append(change / (2.0 * steps))
    if not known:
        return []
    one = np.eye(len(steps), dtype=int)
    size = np.median(known, axis=0)
    return [tuple((float(c), tuple(one[j].tolist())) for j, c in enumerate(row) if c > 0.0) for row in size]


def sizes(function: Callable[[Array], Array], places: list[Array], most: float = 1.0) -> Array:
    """The middle size of each component at these places where that is below `most`, else `most`."""
    values = np.abs([function(place) for place in places])
    out = np.ones(values.shape[1])
    for k, column in enumerate(values.T):
        known = column[np.isfinite(column) & (column > 0.0)]
        out[k] = min(most, float(np.median(known))) if known.size else 1.0
    return out


def in_units(item: EquilibriumPoint | EquilibriumSet, unit: Array) -> EquilibriumPoint | EquilibriumSet:
    """What was found in units, in states."""
    n = len(item.states)
    if np.all(unit == 1.0):
        return item
    if isinstance(item, EquilibriumPoint):
        return _point(item, unit)
    (c,) = item.free
    lead = float(unit[item.states.index(c.name)]) if c.name in item.states else 1.0

    def told(e: Expr, size: float) -> Expr:
        if e == c:
            return c
        return _number(float(e.subs(c, 0)) * size) + _number(float(e.diff(c)) * size / lead) * c

    return replace(
        item,
        x=tuple(told(e, u) for e, u in zip(item.x, unit[:n].tolist(), strict=True)),
        multipliers=tuple((name, told(e, 1.0)) for name, e in item.multipliers),
        domain=tuple((_times(low, lead), _times(high, lead)) for low, high in item.domain),
        bounds=tuple((low * lead, high * lead) for low, high in item.bounds),
        ends=tuple(_point(end, unit) for end in item.ends),
    )


def _point(point: EquilibriumPoint, unit: Array) -> EquilibriumPoint:
    return replace(
        point,
        x=tuple(_times(e, u) for e, u in zip(point.x, unit.tolist(), strict=False)),
        value=tuple(float(v * u) for v, u in zip(point.value, unit.tolist(), strict=False)),
    )


def _times(expression: Expr, unit: float) -> Expr:
    """A number in units."""
    return expression if unit == 1.0 or expression.is_infinite else _number(float(expression) * unit)


def _number(value: float) -> Expr:
    """A number with twelve digits."""
    nearest = round(value)
    whole = value == 0.0 or abs(value - nearest) < 1e-11 * abs(nearest)
    return sympy.Integer(nearest) if whole else sympy.Float(value, DIGITS)
