"""The errors a user meets. Each message says what was given, what was expected and what to do."""

from __future__ import annotations

from typing import Any


class ModelError(ValueError):
    """The model cannot be used as it was written: a name, an expression, a shape or a value is wrong."""


class UsageError(ValueError):
    """An argument that does not describe the model (a tolerance, a time span, an option) is wrong."""


class SolveError(RuntimeError):
    """A solution could not be completed; `solution` holds what was computed up to there, or None."""

    def __init__(self, message: str = "", solution: Any = None) -> None:
        super().__init__(message)
        self.solution = solution


class NonUniqueError(SolveError):
    """More than one continuation satisfies the inclusion, and the policy was to stop there."""
