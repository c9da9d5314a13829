"""Equilibria of one mode by Newton's method from many starts, for plain functions and unsolvable formulas."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy
from sympy import Symbol

from filippov.analysis.algebra.budget import Clock
from filippov.analysis.steady.dimensionless import (
    DIGITS,
    RANGE,
    Terms,
    apart,
    balanced_units,
    in_units,
    polynomial_terms,
    sizes,
    slope_terms,
    units,
)
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, Missing, PointKind
from filippov.analysis.steady.existence import ModeProblem, multiplier_symbol
from filippov.analysis.steady.newton import RESIDUAL, differences, null_space, zero
from filippov.base.arrays import Array
from filippov.model.system import System

STARTS = 48
# The neighbourhood of a multiple zero in which the equations hold to rounding, in Newton's steps.
NEIGHBOURHOOD = 20.0
# The distance at which a zero that is one of many has others beside it.
ASIDE = 1e-2
EDGE = 1e-8
# The least range of a state, and how often units are balanced by slopes.
TINY, ROUNDS = 1e-290, 3
# What is left of an equation near a zero at which all its terms vanish.
ALONE = 1e-12


@dataclass(frozen=True)
class NumericMode:
    """residual(y) = 0 under bounds(y) >= 0, y = (x, s): the states, then a multiplier a sliding surface.

    strict   for each bound, whether it is g > 0; of_multipliers: whether it is one of a multiplier
    limits   (lo, hi) of each multiplier, floats
    parts    the sum of the absolute values of the terms of each equation, of formulas
    terms    those of polynomials
    """

    mode: str
    x: tuple[str, ...]
    names: tuple[str, ...]
    free: tuple[Symbol, ...]
    residual: Callable[[Array], Array]
    bounds: Callable[[Array], Array]
    strict: tuple[bool, ...]
    of_multipliers: tuple[bool, ...]
    limits: tuple[tuple[float, float], ...]
    parts: Callable[[Array], Array] | None = None
    terms: tuple[Terms, ...] = ()

    @classmethod
    def of_expressions(cls, problem: ModeProblem) -> NumericMode:
        """Make it from a mode problem without parameters."""
        unknowns = (*problem.x, *problem.sliding)
        f = sympy.lambdify([unknowns], list(problem.equations), "numpy")
        g = sympy.lambdify([unknowns], [b.g for b in problem.bounds], "numpy")
        parts = sympy.lambdify([unknowns], [absolute_terms(e) for e in problem.equations], "numpy")

        def quiet(function: Callable[[Array], list[float]], y: Array) -> Array:
            # Beyond its surface a field may be undefined: nan there, which the search turns away from.
            with np.errstate(all="ignore"):
                return np.array([float(e) for e in function(y)])

        return cls(
            problem.mode,
            tuple(q.name for q in problem.x),
            problem.names,
            unknowns,
            lambda y: quiet(f, y),
            lambda y: quiet(g, y),
            tuple(b.strict for b in problem.bounds),
            tuple(bool(b.g.free_symbols & set(problem.sliding)) for b in problem.bounds),
            tuple((_limit(low, -1.0), _limit(high, 1.0)) for low, high in problem.limits),
            lambda y: quiet(parts, y),
            tuple(polynomial_terms(problem.equations, unknowns, len(problem.x))),
        )

    @classmethod
    def of_functions(cls, system: System, mode: str, p: Array, t: float) -> NumericMode:
        """Make it from a system of plain functions f(t, x, p, s) and h(t, x, p)."""
        signs = [{"+": 1.0, "-": -1.0, "0": 0.0}[c] for c in mode]
        on = [i for i, m in enumerate(signs) if m == 0]
        record = system.parameters.record(p)
        n, field = system.dimension, system.field
        assert field is not None

        def full(y: Array) -> Array:
            s = np.array(signs)
            s[on] = y[n:]
            return s

        def h(i: int, y: Array) -> float:
            return float(system.surfaces[i].h(t, y[:n].copy(), record))

        def residual(y: Array) -> Array:
            s = full(y)
            f = np.asarray(field(t, y[:n].copy(), record, s), dtype=float).reshape(n)
            return np.concatenate([f, [h(i, y) for i in on]])

        def limit(i: int, y: Array) -> tuple[float, float]:
            low, high = (
                float(b(t, y[:n].copy(), record) if callable(b) else b) for b in system.surfaces[i].radius
            )
            return low, high

        def bounds(y: Array) -> Array:
            out = []
            for i, (surface, m) in enumerate(zip(system.surfaces, signs, strict=True)):
                if m == 0:
                    low, high = limit(i, y)
                    s = y[n + on.index(i)]
                    out += [s - low, high - s]
                elif surface.kind != "observer":
                    out.append(m * h(i, y) + surface.width)
            return np.array(out)

        strict, of_multipliers = list[bool](), list[bool]()
        for surface, m in zip(system.surfaces, signs, strict=True):
            if m == 0:
                strict += [False, False]
                of_multipliers += [True, True]
            elif surface.kind != "observer":
                strict.append(surface.kind == "switching")
                of_multipliers.append(False)
        taken = {*system.states, *system.parameters.names}
        multipliers = [multiplier_symbol(system, i, len(on) == 1, taken) for i in on]
        return cls(
            mode,
            system.states,
            tuple(system.surfaces[i].name for i in on),
            (*(Symbol(q, real=True) for q in system.states), *multipliers),
            residual,
            bounds,
            tuple(strict),
            tuple(of_multipliers),
            tuple(limit(i, np.zeros(n)) for i in on),
        )


def numeric_equilibria(
    search: NumericMode, ranges: list[tuple[float, float]], clock: Clock
) -> tuple[list[EquilibriumPoint | EquilibriumSet], list[str]]:
    """Return what Newton's method finds from 48 starts in the ranges, and notes on what may be missed."""
    from scipy.stats import qmc

    box = np.array([*ranges, *search.limits])
    n = len(search.x)
    unit = units(box, n)
    cube = 0.003 + 0.99 * qmc.Sobol(len(box), scramble=False).random(64)[:STARTS]
    starts = [box.mean(axis=1), *_inside(box, cube)]
    balanced = _balanced_units(search, box, cube)
    if balanced is None:
        scaled = _dimensionless(search, unit, starts)
    else:
        unit = balanced
        near = np.where(np.arange(len(box))[:, None] < n, np.outer(unit, [-1.0, 1.0]), box)
        scaled = _dimensionless(search, unit, list(_inside(near, cube)), np.inf)
        # A third of the starts are all over the box.
        starts[1:] = [*starts[1::3], *_inside(_range_in_units(box, unit, n), cube)[: STARTS - STARTS // 3]]
    missing = Missing(
        f"mode {search.mode!r} was searched numerically in {_box_text(search, ranges)}; some may be missed."
    )
    found, notes = _searched(scaled, [start / unit for start in starts], box / unit[:, None], clock)
    return [in_units(item, unit) for item in found], [missing, *notes]


def _balanced_units(search: NumericMode, box: Array, cube: Array) -> Array | None:
    """Units by the equations, powers of 2, and 1 of multipliers; None where those of the box are as good."""
    n = len(search.x)
    first = np.maximum(np.max(np.abs(box[:n]), axis=1), TINY) / RANGE
    unit = balanced_units(search.terms, first)
    if not search.terms:
        # Where other powers than the first are larger by far these are seen nearer to 0 only.
        for _ in range(ROUNDS):
            places = list(_inside(_range_in_units(box, unit, n), cube))
            unit = balanced_units(_linear_terms(search, places, unit), unit)
    if not apart(first, units(box, n)[:n], unit):
        return None
    return np.concatenate([2.0 ** np.round(np.log2(unit)), np.ones(len(box) - n)])


def _linear_terms(search: NumericMode, places: list[Array], unit: Array) -> list[Terms]:
    """The sizes of slopes in the states over steps of a unit."""

    def quiet(y: Array) -> Array:
        try:
            with np.errstate(all="ignore"):
                return search.residual(y)
        except (ValueError, ArithmeticError):
            return np.full(len(search.free), np.nan)

    return slope_terms(quiet, places, unit)


def _inside(box: Array, cube: Array) -> Array:
    """Places in a box, from such in the unit cube."""
    return np.asarray(box[:, 0] + cube * (box[:, 1] - box[:, 0]))


def _range_in_units(box: Array, unit: Array, states: int) -> Array:
    """+-10 units of each state, as far as it lies in a range that is not the default one."""
    out = box.copy()
    for k in range(states):
        low, high = -RANGE * unit[k], RANGE * unit[k]
        if tuple(box[k]) != (-RANGE, RANGE):
            low, high = max(low, box[k, 0]), min(high, box[k, 1])
        out[k] = (low, high) if low < high else box[k]
    return out


def _dimensionless(search: NumericMode, unit: Array, places: list[Array], most: float = 1.0) -> NumericMode:
    """The mode with its states in units, each equation and bound over its size at the places."""
    rows, bounds = sizes(search.residual, places, most), sizes(search.bounds, places, most)
    # Multipliers are of order 1 as they are.
    bounds[list(search.of_multipliers)] = 1.0
    parts = search.parts
    return replace(
        search,
        residual=lambda z: search.residual(z * unit) / rows,
        bounds=lambda z: search.bounds(z * unit) / bounds,
        parts=None if parts is None else lambda z: parts(z * unit) / rows,
    )


def _searched(
    search: NumericMode, starts: list[Array], box: Array, clock: Clock
) -> tuple[list[EquilibriumPoint | EquilibriumSet], list[str]]:
    """What is found from the starts, and notes."""
    found: list[EquilibriumPoint | EquilibriumSet] = []
    for y in _zeros(search, starts, clock):
        if any(isinstance(e, EquilibriumSet) and _on(e, search, y) for e in found):
            continue
        jacobian = differences(search.residual, y)
        null = np.zeros((0, len(y)))
        # At the edge of where the field is defined there are no slopes, and no set is looked for.
        if np.all(np.isfinite(jacobian)):
            null = null_space(jacobian)
        if len(null) == 1:
            line = _line(search, y, null[0], box, np.maximum(1.0, np.max(np.abs(jacobian), axis=1)))
            if line is not None:
                found.append(line)
                continue
        point = _point(search, y)
        if point is None:
            continue
        if len(null) > 1 or (len(null) == 1 and _goes_on(search, y, null[0])):
            place = ", ".join(f"{value:.10g}" for value in point.value)
            text = f"({place}) lies on a set of dimension {len(null)}, which is not traced."
            return [*found, point], [f"mode {search.mode!r}: {text}"]
        found.append(point)
    return found, []


def _zeros(search: NumericMode, starts: list[Array], clock: Clock) -> Iterator[Array]:
    """The zeros reached from the starts, in their order, each once.

    Near a multiple zero Newton's method ends anywhere where the equations hold to rounding.
    """
    known: list[tuple[Array, float]] = []
    for start in starts:
        clock.check()
        got = zero(search.residual, start)
        if got is None or not _balanced(search, got[0]):
            continue
        y, length = got
        if not any(_same(y, length, other, reach) for other, reach in known):
            known.append(got)
            yield y


def _same(y: Array, length: float, other: Array, reach: float) -> bool:
    near = np.max(np.abs(y - other)) <= NEIGHBOURHOOD * (length + reach)
    return bool(near) or np.allclose(y, other, rtol=1e-8, atol=1e-11)


def _point(search: NumericMode, y: Array) -> EquilibriumPoint | None:
    g = search.bounds(y)
    edge = np.abs(g) <= EDGE
    if np.any(g < -EDGE) or any(e and s for e, s in zip(edge, search.strict, strict=True)):
        return None
    n = len(search.x)
    kind: PointKind = "pseudo-equilibrium" if search.names else "equilibrium"
    y = np.where(np.abs(y) < 1e-13, 0.0, y)
    return EquilibriumPoint(
        search.mode,
        search.x,
        tuple(_rounded(v) for v in y[:n]),
        tuple(zip(search.names, (_rounded(v) for v in y[n:]), strict=True)),
        tuple(y[:n].tolist()),
        tuple(y[n:].tolist()),
        "boundary equilibrium" if np.any(edge) else kind,
        exact=False,
    )


def _line(search: NumericMode, y: Array, direction: Array, box: Array, rates: Array) -> EquilibriumSet | None:
    """The straight set through y, if the equations hold along it; its ends from the bounds.

    rates: the largest slope of each equation
    """
    n = len(search.x)
    on_s = [n + k for k in range(len(search.names)) if abs(direction[n + k]) > 1e-6]
    lead = on_s[0] if on_s else int(np.argmax(np.abs(direction)))
    slope = direction / direction[lead]
    origin = y - y[lead] * slope
    if not all(_holds(search, origin + c * slope, rates) for c in (-1.0, -0.3, 0.5, 1.0)):
        return None
    g0, g1 = search.bounds(origin), search.bounds(origin + slope)
    low, high = -np.inf, np.inf
    for a, b in zip(g0, g1 - g0, strict=True):
        if abs(b) > 1e-9:
            low, high = (max(low, -a / b), high) if b > 0 else (low, min(high, -a / b))
        elif a < -EDGE:
            return None
    # Small slopes are no set where the equations do not hold at the ends of the range either.
    first, last = max(low, box[lead, 0]), min(high, box[lead, 1])
    if not low < high or not all(_holds(search, origin + c * slope, rates) for c in (first, last)):
        return None
    c = search.free[lead]
    formulas = [_rounded(a) + _rounded(b) * c for a, b in zip(origin, slope, strict=True)]
    formulas[lead] = c
    ends = []
    for end in (low, high) if np.isfinite(low) and np.isfinite(high) else ():
        point = _point(replace(search, strict=(False,) * len(search.strict)), origin + end * slope)
        if point is not None:
            ends.append(point)
    domain = tuple(sympy.oo * s if not np.isfinite(e) else _rounded(e) for e, s in ((low, -1), (high, 1)))
    return EquilibriumSet(
        search.mode,
        search.x,
        tuple(formulas[:n]),
        tuple(zip(search.names, formulas[n:], strict=True)),
        (c,),
        ((domain[0], domain[1]),),
        ((float(low), float(high)),),
        tuple(ends),
        exact=False,
    )


def _goes_on(search: NumericMode, y: Array, direction: Array) -> bool:
    """Whether other zeros lie beside this one along a direction, as on a curve, and not this one alone."""
    for aside in (ASIDE, -ASIDE):
        got = zero(search.residual, y + aside * direction)
        if got is None or not 0.5 * ASIDE <= float(np.linalg.norm(got[0] - y)) <= 2.0 * ASIDE:
            return False
    return True


def _holds(search: NumericMode, y: Array, rates: Array) -> bool:
    left = np.max(np.abs(search.residual(y) / rates))
    return bool(left <= 1e3 * RESIDUAL * (1.0 + np.max(np.abs(y)))) and _balanced(search, y)


def _balanced(search: NumericMode, y: Array) -> bool:
    """Whether the terms of each formula cancel, and are not small alone."""
    if search.parts is None:
        return True
    return bool(np.all(np.abs(search.residual(y)) <= 1e3 * RESIDUAL * search.parts(y) + ALONE))


def absolute_terms(e: sympy.Expr) -> sympy.Expr:
    """The sum of the absolute values of the terms of an expression."""
    if e.is_Add:
        return sympy.Add(*map(absolute_terms, e.args))
    if e.is_Mul:
        return sympy.Mul(*map(absolute_terms, e.args))
    if e.is_Pow and e.exp.is_Integer and e.exp > 0:
        return absolute_terms(e.base) ** e.exp
    return sympy.Abs(e)


def _on(line: EquilibriumSet, search: NumericMode, y: Array) -> bool:
    c = y[search.free.index(line.free[0])]
    place = [float(e) for e in line.at(sympy.Float(c))]
    return bool(np.allclose(place, y[: len(place)], rtol=1e-5, atol=1e-5))


def _rounded(value: Any) -> sympy.Expr:
    """Return a float with 12 digits, and 0 for what is rounding."""
    number = float(value)
    if abs(number) < 1e-11:
        return sympy.S.Zero
    nearest = round(number)
    return sympy.Integer(nearest) if abs(number - nearest) < 1e-11 else sympy.Float(number, DIGITS)


def _limit(expression: sympy.Expr, otherwise: float) -> float:
    return float(expression) if expression.is_number else otherwise


def _box_text(search: NumericMode, ranges: list[tuple[float, float]]) -> str:
    return ", ".join(f"{x} in [{a:g}, {b:g}]" for x, (a, b) in zip(search.x, ranges, strict=True))
