"""Numerical search where states or rates are small: in units in which both are of order 1, and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr

from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

# States of the default ranges are of this size in their units.
RANGE = 10.0
DIGITS = 12

Array = npt.NDArray[np.float64]


def units(box: Array, states: int) -> Array:
    """Of each unknown: below 1 for a state whose range is smaller than +-10."""
    sizes = np.max(np.abs(box), axis=1) / RANGE
    state = np.arange(len(box)) < states
    return np.where((sizes > 0.0) & state, np.minimum(sizes, 1.0), 1.0)


def sizes(function: Callable[[Array], Array], places: list[Array]) -> Array:
    """The middle size of each component at these places where that is below 1, else 1."""
    values = np.abs([function(place) for place in places])
    out = np.ones(values.shape[1])
    for k, column in enumerate(values.T):
        known = column[np.isfinite(column) & (column > 0.0)]
        out[k] = min(1.0, float(np.median(known))) if known.size else 1.0
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
