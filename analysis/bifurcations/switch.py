"""To another branch at a special point: the other one at a branch point, the doubled orbit at a period
doubling, the pair without the symmetry at a symmetry breaking.

In equations for the orbit of twice the length (without the symmetry) a period doubling (symmetry breaking) is
a branch point as well, so one construction serves all. At a branch point F_z has two null vectors; tangents
of the branches are those combinations t of them with e . F_zz t t = 0, e the left null vector (Seydel 2010;
Govaerts 2000).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.branch_problem import MapProblem, OrbitProblem
from filippov.analysis.bifurcations.continuation import Continuation
from filippov.analysis.bifurcations.corrector import Along, Corrector
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import Count, Interval, Positive
from filippov.base.keywords import keywords

SWITCHES = ("branch point", "period doubling", "symmetry breaking")
_REACH, _SINGULAR, _NOISE, _FLAT = 1e-4, 1e-3, 1e-6, 1e-4


@keywords()
def switch(
    run: Continuation,
    special: BranchPoint,
    *,
    bounds: Interval | None = None,
    direction: int = 0,
    step: Positive = 0.02,
    min_step: Positive = 1e-8,
    max_step: Positive = 0.1,
    max_points: Count = 500,
    max_time: Positive = float("inf"),
) -> Continuation:
    """The branch that leaves the one of `run` at a special point, not begun: iterate over it, or `run()` it.

    run        the continuation that found the point (its problem is used)
    special    a branch point, period doubling or symmetry breaking
    bounds     of the parameter, by default those of `run`
    direction  +1 or -1: only one of the two halves that meet there, the one of larger or smaller values (of
               the first unknown that changes, where both go the same way); 0: both

    The other options are those of `continuation`. The first point is `special`. Raises UsageError for any
    other point, NoConvergenceError where the branches cannot be separated.
    """
    if special.special not in SWITCHES:
        known = ", ".join(SWITCHES)
        what = repr(special.special) if special.special else "an ordinary point"
        raise UsageError(f"no other branch leaves at {what}; one does at: {known}.")
    low, high = (float(v) for v in (run.bounds if bounds is None else bounds))
    if not low <= special.value <= high:
        raise UsageError(f"the special point at {special.value:g} is outside bounds ({low:g}, {high:g}).")
    if direction not in (-1, 0, 1):
        raise UsageError(f"direction is {direction!r}, expected -1, 0 or 1.")
    u, tangent = np.array(special.u), np.array(special.tangent) * np.append(run.problem.scale, run.width)
    problem: Any = run.problem
    if isinstance(problem, OrbitProblem) and special.phase:
        problem = problem.at_phase(special.phase)
    if isinstance(problem, EquilibriumProblem):
        problem = problem.in_mode(special.modes[0], u)
    elif special.special != "branch point":
        problem, u, tangent = _doubled(problem, u, tangent)
    problem = problem.moved(u, special.value)
    corrector = Corrector(problem, high - low)
    z = corrector.scaled(u, special.value)
    other = _other(corrector, z, tangent / corrector.sizes)
    point = problem.point(*corrector.plain(z))
    point = replace(point, tests={}, note="branches meet").named(special.special, problem.kind)
    branch = Branch(run.branch.parameter, run.branch.kind, dict(run.branch.parameters))
    out = Continuation(problem, special.value, (low, high), branch, direction, step)
    out.min_step, out.max_step, out.max_points, out.max_time = min_step, max_step, max_points, max_time
    out.begin_at(Along(corrector, z, other, replace(point, tangent=tuple(other.tolist()))))
    return out


def _doubled(problem: Any, u: Array, tangent: Array) -> tuple[Any, Array, Array]:
    """The equations of the orbit of twice the length or without the symmetry, its unknowns, the tangent."""
    if not isinstance(problem, MapProblem | OrbitProblem):
        raise UsageError("a period doubles for maps and orbits.")
    u, tangent = u.copy(), tangent.copy()
    shooting = problem.shooting if isinstance(problem, OrbitProblem) else None
    if shooting is not None and shooting.period is None and shooting.symmetry_order == 1:
        u[-1], tangent[-2] = 2 * u[-1], 2 * tangent[-2]
    return problem.doubled(), u, tangent


def _other(corrector: Corrector, z: Array, tangent: Array) -> Array:
    """The tangent of the other branch at a branch point. Raises NoConvergenceError."""
    matrix = corrector.equations(z)[1]
    left, sizes, rows = linalg.svd(matrix)
    if sizes[-1] > _SINGULAR * max(1.0, float(sizes[0])) or (len(sizes) > 1 and sizes[-2] < 10 * sizes[-1]):
        raise NoConvergenceError("no second branch of its own meets the branch there.")
    e, plane = left[:, -1], rows[-2:]
    changes = [corrector.equations(z + side * _REACH * v)[1] for v in plane for side in (1.0, -1.0)]
    form = np.array([e @ (changes[2 * k] - changes[2 * k + 1]) @ plane.T for k in (0, 1)]) / (2 * _REACH)
    form = 0.5 * (form + form.T)
    values, vectors = linalg.eigh(form)
    if not values[0] < 0 < values[1] or -values[0] * values[1] < (_NOISE * np.max(np.abs(values))) ** 2:
        raise NoConvergenceError("the branches touch there, with one tangent: they cannot be told apart.")
    # t . form t = 0 for t = sqrt(l1) v0 +- sqrt(-l0) v1.
    pair = [np.sqrt(values[1]) * vectors[:, 0] + s * np.sqrt(-values[0]) * vectors[:, 1] for s in (1, -1)]
    found = [(plane.T @ v) / np.linalg.norm(v) for v in pair]
    other = min(found, key=lambda v: abs(float(v @ tangent)))
    # A vanishing component along the parameter is rounding: a pitchfork.
    lead = other[-1] if abs(other[-1]) > _FLAT else next(v for v in other if abs(v) > _FLAT)
    return np.asarray(other if lead > 0 else -other)
