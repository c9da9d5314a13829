"""filippov event-map and filippov bifurcation: the map of a section, its fixed points, and how they move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov.app.cli.configuration import ENGINE_NAMES, unused
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import Loaded, loaded_of
from filippov.app.cli.sections.along import follows_solution, section_along, suggestion, values_over, varied
from filippov.app.cli.sections.return_pairs import run_return_pairs
from filippov.app.cli.sweep import engine
from filippov.base.errors import ModelError, UsageError
from filippov.plot.maps import plot_diagram, plot_event_map

PARTS = ("surface", "event", "coordinate", "parametrisation")
CONDITION = "after"
POINT_COLUMNS = ("d", "kind", "slope", "stable", "verdict", "residual", "period", "note")
CHUNK = 64


def section_of(loaded: Loaded, settings: dict[str, Any], interval: str = "any") -> Any:
    """The section of the flags, else the model's own; `interval` as in `suggestion`. Raises UsageError."""
    from filippov.analysis.maps.section import Section

    given = {name: settings[name] for name in PARTS if settings.get(name) is not None}
    own = getattr(loaded.model, "section", None)
    if own is None and len(given) < len(PARTS):
        missing = ", ".join(f"--{name}" for name in PARTS if name not in given)
        raise UsageError(
            f"{loaded.name} proposes no section; give {missing}.{suggestion(loaded, interval)}"
        )
    if settings.get(CONDITION) is not None:
        given[CONDITION] = settings[CONDITION]
    base = {} if own is None else {
        "surface": own.surface, "event": own.kind, "coordinate": own.coordinate,
        "parametrisation": own.parametrisation,
        CONDITION: own.after if given.keys().isdisjoint(("surface", "event")) else "",
    }  # fmt: skip
    chosen = base | given
    own_time = 100.0 if own is None else own.t_max
    t_max = own_time if settings.get("t_max") is None else settings["t_max"]
    made = Section(chosen["surface"], chosen["event"], chosen["coordinate"], chosen["parametrisation"],
                   t_max, chosen.get(CONDITION, ""))  # fmt: skip
    try:
        made.bind(loaded.system)
    except ModelError as error:  # the system is made, so it is the parametrisation
        raise UsageError(str(error)) from None
    return made


def interval_of(loaded: Loaded, settings: dict[str, Any]) -> tuple[float, float]:
    """--interval, else the model's own."""
    own = getattr(getattr(loaded.model, "section", None), "interval", None)
    interval = settings["interval"] or own
    if interval is None:
        raise UsageError(f"{loaded.name} proposes no interval; give --interval LO HI.")
    lo, hi = (float(value) for value in interval)
    if not lo < hi:
        raise UsageError(f"--interval is {lo:g} {hi:g}, expected LO < HI.")
    return lo, hi


def run_event_map(settings: dict[str, Any], console: Console) -> int:
    """Sample the map, find its fixed points, follow an orbit; after Ctrl-C write the samples there are."""
    loaded = loaded_of(settings)
    if settings["start"] is None:
        unused(settings, ("iterates",), "an orbit of the map begins at --start")
    if follows_solution(loaded, settings):
        return run_return_pairs(loaded, settings, console)
    values = loaded.values(settings["parameters"])
    section, (lo, hi) = section_of(loaded, settings), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    options = {name: settings[name] for name in ("rtol", "atol", "method") if settings[name] is not None}
    from filippov.analysis.maps import event_map as maps

    event_map = maps.EventMap(loaded.system, section, parameters=values, order=settings["order"], **options)
    d = np.linspace(lo, hi, settings["points"])
    image, status = np.full(d.size, np.nan), [""] * d.size
    done, orbit = 0, None
    points: Sequence[Any] = ()
    try:
        with console.progress("event map") as progress:
            for first in range(0, d.size, CHUNK):
                part = slice(first, first + CHUNK)
                image[part], ended = event_map.returns(d[part])
                status[part] = [entry.value for entry in ended]
                done = min(first + CHUNK, d.size)
                progress(done, d.size)
        with console.progress("fixed points"):
            points = event_map.fixed_points(lo, hi, max(8, settings["points"]))
        if settings["start"] is not None:
            orbit = event_map.iterate(settings["start"], settings["iterates"])
        code = 0
    except KeyboardInterrupt:
        console.warn(f"interrupted; {done} of {d.size} points of the map are kept")
        code = 130
    _tell(points, console)
    if done and np.all(np.isnan(image[:done])):
        middle = float(d[done // 2])
        why = event_map.why(middle)
        console.warn(f"no solution from the section returns to it. From d = {middle:g}: {why}")
    data = {
        "model": loaded.name, "parameters": values, "order": settings["order"], "interval": [lo, hi],
        "section": section.to_dict(), "fixed_points": [point.to_dict() for point in points],
        "complete": code == 0,
    }  # fmt: skip
    if orbit is not None:
        data["orbit"] = orbit
    console.result(data | {"d": d[:done], "R": image[:done], "status": status[:done]})
    folder.csv("map.csv", ("d", "R", "status"), zip(d[:done].tolist(), image.tolist(), status, strict=False))
    folder.json("fixed_points.json", data)
    if code == 0:
        folder.picture("map.png", lambda: plot_event_map(
            event_map, lo, hi, samples=(d, image), fixed=points, orbit=orbit, title=loaded.title,
        ))  # fmt: skip
    folder.report()
    return code


def run_bifurcation(settings: dict[str, Any], console: Console) -> int:
    """Fixed points over a parameter, folds, changes of stability."""
    loaded = loaded_of(settings)
    values = loaded.values(settings["parameters"])
    parameter, low, high = varied(loaded, settings)
    at = values_over(settings, low, high, 22)
    x0 = interval = None
    if follows_solution(loaded, settings):
        unused(settings, ENGINE_NAMES, "a solution is followed from value to value, in this process")
        section, x0 = section_along(loaded, settings, values, console, (parameter, low, high))
    else:
        section, interval = section_of(loaded, settings), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams import bifurcation as module

    options = {k: settings[k] for k in ("order", "points", "rtol", "atol") if settings[k] is not None}
    with console.progress("bifurcation") as progress:
        diagram = module.bifurcation(
            loaded.system, section, parameter=parameter,
            values=at,
            interval=interval, x0=x0, parameters={k: v for k, v in values.items() if k != parameter},
            engine=None if x0 is not None else engine(settings, folder), progress=progress, **options,
        )  # fmt: skip
    found_at = list(zip(diagram.values, diagram.points, strict=True))
    rows = [(value, point) for value, found in found_at for point in found]
    data = {"model": loaded.name} | diagram.to_dict()
    console.result(data)
    console.say(str(diagram))
    folder.csv(
        "bifurcation.csv", (parameter, *POINT_COLUMNS), ([float(v), *_row(p)] for v, p in rows)
    )
    folder.json("bifurcation.json", data)
    folder.picture("bifurcation.png", lambda: plot_diagram(diagram, title=loaded.title))
    folder.report()
    return 0


def _row(point: Any) -> list[Any]:
    data = point.to_dict()
    return [data[name] for name in POINT_COLUMNS]


def _tell(points: Sequence[Any], console: Console) -> None:
    for point in points:
        kind = f"{point.verdict} {point.kind}"
        note = f", {point.note}" if point.note else ""
        console.say(f"d = {point.d:.12g}  {kind}, slope {point.slope:.6g}{note}")
