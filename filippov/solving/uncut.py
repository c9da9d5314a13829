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
from filippov.solving.solution import Solution
from filippov.solving.solution_tree import SolutionTree
from filippov.solving.solver import solve as one

F = TypeVar("F", bound=Callable[..., Any])
Found = TypeVar("Found", bound=Solution | SolutionTree | Ensemble)


def whole(found: Found) -> Found:
    """A solution, a tree or ends of an ensemble that no interrupt has cut. Raises KeyboardInterrupt."""
    cut = not found.complete if isinstance(found, Ensemble) else found.status is Status.INTERRUPTED
    if cut:
        raise KeyboardInterrupt
    return found


def _uncut(function: F) -> F:
    @wraps(function)
    def called(*given: Any, **options: Any) -> Any:
        return whole(function(*given, **options))

    return cast(F, called)


solve, solve_many = _uncut(one), _uncut(many)
