"""filippov continue: a branch of orbits, fixed points of an event map, or equilibria over a parameter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from filippov.app.cli.configuration import SECTION_NAMES, unused
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import Loaded, load_model
from filippov.app.cli.sections.along import varied
from filippov.app.cli.sections.maps import section_of
from filippov.base.errors import ModelError, SolveError, UsageError
from filippov.base.names import unknown

FILE = "branch.json"


def run(settings: dict[str, Any], console: Console) -> int:
    """Follow the branch; write branch.json, branch.csv and branch.png, also when interrupted."""
    loaded = load_model(settings["model"])
    parameter, first, last = _varied(loaded, settings)
    bounds = (min(first, last), max(first, last))
    folder = Folder(settings["output"], console)
    from filippov.analysis.bifurcations import branch as branches
    from filippov.analysis.bifurcations import continuation as module

    resume = branches.Branch.load(settings["resume"]) if settings["resume"] else None
    values = loaded.values(settings["parameters"]) | {parameter: first}
    names = ("step", "max_step", "max_points", "max_time")
    options = {name: settings[name] for name in names if settings[name] is not None}
    begin, extra = _start(loaded, settings, values, console)
    follow = module.continuation(
        loaded.system, begin, parameter=parameter, bounds=bounds, direction=1 if last >= first else -1,
        resume=resume, **extra, **options,
    )  # fmt: skip
    with console.progress("continuation") as progress:
        branch = follow.run(progress)
    _tell(branch, console)
    others, curves = _switched(follow, settings, options, console), _curves(follow, settings, console)
    data = {"model": loaded.name} | branch.to_dict() | {
        "switched": [other.to_dict() for other in others], "curves": [found.to_dict() for found in curves],
    }  # fmt: skip
    console.result(data)
    _write(folder, "branch", branch)
    for name, found in (("branch", others), ("curve", curves)):
        for number, item in enumerate(found, 1):
            _write(folder, f"{name}-{number}", item)
    from filippov.plot import branch as plots

    folder.picture("branch.png", lambda: plots.plot_branches([branch, *others], title=loaded.title))
    if curves:
        folder.picture("curves.png", lambda: plots.plot_branches(
            curves, coordinate=parameter, names=[item.kind for item in curves], title=loaded.title,
        ))  # fmt: skip
    folder.report()
    if branch.interrupted:
        where = Path(settings["output"] or ".") / FILE
        console.say(f"go on with --resume {where}")
        return 130
    return 0


def _varied(loaded: Loaded, settings: dict[str, Any]) -> tuple[str, float, float]:
    """The parameter of --over NAME=LOW:HIGH, or of --parameter, --from and --to. Raises UsageError."""
    ends = {name: settings[name] for name in ("parameter", "from", "to") if settings[name] is not None}
    if not settings["over"]:
        name = ends.get("parameter")
        if name is None:
            raise UsageError(
                "which parameter? give --over NAME=LOW:HIGH, or --parameter NAME --from LO --to HI."
            )
        if name not in loaded.system.parameters:
            raise UsageError(unknown("parameter", name, loaded.system.parameters))
        if len(ends) < 3:
            raise UsageError(
                f"over which values of {name}? give --over {name}=LOW:HIGH, or --from LO --to HI."
            )
    elif ends:
        raise UsageError("--over says what --parameter, --from and --to say; give one or the other.")
    return varied(loaded, settings | {"values": (ends["from"], ends["to"]) if ends else None})


def _start(
    loaded: Loaded, settings: dict[str, Any], values: dict[str, float], console: Console
) -> tuple[Any, dict[str, Any]]:
    """What the continuation starts from: a fixed point at --start, an equilibrium of --mode, an orbit."""
    if settings["start"] is None:
        unused(settings, SECTION_NAMES, "a section is of a fixed point at --start")
    else:
        unused(settings, ("mode", "x0"), "--start is a coordinate of a section, where the branch begins")
    if settings["mode"] is not None:
        if settings["x0"] is None:
            raise UsageError("an equilibrium needs a state near it: --x0.")
        state = loaded.problem({"x0": settings["x0"], "t_span": (0.0, 1.0)}).x0
        return state, {"mode": settings["mode"], "parameters": values}
    if settings["start"] is not None:
        from filippov.analysis.maps import event_map as maps

        section = section_of(loaded, settings)
        return (maps.EventMap(loaded.system, section, parameters=values, order=2), settings["start"]), {}
    from filippov.analysis.orbits.orbit_search import find_orbit as find

    problem = loaded.problem({"x0": settings["x0"], "t_span": (0.0, 1.0), "parameters": values})
    with console.progress("orbit") as progress:
        orbit = find(problem.system, problem.x0, parameters=values, progress=progress)
    return orbit, {}


def _switched(
    follow: Any, settings: dict[str, Any], options: dict[str, Any], console: Console
) -> list[Any]:
    """The branches that leave at special points, with --switch."""
    if not settings["switch"]:
        return []
    from filippov.analysis.bifurcations import switch as module

    at = [point for point in follow.branch.special if point.special in module.SWITCHES]
    if not at:
        console.say(f"no other branch leaves: there is none of {', '.join(module.SWITCHES)}")
    return _run_all([(p, partial(module.switch, follow, p, **options)) for p in at], "switch", console)


def _curves(follow: Any, settings: dict[str, Any], console: Console) -> list[Any]:
    """The curves of special points over a second parameter, with --curve NAME=LOW:HIGH; with --switch also
    the curves that meet them at codimension-2 points."""
    if not settings["curve"]:
        return []
    if len(settings["curve"]) != 1:
        raise UsageError(
            f"--curve takes one parameter, given {', '.join(settings['curve'])}: leave one of them."
        )
    ((name, bounds),) = settings["curve"].items()
    from filippov.analysis.bifurcations.curve import curve

    at = follow.branch.special
    made = [(p, partial(curve, follow, p, parameter=name, bounds=bounds)) for p in at]
    runs: list[Any] = []
    found = _run_all(made, "curve", console, runs)
    if not settings["switch"]:
        return found
    from filippov.analysis.bifurcations import curve_switch as module
    meeting = [
        (point, partial(module.switch_curve, run, point, kind))
        for run in runs
        for point in run.branch.special
        if point.special in module.MEETS
        for kind in module.curves_at(run, point)
    ]
    return found + _run_all(meeting, "curve", console)


def _run_all(
    made: Sequence[tuple[Any, Callable[[], Any]]], what: str, console: Console, runs: list[Any] | None = None
) -> list[Any]:
    """Run continuations one after the other; one that cannot be made is named, the others go on.

    runs: takes the continuations themselves
    """
    found: list[Any] = []
    for point, make in made:
        try:
            run = make()
            if runs is not None:
                runs.append(run)
            with console.progress(what) as progress:
                found.append(run.run(progress))
        except (ModelError, UsageError, SolveError) as error:
            console.warn(f"{what} at {point.special} ({point.value:.6g}): {error}")
            continue
        _tell(found[-1], console)
        if found[-1].interrupted:
            break
    return found


def _write(folder: Folder, name: str, branch: Any) -> None:
    own = ("special", "value", "stable", "word", "period")
    known = list(branch.points[0].coordinates) if branch.points else []
    # An orbit has its period among its coordinates as well; a state may be called "value".
    names = [n for n in known if n != "period" or branch.kind in ("equilibrium", "function")]
    titles = [f"coordinate {n}" if n in own else n for n in names]
    rows = (
        [getattr(q, c) for c in own] + [q.coordinates.get(n) for n in names] for q in branch.points
    )  # fmt: skip
    folder.csv(f"{name}.csv", (*own, *titles), rows)
    folder.file(f"{name}.json", branch.save)


def _tell(branch: Any, console: Console) -> None:
    console.say(str(branch))
