"""filippov simulate: one solution, its events, its picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.commands.model import load_model
from filippov.errors import ModelError, UsageError
from filippov.events import Event, Stop
from filippov.expression import parse_expression
from filippov.problem import Problem
from filippov.solution import Solution
from filippov.solver import solve
from filippov.status import Status, mode_text
from filippov.user_event import UserEvent

SOLVER = (
    "rtol", "atol", "method", "first_step", "max_step", "max_steps", "max_events", "max_time", "nonunique",
    "sliding", "zeno", "simultaneous", "save_events", "backend",
)  # fmt: skip
EVENT_COLUMNS = (
    "t", "surface", "kind", "before", "after", "direction", "multiplier", "residual", "group", "note",
)  # fmt: skip
SHOWN = 12
MOST_ROWS = 200_000


def run(settings: dict[str, Any], console: Console) -> int:
    """Solve, write what there is, also of a run that ended early."""
    loaded = load_model(settings["model"])
    problem = loaded.problem(settings)
    folder = Folder(settings["output"], console)
    if settings.get("nonunique") == "branch":
        from filippov.commands import simulate_tree

        for name in ("events", "save_events"):
            if settings.get(name):
                flag = f"--{name.replace('_', '-')}"
                raise UsageError(f"{flag} is for one solution; drop it, or --nonunique branch.")
        return simulate_tree.run(loaded.name, problem, settings, console, folder)
    for name in ("max_branches", "max_depth", "release_times"):
        if settings.get(name) is not None:
            raise UsageError(f"--{name.replace('_', '-')} needs --nonunique branch.")
    counted = settings.get("save_events") == "count"
    solution = solved(problem, settings, console, dense=folder.path is not None and not counted)
    summary = summarise(loaded.name, solution)
    states = problem.system.states
    console.result(summary | {"events": [event_data(event, states) for event in solution.events]})
    _tell(solution, console)
    folder.csv("events.csv", EVENT_COLUMNS + states, (_row(event) for event in solution.events))
    points = settings["points"]
    if points is None and len(solution.t) > MOST_ROWS and folder.path is not None:
        points = MOST_ROWS
        console.say(f"trajectory.csv has {points} equally spaced rows for {len(solution.t)} steps")
    t, y = _samples(solution, points)
    folder.csv("trajectory.csv", ("t", *states), np.vstack([t, y]).T.tolist())
    folder.json("summary.json", summary)
    if counted and folder.path is not None:
        console.say("events were counted: no solution.npz, no response.png; the tables have the last few")
    elif not counted:
        folder.file("solution.npz", solution.save)
    if solution.status is not Status.INTERRUPTED and not counted:
        folder.picture("response.png", lambda: solution.plot(title=loaded.title))
    folder.report()
    return exit_code(solution)


def solved(problem: Problem, settings: Mapping[str, Any], console: Console, dense: bool) -> Solution:
    """The solution with the solver's settings; `dense` keeps what lies between the events, for files."""
    if settings.get("nonunique") == "branch":
        raise UsageError("--nonunique branch gives a tree of solutions; this command needs one solution.")
    events = [parse_root(text, problem) for text in settings.get("events") or ()]
    with console.progress("simulate") as progress:
        start = problem.t_span[0]
        solution: Solution = solve(
            problem, progress=lambda t, end: progress(abs(t - start), abs(end - start), f"t = {t:.6g}"),
            events=events or None, dense_output=dense, **solver_options(settings),
        )  # fmt: skip
    return solution


