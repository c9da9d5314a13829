"""Drive the compiled loop from event to event, and decide what it leaves open."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.status import AT_KNOT, JUMPED_OVER, EventKind, Status, stopped_at
from filippov.kernel.tables import codes
from filippov.model.user_event import UserEvent
from filippov.solving.diagnosis import close_call, no_mode, suspect
from filippov.solving.domain import edge
from filippov.solving.finished import Course, finished
from filippov.solving.instant import reached_at_once
from filippov.solving.patience import Patience
from filippov.solving.resets.jumps import pending, reset_surfaces_at, settle, source_name, state_text, stuck
from filippov.solving.resets.passed import passed, slipped
from filippov.solving.resets.reset_cycle import rests_in_cycle
from filippov.solving.resets.rest import CLOSE, FAR
from filippov.solving.resets.slow_spiral import power_law, slow_spiral
from filippov.solving.resets.starts import begin, starting
from filippov.solving.resets.zeno import Accumulation, accumulates
from filippov.solving.selection.ambiguity import BACKWARDS, SPIRAL, Ambiguity, listing, noted, picked
from filippov.solving.selection.attraction import LOST, Attraction
from filippov.solving.selection.fold_point import depart, followers, funnelled
from filippov.solving.selection.higher_order import Begun, HigherOrder
from filippov.solving.selection.modes import Successor
from filippov.solving.selection.observed import observe, watched
from filippov.solving.settling import Settling
from filippov.solving.solution import Solution
from filippov.solving.state.change import Jump, change_of, passed_to
from filippov.solving.state.clocks import Clocks
from filippov.solving.state.events import Event, Mode
from filippov.solving.state.knot import goes_on
from filippov.solving.state.options import Options
from filippov.solving.state.problem import Problem
from filippov.solving.state.ready import put_back, ready
from filippov.solving.state.run import Run
from filippov.solving.state.watched import Watch

# Steps between two looks at the clock: so many at first, then what takes about _LOOK seconds.
_CHUNK, _SLOW_CHUNK, _LONGEST_CHUNK = 2_000, 10, 1_000_000
_LOOK = 0.05
_SHORTER = 0.1  # of the step, at every further event that does not leave the state


class BranchStart(NamedTuple):
    """Where a piece of solution begins with a choice: the point, and the mode taken there."""

    ambiguity: Ambiguity
    chosen: Successor


class Followed(NamedTuple):
    """A piece of solution, and how many events are left until each terminal one."""

    solution: Solution
    stop: npt.NDArray[np.int64]


def follow(
    problem: Problem,
    options: Options,
    progress: Callable[[float, float], None] | None = None,
    times: Array | None = None,
    begin: BranchStart | None = None,
    origin: float | None = None,
    stop: npt.NDArray[np.int64] | None = None,
    users: tuple[UserEvent, ...] = (),
    scaled: bool = False,
) -> Followed:
    """Run to the end of the span, or to where the options say to stop.

    begin    start in this mode instead of the one that the initial state decides
    origin  time at which the whole solution began, where this is a later piece of it; `stop`: its countdown
    users   events of the user; scaled: whether the message is to say where atol decides
    """
    system = problem.system
    watch = Watch(users, len(system.roles), len(system.time_events))
    events = tuple(users[k].surface for k in watch.order)
    run = ready(system, problem.p, problem.x0, problem.t_span, options, events)
    record = None if run.machine.callbacks is None else run.machine.callbacks.p
    run.watch(options.stop)
    if stop is not None:
        run.stop[:] = stop
    if origin is not None:
        run.clock.t_start = origin
    clocks = Clocks(system, record, problem.parameters, float(run.clock.t_start))
    run.tick(clocks)
    loop = _Loop(run, clocks, watch, progress, begin)
    status, message = loop.go()
    course = Course(problem, run, times, message, scaled)
    limits = tuple(loop.accumulations)
    solution = finished(run, watch, course, loop.start_mode, status, loop.ambiguity, limits)
    left = run.stop.copy()
    put_back(run)
    return Followed(solution, left)


class _Loop(Settling):
    """Drive the compiled loop and decide what it leaves open."""

    def __init__(
        self, run: Run, clocks: Clocks, watch: Watch, progress: Callable[[float, float], None] | None,
        begin: BranchStart | None = None,
    ) -> None:  # fmt: skip
        self.run, self.clocks, self.watch, self.progress, self.begin = run, clocks, watch, progress, begin
        self.t_end = float(run.clock.t_end)
        self.ambiguity: Ambiguity | None = None
        self.accumulations: list[Accumulation] = []
        self.higher = HigherOrder(run)
        self.options = run.options
        self.started = time.monotonic()
        self.start_mode: Mode = ()
        self.stalled, self.general_t = 0, np.inf
        self.resetting = any(run.machine.resets_from)
        self.patience, self.attraction = Patience(run), Attraction()
        self.chunk = _CHUNK if run.machine.callbacks is None else _SLOW_CHUNK

    def go(self) -> tuple[Status, str]:
        """Run to the end; returns how it ended and a sentence."""
        run = self.run
        try:
            ended = self._start()
            while ended is None:
                ended = self._step()
        except KeyboardInterrupt:
            run.collect()
            return Status.INTERRUPTED, self._sentence(Status.INTERRUPTED)
        return ended

    def _sentence(self, status: Status, detail: str = "") -> str:
        where = stopped_at(self.run.t, self.run.signs[: self.watch.surfaces])
        ordered = status is Status.NON_UNIQUE and self.ambiguity is None  # no modes to choose from
        told = ordered or (status is Status.ZENO and self.options.zeno == "continue")
        return f"{where}: {detail if told else f'{detail} {status.advice}'.lstrip()}"

    def _end(self, status: Status, detail: str = "") -> tuple[Status, str]:
        text = f"{detail} {status.advice}".lstrip() if status.ok else self._sentence(status, detail)
        text += self.patience.hint(status)
        return status, text if self.spiral is None else text + self.spiral.followed

    def _start(self) -> tuple[Status, str] | None:
        """Mode at the initial state: by the sign of h off a surface, by classification on one (E4)."""
        run = self.run
        if self.options.on_graze == "error":
            run.stop[: self.watch.surfaces, codes.GRAZING] = 1
        self.watch.arm(run)
        self._aim()
        if self.begin is None:
            code = begin(run)
        else:
            at, chosen = self.begin
            code, run.mode[:] = codes.REACHED, at.before
            self.start_mode = chosen.mode if at.start else at.before
            ended = self._take(chosen, at.before, at.triggered, str(at), at.start)
            if ended is not None:
                return ended
        if self.begin is None or self.begin.ambiguity.start:
            self.start_mode = run.signs
        for i, value in enumerate(run.guards().tolist()):
            if not math.isfinite(value):
                name = run.machine.surfaces[i].name
                return self._end(Status.NOT_FINITE, f"surface {name!r} has h = {value} at the initial state.")
        if run.t == self.t_end:
            return self._end(Status.SUCCESS)
        if code == codes.GENERAL:
            near = self._near()
            onto, rested = starting(run, near)
            ended = self._reset(onto, onto) if onto else self._classify(near, (), start=True, rested=rested)
            if ended is not None:
                return ended
            self.start_mode = run.signs
        return None

    def _step(self) -> tuple[Status, str] | None:
        run, options = self.run, self.options
        begun = time.monotonic()
        code = self.attraction.advance(run, max(1, min(self.chunk, options.max_steps - run.attempts)))
        ratio = _LOOK / max(time.monotonic() - begun, 1e-9)
        self.chunk = int(min(max(self.chunk * min(max(ratio, 0.1), 4.0), 1), _LONGEST_CHUNK))
        if code != codes.USER_ERROR and self.resetting and (why := passed(run)):
            return self._end(Status.NO_CONTINUATION, why)
        if code == codes.REACHED:
            return self._reached()
        if run.events.total >= options.max_events and code not in (codes.STOPPED, codes.ZENO):
            return self._too_many()
        if code == codes.STOPPED:
            if options.on_graze == "error" and run.events[-1].kind is EventKind.GRAZING:
                return self._end(Status.GRAZING, f"{run.events[-1]}.")
            surface = int(run.count.surface)
            return self._stopped(next(event for event in reversed(run.events) if event.index == surface))
        if code in (codes.RECORDS_FULL, codes.EVENTS_FULL, codes.CHUNK_DONE):
            return self._budgets()
        if code == LOST:
            return self._classify(group := self.attraction.group, group, start=False)
        if code == codes.GENERAL:
            return self._general()
        if code == codes.ZENO:
            return self._zeno()
        if code == codes.MIN_STEP and accumulates(run):
            return self._zeno()
        if self._arrived():
            return self._budgets()
        if code == codes.MIN_STEP and reached_at_once(run):
            return self._general()
        if code == codes.MIN_STEP and (drawn := funnelled(run) or funnelled(run, behind=True)):
            return self._classify(drawn, drawn, start=False) or self._budgets()
        failures = {codes.NOT_FINITE: Status.NOT_FINITE, codes.MIN_STEP: Status.MIN_STEP}
        status = failures.get(code, Status.NO_SLIDING)
        return self._end(status, f"state {state_text(run)}. {suspect(run, edge(run))}".rstrip())

    def _too_many(self) -> tuple[Status, str]:
        """The budget of events is used up: by an accumulation that no other law recognises, or as it is."""
        limit = power_law(self.run)
        if limit is None:
            spiral = slow_spiral(self.run)
            ways = "Go on in the corner with zeno='continue', or nearer to it with a larger max_events."
            return self._end(Status.MAX_EVENTS, "" if spiral is None else f"{spiral}. {ways}")
        self.accumulations.append(limit)
        return self._end(
            Status.ZENO,
            f"events accumulate at t = {limit.t:.9g} (error about {limit.error:.1g}), as n**-k for the n-th: "
            "there is no limit state to go on with.",
        )

    def _stopped(self, event: Event) -> tuple[Status, str] | None:
        if not self.watch.ends(self.run, event):
            return self._budgets()
        return self._end(Status.STOPPED, f"Stopped at t = {self.run.t:.12g}: {self.watch.shown(event)}.")

    def _budgets(self) -> tuple[Status, str] | None:
        run, options = self.run, self.options
        held_up = self.patience.look(self.t_end, self.accumulations)
        if self._faded(1.0) or ((held_up is not None or self._stands()) and self._settled()):
            return None
        if self.patience.slow and (drawn := funnelled(run)):
            return self._classify(drawn, drawn, start=False)
        if held_up is not None:
            if held_up[0] is Status.MIN_STEP and (drawn := funnelled(run, behind=True)):
                return self._classify(drawn, drawn, start=False)
            return self._end(*held_up)
        if run.attempts >= options.max_steps:
            return self._end(Status.MAX_STEPS)
        if time.monotonic() - self.started > options.max_time:
            return self._end(Status.TIMEOUT)
        if self.progress is not None:
            self.progress(run.t, self.t_end)
        return self._spirals()

    def _aim(self) -> None:
        """Let the compiled loop run to the next instant of a time event, or to the end."""
        if not self.clocks:
            return
        run, clocks = self.run, self.clocks
        if run.machine.pieces is not None:
            run.machine.pieces.hold(clocks.pieces(run.t, run.direction))
        at = clocks.same(run.t) * 2
        if run.direction > 0:
            instant, due = clocks.following(run.t)
            run.machine.between(clocks.before(run.t + at)[0], instant)
        else:
            instant, due = clocks.before(run.t)
            run.machine.between(instant, clocks.following(run.t - at)[0])
        if (instant - self.t_end) * run.direction > clocks.same(self.t_end):
            due = []
        beyond = (instant - self.t_end) * run.direction > 0
        clocks.due, run.count.due = due, len(due)
        run.clock.t_end = self.t_end if beyond else instant
        run.clock.instant = run.clock.t_end if due else np.nan
        run.clock.same_instant = clocks.located(instant) if due else 0.0

    def _reached(self) -> tuple[Status, str] | None:
        """At the end, or at an instant of time events: reset, look where the solution goes, and go on."""
        run, machine = self.run, self.run.machine
        due = self.clocks.due
        if not due:
            return self._end(Status.SUCCESS)
        run.clock.t = run.clock.t_end
        # What is due behind the time events is a knot of an input, at which the state stays as it is.
        clocks = len(machine.system.time_events)
        knots = [machine.m + i for i in due if i >= clocks]
        due = [i for i in due if i < clocks]
        together = bool(run.events) and abs(run.events[-1].t - run.t) <= run.clock.same_instant
        jump = Jump(run.signs, run.x.copy(), (), tuple(due), together)
        resets = [machine.m + i for i in due if machine.system.time_events[i].reset is not None]
        held = [] if machine.pieces is None else list(machine.pieces.now)
        self._aim()
        if resets and run.direction < 0:
            return self._back_over(resets)
        if knots and not due:
            inputs = [machine.system.inputs[i - machine.m - clocks] for i in knots]
            if goes_on(run, all(samples.kind != "hold" for samples in inputs)):
                return self._end(Status.SUCCESS) if run.t == self.t_end else self._budgets()
        if knots and machine.pieces is not None:
            now = list(machine.pieces.now)
            machine.pieces.hold(held)
            jump = replace(jump, knot=tuple(self._near()))
            machine.pieces.hold(now)
        if resets or knots or machine.callbacks is not None:
            # What is reached at the very instant of a clock is one set with it (E5).
            ended = self._reset([*pending(run, reset_surfaces_at(run)), *resets, *knots], (), jump)
        else:
            ended = self._record(run.signs, run.lam, (), "", jump)
        if ended is None and run.t == self.t_end:
            return self._end(Status.SUCCESS)
        if ended is None and run.events.total >= self.options.max_events:
            return self._end(Status.MAX_EVENTS)
        return ended or self._budgets()

    def _general(self) -> tuple[Status, str] | None:
        """Events the compiled loop does not decide: corners, tangencies, several surfaces at once."""
        run = self.run
        triggered = [i for i in range(run.machine.m) if run.trigger[i] != 0]
        roots = [i for i in triggered if run.trigger[i] == codes.ROOT]
        near = self._near(roots)
        sliding = [i for i in range(run.machine.m) if run.mode[i] == 0]
        reached = sorted({*triggered, *near, *sliding})
        # The same place again and again means that the classification and the solution disagree.
        moved = abs(run.t - self.general_t) > 64 * np.finfo(float).eps * abs(run.t)
        self.stalled = 0 if moved else self.stalled + 1
        self.general_t = run.t
        # A step long beside the solution's own times, though within the tolerances, leads back here.
        run.clock.step *= _SHORTER**self.stalled
        ended, held = self._back_over(roots), self.higher.active
        active = pending(run, roots)
        if active and self.clocks.due and abs(run.t - run.clock.t_end) <= run.clock.same_instant:
            return self._reached()
        if ended is None:
            ended = self._decided(active, reached, triggered)
        if ended is None and self.higher.active is held and accumulates(run):
            return self._zeno()
        if ended is None and self.stalled > 4 * (run.machine.m + 1) and not self._settled(stuck=True):
            return self._end(Status.NO_CONTINUATION, stuck(run, triggered))
        return ended if ended is not None else self._budgets()

    def _back_over(self, triggered: Sequence[int]) -> tuple[Status, str] | None:
        """Backwards in time no reset is undone, and no relay with hysteresis: the end of the run at one."""
        run, m = self.run, self.run.machine.m
        relays = [i for i in triggered if i < m and run.machine.widths[i] > 0]
        resets = [i for i in triggered if i >= m or run.machine.resets_from[i]]
        sources = resets or relays
        if run.direction > 0 or not sources:
            return None
        name = "before a reset" if resets else "before a relay"
        here = tuple(i for i in sources if i < m)
        self.ambiguity = Ambiguity(run.t, name, (), run.signs, here, start=False)
        names = ", ".join(repr(source_name(run, i)) for i in sources)
        text = f"backwards in time, {names} is reached, where {BACKWARDS[name]} may have led to the state "
        text += f"{state_text(run)}; what was before it is not determined."
        return self._end(Status.NON_UNIQUE, text)

    def _reset(
        self, active: list[int], triggered: Sequence[int], jump: Jump | None = None
    ) -> tuple[Status, str] | None:
        """Apply the resets of surfaces reached or time events, and find where the solution goes on."""
        run, m = self.run, self.run.machine.m
        jump = jump or Jump(run.signs, run.x.copy())
        self._back()
        settled = settle(run, active, self.options.simultaneous, triggered)
        if settled.status is Status.ZENO and self.options.zeno == "continue":
            led, run.x[:] = run.x.copy(), jump.x
            if any(rests_in_cycle(run, i) for i in active if i < m):
                return self._reached()
            run.x[:] = led
        if settled.status is not None:
            return self._end(settled.status, f"at state {state_text(run)} {settled.detail}")
        jump = replace(jump, by=tuple(i for i in settled.surfaces if i < m))
        ended = self._classify(settled.reached, triggered, start=False, jump=jump)
        run.order[list(settled.left)] = 1
        if ended is None and (why := slipped(run, jump.before)):
            return self._end(Status.NO_CONTINUATION, f"at state {state_text(run)} {why}")
        return ended

    def _classify(
        self, reached: Sequence[int], triggered: Sequence[int], start: bool, jump: Jump | None = None,
        rested: Sequence[int] = (),
    ) -> tuple[Status, str] | None:  # fmt: skip
        """Find the modes that can follow on the surfaces reached, choose one, enter it, record the events.

        rested: contacts whose rate has come to 0, however little it was before.
        """
        run = self.run
        before = run.signs
        if jump is None:
            rested = [*rested, *(i for i in run.held_along() if run.machine.contacts[i])]
        base = tuple(0 if i in rested else sign for i, sign in enumerate(before))
        seen = watched(run, reached)
        reached = [i for i in reached if i not in seen]
        if not reached and (seen or jump is not None):
            run.put(before, (0,) * run.machine.m, tuple(run.lam))
            observe(run, seen)
            here, none = jump or Jump(before, run.x.copy()), np.zeros(run.machine.m)
            return None if start else self._record(run.signs, none, triggered, "", here)
        happens = None if start or jump is not None else [i for i in triggered if i not in seen]
        name, candidates, point = followers(run, base, reached, happens)
        # A slide may have come to its end where several modes seem to follow, or one that cannot be told.
        late = not start and jump is None
        if late and self._faded(FAR if name else CLOSE):
            return None
        if late and (name or self.higher.powerless()) and self._settled():
            return None
        begun = self.higher.idle(candidates) if jump is None else ""
        if isinstance(begun, Begun):
            mode, multipliers = begun.mode, begun.multipliers
            return None if start else self._changed(before, mode, multipliers, triggered, begun.note)
        if len(candidates) == 1 and name != SPIRAL:
            note = noted(point, name, candidates[0]) or close_call(run, candidates[0])
            return self._take(candidates[0], before, triggered, note, start, jump)
        where = f"at state {state_text(run)} on " + ", ".join(repr(run.names[i]) for i in reached)
        if not candidates:
            begun = self.higher.begin(reached, 1e2 * (run.atol + run.options.rtol * np.abs(run.x)))
            if isinstance(begun, Begun):
                jump = jump or Jump(before, run.x.copy())
                mode, multipliers = begun.mode, begun.multipliers
                at = triggered if mode != before else triggered[:1]
                return None if start else self._record(mode, multipliers, at, begun.note, jump)
            if jump is None and self._rests(reached, start):
                return None
            return self._end(*no_mode(run, where))
        causes = tuple(triggered) if jump is None else ()
        taken = picked(self.options.nonunique, candidates, before, causes)
        ambiguity = Ambiguity(run.t, name, candidates, before, causes, start)
        if taken is None:
            self.ambiguity = ambiguity
            if jump is not None:
                self._record(before, np.zeros(run.machine.m), triggered, str(ambiguity), jump)
            name += ", backwards in time" if run.direction < 0 else ""
            return self._end(Status.NON_UNIQUE, f"{name}, {where} can follow: {listing(candidates)}.")
        return self._take(taken, before, triggered, str(ambiguity), start, jump)

    def _take(
        self, chosen: Successor, before: Mode, triggered: Sequence[int], note: str, start: bool,
        jump: Jump | None = None,
    ) -> tuple[Status, str] | None:  # fmt: skip
        run, begun = self.run, self.higher.along(chosen)
        if not isinstance(begun, Begun):
            run.put(chosen.mode, chosen.order, chosen.multipliers, chosen.along)
        if "observer" in run.machine.roles:
            observe(run, watched(run, sorted({*triggered, *self._near()})))
        if any(a == 0 != b for a, b in zip(before, chosen.mode, strict=True)):
            # The step of a slide says nothing about the solution that leaves it.
            run.clock.step = 0.0
        jump = jump or Jump(before, run.x.copy())
        multipliers = np.array(chosen.multipliers)
        ended = None if start else self._record(run.signs, multipliers, triggered, note, jump)
        depart(run, chosen)
        return ended

    def _record(
        self, after: Mode, multipliers: Array, triggered: Sequence[int], note: str, jump: Jump
    ) -> tuple[Status, str] | None:
        """Record the change from the mode before to the one after, an event per surface; tell if it ends."""
        run, before = self.run, jump.before
        ended: tuple[Status, str] | None = None
        together = jump.together
        residual, _ = run.scales()
        for i in range(run.machine.m):
            kind = EventKind.RESET if i in jump.by else change_of(before[i], after[i], i in triggered)
            then = after
            if jump.by and kind is EventKind.GRAZING and run.reaches(i):
                kind, then = EventKind.CROSSING, passed_to(after, i)
            if kind is None:
                continue
            multiplier = float(multipliers[i]) if after[i] == 0 else float("nan")
            over = kind is EventKind.CROSSING and i not in triggered and bool(jump.by or jump.clocks)
            at = i in triggered or (jump.knot is not None and i in jump.knot and before[i] != 0)
            caused = jump.knot is not None and not at
            changes = kind in (EventKind.CROSSING, EventKind.ENTRY)
            root = changes and i in triggered
            root = root and (run.trigger[i] == codes.ROOT or run.machine.roles[i] == "observer")
            # Of a contact that is rested on the residual is that of its rate.
            root = root and not (after[i] == 0 and run.machine.contacts[i])
            if root and run.machine.callbacks is not None and not (jump.by or jump.clocks):
                run.check_root(run.t, i, jump.x.copy(), float(residual[i]), before)
            run.add_event(
                run.t, i, kind, jump.since or before, then, jump.x.copy(), multiplier, float(residual[i]),
                AT_KNOT if caused else JUMPED_OVER if over else note, together,
                run.x.copy() if jump.by else None,
            )  # fmt: skip
            together = True
            if run.count_down(i, kind, run.events[-1].direction):
                ended = self._stopped(run.events[-1]) or ended
            if kind is EventKind.GRAZING and self.options.on_graze == "error":
                ended = self._end(Status.GRAZING, f"{run.events[-1]}.")
        for i in jump.clocks:
            moved = run.machine.system.time_events[i].reset is not None
            run.add_event(
                run.t, run.machine.m + i, EventKind.TIME, before, after, jump.x.copy(), float("nan"), 0.0,
                note, together, run.x.copy() if moved else None,
            )  # fmt: skip
            together = True
        return ended
