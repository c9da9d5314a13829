"""filippov event-map along one solution: each event of a section over the one before it."""

from __future__ import annotations

from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import Loaded
from filippov.app.cli.sections.along import section_along
from filippov.base.errors import ModelError, SolveError, UsageError
from filippov.plot.maps import plot_returns
from filippov.plot.style import coordinate_labels

COLUMNS = ("t", "d", "R")


def run_return_pairs(loaded: Loaded, settings: dict[str, Any], console: Console) -> int:
    """Write the pairs, the orbit that the solution goes to, and their picture."""
    values = loaded.values(settings["parameters"])
    section, x0 = section_along(loaded, settings, values, console)
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams.orbit_points import orbit_points
    from filippov.analysis.maps.returns import returns
    from filippov.analysis.orbits.orbit_search import find_orbit

    options = {name: settings[name] for name in ("rtol", "atol", "method") if settings[name] is not None}
    order, count = settings["order"], settings["points"]
    with console.progress("event map"):
        found = returns(loaded.system, section, x0, count + order, parameters=values, **options)
    points: list[Any] = []
    note = found.message
    if found.d.size and not note:
        try:
            with console.progress("orbit"):
                orbit = find_orbit(loaded.system, found.x[-1], parameters=values, t0=float(found.t[-1]))
            points = orbit_points(section, orbit)
        except (SolveError, UsageError, ModelError, ArithmeticError) as error:
            note = f"no periodic orbit near the end of the solution: {error}"
    if note:
        console.say(note)
    for point in points:
        console.say(f"d = {point.d:.12g}  {point.verdict} {point.kind}, multiplier {point.slope:.6g}, one of "
                    f"{len(points)} events in its period {point.period:.9g}")  # fmt: skip
    image = found.d[order:]
    d = found.d[: len(image)]
    data = {
        "model": loaded.name, "parameters": values, "order": order, "x0": x0.tolist(),
        "section": section.to_dict(), "note": note,
        "fixed_points": [point.to_dict() for point in points],
        "complete": True,
    }  # fmt: skip
    console.result(data | {"t": found.t[: len(image)], "d": d, "R": image})
    rows = zip(found.t.tolist(), d.tolist(), image.tolist(), strict=False)
    folder.csv("map.csv", COLUMNS, rows)
    folder.json("fixed_points.json", data)
    if d.size:
        labels = coordinate_labels(loaded.system, section, order)
        folder.picture("map.png", lambda: plot_returns(d, image, fixed=points, labels=labels,
                                                       title=loaded.title))  # fmt: skip
    folder.report()
    return 0
