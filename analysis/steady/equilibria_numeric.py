"""Equilibria of one mode by Newton's method, for plain functions and unsolvable formulas (see `scales`)."""

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
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, PointKind
from filippov.analysis.steady.existence import ModeProblem, multiplier_symbol
from filippov.kernel.derivative.exact import Exact
from filippov.kernel.derivative.overloaded import overloaded
from filippov.model.system import System

# Of the equations, and of the Newton step that is left, relative to what is of order 1; passes of the search.
RESIDUAL, STEP, PASSES = 1e-9, 1e-5, 4
# Steps of Newton's method with exact slopes, whose singular values below EXACT are 0, and of balancing them.
POLISHING, EXACT, BALANCING = 100, 1e-10, 6
# Steps get shorter by this factor at least; towards a zero of multiplicity m it is 1 - 1/m.
FASTER = 0.95
EDGE = 1e-8
RANK = 1e-7
DIGITS = 12

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class NumericMode:
    """residual(y) = 0 under bounds(y) >= 0, y = (x, s): the states, then a multiplier a sliding surface.

    slopes   the derivatives of the equations, or None where these take no dual numbers
    strict   for each bound, whether it is g > 0; of_multipliers: whether it is one of a multiplier
    limits   (lo, hi) of each multiplier, floats
    """

    mode: str
    x: tuple[str, ...]
    names: tuple[str, ...]
    free: tuple[Symbol, ...]
    residual: Callable[[Array], Array]
    slopes: Callable[[Array], Array | None]
    bounds: Callable[[Array], Array]
    strict: tuple[bool, ...]
    of_multipliers: tuple[bool, ...]
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
            _slopes(lambda y: quiet(f, y), overloaded(f)),
            lambda y: quiet(g, y),
            tuple(b.strict for b in problem.bounds),
            tuple(bool(b.g.free_symbols & set(problem.sliding)) for b in problem.bounds),
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

        twin, guards = overloaded(field), [overloaded(system.surfaces[i].h) for i in on]

        def of_dual(y: Any) -> list[Any]:
            s = np.array(signs, dtype=object)
            s[on] = y[n:]
            return [*twin(t, y[:n], record, s), *(h(t, y[:n], record) for h in guards)]

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
            _slopes(residual, of_dual),
            bounds,
            tuple(strict),
            tuple(of_multipliers),
            tuple(limit(i, np.zeros(n)) for i in on),
        )


def searched(
    search: NumericMode, starts: list[Array], clock: Clock
) -> tuple[list[EquilibriumPoint | EquilibriumSet], list[str]]:
    """What Newton's method finds from the starts, and notes; states, equations and bounds are of order 1."""
    found: list[EquilibriumPoint | EquilibriumSet] = []
    places: list[Array] = []
    for start in starts:
        clock.check()
        y = _root(search, start)
        if y is None or any(np.allclose(y, place, rtol=1e-6, atol=1e-7) for place in places):
            continue
        if any(isinstance(e, EquilibriumSet) and _on(e, search, y) for e in found):
            continue
        places.append(y)
        null = _directions(search, y)
        if len(null) == 1:
            line = _line(search, y, null[0])
            if line is not None:
                found.append(line)
                continue
        point = _point(search, y)
        if point is None:
            continue
        if len(null) > 1:
            text = f"{point.value} lies on a set of dimension {len(null)}, which is not traced."
            return [*found, point], [f"mode {search.mode!r}: {text}"]
        found.append(point)
    return found, []


def _root(search: NumericMode, start: Array) -> Array | None:
    """A zero of the equations from a start; None where there is none, as of exp(-x) for large x."""
    from scipy.optimize import least_squares

    y, size, before = start, 1.0, np.inf
    # Newton's method goes on from there where slopes are exact; else the rounding level of f decides where
    # differences for them are taken.
    least = 1e-9 if search.slopes(start) is not None else 1e-15
    for _ in range(PASSES):
        try:
            with np.errstate(all="ignore"):
                result = least_squares(
                    lambda z, size=size: search.residual(z) / size, y, xtol=least, ftol=least, gtol=least,
                    max_nfev=200,
                )  # fmt: skip
        except (ValueError, ArithmeticError, np.linalg.LinAlgError):
            return None
        slopes = size * result.jac
        if not np.all(np.isfinite(result.x)) or not np.all(np.isfinite(slopes)):
            return None
        y, step = _polished(search, result.x, slopes)
        left = float(np.max(np.abs(search.residual(y)), initial=0.0))
        if not left <= RESIDUAL * (1.0 + float(np.max(np.abs(slopes)))):
            return None
        length = float(np.max(np.abs(step)))
        if length <= STEP * (1.0 + float(np.max(np.abs(y)))):
            return y
        if not length <= FASTER * before:
            return None
        before = length
        # A multiple zero: what is left is far below rounding of f at order 1, and has to count as that.
        size = left
    return None


