"""Where a solution settles: events that pile up, arrivals, and sliding of higher order from there on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import Status
from filippov.kernel.tables import codes
from filippov.solving.patience import Patience
from filippov.solving.resets.jumps import bouncing, endless, pending
from filippov.solving.resets.reset_cycle import passes_at_rest, rests_in_cycle
from filippov.solving.resets.rest import CLOSE, NEAR_REST, come_to_rest, faded, on_equilibrium, rest, rests
from filippov.solving.resets.slow_spiral import SlowSpiral, slow_spiral
from filippov.solving.resets.zeno import (
    WITHIN,
    Accumulation,
    accumulates,
    accumulation,
    also_reached,
    beyond,
    bounces_on,
    bridge,
    distant,
    interrupted,
    lawful,
    not_before,
    rest_on_contact,
    second_order,
    sentence,
    with_approached,
)
from filippov.solving.selection.ambiguity import point_of
from filippov.solving.selection.faint_cycles import go_on
from filippov.solving.selection.higher_order import Begun, HigherOrder, Left
from filippov.solving.selection.modes import successors
from filippov.solving.selection.observed import observe, watched
from filippov.solving.state.change import Jump
from filippov.solving.state.events import Mode
from filippov.solving.state.options import Options
from filippov.solving.state.rates import off_contact
from filippov.solving.state.run import Run

# Of the time left: steps that get nowhere.
SHORT = 1e-4
# How a run ends, and a sentence; None while it goes on.
Ended = tuple[Status, str] | None


class Settling(ABC):
    """The part of the loop that leads a solution into limits and along sliding of higher order."""

    run: Run
    options: Options
    higher: HigherOrder
    patience: Patience
    looked_for_spiral: bool = False
    spiral: SlowSpiral | None = None
    accumulations: list[Accumulation]

    @abstractmethod
    def _end(self, status: Status, detail: str = "") -> tuple[Status, str]: ...

    @abstractmethod
    def _budgets(self) -> Ended: ...

    @abstractmethod
    def _reached(self) -> Ended: ...

    @abstractmethod
    def _reset(self, active: list[int], triggered: Sequence[int], jump: Jump | None = None) -> Ended: ...

    @abstractmethod
    def _classify(
        self, reached: Sequence[int], triggered: Sequence[int], start: bool, jump: Jump | None = None,
        rested: Sequence[int] = (),
    ) -> Ended: ...  # fmt: skip

    @abstractmethod
    def _record(
        self, after: Mode, multipliers: Array, triggered: Sequence[int], note: str, jump: Jump
    ) -> Ended: ...

    def _changed(
        self, before: Mode, after: Mode, multipliers: Array, triggered: Sequence[int], note: str,
    ) -> Ended:  # fmt: skip
        """Record a change of mode that has been taken up."""
        return self._record(after, multipliers, triggered, note, Jump(before, self.run.x.copy()))

    def _near(self, roots: Sequence[int] = ()) -> list[int]:
        """Surfaces that the present point lies on, to rounding; `roots`: those that it was led to."""
        sizes, scale = self.run.scales(roots)
        near = sizes <= 8 * np.finfo(float).eps * scale
        near[self.run.held_along()] = True
        # A relay with hysteresis switches at the edges of its band, not where h is 0.
        return [i for i in range(self.run.machine.m) if near[i] and self.run.machine.widths[i] == 0.0]

    def _zeno(self) -> Ended:
        """Events accumulate: name the limit, and stop there or go on in the limit mode."""
        run = self.run
        if self._settled():
            return self._budgets()
        code, limit = codes.GENERAL, None
        if self.options.zeno == "continue" and self.higher.active is None:
            before = run.signs
            code, limit = rest_on_contact(run)
        if code == codes.ENTRY and limit is not None:
            self.accumulations.append(limit)
            return self._changed(before, run.signs, run.lam, limit.surfaces, "") or self._budgets()
        limit = None if code == codes.NONE else accumulation(run)
        if limit is None or beyond(run, limit) or distant(run, limit) or interrupted(run, limit):
            run.zeno.array[:] = 0.0
            return self._budgets()
        if (limit.t - float(run.clock.t_end)) * run.direction > 0.0:
            limit = replace(limit, t=float(run.clock.t_end))
        limit = not_before(run, limit)
        self.accumulations.append(limit)
        detail = sentence(limit.t, limit.error, limit.x, limit.x_error)
        if self.options.zeno == "stop":
            return self._end(Status.ZENO, detail)
        machine = run.machine
        open_ends = [i for i in limit.surfaces if machine.resets_from[i] and not machine.contacts[i]]
        event = run.last_decided()
        last = -1 if event is None else event.index
        if last in open_ends and passes_at_rest(run, last, limit):
            # Of a block that rocks to rest on both feet: the signs hold it there until one lifts.
            before, kept = run.signs, (run.t, run.x.copy())
            run.clock.t, run.x[:] = limit.t, limit.x
            begun = self.higher.begin([last], np.full(machine.n, WITHIN * limit.x_error))
            held = run.x.copy()
            run.clock.t, run.x[:] = kept
            self.patience.limited(begun if isinstance(begun, str) else "")
            if isinstance(begun, Begun):
                bridge(run, limit)
                run.x[:] = held
                ended = self._changed(before, begun.mode, begun.multipliers, limit.surfaces, begun.note)
                return ended or self._budgets()
        if last in open_ends and rests_in_cycle(run, last, limit):
            return self._reached()
        if open_ends:
            names = ", ".join(repr(machine.surfaces[i].name) for i in open_ends)
            detail += f" There is no resting contact on {names} to go on with (see the docstring of Surface)."
            if machine.system.field is not None:
                detail += " contact=True gives one to a surface of functions whose reset is an impact."
            return self._end(Status.ZENO, detail)
        limit = with_approached(run, limit)
        rested = [i for i in limit.surfaces if machine.contacts[i]]
        if unending := endless(run, limit.x, off_contact(run, run.mode), rested):
            return self._end(Status.ZENO, f"{detail} {unending}")
        before = run.signs
        here = self.higher.arrives(limit.surfaces[0]) if len(limit.surfaces) == 1 else ""
        if isinstance(here, Begun):
            # What is left of the cycles is rounding already, and so is a limit by their law.
            return self._changed(before, here.mode, here.multipliers, limit.surfaces, here.note)
        besides = also_reached(run, limit)
        bridge(run, limit)
        zero = self._back()
        run.x[:] = limit.x
        begun = self.higher.begin([*limit.surfaces, *zero], np.full(machine.n, WITHIN * limit.x_error))
        self.patience.limited(begun if isinstance(begun, str) else "")
        if isinstance(begun, Begun):
            reached = limit.surfaces
            ended = self._changed(before, begun.mode, begun.multipliers, reached, begun.note)
            return ended or self._budgets()
        higher = second_order(run, limit)
        if higher is not None:
            run.x[:] = higher
            if rests(run, limit.surfaces):
                rest(run, limit.surfaces)
                return self._reached()
        run.x[:] = limit.x
        struck = pending(run, besides)
        on = self._with_slides([*limit.surfaces, *(i for i in besides if i not in struck)], zero)
        ended = self._classify(on, limit.surfaces, start=False, rested=rested)
        if ended is None and struck and (struck := pending(run, struck)):
            ended = self._reset(struck, ())
        return ended or self._budgets()

    def _spirals(self) -> Ended:
        """Half of the events went into ever slower cycles around a corner: go on in it, if that is wanted."""
        run, options = self.run, self.options
        if options.zeno != "continue" or self.looked_for_spiral or run.events.total < options.max_events // 2:
            return None
        self.looked_for_spiral = True
        spiral = slow_spiral(run)
        if spiral is None:
            return None
        run.x[:] = spiral.x
        self.spiral = spiral
        if len(spiral.surfaces) == 1:
            before = run.signs
            begun = self.higher.begin(spiral.surfaces, np.full(run.machine.n, spiral.distance))
            if isinstance(begun, Begun):
                return self._changed(before, begun.mode, begun.multipliers, spiral.surfaces, begun.note)
        return self._classify(self._with_slides(spiral.surfaces), spiral.surfaces, start=False)

    def _with_slides(self, reached: Sequence[int], zero: Sequence[int] = ()) -> list[int]:
        """The surfaces reached and those slid on: what changes at a limit may take these to their ends."""
        slid = [i for i, sign in enumerate(self.run.signs) if sign == 0 and i not in zero]
        return sorted({*reached, *slid})

    def _decided(self, active: list[int], reached: Sequence[int], triggered: Sequence[int]) -> Ended:
        """Decide events by resets, by sliding of higher order, or by the modes that can follow."""
        if active or bouncing(self.run, [i for i in triggered if self.run.trigger[i] == codes.ROOT]):
            ended = self._reset(active, triggered)
            return ended or (self._zeno() if bounces_on(self.run) else None)
        if seen := watched(self.run, triggered):
            return self._observed(seen, reached, [i for i in triggered if i not in seen])
        if self.higher.active is not None:
            return self._besides(triggered)
        if len(triggered) == 1 and self.run.trigger[triggered[0]] in (codes.ROOT, codes.TOUCH):
            if accumulates(self.run):
                return self._zeno()
            if on_equilibrium(self.run, triggered):
                return self._classify(sorted({*reached, *self._near()}), triggered, start=False)
            before = self.run.signs
            # Cycles that shrink by a law go on until their limit is near.
            root = self.run.trigger[triggered[0]] == codes.ROOT
            begun = "" if root and lawful(self.run) else self.higher.arrives(triggered[0])
            if isinstance(begun, Begun):
                return self._changed(before, begun.mode, begun.multipliers, triggered, begun.note)
            go_on(self.run, triggered[0])
            over = self.higher.across(triggered[0]) if root and triggered[0] in self._near() else None
            if over is not None:
                self.run.put(over.mode, over.order, tuple(self.run.lam.tolist()))
                return self._changed(before, over.mode, self.run.lam, triggered, "")
        return self._classify(reached, triggered, start=False)

    def _observed(self, seen: Sequence[int], reached: Sequence[int], others: Sequence[int]) -> Ended:
        """Decide what else happens at the instant of observers and user events as if these were not there."""
        run, first = self.run, self.run.signs
        ended = self._decided([], reached, others) if others else None
        before = run.signs
        seen = [i for i in seen if before[i] == first[i]]
        if ended is not None or not seen:
            return ended
        seen = observe(run, seen, first)
        if not seen:
            return None
        jump = Jump(before, run.x.copy(), together=bool(others), since=first)
        return self._record(run.signs, run.lam, seen, "", jump)

    def _arrived(self) -> bool:
        """Whether a solution that no step leads on has arrived where sliding of higher order begins."""
        run, before = self.run, self.run.signs
        if self._settled(stuck=True):
            return True
        for i in range(run.machine.m):
            begun = self.higher.arrives(i)
            if isinstance(begun, Begun):
                self._changed(before, begun.mode, begun.multipliers, (i,), begun.note)
                return True
        return False

    def _stands(self) -> bool:
        """Whether a slide goes on in ever shorter steps, with a field that leads within the tolerance."""
        run = self.run
        left = abs(float(run.clock.t_end) - run.t)
        if self.higher.active is not None or run.clock.step > SHORT * left or 0.0 not in run.mode:
            return False
        code, field, _, _ = run.machine.probe(run.t, 0.0, run.x, run.mode, run.lam)
        return code == 0 and bool(np.all(left * np.abs(field) <= run.atol + run.options.rtol * np.abs(run.x)))

    def _settled(self, stuck: bool = False) -> bool:
        """Whether a slide has led to the end of its own surface, where the solution stays from now on.

        stuck: or a solution along a surface, which no step leads on.
        """
        run, before = self.run, self.run.signs
        slid = self.higher.slid_lately(stuck)
        if not slid:
            return self._faded()
        begun = self.higher.settles(slid)
        if isinstance(begun, Begun):
            # A solution that goes on sliding comes to rest where it is tangent to a kink.
            at = [] if begun.mode != before or self.higher.active is None else self.higher.active.kinks[:1]
            self._changed(before, begun.mode, begun.multipliers, at, begun.note)
            return True
        near = come_to_rest(run, slid, NEAR_REST if stuck else 0.0)
        if near:
            rest(run, near)
        return bool(near) or self._faded()

    def _faded(self, close: float = CLOSE) -> bool:
        """Whether the solution stays at an equilibrium, from which it cannot be told any more.

        close: in tolerances; where steps are short beside the time left, CLOSE at least.
        """
        short = self.run.clock.step < SHORT * abs(float(self.run.clock.t_end) - self.run.t)
        near = faded(self.run, max(close, CLOSE) if short else close)
        if near:
            rest(self.run, near)
        return bool(near)

    def _rests(self, reached: Sequence[int], start: bool) -> bool:
        """Whether the solution stays where no mode follows."""
        # A corner entered tangentially may be none of the solution's modes, and yet a place to rest in.
        if rests(self.run, reached):
            rest(self.run, come_to_rest(self.run, reached, NEAR_REST) or reached)
            return True
        return not start and self._settled(stuck=True)

    def _back(self) -> tuple[int, ...]:
        """Interrupt sliding of higher order; returns the surfaces that it was on."""
        return () if self.higher.active is None else self.higher.suspend()

    def _besides(self, triggered: Sequence[int]) -> Ended:
        """An event during sliding of higher order: its end, or something on other surfaces."""
        run, higher = self.run, self.higher
        found, left = higher.active, higher.left(triggered)
        assert found is not None
        if left is None:
            others = [i for i in {*triggered, *self._near()} if i not in (*found.zero, *found.kinks)]
            return self._classify(sorted(others), triggered, start=False)
        before = run.signs
        higher.suspend()
        if found.kinks:
            left = self._with_kinks(left, sorted({*found.zero, *found.kinks}))
        run.put(left.mode, left.order, tuple(run.lam.tolist()))
        run.clock.step = 0.0
        ended = self._changed(before, left.mode, run.lam, triggered, "")
        if ended is None and left.remaining:
            slack = 1e2 * (run.atol + run.options.rtol * np.abs(run.x))
            again = higher.begin(left.remaining, slack)
            if isinstance(again, str):
                ended = self._classify(left.remaining, (), start=False)
        return ended

    def _with_kinks(self, left: Left, held: Sequence[int]) -> Left:
        """The kinks that were held leave with the surfaces slid on, each to its side, if one mode does so."""
        free = [i for i in held if left.mode[i] != 0]
        found = successors(point_of(self.run), left.mode, held)
        off = [c for c in found if all(c.mode[i] != 0 < c.order[i] for i in free)]
        return replace(left, mode=off[0].mode, order=off[0].order) if len(off) == 1 else left
