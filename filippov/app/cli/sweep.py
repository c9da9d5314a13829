"""filippov sweep and filippov ensemble: one model at many parameter values and initial states."""

from __future__ import annotations

import shlex
import sys
from collections import Counter
from functools import partial
from typing import Any

import numpy as np

from filippov import Problem, SolveError, Sweep, UsageError, solve_many
from filippov.app.cli.console import Console, json_text
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import loaded_of
from filippov.app.cli.outputs import Outputs
from filippov.app.cli.solved import SOLVER, parse_stop
from filippov.base.status import mode_text
from filippov.base.whole_file import write_whole
from filippov.sweep.dataset import write_csv, write_netcdf
from filippov.sweep.point import split
from filippov.sweep.table import SweepTable

SHOWN = 5
FAILED, INTERRUPTED = 3, 130
FILES = ("summary.json", "results.csv", "results.nc")
HOW = ("jobs", "executor", "scheduler", "resume", "fresh", "trust", "max_memory", "chunk")


def run(settings: dict[str, Any], console: Console) -> int:
    """Compute every point, or those that an earlier run left; 3 where some failed, 130 interrupted."""
    problem, options = _start(settings)
    sweep = Sweep(
        problem, settings["over"], settings["samples"], measure=settings["measure"], n=settings["n"],
        seed=settings["seed"], tail=settings["tail"], reduce=settings["reduce"], **options,
    )  # fmt: skip
    if settings["samples"] in ("grid", "list"):
        for name, values in settings["over"].items():
            if len(values) == 2:
                ends = f"{values[0]:g} and {values[1]:g}"
                console.say(f"{name}: 2 values, {ends}; {name}={values[0]:g}:{values[1]:g}:COUNT takes more")
    folder = Folder(settings["output"], console)
    outputs = Outputs(folder.path, FILES)
    how = {name: settings[name] for name in HOW}
    try:
        with console.progress("sweep") as progress:

            def look(done: int, total: int) -> None:
                if settings["fresh"]:
                    outputs.remove()  # by now the folder is this sweep's
                progress(done, total, f"{done} of {total} points")

            table = sweep.run(folder.path, progress=look, max_time=settings["max_time"], **how)
    except SolveError:
        if folder.path is not None:
            console.warn(f"what is done is kept; to go on: {_resume(settings)}")
        raise
    data = {
        "model": settings["model"], "backward": problem.backward, "points": len(table),
        "complete": table.complete,
        "counts": table.counts, "content_hash": table.content_hash, "columns": list(table.columns),
        "reduced": table.reduced, "failed": _failed(table),
    }  # fmt: skip
    console.result(data)
    if table.damaged:
        console.warn(f"{len(table.damaged)} chunks were damaged and computed again")
    counts = ", ".join(f"{count} {name or 'not computed'}" for name, count in table.counts.items())
    console.say(counts + _backwards(problem))
    for row in data["failed"][:SHOWN]:
        console.warn(f"point {row['point']}: {row['status']}: {row['message']}")
    said = json_text(data)
    folder.file("summary.json", lambda path: outputs.write(path, partial(write_whole, content=said)))
    folder.file("results.csv", lambda path: outputs.write(path, partial(write_csv, table)))
    try:
        folder.file("results.nc", lambda path: outputs.write(path, partial(write_netcdf, table)))
    except ImportError as error:
        console.say(f"no results.nc: {error}")
    outputs.keep()
    folder.report()
    if not table.complete:
        if folder.path is not None:
            console.warn(f"interrupted; to go on: {_resume(settings)}")
        return INTERRUPTED
    return FAILED if table.failed.size else 0


