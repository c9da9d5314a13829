"""Follow solutions over a parameter: pseudo-arclength continuation as an iterator of points.

    run = continuation(system, orbit, parameter="P", bounds=(10, 31))
    for point in run:
        print(point)
    run.branch.save("branch.json")

A predictor along the tangent, a corrector across it (Newton, exact matrices) and a step control are apart.
Changes of sign of test functions between two points are located on the branch by root-finding, changes of the
mode word by bisection; the branch goes on across both. Source: Allgower & Georg 1990; Seydel 2010;
Veltz 2020 (BifurcationKit) for the iterator.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from filippov import System, UsageError
from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.branch_labels import labels_of
from filippov.analysis.bifurcations.branch_problem import (
    BranchProblem,
    MapProblem,
    OrbitProblem,
    check_varied,
)
from filippov.analysis.bifurcations.corrector import FAILURES, Along, Corrector, closed_by
from filippov.analysis.bifurcations.crossing import Crossings, EndOfWordError
from filippov.analysis.bifurcations.cycle_end import cycle_end
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.bifurcations.function_problem import FunctionProblem
from filippov.analysis.bifurcations.normal_form import described
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.map_units import finer
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import refine
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.analysis.orbits.time_limit import limited
from filippov.base.given import Count, Interval, Positive
from filippov.base.keywords import keywords
from filippov.base.names import Answering
from filippov.base.shown import Shown
from filippov.base.status import mode_text
from filippov.solving.state.options import check_state

# Cosine of the angle between two tangents below which a step is halved; no branch closes in fewer steps.
_STRAIGHT, _FEWEST = 0.9, 3
# So many iterations of the corrector shorten the next step.
_SLOW = 6
_CLOSED = "the branch is closed"


@keywords()
def continuation(
    system: Any,
    start: Any,
    *,
    parameter: str = "parameter",
    bounds: Interval,
    value: float | None = None,
    mode: Any = None,
    parameters: Mapping[str, float] | None = None,
    direction: int = 0,
    step: Positive = 0.02,
    min_step: Positive = 1e-8,
    max_step: Positive = 0.1,
    max_points: Count = 500,
    max_time: Positive = float("inf"),
    resume: Branch | None = None,
) -> Continuation:
    """A continuation, not begun: iterate over it, or `run()` it.

    system      what `start` is a solution of, or a function F(u, value) with as many values as unknowns
    start       an Orbit; (EventMap, d) for fixed points of the map; for equilibria a state, with `mode`;
                for a function the unknowns
    parameter   name of what is varied, from `value` (default: what the start has) within `bounds`
    mode        of an equilibrium, "+0" or signs; 0 for the surfaces that a pseudo-equilibrium slides on
    parameters  values of the others, for equilibria
    direction   +1 or -1: to larger or smaller values first, only that way; 0: both ways
    step, min_step, max_step   of the arclength, in units of the solution's size and of the width of bounds;
                where a small cycle shrinks into rest at a parameter that hardly changes, steps are longer
    max_points, max_time   budgets; what was found is kept
    resume      a Branch that was interrupted: goes on where that ended

    Raises UsageError, ModelError; NoConvergenceError where the start is no solution or singular.
    """
    low, high = float(bounds[0]), float(bounds[1])
    if not low < high:
        raise UsageError(f"bounds are ({low:g}, {high:g}), expected two increasing numbers.")
    if direction not in (-1, 0, 1):
        raise UsageError(f"direction is {direction!r}, expected -1, 0 or 1.")
    if not 0 < min_step < step <= max_step:
        raise UsageError(f"steps are {min_step:g}, {step:g}, {max_step:g}; expected 0 < min < step <= max.")
    problem, at, others = _problem(system, start, parameter, value, mode, parameters, high - low)
    if not low <= at <= high:
        raise UsageError(f"{parameter} = {at:g} at the start is outside bounds ({low:g}, {high:g}).")
    run = Continuation(problem, at, (low, high), Branch(parameter, problem.kind, others), direction, step)
    run.min_step, run.max_step, run.max_points, run.max_time = min_step, max_step, max_points, max_time
    if resume is not None:
        run.take_up(resume)
    run.prepare()
    return run


def _problem(
    system: Any, start: Any, parameter: str, value: float | None, mode: Any,
    parameters: Mapping[str, float] | None, width: float,
) -> tuple[Any, float, dict[str, float]]:  # fmt: skip
    """The problem, the parameter's value at the start, the values of the others."""
    if callable(system) and not hasattr(system, "states"):
        if value is None:
            raise UsageError("a function needs the parameter's value at the start: value=.")
        return FunctionProblem(system, start), float(value), {}
    if not isinstance(system, System):
        raise UsageError(
            f"system is of type {type(system).__name__}, expected a System or a function F(u, value). Write "
            "continuation(system, start, parameter=..., bounds=...)."
        )
    check_varied(system, parameter, start)
    if isinstance(start, Orbit):
        values = dict(start.parameters)
        if value is not None or start.problem is None:
            start = refine(start, {} if value is None else {parameter: value})
        at = float(start.parameters[parameter])
        return OrbitProblem(start, parameter), at, {k: v for k, v in values.items() if k != parameter}
    if isinstance(start, tuple) and len(start) == 2 and isinstance(start[0], EventMap):
        event_map, d = start
        at = float(event_map.parameters[parameter] if value is None else value)
        others = {k: v for k, v in event_map.parameters.items() if k != parameter}
        fine = finer(event_map.remake(parameters={parameter: at}), float(d), 2e-12)
        return MapProblem(fine, parameter, float(d)), at, others
    if mode is None:
        some = "such as '+0'" if system.surfaces else "here mode='' (no surfaces)"
        raise UsageError(
            f"the start is a state; an equilibrium needs its mode=, {some}. A cycle is found first: "
            f"continuation(system, find_orbit(system, x0), parameter={parameter!r}, bounds=...)."
        )
    named = dict(zip(system.parameters.names, system.parameters.resolve(parameters).tolist(), strict=True))
    at = named[parameter] if value is None else float(value)
    signs = system.symbolic.signs(mode) if system.symbolic is not None else tuple(mode)
    start = check_state(start, system)
    problem = EquilibriumProblem(system, signs, parameter, start, named | {parameter: at}).in_units(at, width)
    return problem, at, {k: v for k, v in named.items() if k != parameter}


