"""filippov regions and filippov basin: what holds where, over two parameters or two initial states."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import load_model
from filippov.app.cli.sections.maps import interval_of, section_of
from filippov.app.cli.sweep import engine
from filippov.base.errors import UsageError
from filippov.plot.regions import plot_basin, plot_regions


def _axes(settings: dict[str, Any], what: str) -> list[tuple[str, list[float]]]:
    axes = []
    for flag in ("x", "y"):
        if len(settings[flag]) != 1:
            raise UsageError(f"which {what}? give --{flag} NAME=LOW:HIGH, one name.")
        ((name, (low, high)),) = settings[flag].items()
        if not low < high:
            raise UsageError(f"--{flag} is {name}={low:g}:{high:g}, expected LOW < HIGH.")
        axes.append((name, np.linspace(low, high, settings["cells"]).tolist()))
    return axes


def run_regions(settings: dict[str, Any], console: Console) -> int:
    """Write the cells as rows and as a picture; after Ctrl-C those that are done."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    x, y = _axes(settings, "parameters")
    section, interval = section_of(loaded, settings, "positive"), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams import regions as module

    with console.progress("regions") as progress:
        result = module.regions(
            loaded.system, section, x, y, interval, order=settings["order"], points=settings["points"],
            rtol=settings["rtol"], parameters={k: v for k, v in values.items() if k not in (x[0], y[0])},
            engine=engine(settings, folder), progress=progress, borders=settings["borders"] or (),
        )  # fmt: skip
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(str(result))
    folder.json("regions.json", data)
    columns = (x[0], y[0], "cycles", "stable", "undecided", "set_verdict", "amplitude", "lost")
    grid = np.meshgrid(result.x, result.y)
    cells = [a.ravel().tolist() for a in (
        *grid, result.cycles, result.stable, result.undecided, result.set_verdict, result.amplitude,
        result.lost,
    )]  # fmt: skip
    folder.csv("regions.csv", columns, zip(*cells, strict=True))
    folder.picture("regions.png", lambda: plot_regions(
        result, labels=loaded.labels(*result.names), title=loaded.title,
    ))  # fmt: skip
    folder.report()
    return 0 if result.complete else 130


def run_basin(settings: dict[str, Any], console: Console) -> int:
    """Write the labels and their picture; after Ctrl-C those that are done."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    x, y = _axes(settings, "states")
    section, (lo, hi) = section_of(loaded, settings), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams import basin as module

    interval = (min(lo, -hi), hi)
    with console.progress("basin") as progress:
        result = module.basin(
            loaded.system, section, x, y, interval, at=settings["at"], parameters=values,
            order=settings["order"], rtol=settings["rtol"], engine=engine(settings, folder),
            progress=progress,
        )  # fmt: skip
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(str(result))
    folder.json("basin.json", data)
    arrays = {"x": result.x, "y": result.y, "label": result.label, "d": result.d}
    folder.content("basin.npz", lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    folder.picture("basin.png", lambda: plot_basin(result, labels=loaded.labels(*result.names)))
    folder.report()
    return 0 if result.complete else 130
