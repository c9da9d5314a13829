"""Figure of a comparison of band models with the exact system, over the width of the band.

What is drawn is asked only for its attributes: `rows` (dicts with model, width, error_R, drift, field_calls
and the model's options; the first one the exact system) and `trends` (model, options, quantity, order,
label).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.place import label_beside
from filippov.plot.results import result_of
from filippov.plot.style import GREY, INK, SERIES, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKS = "osD^v<>P"
_PANELS = (("error_R", "error of R(d)"), ("drift", "drift during stick"), ("field_calls", "field calls"))


@keywords(first=result_of("compare", "trends", "rows", "coordinate"))
def plot_comparison(
    comparison: Any, *, labels: Mapping[str, str] | None = None, title: str = "", figure: Figure | None = None
) -> Figure:
    """Error of P and drift in stick with their orders, and field calls, against the width: log-log.

    One colour per model, one mark per combination of its options; the exact system's own uncertainty and work
    are dashed lines.

    labels  {"width": ..., "error_R": ..., "drift": ..., "field_calls": ...} of the axes; default: with the
            units of the exact system
    """
    text = {"width": "half-width of the band", **dict(_PANELS), **getattr(comparison, "labels", {})}
    check_known("label", labels or {}, text, UsageError)
    text |= labels or {}
    trends = list(comparison.trends)
    families = list(dict.fromkeys((trend.label, trend.model) for trend in trends))
    models = list(dict.fromkeys(model for _, model in families))
    exact = comparison.rows[0]
    with style():
        drawn = figure if figure is not None else new_figure(10.5, 4.2)
        axes = drawn.subplots(1, len(_PANELS))
        beside: list[tuple[Any, list[Any]]] = []
        for ax, (quantity, _) in zip(axes, _PANELS, strict=True):
            orders: list[tuple[float, float, str, str]] = []
            for label, model in families:
                own = [q for q in trends if q.label == label]
                exponent = next((q.order for q in own if q.quantity == quantity), None)
                look = _look(label, model, families, models)
                at = _line(ax, comparison.rows, own[0], quantity, look, models.index(model))
                told = ("" if exponent is None else f"{round(exponent, 2) + 0.0:.2f}", look["color"])
                # What lines of one model have in common is said once.
                if at is not None and exponent is not None and all(told != order[2:] for order in orders):
                    orders.append((*at, *told))
            _reference(ax, exact, quantity)
            beside.append((ax, orders))
            ax.set(xscale="log", yscale="log", xlabel=text["width"], ylabel=text[quantity])
            ax.invert_xaxis()
        _legend(drawn, axes, len(families))
        for ax, orders in beside:
            for order in orders:
                label_beside(ax, *order)
        if title:
            drawn.suptitle(title, x=0.01, ha="left", fontsize=10.5)
    return drawn


def _look(label: str, model: str, families: list[tuple[str, str]], models: list[str]) -> dict[str, Any]:
    own = [name for name, other in families if other == model]
    return {
        "color": SERIES[models.index(model) % len(SERIES)], "marker": _MARKS[own.index(label) % len(_MARKS)],
        "label": label, "markersize": 4.5 + 2.5 * own.index(label), "markerfacecolor": "none",
        "linewidth": 1.1,
    }  # fmt: skip


def _line(
    ax: Any, rows: Any, trend: Any, quantity: str, look: dict[str, Any], place: int
) -> tuple[float, float] | None:
    """One family; what is 0 has no place on a log axis. The point beside which its order stands, if any."""
    mine = [
        row
        for row in rows
        if row["model"] == trend.model
        and row["width"] is not None
        and all(row.get(name) == value for name, value in trend.options.items())
    ]
    points = [(row["width"], row[quantity]) for row in mine if row[quantity]]
    if not points:
        ax.plot([], [], **look)
        return None
    ax.plot(*np.array(points, dtype=float).T, **look)
    if look["marker"] != _MARKS[0] and quantity != "drift":
        return None
    width, value = points[max(0, len(points) // 2 - place % 2)]  # models in turn, not above each other
    return width, value


def _reference(ax: Any, exact: Any, quantity: str) -> None:
    value = exact[quantity]
    if value:
        ax.axhline(value, color=GREY, linestyle="--", linewidth=0.9, zorder=1)
        text = "exact" if quantity == "field_calls" else "exact: two tolerances differ"
        at, side = (0.98, "right") if quantity == "field_calls" else (0.02, "left")
        ax.annotate(
            text, (at, value), xycoords=("axes fraction", "data"), xytext=(0, 3), color=INK, fontsize=7.5,
            textcoords="offset points", ha=side,
        )  # fmt: skip
    elif quantity == "drift":
        ax.text(0.02, 0.02, "exact: 0", transform=ax.transAxes, color=INK, fontsize=7.5)


def _legend(figure: Any, axes: Any, count: int) -> None:
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=min(count, 4),
                  title="number beside a line: the order of the error in the width")  # fmt: skip
