"""`solve` by time stepping: its options and the system checked, then the march."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from filippov.base.errors import NonUniqueError, SolveError, UsageError
from filippov.base.status import Status
from filippov.kernel.codegen.interpreted import using
from filippov.solving.solution import Solution
from filippov.solving.state.options import Options, check_times
from filippov.solving.state.problem import Problem
from filippov.solving.stepping.marching import march
from filippov.solving.stepping.plan import check_fits, check_options


def stepped(
    problem: Problem, options: Mapping[str, Any], events: Any, t_eval: Any, throw: bool,
    progress: Callable[[float, float], None] | None,
) -> Solution:  # fmt: skip
    """The solution in steps of one length; options: those that were given. Raises UsageError, SolveError."""
    check_options(options, events, problem.backward)
    given = {name: value for name, value in options.items() if name != "stop"}
    checked = Options(**given)
    checked.check_span(problem.t_span)
    checked.check_system(problem.system)
    check_fits(problem.system)
    times = None if t_eval is None else check_times(t_eval, problem.t_span)
    if times is not None and not checked.dense_output:
        raise UsageError("t_eval needs the dense output; drop dense_output=False.")
    with using(checked.backend):
        solution = march(problem, checked, progress, times)
    if throw and not solution.success:
        kind = NonUniqueError if solution.status is Status.NON_UNIQUE else SolveError
        raise kind(solution.message, solution)
    return solution
