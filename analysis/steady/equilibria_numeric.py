"""Equilibria of one mode by Newton's method from many starts, for plain functions and unsolvable formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Symbol

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.budget import Clock
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, Missing, PointKind
from filippov.analysis.steady.existence import ModeProblem, multiplier_symbol
from filippov.model.system import System

STARTS = 48
RESIDUAL = 1e-9
EDGE = 1e-8
RANK = 1e-7
DIGITS = 12

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class NumericMode:
    """residual(y) = 0 under bounds(y) >= 0, y = (x, s): the states, then a multiplier a sliding surface.

    strict   for each bound, whether it is g > 0
    limits   (lo, hi) of each multiplier, floats
    """

    mode: str
    x: tuple[str, ...]
    names: tuple[str, ...]
    free: tuple[Symbol, ...]
    residual: Callable[[Array], Array]
    bounds: Callable[[Array], Array]
    strict: tuple[bool, ...]
    limits: tuple[tuple[float, float], ...]

    @classmethod
    def of_expressions(cls, problem: ModeProblem) -> NumericMode:
        """Make it from a mode problem without parameters."""
        unknowns = (*problem.x, *problem.sliding)
        f = sympy.lambdify([unknowns], list(problem.equations), "numpy")
        g = sympy.lambdify([unknowns], [b.g for b in problem.bounds], "numpy")

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
            tuple((_limit(low, -1.0), _limit(high, 1.0)) for low, high in problem.limits),
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

        strict: list[bool] = []
        for surface, m in zip(system.surfaces, signs, strict=True):
            if m == 0:
                strict += [False, False]
            elif surface.kind != "observer":
                strict.append(surface.kind == "switching")
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
            tuple(limit(i, np.zeros(n)) for i in on),
        )


def numeric_equilibria(
    search: NumericMode, ranges: list[tuple[float, float]], clock: Clock
) -> tuple[list[EquilibriumPoint | EquilibriumSet], list[str]]:
    """Return what Newton's method finds from 48 starts in the ranges, and notes on what may be missed."""
    from scipy.optimize import least_squares
    from scipy.stats import qmc

    box = np.array([*ranges, *search.limits])
    cube = qmc.Sobol(len(box), scramble=False).random(64)[:STARTS]
    starts = [box.mean(axis=1), *(box[:, 0] + (0.003 + 0.99 * cube) * (box[:, 1] - box[:, 0]))]
    found: list[EquilibriumPoint | EquilibriumSet] = []
    places: list[Array] = []
    where = _box_text(search, ranges)
    notes: list[str] = [
        Missing(f"mode {search.mode!r} was searched numerically in {where}; some may be missed.")
    ]
    for start in starts:
        clock.check()
        try:
            # The rounding level of f decides where differences for the slopes are taken.
            result = least_squares(search.residual, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            continue
        y = result.x
        scale = 1.0 + float(np.max(np.abs(result.jac), initial=0.0))
        if not np.all(np.isfinite(y)) or np.max(np.abs(result.fun)) > RESIDUAL * scale:
            continue
        if any(np.allclose(y, place, rtol=1e-6, atol=1e-7) for place in places):
            continue
        if any(isinstance(e, EquilibriumSet) and _on(e, search, y) for e in found):
            continue
        places.append(y)
        jacobian = _differences(search.residual, y)
        null = np.zeros((0, len(y)))
        # At the edge of where the field is defined there are no slopes, and no set is looked for.
        if np.all(np.isfinite(jacobian)):
            _, sizes, vt = linalg.svd(jacobian)
            null = vt[int(np.sum(sizes > RANK * max(1.0, sizes[0]))) :]
        if len(null) == 1:
            line = _line(search, y, null[0])
            if line is not None:
                found.append(line)
                continue
        point = _point(search, y)
        if point is None:
            continue
        if len(null):
            text = f"{point.value} lies on a set of dimension {len(null)}, which is not traced."
            notes.append(f"mode {search.mode!r}: {text}")
            return [*found, point], notes
        found.append(point)
    return found, notes


def _differences(f: Callable[[Array], Array], y: Array) -> Array:
    columns = []
    for k in range(len(y)):
        step = np.zeros(len(y))
        step[k] = 1e-6 * max(1.0, abs(y[k]))
        columns.append((f(y + step) - f(y - step)) / (2 * step[k]))
    return np.array(columns).T


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


def _line(search: NumericMode, y: Array, direction: Array) -> EquilibriumSet | None:
    """The straight set through y, if the equations hold along it; its ends from the bounds."""
    n = len(search.x)
    on_s = [n + k for k in range(len(search.names)) if abs(direction[n + k]) > 1e-6]
    lead = on_s[0] if on_s else int(np.argmax(np.abs(direction)))
    slope = direction / direction[lead]
    origin = y - y[lead] * slope
    probes = [origin + c * slope for c in (-1.0, -0.3, 0.5, 1.0)]
    if any(np.max(np.abs(search.residual(q))) > 1e3 * RESIDUAL * (1 + np.max(np.abs(q))) for q in probes):
        return None
    g0, g1 = search.bounds(origin), search.bounds(origin + slope)
    low, high = -np.inf, np.inf
    for a, b in zip(g0, g1 - g0, strict=True):
        if abs(b) > 1e-9:
            low, high = (max(low, -a / b), high) if b > 0 else (low, min(high, -a / b))
        elif a < -EDGE:
            return None
    if not low < high:
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
