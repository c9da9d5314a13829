"""filippov lyapunov and filippov diagram: exponents of a solution, diagrams by iteration."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import loaded_of
from filippov.app.cli.sections.along import follows_solution, section_along, values_over, varied
from filippov.app.cli.sections.maps import interval_of, section_of
from filippov.base.errors import UsageError
from filippov.plot.lyapunov import plot_brute_force, plot_lyapunov


def run_lyapunov(settings: dict[str, Any], console: Console) -> int:
    """Write the exponents and how they settle; after Ctrl-C those of the time that was run."""
    loaded = loaded_of(settings)
    problem = loaded.problem({**settings, "t_span": (0.0, 1.0)})
    for name in ("duration", "interval"):
        if settings[name] is None:
            raise UsageError(f"how long? give --{name} TIME.")
    folder = Folder(settings["output"], console)
    from filippov.analysis.sensitivity import lyapunov as module

    options = {name: settings[name] for name in ("number", "rtol", "atol") if settings[name] is not None}
    with console.progress("exponents") as progress:
        found = module.lyapunov(
            problem.system, problem.x0, settings["duration"], interval=settings["interval"],
            transient=settings["transient"], parameters=problem.parameters, progress=progress, **options,
        )  # fmt: skip
    console.say(str(found))
    if found.message:
        console.warn(found.message)
    data = {"model": loaded.name} | found.to_dict()
    console.result(data)
    folder.json("exponents.json", data)
    columns = ("t", *(f"exponent {k + 1}" for k in range(len(found.exponents))))
    folder.csv("exponents.csv", columns, np.column_stack([found.t[1:], found.running]).tolist())
    folder.picture("exponents.png", lambda: plot_lyapunov(found, title=loaded.title))
    folder.report()
    return 130 if found.interrupted else 0


def run_diagram(settings: dict[str, Any], console: Console) -> int:
    """Write the iterates at every value of the parameter and their picture."""
    loaded = loaded_of(settings)
    values = loaded.values(settings["parameters"])
    parameter, low, high = varied(loaded, settings)
    at = values_over(settings, low, high, 200)
    if follows_solution(loaded, settings):
        section, start = section_along(loaded, settings, values, console, (parameter, low, high))
    else:
        section, start = section_of(loaded, settings), settings["start"]
        start = 0.5 * sum(interval_of(loaded, settings)) if start is None else start
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams import brute_force as module

    with console.progress("diagram") as progress:
        found = module.brute_force(
            loaded.system, section, parameter, at,
            start,
            transient=settings["transient"], keep=settings["keep"], follow=settings["follow"],
            rtol=settings["rtol"], progress=progress,
            parameters={name: value for name, value in values.items() if name != parameter},
        )  # fmt: skip
    data = {"model": loaded.name} | found.to_dict()
    console.result(data)
    console.say(str(found))
    folder.json("diagram.json", data)
    rows = zip(found.values.tolist(), found.period.tolist(), *found.d.T.tolist(), strict=True)
    folder.csv("diagram.csv", (parameter, "period", *(f"d{k}" for k in range(found.d.shape[1]))), rows)
    folder.picture("diagram.png", lambda: plot_brute_force(found, title=loaded.title))
    folder.report()
    return 0 if found.complete else 130
