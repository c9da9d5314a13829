"""The end of a branch of cycles that shrink into an equilibrium: Hopf, pseudo-Hopf, or boundary equilibrium.

Beyond a Hopf point the equations of the orbit go on with the same cycles, begun half a period later: the
state that they are solved for passes through the equilibrium to the other side. At a boundary equilibrium
the size falls in proportion to the distance in the parameter, and so do all states less the equilibrium; at
a pseudo-Hopf point, two folds that collide, by its root, and the period with it. The orbit nearer to the
end is guessed from that and solved for, which confirms it.
Source: Kuznetsov 2004, section 3.4; di Bernardo et al. 2008, section 5.4.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import by_multipliers
from filippov.analysis.bifurcations.branch import LOCATED, BranchPoint
from filippov.analysis.bifurcations.branch_problem import OrbitProblem
from filippov.analysis.bifurcations.corrector import FAILURES, Along, Corrector
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem, is_kink
from filippov.base.arrays import Array

SHRINKS = "cycle shrinks into an equilibrium"
_OPPOSITE, _DOUBLINGS = -0.5, 14
# In units of the orbit's size at the start: when an end is asked for, also where the modes change or not.
_SMALL, _TINY = 0.5, 0.01
_NEAR, _PARTS, _ITERATIONS = 4.0, (0.1, 0.3), 12


def cycle_end(a: Along, b: Along, bounds: tuple[float, float]) -> BranchPoint | None:
    """The end between two orbits of one branch, or next to the second one; None where there is none."""
    problem = a.corrector.problem
    if not isinstance(problem, OrbitProblem) or problem.shooting.period is not None:
        return None
    if len(a.u) != len(b.u) or len(problem.shooting.shares) != 1:
        return None
    names = problem.shooting.system.states
    (first, here), (second, there) = (_out(at.point, at.u, names) for at in (a, b))
    weight = 1.0 / np.maximum(here + there, 1e-12 * np.max(here + there))
    first, second = first * weight, second * weight
    flips = first @ second < _OPPOSITE * float(np.linalg.norm(first) * np.linalg.norm(second))
    before, after = (float(np.max(part / problem.scale[: len(names)])) for part in (here, there))
    if len(a.point.modes) == 1 and a.point.modes == b.point.modes:
        found = _hopf(problem, a, b, bounds) if flips or after < min(before, _TINY) else None
        # The square of the size falls in proportion to the distance from the end.
        falls = found is not None and not flips and abs(found.value - b.point.value) < _NEAR * abs(
            (b.point.value - a.point.value) * after**2 / (before**2 - after**2)
        )  # fmt: skip
        return found if flips or falls else None
    changes = flips or a.point.word != b.point.word
    if after < min(before, _TINY) or (changes and before < _SMALL):
        return _boundary(problem, a, b, bounds) or _pseudo_hopf(problem, a, b, bounds)
    return None


def _out(point: BranchPoint, u: Array, names: tuple[str, ...]) -> tuple[Array, Array]:
    """The state that is solved for, relative to the middle of the orbit, and half the orbit's size."""
    low, high = (np.array([point.coordinates[f"{end} {name}"] for name in names]) for end in ("min", "max"))
    return u[: len(names)] - 0.5 * (low + high), 0.5 * (high - low)


def _rest(problem: OrbitProblem, at: Along, mode: str) -> EquilibriumProblem:
    """The equilibria of a mode, begun in the middle of an orbit."""
    system = problem.shooting.system
    values = dict(zip(system.parameters.names, problem.base.tolist(), strict=True))
    signs = tuple({"+": 1, "0": 0, "-": -1}[sign] for sign in mode) if system.surfaces else ()
    n = system.dimension
    middle = at.u[:n] - _out(at.point, at.u, system.states)[0]
    rest = EquilibriumProblem(system, signs, problem.parameter, middle, values)
    if not rest.sliding:
        return rest
    # The multipliers with which the field is least there: from others a search may go far.
    residual, matrix = rest.evaluate(rest.start, at.point.value)
    balance = linalg.lstsq(matrix[:n, n:-1], -residual[:n], rcond=None)[0]
    return EquilibriumProblem(system, signs, problem.parameter, middle, values, balance)


def _hopf(problem: OrbitProblem, a: Along, b: Along, bounds: tuple[float, float]) -> BranchPoint | None:
    names = problem.shooting.system.states
    rest = Corrector(_rest(problem, a, a.point.modes[0]), bounds[1] - bounds[0])
    rate = 4.0 * np.pi / (a.point.period + b.point.period)

    def pair(value: float) -> complex:
        found = np.array(rest.fixed(rest.problem.start, value).multipliers)
        return complex(found[np.argmin(np.abs(found - 1j * rate))])

    at = _root(lambda value: pair(value).real, a, b, bounds)
    if at is None:
        return None
    point, root = rest.fixed(rest.problem.start, at), pair(at)
    others = [v for v in point.multipliers if min(abs(v - root), abs(v - root.conjugate())) > 1e-9]
    period = 2 * np.pi / abs(root.imag)
    left = (1.0 + 0j, *(complex(np.exp(v * period)) for v in others))
    place = np.array([point.coordinates[name] for name in names])
    return _ended(at, place, period, left, a.point, names, "a Hopf point of the equilibrium")


