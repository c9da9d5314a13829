"""solve and solve_many for those who go on with their results: where Ctrl-C cuts a run, KeyboardInterrupt.

Both answer Ctrl-C with what is done. An analysis that took this for a run that ended early would go on
without it, for minutes, and keep what it made of it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from filippov.base.status import Status
from filippov.solving.ensemble import Ensemble
from filippov.solving.ensemble import solve_many as many
from filippov.solving.solver import solve as one

F = TypeVar("F", bound=Callable[..., Any])


def whole(ends: Ensemble) -> Ensemble:
    """Ends that no interrupt has cut. Raises KeyboardInterrupt."""
    if not ends.complete:
        raise KeyboardInterrupt
    return ends


def _uncut(function: F) -> F:
    @wraps(function)
    def called(*given: Any, **options: Any) -> Any:
        found = function(*given, **options)
        if isinstance(found, Ensemble):
            return whole(found)
        if found.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return found

    return cast(F, called)


solve, solve_many = _uncut(one), _uncut(many)
