"""A model at a state: its field in a mode, the rates of its surfaces on both sides, and their rounding.

The text of this file is part of exported modules: it needs `math` alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from filippov.io.automaton.method import EPS

# Parts of the terms of a rate: below CLEAR its sign is not trusted, below NO_RATE it is none.
CLEAR, NO_RATE = 1e-6, 1e-12
# The error of the time of an event, over |t|; events closer than SAME of the time run pile up.
INSTANT, SAME = 1.42e-14, 1e-12
# A slide whose two rates have come this close to each other, of what they were, is near a two-fold.
NEAR_FOLD = 1e-3
# A flight between impacts that is shorter than this part of t cannot be followed.
SHORTEST = 1e-10
# States that differ by this part of their size are one; so many resets are tried in every order.
ONE_STATE, MOST_ORDERS = 1e-9, 6


class Refusal(Exception):  # noqa: N818  # caught inside, where it becomes a status
    """Why a run cannot go on: a name, and a sentence."""

    def __init__(self, name: str, sentence: str) -> None:
        super().__init__(sentence)
        self.name = name


class Event(NamedTuple):
    """What happened at time t on a surface or clock; kind is crossing, sliding entry, sliding exit, reset or
    time event, x the state that was reached.
    """

    t: float
    surface: str
    kind: str
    before: tuple[int, ...]
    after: tuple[int, ...]
    x: tuple[float, ...]


class Result:
    """A run: times t, states x (a list a time), modes, outputs by name, events, and how it ended.

    status is "success", or the name of what the automaton does not decide; message says where.
    """

    def __init__(self) -> None:
        self.t: list[float] = []
        self.x: list[list[float]] = []
        self.modes: list[tuple[int, ...]] = []
        self.events: list[Event] = []
        self.outputs: dict[str, list[float]] = {}
        self.status, self.message = "success", "The end of t_span was reached."

    @property
    def success(self) -> bool:
        """Whether the end of t_span was reached."""
        return self.status == "success"


def checked_parameters(model: Any, given: Mapping[str, float] | None) -> list[float]:
    """Values of all parameters in order: defaults, replaced by those given by name. Raises ValueError."""
    for name in given or {}:
        if name not in model.PARAMETERS:
            raise ValueError(f"unknown parameter {name!r}; known: {', '.join(model.PARAMETERS)}")
    values = []
    for name, (default, lower, upper) in model.PARAMETERS.items():
        value = float((given or {}).get(name, default))
        if not (lower <= value <= upper and math.isfinite(value)):
            raise ValueError(f"parameter {name!r} is {value}, expected a number in [{lower}, {upper}].")
        values.append(value)
    return values


def size_power(size: float, exponent: float) -> float:
    """A power of a size |h|, which is negative in stages beyond its surface: held at 0 there."""
    if exponent < 1:
        raise Refusal(
            "non_lipschitz", f"the field holds |h|**{exponent:g}: an exported automaton needs a power >= 1."
        )
    return size**2 if exponent == 2 else size if exponent == 1 else math.pow(max(size, 0.0), exponent)


def sign_of(value: float) -> float:
    """-1, 0 or 1."""
    return float((value > 0) - (value < 0))


def rate(row: Sequence[float], f: Sequence[float]) -> float:
    """dh/dt = dh/dx . f + dh/dt along the field f; the row has dh/dt last."""
    return sum((g * v for g, v in zip(row[:-1], f, strict=True)), row[-1])


class AtState:
    """A model at parameter values, with the mode m and the state x at time t of one run."""

    def __init__(
        self, model: Any, x0: Sequence[float], t0: float, parameters: Mapping[str, float] | None
    ) -> None:
        if len(x0) != len(model.STATES) or not all(math.isfinite(v) for v in x0):
            raise ValueError(f"x0 is {x0}, expected a finite number each for {', '.join(model.STATES)}.")
        self.model, self.p = model, checked_parameters(model, parameters)
        self.t, self.x = float(t0), [float(v) for v in x0]
        self.m = [1] * len(model.SURFACES)
        # How many derivatives of h vanish where a surface has just been left; the start and the largest
        # difference of rates of a slide.
        self.order = [0] * len(self.m)
        self.since, self.widest = [self.t] * len(self.m), [0.0] * len(self.m)
        # Kinks on which the state stays until the next event: their h is not watched, and has to stay 0.
        self.still = [False] * len(self.m)
        self.crowd = 0  # events in a row that pile up
        self.length, self.atol = 0.0, 1e-12  # of the next step, 0 at the start

    def sliding(self) -> list[int]:
        """The surfaces that the solution slides on."""
        return [i for i, sign in enumerate(self.m) if sign == 0]

    def gradients(self, t: float, x: Sequence[float]) -> list[list[float]]:
        """Rows dh/dx, and behind them dh/dt."""
        rows: list[list[float]] = self.model.gradients(t, x, self.p, self.m)
        return rows

    def velocity(self, t: float, x: Sequence[float]) -> list[float]:
        """The field of the mode: while sliding, the combination of both sides with dh/dt = 0."""
        return self.motion(t, x)[0]

    def motion(self, t: float, x: Sequence[float]) -> tuple[list[float], list[float]]:
        """The field of the mode, and its signs: those of the mode, and while sliding the multipliers."""
        sliding, values = self.sliding(), [float(sign) for sign in self.m]
        if not sliding:
            return self.model.field(t, x, self.p, self.m, self.m), values
        if len(sliding) > 1 and not self.model.AFFINE:
            raise Refusal("corner", f"the solution slides on {self.named(sliding)} under a product of signs.")
        rows, signs = self.gradients(t, x), [sign or -1 for sign in self.m]
        low = self.model.field(t, x, self.p, signs, self.m)
        out = list(low)
        for i in sliding:
            signs[i] = 1
            high = self.model.field(t, x, self.p, signs, self.m)
            signs[i] = -1
            minus, plus = rate(rows[i], low), rate(rows[i], high)
            if not minus - plus > 1e-9 * (abs(minus) + abs(plus)) and self.model.CONTACT[i] == 0:
                raise Refusal(
                    "no_sliding", f"nothing holds the solution on surface {self.model.SURFACES[i]!r}."
                )
            weight = minus / (minus - plus)
            values[i] = 2 * weight - 1
            out = [v + weight * (b - a) for v, a, b in zip(out, low, high, strict=True)]
        return out, values

    def outputs(self) -> list[float]:
        """The outputs at the state; NaN for all where one has no value, or nothing holds a slide."""
        try:
            signs = self.motion(self.t, self.x)[1]
            found: list[float] = self.model.outputs(self.t, self.x, self.p, signs, self.m)
        except (ArithmeticError, ValueError, Refusal):
            return [math.nan] * len(self.model.OUTPUTS)
        return found

    def sides(self, i: int, t: float, x: Sequence[float]) -> tuple[float, float, float]:
        """dh_i/dt under the fields at s_i = +1 and -1, and the size of their terms."""
        held, self.m[i] = self.m[i], 0
        try:
            row, signs = self.gradients(t, x)[i], [sign or 1 for sign in self.m]
            rates, size = [], abs(row[-1])
            for side in (1, -1):
                signs[i] = side
                f = self.model.field(t, x, self.p, signs, self.m)
                rates.append(rate(row, f))
                size = max(size, sum(abs(g * v) for g, v in zip(row[:-1], f, strict=True)))
        finally:
            self.m[i] = held
        return rates[0], rates[1], size

    def at_ends(self, i: int, t: float, x: Sequence[float]) -> tuple[float, float, float]:
        """dh_i/dt at the upper and the lower end of the set of signs at h_i = 0, and its size.

        A resting contact has one end only: its other rate is that of an unlimited push.
        """
        plus, minus, size = self.sides(i, t, x)
        low, high = self.model.ends(t, x, self.p)[i]
        upper = 0.5 * ((1 + high) * plus + (1 - high) * minus)
        lower = 0.5 * ((1 + low) * plus + (1 - low) * minus)
        if self.model.CONTACT[i] > 0:
            lower = math.inf
        elif self.model.CONTACT[i] < 0:
            upper = -math.inf
        return upper, lower, size

    def noise(self, i: int, t: float, x: Sequence[float]) -> float:
        """What rounding makes of h_i: of its terms, and of its rate over the error of the time."""
        row = self.gradients(t, x)[i]
        terms = abs(row[-1] * t) + sum(abs(g * v) for g, v in zip(row[:-1], x, strict=True))
        held = [sign or 1 for sign in self.m]
        return 8 * EPS * terms + INSTANT * abs(t * rate(row, self.model.field(t, x, self.p, held, self.m)))

    def at_rest(self, i: int, t: float, x: Sequence[float], value: float) -> bool:
        """Whether h_i = value is that of a kink on which the state stays."""
        return abs(value) <= 64 * self.noise(i, t, x) + 1e-3 * self.atol

    def coupled(self, i: int) -> list[int]:
        """The surfaces that the solution slides on and whose signs have to do with surface i."""
        part = self.model.COMPONENT
        return [j for j in self.sliding() if j != i and part[j] == part[i]]

    def named(self, surfaces: Sequence[int]) -> str:
        """Names of surfaces for a message."""
        return ", ".join(repr(self.model.SURFACES[i]) for i in surfaces)
