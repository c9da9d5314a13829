"""The computations of one case of a study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from filippov.analysis.diagrams.bifurcation import Diagram, bifurcation
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.app.report.effort import Effort
from filippov.app.report.independent import Orbits
from filippov.app.report.results import Agreement, CaseResult, Exactness, Samples
from filippov.base.errors import SolveError, UsageError
from filippov.graphs.graph import observed_graph
from filippov.graphs.word import mode_word
from filippov.model.system import System
from filippov.models.registry import Model
from filippov.models.studies import Study, StudyCase
from filippov.solving.solution import Solution
from filippov.solving.solver import solve
from filippov.solving.state.machine import Machine

Array = npt.NDArray[np.float64]
Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class Subject:
    """What a study is about: its model's system and section."""

    study: Study
    model: Model
    system: System
    section: Section
    interval: tuple[float, float]

    @classmethod
    def of(cls, study: Study, model: Model) -> Subject:
        """The subject of a study; UsageError for a model without a section."""
        section, data = Section.from_model(model), model.section
        assert data is not None
        return cls(study, model, model.build(), section, data.interval)

    def event_map(self, case: StudyCase) -> EventMap:
        """The map of a case."""
        return EventMap(self.system, self.section, parameters=case.parameters)


def case_result(
    subject: Subject, case: StudyCase, effort: Effort, tell: Tell, timing: dict[str, float], clock: Any
) -> CaseResult:
    """Compute one case; `tell` gets the fraction done, `timing` the seconds a stage."""
    study, system = subject.study, subject.system

    def stage(name: str, fraction: float, work: Callable[[], Any]) -> Any:
        tell(fraction, f"{case.label}: {name}")
        since = clock()
        out = work()
        timing[f"{name}, {case.label}"] = clock() - since
        return out

    once = subject.event_map(case)
    power = once.power(study.order)
    solution = stage(
        "time response", 0.0,
        lambda: solve(system, study.x0, study.t_span, parameters=case.parameters, rtol=1e-10, atol=1e-12),
    )  # fmt: skip
    if not solution.success:
        raise SolveError(f"the time response of {case.label} ended early: {solution.message}", solution)
    low, high = subject.interval
    wide = stage("event map", 0.05, lambda: _sample(once, low, high, effort.samples))
    small = _sample(once, low, case.small, effort.samples)
    fixed = stage("fixed points", 0.1, lambda: power.fixed_points(low, high, effort.points))
    basins = stage("basins", 0.15, lambda: power.basins(low, high, effort.points))
    jumps = stage("jumps", 0.2, lambda: once.jumps(low, high, effort.points))

    def diagram(values: tuple[float, ...], start: float, share: float) -> Diagram:
        return bifurcation(
            system, subject.section, parameter=study.parameter, values=values, interval=subject.interval,
            parameters=case.parameters, order=study.order, points=effort.points,
            progress=lambda done, total: tell(start + share * done / total, f"{case.label}: bifurcation"),
        )  # fmt: skip

    main = stage("bifurcation", 0.25, lambda: diagram(_every(study.values, effort.stride), 0.25, 0.3))
    beyond = stage("bifurcation beyond", 0.55, lambda: diagram(study.beyond, 0.55, 0.05))
    report = stage(
        "stability", 0.6, lambda: stability_report(system, case.parameters, solve_for=study.parameter)
    )
    agreements = stage("independent checks", 0.7, lambda: _agreements(study, case, power, fixed, effort))
    orbit = _orbit(subject, once, solution)
    return CaseResult(
        case, once.parameters, study.curve(case.parameters), solution,
        exactness(subject, solution, orbit), orbit, once, power, wide, small, fixed, basins, jumps, main,
        beyond, report, agreements, observed_graph(solution), mode_word(solution, study.mode_names),
    )  # fmt: skip


def _every(values: tuple[float, ...], stride: int) -> tuple[float, ...]:
    return tuple(dict.fromkeys([*values[::stride], values[-1]]))


