"""Figure of an identified friction law: the fit, its residuals, the friction curve with its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.label import unit_of
from filippov.base.names import check_known
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREY, INK, PALE, RED, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWS, SEED = 200, 20

Force = Callable[[Array, dict[str, float]], Array]


@keywords(first=result_of("identify", "values", "errors", "covariance"))
def plot_identification(
    result: Any,
    force: Force,
    *,
    points: tuple[Array, Array] | None = None,
    speed: float | None = None,
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Position with its fit and residuals (or the measured points), and F(v) with a 95 % band.

    result   what `identify` or `identify_curve` returned
    force    F(v, values)
    points   (v, F) that were measured, for a curve
    speed    largest |v| of the curve; default: from the data
    labels   of "t", "x", "v" and "force", with units; default: those of the system that was fitted
    """
    text = {"t": "time", "x": "position", "v": "velocity", "force": "friction force"}
    text |= getattr(result, "labels", {})
    check_known("label", labels or {}, text, UsageError)
    text |= labels or {}
    with style():
        drawn = figure if figure is not None else new_figure(9.2, 4.2)
        if points is None:
            left, right = drawn.subfigures(1, 2, width_ratios=(1.25, 1.0), squeeze=False)[0]
            _trajectory(left, result, text)
        else:
            right = drawn
        top = right.subplots()
        reach = speed or (float(np.max(np.abs(points[0]))) if points else _speed(result))
        _curve(top, result, force, reach)
        top.set(xlabel=text["v"], ylabel=text["force"])
        if points is not None:
            top.plot(*points, ".", color=GREY, markersize=3, zorder=1, label="measured")
        top.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        if title:
            drawn.suptitle(title, color=INK, fontsize=10)
    return drawn


def _speed(result: Any) -> float:
    return float(np.quantile(np.abs(np.gradient(result.fitted, result.t)), 0.995))


def _trajectory(figure: Any, result: Any, text: Mapping[str, str]) -> None:
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    top.plot(result.t, result.measured, ".", color=GREY, markersize=2.5, label="measured")
    top.plot(result.t, result.fitted, color=BLUE, label="exact model, fitted")
    top.set_ylabel(text["x"])
    top.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    bottom.axhline(0, color=PALE, linewidth=0.8)
    bottom.plot(result.t, result.residual, ".", color=RED, markersize=2)
    unit = unit_of(text["x"])
    bottom.set(xlabel=text["t"], ylabel=f"residual [{unit}]" if unit else "residual")
    figure.align_ylabels([top, bottom])


def _curve(ax: Any, result: Any, force: Force, reach: float) -> None:
    v = reach * np.concatenate((-np.geomspace(1, 1e-4, 200), np.geomspace(1e-4, 1, 200)))
    names = list(result.errors)
    center = np.array([result.values[name] for name in names])
    finite = np.all(np.isfinite(result.covariance))
    if finite:
        random = np.random.default_rng(SEED)
        draws = random.multivariate_normal(center, result.covariance, DRAWS, method="eigh")
        curves = [force(v, dict(zip(names, np.maximum(d, 1e-12), strict=True))) for d in draws]
        low, high = np.quantile(curves, (0.025, 0.975), axis=0)
    best = force(v, dict(zip(names, center, strict=True)))
    for side in (v < 0, v > 0):
        if finite:
            ax.fill_between(v[side], low[side], high[side], color=BLUE, alpha=0.25, linewidth=0)
        ax.plot(v[side], best[side], color=BLUE, label="fitted law, 95 % band" if v[side][0] > 0 else None)
    middle = len(v) // 2
    ax.plot([0, 0], [best[middle - 1], best[middle]], color=BLUE)
