"""filippov compare: the exact inclusion against its band and regularised models."""

from __future__ import annotations

from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.maps import section_of
from filippov.app.cli.model import load_model


def band_models(name: str, alphas: Any) -> list[Any]:
    """The band models that a study of this model names, with other values of alpha where asked for."""
    from filippov.analysis.comparisons.band_model import BandModel
    from filippov.models import studies

    out = []
    for study in map(studies.get_study, studies.study_names()):
        if study.model == name:
            for variant in study.variants:
                options = dict(variant.options)
                if alphas is not None and "alpha" in options:
                    options["alpha"] = tuple(alphas)
                out.append(BandModel(variant.name, variant.build, variant.stick, options))
    return out


def own_interval(loaded: Any) -> tuple[float, float] | None:
    """The interval of coordinates that the model proposes."""
    return getattr(getattr(loaded.model, "section", None), "interval", None)


def run(settings: dict[str, Any], console: Console) -> int:
    """Errors, field calls and times as a table."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    section = section_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.comparisons.comparison import compare

    given: dict[str, Any] = {} if settings["widths"] is None else {"widths": settings["widths"]}
    bands = band_models(loaded.name, settings["alphas"])
    with console.progress("compare") as progress:
        result = compare(
            loaded.system, section, bands, parameters=values, interval=own_interval(loaded),
            progress=progress, **given,
        )  # fmt: skip
    rows = [dict(row) for row in result.rows]
    columns = tuple(dict.fromkeys(key for row in rows for key in row))
    console.result({"model": loaded.name, "parameters": values, "rows": rows})
    console.say(result.to_text())
    folder.csv("comparison.csv", columns, ([row.get(key) for key in columns] for row in rows))
    folder.json("comparison.json", {"model": loaded.name, "parameters": values, "rows": rows})
    folder.content("comparison.txt", result.to_text())
    folder.picture("comparison.png", result.plot)
    folder.report()
    return 0
