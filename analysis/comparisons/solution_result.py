"""The result of a comparison of solutions: rows, orders, needed widths, and qualitative faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from filippov.analysis.comparisons.approximation import UNFIT
from filippov.analysis.comparisons.comparison_result import Trend, aligned, tended
from filippov.analysis.comparisons.solution_run import ERRORS, LISTS, OWN
from filippov.base.csv_text import csv_text
from filippov.base.json_text import json_text
from filippov.base.names import Answering
from filippov.base.shown import Shown
from filippov.solving.solution import Solution

WORDS = {
    "error_state": "error of the states", "error_final": "error of the final state",
    "error_times": "error of event times", "drift": "drift in stick",
}  # fmt: skip
HEAD = (
    "model", "width", "method", "err state", "err final", "err times", "drift", "calls", "x", "ms", "note",
)  # fmt: skip


FOOT = "err state: the largest, over the extent of the state; x: field calls over those of the exact run."


@dataclass(frozen=True)
class Needed:
    """The widest width whose `quantity` is within `accuracy`, checked by a run; None where none was found.

    every   whether it is the widest of those computed: a wider one may do as well
    """

    model: str
    quantity: str
    accuracy: float
    width: float | None
    error: float | None
    calls_ratio: float | None
    every: bool = False

    @property
    def sentence(self) -> str:
        """The same in words."""
        what = f"{self.model}: {WORDS[self.quantity]} within {self.accuracy:g}"
        if self.width is None:
            return f"{what} was not reached."
        if self.every:
            return f"{what} is met by every width computed, up to {self.width:.3g}: {self.error:.3g} there."
        return (
            f"{what} needs width {self.width:.3g}: checked, {self.error:.3g}, at {self.calls_ratio:.3g} "
            "times the field calls of the exact run."
        )


@dataclass(frozen=True)
class SolutionComparison(Shown, Answering):
    """Rows of a comparison of solutions, the exact one first.

    rows       one dict per row: model, width (None: exact, or the note says why it does not apply), method,
               error_state, error_final (over the extent of each state), error_times, drift, stick (time),
               entries (into stick, by surface), ending, amplitude, period, field_calls, jacobians,
               factorisations, calls_ratio, seconds, note, measures; not in the table: stays (times in stick,
               by surface), event_times (entry, exit and crossing, each with its surface)
    faults     a sentence for each qualitative difference, at the narrowest width that has it
    needed     the widths for the requested accuracy
    exact      the exact Solution; solutions: those of the widest width by model
    labels     of the width and the errors, with the units of the exact system, for figures
    """

    rows: tuple[dict[str, Any], ...]
    faults: tuple[str, ...]
    needed: tuple[Needed, ...]
    exact: Solution
    solutions: Mapping[str, Solution]
    left: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def motions(self) -> Mapping[str, Solution]:
        """`solutions` under its earlier name."""
        return self.solutions

    def of(self, model: str) -> list[dict[str, Any]]:
        """The rows of a model, the widest first."""
        return [row for row in self.rows if row["model"] == model and row["width"] is not None]

    @property
    def models(self) -> tuple[str, ...]:
        """The names of the approximations in order."""
        return tuple(dict.fromkeys(row["model"] for row in self.rows if row["width"] is not None))

    @property
    def measures(self) -> tuple[str, ...]:
        """The names of the requested measures."""
        return tuple(name for name in self.rows[0] if name not in OWN)

    @property
    def head(self) -> tuple[str, ...]:
        """The titles of the table's columns."""
        return (*HEAD[:-1], *self.measures, HEAD[-1])

    @property
    def cells(self) -> list[tuple[str, ...]]:
        """The table's rows as text."""
        return [cells(row, self.measures) for row in self.rows]

    @cached_property
    def trends(self) -> tuple[Trend, ...]:
        """For every model and error: what it does as the width goes to 0."""
        return tuple(self._trend(model, quantity) for model in self.models for quantity in ERRORS)

    def trend(self, model: str, quantity: str) -> Trend:
        """One of the trends; KeyError if there is none."""
        for trend in self.trends:
            if (trend.model, trend.quantity) == (model, quantity):
                return trend
        raise KeyError((model, quantity))

    def _trend(self, model: str, quantity: str) -> Trend:
        what = f"{model}: {WORDS[quantity]}"
        # What two tolerances of the exact solution differ by bounds what can be told.
        floor = 10.0 * (0.0 if quantity == "drift" else self.rows[0][quantity] or 0.0) + 1e-13
        known = [(row["width"], row[quantity]) for row in self.of(model) if row[quantity] is not None]
        if not known:
            return Trend(model, {}, quantity, None, None, f"{what} cannot be compared at any width.")
        order, vanishes, text = tended(known, floor)
        return Trend(model, {}, quantity, order, vanishes, f"{what} {text}")

    def __str__(self) -> str:
        return self.to_text().rstrip()

    def to_text(self) -> str:
        """The table, then the orders, the faults and the widths needed."""
        lines = [*aligned([self.head, *self.cells]), "", FOOT, "", *(trend.sentence for trend in self.trends)]
        for title, sentences in self.paragraphs():
            lines += ["", title, *(f"  {sentence}" for sentence in sentences)]
        return "\n".join(lines) + "\n"

    def paragraphs(self) -> list[tuple[str, tuple[str, ...]]]:
        """Titles with their sentences, those that have any."""
        return [(title, found) for title, found in (
            ("Wrong in kind:", self.faults),
            ("Widths needed:", tuple(item.sentence for item in self.needed)),
            ("Left exact:", self.left),
            ("Does not apply:", tuple(f"{row['model']}: {_why(row)}" for row in self.rows if _why(row))),
        ) if found]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Rows, trends, faults and widths needed, as JSON takes them."""
        problem = self.exact.problem
        return {
            "parameters": dict(problem.parameters), "x0": problem.x0.tolist(), "t_span": list(problem.t_span),
            "rows": [dict(row) for row in self.rows],
            "trends": [trend.told() for trend in self.trends],
            "faults": list(self.faults), "left": list(self.left),
            "needed": [vars(item) | {"sentence": item.sentence} for item in self.needed],
        }  # fmt: skip

    def to_json(self) -> str:
        """The same as text."""
        return json_text(self.to_dict(), indent=2)

    def to_csv(self) -> str:
        """The rows as a table."""
        columns = tuple(dict.fromkeys(key for row in self.rows for key in row if key not in LISTS))
        return csv_text(columns, ([row.get(key) for key in columns] for row in self.rows))

    def to_html(self) -> str:
        """One page with the table, the sentences and the picture in it."""
        from filippov.analysis.comparisons.solution_page import page

        return page(self)

    def plot(self, *given: Any, **options: Any) -> Any:
        """The solutions, errors over width and over work (see `filippov.plot.solution_comparison`)."""
        from filippov.plot.solution_comparison import plot_solution_comparison

        return plot_solution_comparison(self, *given, **options)


MotionComparison = SolutionComparison  # its earlier name


def cells(row: Mapping[str, Any], measures: Sequence[str] = ()) -> tuple[str, ...]:
    """A row as text."""

    def number(value: Any, form: str = ".1e") -> str:
        return "-" if value is None else format(value, form)

    seconds = row["seconds"]
    return (
        row["model"], "-" if row["width"] is None else f"{row['width']:.0e}", row["method"] or "-",
        *(number(row[name]) for name in ERRORS), number(row["field_calls"], "d"),
        number(row["calls_ratio"], ".2f"), number(None if seconds is None else 1e3 * seconds, ".2f"),
        *(number(row.get(name), ".6g") for name in measures), UNFIT if _why(row) else row["note"],
    )  # fmt: skip


def _why(row: Mapping[str, Any]) -> str:
    """Why the approximation of a row does not apply; empty where it does."""
    said, _, why = row["note"].partition(": ")
    return why if said == UNFIT else ""
