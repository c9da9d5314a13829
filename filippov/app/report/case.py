"""What is computed for each case of a study, and its cycles followed over the study's parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov import SolveError, UsageError
from filippov.analysis import EventMap, bifurcation, find_orbit, stability_report
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.comparisons.independent import Orbits
from filippov.analysis.diagrams.diagram import Diagram
from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.analysis.maps.gap_roots import fixed_point_near
from filippov.app.report.aside import Aside
from filippov.app.report.context import Context, Progress
from filippov.app.report.effort import Effort
from filippov.app.report.part import first
from filippov.base.arrays import Array
from filippov.graphs import mode_word, observed_graph
from filippov.models.studies import Study, StudyCase
from filippov.solving.state.machine import Machine
from filippov.solving.uncut import solve

# The ends of the stages, as fractions of a case.
ENDS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.6, 0.7, 1.0)
# Tolerances at which branches are followed, and compared.
LOOSE, TIGHT = 1e-12, 1e-13
# Longest step along a branch, in units of its size: short enough to be drawn.
LONGEST = 0.04


@dataclass(frozen=True)
class Samples:
    """The map and its iterate at coordinates d."""

    d: Array
    once: Array
    power: Array


@dataclass(frozen=True)
class Agreement:
    """One cycle by several methods: values by name of the method; why independent ones do not apply."""

    values: Mapping[str, float]
    reference: str
    why: str

    def digits(self, *names: str) -> float:
        """Decimal digits on which the named methods agree, relative to the value."""
        chosen = [self.values[n] for n in names if n in self.values]
        spread = max(chosen) - min(chosen)
        return float(-np.log10(max(spread / abs(chosen[0]), 2.0**-53)))


def diagrams(study: Study, effort: Effort, k: int) -> tuple[Diagram, Diagram | None]:
    """The diagram of case k, and the one of further values where the study has some."""
    about = Context(study, effort)

    def over(values: tuple[float, ...]) -> Diagram:
        return bifurcation(
            about.system, about.section, parameter=study.parameter, values=values, interval=about.interval,
            parameters=study.cases[k].parameters, order=study.order, points=effort.points,
        )  # fmt: skip

    chosen = tuple(dict.fromkeys([*study.values[:: effort.stride], study.values[-1]]))
    return over(chosen), over(study.beyond) if study.beyond else None


class CaseResults:
    """Everything computed for one case; `low` and `high`: the fraction of the whole at its start and end.

    orbit   iterates of the map from the first rest of the response, as many as it has rests
    height  largest |h| while sliding on the section's surface; spreads: of the model's invariants there
    apart   largest distance of the response's rest positions from the orbit; NaN without any
    """

    def __init__(self, run: Context, case: StudyCase, low: float, high: float) -> None:
        self.run, self.case, self.label, self.slug = run, case, case.label, case.slug
        self._ends = iter([low + (high - low) * end for end in ENDS])
        study, effort, system, given = run.study, run.effort, run.system, case.parameters
        a, b = run.interval
        self.event_map = once = EventMap(system, run.section, parameters=given)
        self.power, self.parameters = once.power(study.order), once.parameters
        with self._stage("time response"):
            self.solution = solve(system, run.x0, run.t_span, parameters=given, rtol=1e-10, atol=1e-12)
        if not self.solution.success:
            raise SolveError(
                f"the time response of {self.label} ended early: {self.solution.message}", self.solution
            )
        with self._stage("event map"):
            self.wide = self._sample(a, b)
            self.small = None if case.small is None else self._sample(a, case.small)
        with self._stage("fixed points"):
            self.fixed = self.power.fixed_points(a, b, effort.points)
        with self._stage("basins"):
            self.basins = self.power.basins(a, b, effort.points)
        with self._stage("jumps"):
            self.jumps = once.jumps(a, b, effort.points)
        with self._stage("bifurcation"):
            self.diagram, self.beyond = run.aside.value(diagrams, study.cases.index(case))
        with self._stage("stability"):
            self.stability = stability_report(system, given, solve_for=study.parameter)
        with self._stage("independent checks"):
            self.agreements = self._agreements()
        self.curve = None if study.curve is None else study.curve(given)
        self.graph = observed_graph(self.solution)
        self.word = mode_word(self.solution, study.mode_names)
        rests = self._rests()
        self.orbit = once.iterate(float(rests[0]), len(rests) - 1) if len(rests) else np.zeros(0)
        self.apart = float(np.max(np.abs(rests - self.orbit))) if len(rests) else float("nan")
        self.height, self.spreads = self._exactness()

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        with self.run.stage(f"{name}, {self.label}", next(self._ends), f"{self.label}: {name}"):
            yield

    @property
    def cycles(self) -> tuple[FixedPoint, ...]:
        """The limit cycles among the fixed points."""
        return tuple(q for q in self.fixed if q.kind == "limit cycle")

    @property
    def diagrams(self) -> list[Diagram]:
        """The diagram, and the one of further values."""
        return [self.diagram, *([self.beyond] if self.beyond else [])]

    @property
    def bound(self) -> float | None:
        """The value of the parameter above which the Routh-Hurwitz conditions hold; None without one."""
        try:
            return None if self._solved is None else float(self._solved.numeric.as_set().start)
        except (AttributeError, NotImplementedError, TypeError, ValueError):
            return None

    @property
    def thresholds(self) -> tuple[float, ...]:
        """Values at which the set changes stability by the linearised return map."""
        return () if self._solved is None else tuple(self._solved.threshold)

    @property
    def without(self) -> str:
        """Why there is no bound: the field beside a set has no linear part, or none was found."""
        return "no linear part" if any(c.polynomial is None for c in self.applying) else "none found"

    @property
    def sets(self) -> list[Any]:
        """The ends of each equilibrium set."""
        found = [getattr(item.equilibrium, "ends", ()) for item in self.stability.items]
        return [ends for ends in found if ends]

    @property
    def applying(self) -> list[Any]:
        """The cases of the stability report that apply."""
        return [c for item in self.stability.items for c in item.cases if c.applies]

    @property
    def _solved(self) -> Any:
        return next((c.solved for c in self.applying if c.solved and c.polynomial is not None), None)

    def _sample(self, low: float, high: float) -> Samples:
        """Samples at even coordinates and, denser, next to 0, where a map may be steep."""
        count = self.run.effort.samples
        d = np.linspace(low, high, count)
        if low == 0.0:
            d = np.unique(np.concatenate([d, np.geomspace(1e-8 * high, high, count)]))
        once, power = (np.asarray(of(d), dtype=float) for of in (self.event_map, self.power))
        return Samples(d, once, power)

    def _rests(self) -> Array:
        """The section's coordinate at each of its events along the response."""
        section = self.run.section
        return np.array([e.x[self.run.index] for e in self.solution.events.of(section.surface, section.kind)])

    def _exactness(self) -> tuple[float, dict[str, float]]:
        """`height` and `spreads`, from twenty points of each segment."""
        solution, system, invariants = self.solution, self.run.system, self.run.model.invariants
        p, sol = solution.problem.p, solution.sol
        assert sol is not None
        machine = Machine(system, solution.options.stepper, p, sliding=solution.options.sliding)
        mode, record = np.zeros(len(system.surfaces)), system.parameters.record(p)
        height, spreads = 0.0, dict.fromkeys((i.name for i in invariants), 0.0)
        for segment in solution.segments:
            if segment.mode[self.run.surface] != 0:
                continue
            t = np.linspace(segment.t0, segment.t1, 20)
            rows = np.ascontiguousarray(np.column_stack([sol(t[:1], side="+"), sol(t[1:])]).T)
            pairs = list(zip(t.tolist(), rows, strict=True))
            on = [machine.guards(a, row, mode)[self.run.surface] for a, row in pairs]
            height = max(height, float(np.max(np.abs(on))))
            for invariant in invariants:
                values = [invariant.function(a, row, record) for a, row in pairs]
                spreads[invariant.name] = max(spreads[invariant.name], max(values) - min(values))
        return height, spreads

    def _agreements(self) -> tuple[Agreement, ...]:
        """Every cycle by two tolerances of the solver and by two independent methods, where they apply."""
        study, effort, power = self.run.study, self.run.effort, self.power
        said = study.stated.points.get(self.case.key, ()) if study.stated else ()
        stated = [s for s in said if s.kind == "limit cycle"]
        out: list[Agreement] = []
        for k, cycle in enumerate(self.cycles):
            values = {f"event map, rtol {r:g}": _polished(power, cycle.d, r) for r in effort.tolerances}
            why = ""
            try:
                orbits = Orbits(self.event_map)
                for stages in effort.stages:
                    values[f"collocation, {stages} stages"] = orbits.collocation(cycle.d, study.order, stages)
                name = f"solve_ivp + brentq, rtol {effort.shooting:g}"
                values[name] = orbits.shooting(cycle.d, study.order, effort.shooting)
            except UsageError as error:  # those methods do not apply to this system
                why = str(error)
            reference = stated[k].reference if len(stated) == len(self.cycles) else ""
            out.append(Agreement(values, reference, why))
        return tuple(out)


