"""How long a computation of many solutions may go on: they end, too, when its time is up."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")
_UNTIL: ContextVar[float] = ContextVar("until", default=math.inf)
# A solution is given so many seconds at least.
_LEAST = 1e-3


class OutOfTimeError(Exception):
    """The time of the computation under way is up; no failure of what it computes."""


def time_left() -> float:
    """Seconds until the computation under way ends; infinite where it has no limit."""
    return max(_UNTIL.get() - time.monotonic(), _LEAST)


def check_time() -> None:
    """Raise OutOfTimeError where the time of the computation under way is up."""
    if time.monotonic() > _UNTIL.get():
        raise OutOfTimeError


def limited(items: Iterator[T], until: float) -> Iterator[T]:
    """The items that are computed before a time of the clock (time.monotonic); the one under way is lost."""
    while True:
        token = _UNTIL.set(until)
        try:
            item = next(items)
        except (StopIteration, OutOfTimeError):
            return
        finally:
            _UNTIL.reset(token)
        yield item
