"""Whether a run gets anywhere: steps and events counted against the time that they cover, never seconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filippov.base.status import Status
from filippov.kernel.loop.event_cycle import NEAR_END
from filippov.solving.diagnosis import LOOKS, NO_PROGRESS, STAGNATION, STAGNATION_STEPS, singular, stagnation
from filippov.solving.resets.jumps import state_text
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.selection.higher_order import PLAIN
from filippov.solving.state.run import Run
from filippov.solving.stiffness import StiffnessMonitor

# So many accumulations, or events after one, at one place: the solution cannot be led out of it.
MOST_LIMITS, MOST_EVENTS = 4, 100
# Events that are looked at together for whether they get anywhere.
PILE = 5_000


class Patience:
    """Looks now and then at how far a run has come, and says what holds it up."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.looked, self.held_up = (0, run.t), 0
        self.counted = (0, run.t)
        self.named = self.slow = False
        self.stiffness = StiffnessMonitor()
        self.since, self.why = 0, ""

    def limited(self, why: str) -> None:
        """Events accumulated, and the solution goes on; `why`: not in sliding of higher order."""
        self.since, self.why = len(self.run.events), why

    def look(self, t_end: float, accumulations: Sequence[Accumulation]) -> tuple[Status, str] | None:
        """How the run is to end where it gets nowhere, and a sentence; None where it does."""
        run = self.run
        self.stiffness.look(run)
        if accumulations and self._chattering(accumulations):
            limit = accumulations[-1]
            return Status.ZENO, (
                f"events go on accumulating at t = {limit.t:.12g}, state {state_text(run)}, where the "
                "solution was to go on: it follows none of the modes, nor sliding of higher order: "
                f"{self.why}."
            )
        self.slow = False
        if run.attempts - self.looked[0] >= STAGNATION_STEPS:
            left = abs(t_end - run.t)
            before, self.looked = self.looked[1], (run.attempts, run.t)
            moved = abs(run.t - before)
            self.slow = moved < STAGNATION * left
            # Towards t = 0 the spacing of t shrinks with the steps.
            gets_on = moved >= NO_PROGRESS * self._horizon(left) or abs(run.t) < 0.5 * abs(before)
            self.held_up = 0 if gets_on else self.held_up + 1
            why = stagnation(run, moved / left) if moved < STAGNATION * left else ""
            if not why and self.held_up:
                why = singular(run)
            self.named = bool(why)
            if not why and self.held_up >= LOOKS:
                why = f"{STAGNATION_STEPS} steps led on by {moved:.1g} only, {LOOKS} times in a row."
            if why:
                return Status.MIN_STEP, f"state {state_text(run)}. {why}"
        return self._pile(t_end)

    def _pile(self, t_end: float) -> tuple[Status, str] | None:
        """Whether events pile up in next to no time, following no law that gives their limit."""
        run = self.run
        if run.events.total - self.counted[0] < PILE:
            return None
        left, moved = abs(t_end - run.t), abs(run.t - self.counted[1])
        self.counted = (run.events.total, run.t)
        if moved >= NO_PROGRESS * self._horizon(left):
            return None
        taking = sorted({e.index for e in run.events[-64:]})
        names = ", ".join(repr(run.machine.surfaces[i].name) for i in taking if i < run.machine.m)
        return Status.MAX_EVENTS, (
            f"the last {PILE} events, on {names}, led on by {moved:.1g} only, state {state_text(run)}: they "
            "pile up by no law that tells their limit. A relay that feels its own switching needs a "
            "hysteresis, Surface(..., width=...); a spiral into a corner may be slower than its rounding."
        )

    def _horizon(self, left: float) -> float:
        """What steps are to get on with: the time left, or the solution's own where it is to run forever.

        Its own is the time run, or the one in which its field moves the state by its size.
        """
        run = self.run
        field = np.abs(run.machine.rhs(run.t, run.x, np.where(run.mode == 0.0, run.lam, run.mode), run.mode))
        speed = float(np.max(field[np.isfinite(field)], initial=0.0))
        own = float(np.max(np.abs(run.x), initial=0.0)) / speed if speed > 0.0 else np.inf
        return min(left, max(abs(run.t - float(run.clock.t_start)), own))

    def hint(self, status: Status) -> str:
        """What slows an explicit method down, or what plain functions cannot do; "" where neither does."""
        plain = self.run.machine.system.field is not None
        if plain and status in (Status.NO_CONTINUATION, Status.NO_SLIDING):
            return f" If h and dh/dt are both 0 here: {PLAIN}."
        return "" if self.named else self.stiffness.hint(self.run, status)

    def _chattering(self, accumulations: Sequence[Accumulation]) -> bool:
        """Whether the solution does not get away from an accumulation that it was to be led out of."""
        run, last = self.run, accumulations[-1]
        elapsed = abs(last.t - float(run.clock.t_start))
        # Contacts hold what has come to rest on them: bodies that rest one after the other do not chatter.
        held = run.machine.contacts
        loose = [a for a in accumulations if not all(held[i] for i in a.surfaces)]
        here = [a for a in loose if abs(a.t - run.t) <= NEAR_END * elapsed]
        return bool(here) and (len(here) >= MOST_LIMITS or len(run.events) - self.since >= MOST_EVENTS)
