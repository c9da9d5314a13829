"""Numerical search for equilibria at several scales of the states, each with quantities of order 1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr

from filippov.analysis.algebra.budget import Clock
from filippov.analysis.steady.equilibria_numeric import DIGITS, NumericMode, searched
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, Missing

# Starts in the ranges, and in the same ranges made smaller by each of these factors.
STARTS, FEWER, LEVELS = 48, 24, (1.0, 1e-3, 1e-6, 1e-9)
# States of the default ranges are of this size in their units.
RANGE = 10.0
# In units: a point that is smaller is searched again at its own size; less than NOTHING is rounding of 0.
OWN, NOTHING, SEARCHES = 0.1, 1e-13, 12
# Relative difference of equilibria that count as one.
SAME = 1e-5

Array = npt.NDArray[np.float64]
Found = EquilibriumPoint | EquilibriumSet


def numeric_equilibria(
    search: NumericMode, ranges: list[tuple[float, float]], clock: Clock
) -> tuple[list[Found], list[str]]:
    """Return what Newton's method finds from starts in the ranges, and notes on what may be missed."""
    where = ", ".join(f"{x} in [{a:g}, {b:g}]" for x, (a, b) in zip(search.x, ranges, strict=True))
    missing = Missing(f"mode {search.mode!r} was searched numerically in {where}; some may be missed.")
    scales = _Scales(search, np.array([*ranges, *search.limits]), clock)
    found: list[Found] = []
    # Sets of more than one dimension: the first point and what is said of it. Those that only a coarse scale
    # sees are none.
    spread: list[tuple[Found, str]] = []
    for level in LEVELS:
        items, said = scales.searched(level)
        if said:
            spread.append((items.pop(), said[0]))
        elif level == LEVELS[-1]:
            spread.clear()
        for item in items:
            own = scales.own(item, level)
            if own is not None and not any(scales.same(own, other, level) for other in found):
                found.append(own)
    return [*found, *(item for item, _ in spread[:1])], [missing, *(text for _, text in spread[:1])]


class _Scales:
    """The search of one mode in units of any size; unit: of the unknowns of the ranges as given."""

    def __init__(self, search: NumericMode, box: Array, clock: Clock) -> None:
        self.search, self.box, self.clock, self.n = search, box, clock, len(search.x)
        sizes = np.max(np.abs(box), axis=1) / RANGE
        self.unit = np.where((sizes > 0.0) & (np.arange(len(box)) < self.n), sizes, 1.0)

    def units(self, size: float) -> Array:
        """The units where states are smaller by a factor; multipliers are of order 1 as they are."""
        out = self.unit.copy()
        out[: self.n] *= size
        return out

    def searched(self, size: float, starts: list[Array] | None = None) -> tuple[list[Found], list[str]]:
        """What is found where states are smaller by a factor, from there or from starts of one's own."""
        inner, unit = self.box.copy(), self.units(size)
        inner[: self.n] *= size
        spread = _starts(inner, STARTS if size == 1.0 else FEWER)
        scaled = _dimensionless(self.search, unit, spread)
        items, said = searched(scaled, [start / unit for start in starts or spread], self.clock)
        return [_in_units(item, unit) for item in items], said

    def own(self, item: Found, level: float) -> Found | None:
        """A point as it is seen at its own size; None where it is none there, or a smaller level's."""
        for _ in range(SEARCHES):
            if not isinstance(item, EquilibriumPoint):
                return item
            size = self.size(item)
            if size >= OWN * level:
                return item
            if size < NOTHING:
                return item if level == LEVELS[-1] else None
            items, _ = self.searched(size, [np.array([*item.value, *item.s_value])])
            if not items:
                return None
            item, level = items[0], size
        return None

    def size(self, point: EquilibriumPoint) -> float:
        """The largest state in units."""
        return float(np.max(np.abs(point.value) / self.unit[: self.n], initial=0.0))

    def same(self, one: Found, other: Found, level: float) -> bool:
        """Whether a point or set is one that is known."""
        unit = self.units(level)[: self.n]
        if isinstance(other, EquilibriumPoint):
            if not isinstance(one, EquilibriumPoint):
                return False
            unit = self.units(max(self.size(one), self.size(other)))[: self.n]
            return _near(np.array(one.value), np.array(other.value), unit)
        if isinstance(one, EquilibriumPoint):
            c = _free_value(one, other)
            return c is not None and _near(np.array(one.value), _at(other, c), unit)
        if len(one.ends) == len(other.ends) == 2:
            first, second = (sorted(end.value for end in line.ends) for line in (one, other))
            size = max(self.size(end) for end in (*one.ends, *other.ends))
            unit = self.units(max(size, level))[: self.n]
            return all(_near(np.array(a), np.array(b), unit) for a, b in zip(first, second, strict=True))
        return all(_off_line(_at(one, c), other) <= SAME * (1.0 + abs(c)) for c in (-0.37, 0.37))


