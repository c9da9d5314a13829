"""Solve an inclusion exactly: mode by mode, event by event."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal, Unpack, overload

from filippov.base.errors import NonUniqueError, SolveError, UsageError
from filippov.base.given import Count, Positive
from filippov.base.keywords import keywords
from filippov.base.status import Status
from filippov.kernel.codegen.interpreted import using
from filippov.model.system import System
from filippov.model.user_event import user_events
from filippov.solving.branching import branch
from filippov.solving.loop import follow
from filippov.solving.scale import default_atol
from filippov.solving.solution import Solution
from filippov.solving.solution_tree import SolutionTree
from filippov.solving.state.option_types import (
    ANSWERS,
    SAME_AS,
    Backend,
    BranchOptions,
    Kept,
    MethodName,
    OnGraze,
    OnZeno,
    Policy,
    RunOptions,
    SlidingRule,
    Stops,
    Together,
    Tolerance,
)
from filippov.solving.state.options import (
    STEPPING,
    Options,
    check_priority,
    check_stops,
    check_times,
    checked_options,
    given_options,
)
from filippov.solving.state.problem import Problem, no_system
from filippov.solving.traced import as_expressions


def _needs_system(function: str, given: object) -> None:
    if not isinstance(given, System | Problem):
        raise UsageError(no_system(function, given, "a System or a Problem"))


@overload
def solve(
    system: System | Problem,
    x0: Any = ...,
    t_span: Any = ...,
    *,
    nonunique: Literal["branch"],
    parameters: Mapping[str, float] | None = ...,
    throw: bool = ...,
    progress: Callable[[float, float], None] | None = ...,
    max_branches: int | None = ...,
    max_depth: int | None = ...,
    release_times: Any = ...,
    backward: bool | int = ...,
    **options: Unpack[BranchOptions],
) -> SolutionTree: ...
@overload
def solve(
    system: System | Problem,
    x0: Any = ...,
    t_span: Any = ...,
    *,
    parameters: Mapping[str, float] | None = ...,
    t_eval: Any = ...,
    events: Any = ...,
    throw: bool = ...,
    progress: Callable[[float, float], None] | None = ...,
    backward: bool | int = ...,
    **options: Unpack[RunOptions],
) -> Solution: ...
@keywords(same=SAME_AS, answers=ANSWERS, own=("system", "method"), first=_needs_system)
def solve(
    system: System | Problem,
    x0: Any = None,
    t_span: Any = None,
    *,
    parameters: Mapping[str, float] | None = None,
    t_eval: Any = None,
    events: Any = None,
    throw: bool = False,
    progress: Callable[[float, float], None] | None = None,
    backward: bool | int = False,
    method: MethodName | str = "DOP853",
    rtol: Positive = Options.rtol,
    atol: Tolerance | None = None,
    first_step: Positive | None = None,
    max_step: Positive = math.inf,
    max_steps: Count = Options.max_steps,
    max_events: Count = Options.max_events,
    max_time: Positive = math.inf,
    nonunique: Policy | Literal["branch"] = "raise",
    max_branches: Count | None = None,
    max_depth: Count | None = None,
    release_times: Any = None,
    on_graze: OnGraze = "continue",
    zeno: OnZeno = "stop",
    simultaneous: Together = "raise",
    sliding: SlidingRule = "filippov",
    stop: Stops = (),
    dense_output: bool = True,
    save_events: Kept = "all",
    compile: bool | None = None,  # noqa: A002 (the word for it)
    backend: Backend = "compiled",
    dt: float | None = None,
    theta: float | None = None,
) -> Solution | SolutionTree:
    """Solve x' in { f(t, x, s; p) : s_i in Sgn(h_i) } from x0 over t_span.

    system      System, or a Problem that holds x0, t_span and parameters
    x0          one number per state, in order or as a mapping by name
    t_span      (t0, t1)
    backward    True to integrate backwards in time, with t1 < t0; without it such a span is refused: in
                scipy's order of arguments a span would be mistaken for a state
    parameters  values by name; the others keep their defaults
    t_eval      times of the solution's t and y; default: the ends of all steps
    events      roots to watch, as in scipy: a function g(t, y) -> float or several, with attributes
                `terminal` (True, or n: end at the n-th) and `direction` (+1, -1; in true time),
                expressions, or UserEvent(g, terminal=..., direction=...). The last lists of t_events
    throw       raise SolveError (carrying the partial solution) where the run ends early
    progress    called from time to time with (t, t1)
    method      "DOP853" (order 8), "DP5" (order 5), "Radau" (order 5, implicit) for stiff fields, or "Taylor"
                (order 8 to 20 by rtol) for accurate runs of systems given as expressions;
                "Moreau": time stepping, which locates no events (see `filippov.solving.stepping`)
    dt, theta   with "Moreau": the length of its steps, and 0.5 (order 2 between events, the default) to 1
                (implicit Euler)
    rtol, atol  relative and absolute tolerance of a step; atol may be one number per state. Default of atol:
                1e-12, less where the whole solution is small (see `filippov.solving.scale`)
    first_step, max_step         bounds of the step, at most the span
    max_steps, max_events, max_time   budgets (max_time in seconds); each ends in a named status
    nonunique   where several modes can follow: "raise" (end with NON_UNIQUE), "stick" (most sliding), "slip"
                (least sliding), a list of modes such as ["+", "0"] of which the first that can follow is
                taken, a function from the list of candidates (`Successor`) to the one to take, or "branch":
                follow all of them and return a SolutionTree
    max_branches, max_depth   with "branch": most whole solutions (64), most decisions along one (8)
    release_times   with "branch": departures to sample along sliding that can be left at any time, a number
                or times; default: none, only staying and leaving at once
    on_graze    "continue", or "error" to end where a surface is grazed
    zeno        "stop" at an accumulation of events, or "continue" in the limit mode
    simultaneous  where resets at one instant depend on their order: "raise" (end with NON_UNIQUE),
                "sequential" (one after the other, the fastest approach first), or "generalised Newton" (all
                resting contacts at once); see the page on resets
    sliding     "filippov" (multi-affine), "moments", or "utkin" (equivalent control); see the page on sliding
    stop        Stop(surface, kind, count) or several: terminal events
    dense_output  keep the interpolants that sol(t) needs
    compile     for a field that is a plain function: True compiles it at once (arrays and names that it reads
                then count as constants), False never; default: after many calls, if it is pure by inspection
    backend     "compiled", or "python": the same event loop run by Python, for a debugger (FILIPPOV_PYTHON=1
                for a whole process); see the page on compiled code
    save_events "all", or "count" to keep only their number and the last few: memory does not grow with them

    Returns a Solution; see its `status` and `message`. Raises ModelError, UsageError for bad input, and
    whatever a function of the user raises. Source: event-driven integration after Piiroinen & Kuznetsov 2008
    and Dieci & Lopez 2012; see the page on the event loop.
    """
    options = given_options(locals())
    if str(method) == STEPPING:
        rest = {"max_branches": max_branches, "max_depth": max_depth, "release_times": release_times}
        options |= {name: value for name, value in rest.items() if value is not None}
        problem = _problem(system, x0, t_span, parameters, backward)
        # It writes kernels for the system, and so needs sympy, which functions do without.
        from filippov.solving.stepping.stepped import stepped

        return stepped(problem, options, events, t_eval, throw, progress)
    of_tree = {"max_branches": max_branches, "max_depth": max_depth, "release_times": release_times}
    of_tree = {name: value for name, value in of_tree.items() if value is not None}
    problem = _problem(system, x0, t_span, parameters, backward)
    options["nonunique"] = check_priority(options.get("nonunique", "raise"), problem.system)
    if "stop" in options:
        options["stop"] = check_stops(options["stop"], problem.system)
    checked = checked_options(options)
    checked.check_span(problem.t_span)
    checked.check_system(problem.system)
    try:
        with using(checked.backend):
            if "atol" not in options:
                atol = default_atol(problem.system, problem.x0, problem.t_span, problem.p, checked)
                checked = checked if atol == checked.atol else checked_options({**options, "atol": atol})
            return _solved(problem, checked, t_eval, events, of_tree, throw, progress)
    except IndexError as error:
        # The states are never empty: what was asked for is a sign.
        if problem.system.field is None or problem.system.surfaces or "with size 0" not in str(error):
            raise
        raise IndexError(
            f"the field asks for a sign ({error}), and the system has no surfaces: s is empty. Declare what "
            "switches: System(field=f, surfaces=[Surface('v', h)], ...)."
        ) from error


def _solved(
    problem: Problem, checked: Options, t_eval: Any, events: Any, of_tree: Mapping[str, Any], throw: bool,
    progress: Callable[[float, float], None] | None,
) -> Solution | SolutionTree:  # fmt: skip
    """The same with its options checked."""
    users = user_events(events)
    for user in users if problem.system.field is not None else ():
        if user.symbolic:
            raise UsageError(f"event {user.name!r} is an expression; with a field of functions give g(t, y).")
    if checked.nonunique == "branch":
        if users:
            raise UsageError("events are for one solution; drop nonunique='branch', or declare observers.")
        if t_eval is not None:
            raise UsageError(
                "t_eval is for one solution; a tree has path.sol(t) for each and tree.reachable(t) for all."
            )
        tree = branch(problem, checked, progress=progress, **of_tree)
        if throw and not tree.success:
            raise SolveError(tree.message, tree)
        return tree
    if of_tree:
        raise UsageError(f"{', '.join(of_tree)} need nonunique='branch'.")
    users = as_expressions(problem.system, problem.p, users)
    times = None if t_eval is None else check_times(t_eval, problem.t_span)
    if times is not None and not checked.dense_output:
        raise UsageError("t_eval needs the dense output; drop dense_output=False.")
    solution = follow(problem, checked, progress, times, users=users, scaled=True).solution
    status = solution.status
    if throw and not status.ok:
        kind = NonUniqueError if status is Status.NON_UNIQUE else SolveError
        raise kind(solution.message, solution)
    return solution


def _problem(
    system: System | Problem, x0: Any, t_span: Any, parameters: Mapping[str, float] | None,
    backward: bool | int,
) -> Problem:
    if isinstance(system, Problem):
        if x0 is None and t_span is None and parameters is None and not backward:
            return system
        return system.remake(x0=x0, t_span=t_span, parameters=parameters, backward=backward or None)
    if x0 is None or t_span is None:
        raise UsageError("solve needs x0 and t_span: solve(system, x0=(...), t_span=(t0, t1)).")
    return Problem(system, x0, t_span, parameters or {}, backward)
