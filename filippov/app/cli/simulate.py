"""filippov simulate: one solution, its events, its picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov import ModelError, Solution, UsageError
from filippov.app.cli import simulate_tree
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import loaded_of
from filippov.app.cli.solved import EVENT_COLUMNS, event_data, event_row, exit_code, solved
from filippov.base.given import number
from filippov.base.read_whole import read_json
from filippov.base.status import Status, mode_text
from filippov.solving.reading import expression_of

SHOWN = 12
MOST_ROWS = 200_000
LARGEST = 10_000_000


def run(settings: dict[str, Any], console: Console) -> int:
    """Solve, write what there is, also of a run that ended early."""
    loaded = loaded_of(settings)
    if settings["tuned"] is not None:
        settings = settings | {"parameters": tuned_values(settings["tuned"]) | (settings["parameters"] or {})}
    problem = loaded.problem(settings)
    folder = Folder(settings["output"], console)
    if settings.get("nonunique") == "branch":
        for name in ("events", "save_events", "evaluate", "animate"):
            if settings.get(name):
                flag = f"--{name.replace('_', '-')}"
                raise UsageError(f"{flag} is for one solution; drop it, or --nonunique branch.")
        return simulate_tree.run(loaded.name, problem, settings, console, folder)
    for name in ("max_branches", "max_depth", "release_times"):
        if settings.get(name) is not None:
            raise UsageError(f"--{name.replace('_', '-')} needs --nonunique branch.")
    counted = settings.get("save_events") == "count"
    formulas, states = settings["evaluate"] or [], problem.system.states
    for formula in formulas:
        try:
            expression_of(problem.system, formula)
        except ModelError as error:
            raise UsageError(f"--evaluate: {error}") from None
    if counted and (formulas or settings["animate"]):
        raise UsageError("--evaluate and --animate need what lies between the events; drop --save-events.")
    _check_film(settings)
    dense = (folder.path is not None or bool(formulas)) and not counted
    solution = solved(problem, settings, console, dense=dense)
    shown = [*states, *(problem.system.outputs if solution.sol is not None else ()), *formulas]
    summary = summarise(loaded.name, solution)
    if len(shown) > len(states):
        at = solution.t_end
        summary["outputs"] = {name: solution.evaluate(name, at) for name in shown[len(states) :]}
    console.result(summary | {"events": [event_data(event, states) for event in solution.events]})
    _tell(solution, console)
    folder.csv("events.csv", EVENT_COLUMNS + states, (event_row(event) for event in solution.events))
    points = settings["points"]
    if points is None and len(solution.t) > MOST_ROWS and folder.path is not None:
        points = MOST_ROWS
        console.say(f"trajectory.csv has {points} equally spaced rows for {len(solution.t)} steps")
    t, y = _samples(solution, points, shown)
    folder.csv("trajectory.csv", ("t", *shown), np.vstack([t, y]).T.tolist())
    folder.json("summary.json", summary)
    if counted and folder.path is not None:
        console.say("events were counted: no solution.npz, no response.png; the tables have the last few")
    elif not counted:
        folder.file("solution.npz", solution.save)
    if solution.status is not Status.INTERRUPTED and not counted:
        folder.picture("response.png", lambda: solution.plot(shown, title=loaded.title))
        if settings["animate"] and folder.path is not None:
            folder.file(settings["animate"], lambda path: solution.animate(path, shown, title=loaded.title))
    folder.report()
    return exit_code(solution)


def tuned_values(path: str) -> dict[str, float]:
    """The best gains out of the tuning.json of `filippov tune`, with the parameters they were found for."""
    try:
        data = read_json(path, LARGEST)
        best, reason = data["best"], str(data["reason"])
        values = {str(k): number(v, str(k)) for k, v in {**data["parameters"], **(best or {})}.items()}
    except (OSError, RecursionError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} is no tuning.json of `filippov tune` ({type(error).__name__}: {error})."
        ) from None
    if best is None:
        raise UsageError(f"{path} holds no gains, for none were found: {reason}")
    return values


def summarise(name: str, solution: Solution) -> dict[str, Any]:
    """What happened, without the events themselves."""
    problem, system = solution.problem, solution.system
    counted = solution.options.save_events == "count"
    return {
        "model": name,
        "parameters": dict(problem.parameters),
        "x0": dict(zip(system.states, problem.x0.tolist(), strict=True)),
        "t_span": list(problem.t_span),
        "backward": problem.backward,
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


def _option(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def _check_film(settings: dict[str, Any]) -> None:
    name = settings["animate"]
    if name is None:
        return
    if settings["output"] is None:
        raise UsageError(f"--animate {name} is written into the folder of -o; give -o DIR.")
    if not name.endswith((".gif", ".mp4")) or "/" in name or "\\" in name:
        raise UsageError(f"--animate is {name!r}, expected a file name that ends in .gif or .mp4.")


def _samples(solution: Solution, points: int | None, shown: Sequence[str]) -> tuple[Any, Any]:
    """Times and values for the table: equally spaced ones, else the ends of the steps."""
    if points is None or solution.sol is None:
        rest = [solution[name] for name in shown[len(solution.y) :]]
        return solution.t, np.vstack([solution.y, *rest])
    t = np.linspace(solution.problem.t_span[0], solution.t_end, points)
    return t, np.vstack([solution.evaluate(name, t) for name in shown])


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
