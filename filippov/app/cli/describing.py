"""filippov describing-function: the limit cycles that harmonic balance predicts."""

from __future__ import annotations

from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import load_model
from filippov.plot.describing import plot_describing_function


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the prediction, the growth rate over the amplitude, and its picture."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    folder = Folder(settings["output"], console)
    from filippov.analysis.harmonic import describing_function as module

    options = {} if settings["amplitudes"] is None else {"amplitudes": tuple(settings["amplitudes"])}
    with console.progress("describing function"):
        prediction = module.describing_function(loaded.system, settings["surface"], values, **options)
    console.say(str(prediction))
    data = {"model": loaded.name} | prediction.to_dict()
    console.result(data)
    folder.json("prediction.json", data)
    columns = ("amplitude", "growth", "frequency")
    rows = zip(*(getattr(prediction, name).tolist() for name in columns), strict=True)
    folder.csv("prediction.csv", columns, rows)
    folder.picture("prediction.png", lambda: plot_describing_function(prediction, title=loaded.title))
    folder.report()
    return 0
