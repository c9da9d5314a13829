"""filippov tune: controller gains without hunting, the farthest from the border of all that were found."""

from __future__ import annotations

import importlib
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np

from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.commands.maps import interval_of, section_of
from filippov.commands.model import load_model
from filippov.errors import UsageError
from filippov.plot_tuning import plot_gain_maps

LARGEST = 10_000_000


def identified(path: str, known: tuple[str, ...]) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Values and intervals out of the identified.json that `filippov identify` wrote."""
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST:
            raise UsageError(f"{path} is larger than {LARGEST} bytes, which no identified.json is.")
        data = json.loads(file.read_text(encoding="utf-8"))
        values = {k: float(v) for k, v in {**data["fixed"], **data["values"]}.items() if k in known}
        intervals = {k: (float(a), float(b)) for k, (a, b) in data["intervals"].items() if k in known}
    except (OSError, RecursionError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} is no identified.json of `filippov identify` ({type(error).__name__}: {error})."
        ) from None
    return values, intervals


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the answer, the samples and a picture of the gains."""
    loaded = load_model(settings["model"])
    ranges = settings["ranges"]
    if not ranges:
        raise UsageError("which gains? give --ranges P=5:60 for each, lowest and highest value.")
    own: dict[str, float] = {}
    spread: dict[str, tuple[float, float]] = {}
    if settings["identified"] is not None:
        own, spread = identified(settings["identified"], tuple(loaded.system.parameters.names))
    values = loaded.values({**own, **settings["parameters"]})
    spread |= settings["band"]
    known = {name: loaded.system.parameters[name] for name in spread if name in loaded.system.parameters}
    for name, declared in known.items():
        # An interval of an estimate may reach beyond what the parameter can be.
        if declared.lower is not None:
            spread[name] = (max(spread[name][0], declared.lower), spread[name][1])
    corners = [dict(zip(spread, pick, strict=True)) for pick in itertools.product(*spread.values())]
    section, interval = section_of(loaded, settings), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    module = importlib.import_module("filippov.analysis.tuning")
    fixed = {name: value for name, value in values.items() if name not in ranges}
    with console.progress("tune") as progress:
        result = module.tune(
            loaded.system, section, ranges, interval, parameters=fixed, band=corners,
            samples=settings["samples"], seed=settings["seed"], progress=progress,
        )  # fmt: skip
    console.say(str(result))
    data = {"model": loaded.name, "parameters": fixed, "ranges": ranges, "band": corners} | result.to_dict()
    console.result(data)
    folder.json("tuning.json", data)
    rows = zip(*result.gains.T.tolist(), result.ratio.tolist(), strict=True)
    folder.csv("samples.csv", (*result.names, "ratio"), rows)
    pairs = list(itertools.combinations(ranges, 2))
    if pairs and result.complete:
        center = result.best or {name: float(np.sqrt(a * b)) for name, (a, b) in ranges.items()}
        module = importlib.import_module("filippov.analysis.gain_map")
        maps, count = [], int(settings["grid"])
        values_of = {n: np.geomspace(low, high, count).tolist() for n, (low, high) in ranges.items()}
        with console.progress("gain maps") as progress:
            for k, pair in enumerate(pairs):
                axes = [(name, values_of[name]) for name in pair]
                maps.append(module.gain_map(
                    loaded.system, section, *axes, interval, parameters=fixed | center, band=corners,
                ))  # fmt: skip
                progress(k + 1, len(pairs))
        folder.picture("tuning.png", lambda: plot_gain_maps(maps, tuning=result, title=loaded.name))
    folder.report()
    return 0 if result.complete else 130
