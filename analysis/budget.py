"""Time and size that a symbolic computation may take."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

MOST_TERMS = 100_000


class OutOfBudgetError(Exception):
    """The time or the size that was allowed is used up."""


@dataclass
class Clock:
    """Wall time and size that a computation may take; asked between its steps."""

    budget: float
    started: float = field(default_factory=time.monotonic)

    def check(self, terms: int = 0) -> None:
        """Raise OutOfBudgetError if the time is over or a product of that many terms would be formed."""
        if terms > MOST_TERMS:
            raise OutOfBudgetError(f"a product of {terms} terms")
        if time.monotonic() - self.started > self.budget:
            raise OutOfBudgetError(f"more than {self.budget:g} s")

    def remaining(self) -> float:
        """Seconds that are left; raises OutOfBudgetError where there are none."""
        self.check()
        return self.budget - (time.monotonic() - self.started)
