"""The period that a solution settles to, over two parameters: for systems without a coordinate to start from.

At every pair of values the solution from one state is followed from event to event of a section, or once per
period of a forcing or a clock, as in `filippov.analysis.diagrams.brute_force`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from filippov import System, UsageError
from filippov.analysis.diagrams.brute_force import brute_force, first_section
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope
from filippov.base.arrays import Array, Whole
from filippov.base.given import Amount, Axis, Natural, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.shown import Told
from filippov.plot.style import axis_labels

UNKNOWN = -1


@dataclass(frozen=True)
class PeriodMap(Told):
    """Cells over two parameters; arrays have shape (len(y), len(x)).

    names       of the parameters; x, y: their values
    period      events of the section after which the solution is where it was, 0 where there is no such
                number up to half of `keep`, where it still settles to a smaller one (a longer transient tells
                it) or the solution does not return so often; -1 where not computed
    d           the last coordinate on the section, NaN where there is none
    notes       why the solution did not return so often, "" where it did; rows of the cells
    section     where the coordinate is read; parameters: the values of all others; labels: of the axes
    complete    False where the computation was interrupted
    """

    names: tuple[str, str]
    x: Array
    y: Array
    period: Whole
    d: Array
    notes: tuple[tuple[str, ...], ...]
    section: Section | Stroboscope
    complete: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        lines = []
        for period, count in zip(*np.unique(self.period, return_counts=True), strict=True):
            what = {0: "no period found", UNKNOWN: "not computed"}.get(int(period), f"period {period}")
            lines.append(f"{count} of {self.period.size} cells: {what}")
        notes = sorted({note for row in self.notes for note in row if note})
        return "\n".join([*lines, *notes[:3]])

    def plot(self, *given: Any, **options: Any) -> Any:
        """Periods by colour (see `filippov.plot.regions.plot_periods`)."""
        from filippov.plot.regions import plot_periods

        return plot_periods(self, *given, **options)


@keywords()
def period_map(
    system: System,
    section: Section | Stroboscope | None,
    x: Axis,
    y: Axis,
    x0: Any,
    *,
    parameters: Mapping[str, float] | None = None,
    transient: Natural = 200,
    keep: Amount = 64,
    rtol: Positive = 1e-8,
    progress: Callable[[int, int], None] | None = None,
) -> PeriodMap:
    """The period of the orbit that the solution from x0 goes to, over two parameters.

    section          a `Stroboscope`, or a section; None: found along the solution, at one of the corners
    x, y             (name, values) of the parameters
    x0               the initial state, in order or by name, the same in every cell
    transient, keep  events that are dropped, and those in which a period is looked for
    progress         called with (rows done, rows)

    Ctrl-C returns the rows that are done. Raises UsageError.
    """
    for name in (x[0], y[0]):
        if name not in system.parameters:
            raise UsageError(unknown("parameter", name, system.parameters))
    if x[0] == y[0]:
        raise UsageError(f"axes {x[0]!r} and {y[0]!r}: expected two parameters.")
    if isinstance(section, Section):
        section = replace(section, parametrisation=None)
    given = dict(parameters or {})
    others = system.parameters.others(given, (x[0], y[0]))
    across, up = np.asarray(x[1], dtype=float), np.asarray(y[1], dtype=float)
    middle = {**given, y[0]: float(up[len(up) // 2])}
    chosen = section if section is not None else first_section(system, x0, x[0], across.tolist(), middle)
    period = np.full((up.size, across.size), UNKNOWN)
    d = np.full(period.shape, np.nan)
    notes = [("",) * across.size] * up.size
    complete = True
    for i, value in enumerate(up.tolist()):
        row = brute_force(
            system, chosen, x[0], across.tolist(), x0, transient=transient, keep=keep, rtol=rtol,
            parameters={**given, y[0]: value},
        )  # fmt: skip
        if not row.complete:
            complete = False
            break
        period[i], notes[i] = row.period, row.notes
        d[i] = row.d[:, -1]
        if progress is not None:
            progress(i + 1, up.size)
    named = axis_labels(system, x[0], y[0])
    return PeriodMap((x[0], y[0]), across, up, period, d, tuple(notes), chosen, complete, others, named)
