"""The cycles of a smoother model of the same system, followed over the study's parameter."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.app.report.compute import Subject
from filippov.app.report.effort import Effort
from filippov.app.report.findings import RelativeCase
from filippov.app.report.results import CaseResult
from filippov.base.errors import SolveError
from filippov.model.system import System
from filippov.models.questions import Relative
from filippov.solving.solution import Solution
from filippov.solving.solver import solve

Tell = Callable[[float, str], None]
RTOL, MOST = 1e-9, 400


def relative_cases(
    subject: Subject, results: Sequence[CaseResult], effort: Effort, tell: Tell
) -> tuple[RelativeCase, ...]:
    """Its branch in every case; () where no such model is asked."""
    asked = subject.study.questions.relative
    if asked is None:
        return ()
    chosen, system = results[: effort.relatives], asked.build()
    out = []
    for k, result in enumerate(chosen):
        label = f"{asked.name}, {result.case.label}"

        def within(point: int, k: int = k, label: str = label) -> None:
            tell((k + min(point / 150, 1.0)) / len(chosen), f"{label}: {point} points")

        out.append(_case(subject, asked, system, result, effort, within))
    return tuple(out)


def _case(
    subject: Subject, asked: Relative, system: System, result: CaseResult, effort: Effort,
    tell: Callable[[int], None],
) -> RelativeCase:  # fmt: skip
    study = subject.study
    low, high = study.values[0], study.values[-1]
    own = {k: v for k, v in result.parameters.items() if k in system.parameters}
    orbit = _orbit(subject, system, own, asked.x0)
    branch = _branch(subject, system, orbit, study.parameter, (low, high), effort.follow, tell)
    beyond = None
    if not branch.folds and effort.relatives is None:
        value, x0 = asked.beyond
        far = _orbit(subject, system, {**own, study.parameter: value}, x0)
        beyond = _branch(subject, system, far, study.parameter, (value, max(study.beyond)), 1, tell)
    small = tuple(
        (start, _rests(asked, system, own, start), abs(float(result.event_map(start))) / start)
        for start in asked.small
    )
    return RelativeCase(result.case.key, branch, beyond, small)


def _orbit(
    subject: Subject, system: System, values: dict[str, float], x0: Sequence[float]
) -> Orbit:
    """The orbit that a motion goes to."""
    asked = subject.study.questions.relative
    assert asked is not None
    run = _motion(asked, system, values, x0, asked.transient)
    return find_orbit(
        system, run.x_end, symmetry=subject.study.questions.symmetry, method=asked.method, rtol=RTOL,
        atol=1e-2 * RTOL, parameters=values,
    )  # fmt: skip


def _branch(
    subject: Subject, system: System, orbit: Orbit, parameter: str, bounds: tuple[float, float], follow: int,
    tell: Callable[[int], None],
) -> Branch:  # fmt: skip
    """The branch to larger values, until so many points after its first fold.

    In legs: steps are in units of the orbit at a leg's start, so one begins where the word has changed and
    where the orbit has become half as large.
    """
    whole: Branch | None = None
    while True:
        run = continuation(
            system, orbit, parameter=parameter, bounds=bounds, direction=1, step=0.15, max_step=1.0,
            max_points=MOST,
        )  # fmt: skip
        whole = whole or Branch(parameter, run.branch.kind, run.branch.parameters)
        last = _leg(run, system, whole, follow, tell)
        whole.message = run.branch.message
        if last is None:
            return whole
        values = {**orbit.parameters, parameter: last.value}
        orbit = _orbit(subject, system, values, last.u[: system.dimension])


def _leg(
    run: Continuation, system: System, whole: Branch, follow: int, tell: Callable[[int], None]
) -> BranchPoint | None:
    """Append the points of one leg; the point at which the next one begins, None after the last."""
    size = f"amplitude {system.states[0]}"
    first, changed, begun = None, False, bool(whole.points)
    for point in run:
        if first is None:
            first = point.coordinates[size]
            if begun:
                continue
        whole.points.append(point)
        tell(len(whole.points))
        if whole.folds:
            if len(whole.points) - whole.points.index(whole.folds[0]) > follow:
                return None
        elif point.special:
            changed = True
        elif changed or point.coordinates[size] < 0.5 * first:
            return point
    return None


def _rests(asked: Relative, system: System, values: dict[str, float], start: float) -> bool:
    """Whether a motion from near rest is at rest in the last tenth of the time it is given."""
    run = _motion(asked, system, values, (start, *(0.0 for _ in system.states[1:])), asked.settle)
    assert run.sol is not None
    speed = run.sol(np.linspace(0.9 * asked.settle, asked.settle, 2001))[1]
    return bool(np.max(np.abs(speed)) < asked.threshold)


def _motion(
    asked: Relative, system: System, values: dict[str, float], x0: Sequence[float], time: float
) -> Solution:
    run = solve(system, x0, (0.0, time), parameters=values, method=asked.method, rtol=1e-8, atol=1e-10)
    if not run.success:
        raise SolveError(f"the motion of {asked.name} ended early: {run.message}", run)
    return run
