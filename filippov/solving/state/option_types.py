"""Types of the options of a run, and what is said of options that other solvers have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypedDict

import numpy.typing as npt

from filippov.solving.state.events import Stop

# RK45 is what scipy calls DP5 (Dormand & Prince 1980).
MethodName = Literal["DOP853", "DP5", "Radau", "Taylor", "RK45", "Moreau"]
# A list and a tuple, no sequence: a text is one as well, and "branch" gives another result.
Policy = Literal["raise", "stick", "slip"] | list[str] | tuple[str, ...] | Callable[..., Any]
OnGraze = Literal["continue", "error"]
OnZeno = Literal["stop", "continue"]
Together = Literal["raise", "sequential", "generalised Newton"]
SlidingRule = Literal["filippov", "moments", "utkin"]
Kept = Literal["all", "count"]
Backend = Literal["compiled", "python"]
Tolerance = float | Sequence[float] | npt.NDArray[Any]
Stops = Stop | Sequence[Stop]


class BranchOptions(TypedDict, total=False):
    """The options of `solve` by name, all but `nonunique`."""

    method: MethodName | str
    rtol: float
    atol: Tolerance | None
    first_step: float | None
    max_step: float
    max_steps: int
    max_events: int
    max_time: float
    on_graze: OnGraze
    zeno: OnZeno
    simultaneous: Together
    sliding: SlidingRule
    stop: Stops
    dense_output: bool
    save_events: Kept
    compile: bool | None
    backend: Backend


class RunOptions(BranchOptions, total=False):
    """The options of `solve` for one solution."""

    nonunique: Policy
    dt: float | None
    theta: float | None


SAME_AS: Mapping[str, str] = {"y0": "x0", "tspan": "t_span"}
METHODS_OF_OTHERS: Mapping[str, str] = {
    "RK23": "method='DP5' with a larger rtol",
    "BDF": "method='Radau', which is for stiff fields as well",
    "LSODA": "method='DOP853', or 'Radau' where the run says that it is stiff",
    "ode45": "method='DP5', the same formulas",
    "ode23": "method='DP5' with a larger rtol",
    "ode113": "method='DOP853'",
    "ode15s": "method='Radau'",
    "ode23s": "method='Radau'",
    "ode23tb": "method='Radau'",
    **dict.fromkeys(
        ("Euler", "euler", "RK4", "rk4", "leapfrog"),
        "method='DP5', whose steps the tolerances choose, or 'Moreau' with steps of one length dt",
    ),
}
ANSWERS: dict[str, str] = {
    "args": "args are parameters by name here: declare p = parameters(m=1.0) (or System(..., "
    "parameters={'m': 1.0})), then parameters={'m': 2.0} gives the run another value.",
    "fun": "fun belongs to the system: System({x: v, v: ...}) or System(field=f, ...); it is "
    "the first argument.",
    "jac": "jac is not needed: derivatives are taken of the expressions, and differences of plain functions.",
    "vectorized": "vectorized is not needed: leave it out. For many runs at once use solve_many.",
    "min_step": "min_step is not needed: a step that would fall below the spacing of t ends the run by name.",
    "RelTol": "RelTol is rtol here: rtol=1e-9.",
    "AbsTol": "AbsTol is atol here: atol=1e-12, or one number per state.",
    "MaxStep": "MaxStep is max_step here.",
    "InitialStep": "InitialStep is first_step here.",
    "Events": "Events are events here: events=g with g(t, y) -> float, as in scipy.",
    "tol": "tol is rtol (relative) and atol (absolute) here.",
    "reltol": "reltol is rtol here.",
    "abstol": "abstol is atol here.",
    "params": "params is parameters here: parameters={'m': 2.0}.",
    "t": "t is t_span=(t0, t1) here; times at which the solution is wanted are t_eval.",
    "dt": "dt is of solve(..., method='Moreau'), which takes steps of one length; max_step is a bound of the "
    "others' steps; times at which the solution is wanted are t_eval.",
    "h0": "h0 is first_step here.",
    "hmax": "hmax is max_step here.",
    "tfirst": "tfirst is not needed: the time goes first in every function, f(t, x, p, s).",
    **dict.fromkeys(
        ("n", "N", "num", "points", "n_points", "npoints", "steps", "n_steps", "saveat", "teval"),
        "times at which the solution is wanted are t_eval=np.linspace(t0, t1, 1001); its steps are chosen by "
        "the tolerances, max_step bounds them.",
    ),
    **dict.fromkeys(
        ("verbose", "disp", "callback", "callbacks"),
        "progress=f is called with (t, t1) from time to time; what is to happen at an event is events=g, or "
        "the reset of a Surface.",
    ),
    **dict.fromkeys(
        ("tmax", "t_max", "tf", "t_end", "tend", "t1", "T", "duration"), "the end is t1 of t_span=(t0, t1)."
    ),
    **dict.fromkeys(("u0", "ic", "init", "initial"), "the initial state is x0=(...), or y0 as in scipy."),
    **dict.fromkeys(("solver", "alg", "integrator"), "it is method='DOP853', 'DP5', 'Radau' or 'Taylor'."),
    **dict.fromkeys(
        ("StopTime", "StartTime", "TimeSpan", "FinalTime"), "the times are t_span=(t0, t1) here."
    ),
    **dict.fromkeys(
        ("FixedStep", "SampleTime", "step_size"),
        "steps are chosen by the tolerances; max_step bounds them, and method='Moreau' has steps of one "
        "length dt. A sampled part of a model is TimeEvent('clock', period=...) with a state that it resets.",
    ),
    **dict.fromkeys(("Solver", "SolverName"), "it is method='DOP853', 'DP5', 'Radau' or 'Taylor'."),
    **dict.fromkeys(
        ("Refine", "OutputTimes", "OutputFcn"), "times at which the solution is wanted are t_eval."
    ),
    **dict.fromkeys(
        ("Jacobian", "Mass", "Vectorized"),
        "it is not needed: derivatives are taken of the expressions; a mass goes into the equations.",
    ),
    "maxiters": "maxiters is max_steps here.",
    "dtmax": "dtmax is max_step here.",
    "p": "p is parameters here: parameters={'m': 2.0}.",
    "comparator": "comparator belongs to the system: solve(system.with_comparator(Band(1e-3)), ...).",
    **dict.fromkeys(
        ("inputs", "input", "u"),
        "an input stands in the equations, Input('r', t, values), or in the place of a parameter: "
        "solve(system.with_inputs({'r': signal}), ...).",
    ),
    "surfaces": "surfaces belong to the system: System({...}, surfaces=[Surface('v', v)]).",
    "reset": "a reset belongs to the system: Surface('floor', y, reset={v: -p.e*v}).",
    "terminal": "terminal belongs to an event: events=UserEvent(g, terminal=True); a surface is "
    "stop=Stop('v', 'crossing').",
    "width": "width belongs to a comparator: solve(system.with_comparator(Band(width)), ...).",
}
# What has no meaning where only the ends are kept.
ENDS_ONLY = {
    **dict.fromkeys(
        ("jobs", "n_jobs", "workers", "processes", "executor"),
        "solve_many runs in this process, on threads=... Worker processes and dask are those of a sweep: "
        "Sweep(problem, over={'P': [10, 20]}).run(jobs=4).",
    ),
} | {
    name: f"{name} is for solve: solve_many keeps the ends only. Use solve for the way of one trajectory."
    for name in (
        "t_eval", "events", "dense_output", "save_events", "on_graze", "max_time", "backend", "throw",
        "theta",
    )
}