def solver_options(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What the settings say about the solver, as its keywords."""
    options = {name: settings[name] for name in SOLVER if settings.get(name) is not None}
    return options | {"stop": [parse_stop(text) for text in settings.get("stop") or ()]}


def exit_code(solution: Solution) -> int:
    """0 for a run that did what it was asked to do, 130 for an interrupted one, else 1."""
    if solution.status is Status.INTERRUPTED:
        return 130
    return 0 if solution.success else 1


def parse_stop(text: str) -> Stop:
    """SURFACE, SURFACE:KIND or SURFACE:KIND:COUNT."""
    surface, *rest = (piece.strip() for piece in text.split(":"))
    if len(rest) > 2 or (len(rest) == 2 and not rest[1].isdecimal()):
        raise UsageError(f"--stop is {text!r}, expected SURFACE, SURFACE:KIND or SURFACE:KIND:COUNT.")
    kind = rest[0] if rest else "crossing"
    return Stop(surface, kind, int(rest[1]) if len(rest) == 2 else 1)


def parse_root(text: str, problem: Problem) -> UserEvent:
    """FORMULA, FORMULA:DIRECTION or FORMULA:DIRECTION:COUNT."""
    formula, *rest = (piece.strip() for piece in text.split(":"))
    directions = {"up": 1.0, "down": -1.0, "both": 0.0}
    way = rest[0] if rest else "both"
    if len(rest) > 2 or way not in directions or (len(rest) == 2 and not rest[1].isdecimal()):
        raise UsageError(
            f"--events is {text!r}, expected FORMULA, FORMULA:DIRECTION or FORMULA:DIRECTION:COUNT with the "
            "directions up, down or both."
        )
    form = problem.system.symbolic
    if form is None:
        raise UsageError("--events needs a model of formulas; with functions use solve(..., events=g).")
    try:
        g = parse_expression(formula, {symbol.name: symbol for symbol in (*form.x, *form.p)})
    except ModelError as error:
        raise UsageError(f"--events: {error}") from None
    count = int(rest[1]) if len(rest) == 2 else 0
    return UserEvent(g, terminal=count, direction=directions[way], name=formula)


def summarise(name: str, solution: Solution) -> dict[str, Any]:
    """What happened, without the events themselves."""
    problem, system = solution.problem, solution.system
    counted = solution.options.save_events == "count"
    return {
        "model": name,
        "parameters": dict(problem.parameters),
        "x0": dict(zip(system.states, problem.x0.tolist(), strict=True)),
        "t_span": list(problem.t_span),
        "status": solution.status.value,
        "success": solution.success,
        "message": solution.message,
        "t_end": solution.t_end,
        "x_end": dict(zip(system.states, solution.x_end.tolist(), strict=True)),
        "end_mode": mode_text(solution.end_mode),
        "dwell_times": {} if counted else dict(solution.dwell_times()),
        "event_counts": [
            {"surface": surface, "kind": kind, "count": number}
            for surface, kinds in solution.event_counts.items()
            for kind, number in kinds.items()
        ],
        "steps": solution.steps,
        "rejected": solution.rejected,
        "nfev": solution.nfev,
        "options": {name: _option(getattr(solution.options, name)) for name in ("method", "rtol", "atol")},
    }


def event_data(event: Event, states: tuple[str, ...]) -> dict[str, Any]:
    """One event by name; x holds the state, x_after the one after a reset."""
    data = dict(zip(EVENT_COLUMNS, _row(event), strict=False))
    data["x"] = dict(zip(states, event.x.tolist(), strict=True))
    if event.x_after is not None:
        data["x_after"] = dict(zip(states, event.x_after.tolist(), strict=True))
    return data


def _row(event: Event) -> list[Any]:
    return [
        float(event.t), event.surface, str(event.kind), mode_text(event.before), mode_text(event.after),
        int(event.direction), float(event.multiplier), float(event.residual), int(event.group), event.note,
        *event.x.tolist(),
    ]  # fmt: skip


def _option(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def _samples(solution: Solution, points: int | None) -> tuple[Any, Any]:
    """Times and states for the table: equally spaced ones, else the ends of the steps."""
    if points is None or solution.sol is None:
        return solution.t, solution.y
    t = np.linspace(solution.problem.t_span[0], solution.t_end, points)
    return t, solution.sol(t).reshape(len(solution.problem.x0), points)


def _tell(solution: Solution, console: Console) -> None:
    number = sum(sum(kinds.values()) for kinds in solution.event_counts.values())
    for event in solution.events[:SHOWN] if number == len(solution.events) else ():
        console.say(str(event))
    if number > SHOWN:
        counts = [
            f"{n} {kind} of {name}"
            for name, kinds in solution.event_counts.items()
            for kind, n in kinds.items()
        ]
        console.say(f"{number} events: {', '.join(counts)}")
    end = ", ".join(f"{n} = {v:.12g}" for n, v in zip(solution.system.states, solution.x_end, strict=True))
    console.say(f"t = {solution.t_end:.12g}  {end}  (mode {mode_text(solution.end_mode)})")
    if solution.success:
        console.say(solution.message)
    else:
        console.warn(f"{solution.status.value}: {solution.message}")
