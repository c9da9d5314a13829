"""Events defined by the user, with scipy's meaning: g(t, y) = 0, a direction, and whether the run ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.given import as_float, shown
from filippov.base.keywords import constructor
from filippov.base.signature import check_signature
from filippov.base.symbolic_value import is_expression, single
from filippov.model.surface import Surface


@constructor(own=("direction",))
@dataclass(frozen=True)
class UserEvent:
    """A root of g(t, y): every one is found, each once.

    g          function (t, y) -> float, or an expression in t, states and parameters
    terminal   False, True, or n: end the run at the n-th occurrence
    direction  > 0: only where g rises in true time, < 0: only where it falls, 0: both
    name       what it is called in events and messages; default: the function's name

    A start with g = 0 is no event, and neither is a tangency of 0 (`Solution.events` has it as grazing). What
    arrives at 0 with a speed and stays has an event there, and one where it leaves to the side it came from;
    what arrives at 0 with a speed and is turned back there by a reset, as at an impact, has one event there.
    Raises UsageError.
    """

    g: Any
    terminal: bool | int = False
    direction: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "g", single(self.g))
        if not callable(self.g) and not is_expression(self.g):
            raise UsageError(
                f"an event is {self.g!r}, expected a function g(t, y) -> float, an expression or a "
                f"UserEvent{', without quotes' if isinstance(self.g, str) else ''}. A Stop goes to stop=."
            )
        if not is_expression(self.g):
            called = getattr(self.g, "__name__", "g")
            check_signature(self.g, ("t", "y"), f"event {called!r}", "a float", UsageError)
        if not self.name:
            plain = str(self.g) if is_expression(self.g) else getattr(self.g, "__name__", "")
            object.__setattr__(self, "name", "event" if plain in ("", "<lambda>") else plain)
        whole = isinstance(self.terminal, (bool, int, np.bool_, np.integer))
        if not whole or int(self.terminal) < 0:
            raise UsageError(
                f"event {self.name!r}: terminal is {self.terminal!r}, expected True, False or the number of "
                "the occurrence that ends the run (1, 2, ...)."
            )
        direction = as_float(self.direction)
        if direction is None or np.isnan(direction):
            raise UsageError(
                f"event {self.name!r}: direction is {shown(self.direction)}, expected a number: 1 where g "
                "rises, -1 where it falls, 0 for both."
            )
        object.__setattr__(self, "terminal", int(self.terminal))
        object.__setattr__(self, "direction", float(np.sign(direction)))

    @property
    def symbolic(self) -> bool:
        """Whether g is an expression."""
        return is_expression(self.g)

    @property
    def surface(self) -> Surface:
        """The observer surface that stands for it in the event loop."""
        return Surface(self.name, self.g if self.symbolic else Watched(self.g), kind="observer")


@dataclass(frozen=True)
class Watched:
    """g(t, y) as a switching function h(t, x, p)."""

    g: Callable[..., Any]

    def __call__(self, t: float, x: Any, p: Any) -> Any:
        """Return g(t, x)."""
        return self.g(t, x)


def user_events(events: Any) -> tuple[UserEvent, ...]:
    """What `solve` was given as events: functions with scipy's attributes, expressions, UserEvents."""
    if events is None:
        return ()
    events = single(events)
    one = callable(events) or isinstance(events, UserEvent | str) or is_expression(events)
    if one or not isinstance(events, Sequence):
        events = (events,)
    return tuple(
        item
        if isinstance(item, UserEvent)
        else UserEvent(item, getattr(item, "terminal", False), getattr(item, "direction", 0.0))
        if callable(item)
        else UserEvent(item)
        for item in events
    )