class Continuation(Shown, Answering):
    """A continuation under way: an iterator of points. `branch` has what was found, in order along it.

    stop()   ends it after the point at hand; a KeyboardInterrupt does so too when it runs by `run`
    """

    _elsewhere: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("points", "special", "plot", "save"), "run() follows it and returns the branch, which has it."
    )
    min_step, max_step, max_points, max_time = 1e-8, 0.1, 500, float("inf")

    def __init__(
        self, problem: BranchProblem, value: float, bounds: tuple[float, float], branch: Branch,
        direction: int, step: float,
    ) -> None:  # fmt: skip
        self.problem, self.value, self.bounds, self.branch = problem, value, bounds, branch
        self.direction, self.step = direction, step
        self.width = bounds[1] - bounds[0]
        self._z = np.zeros(0)
        self._message = ""
        self.stopped = False
        self._resumed: list[BranchPoint] = []
        self._iterator: Iterator[BranchPoint] | None = None
        self._first: Along | None = None

    def __repr__(self) -> str:
        low, high = self.bounds
        where = f"{self.branch.parameter} in [{low:.6g}, {high:.6g}], {len(self.branch.points)} points"
        return f"Continuation({self.branch.kind}, {where}; run() follows it)"

    def __iter__(self) -> Iterator[BranchPoint]:
        return self

    def __next__(self) -> BranchPoint:
        if self._iterator is None:
            self._iterator = self._points()
        return next(self._iterator)

    def stop(self) -> None:
        """End after the point at hand."""
        self.stopped = True

    def run(self, progress: Callable[[float, float, str], None] | None = None) -> Branch:
        """All points; progress(done, all, note) is called at each. After Ctrl-C what was found is kept."""
        try:
            for count, point in enumerate(self):
                if progress is not None:
                    progress(min(count, self.max_points), self.max_points, f"{point.value:.6g}")
        except KeyboardInterrupt:
            self.branch.message = f"interrupted after {len(self.branch.points)} points; resume= goes on"
            self.branch.interrupted = True
        return self.branch

    def take_up(self, branch: Branch) -> None:
        """Go on with a branch that was stored. Raises UsageError where it is another continuation's."""
        mine = self.branch
        if (branch.parameter, branch.kind) != (mine.parameter, mine.kind):
            raise UsageError(
                f"the branch to resume follows a {branch.kind} over {branch.parameter!r}, this one a "
                f"{mine.kind} over {mine.parameter!r}. Resume with what it was made with, or without resume."
            )
        for name, number in mine.parameters.items():
            if branch.parameters.get(name) != number:
                raise UsageError(
                    f"the branch to resume has {name} = {branch.parameters.get(name)}, this one {number}. "
                    "Give it the same values, or leave resume out."
                )
        self._resumed = list(branch.points)
        self.branch.points = list(branch.points)
        self.branch.state = dict(branch.state)

    def at(self, value: float) -> list[BranchPoint]:
        """The solutions of the branch found so far at one value of the parameter, each corrected there."""
        return self._solutions(self.branch.points, value)

    def _solutions(self, points: list[BranchPoint], value: float) -> list[BranchPoint]:
        """The solutions at a value between neighbours among points, each corrected there."""
        problem, out = self.problem, list[BranchPoint]()
        corrector = Corrector(problem, self.width)
        for k, (a, b) in enumerate(pairwise(points)):
            inside = min(a.value, b.value) <= value <= max(a.value, b.value) and a.value != b.value
            # An end that two segments share counts once.
            if len(a.u) != len(b.u) or not inside or (k and value == a.value):
                continue
            if value == b.value == points[0].value and b is points[-1] and _CLOSED in self.branch.message:
                continue
            share = (value - a.value) / (b.value - a.value)
            near = a if share < 0.5 else b
            u, at = np.array(near.u), corrector
            if a.phase == b.phase:
                u = np.array(a.u) + share * (np.array(b.u) - np.array(a.u))
            if isinstance(problem, OrbitProblem):
                moved = problem.at_phase(near.phase) if near.phase else problem
                at = Corrector(moved.moved(np.array(near.u), near.value), self.width)
            if isinstance(problem, EquilibriumProblem) and near.modes[0] != mode_text(problem.mode):
                at = Corrector(problem.in_mode(near.modes[0], np.array(near.u)), self.width)
            if np.all(np.isfinite(u)):
                out.append(at.fixed(u, value))
        return out

    # -- the march ---------------------------------------------------------------------------------------

    def _points(self) -> Iterator[BranchPoint]:
        begun = time.monotonic()
        state = self.branch.state
        ways = [self.direction] if self.direction else [1, -1]
        done = list(state.get("done", []))
        messages = list(state.get("messages", []))
        for way in ways:
            if way in done:
                continue
            current = self._begin(way)
            self.branch.labels = labels_of(self.problem, (self.branch.parameter, *current.point.coordinates))
            if not self._resumed and not self.branch.points:
                self.branch.points.append(current.point)
                yield current.point
            for point in limited(self._march(current, way), begun + self.max_time):
                # Points of the second way come before those of the first.
                if way == ways[0]:
                    self.branch.points.append(point)
                else:
                    self.branch.points.insert(0, point)
                yield point
                if self.stopped or self._spent(begun):
                    break
            messages += [self._message] if self._message else []
            if self.stopped or self._spent(begun):
                self.branch.message = "; ".join([*messages, "stopped" if self.stopped else self._limit()])
                return
            done.append(way)
            if self._message == _CLOSED:
                # The other way is the same.
                done = list(ways)
            self.branch.message = "; ".join(messages)
            self.branch.state = {"done": done, "messages": messages}

    def _spent(self, begun: float) -> bool:
        return len(self.branch.points) >= self.max_points or time.monotonic() - begun > self.max_time

    def _limit(self) -> str:
        """The limit that ended the march, by name."""
        if len(self.branch.points) >= self.max_points:
            return f"cut off by max_points = {self.max_points}"
        return f"cut off by max_time = {self.max_time:g} s of the wall clock"

    def _begin(self, way: int) -> Along:
        """The first point with its tangent; that of a stored branch where it is resumed."""
        points = self.branch.points
        if self._resumed and self.branch.state.get("way") == way:
            end = -1 if way == (self.direction or 1) else 0
            while len(points) > 1 and points[end].special:
                # It is found again from the point before it.
                points.pop(end)
            stored = points[end]
            u = np.array(stored.u)
            if isinstance(self.problem, EquilibriumProblem):
                self.problem = self.problem.in_mode(stored.modes[0], u)
            if isinstance(self.problem, OrbitProblem) and stored.phase:
                self.problem = self.problem.at_phase(stored.phase)
            self.problem = self.problem.moved(u, stored.value)
            corrector = Corrector(self.problem, self.width)
            tangent = np.array(stored.tangent) if stored.tangent else None
            found = corrector.along(corrector.scaled(u, stored.value), tangent, way)
            # Tests that are 0 here to rounding keep their previous signs.
            return replace(found, point=stored) if stored.tests else found
        if self._first is not None:
            return replace(self._first, tangent=way * self._first.tangent)
        corrector = Corrector(self.problem, self.width)
        return corrector.along(self._z, None, way)

    def _origin(self, current: Along, way: int) -> Along:
        """The point at which a closed branch closes: that at which a stored one began."""
        points = self.branch.points
        if not self._resumed or way != (self.direction or 1) or not points[0].tangent:
            return current
        stored, problem = points[0], current.corrector.problem
        u = np.array(stored.u)
        if isinstance(problem, EquilibriumProblem):
            problem = problem.in_mode(stored.modes[0], u)
        if isinstance(problem, OrbitProblem) and stored.phase:
            problem = problem.at_phase(stored.phase)
        corrector = Corrector(problem.moved(u, stored.value), self.width)
        return Along(corrector, corrector.scaled(u, stored.value), np.array(stored.tangent), stored)

    def begin_at(self, first: Along) -> None:
        """Begin at a point with a tangent of its own: a branch point, where the equations give two."""
        self._first = first

    def prepare(self) -> None:
        """Correct the start. Raises NoConvergenceError where it is no solution, or singular."""
        start = np.asarray(self.problem.start, dtype=float)
        self._z = Corrector(self.problem, self.width).settle(start, self.value)

    def _march(self, current: Along, way: int) -> Iterator[BranchPoint]:
        step, low, high = self.step, self.bounds[0], self.bounds[1]
        crossings = Crossings(self.width, self.min_step)
        self.branch.state["way"] = way
        self._message = ""
        first, passed = self._origin(current, way), 0
        # The point from which the end of its word was looked for, and what is beyond it where that is known.
        tried: Along | None = None
        ahead: tuple[BranchPoint, Along] | None = None
        while True:
            corrector = current.corrector
            near = 1e-12 * self.width
            if not low + near < current.point.value < high - near and self._outward(current):
                self._message = f"{self.branch.parameter} = {current.point.value:.9g}: bound reached"
                return
            ending: Along | None = None
            try:
                if ahead is not None:
                    raise NoConvergenceError("the branch ends at the border of its mode word.")
                following, count = corrector.step(current, step)
            except FAILURES as error:
                ending = crossings.end_of_word(current, step) if current is not tried else None
                tried = current
                if ending is None:
                    step *= 0.5
                    if step >= self.min_step and ahead is None:
                        continue
                    onwards = yield from self._beyond(crossings, current, error, ahead)
                    if onwards is None:
                        return
                    current, step, ahead = onwards, self.step * 0.1, None
                    continue
                following, count = ending, _SLOW
            same = following.point.word == current.point.word
            if same and current.tangent @ following.tangent < _STRAIGHT and step > 1e3 * self.min_step:
                step *= 0.5
                continue
            value = following.point.value
            if not low <= value <= high:
                try:
                    following = corrector.at_value(current, following, low if value < low else high)
                except FAILURES as error:
                    step *= 0.5
                    if step >= self.min_step:
                        continue
                    self._message = f"no further point at {current.point.value:.9g}: {error}"
                    return
            closing = closed_by(first, current, following) if passed > _FEWEST else None
            following, passed = closing or following, passed + 1
            shrunk = cycle_end(current, following, self.bounds)
            if shrunk is not None:
                self._message = f"{shrunk.special} at {shrunk.value:.12g}"
                yield shrunk
                return
            if following.turned() and step > 1e3 * self.min_step:
                step *= 0.5
                continue
            try:
                found, goes_on = crossings.between(current, following, step)
            except FAILURES as error:
                if not isinstance(corrector.problem, OrbitProblem):
                    self._message = f"no further point at {current.point.value:.9g}: {error}"
                    return
                step *= 0.5
                if step >= self.min_step and not isinstance(error, EndOfWordError):
                    continue
                last = error.last if isinstance(error, EndOfWordError) else current
                onwards = yield from self._beyond(crossings, last, error)
                if onwards is None:
                    return
                current, step = onwards, self.step * 0.1
                continue
            if any(not low - near <= point.value <= high + near for point in found) and step > self.min_step:
                # The branch leaves the bounds and comes back within the step: shorter ones end at the bound.
                step = max(0.5 * step, self.min_step)
                continue
            for special in found:
                yield self._described(current, special)
            current = goes_on
            end = self._end(current)
            if end is None or end.u != current.point.u:
                yield current.point
            if end is not None:
                yield end
                return
            current = current.moved()
            if goes_on is ending:
                tried, ahead = current, crossings.jump(current)
            elif goes_on is not following:
                step = max(min(step, self.step) * 0.25, 10 * self.min_step)
            elif count <= 3:
                room = getattr(current.corrector.problem, "room", lambda u, tangent: 0.0)
                step = min(1.4 * step, max(self.max_step, room(current.u, current.tangent)))
            elif count >= _SLOW:
                step *= 0.7
            if closing is not None and goes_on is following:
                self._message = _CLOSED
                return

    def _beyond(
        self, crossings: Crossings, current: Along, error: Exception,
        ahead: tuple[BranchPoint, Along] | None = None,
    ) -> Generator[BranchPoint, None, Along | None]:  # fmt: skip
        """The points that follow the last one of a word; returns the one to go on from, or None where the
        branch ends, with the reason in the message. ahead: what `Crossings.jump` has found, where asked."""
        low, high = self.bounds
        jumped = ahead or crossings.jump(current) or crossings.reached(current)
        if jumped is None:
            end = crossings.blocked(current)
            self._message = f"no further point at {current.point.value:.9g}: {error}"
            if end is not None:
                yield self._described(current, end)
            return None
        special, onwards = jumped
        values = special.value, onwards.point.value
        if not low <= min(values) <= max(values) <= high:
            self._message = f"{self.branch.parameter} = {special.value:.9g}: bound reached"
            return None
        special, had = self._described(current, special), self._had(onwards.point)
        if had:
            self._message = f"no further point at {special.value:.9g}: beyond it are orbits of this branch"
        yield special
        if had:
            return None
        yield onwards.point
        return onwards

    def _had(self, point: BranchPoint) -> bool:
        """Whether the branch has the orbit of a point already."""
        for pair in pairwise(q for q in self.branch.points if q.word == point.word):
            try:
                if any(q.is_solution_of(point) for q in self._solutions(list(pair), point.value)):
                    return True
            except FAILURES:
                continue
        return False

    def _described(self, at: Along, point: BranchPoint) -> BranchPoint:
        """A special point with its normal form."""
        return described(at.corrector.problem, point, self.width, self.branch.parameter)

    def _outward(self, current: Along) -> bool:
        """Whether the branch leaves the bounds at a point on them."""
        at_high = current.point.value > 0.5 * (self.bounds[0] + self.bounds[1])
        return bool((current.tangent[-1] > 0) == at_high)

    def _end(self, current: Along) -> BranchPoint | None:
        """The end of a branch of a map's fixed points in the equilibrium set, None before it."""
        problem = current.corrector.problem
        ending = getattr(problem, "ending", None)
        if ending is None:
            return None
        point: BranchPoint | None = ending(current.u, current.point.value, self.bounds)
        if point is not None:
            self._message = f"{point.special} at {point.value:.12g}"
        return point