def _root(test: Callable[[float], float], a: Along, b: Along, bounds: tuple[float, float]) -> float | None:
    """The value of the parameter around two orbits at which a test of the equilibrium is 0.

    A step may lead far beyond the end, where there is no equilibrium: it is looked for next to the first too.
    """
    least = 1e-6 * (bounds[1] - bounds[0])
    for begin in ((a.point.value, b.point.value), (a.point.value,)):
        low, high = min(begin), max(begin)
        reach = max(high - low, least)
        try:
            for _ in range(_DOUBLINGS):
                low, high = max(low - reach, bounds[0]), min(high + reach, bounds[1])
                if test(low) * test(high) < 0:
                    return float(brentq(test, low, high, xtol=1e-14, rtol=1e-14))
                reach *= 2.0
        except FAILURES:
            continue
    return None


def _boundary(problem: OrbitProblem, a: Along, b: Along, bounds: tuple[float, float]) -> BranchPoint | None:
    system, n = problem.shooting.system, problem.shooting.system.dimension
    _, half = _out(a.point, a.u, system.states)
    for mode in (mode for mode in a.point.modes if "0" not in mode):
        rest = _rest(problem, a, mode)
        for i, surface in enumerate(system.surfaces):
            found = _meets(rest, i, a.point.value) if surface.kind != "observer" else None
            if found is None:
                continue
            place, value = found[:n], float(found[n])
            ahead = (value - a.point.value) * (b.point.value - a.point.value) > 0
            if not ahead or not bounds[0] <= value <= bounds[1]:
                continue
            if np.any(np.abs(place - rest.start[:n]) > _NEAR * np.max(half)):
                continue
            if _confirmed(problem, a, place, value):
                note = f"a boundary equilibrium of mode {mode} on {surface.name!r}"
                return _ended(value, place, a.point.period, a.point.multipliers, a.point, system.states, note)
    return None


def _pseudo_hopf(
    problem: OrbitProblem, a: Along, b: Along, bounds: tuple[float, float]
) -> BranchPoint | None:
    system = problem.shooting.system
    n, modes = system.dimension, set(a.point.modes)
    if len(modes) != 2 or any("0" in mode for mode in modes):
        return None
    changed = [i for i, signs in enumerate(zip(*modes, strict=True)) if len(set(signs)) == 2]
    if len(changed) != 1:
        return None
    (i,), (mode, _) = changed, sorted(modes)
    if is_kink(system, i):
        return None
    rest = Corrector(_rest(problem, a, f"{mode[:i]}0{mode[i + 1 :]}"), bounds[1] - bounds[0])
    value = _root(lambda at: rest.fixed(rest.problem.start, at).tests["pseudo-Hopf"], a, b, bounds)
    if value is None:
        return None
    place = np.array(rest.fixed(rest.problem.start, value).u[:n])
    if not _confirmed(problem, a, place, value, rest.problem.gradient(i, place, value)):
        return None
    note = f"a pseudo-Hopf point: two folds collide on {system.surfaces[i].name!r}"
    return _ended(value, place, 0.0, a.point.multipliers, a.point, system.states, note)


def _meets(rest: EquilibriumProblem, i: int, value: float) -> Array | None:
    """(x, parameter) with f = 0 in the mode and h_i = 0, by Newton's method."""
    n = rest.system.dimension
    z = np.append(rest.start[:n], value)
    try:
        for _ in range(_ITERATIONS):
            residual, matrix = rest.evaluate(z[:n], float(z[n]))
            at = (np.zeros(1), z[None, :n], np.array(rest.mode, dtype=float)[None, :], rest.p(float(z[n])))
            h, slope = rest.field.part("h", *at)[0, i, 0], rest.field.part("hy", *at)[0, i, : n + 1]
            change = linalg.solve(np.vstack([matrix, slope]), -np.append(residual, h))
            z = z + change
            if np.max(np.abs(change)) < 1e-12 * (1.0 + np.max(np.abs(z))):
                return np.asarray(z)
    except FAILURES:
        return None
    return None


def _confirmed(
    problem: OrbitProblem, a: Along, place: Array, value: float, normal: Array | None = None
) -> bool:
    """Whether an orbit of the same modes, smaller in proportion, lies nearer to the end.

    normal   of the surface at two folds: across it, and in the parameter, the square of the size counts; the
             period goes as the size
    """
    return any(_smaller(problem, a, place, value, normal, part) for part in _PARTS)


def _smaller(
    problem: OrbitProblem, a: Along, place: Array, value: float, normal: Array | None, part: float
) -> bool:
    """Whether the orbit of a part of the size is there; what its guess leaves out counts less for large
    parts."""
    n, out = len(place), a.u[: len(place)] - place
    guess, at = a.u.copy(), value + part * (a.point.value - value)
    if normal is not None:
        guess, at = part * a.u, value + part**2 * (a.point.value - value)
        out = out - (1.0 - part) * normal * (normal @ out) / float(normal @ normal)
    guess[:n] = place + part * out
    try:
        point = Corrector(problem.moved(guess, at), a.corrector.width).fixed(guess, at)
    except FAILURES:
        return False
    names = problem.shooting.system.states
    small, large = (float(np.max(_out(p, u, names)[1])) for p, u in ((point, guess), (a.point, a.u)))
    return point.word == a.point.word and 0.5 * part < small / large < 2.0 * part


def _ended(
    value: float, place: Array, period: float, multipliers: tuple[complex, ...], last: BranchPoint,
    names: tuple[str, ...], note: str,
) -> BranchPoint:  # fmt: skip
    data = {"period": period}
    for name, at in zip(names, place.tolist(), strict=True):
        data |= {f"max {name}": at, f"min {name}": at, f"amplitude {name}": 0.0}
    return BranchPoint(
        value, (float("-inf"),), data, multipliers, by_multipliers(multipliers, LOCATED), last.word,
        last.modes, period, special=SHRINKS, note=note,
    )  # fmt: skip
