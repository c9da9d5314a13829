"""The event loop of an exported automaton: one smooth field a mode, events located and landed on.

A mode has +1, -1 or 0 (sliding) for every surface. While sliding, the sign of a surface is the multiplier at
which dh/dt = 0; it is left where the rate of h on one side vanishes. What follows an event, `decisions` say.

The text of this file is part of exported modules: it needs `math` alone, and the files before it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from filippov.io.automaton.decisions import Decisions
from filippov.io.automaton.method import (
    EPS,
    PLACES,
    PROBES,
    Step,
    bernstein_values,
    coefficients,
    first_zero,
    without_zeros_at_start,
)
from filippov.io.automaton.values import SAME, Event, Refusal, Result


class Clock:
    """Instants start + k period, or those of a list."""

    def __init__(
        self, name: str, start: float = 0.0, period: float = math.inf, times: Sequence[float] | None = None
    ) -> None:
        if times is None and not (period > 0 and math.isfinite(start) and math.isfinite(period)):
            raise ValueError(f"clock {name!r} has the period {period} from {start}, expected a number > 0.")
        if times is not None and any(a >= b for a, b in itertools.pairwise(times)):
            raise ValueError(f"clock {name!r} has the times {times}, expected increasing ones.")
        self.name, self.start, self.period, self.times = name, start, period, times

    def after(self, t: float) -> float:
        """The first instant after t; inf if there is none."""
        if self.times is not None:
            return min((q for q in self.times if q > t), default=math.inf)
        k = max(math.floor((t - self.start) / self.period) - 1, 0)
        while self.start + k * self.period <= t:
            k += 1
        return self.start + k * self.period


class Automaton(Decisions):
    """One run of a model forwards in time; `advance` takes it to a time, `result` holds what happened."""

    def __init__(
        self, model: Any, x0: Sequence[float], t0: float, parameters: Mapping[str, float] | None = None,
        rtol: float = 1e-10, atol: float = 1e-12, max_steps: int = 1_000_000,
    ) -> None:  # fmt: skip
        if not (rtol >= 1e-13 and atol > 0 and math.isfinite(t0)):
            raise ValueError(
                f"rtol {rtol}, atol {atol}, t0 {t0}: expected rtol >= 1e-13, atol > 0, finite t0."
            )
        super().__init__(model, x0, t0, parameters)
        self.first, self.rtol, self.atol, self.room = float(t0), rtol, atol, max_steps
        self.last = -math.inf
        self.clocks = model.clocks(self.p)
        # Kept, not taken from t: a step may end within rounding before an instant, which is still to come.
        self.waiting = [clock.after(self.t + self.same()) for clock in self.clocks]
        self.result = Result()
        try:
            self.start()
        except Refusal as why:
            self.stop(why)
        self.note()

    def advance(self, t_end: float) -> bool:
        """Go on to t_end; False where the run has stopped."""
        while self.result.success and self.t < t_end:
            try:
                self.move(t_end)
            except Refusal as why:
                self.stop(why)
            self.note()
        return self.result.success

    def move(self, t_end: float) -> None:
        """One step, to an event, to the next instant of a clock, or to t_end at most."""
        due = min(self.waiting, default=math.inf)
        goal = min(due, t_end)
        if goal - self.t > self.same():
            step, found = self.tried(goal)
            if found is not None:
                self.land(step, *found)
                return
            self.x = step.end
            self.t = goal if goal - self.t - step.length <= 4 * EPS * abs(goal) else self.t + step.length
            self.order = [0] * len(self.m)
            self.project()
            self.check_still()
        else:
            self.t = goal
        if self.t == due:
            self.strike()

    def same(self) -> float:
        """Closer to t than that an instant is t."""
        return 32 * EPS * max(abs(self.t), abs(self.t - self.first))

    def tried(self, goal: float) -> tuple[Step, tuple[int, str, float, float] | None]:
        """A step within the tolerance, and the first event on it: surface, what is 0, where, its slope."""
        length = min(self.length or self.first_length(), goal - self.t)
        while True:
            self.room -= 1
            if self.room < 0:
                raise Refusal("max_steps", "the budget of steps is used up.")
            if length <= 16 * EPS * max(abs(self.t), 1e-300):
                said = "the step fell below the spacing of t: the field is not finite here, or not smooth off"
                raise Refusal("min_step", f"{said} its surfaces.")
            try:
                step = Step(self.velocity, self.t, self.x, length)
                error = self.size_of(step)
                if error <= 1.0:
                    watched = self.watched(step)
                    if watched is not None:
                        natural = length * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
                        # A step cut off by t_end or by a clock says little about the one after it.
                        cut = length == goal - self.t
                        self.length = max(natural, self.length) if cut else natural
                        return step, self.first_event(step, watched)
                    length *= 0.5
                    continue
                length *= max(0.2, 0.9 * error**-0.2) if math.isfinite(error) else 0.2
            except (ArithmeticError, ValueError):
                length *= 0.2
            except Refusal as why:
                if why.name != "no_sliding" or length <= 1e-9 * max(abs(self.t), abs(goal - self.t)):
                    raise
                length *= 0.2

    def first_length(self) -> float:
        """A first step from the sizes of state and field."""
        f = self.velocity(self.t, self.x)
        scale = [self.atol + self.rtol * abs(v) for v in self.x]
        far = max((abs(v) / s for v, s in zip(self.x, scale, strict=True)), default=0.0)
        fast = max((abs(v) / s for v, s in zip(f, scale, strict=True)), default=0.0)
        return 1e-3 * far / fast if far > 1e-5 and fast > 1e-5 else 1e-6

    def size_of(self, step: Step) -> float:
        """The error of a step over the tolerance; NaN where it has none."""
        parts = [
            abs(e) / (self.atol + self.rtol * max(abs(a), abs(b)))
            for e, a, b in zip(step.error, step.x, step.end, strict=True)
        ]
        return max(parts) if all(math.isfinite(q) for q in parts) else math.nan

    def values(self, t: float, x: Sequence[float]) -> dict[tuple[int, str], float]:
        """What is watched, above 0 in the mode: s h + width, and while sliding the rates at both ends."""
        h = self.model.guards(t, x, self.p, self.m)
        out = {}
        for i, sign in enumerate(self.m):
            if self.still[i]:
                continue
            if sign:
                out[i, "h"] = sign * h[i] + self.model.WIDTH[i]
                continue
            upper, lower, _ = self.at_ends(i, t, x)
            if self.model.CONTACT[i] >= 0:
                out[i, "upper"] = -upper
            if self.model.CONTACT[i] <= 0:
                out[i, "lower"] = lower
        return out

    def watched(self, step: Step) -> dict[tuple[int, str], list[float]] | None:
        """The watched functions over the step in Bernstein form; None where a polynomial misses one."""
        rows = [self.values(step.t + q * step.length, step.at(q)) for q in PLACES]
        probes = [self.values(step.t + q * step.length, step.at(q)) for q in PROBES]
        out = {}
        for key in rows[0]:
            c = coefficients([row[key] for row in rows])
            size = max(abs(row[key]) for row in rows)
            room = 1e-9 * size + self.rounding(key, step.t, step.x)
            for place, probe in zip(PROBES, probes, strict=True):
                value = sum(b * q for b, q in zip(bernstein_values(place, len(c) - 1), c, strict=True))
                if not abs(value - probe[key]) <= room:
                    return None
            out[key] = c
        return out

    def rounding(self, key: tuple[int, str], t: float, x: Sequence[float]) -> float:
        """What a watched function is known to."""
        if key[1] == "h":
            return 64 * self.noise(key[0], t, x)
        widest = self.widest[key[0]]
        return 1e-12 * (widest if math.isfinite(widest) else self.at_ends(key[0], t, x)[2])

    def first_event(
        self, step: Step, watched: Mapping[tuple[int, str], list[float]]
    ) -> tuple[int, str, float, float] | None:
        """The earliest zero of the watched functions: surface, which function, place in the step, slope."""
        best = None
        for (i, what), c in watched.items():
            place = first_zero(without_zeros_at_start(c, self.order[i]) if what == "h" else c)
            if place is not None and (best is None or place < best[2]):
                n = len(c) - 1
                basis = bernstein_values(place, n - 1)
                slope = n * sum(b * (c[k + 1] - c[k]) for k, b in enumerate(basis)) / step.length
                best = (i, what, place, slope)
        return best

    def land(self, step: Step, i: int, what: str, place: float, slope: float) -> None:
        """Take the step that ends where a watched function vanishes, and decide what follows."""
        t, x = self.t, self.x
        for _ in range(len(self.m) + 2):
            length = self.landing(t, x, (i, what), place * step.length, slope)
            end = Step(self.velocity, t, x, length).end if length > 0 else list(x)
            found = self.values(t + length, end)
            missed = [
                key for key, value in found.items()
                if key != (i, what) and self.order[key[0]] == 0 and value < -self.tiny(key, t + length, end)
            ]  # fmt: skip
            if not missed:
                break
            # Another one was first by less than the dense output tells.
            (i, what), place = missed[0], length / step.length
            slope = (found[i, what] - self.values(t, x)[i, what]) / length
        else:
            raise Refusal("corner", f"events are too close to be put in order: {self.named([i])}.")
        self.t, self.x = t + length, end
        self.project()
        together = {key: None for key, value in found.items()
                    if self.order[key[0]] == 0 and abs(value) <= self.tiny(key, self.t, end)}  # fmt: skip
        together[i, what] = None
        self.crowd = self.crowd + 1 if self.t - self.last <= SAME * (self.t - self.first) + self.same() else 0
        self.last = self.t
        if self.crowd > 4 * len(self.m) + 4:
            raise Refusal("zeno", f"events accumulate; the last was on surface {self.named([i])}.")
        if len({j for j, _ in together}) < len(together):
            raise Refusal(
                "two-fold", f"the slide on surface {self.named([i])} ends where it attracts no more."
            )
        parts = [self.model.COMPONENT[j] for j, _ in together]
        alone = len(together) == 1
        if not alone and (len(set(parts)) < len(parts) or any(self.model.RESET_FROM[j] for j, _ in together)):
            raise Refusal("corner", f"surfaces are reached together: {self.named([j for j, _ in together])}.")
        jumps = [j for j, which in together if which == "h" and self.model.RESET_FROM[j] in (2, self.m[j])]
        if jumps:
            self.check_order([*jumps, *self.due()])
        self.order = [0] * len(self.m)
        for j, which in together:
            before = tuple(self.m)
            reached = tuple(self.x)
            kind = self.reach(j) if which == "h" else self.leave(j, which, slope if alone else -math.inf)
            freed = self.leave_kinks()
            others = self.passed(before, j) if kind == "reset" else freed
            for i, told in sorted([(j, kind), *others]):
                self.record(self.model.SURFACES[i], told, before, reached)

    def check_still(self) -> None:
        """Refuse a kink that the solution was to stay on until an event, and has left."""
        h = self.model.guards(self.t, self.x, self.p, self.m)
        for i, still in enumerate(self.still):
            if still and not self.at_rest(i, self.t, self.x, h[i]):
                raise Refusal("tangency", f"the solution leaves surface {self.named([i])} along it.")

    def leave_kinks(self) -> list[tuple[int, str]]:
        """Behind an event: where the kinks that the solution has stayed on are left to, with crossings."""
        crossed = []
        for i in [i for i, still in enumerate(self.still) if still]:
            before = self.m[i]
            self.decide_kink(i, True)
            if self.m[i] != before:
                crossed.append((i, "crossing"))
        return crossed

    def tiny(self, key: tuple[int, str], t: float, x: Sequence[float]) -> float:
        """What is 0 of a watched function at an event."""
        if key[1] == "h":
            return 2 * self.noise(key[0], t, x)
        return 1e-12 * self.at_ends(key[0], t, x)[2]

    def landing(
        self, t: float, x: Sequence[float], key: tuple[int, str], length: float, slope: float
    ) -> float:
        """The length of the step at whose end a watched function is 0: the secant method on real steps."""
        if length <= 0.0:
            return 0.0
        past, moved = None, math.inf
        for _ in range(12):
            value = self.values(t + length, Step(self.velocity, t, x, length).end)[key]
            if past is not None and past[0] != length and past[1] != value:
                slope = (value - past[1]) / (length - past[0])
            if value == 0.0 or slope == 0.0 or not math.isfinite(value):
                break
            moved, past = -value / slope, (length, value)
            if abs(moved) <= 2 * EPS * max(abs(t), length):
                return length
            length = min(max(length + moved, 0.25 * length), 2 * length)
        if value == 0.0 or abs(moved) <= 1e3 * EPS * max(abs(t), length):
            return length
        raise Refusal("tangency", f"the solution grazes surface {self.named([key[0]])}, or crosses it "
                      "almost along it.")  # fmt: skip

    def due(self) -> list[int]:
        """The clocks of this instant, by their numbers among resets: behind those of surfaces."""
        late = self.t + self.same()
        return [len(self.m) + k for k, at in enumerate(self.waiting) if at <= late]

    def met(self) -> list[int]:
        """The surfaces whose reset falls on this instant too, within rounding."""
        h = self.model.guards(self.t, self.x, self.p, self.m)
        return [
            i for i, sign in enumerate(self.m)
            if sign and self.model.RESET_FROM[i] in (2, sign) and self.order[i] == 0
            and abs(h[i]) <= self.noise(i, self.t, self.x)
        ]  # fmt: skip

    def strike(self) -> None:
        """The clocks that are due now, one after the other in their order, and the signs after them."""
        self.check_order([*self.met(), *self.due()])
        for k, clock in enumerate(self.clocks):
            if self.waiting[k] > self.t + self.same():
                continue
            self.waiting[k] = clock.after(self.t + self.same())
            before, reached = tuple(self.m), tuple(self.x)
            self.x = self.model.strike(k, self.t, self.x, self.p, self.m)
            if not all(math.isfinite(v) for v in self.x):
                raise Refusal("not_finite", f"the reset of clock {clock.name!r} gives no finite state.")
            if tuple(self.x) != reached:
                self.after_jump(before)
            self.leave_kinks()
            for i, kind in self.passed(before):
                self.record(self.model.SURFACES[i], kind, before, reached)
            self.record(clock.name, "time event", before, reached)

    def record(self, surface: str, kind: str, before: tuple[int, ...], reached: tuple[float, ...]) -> None:
        """Keep an event."""
        self.result.events.append(Event(self.t, surface, kind, before, tuple(self.m), reached))

    def note(self) -> None:
        """Keep the state."""
        self.result.t.append(self.t)
        self.result.x.append(list(self.x))
        self.result.modes.append(tuple(self.m))
        for name, value in zip(self.model.OUTPUTS, self.outputs(), strict=True):
            self.result.outputs.setdefault(name, []).append(value)

    def stop(self, why: Refusal) -> None:
        """End the run by name."""
        self.result.status = why.name
        self.result.message = f"stopped at t = {self.t:.12g}: {why}"


def simulate(
    model: Any, x0: Sequence[float], t_span: Sequence[float], parameters: Mapping[str, float] | None = None,
    rtol: float = 1e-10, atol: float = 1e-12, max_steps: int = 1_000_000,
) -> Result:  # fmt: skip
    """Run a model from x0 over t_span = (t0, t1), t0 < t1.

    Raises ValueError for arguments that do not fit; what stops a run is told by `status` and `message`.
    """
    t0, t1 = (float(q) for q in t_span)
    if not (t0 < t1 and math.isfinite(t1)):
        raise ValueError(f"t_span is {t_span}, expected two times t0 < t1.")
    run = Automaton(model, x0, t0, parameters, rtol, atol, max_steps)
    run.advance(t1)
    return run.result
