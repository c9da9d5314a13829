"""The section of a forced or clocked system: its states once per period of the forcing."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy

from filippov import System, UsageError
from filippov.analysis.steady.forcing import Period, is_forced
from filippov.base.arrays import Array
from filippov.base.keywords import constructor
from filippov.base.names import unknown
from filippov.base.shown import Shown

# The most parts of a strobe's time that are looked for in the period of an orbit.
MOST_PARTS = 100
# The relative error of a part or multiple.
_SAME = 1e-9


@constructor()
@dataclass(frozen=True)
class Stroboscope(Shown):
    """States at t = k T, or after every tick of a clock.

    coordinate  what is read there: the name of a state, or a formula in states (sympy or text)
    period      T > 0: a number, a formula in the parameters such as "2*pi/omega", a function of the
                parameters; None: read off the sines and cosines of t and the clocks
    clock       name of the time event after whose ticks states are read, with its reset; "": at t = k T.
                TimeEvent("look", period=T, start=T/4) chooses a phase

    Raises UsageError.
    """

    coordinate: Any
    period: Any = None
    clock: str = ""

    def period_on(self, system: System) -> Period:
        """T with its derivatives by parameters. Raises UsageError where nothing forces the system."""
        if self.period is None and not is_forced(system):
            raise UsageError(
                "nothing forces the system: t stands nowhere and no clock ticks, so there is no period to "
                "look at it once in. Take a Section on one of its surfaces: find_section(system, x0)."
            )
        names = [event.name for event in system.time_events]
        if self.clock and self.clock not in names:
            raise UsageError(unknown("time event", self.clock, names))
        return Period(system, self.period)

    def to_dict(self) -> dict[str, Any]:
        """When states are looked at and what is read, as plain data; period is null where it is found."""
        number = isinstance(self.period, int | float)
        period = self.period if number or self.period is None else str(self.period)
        return {"period": period, "clock": self.clock, "coordinate": str(self.coordinate)}

    def __str__(self) -> str:
        return f"once a period{f', after {self.clock!r}' if self.clock else ''}"


def strobes_and_turns(period: float, strobe: float) -> tuple[int, int]:
    """The least number of strobes after which an orbit is back at one, and the turns that it then made.

    Raises UsageError where it never is.
    """
    ratio = Fraction(period / strobe).limit_denominator(MOST_PARTS)
    if not ratio or abs(period / strobe / ratio - 1) > _SAME:
        raise UsageError(
            f"the orbit has the period {period:.12g}, and states are looked at every {strobe:.12g}, at which "
            "it is never back: expected a multiple or part of its period. Leave period out where a forcing "
            "gives it, or take a Section on a surface."
        )
    return ratio.numerator, ratio.denominator


def clock_times(system: System, name: str, values: Array) -> tuple[float, float]:
    """First tick and period of a clock at resolved parameter values."""
    event = next(e for e in system.time_events if e.name == name)
    named = dict(zip(system.parameters.names, values.tolist(), strict=True))

    def number(given: Any) -> float:
        if isinstance(given, sympy.Expr):
            return float(given.xreplace({s: sympy.Float(named[s.name], 17) for s in given.free_symbols}))
        return float(given(system.parameters.record(values)) if callable(given) else given)

    return number(event.start), number(event.period)
