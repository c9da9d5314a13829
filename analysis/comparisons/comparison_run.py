"""The runs behind a comparison: what is computed of the exact system, and of one band model at one width."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from filippov import Solution, Status, Stop, System, UsageError
from filippov.analysis.comparisons.band_model import BandModel, Reader, Stay
from filippov.analysis.comparisons.solution_events import EventReader
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.gap_roots import fixed_point_near
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array
from filippov.solving.state.options import check_state
from filippov.solving.uncut import solve, solve_many

Position = Callable[[float, Any, Any], float]
TIGHT = 3e-14
LATEST = 2.0  # a band model that takes longer than this times the exact return does not return
# Solutions are timed in copies, at most so many, for about so many seconds: the call does not count then.
COPIES, ENOUGH = 20, 0.02


class OverBudgetError(Exception):
    """The steps of one solution are used up."""


def blank_row(name: str, width: float | None, options: Mapping[str, float]) -> dict[str, Any]:
    """A row without values."""
    blank = dict.fromkeys((
        "error_times", "error_R", "error_fixed_points", "drift", "field_calls", "seconds", "calls_ratio",
        "time_ratio", "fixed_points",
    ))  # fmt: skip
    return {"model": name, "width": width, **options, **blank, "note": ""}


@dataclass(frozen=True)
class _Reference:
    """The exact system: values of P, times and kinds of the response's events, fixed points, drift."""

    values: Array
    times: Array
    kinds: tuple[str, ...]
    fixed: Array
    drift: float


