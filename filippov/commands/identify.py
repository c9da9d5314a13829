"""filippov identify: the parameters of a friction law from a CSV file of measurements."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.errors import UsageError
from filippov.escape import figure_text
from filippov.names import unknown
from filippov.plot_identification import plot_identification

LAWS = {"coulomb": "Coulomb", "static": "StaticCoulomb", "stribeck": "Stribeck", "hyperbolic": "Hyperbolic"}


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the estimates with their intervals, the fit as rows, and its picture."""
    if settings["data"] is None:
        raise UsageError("which file? give DATA.csv with t, x and u (or force), or v and friction.")
    record_module = importlib.import_module("filippov.analysis.record")
    module = importlib.import_module("filippov.analysis.identification")
    curves = importlib.import_module("filippov.analysis.friction_curve")
    laws = importlib.import_module("filippov.models.laws")
    record = record_module.read_record(settings["data"])
    law = getattr(laws, LAWS[settings["law"]])
    system = importlib.import_module("filippov.models.driven").driven_mass(law())
    curve = isinstance(record, record_module.Curve)
    fixed = {} if settings["fixed"] is None else settings["fixed"]
    own = [item.name for item in dataclasses.fields(law)]
    free = settings["free"] or [name for name in own if name not in fixed]
    for name in free:
        if name not in (*own, "m"):
            raise UsageError(unknown("parameter", name, (*own, "m")))
    folder = Folder(settings["output"], console)
    options: dict[str, Any] = {"start": settings["start"], "fixed": fixed, "level": settings["level"]}
    with console.progress("identify") as progress:
        if curve:
            result = curves.identify_curve(record, system, free, **options)
        else:
            result = module.identify(
                record, system, free, windows=settings["windows"], hold=settings["hold"],
                progress=lambda count, misfit: progress(count, 0), **options,
            )  # fmt: skip
    console.say(str(result))
    data = {"data": settings["data"], "law": settings["law"], "fixed": fixed} | result.to_dict()
    console.result(data)
    folder.json("identified.json", data)
    names = ("v", "friction", "fitted", "residual") if curve else ("t", "x", "fitted", "residual")
    columns = (result.t, result.measured, result.fitted, result.residual)
    folder.csv("fit.csv", names, zip(*(column.tolist() for column in columns), strict=True))

    def force(v: Any, values: dict[str, float]) -> Any:
        return curves.friction_force(system, v, {**fixed, **values})

    points, title = (record.v, record.friction) if curve else None, figure_text(settings["data"])
    folder.picture("fit.png", lambda: plot_identification(result, force, points=points, title=title))
    folder.report()
    return 0 if result.success else 3
