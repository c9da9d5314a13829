"""filippov homoclinic: the homoclinic orbit of a saddle, and the parameter value at which there is one."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import load_model
from filippov.base.errors import UsageError

KEEP = ("free", "mode", "side", "t_max", "rtol", "atol")


def run(settings: dict[str, Any], console: Console) -> int:
    """Find it near --x0, say where it is, write homoclinic.json, homoclinic.csv and homoclinic.png."""
    if settings.get("free") is None:
        raise UsageError("homoclinic needs the parameter that is solved for: --free NAME.")
    loaded = load_model(settings["model"])
    problem = loaded.problem({**settings, "t_span": (0.0, 1.0)})
    folder = Folder(settings["output"], console)
    from filippov.analysis.orbits.homoclinic import find_homoclinic as find
    options = {name: settings[name] for name in KEEP if settings.get(name) is not None}
    found = find(problem.system, problem.x0, parameters=problem.parameters, **options)
    data = {"model": loaded.name} | found.to_dict()
    console.result(data)
    place = ", ".join(f"{n} = {v:.9g}" for n, v in zip(problem.system.states, found.saddle.x, strict=True))
    console.say(f"homoclinic orbit at {found.free} = {found.value:.12g}: {found.word}")
    console.say(f"saddle: {place}; eigenvalues: {', '.join(f'{v:.9g}' for v in found.saddle.eigenvalues)}")
    rows = [row for piece in found.pieces for row in _rows(piece)]
    folder.csv("homoclinic.csv", ("t", *problem.system.states), rows)
    folder.json("homoclinic.json", data)
    folder.picture("homoclinic.png", found.plot)
    folder.report()
    return 0


def _rows(piece: Any) -> list[list[float]]:
    t = np.linspace(piece.problem.t_span[0], piece.t_end, 9)
    rows: list[list[float]] = np.vstack([t, piece.sol(t)]).T.tolist()
    return rows
