"""The table of approximations: six plants, exact and under what is used in place of the inclusion.

Every row is a run of `compare` along one solution, at the narrowest width, with the order seen over the
widths beside the one that theory gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from filippov.analysis.comparisons.approximation import STEPS, UNFIT, Unfit, approximation
from filippov.analysis.comparisons.solution_result import SolutionComparison
from filippov.analysis.comparisons.solutions import compare_solutions
from filippov.base.errors import UsageError
from filippov.base.names import check_known
from filippov.models.approximated import PLANTS

BANDS, BRISTLES = ("switch", "karnopp", "band", "tanh"), ("lugre", "dahl")
MODELS = (*BANDS, *BRISTLES, STEPS)
# The power of the width with which the error of the states goes to 0: what moves on a spring of stiffness
# 1/width when it stops has a period that goes with the root of the width.
THEORY = dict.fromkeys((*BANDS, STEPS), 1.0) | dict.fromkeys(BRISTLES, 0.5)
COLUMNS = (
    "plant", "model", "method", "width", "error_state", "error_final", "error_times", "drift", "calls_ratio",
    "order", "theory", "said",
)  # fmt: skip


def table_of_approximations(
    plants: Iterable[str] = tuple(PLANTS), models: Iterable[str] = MODELS,
    progress: Callable[[str], object] | None = None,
) -> list[dict[str, Any]]:  # fmt: skip
    """Rows by the names of COLUMNS: of each plant the exact solution, then the models.

    said   what is wrong in kind, or why a model does not apply; progress: called with the plant and model
    """
    plants, models = tuple(plants), tuple(models)
    check_known("plant", plants, PLANTS, UsageError)
    check_known("model", models, MODELS, UsageError)
    rows: list[dict[str, Any]] = []
    for name in plants:
        plant = PLANTS[name]
        system = plant.build()
        for model in models:
            if progress is not None:
                progress(f"{name} {model}")
            widths = plant.steps if model == STEPS else plant.widths if model in BANDS else plant.deflections
            made = approximation(system, model)
            if isinstance(made, Unfit):
                said = f"{UNFIT}: {made.why}"
                rows.append(dict.fromkeys(COLUMNS) | {"plant": name, "model": model, "said": said})
                continue
            found = compare_solutions(
                system, plant.x0, plant.t_span, against=made, widths=widths, max_steps=2_000_000
            )
            if not any(row["plant"] == name and row["model"] == "exact" for row in rows):
                rows.append(_row(name, found.rows[0], "-"))
            rows.append(_summary(name, model, found))
    return rows


def _row(plant: str, row: dict[str, Any], said: str) -> dict[str, Any]:
    kept = {column: row.get(column) for column in COLUMNS}
    return kept | {"plant": plant, "said": said}


def _summary(plant: str, model: str, found: SolutionComparison) -> dict[str, Any]:
    """The row of the narrowest width that was computed, with the order over all of them."""
    done = [row for row in found.of(model) if row["entries"] is not None]
    if not done:
        return _row(plant, found.of(model)[-1], found.of(model)[-1]["note"])
    trend, theory = found.trend(model, "error_state"), THEORY[model]
    said = list(found.faults)
    if trend.order is not None and trend.order < theory - 0.25:
        said.insert(0, f"order {trend.order:.2f}, below the {theory:g} of theory.")
    order = math.nan if trend.order is None else trend.order
    return _row(plant, done[-1], " ".join(said)) | {"order": order, "theory": theory}
