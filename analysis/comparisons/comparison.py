"""The exact system against models in which a layer of finite width replaces its sliding mode.

Compared, at every width and for every combination of a model's options:

    error_times         largest |t - t_exact| over the first entries into and exits from stick of one response
    error_R             largest |R(d) - R_exact(d)| over the coordinates d
    error_fixed_points  |d* - d*_exact| for every isolated fixed point of the order-th return
    drift               largest way slipped during the stays in stick of the response, |integral of h dt| from
                        the entry on, or |position(t) - position(entry)|
    field_calls, seconds   of the same solutions over the same span, ratios to the exact system beside them

R(d) is the section's coordinate where the solution that starts on the section at d enters stick (see
`band_model` for what that is); the order-th return is its order-th entry, in one solution, so that it
includes what the model does during stick. The exact system is computed at two tolerances; its row holds their
difference, which limits what can be resolved.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, overload

import numpy as np

from filippov import System, UsageError
from filippov.analysis.comparisons.band_model import BandModel, comparator_models
from filippov.analysis.comparisons.comparison_labels import section_labels
from filippov.analysis.comparisons.comparison_result import Comparison
from filippov.analysis.comparisons.comparison_run import (
    BandRun,
    ExactRun,
    OverBudgetError,
    Position,
    blank_row,
)
from filippov.analysis.comparisons.solution_result import SolutionComparison
from filippov.analysis.comparisons.solutions import compare_solutions
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array
from filippov.base.given import Count, Interval, NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown

WIDTHS = tuple(10.0**-k for k in range(2, 9))


@overload
def compare(exact: System, section: Section, bands: Any = ..., **options: Any) -> Comparison: ...
@overload
def compare(exact: System, x0: Any, t_span: tuple[float, float], **options: Any) -> SolutionComparison: ...
@overload
def compare(exact: System, *, t_span: tuple[float, float], **options: Any) -> SolutionComparison: ...
def compare(exact: System, *given: Any, **options: Any) -> Comparison | SolutionComparison:
    """Compare the inclusion with its approximations: over returns to a section or along a solution.

    compare(system, section, bands, ...)     see `compare_sections`
    compare(system, x0, t_span, ...)         see `filippov.analysis.comparisons.solutions.compare_solutions`

    Raises UsageError, ModelError.
    """
    if "section" in options or (given and isinstance(given[0], Section)):
        return compare_sections(exact, *given, **options)
    if not given and "t_span" not in options:
        raise UsageError("compare needs a Section, or x0 and t_span: compare(system, x0, t_span).")
    return compare_solutions(exact, *given, **options)


@keywords()
def compare_sections(
    exact: System,
    section: Section,
    bands: Mapping[str, Callable[..., System]] | Sequence[BandModel] = (),
    *,
    widths: Sequence[float] = WIDTHS,
    comparators: Sequence[str] = ("band", "smooth"),
    coordinates: Sequence[float] | None = None,
    interval: Interval | None = None,
    order: Count = 2,
    x0: Any = None,
    events: int = 6,
    position: Position | None = None,
    parameters: Mapping[str, float] | None = None,
    rtol: Positive = 1e-11,
    atol: NonNegative = 1e-13,
    max_steps: Count = 100_000,
    repeats: Count = 5,
    progress: Callable[..., object] | None = None,
) -> Comparison:
    """Compare band models with the exact system, over the widths.

    exact        the inclusion; section: on a sliding entry of it
    bands        BandModels, or {name: width -> System} (stick is then read by layer)
    widths       half-widths of the bands, in the units of h
    comparators  regularisations of `exact` itself to try too: "band", "smooth"
    coordinates  d at which R(d) is compared; default five over the interval, else 0.1 ... 0.5
    interval     where fixed points of the order-th return are sought; None: not compared
    x0           start of the response, default that of the middle coordinate; events: how many to compare
    position     quantity (t, x, p) that stick keeps, p of the exact system; default: the way slipped
    parameters   values by name, for the exact system and every model that has them
    max_steps    budget of one solution; a model that uses it up is not tried at smaller widths
    repeats      runs whose median is the time, exact and model in turn
    progress     called with (done, total, what)

    Raises UsageError, ModelError.
    """
    models = [*_models(bands), *_comparators(exact, section, comparators)]
    sizes = sorted({_width(value) for value in widths}, reverse=True)
    run = ExactRun(exact, section, parameters, rtol, atol, max_steps, repeats)
    run.measure(_coordinates(coordinates, interval), interval, order, x0, events, position)
    total = 1 + len(sizes) * sum(len(list(model.variants())) for model in models)
    rows = [run.row()]
    for model in models:
        for options in model.variants():
            spent = None
            for width in sizes:
                if progress is not None:
                    progress(len(rows), total, f"{model.name} {width:g}")
                row = blank_row(model.name, width, options)
                if spent is None:
                    try:
                        row |= BandRun(run, model, width, options).row()
                    except OverBudgetError:
                        spent = width
                        row["note"] = f"not computed: a solution takes more than {max_steps} steps"
                else:
                    row["note"] = f"not computed: {max_steps} steps were not enough at width {spent:g}"
                rows.append(row)
    if progress is not None:
        progress(total, total)
    return Comparison(
        tuple(rows), section.coordinate, tuple(run.d.tolist()), run.points, rtol, run.parameters,
        section_labels(exact, section, position is None),
    )


def _width(value: float) -> float:
    width = float(value)
    if not 0 < width < np.inf:
        raise UsageError(f"widths holds {value!r}, expected numbers > 0.")
    return width


def _models(bands: Any) -> list[BandModel]:
    if isinstance(bands, Mapping):
        return [BandModel(str(name), build) for name, build in bands.items()]
    for band in bands:
        if not isinstance(band, BandModel):
            raise UsageError(f"bands holds {band!r}, expected BandModel(name, build, ...) or a dict.")
    return list(bands)


def _comparators(exact: System, section: Section, names: Sequence[str]) -> list[BandModel]:
    known = comparator_models(exact, section.surface)
    for name in names:
        if name not in known:
            raise UsageError(unknown("comparator", name, known))
    return [known[name] for name in names]


def _coordinates(given: Sequence[float] | None, interval: tuple[float, float] | None) -> Array:
    if given is None:
        lo, hi = (0.0, 0.5) if interval is None else interval
        return np.linspace(lo, hi, 6)[1:]
    return np.asarray(given, dtype=float)
