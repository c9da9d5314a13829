"""Test signals: steps, square waves, pseudo-random binary sequences, chirps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy
from sympy import Expr

from filippov.base.errors import ModelError
from filippov.base.given import number_array, whole
from filippov.base.keywords import keywords
from filippov.base.symbolic_value import is_expression
from filippov.model.check import as_expression
from filippov.model.parameter import as_number
from filippov.model.signals.input import Input
from filippov.model.symbols import t

# Registers whose longest sequences are known, and so many states of one at most.
SHORTEST, LONGEST = 2, 16
_input: Any = Input


@keywords("keyword", error=ModelError, own=("name",))
def step(name: str, times: Any, levels: Sequence[float]) -> Expr:
    """Steps of an input at known times: levels[0] before times[0], levels[k] from times[k - 1] on.

    times    one time, or increasing ones; levels: one more than times
    """
    at = np.atleast_1d(number_array(f"step {name!r}: times", times, ModelError))
    if at.ndim != 1 or not at.size or len(levels) != len(at) + 1:
        raise ModelError(
            f"step {name!r}: {at.size} times and {len(levels)} levels were given, expected one level more "
            "than times: step('r', 1.0, (0, 5))."
        )
    # Held before the first knot as well: that one changes nothing.
    first = at[0] - max(1.0, abs(at[0]))
    made: Expr = _input(name, [first, *at], list(levels), "hold", outside="hold")
    return made


@keywords("keyword", error=ModelError, own=("name", "period", "duty"))
def square(
    name: str, period: float, levels: tuple[float, float] = (1.0, -1.0), *, duty: float = 0.5,
    start: float = 0.0,
) -> Expr:  # fmt: skip
    """A square wave: levels[0] for the part `duty` of each period, from `start` on, then levels[1]."""
    for what, value in (("period", period), ("duty", duty)):
        if is_expression(value) and not value.is_number:
            raise ModelError(
                f"square {name!r}: {what} is {value}, expected a number. With parameters: Heaviside of a "
                "ramp state, which TimeEvent('clock', period=p.T, reset={ramp: 0}) sets back."
            )
    length, part = as_number(period, f"square {name!r}: period"), as_number(duty, f"square {name!r}: duty")
    if not 0.0 < part < 1.0:
        raise ModelError(f"square {name!r}: duty is {part}, expected a number between 0 and 1.")
    if not length > 0.0:
        raise ModelError(f"square {name!r}: period is {length}, expected a number > 0.")
    made: Expr = _input(name, [start, start + part * length], list(levels), "hold", period=length)
    return made


@keywords("keyword", error=ModelError, own=("name",))
def prbs(
    name: str, clock: float, levels: tuple[float, float] = (-1.0, 1.0), *, order: Any = 7, start: float = 0.0
) -> Expr:
    """A pseudo-random binary sequence: the longest of a shift register, repeated every 2**order - 1 clocks.

    clock    time between two decisions; order: length of the register, 2 to 16

    Its autocorrelation is that of white noise up to about 0.4/clock (Ljung 1999, section 13.3).
    """
    every = as_number(clock, f"prbs {name!r}: clock")
    if not every > 0.0:
        raise ModelError(f"prbs {name!r}: clock is {every}, expected a number > 0.")
    length = whole(f"prbs {name!r}: order", order, SHORTEST, ModelError, LONGEST)
    from scipy.signal import max_len_seq

    bits = np.asarray(max_len_seq(length)[0])
    # Where the level stays there is no knot.
    change = np.append(True, bits[1:] != bits[:-1])
    times = start + every * np.arange(len(bits))
    values = np.where(bits > 0, levels[1], levels[0])
    made: Expr = _input(name, times[change], values[change], "hold", period=every * len(bits))
    return made


@keywords("keyword", error=ModelError)
def chirp(f0: Any, f1: Any, duration: Any, *, phase: Any = 0.0) -> Expr:
    """sin(2 pi (f0 t + (f1 - f0) t^2 / (2 duration)) + phase): its frequency runs from f0 at 0 to f1.

    Numbers or expressions in parameters; frequencies in 1/time. It is smooth: no knots. Beyond `duration` the
    frequency changes on at the same rate.
    """
    first, last, length, angle = (
        as_expression(q, f"chirp: {what}")
        for q, what in ((f0, "f0"), (f1, "f1"), (duration, "duration"), (phase, "phase"))
    )
    if length.is_number and not (length.is_finite and length.is_positive):
        raise ModelError(
            f"chirp: duration is {length}, expected a number > 0: the time in which the frequency runs from "
            "f0 to f1."
        )
    made: Expr = sympy.sin(2 * sympy.pi * (first * t + (last - first) * t**2 / (2 * length)) + angle)
    return made
