"""Limit cycles, their branches, the curve on which they end and the regions they fill."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import sympy

from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.diagrams.regions import Regions, regions
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.steady.rest_map import growth, rest_map, threshold
from filippov.app.report.compute import Subject
from filippov.app.report.effort import Effort
from filippov.app.report.findings import CaseCycles
from filippov.app.report.results import CaseResult

Array = npt.NDArray[np.float64]
Tell = Callable[[float, str], None]
TIGHT = 1e-13
# Longest step along a branch, in units of its size: short enough to be drawn.
LONGEST = 0.04
# Points of the border at which the set changes stability, and of the scan for each.
BORDER, SCAN = 25, 40


def case_cycles(subject: Subject, result: CaseResult) -> tuple[CaseCycles, tuple[Continuation, ...]]:
    """The cycles of one case, and the continuations behind its branches."""
    study = subject.study
    once = result.event_map
    orbits = tuple(
        find_orbit(
            subject.system, once.bound.start(np.array([q.d]), once.p)[0],
            symmetry=study.questions.symmetry, parameters=result.parameters,
        )
        for q in result.cycles
    )  # fmt: skip
    runs = _runs(subject, result, 1e-12)
    tight = _runs(subject, result, TIGHT)
    at = tuple((value, tuple(p for run in runs for p in run.at(value))) for value in study.values)
    pairs = [
        (_place(p), _place(q))
        for value, points in at
        for p, q in zip(points, [p for run in tight for p in run.at(value)], strict=True)
    ]
    for one, other in zip(runs, tight, strict=True):
        special = zip(one.branch.special, other.branch.special, strict=True)
        pairs += [(a.value, b.value) for a, b in special]
    spread = max((abs(a - b) / abs(b) for a, b in pairs), default=0.0)
    branches = tuple(run.branch for run in runs)
    return CaseCycles(result.case.key, orbits, branches, at, spread, len(pairs)), runs


def _place(point: BranchPoint) -> float:
    """The first coordinate."""
    return float(next(iter(point.coordinates.values())))


def _runs(subject: Subject, result: CaseResult, rtol: float) -> tuple[Continuation, ...]:
    """Branches through all cycles of the case, from the largest down; one that was met is not begun again."""
    study = subject.study
    power = result.power.remake(rtol=rtol, atol=1e-2 * rtol)
    own, bounds = power.parameters[study.parameter], (study.values[0], study.values[-1])
    out: list[Continuation] = []
    met: list[float] = []
    for q in sorted(result.cycles, key=lambda q: -q.d):
        if any(abs(q.d - d) < 1e-6 * q.d for d in met):
            continue
        way = 1 if own <= bounds[0] else -1 if own >= bounds[1] else 0
        run = continuation(
            subject.system, (power, q.d), parameter=study.parameter, bounds=bounds, direction=way,
            max_step=LONGEST,
        )  # fmt: skip
        run.run()
        met += [_place(p) for p in run.at(own)]
        out.append(run)
    return tuple(out)


def end_curve(subject: Subject, runs: tuple[Continuation, ...]) -> Branch | None:
    """The curve of the first fold over the second parameter; None where none is asked or there is no fold."""
    asked = subject.study.questions.ending
    return None if asked is None else _fold_curve(runs, asked.parameter, asked.bounds)


def _fold_curve(
    runs: tuple[Continuation, ...], parameter: str, bounds: tuple[float, float], direction: int | None = None
) -> Branch | None:
    run = next((run for run in runs if run.branch.folds), None)
    if run is None:
        return None
    own = run.branch.parameters[parameter]
    way = direction or (-1 if own >= bounds[1] else 1)
    return curve(run, run.branch.folds[0], parameter=parameter, bounds=bounds, direction=way).run()


def region_map(
    subject: Subject, result: CaseResult, runs: tuple[Continuation, ...], effort: Effort, tell: Tell
) -> Regions | None:
    """Cells over two parameters with their exact borders: the fold, and where the set changes stability."""
    asked, study = subject.study.questions.plane, subject.study
    if asked is None:
        return None
    halves = [_fold_curve(runs, asked.parameter, asked.up, way) for way in (-1, 1)]
    rows = [
        np.column_stack([half.coordinate(study.parameter), half.values])[::way]
        for half, way in zip(halves, (-1, 1), strict=True) if half is not None
    ]  # fmt: skip
    borders: list[tuple[str, Array]] = []
    if rows:
        borders.append(("fold of the two cycles", np.vstack(rows)))
    change = _change(result, study.parameter, asked.parameter, asked.across, asked.up)
    if change is not None:
        borders.append(("set changes stability", change))
    across, up = effort.cells
    return regions(
        subject.system, subject.section,
        (study.parameter, np.linspace(*asked.across, across).tolist()),
        (asked.parameter, np.linspace(*asked.up, up).tolist()), subject.interval,
        parameters=result.case.parameters, order=study.order, points=32, borders=borders,
        progress=lambda done, total: tell(done / total, f"cells over {study.parameter}, {asked.parameter}"),
    )  # fmt: skip


def _change(
    result: CaseResult, across: str, up: str, low_high: tuple[float, float], span: tuple[float, float]
) -> Array | None:
    """Points (across, up) where the linearised return map of the set has modulus 1; None without one."""
    polynomials = [
        case.polynomial
        for item in result.stability.items
        for case in item.cases
        if case.applies and case.polynomial is not None
    ]
    if not polynomials:
        return None
    used = sorted({s for row in polynomials for c in row for s in c.free_symbols}, key=str)
    coefficients = sympy.lambdify(used, [list(row) for row in polynomials], "math")

    def measure(x: float, y: float) -> float:
        values = {**result.parameters, across: x, up: y}
        return growth([rest_map(row) for row in coefficients(*(values[s.name] for s in used))])

    border = [
        (x, y)
        for y in np.linspace(*span, BORDER).tolist()
        for x in threshold(lambda x, y=y: measure(x, y), *low_high, points=SCAN)  # type: ignore[misc]
    ]
    return np.array(border) if border else None