class ExactRun:
    """The exact system, its reference numbers and what every model is measured with."""

    def __init__(
        self, system: System, section: Section, parameters: Mapping[str, float] | None, rtol: float,
        atol: float, max_steps: int, repeats: int,
    ) -> None:  # fmt: skip
        if section.kind != "sliding entry":
            raise UsageError(f"the section is a {section.kind!r}, expected a 'sliding entry'.")
        self.system, self.bound = system, section.bind(system)
        section = self.section = self.bound.section
        self.p = system.parameters.resolve(parameters)
        self.parameters = dict(zip(system.parameters.names, self.p.tolist(), strict=True))
        self.given = dict(parameters or {})
        self.options: dict[str, Any] = {"rtol": rtol, "atol": atol, "max_steps": max_steps}
        self.reader = Reader(system, section.surface, self.p)
        self.ways = EventReader(system, self.p)
        self.repeats = repeats
        self.points: tuple[Any, ...] = ()

    def start(self, d: float) -> Array:
        """The state on the section at the coordinate d."""
        return np.asarray(self.bound.start(np.array([d]), self.p)[0])

    def place(self, solution_t: float, x: Array) -> float:
        """The quantity that stick keeps, where one was asked for."""
        assert self.position is not None
        return float(self.position(solution_t, x, self.system.parameters.record(self.p)))

    def measure(
        self,
        d: Array,
        interval: tuple[float, float] | None,
        order: int,
        x0: Any,
        events: int,
        position: Position | None,
    ) -> None:
        """Compute the reference at the given tolerance and a tighter one."""
        if order < 1 or events < 1:
            raise UsageError(
                f"order is {order!r} and events is {events!r}, expected whole numbers of at least 1."
            )
        self.d, self.order, self.position, self.events = d, order, position, events
        self.x0 = self.start(float(d[d.size // 2])) if x0 is None else check_state(x0, self.system)
        tight = {"rtol": max(TIGHT, 1e-2 * self.options["rtol"]), "atol": 1e-2 * self.options["atol"]}
        numbers = []
        for tolerance in ({}, tight):
            used = {**self.options, **tolerance}
            numbers.append(self._numbers(interval, used))
        self.coarse, self.fine = numbers
        if not self.fine.times.size:
            raise UsageError(
                "the response of the exact system has no entry into stick and no exit; give another x0."
            )
        self.t_response = float(self.fine.times[-1])
        self.horizons = [LATEST * self.return_time(float(q), 1) for q in d]

    def _numbers(self, interval: tuple[float, float] | None, options: Mapping[str, Any]) -> _Reference:
        tolerances = {name: options[name] for name in ("rtol", "atol")}
        event_map = EventMap(self.system, self.section, parameters=self.parameters, **tolerances)
        fixed: list[float] = []
        if interval is not None:
            found = event_map.power(self.order).fixed_points(*interval)
            self.points = tuple(point for point in found if point.kind == "limit cycle")
            fixed = [point.d for point in self.points]
        stop = Stop(self.section.surface, "sliding entry", self.events // 2 + 1)
        response = solve(
            self.system, self.x0, (0.0, self.section.t_max), parameters=self.parameters, stop=stop, **options
        )
        stays = self.reader.of_exact(response)
        times, kinds = _events(stays, self.events, self.section.t_max)
        drift = self.drift(response, stays, times[-1] if times.size else 0.0)
        return _Reference(np.asarray(event_map(self.d)), times, kinds, np.array(fixed), drift)

    def return_time(self, d: float, count: int) -> float:
        """Time of the count-th entry into stick; t_max where there is none."""
        stop = Stop(self.section.surface, "sliding entry", count)
        end: Solution = solve(
            self.system, self.start(d), (0.0, self.section.t_max), parameters=self.parameters, stop=stop,
            dense_output=False, **self.options,
        )  # fmt: skip
        return end.t_end

    def drift(self, solution: Solution, stays: Sequence[Stay], until: float) -> float:
        """Largest change of the position within a stay, up to a time, from 64 points a stay.

        Without a position that was asked for: the way slipped, as for solutions; a belt carries the place on.
        """
        assert solution.sol is not None
        worst = 0.0
        if self.position is None:
            until = min(until, solution.t_end)
            cut = [replace(stay, t1=min(stay.t1, until)) for stay in stays if stay.t0 < until]
            return self.ways.drift(solution, self.section.surface, cut)
        for stay in stays:
            if stay.t0 >= until:
                break
            times = np.linspace(stay.t0, min(stay.t1, until), 64)[1:-1]
            places = [self.place(float(t), solution.sol(float(t))) for t in times]
            first = self.place(stay.t0, stay.x)
            worst = max(worst, max((abs(place - first) for place in places), default=0.0))
        return worst

    def row(self) -> dict[str, Any]:
        """The row of the exact system: how far two tolerances differ."""
        self.calls, seconds, _ = self.clock(self.system, self.parameters)
        a, b = self.coarse, self.fine
        same = a.kinds == b.kinds and a.fixed.shape == b.fixed.shape
        return blank_row("exact", None, {}) | {
            "error_times": _largest(a.times - b.times) if same else None,
            "error_R": _largest(a.values - b.values),
            "error_fixed_points": np.abs(a.fixed - b.fixed).tolist() if same else None,
            "fixed_points": b.fixed.tolist(),
            "drift": max(a.drift, b.drift), "field_calls": self.calls, "seconds": seconds, "calls_ratio": 1.0,
            "time_ratio": 1.0, "note": "errors: difference between two tolerances",
        }  # fmt: skip

    def clock(self, system: System, given: Mapping[str, float]) -> tuple[int, float, float]:
        """Field calls and seconds of the solutions from all coordinates over the response's span; exact ones.

        They run one after the other: what one solution costs.

        The exact system is timed in turn with the model. Raises OverBudgetError.
        """
        starts = self.bound.start(self.d, self.p)

        def work(target: System, values: Mapping[str, float], copies: int) -> tuple[int, float]:
            states = np.tile(starts, (copies, 1))
            begun = time.perf_counter()
            ends = solve_many(
                target, states, (0.0, self.t_response), parameters=values, threads=1, lanes=1, **self.options
            )
            spent = (time.perf_counter() - begun) / copies
            if any(status is Status.MAX_STEPS for status in ends.status):
                raise OverBudgetError
            return int(ends.nfev.sum()) // copies, spent

        work(system, given, 1)  # compiles
        calls, once = work(system, given, 1)
        copies = min(COPIES, max(1, int(ENOUGH / once)))
        pairs = [
            (work(self.system, self.parameters, COPIES)[1], work(system, given, copies)[1])
            for _ in range(max(1, self.repeats))
        ]
        exact, own = (statistics.median(column) for column in zip(*pairs, strict=True))
        return calls, own, exact


class BandRun:
    """One band model at one width."""

    def __init__(self, exact: ExactRun, model: BandModel, width: float, options: Mapping[str, float]) -> None:
        self.exact, self.model, self.width = exact, model, width
        built = model.build(width, **options)
        self.system, own = built if isinstance(built, tuple) else (built, {})
        if not isinstance(self.system, System):
            raise UsageError(f"{model.name}: build returned {type(self.system).__name__}, expected a System.")
        if self.system.states != exact.system.states:
            raise UsageError(
                f"{model.name}: the states are {' '.join(self.system.states)}, expected those of the exact "
                f"system: {' '.join(exact.system.states)}."
            )
        shared = {name: v for name, v in exact.given.items() if name in self.system.parameters}
        self.parameters = {**shared, **own}

    def row(self) -> dict[str, Any]:
        """Everything that is compared. Raises OverBudgetError."""
        exact = self.exact
        calls, seconds, beside = exact.clock(self.system, self.parameters)
        pairs = zip(exact.d, exact.horizons, strict=True)
        values = np.array([self.nth_return(float(q), 1, t) for q, t in pairs])
        gap = np.abs(values - exact.fine.values)
        lost = exact.d[~np.isfinite(gap)].tolist()
        response = self.solve(exact.x0, 1.5 * exact.t_response, dense=True)
        stays = exact.reader.of_model(response, self.model, self.width)
        times, kinds = _events(stays, exact.fine.times.size, exact.t_response)
        same = kinds == exact.fine.kinds
        fixed, missing = [], []
        for k, point in enumerate(exact.points):
            try:
                fixed.append(self.fixed_point(k))
                reason = "is lost"
            except (
                OverBudgetError
            ):  # long stays in stick, at small d, take more steps than the coordinates compared
                fixed.append(None)
                reason = "takes too many steps"
            if fixed[-1] is None:
                missing.append(f"the fixed point at {point.d:.4g} {reason}")
        errors = [
            None if f is None else abs(f - d) for f, d in zip(fixed, exact.fine.fixed.tolist(), strict=True)
        ]
        notes = [
            *([] if not lost else [f"no stick after the start at {', '.join(f'{q:g}' for q in lost)}"]),
            *([] if same else ["the response has other stick phases"]),
            *missing,
            *([] if response.status.ok else [f"the response ended with {response.status.value}"]),
        ]
        return {
            "error_times": _largest(times - exact.fine.times) if same else None,
            "error_R": None if lost else _largest(gap),
            "error_fixed_points": errors, "fixed_points": fixed,
            "drift": exact.drift(response, stays, exact.t_response) if stays else None,
            "field_calls": calls, "seconds": seconds, "calls_ratio": calls / max(exact.calls, 1),
            "time_ratio": seconds / beside, "note": "; ".join(notes),
        }  # fmt: skip

    def solve(self, x0: Array, t_end: float, dense: bool, max_events: int = 100_000) -> Solution:
        """A solution of the model. Raises OverBudgetError."""
        solution: Solution = solve(
            self.system, x0, (0.0, t_end), parameters=self.parameters, dense_output=dense,
            max_events=max_events, **self.exact.options,
        )  # fmt: skip
        if solution.status is Status.MAX_STEPS:
            raise OverBudgetError
        return solution

    def nth_return(self, d: float, count: int, horizon: float) -> float:
        """Coordinate at the count-th entry into stick of the solution from d; NaN if there is none."""
        start, by_layer = self.exact.start(d), self.model.stick is None
        most = 100_000 if by_layer else 8 * count
        while True:
            solution = self.solve(start, horizon, by_layer, most)
            stays = self.exact.reader.of_model(solution, self.model, self.width)
            entries = [stay for stay in stays if not stay.from_start]
            if len(entries) >= count:
                return float(entries[count - 1].x[self.exact.bound.index])
            if solution.status is not Status.MAX_EVENTS or most >= 100_000:
                return float("nan")
            most *= 4

    def fixed_point(self, k: int) -> float | None:
        """The fixed point that belongs to the exact one: bracketed around it, None where it is lost."""
        exact, point = self.exact, self.exact.points[k]
        others = [0.0, *(q.d for j, q in enumerate(exact.points) if j != k)]
        limit = 0.5 * min(abs(point.d - q) for q in others)
        horizon = LATEST * exact.return_time(point.d, exact.order)

        def image(d: float) -> float:
            return self.nth_return(d, exact.order, horizon)

        reach = 2.0 * abs((image(point.d) - point.d) / (point.slope - 1.0)) + 1e-14 * abs(point.d)
        return fixed_point_near(image, point.d, reach, limit) if reach <= limit else None


def _events(stays: Sequence[Stay], count: int, scale: float) -> tuple[Array, tuple[str, ...]]:
    """Times and kinds of the first entries and exits; a start on the edge of stick is no event."""
    found: list[tuple[float, str]] = []
    for stay in stays:
        if not stay.from_start:
            found.append((stay.t0, "entry"))
        if not stay.to_end and not (stay.from_start and stay.t1 <= 1e-9 * scale):
            found.append((stay.t1, "exit"))
    first = found[:count]
    return np.array([t for t, _ in first]), tuple(kind for _, kind in first)


def _largest(values: Array) -> float | None:
    size = np.abs(np.asarray(values, dtype=float))
    return float(np.max(size)) if size.size and np.all(np.isfinite(size)) else None
