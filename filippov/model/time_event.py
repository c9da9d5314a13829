"""Events at known times: clocks and lists of instants, reached exactly."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from filippov.base.errors import ModelError
from filippov.base.given import several
from filippov.base.keywords import constructor
from filippov.base.symbolic_value import is_expression
from filippov.model.parameter import as_number
from filippov.model.surface import Surface, reset_pairs

if TYPE_CHECKING:
    from sympy import Expr

_ANSWERS = {
    "phase": "phase is start here, the first instant: TimeEvent('clock', period=1, start=0.2).",
    "t": "t is times=(...) here, or period=... for a clock.",
}

# A number, an expression in parameters, or a function p -> float.
Instant = Any


@constructor(answers=_ANSWERS, error=ModelError, own=("name",))
@dataclass(frozen=True)
class TimeEvent:
    """Instants t = start + k period, k = 0, 1, 2, ..., or `times`: exact to the last bit.

    name     non-empty text, no surface's
    period   > 0: a number, an expression in parameters, or (for systems of functions) a function p -> float
    start    the first instant of a clock
    times    increasing instants in place of period and start
    reset    x+ = r(t, x-, p) there: a mapping from states (symbols or names) to expressions, the others keep
             their values; for systems of functions a function r(t, x, p) -> (n,). None: the state stays, and
             the field of a system of functions may jump

    A run over (t0, t1] reaches the instants after t0, t1 included. Between instants, user functions are
    called only with times strictly inside, even at the ends of steps. Instants of several time events, or of
    a time event and a surface, that differ by rounding (1e-12 of the time run) are one set: first the
    surfaces, then the clocks. Raises ModelError.
    """

    name: str
    period: Instant = None
    start: Instant = 0.0
    times: Sequence[Instant] | None = None
    reset: Any = None

    def __post_init__(self) -> None:
        name: object = self.name
        if not isinstance(name, str) or not name.strip():
            raise ModelError(
                f"a time event has the name {name!r}, expected non-empty text. The name goes first: "
                "TimeEvent('tick', period=0.1) or TimeEvent('kick', times=(1.0,))."
            )
        where = f"time event {self.name!r}"
        if (self.period is None) == (self.times is None):
            what = "neither" if self.period is None else "both"
            raise ModelError(f"{where}: give period=..., or times=(...): {what} was given.")
        if self.times is not None:
            if isinstance(self.times, (str, Mapping)) or not isinstance(self.times, Sequence):
                raise ModelError(f"{where}: times is {self.times!r}, expected a sequence of instants.")
            object.__setattr__(self, "times", tuple(_instant(q, f"{where}: times") for q in self.times))
        else:
            object.__setattr__(self, "period", _instant(self.period, f"{where}: period"))
            object.__setattr__(self, "start", _instant(self.start, f"{where}: start"))
        if self.reset is not None and not callable(self.reset):
            object.__setattr__(self, "reset", reset_pairs(self.reset, f"{where}: reset"))
        self._check_numbers()

    @property
    def symbolic(self) -> bool:
        """Whether it fits a system of expressions: no functions in it."""
        return not any(callable(q) and not is_expression(q) for q in (*self.instants, self.reset))

    @property
    def instants(self) -> tuple[Instant, ...]:
        """What the instants are made of: the times, or start and period."""
        return tuple(self.times) if self.times is not None else (self.start, self.period)

    def expressions(self) -> list[Expr]:
        """Every expression in it."""
        pairs = self.reset if isinstance(self.reset, tuple) else ()
        return [q for q in (*self.instants, *(e for _, e in pairs)) if is_expression(q)]

    def _check_numbers(self) -> None:
        if all(isinstance(q, float) for q in self.instants):
            self.checked([float(q) for q in self.instants])

    def checked(self, values: list[float]) -> list[float]:
        """The instants' numbers, or a ModelError."""
        where = f"time event {self.name!r}"
        if not all(math.isfinite(q) for q in values):
            raise ModelError(f"{where}: its instants are {values}, expected finite numbers.")
        if self.times is None and not values[1] > 0:
            raise ModelError(f"{where}: period is {values[1]}, expected a number > 0.")
        if self.times is not None and any(a >= b for a, b in itertools.pairwise(values)):
            raise ModelError(f"{where}: times are {values}, expected increasing ones.")
        return values

    def numbers(self, p: Any, values: Mapping[str, float]) -> list[float]:
        """The instants at parameter values: p for functions, by name for expressions."""
        out = []
        for q in self.instants:
            if is_expression(q):
                out.append(self._number(q, values))
            else:
                out.append(as_number(q(p), f"time event {self.name!r}") if callable(q) else q)
        return self.checked(out)

    def _number(self, expression: Expr, values: Mapping[str, float]) -> float:
        """An instant's expression at parameter values by name; ModelError where it is no real number."""
        from sympy import Float

        at = expression.xreplace({s: Float(values[s.name]) for s in expression.free_symbols})
        if at.is_real is False or at.is_finite is False:
            known = ", ".join(f"{s.name} = {values[s.name]:g}" for s in expression.free_symbols)
            raise ModelError(
                f"time event {self.name!r}: {expression} is {at} at {known}, expected a finite real number."
            )
        return float(at)



def _instant(value: Any, where: str) -> float | Expr | Callable[..., float]:
    if is_expression(value) and not value.is_number:
        return value
    if callable(value) and not is_expression(value):
        return value
    return as_number(value, where)


def read_clocks(time_events: Any, symbolic: bool) -> tuple[TimeEvent, ...]:
    """Return time events that fit the system."""
    one = isinstance(time_events, TimeEvent)
    items = (time_events,) if one else tuple(several("time_events", time_events, ModelError))
    for item in items:
        if not isinstance(item, TimeEvent):
            raise ModelError(
                f"time_events holds {item!r}, expected TimeEvent('name', period=...). "
                "A Surface goes into surfaces=."
            )
        if symbolic and not item.symbolic:
            raise ModelError(
                f"time event {item.name!r} has a function, expected numbers and expressions, because the "
                "equations are expressions."
            )
        if not symbolic and (item.expressions() or isinstance(item.reset, tuple)):
            raise ModelError(
                f"time event {item.name!r} has an expression, expected numbers and functions, because the "
                "field is a function: reset=lambda t, x, p: [...]."
            )
    return items


def check_clock_names(clocks: Sequence[TimeEvent], surfaces: Sequence[Surface]) -> None:
    """Refuse a duplicate name, and instants that are not numbers or parameters."""
    seen = [surface.name for surface in surfaces]
    for clock in clocks:
        if clock.name in seen:
            raise ModelError(f"two surfaces or time events are named {clock.name!r}. Rename one of them.")
        seen.append(clock.name)
        for e in clock.instants:
            if is_expression(e):
                _check_instant(e, clock.name)


def _check_instant(e: Expr, name: str) -> None:
    from filippov.model.parameter_symbol import ParameterSymbol

    if not all(isinstance(q, ParameterSymbol) for q in e.free_symbols):
        raise ModelError(
            f"time event {name!r}: its instants are {e}, expected numbers or parameters. What depends on the "
            "state is a Surface."
        )
