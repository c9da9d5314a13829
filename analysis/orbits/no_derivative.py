"""What to say where the flow has no derivative, to somebody who looks for a periodic orbit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from filippov.analysis.sensitivity.saltation import NotDifferentiableError

_CURE = (
    "Newton's method on an orbit needs this derivative. If only the way to the orbit leads there, begin "
    "elsewhere: another guess, or transient=50. If the orbit itself does, it has no multipliers: take "
    "another value of a parameter, or follow where solutions settle: returns(system, find_section(system, "
    "x0), x0, 100)."
)


@contextmanager
def with_cure() -> Iterator[None]:
    """Add to a NotDifferentiableError what the derivative is needed for, and what to do without it."""
    try:
        yield
    except NotDifferentiableError as error:
        if _CURE in str(error):  # one search within another
            raise
        raise NotDifferentiableError(f"{error} {_CURE}") from error
