"""filippov compare: the exact inclusion against its approximations, over a section or along a solution.

What works is imported when it is run: the catalogue of commands reads the options here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from filippov.app.cli.configuration import SECTION_NAMES, Option, unused
from filippov.app.cli.values import number, numbers, one_of, texts, whole, words
from filippov.base.errors import UsageError

if TYPE_CHECKING:
    from filippov.app.cli.console import Console
    from filippov.app.cli.model import Loaded

# As in `filippov.analysis.comparisons`, which is not imported for a help text.
KINDS = (
    "switch", "karnopp", "band", "tanh", "arctan", "sqrt", "hysteresis", "lugre", "dahl",
    "elasto-plastic", "maxwell-slip", "memory", "bengisu-akay", "seven-parameter", "moreau",
)  # fmt: skip
ERRORS = ("error_state", "error_final", "error_times", "drift")

APPROXIMATIONS = (
    Option("against", f"along a solution: {', '.join(KINDS)}; several with commas", words,
           metavar="NAME,NAME,..."),
    Option("widths", "band widths, with commas", numbers, metavar="ETA,ETA,..."),
    Option("alphas", "stiffnesses of the band, with commas", numbers, metavar="ALPHA,ALPHA,..."),
    Option("accuracy", "along a solution: error whose width is solved for and checked", number,
           metavar="E"),
    Option("tau", "along a solution: time of the bristle models that have one", number, metavar="T"),
    Option("theta", "along a solution: of moreau, 0.5 to 1", number, metavar="THETA"),
    Option("max_steps", "along a solution: budget of steps of a run", whole, metavar="N"),
    Option("max_events", "along a solution: budget of events of a run", whole, metavar="N"),
    Option("quantity", "the error that --accuracy is of", one_of(*ERRORS),
           metavar="{" + ",".join(ERRORS) + "}"),
    Option("measure", "further numbers of each run: amplitude(x), path/to/file.py:name; can be repeated",
           texts, metavar="MEASURE", repeat=True),
)  # fmt: skip
# Handed on by their names.
NAMED = ("against", "accuracy", "quantity", "tau", "theta", "max_steps", "max_events")
OF_SOLUTIONS = (*NAMED, "measure")


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
    """Errors, field calls and times as a table: along a solution where one is given, else over a section."""
    from filippov.app.cli.folder import Folder
    from filippov.app.cli.model import loaded_of
    from filippov.app.cli.sections.maps import PARTS, section_of

    loaded = loaded_of(settings)
    of_solutions = [name for name in (*OF_SOLUTIONS, "x0", "t_span") if settings.get(name) is not None]
    sectionless = getattr(loaded.model, "section", None) is None
    if of_solutions or (sectionless and all(settings.get(part) is None for part in PARTS)):
        return run_solutions(loaded, settings, console)
    values = loaded.values(settings["parameters"])
    section = section_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.comparisons.comparison import compare

    given = {name: settings[name] for name in ("widths", "rtol", "atol") if settings[name] is not None}
    bands = band_models(loaded.name, settings["alphas"])
    with console.progress("compare") as progress:
        result = compare(
            loaded.system, section, bands, parameters=values, interval=own_interval(loaded),
            progress=progress, **given,
        )  # fmt: skip
    rows = [dict(row) for row in result.rows]
    columns = tuple(dict.fromkeys(key for row in rows for key in row))
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(result.to_text())
    folder.csv("comparison.csv", columns, ([row.get(key) for key in columns] for row in rows))
    folder.json("comparison.json", data)
    folder.content("comparison.txt", result.to_text())
    folder.picture("comparison.png", result.plot)
    folder.report()
    return 0


def run_solutions(loaded: Loaded, settings: dict[str, Any], console: Console) -> int:
    """The same along a solution: comparison.csv, .json, .txt, .html and .png."""
    unused(settings, SECTION_NAMES, "a solution is compared, not the returns to a section")
    if settings["alphas"] is not None and len(settings["alphas"]) > 1:
        raise UsageError("--alphas has several values; along a solution give one.")
    problem = loaded.problem(settings)
    from filippov.analysis.comparisons.solutions import compare_solutions
    from filippov.app.cli.folder import Folder

    folder = Folder(settings["output"], console)
    given = {name: settings[name] for name in ("widths", "rtol", "atol", *NAMED)}
    given |= {"measures": settings["measure"], "alpha": (settings["alphas"] or [None])[0]}
    with console.progress("compare") as progress:
        result = compare_solutions(
            loaded.system, problem.x0, problem.t_span, parameters=dict(problem.parameters), progress=progress,
            **{name: value for name, value in given.items() if value is not None},
        )  # fmt: skip
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(result.to_text())
    folder.content("comparison.csv", result.to_csv())
    folder.json("comparison.json", data)
    folder.content("comparison.txt", result.to_text())
    if folder.path is not None:
        folder.content("comparison.html", result.to_html())
    folder.picture("comparison.png", lambda: result.plot(title=loaded.title))
    folder.report()
    return 0
