"""filippov identify: the parameters of a friction law from a CSV file of measurements."""

from __future__ import annotations

import dataclasses
from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.base.errors import UsageError
from filippov.base.escape import figure_text
from filippov.base.names import unknown
from filippov.plot.identification import plot_identification


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the estimates with their intervals, the fit as rows, and its picture."""
    if settings["data"] is None:
        raise UsageError("which file? give DATA.csv with t, x and u (or force), or v and friction.")
    from filippov import models
    from filippov.analysis.estimation import friction_curve as curves
    from filippov.analysis.estimation import identification as module
    from filippov.analysis.estimation import record as record_module
    from filippov.models.driven import driven_mass
    from filippov.models.offered import LAWS

    record = record_module.read_record(settings["data"])
    law = getattr(models, LAWS[settings["law"]])
    system = driven_mass(law())
    fixed = {} if settings["fixed"] is None else settings["fixed"]
    own = [item.name for item in dataclasses.fields(law)]
    free = settings["free"] or [name for name in own if name not in fixed]
    for name in free:
        if name not in (*own, "m"):
            raise UsageError(unknown("parameter", name, (*own, "m")))
    folder = Folder(settings["output"], console)
    options: dict[str, Any] = {"start": settings["start"], "fixed": fixed, "level": settings["level"]}
    with console.progress("identify") as progress:
        if isinstance(record, record_module.Curve):
            result = curves.identify_curve(record, system, free, **options)
        else:
            result = module.identify(
                record, system, free, windows=settings["windows"], hold=settings["hold"],
                progress=lambda count, misfit: progress(f"{count} evaluations, misfit {misfit:.3g}"),
                **options,
            )  # fmt: skip
    *told, last = str(result).splitlines()  # the last one says why, where it did not succeed
    console.say("\n".join(told))
    (console.say if result.success else console.warn)(last)
    data = {"data": settings["data"], "law": settings["law"]} | result.to_dict()
    console.result(data)
    folder.json("identified.json", data)
    points = (record.v, record.friction) if isinstance(record, record_module.Curve) else None
    first = ("t", "x") if points is None else ("v", "friction")
    columns = (result.t, result.measured, result.fitted, result.residual)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    folder.csv("fit.csv", (*first, "fitted", "residual"), rows)

    def force(v: Any, values: dict[str, float]) -> Any:
        return curves.friction_force(system, v, {**fixed, **values})

    title = figure_text(settings["data"])
    folder.picture("fit.png", lambda: plot_identification(result, force, points=points, title=title))
    folder.report()
    return 0 if result.success else 3
