"""Bifurcation diagram of an event map in one parameter: every branch, and the exact places where it changes.

The fixed points of each parameter value are joined into branches. Where two of them disappear together
between two values, the fold is located on the curve of fixed points through one of them, and likewise where
a slope passes -1 (`filippov.analysis.bifurcations.continuation`); where the equilibrium set changes
stability, the root of |slope| = 1 at the set. None is read off the grid of values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from filippov import System, UsageError
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.bifurcations.corrector import FAILURES
from filippov.analysis.diagrams.cell_work import DiagramWork, fixed_points_of
from filippov.analysis.diagrams.diagram import Diagram, DiagramBranch, Special, diagram_labels
from filippov.analysis.diagrams.orbit_diagram import orbit_diagram
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.analysis.maps.map_units import finer
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.set_slope import log_slope
from filippov.analysis.maps.stroboscope import Stroboscope
from filippov.base.given import Amount, Count, Interval, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.solving.state.option_types import Tolerance
from filippov.sweep.run import run

# Points of a curve of fixed points between two neighbouring values.
MOST_POINTS = 100
# Folds that are nearer to each other, in parts of the range of values, are one.
_SAME = 1e-9


@keywords()
def bifurcation(
    system: System,
    section: Section | Stroboscope | None,
    *,
    parameter: str,
    values: Sequence[float],
    interval: Interval | None = None,
    x0: Any = None,
    parameters: Mapping[str, float] | None = None,
    order: Count = 2,
    points: Amount = 400,
    rtol: Positive = 1e-10,
    atol: Tolerance | None = None,
    engine: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Diagram:
    """Fixed points of the order-th iterate of the section's map over values of one parameter.

    interval    of the coordinate that is searched
    x0          in place of an interval, where the section has no parametrisation (None: it is found): a state
                whose solution goes to an orbit, which is followed over the parameter together with the orbits
                that branch off it (see `filippov.analysis.diagrams.orbit_diagram`); order, points, atol and
                engine are then ignored
    points      of the grid on it
    engine      keywords of `filippov.sweep.run.run`, such as {"folder": ..., "jobs": 8, "resume": True}: the
                values are computed by worker processes and kept in the folder; None: in this process
    progress    called with (done, all)

    Raises UsageError, ModelError. Source: Hensen & van de Molengraft 2002, section 5, for such diagrams.
    """
    if parameter not in system.parameters:
        raise UsageError(unknown("parameter", parameter, system.parameters.names))
    if x0 is not None:
        return orbit_diagram(
            system, section, parameter, values, x0, parameters=parameters, rtol=rtol, progress=progress
        )
    if not isinstance(section, Section) or interval is None:
        raise UsageError(
            "bifurcation needs a section with a parametrisation and interval=(lo, hi), or x0=, the state of "
            "a solution that goes to an orbit."
        )
    base = EventMap(system, section, parameters=parameters, order=order, rtol=rtol, atol=atol)
    ordered = sorted(float(v) for v in values)
    found: list[tuple[FixedPoint, ...]] = []
    if engine is not None:
        written = None if atol is None else np.asarray(atol, dtype=float).tolist()
        options = {"order": order, "rtol": rtol, "atol": written}
        unit = system.parameters[parameter].unit
        work = DiagramWork(
            system, section, (parameter,), np.array(ordered)[:, None], interval, points, options,
            dict(parameters or {}), {parameter: unit} if unit else {},
        )  # fmt: skip
        table = run(work, **engine, progress=progress)
        if not table.complete:
            raise KeyboardInterrupt
        table.raise_errors()
        found = fixed_points_of(table)
    for number, value in enumerate(() if found else ordered):
        found.append(base.remake(parameters={parameter: value}).fixed_points(*interval, points))
        if progress is not None:
            progress(number + 1, len(ordered))
    branches = _joined(ordered, found)
    special = [
        *_folds(base, parameter, ordered, found),
        *_set_changes(base, parameter, ordered, found, interval),
    ]
    special += _doublings(base, parameter, branches)
    return Diagram(
        parameter, tuple(ordered), tuple(found), tuple(branches), tuple(special),
        system.parameters.others(parameters, (parameter,)), (float(interval[0]), float(interval[1])), section,
        diagram_labels(system, section, parameter),
    )  # fmt: skip


def _joined(values: Sequence[float], found: Sequence[tuple[FixedPoint, ...]]) -> list[DiagramBranch]:
    """Join points of neighbouring values: same kind, same side of slope 1, nearest coordinate."""
    growing: list[tuple[list[float], list[FixedPoint]]] = []
    done: list[tuple[list[float], list[FixedPoint]]] = []
    for value, points in zip(values, found, strict=True):
        rest = list(points)
        following = []
        for branch in growing:
            last = branch[1][-1]
            fitting = [q for q in rest if q.kind == last.kind and (q.slope > 1.0) == (last.slope > 1.0)]
            if not fitting and last.kind == "equilibrium set":
                fitting = [q for q in rest if q.kind == last.kind]
            if fitting:
                best = min(fitting, key=lambda q: abs(q.d - last.d))
                rest.remove(best)
                branch[0].append(value)
                branch[1].append(best)
                following.append(branch)
            else:
                done.append(branch)
        growing = following + [([value], [q]) for q in rest]
    return [DiagramBranch(tuple(v), tuple(p)) for v, p in done + growing]


def _folds(
    base: EventMap, name: str, values: Sequence[float], found: Sequence[tuple[FixedPoint, ...]]
) -> list[Special]:
    out: list[Special] = []
    width = abs(values[-1] - values[0])
    for i in range(len(values) - 1):
        for one, other in ((i, i + 1), (i + 1, i)):
            for pair in _lost_pairs(found[one], found[other]):
                fold = _first(base, name, values[one], values[other], pair[0].d, "fold")
                if fold is not None and all(abs(fold.value - s.value) > _SAME * width for s in out):
                    left = max(fold.residual, abs(fold.multipliers[0] - 1.0))
                    d = fold.coordinates[base.section.coordinate]
                    out.append(Special("fold", fold.value, d, left, "two limit cycles meet"))
    return out


def _first(base: EventMap, name: str, here: float, there: float, d: float, kind: str) -> BranchPoint | None:
    """The first point of a kind on the curve of fixed points from (here, d) on, before it is `there`."""
    at = finer(base.remake(parameters={name: here}), d, 1e-13)
    bounds = sorted((here, there))
    try:
        run = continuation(
            at.system, (at, d), parameter=name, bounds=(bounds[0], bounds[1]),
            direction=1 if there > here else -1, max_points=MOST_POINTS,
        )  # fmt: skip
        return next((point for point in run if point.special == kind), None)
    except FAILURES:
        return None


def _lost_pairs(
    here: Sequence[FixedPoint], there: Sequence[FixedPoint]
) -> list[tuple[FixedPoint, FixedPoint]]:
    """Neighbouring cycles with slopes on both sides of 1 that the other value has two fewer of."""
    cycles = [q for q in here if q.kind == "limit cycle"]
    missing = len(cycles) - sum(q.kind == "limit cycle" for q in there)
    if missing < 2:
        return []
    pairs = [(a, b) for a, b in pairwise(cycles) if (a.slope > 1.0) != (b.slope > 1.0)]
    return sorted(pairs, key=lambda pair: pair[1].d - pair[0].d)[: missing // 2]


def _set_changes(
    base: EventMap, name: str, values: Sequence[float], found: Sequence[tuple[FixedPoint, ...]],
    interval: tuple[float, float],
) -> list[Special]:  # fmt: skip
    reach = 1e-3 * max(abs(interval[0]), abs(interval[1]))

    def excess(value: float) -> float:
        return log_slope(base, reach, **{name: value})

    out = []
    sets = [next((q for q in points if q.kind == "equilibrium set"), None) for points in found]
    for i in range(len(values) - 1):
        a, b = sets[i], sets[i + 1]
        if a is None or b is None or not np.isfinite(a.slope * b.slope):
            continue
        # One of the values may be the root itself: the next pair of values then finds it, or the last.
        beyond = [abs(q.slope) - 1.0 for q in (a, b)]
        last = i == len(values) - 2
        if beyond[0] * beyond[1] > 0 or (beyond[1] == 0 and not last) or beyond == [0.0, 0.0]:
            continue
        ends = values[i], values[i + 1]
        value = float(brentq(excess, *ends, xtol=1e-12 * abs(ends[1] - ends[0]), rtol=1e-14))
        out.append(Special("set stability change", value, 0.0, abs(excess(value)), "|slope| = 1 at the set"))
    return out


def _doublings(base: EventMap, name: str, branches: Sequence[DiagramBranch]) -> list[Special]:
    """Where the slope of a cycle passes -1: a cycle of twice the period branches off."""
    out = []
    for branch in branches:
        for i in range(len(branch.points) - 1):
            a, b = branch.points[i], branch.points[i + 1]
            if branch.kind != "limit cycle" or (a.slope + 1.0) * (b.slope + 1.0) >= 0:
                continue
            point = _first(base, name, branch.values[i], branch.values[i + 1], a.d, "period doubling")
            if point is not None:
                d, left = point.coordinates[base.section.coordinate], abs(point.multipliers[0] + 1.0)
                out.append(Special("period doubling", point.value, d, left, "slope -1"))
    return out
