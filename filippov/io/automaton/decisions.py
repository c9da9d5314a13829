"""What follows where a surface is reached, left or jumped onto: the rates of h on both sides decide it.

Where they do not (corners of coupled surfaces, two-folds, tangencies, accumulations), the run stops and says
so by name: it never guesses.

The text of this file is part of exported modules: it needs `math` alone, and the files before it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from filippov.io.automaton.method import EPS, Step
from filippov.io.automaton.values import (
    CLEAR,
    MOST_ORDERS,
    NEAR_FOLD,
    NO_RATE,
    ONE_STATE,
    SHORTEST,
    AtState,
    Refusal,
    rate,
    sign_of,
)


class Decisions(AtState):
    """The mode at the start, and after every event."""

    def start(self) -> None:
        """The mode at the first state."""
        for _ in range(2):  # sizes |h| inside other switching functions follow the signs found first
            h = self.model.guards(self.t, self.x, self.p, self.m)
            self.m = [-1 if value < 0 else 1 for value in h]
        reached = [
            i for i, value in enumerate(h)
            if self.model.WIDTH[i] == 0 and abs(value) <= self.noise(i, self.t, self.x)
        ]  # fmt: skip
        if any(self.model.RESET_FROM[i] for i in reached):
            raise Refusal("corner", f"the state starts on surface {self.named(reached)}, which has a reset.")
        self.decide_on(reached)

    def decide_on(self, reached: Sequence[int]) -> None:
        """The signs of surfaces that the state lies on, by the rates of h on both sides."""
        parts = [self.model.COMPONENT[i] for i in reached]
        if len(set(parts)) < len(parts):
            raise Refusal("corner", f"the state lies on coupled surfaces: {self.named(reached)}.")
        kinks = [i for i in reached if self.model.ROLE[i] == "kink"]
        for i in reached:
            if i in kinks:
                continue
            upper, lower, size = self.at_ends(i, self.t, self.x)
            clear = CLEAR * size
            slides = self.model.ROLE[i] == "switching" and self.model.WIDTH[i] == 0
            if slides and upper < -clear and lower > clear:
                self.enter(i)
            elif min(upper, lower) > clear or max(upper, lower) < -clear:
                self.m[i], self.order[i] = (1 if upper > 0 else -1), 1
            else:
                said = f"the state starts tangent to surface {self.named([i])}, or leaves it both ways."
                raise Refusal("tangency", said)
        for i in kinks:  # what holds the state is known now
            self.decide_kink(i)

    def decide_kink(self, i: int, stayed: bool = False) -> None:
        """The side of a kink on which the solution goes on; or it stays on it, as at rest, until an event.

        The field is the same on both sides of a kink, and what counts is where h goes. Where it has stayed,
        the rate that the end of a slide leaves is that of rounding, and says nothing by itself.
        """
        held = self.m[i]
        ways = []
        for side in (1, -1):
            self.m[i] = side
            row, f = self.gradients(self.t, self.x)[i], self.velocity(self.t, self.x)
            size = abs(row[-1]) + sum(abs(g * v) for g, v in zip(row[:-1], f, strict=True))
            here = rate(row, f)
            if stayed:
                ways.append(self.way_off(i))
            elif abs(here) > CLEAR * size:
                ways.append((sign_of(here), 1))
            elif abs(here) > NO_RATE * size and not self.at_rest(i, self.t, self.x, here):
                ways.append((0.0, 0))
            else:
                ways.append(self.way_off(i))
        if ways[0] != ways[1] or ways[0] == (0.0, 0):
            said = f"the solution goes on tangent to surface {self.named([i])}, or leaves it both ways."
            raise Refusal("tangency", said)
        side, order = int(ways[0][0]), ways[0][1]
        self.m[i], self.order[i], self.still[i] = side or held or 1, max(order, 0), side == 0

    def way_off(self, i: int) -> tuple[float, int]:
        """The sign that h_i gets where its rate is 0, and its first power of time: (0, -1) if it stays 0."""
        stays, last = True, None  # the same at two lengths: one that is too long has some power by chance
        length = self.length or 1e-3
        for part in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5):
            try:
                ends = [Step(self.velocity, self.t, self.x, q * part * length).end for q in (1.0, 0.5)]
                whole, half = (
                    self.model.guards(self.t + q * part * length, end, self.p, self.m)[i]
                    for q, end in zip((1.0, 0.5), ends, strict=True)
                )
            except (ArithmeticError, ValueError, Refusal):  # too long a step
                stays = False
                continue
            stays = stays and self.at_rest(i, self.t, ends[0], whole)
            if whole * half > 0 and not self.at_rest(i, self.t, ends[1], half):
                power = math.log2(whole / half)
                found = (sign_of(whole), round(power)) if abs(power - round(power)) < 0.02 else None
                if found is not None and found == last and 0 < found[1] < 6:
                    return found
                last = found
        return 0.0, -1 if stays else 0

    def enter(self, i: int) -> None:
        """Begin to slide on a surface."""
        self.m[i], self.order[i], self.since[i] = 0, 0, self.t
        self.project()
        upper, lower, _ = self.at_ends(i, self.t, self.x)
        self.widest[i] = abs(lower - upper)

    def project(self) -> None:
        """Put the state back on every surface that it slides on, along the gradient."""
        for i in self.sliding():
            for contact in ([self.model.CONTACT[i]] if self.model.CONTACT[i] else []) + [0]:
                for _ in range(2):
                    self.m[i] = contact  # off contact the function is h, in it dh/dt
                    h = self.model.guards(self.t, self.x, self.p, self.m)[i]
                    row = self.gradients(self.t, self.x)[i][:-1]
                    self.m[i] = 0
                    size = sum(g * g for g in row)
                    if size > 0:
                        self.x = [v - h / size * g for v, g in zip(self.x, row, strict=True)]

    def after_jump(self, before: Sequence[int], but: int = -1) -> None:
        """Signs after the state has jumped; but: a surface that has its sign already."""
        h = self.model.guards(self.t, self.x, self.p, [sign or 1 for sign in before])
        reached = []
        for i, sign in enumerate(before):
            if i == but:
                continue
            self.still[i] = False
            width = self.model.WIDTH[i]
            beyond = width > 0 and sign * h[i] + width <= 0
            if width == 0 and abs(h[i]) <= self.noise(i, self.t, self.x):
                if self.model.RESET_FROM[i]:
                    raise Refusal(
                        "corner", f"the state jumps on surface {self.named([i])}, which has a reset."
                    )
                reached.append(i)
            elif beyond or (width == 0 and (sign == 0 or sign * h[i] < 0)):
                if self.model.RESET_FROM[i] != 0:
                    raise Refusal(
                        "corner", f"a jump leads across surface {self.named([i])}, which has a reset."
                    )
                self.m[i], self.order[i] = (1 if h[i] > 0 else -1), 0
            else:
                self.order[i] = 0
        self.decide_on(reached)

    def passed(self, before: Sequence[int], but: int = -1) -> list[tuple[int, str]]:
        """The surfaces that a jump has passed, entered or left, but one, with the kinds of their events."""
        kinds = {True: "sliding exit", False: "crossing"}
        return [
            (i, "sliding entry" if self.m[i] == 0 else kinds[sign == 0])
            for i, sign in enumerate(before) if i != but and self.m[i] != sign
        ]  # fmt: skip

    def reach(self, i: int) -> str:
        """What follows where h_i = 0 is reached from the side of its sign: the kind of event."""
        sign, model = self.m[i], self.model
        if model.RESET_FROM[i] in (2, sign):
            self.jump(i)
            return "reset"
        if model.ROLE[i] in ("switching", "reset") and self.coupled(i):
            raise Refusal("corner", f"surface {self.named([i])} is reached while the solution slides on "
                          f"{self.named(self.coupled(i))}.")  # fmt: skip
        if model.ROLE[i] != "switching" or model.WIDTH[i] > 0:
            row, f = self.gradients(self.t, self.x)[i], self.velocity(self.t, self.x)
            size = abs(row[-1]) + sum(abs(g * v) for g, v in zip(row[:-1], f, strict=True))
            if not -sign * rate(row, f) > CLEAR * size:
                raise Refusal("tangency", f"the solution grazes surface {self.named([i])}.")
            self.m[i], self.order[i] = -sign, (0 if model.WIDTH[i] > 0 else 1)
            return "crossing"
        plus, minus, size = self.sides(i, self.t, self.x)
        here, beyond = (plus, minus) if sign > 0 else (minus, plus)
        upper, lower, _ = self.at_ends(i, self.t, self.x)
        clear = CLEAR * size
        if abs(plus - minus) <= 1e-15 * size and -sign * here > NO_RATE * size:
            self.m[i], self.order[i] = -sign, 1  # the sign does not act on this rate
            return "crossing"
        if not -sign * here > clear or min(abs(upper), abs(lower), abs(beyond)) <= clear:
            where = self.named([i])
            said = f"the solution reaches surface {where} where the field on one side is tangent to it."
            raise Refusal("tangency", said)
        if upper < 0 < lower:
            self.enter(i)
            return "sliding entry"
        if sign * beyond < 0:
            self.m[i], self.order[i] = -sign, 1
            return "crossing"
        raise Refusal(
            "non_unique", f"at surface {self.named([i])} the solution can go on in more than one way."
        )

    def leave(self, i: int, which: str, slope: float) -> str:
        """What follows where the rate of h_i at an end of its set has come to 0: it is left there."""
        upper, lower, _ = self.at_ends(i, self.t, self.x)
        side = 1 if which == "upper" else -1
        other = lower if side > 0 else -upper
        if self.model.CONTACT[i] == 0:
            lasted = self.t - self.since[i]
            if not other > NEAR_FOLD * self.widest[i] or not -slope * lasted > CLEAR * other:
                raise Refusal(
                    "two-fold", f"the slide on surface {self.named([i])} ends where it attracts no more."
                )
        low, high = self.model.ends(self.t, self.x, self.p)[i]
        end = high if side > 0 else low
        self.m[i] = side
        self.order[i] = 3 if self.model.CONTACT[i] else 2 if abs(end - side) <= 1e-12 else 1
        return "sliding exit"

    def jump(self, i: int) -> None:
        """The reset of surface i, and the signs after it."""
        before = tuple(self.m)
        row, f = self.gradients(self.t, self.x)[i], self.velocity(self.t, self.x)
        size = sum(abs(g * v) for g, v in zip(row[:-1], f, strict=True)) + abs(row[-1])
        self.x = self.model.reset(i, self.t, self.x, self.p, self.m)
        if not all(math.isfinite(v) for v in self.x):
            raise Refusal("not_finite", f"the reset of surface {self.named([i])} gives no finite state.")
        h = self.model.guards(self.t, self.x, self.p, self.m)[i]
        if abs(h) > max(8 * self.noise(i, self.t, self.x), 64 * EPS * size):
            self.m[i], self.order[i] = (1 if h > 0 else -1), 0
        else:
            self.bounce(i, before[i], size)
        self.after_jump(before, but=i)

    def check_order(self, due: Sequence[int]) -> None:
        """Refuse resets of one instant whose order decides the state behind them.

        due: their numbers, first those of surfaces, then clocks. Those that commute are not tried.
        """
        for group in {self.model.ORDER[i] for i in due}:
            members = [i for i in due if self.model.ORDER[i] == group]
            if len(members) > MOST_ORDERS:
                said = f"{len(members)} resets are due at once, expected {MOST_ORDERS} at most where the"
                raise Refusal("non_unique", f"{said} order may matter.")
            if len(members) < 2:
                continue
            ways = [self.in_turn(order) for order in itertools.permutations(members)]
            for j in range(len(self.x)):
                size = max(abs(x[j]) for way in ways for x in way)
                ends = [way[-1][j] for way in ways]
                if not max(ends) - min(ends) <= ONE_STATE * size + self.atol:
                    said = "resets are due at once, and the state after them depends on their order."
                    raise Refusal("non_unique", said)

    def in_turn(self, order: Sequence[int]) -> list[list[float]]:
        """The states that resets pass through in an order, from the one that there is to the last."""
        m, states, count = list(self.m), [list(self.x)], len(self.m)
        for i in order:
            reset, k = (self.model.reset, i) if i < count else (self.model.strike, i - count)
            x = reset(k, self.t, states[-1], self.p, m)
            h = self.model.guards(self.t, x, self.p, [sign or 1 for sign in m])
            for j, value in enumerate(h):
                room = max(self.model.WIDTH[j], 64 * self.noise(j, self.t, x))
                if abs(value) > room and m[j] * value <= 0:
                    m[j] = 1 if value > 0 else -1
            states.append(x)
        return states

    def bounce(self, i: int, sign: int, size: float) -> None:
        """The sign of a surface that a reset has left the state on: off again, through, or at rest on it."""
        if self.model.ROLE[i] == "switching":
            self.decide_on([i])
            return
        contact = self.model.CONTACT[i] == sign
        row, f = self.gradients(self.t, self.x)[i], self.model.field(self.t, self.x, self.p, self.m, self.m)
        off = rate(row, f)
        size += sum(abs(g * v) for g, v in zip(row[:-1], f, strict=True))
        free, terms = 0.0, 0.0
        if contact:
            plus, minus, terms = self.sides(i, self.t, self.x)
            free = sign * (plus if sign > 0 else minus)
        if abs(off) <= NO_RATE * size:
            if contact and free < -CLEAR * terms:
                self.enter(i)
                return
            if contact and free > CLEAR * terms:
                self.m[i], self.order[i] = sign, 2
                return
            raise Refusal("tangency", f"a reset leaves the state at rest on surface {self.named([i])}.")
        low = off * off <= -2 * free * 1e2 * self.noise(i, self.t, self.x)
        # What has come this near by ever shorter flights does not go through: its limit is the surface.
        shrunk = self.crowd > 0 and sign * off < 0
        if shrunk or (contact and sign * off > 0 and (low or 2 * abs(off) <= -free * SHORTEST * abs(self.t))):
            raise Refusal("zeno", f"resets accumulate at surface {self.named([i])}.")
        self.m[i], self.order[i] = (1 if off > 0 else -1), 1