def run_ensemble(settings: dict[str, Any], console: Console) -> int:
    """Write where every trajectory ends; 3 where some failed, 130 interrupted."""
    problem, options = _start(settings)
    sweep = Sweep(
        problem, settings["over"], settings["samples"], n=settings["n"], seed=settings["seed"], **options
    )
    folder = Folder(settings["output"], console)
    x0, values = split(sweep.plan, np.arange(len(sweep.points)))
    with console.progress("ensemble") as progress:
        ends = solve_many(
            problem.system, x0, problem.t_span, parameters=values, threads=settings["jobs"],
            backward=problem.backward,
            progress=progress, **options,
        )  # fmt: skip
    states = problem.system.states
    counts = Counter(status.value for status in ends.status)
    data = {
        "model": settings["model"], "backward": problem.backward, "trajectories": len(ends.t),
        "complete": ends.complete,
        "counts": dict(counts), "nfev": int(ends.nfev.sum()), "lanes": ends.lanes, "threads": ends.threads,
    }  # fmt: skip
    console.result(data)
    console.say(", ".join(f"{count} {name}" for name, count in counts.items()) + _backwards(problem))
    for k in np.flatnonzero(~ends.success)[:SHOWN].tolist():
        console.warn(f"trajectory {k}: {ends.status[k].value}: {ends.message[k]}".removesuffix(": "))
    folder.json("summary.json", data)
    columns = (*sweep.names, "t", *(f"end({name})" for name in states), "mode", "events", "status", "message")
    modes = [mode_text(tuple(mode)) for mode in ends.mode.tolist()]
    rows = zip(
        sweep.points.tolist(), ends.t.tolist(), ends.x.tolist(), modes, ends.events().tolist(), ends.status,
        ends.message, strict=True,
    )  # fmt: skip
    folder.csv("ends.csv", columns, ([*p, t, *x, *rest] for p, t, x, *rest in rows))
    arrays: dict[str, Any] = {
        "points": sweep.points, "t": ends.t, "x": ends.x, "mode": ends.mode, "counts": ends.counts,
        "success": ends.success,
    }  # fmt: skip
    folder.content("ends.npz", lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    folder.report()
    return INTERRUPTED if not ends.complete else FAILED if not ends.success.all() else 0


def engine(settings: dict[str, Any], folder: Folder) -> dict[str, Any] | None:
    """How another command is to compute in workers, None where nothing was said about that."""
    asked = any(settings[name] for name in HOW if name != "executor")
    if not asked and settings["executor"] == "processes":
        return None
    return {"folder": folder.path, **{name: settings[name] for name in HOW}}


def _start(settings: dict[str, Any]) -> tuple[Problem, dict[str, Any]]:
    """The template and the solver's options. What is varied needs no value of its own."""
    loaded = loaded_of(settings)
    over = settings["over"]
    if not over:
        raise UsageError("nothing is varied; give --over NAME=LOW:HIGH:COUNT, or a table [sweep.over].")
    first = {name.removeprefix("x0."): values[0] for name, values in over.items() if name.startswith("x0.")}
    x0 = settings["x0"]
    if loaded.x0 is None and not isinstance(x0, list):
        x0 = {**first, **(x0 or {})}
    problem = loaded.problem({**settings, "x0": x0})
    options = {
        name: settings[name] for name in SOLVER if name != "max_time" and settings.get(name) is not None
    }
    return problem, options | {"stop": [parse_stop(text) for text in settings["stop"] or ()]}


def _backwards(problem: Problem) -> str:
    first, last = problem.t_span
    return f"; backwards in time, from t = {first:.9g} to t = {last:.9g}" if problem.backward else ""


def _failed(table: SweepTable) -> list[dict[str, Any]]:
    return [
        {"point": point, "values": dict(zip(table.names, table.points[point].tolist(), strict=True)),
         "status": table.status[point], "message": table.message.get(point, "")}
        for point in table.failed[:1000].tolist()
    ]  # fmt: skip


def _resume(settings: dict[str, Any]) -> str:
    """The command that goes on."""
    words = sys.argv[1:]
    if words[:1] != ["sweep"]:
        config = settings.get("config")
        source = ["--config", config] if config else [settings["model"]]
        words = ["sweep", *source, "-o", settings["output"]]
    words = [word for word in words if word not in ("--fresh", "--resume")]
    return shlex.join(["filippov", *words, "--resume"])