def _polished(power: EventMap, near: float, rtol: float) -> float:
    at = power.remake(rtol=rtol, atol=rtol * 1e-2)
    found = fixed_point_near(lambda d: float(at(d)), near, 1e-5 * abs(near))
    if found is None:
        raise SolveError(f"the map has no fixed point at d = {near:.6g} at rtol = {rtol:g}.")
    return found


class CaseCycles:
    """The cycles of one case.

    orbits  at its own parameters, by growing coordinate
    runs    the continuations over the study's parameter; at: points on them at every value of the study
    pairs   every number with that of a tighter tolerance
    """

    def __init__(self, run: Context, case: CaseResults) -> None:
        study, once = run.study, case.event_map
        self.case = case
        self.orbits = tuple(
            find_orbit(run.system, once.bound.start(np.array([q.d]), once.p)[0], symmetry=study.symmetry,
                       parameters=case.parameters)
            for q in case.cycles
        )  # fmt: skip
        self.runs, tight = _runs(run, case, LOOSE), _runs(run, case, TIGHT)
        self.branches = tuple(r.branch for r in self.runs)
        self.at = {v: [p for r in self.runs for p in r.at(v)] for v in study.values}
        self.pairs = [
            (first(p), first(q))
            for v, points in self.at.items()
            for p, q in zip(points, [p for r in tight for p in r.at(v)], strict=True)
        ]
        for one, other in zip(self.runs, tight, strict=True):
            special = zip(one.branch.special, other.branch.special, strict=True)
            self.pairs += [(a.value, b.value) for a, b in special]

    @property
    def spread(self) -> float:
        """Largest relative difference of the pairs."""
        return max((abs(a - b) / abs(b) for a, b in self.pairs), default=0.0)

    @property
    def special(self) -> list[BranchPoint]:
        """Special points of all branches."""
        return [point for branch in self.branches for point in branch.special]