def _starts(box: Array, count: int) -> list[Array]:
    """The middle of the box, and points spread over it."""
    from scipy.stats import qmc

    cube = qmc.Sobol(len(box), scramble=False).random(64)[:count]
    return [box.mean(axis=1), *(box[:, 0] + (0.003 + 0.99 * cube) * (box[:, 1] - box[:, 0]))]


def _dimensionless(search: NumericMode, unit: Array, starts: list[Array]) -> NumericMode:
    """The mode with its states in units, each equation and bound over its middle size at the starts."""
    rows, bounds = _sizes(search.residual, starts), _sizes(search.bounds, starts)
    # Multipliers are of order 1 as they are.
    bounds[list(search.of_multipliers)] = 1.0

    def slopes(z: Array) -> Array | None:
        found = search.slopes(z * unit)
        return None if found is None else found * unit / rows[:, None]

    return replace(
        search,
        residual=lambda z: search.residual(z * unit) / rows,
        slopes=slopes,
        bounds=lambda z: search.bounds(z * unit) / bounds,
    )


def _sizes(function: Callable[[Array], Array], places: list[Array]) -> Array:
    """The middle size of each component, 1 where it has none."""
    values = np.abs([function(place) for place in places])
    out = np.ones(values.shape[1])
    for k, column in enumerate(values.T):
        known = column[np.isfinite(column) & (column > 0.0)]
        out[k] = float(np.median(known)) if known.size else 1.0
    return out


def _in_units(item: Found, unit: Array) -> Found:
    """What was found in units, in states."""
    n = len(item.states)
    if np.all(unit == 1.0):
        return item
    if isinstance(item, EquilibriumPoint):
        return _point_in_units(item, unit)
    (c,) = item.free
    lead = float(unit[item.states.index(c.name)]) if c.name in item.states else 1.0

    def told(e: Expr, size: float) -> Expr:
        ends = float(e.subs(c, 0)) * size, float(e.diff(c)) * size / lead
        return c if e == c else _number(ends[0]) + _number(ends[1]) * c

    return replace(
        item,
        x=tuple(told(e, u) for e, u in zip(item.x, unit[:n].tolist(), strict=True)),
        multipliers=tuple((name, told(e, 1.0)) for name, e in item.multipliers),
        domain=tuple((_times(low, lead), _times(high, lead)) for low, high in item.domain),
        bounds=tuple((low * lead, high * lead) for low, high in item.bounds),
        ends=tuple(_point_in_units(end, unit) for end in item.ends),
    )


def _point_in_units(point: EquilibriumPoint, unit: Array) -> EquilibriumPoint:
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


def _free_value(point: EquilibriumPoint, line: EquilibriumSet) -> float | None:
    """The value of the free symbol of a set at a point."""
    (c,) = line.free
    if c.name in point.states:
        return float(point.value[point.states.index(c.name)])
    for (_, e), s in zip(line.multipliers, point.s_value, strict=True):
        if e == c:
            return float(s)
    return None


def _off_line(x: Array, line: EquilibriumSet) -> float:
    """The distance of a point from the line that a set lies on, relative to its own size."""
    origin = _at(line, 0.0)
    way, to = _at(line, 1.0) - origin, x - origin
    along = float(way @ way)
    off = to - way * (float(to @ way) / along) if along > 0.0 else to
    return float(np.max(np.abs(off)) / max(float(np.max(np.abs(x))), float(np.max(np.abs(way))), 1e-300))


def _at(line: EquilibriumSet, c: float) -> Array:
    return np.array([float(e) for e in line.at(sympy.Float(c))])


def _near(x: Array, y: Array, unit: Array) -> bool:
    return bool(np.all(np.abs(x - y) <= SAME * np.maximum(np.abs(y), unit)))