def _polished(search: NumericMode, y: Array, slopes: Array) -> tuple[Array, Array]:
    """Newton's method with exact slopes from near a zero, and the step that is left; slopes: differences."""
    step = linalg.lstsq(slopes, search.residual(y), rcond=RANK)[0]
    before = np.inf
    for _ in range(POLISHING):
        exact = search.slopes(y)
        if exact is None:
            break
        matrix, rows, columns = balanced(exact)
        step = columns * linalg.lstsq(matrix, rows * search.residual(y), rcond=EXACT)[0]
        length = float(np.max(np.abs(step)))
        if not 1e-14 * float(np.max(np.abs(y))) < length < FASTER * before:
            break
        before = length
        if not np.all(np.isfinite(search.residual(y - step))):
            break
        y = y - step
    return y, step


def _directions(search: NumericMode, y: Array) -> Array:
    """Directions along which the equations hold to first order, one a row."""
    exact = search.slopes(y)
    matrix = _differences(search.residual, y) if exact is None else exact
    # At the edge of where the field is defined there are no slopes, and no set is looked for.
    if not np.all(np.isfinite(matrix)):
        return np.zeros((0, len(y)))
    if exact is None:
        _, sizes, vt = linalg.svd(matrix)
        return np.asarray(vt[int(np.sum(sizes > RANK * max(1.0, sizes[0]))) :])
    # States may have units of their own, which make slopes small beside others.
    matrix, _, columns = balanced(exact)
    _, sizes, vt = linalg.svd(matrix)
    return np.asarray(vt[int(np.sum(sizes > EXACT)) :] * columns)


def balanced(matrix: Array) -> tuple[Array, Array, Array]:
    """The matrix with rows and columns over the roots of their largest entries, and the factors of both."""
    rows, columns = np.ones(matrix.shape[0]), np.ones(matrix.shape[1])
    for _ in range(BALANCING):
        now = np.abs(rows[:, None] * matrix * columns)
        for factors, largest in ((rows, now.max(axis=1)), (columns, now.max(axis=0))):
            factors[largest > 0.0] /= np.sqrt(largest[largest > 0.0])
    return rows[:, None] * matrix * columns, rows, columns


def _slopes(
    function: Callable[[Array], Array], twin: Callable[[Any], Any]
) -> Callable[[Array], Array | None]:
    exact = Exact(function, twin)

    def slopes(y: Array) -> Array | None:
        found = exact(y)
        return None if found is None else found[1]

    return slopes


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
        tuple(rounded(v) for v in y[:n]),
        tuple(zip(search.names, (rounded(v) for v in y[n:]), strict=True)),
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
    formulas = [rounded(a) + rounded(b) * c for a, b in zip(origin, slope, strict=True)]
    formulas[lead] = c
    ends = []
    for end in (low, high) if np.isfinite(low) and np.isfinite(high) else ():
        point = _point(replace(search, strict=(False,) * len(search.strict)), origin + end * slope)
        if point is not None:
            ends.append(point)
    domain = tuple(sympy.oo * s if not np.isfinite(e) else rounded(e) for e, s in ((low, -1), (high, 1)))
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


def rounded(value: Any) -> sympy.Expr:
    """Return a float with 12 digits, and 0 for what is rounding."""
    number = float(value)
    if abs(number) < 1e-11:
        return sympy.S.Zero
    nearest = round(number)
    return sympy.Integer(nearest) if abs(number - nearest) < 1e-11 else sympy.Float(number, DIGITS)


def _limit(expression: sympy.Expr, otherwise: float) -> float:
    return float(expression) if expression.is_number else otherwise
