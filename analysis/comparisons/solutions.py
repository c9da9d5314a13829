"""A solution of any system, exact and under approximations: what each of these costs and gets wrong."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from filippov import Solution, System, UsageError
from filippov.analysis.comparisons.approximation import ALPHA, UNFIT, Unfit, approximations
from filippov.analysis.comparisons.comparison_labels import solution_labels
from filippov.analysis.comparisons.solution_faults import faults
from filippov.analysis.comparisons.solution_result import Needed, SolutionComparison
from filippov.analysis.comparisons.solution_run import (
    ERRORS,
    ExactSolution,
    ModelSolutions,
    blank_row,
    chosen_widths,
    needed_width,
)
from filippov.base.given import Count, NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown

AGAINST = ("switch", "karnopp", "band", "tanh")
DECADES = (2, 3, 4, 5, 6)


@keywords()
def compare_solutions(
    system: System,
    x0: Any,
    t_span: tuple[float, float],
    *,
    against: Any = None,
    widths: Sequence[float] | None = None,
    measures: Any = (),
    parameters: Mapping[str, float] | None = None,
    accuracy: Positive | None = None,
    quantity: str = "error_state",
    alpha: Positive = ALPHA,
    tau: Positive | None = None,
    theta: Positive | None = None,
    rtol: Positive = 1e-10,
    atol: NonNegative = 1e-12,
    max_steps: Count = 200_000,
    max_events: Count = 20_000,
    repeats: Count = 1,
    progress: Callable[..., object] | None = None,
) -> SolutionComparison:
    """Compare a solution of the inclusion with the same under approximations, over the widths.

    system      the inclusion; x0, t_span: as for `solve`
    against     names ("switch", "karnopp", "band", "tanh", "arctan", "sqrt", "hysteresis"; "lugre", "dahl",
                "elasto-plastic", "maxwell-slip", "memory", "bengisu-akay", "seven-parameter", see
                `filippov.model.bristles`; "moreau": time stepping, whose width is its step), a mapping {name:
                width -> System}, or Approximations; default: the first four
    widths      half-widths in the units of h; default: five decades below the largest |h| of the solution
    measures    further numbers of each run, as in sweeps: "amplitude(x)", a function of the Solution
    parameters  values by name, for the exact system and every approximation that has them
    accuracy    of `quantity`: the width that it needs is solved for and checked by a run
    quantity    "error_state", "error_final", "error_times" or "drift"
    alpha       rate of the Switch and Karnopp models in stick [1/time]
    tau         time of the bristle models that have one; default: from the friction level at rest
    theta       of "moreau", 0.5 to 1, see `solve`; sliding of order two needs 1
    max_steps, max_events   budgets of one run; an approximation that uses one up is not tried at smaller
                widths
    repeats     runs whose median is the reported time
    progress    called with (done, total, what)

    Stiff approximations are integrated by Radau where stability would limit an explicit method; the rows say
    which. Where the one does not reach the end, the other is tried. An approximation that does not apply to
    the system has a row that says why; only where none applies is that an error. Raises UsageError,
    ModelError.
    """
    if quantity not in ERRORS:
        raise UsageError(unknown("quantity", quantity, ERRORS))
    if accuracy is not None and not 0 < accuracy < float("inf"):
        raise UsageError(f"accuracy is {accuracy!r}, expected a number > 0.")
    exact = ExactSolution(
        system.exact, x0, t_span, parameters, measures, rtol, atol, max_steps, max_events, repeats
    )
    models = approximations(system.exact, AGAINST if against is None else against, alpha, tau)
    sizes = chosen_widths(exact, widths, DECADES)
    rows, wrong, needs, left = [exact.row], [], [], []
    shown: dict[str, Solution] = {}
    total = 1 + len(models) * len(sizes)
    for model in models:
        if isinstance(model, Unfit):
            rows.append(blank_row(model.name, None) | {**exact.blank, "note": f"{UNFIT}: {model.why}"})
            continue
        left += [f"{model.name} leaves {surface!r} exact: {why}" for surface, why in model.without.items()]
        own: list[dict[str, Any]] = []
        sizes = chosen_widths(exact, widths, DECADES, model.timed)
        approximate, spent = ModelSolutions(exact, model, sizes[-1], theta), ""
        for width in sizes:
            if progress is not None:
                progress(len(rows), total, f"{model.name} {width:g}")
            row = approximate.row(width) if not spent else own[-1] | {"width": width, "note": spent}
            own.append(row)
            rows.append(row)
            if "allowed" in row["note"] and not spent:
                spent = f"not computed: it was not possible at width {width:g}"
        done = [row for row in own if row["entries"] is not None]
        runs = [approximate.seen[row["width"]] for row in done]
        wrong += faults(runs, exact.seen, system.states, exact.extent)
        if done:
            shown[model.name] = approximate.solutions[done[0]["width"]]
        else:
            wrong.append(f"{model.name} at width {own[0]['width']:.3g}: {own[0]['note']}.")
        if accuracy is not None:
            width_found, row_found = needed_width(done, quantity, accuracy, approximate.row)
            error = None if row_found is None else row_found[quantity]
            ratio = None if row_found is None else row_found["calls_ratio"]
            widest = bool(done) and width_found == done[0]["width"]
            needs.append(Needed(model.name, quantity, accuracy, width_found, error, ratio, widest))
    if progress is not None:
        progress(total, total)
    timed = [model.timed for model in models if not isinstance(model, Unfit)]
    labels = solution_labels(system.exact, list(exact.reader.readers), timed)
    return SolutionComparison(tuple(rows), tuple(wrong), tuple(needs), exact.fine, shown, tuple(left), labels)


compare_motions = compare_solutions  # its earlier name
