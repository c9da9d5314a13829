"""filippov tune: controller gains without cycles, the farthest from the border of all that were found."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from scipy.stats import chi2

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import load_model
from filippov.app.cli.sections.maps import interval_of, section_of
from filippov.base.errors import UsageError
from filippov.base.given import level, number
from filippov.base.read_whole import read_json
from filippov.plot.tuning import plot_gain_maps

LARGEST = 10_000_000


def identified(path: str, known: tuple[str, ...]) -> tuple[dict[str, float], list[dict[str, float]]]:
    """Values out of the identified.json that `filippov identify` wrote, and the ends of their region.

    The region is the ellipsoid of the estimate's covariance at its level; the ends are those of its axes.
    """
    try:
        data = read_json(path, LARGEST)
        values = {k: number(v, k) for k, v in {**data["fixed"], **data["values"]}.items() if k in known}
        names = [name for name in data["values"] if name in known]
        every = list(data["values"])
        place = [every.index(name) for name in names]
        covariance = np.array(data["covariance"], dtype=float).reshape(len(every), len(every))
        radius = math.sqrt(float(chi2.ppf(level(data["level"]), max(len(names), 1))))
    except (OSError, RecursionError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} is no identified.json of `filippov identify` ({type(error).__name__}: {error})."
        ) from None
    if not np.all(np.isfinite(covariance)):
        raise UsageError(
            f"{path}: the covariance is not finite; the data do not determine every parameter. Fix some in "
            "`filippov identify`: --fixed beta=2."
        )
    sizes, axes = np.linalg.eigh(covariance[np.ix_(place, place)])
    ends = []
    for size, axis in zip(np.sqrt(np.maximum(sizes, 0.0)), axes.T, strict=True):
        for side in (-1.0, 1.0):
            shift = side * radius * size * axis
            ends.append({n: values[n] + float(s) for n, s in zip(names, shift, strict=True)})
    return values, ends


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the answer, the samples and a picture of the gains."""
    loaded = load_model(settings["model"])
    ranges = settings["over"]
    if not ranges:
        raise UsageError("which gains? give --over P=5:60 for each, lowest and highest value.")
    own: dict[str, float] = {}
    ends: list[dict[str, float]] = []
    if settings["identified"] is not None:
        own, ends = identified(settings["identified"], tuple(loaded.system.parameters.names))
    values = loaded.values({**own, **settings["parameters"]})
    spread = settings["band"]
    corners = [dict(zip(spread, pick, strict=True)) for pick in itertools.product(*spread.values())]
    for end in ends:
        # The region of an estimate may reach beyond what a parameter can be.
        for name in end:
            lower = loaded.system.parameters[name].lower
            end[name] = end[name] if lower is None else max(end[name], lower)
    corners = [{**end, **corner} for corner in corners for end in [{}, *ends]]
    section, interval = section_of(loaded, settings, "both"), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.gains.tuning import tune

    fixed = {name: value for name, value in values.items() if name not in ranges}
    with console.progress("tune") as progress:
        result = tune(
            loaded.system, section, ranges, interval, parameters=fixed, band=corners,
            samples=settings["samples"], seed=settings["seed"], progress=progress,
        )  # fmt: skip
    console.say(str(result))
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    folder.json("tuning.json", data)
    rows = zip(*result.gains.T.tolist(), result.ratio.tolist(), strict=True)
    folder.csv("samples.csv", (*result.names, "ratio"), rows)
    pairs = list(itertools.combinations(ranges, 2))
    if pairs and result.complete:
        center = result.best or {name: float(np.sqrt(a * b)) for name, (a, b) in ranges.items()}
        from filippov.analysis.gains.gain_map import gain_map

        maps, count = [], int(settings["grid"])
        values_of = {n: np.geomspace(low, high, count).tolist() for n, (low, high) in ranges.items()}
        with console.progress("gain maps") as progress:
            for k, pair in enumerate(pairs):
                x, y = ((name, values_of[name]) for name in pair)
                maps.append(gain_map(
                    loaded.system, section, x, y, interval, parameters=fixed | center, band=corners,
                ))  # fmt: skip
                progress(k + 1, len(pairs))
        folder.picture("tuning.png", lambda: plot_gain_maps(
            maps, tuning=result, title=loaded.title,
        ))  # fmt: skip
    folder.report()
    return 0 if result.complete else 130