def _sample(once: EventMap, low: float, high: float, count: int) -> Samples:
    """Coordinates evenly, and crowding at 0, where a map may be steep."""
    d = np.linspace(low, high, count)
    if low == 0.0:
        d = np.unique(np.concatenate([d, np.geomspace(1e-8 * high, high, count)]))
    return Samples(d, np.asarray(once(d), dtype=float), np.asarray(once.power(2)(d), dtype=float))


def _rests(subject: Subject, solution: Solution) -> Array:
    """The section's coordinate at each of its events along the response."""
    events = solution.events.of(subject.section.surface, subject.section.kind)
    index = subject.system.state_index(subject.section.coordinate)
    return np.array([event.x[index] for event in events])


def _orbit(subject: Subject, once: EventMap, solution: Solution) -> Array:
    """Iterates of the map from the first rest of the response, as many as it has."""
    rests = _rests(subject, solution)
    return once.iterate(float(rests[0]), len(rests) - 1) if len(rests) else np.zeros(0)


def exactness(subject: Subject, solution: Solution, orbit: Array) -> Exactness:
    """Measure what should be exact along the response."""
    place = subject.system.surface_index(subject.section.surface)
    heights = _heights(subject.system, solution, place)
    height, spreads = 0.0, dict.fromkeys((i.name for i in subject.model.invariants), 0.0)
    record = subject.system.parameters.record(solution.problem.p)
    for segment in solution.segments:
        if segment.mode[place] != 0:
            continue
        t = np.linspace(segment.t0, segment.t1, 20)
        x = np.column_stack([solution.sol(t[:1], side="+"), solution.sol(t[1:])]) if solution.sol else None
        assert x is not None
        height = max(height, float(np.max(np.abs(heights(t, x)))))
        for invariant in subject.model.invariants:
            values = [invariant.function(float(a), b, record) for a, b in zip(t, x.T, strict=True)]
            spreads[invariant.name] = max(spreads[invariant.name], max(values) - min(values))
    rests = _rests(subject, solution)
    apart = float(np.max(np.abs(rests - orbit))) if len(rests) else float("nan")
    return Exactness(height, spreads, apart, len(rests))


def _heights(system: System, solution: Solution, place: int) -> Callable[[Array, Array], Array]:
    """h of one surface at times and states (n, k)."""
    machine = Machine(system, solution.options.method, solution.problem.p, sliding=solution.options.sliding)
    mode = np.zeros(len(system.surfaces))

    def values(t: Array, x: Array) -> Array:
        rows = np.ascontiguousarray(x.T)
        return np.array([machine.guards(float(a), row, mode)[place] for a, row in zip(t, rows, strict=True)])

    return values


def _agreements(
    study: Study, case: StudyCase, power: EventMap, fixed: Any, effort: Effort
) -> tuple[Agreement, ...]:
    """Every cycle by two tolerances of the solver and by two independent methods."""
    out = []
    cycles = [q for q in fixed if q.kind == "limit cycle"]
    stated = [s for s in study.stated_points.get(case.key, ()) if s.kind == "limit cycle"]
    try:
        orbits: Orbits | None = Orbits(power.remake(order=1))
    except UsageError:
        orbits = None
    for k, cycle in enumerate(cycles):
        values: dict[str, float] = {}
        for rtol in effort.tolerances:
            values[f"event map, rtol {rtol:g}"] = _polished(power, cycle.d, rtol)
        if orbits is not None:
            for stages in effort.stages:
                values[f"collocation, {stages} stages"] = orbits.collocation(cycle.d, study.order, stages)
            name = f"solve_ivp + brentq, rtol {effort.shooting:g}"
            values[name] = orbits.shooting(cycle.d, study.order, effort.shooting)
        reference = stated[k].reference if len(stated) == len(cycles) else ""
        out.append(Agreement(case.key, values, reference))
    return tuple(out)


def _polished(power: EventMap, near: float, rtol: float) -> float:
    at = power.remake(rtol=rtol, atol=rtol * 1e-2)
    reach = 1e-5 * abs(near)
    return float(
        brentq(lambda d: float(at(d)) - d, near - reach, near + reach, xtol=1e-15 * abs(near), rtol=8.9e-16)
    )