def _runs(run: Context, case: CaseResults, rtol: float) -> tuple[Continuation, ...]:
    """Branches through all cycles of the case, from the largest down; each is followed once."""
    name, values = run.study.parameter, run.study.values
    power = case.power.remake(rtol=rtol, atol=1e-2 * rtol)
    own, bounds = power.parameters[name], (values[0], values[-1])
    out: list[Continuation] = []
    known: list[float] = []
    for q in sorted(case.cycles, key=lambda q: -q.d):
        if any(abs(q.d - d) < 1e-6 * abs(q.d) for d in known):
            continue
        way = 1 if own <= bounds[0] else -1 if own >= bounds[1] else 0
        found = continuation(
            run.system, (power, q.d), parameter=name, bounds=bounds, direction=way, max_step=LONGEST
        )
        found.run()
        known += [first(p) for p in found.at(own)]
        out.append(found)
    return tuple(out)


class StudyRun(Context):
    """The data of the sections: computed cases, the main one first, and the cycles of each."""

    def __init__(
        self, study: Study, effort: Effort, progress: Progress | None = None, aside: Aside | None = None
    ) -> None:
        super().__init__(study, effort, progress, aside)
        self.cases: list[CaseResults] = []
        self.cycles: list[CaseCycles] = []

    @property
    def main(self) -> CaseResults:
        """The case that is shown in most detail."""
        return self.cases[0]
