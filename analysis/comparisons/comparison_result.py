"""The result of a comparison: rows, observed orders in the width, and sentences where a difference stays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from filippov.base.json_text import finite, json_text
from filippov.base.names import Answering
from filippov.base.shown import Shown

QUANTITIES = {
    "error_R": "error of R(d)",
    "error_times": "error of event times",
    "error_fixed_points": "error of fixed points",
    "drift": "drift in stick",
}
_OWN = (
    "model", "width", "error_times", "error_R", "error_fixed_points", "drift", "field_calls", "seconds",
    "calls_ratio", "time_ratio", "fixed_points", "note",
)  # fmt: skip
UNCOMPUTED = "not computed"
# Widths, from the smallest whose difference is above the floor, that an order is fitted to.
FITTED = 4
SLOWEST = 0.25
Pairs = list[tuple[float, float]]


@dataclass(frozen=True)
class Trend:
    """How one difference of one model behaves as the width goes to 0.

    order      slope of log difference over log width, over the FITTED smallest widths above the floor
    vanishes   whether the difference goes to 0; None where too little was computed to say
    sentence   the same in words
    """

    model: str
    options: Mapping[str, float]
    quantity: str
    order: float | None
    vanishes: bool | None
    sentence: str

    @property
    def label(self) -> str:
        """Model and options as text."""
        return label(self.model, self.options)

    def told(self) -> dict[str, Any]:
        """Its fields, with an entry for each option."""
        return {key: value for key, value in vars(self).items() if key != "options"} | {**self.options}


@dataclass(frozen=True)
class Comparison(Shown, Answering):
    """Rows of a comparison, the exact system first.

    rows         one dict per row, as JSON takes it: model, width (None: exact), options, error_times,
                 error_R, error_fixed_points, drift, field_calls, seconds, calls_ratio, time_ratio,
                 fixed_points, note;
                 None where there is no value
    coordinate   name of the section's coordinate; coordinates: the d compared
    points       the exact fixed points; parameters: values by name, of the exact system
    labels       of the axes of its figure, with the units of the exact system
    """

    rows: tuple[dict[str, Any], ...]
    coordinate: str
    coordinates: tuple[float, ...]
    points: tuple[Any, ...]
    rtol: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def trends(self) -> tuple[Trend, ...]:
        """For every model, its options and every quantity: what the difference does with the width."""
        return tuple(
            self._trend(rows, quantity)
            for rows in self.families()
            for quantity in QUANTITIES
            if quantity != "error_fixed_points" or self.points
        )

    def trend(self, model: str, quantity: str, **options: float) -> Trend:
        """One of the trends; KeyError if there is none."""
        quantity = "error_R" if quantity == "error_P" else quantity  # its earlier name
        for trend in self.trends:
            matches = all(trend.options.get(name) == value for name, value in options.items())
            if trend.model == model and trend.quantity == quantity and matches:
                return trend
        raise KeyError((model, quantity, options))

    def families(self) -> list[list[dict[str, Any]]]:
        """Rows of the same model and options together, the widest first; without the exact one."""
        families: dict[str, list[dict[str, Any]]] = {}
        for row in self.rows:
            if row["width"] is not None:
                families.setdefault(label(row["model"], options_of(row)), []).append(row)
        return list(families.values())

    @property
    def remaining(self) -> tuple[str, ...]:
        """A sentence for every difference that does not go to 0."""
        return tuple(trend.sentence for trend in self.trends if trend.vanishes is False)

    def _trend(self, rows: Sequence[dict[str, Any]], quantity: str) -> Trend:
        model, options = rows[0]["model"], options_of(rows[0])
        name, what = label(model, options), QUANTITIES[quantity]
        part = ""
        floor = 10.0 * (0.0 if quantity == "drift" else largest(self.rows[0][quantity]) or 0.0) + 1e-14

        def made(order: float | None, vanishes: bool | None, text: str) -> Trend:
            return Trend(model, options, quantity, order, vanishes, f"{name}: {what}{part} {text}")

        computed = [row for row in rows if not row["note"].startswith(UNCOMPUTED)]
        if not computed:
            return made(None, None, "not computed: too many steps at every width.")
        narrow = computed[-1]
        whole = quantity != "error_fixed_points" or "is lost" in narrow["note"]
        kept = () if whole else tuple(i for i, e in enumerate(narrow[quantity]) if e is not None)
        sizes = [
            (row["width"], largest([row[quantity][i] for i in kept] if kept else row[quantity]))
            for row in computed
        ]
        known = [(width, error) for width, error in sizes if error is not None]
        part = f" ({len(kept)} of {len(self.points)})" if 0 < len(kept) < len(self.points) else ""
        if not known or known[-1][0] != narrow["width"]:
            why = narrow["note"] or "no value"
            where = f"cannot be compared at the smallest width computed, {narrow['width']:g} ({why})"
            if len(computed) < len(rows) or "too many steps" in narrow["note"]:
                return made(None, None, f"{where}, and smaller ones take too many steps.")
            return made(None, False, f"{where}: the model does NOT converge to the exact system.")
        return made(*tended(known, floor))

    def __str__(self) -> str:
        return self.to_text().rstrip()

    def to_text(self) -> str:
        """The table, then the orders, then what does not go to 0."""
        head = ("model", "width", "err times", "err R", "err fixed", "drift", "calls", "x", "ms", "x", "note")
        lines = aligned([head, *(_cells(row) for row in self.rows)])
        where = ", ".join(f"{d:g}" for d in self.coordinates)
        foot = f"R(d) at {self.coordinate} = {where}; rtol {self.rtol:g}; x: over the exact system beside it."
        lines += ["", foot, ""]
        lines += [trend.sentence for trend in self.trends]
        return "\n".join(lines) + "\n"

    def to_dict(self) -> dict[str, Any]:
        """Rows and trends, as JSON takes them."""
        return {
            "parameters": dict(self.parameters), "coordinate": str(self.coordinate),
            "coordinates": list(self.coordinates), "fixed_points": [q.to_dict() for q in self.points],
            "rtol": self.rtol, "rows": [dict(row) for row in self.rows],
            "trends": [trend.told() for trend in self.trends],
        }  # fmt: skip

    def to_json(self) -> str:
        """The same as text."""
        return json_text(finite(self.to_dict()), indent=2)

    def plot(self, *given: Any, **options: Any) -> Any:
        """Differences and work over the width (see `filippov.plot.comparison`)."""
        from filippov.plot.comparison import plot_comparison

        return plot_comparison(self, *given, **options)


def tended(known: Pairs, floor: float) -> tuple[float | None, bool | None, str]:
    """The order of errors over widths, of the last FITTED above the floor; whether they vanish; in words."""
    above = [(width, error) for width, error in known if error > floor][-FITTED:]
    width, error = known[-1]
    if len(above) < 2 and error <= floor:
        return None, True, f"is not more than rounding at width {width:g}."
    if len(above) < 2:
        return None, None, f"is {error:.3g} at width {width:g}; one width gives no order."
    widths, errors = np.log(above).T
    order = float(np.polyfit(widths, errors, 1)[0])
    if order > SLOWEST:
        end = "not more than rounding" if error <= floor else f"{error:.2g}"
        return order, True, f"goes to 0 like width^{order:.2f}; {end} at width {width:g}."
    ends = f"{above[0][1]:.3g} at width {above[0][0]:g}, {error:.3g} at width {width:g}"
    return order, False, f"does NOT go to 0 at these widths: {ends}."


def aligned(table: Sequence[Sequence[str]]) -> list[str]:
    """A head and rows as lines in columns: the first and the last to the left, with a rule below the head."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for first, *middle, last in table:
        cells = map(str.rjust, middle, widths[1:-1])
        lines.append("  ".join([first.ljust(widths[0]), *cells, last]).rstrip())
    return [lines[0], "-" * max(map(len, lines)), *lines[1:]]


def options_of(row: Mapping[str, Any]) -> dict[str, float]:
    """The options of a row: what is not a column of every table."""
    return {name: value for name, value in row.items() if name not in _OWN}


def label(model: str, options: Mapping[str, float]) -> str:
    """Model and options as text."""
    inner = ", ".join(f"{name} {value:g}" for name, value in options.items())
    return f"{model} ({inner})" if inner else model


def largest(value: Any) -> float | None:
    """The difference as one number: the largest of several, None where one is missing."""
    values = value if isinstance(value, (list, tuple)) else [value]
    return None if not values or any(v is None for v in values) else float(max(values))


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    def number(value: Any, form: str = ".1e") -> str:
        found = largest(value)
        return "-" if found is None else format(found, form)

    seconds = row["seconds"]
    return (
        label(row["model"], options_of(row)), "-" if row["width"] is None else f"{row['width']:.0e}",
        *(number(row[name]) for name in ("error_times", "error_R", "error_fixed_points", "drift")),
        number(row["field_calls"], ".0f"), number(row["calls_ratio"], ".2f"),
        number(None if seconds is None else 1e3 * seconds, ".2f"), number(row["time_ratio"], ".2f"),
        row["note"],
    )  # fmt: skip
