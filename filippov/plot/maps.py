"""Figures of event maps and bifurcation diagrams.

Stable fixed points are filled and unstable ones open; equilibrium sets are squares and cycles circles. Only
the attributes of what is drawn are used, so any object that has them can be drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import Amount, Count
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.results import result_of
from filippov.plot.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    RED,
    coordinate_labels,
    new_figure,
    style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Part of the largest fixed point below which a cycle is magnified.
SMALL = 0.025
# A step of a map is bisected so often, as long as there are no more of them.
BISECTIONS, MOST_JUMPS = 8, 40
_BOUNDS = (RED, PURPLE, ORANGE, GREEN)


@keywords(first=result_of("EventMap", "__call__"))
def plot_event_map(
    event_map: Any,
    lo: float,
    hi: float,
    *,
    points: Amount = 400,
    samples: tuple[Any, Any] | None = None,
    fixed: Iterable[Any] = (),
    orbit: Any = None,
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """R(d) over [lo, hi] with the diagonal, fixed points, and the pairs (d_k, d_k+1) of an orbit.

    event_map  function of an array of d, NaN where it does not return
    samples    (d, R(d)) where they are known already
    fixed      objects with d, kind and stable
    orbit      successive d of a solution
    labels     {"d": "x at the stick [m]", "image": "next x", "map": "R(d)", its name in the legend}; default:
               those of the system

    The line is broken where the map has no value, and where it jumps. Raises UsageError.
    """
    text = _labels(labels, _named(event_map))
    d, image = _sampled(event_map, lo, hi, points, samples)
    with style():
        drawn = figure if figure is not None else new_figure(4.8, 4.4)
        ax = drawn.subplots()
        _curve(ax, lo, hi, d, image, text["map"])
        if orbit is not None:
            steps = np.asarray(orbit, dtype=float)
            ax.plot(steps[:-1], steps[1:], "o", color=ORANGE, markersize=3.6, zorder=3, label="orbit")
        _fixed(ax, fixed)
        ax.set(xlim=(lo, hi), xlabel=text["d"], ylabel=text["image"])
        _finish(ax, title)
    return drawn


@keywords()
def plot_returns(
    d: Any, image: Any, *, fixed: Iterable[Any] = (), labels: Mapping[str, str] | None = None,
    title: str = "", figure: Figure | None = None,
) -> Figure:  # fmt: skip
    """The pairs (d_k, d_k+1) of one solution with the diagonal and fixed points; later pairs are darker.

    d, image  coordinates at events of a section and at the events that are set against them
    fixed, labels  as in `plot_event_map`
    """
    text = _labels(labels, {"d": "d", "image": "R(d)"})
    x, y = np.asarray(d, dtype=float), np.asarray(image, dtype=float)
    if x.shape != y.shape or x.size == 0:
        raise UsageError(f"d and image have shapes {x.shape} and {y.shape}, expected (k,), k > 0, for both.")
    both = np.concatenate([x, y])
    margin = 0.08 * (float(np.ptp(both)) or abs(float(both[0])) or 1.0)
    ends = [float(both.min()) - margin, float(both.max()) + margin]
    with style():
        drawn = figure if figure is not None else new_figure(4.8, 4.4)
        ax = drawn.subplots()
        ax.plot(ends, ends, color=GREY, linewidth=0.8, linestyle=":", zorder=1, label="R(d) = d")
        half = x.size // 2
        ax.plot(x[:half], y[:half], ".", color=PALE, markersize=5, zorder=2, label="first half")
        ax.plot(x[half:], y[half:], ".", color=BLUE, markersize=5, zorder=3, label="second half")
        _fixed(ax, fixed)
        ax.set(xlim=ends, ylim=ends, xlabel=text["d"], ylabel=text["image"])
        _finish(ax, title)
    return drawn


@keywords(first=result_of("EventMap", "__call__", "iterate"))
def plot_iterates(
    event_map: Any,
    start: float,
    n: Count = 30,
    *,
    lo: float | None = None,
    hi: float | None = None,
    points: Amount = 400,
    fixed: Iterable[Any] = (),
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Cobweb of n iterates from `start`; [lo, hi] by default what the iterates cover, with a margin.

    event_map  as in `plot_event_map`, with iterate(d, n)
    """
    text = _labels(labels, _named(event_map))
    orbit = np.asarray(event_map.iterate(start, n), dtype=float)
    known = orbit[np.isfinite(orbit)]
    margin = 0.08 * (float(np.ptp(known)) or abs(start) or 1.0)
    low = float(known.min()) - margin if lo is None else lo
    high = float(known.max()) + margin if hi is None else hi
    d, image = _sampled(event_map, low, high, points, None)
    with style():
        drawn = figure if figure is not None else new_figure(4.8, 4.4)
        ax = drawn.subplots()
        _curve(ax, low, high, d, image, text["map"])
        x = np.repeat(orbit, 2)[:-1]
        y = np.concatenate([[orbit[0]], np.repeat(orbit[1:], 2)])
        ax.plot(x, y, color=ORANGE, linewidth=0.9, zorder=3, label=f"{n} iterates")
        ax.plot(orbit[0], orbit[0], "s", color=INK, markersize=4.5, zorder=4, label="start")
        _fixed(ax, fixed)
        ax.set(xlim=(low, high), xlabel=text["d"], ylabel=text["image"])
        _finish(ax, title)
    return drawn


@keywords(first=result_of("bifurcation", "parameter", "values", "points", "folds"))
def plot_diagram(
    diagram: Any,
    *,
    bounds: Mapping[str, float] | None = None,
    labels: Mapping[str, str] | None = None,
    title: str = "",
    inset: bool = False,
    figure: Figure | None = None,
) -> Figure:
    """Fixed points over a parameter: stable filled, unstable open; folds and changes of stability marked.

    diagram  object with parameter, values, points (for each value its fixed points), folds [(value, d)] and
             stability_changes [value]; branches are drawn as lines and period doublings among its `special`
             as crosses, where it has them
    bounds   values of the parameter to draw as vertical lines, by what they are: {"Routh-Hurwitz": 29}
    labels   {"parameter": "P", "d": "x at the stick [m]"}; default: those of the system
    inset    magnify, in the upper right, cycles that the scale of the others puts onto d = 0
    """
    told = dict(getattr(diagram, "labels", {}))
    text = _labels(labels, {"parameter": str(diagram.parameter), "d": "fixed points d", **told})
    with style():
        drawn = figure if figure is not None else new_figure(6.4, 4.0)
        ax = drawn.subplots()
        _diagram(ax, diagram)
        for value, d in diagram.folds:
            ax.annotate(
                f"{value:.5g}", (value, d), xytext=(7, 0), textcoords="offset points", color=RED, fontsize=8,
                va="center",
            )  # fmt: skip
        for k, (name, value) in enumerate((bounds or {}).items()):
            colour = _BOUNDS[k % len(_BOUNDS)]
            label = f"{name} {value:.6g}"
            ax.axvline(value, color=colour, linewidth=1.0, linestyle="-.", zorder=1, label=label)
        ax.set(xlabel=text["parameter"], ylabel=text["d"])
        ax.margins(0.04)
        if inset:
            _magnified(ax, diagram, (bounds or {}).values())
        _finish(ax, title)
    return drawn


# -- pieces ----------------------------------------------------------------------------------------------


def _diagram(ax: Any, diagram: Any) -> None:
    """Branches, fixed points and special points."""
    for branch in getattr(diagram, "branches", ()):
        _branch(ax, branch)
    flat = [(float(v), q) for v, found in zip(diagram.values, diagram.points, strict=True) for q in found]
    _scatter(ax, [(value, float(q.d), q) for value, q in flat])
    for k, (value, d) in enumerate(diagram.folds):
        ax.plot(value, d, "D", color=RED, markersize=6, zorder=6, label=None if k else "fold")
    doubled = [(q.value, q.d) for q in getattr(diagram, "special", ()) if q.kind == "period doubling"]
    if doubled:
        ax.plot(*np.array(doubled).T, "X", color=GREEN, markersize=7, zorder=6, label="period doubling")
    for k, value in enumerate(diagram.stability_changes):
        name = None if k else "set changes stability"
        ax.plot(value, 0.0, "*", color=PURPLE, markersize=11, zorder=6, label=name)


def _magnified(ax: Any, diagram: Any, lines: Iterable[float]) -> None:
    """An inset with the cycles below a fortieth of the largest, left of vertical lines; without any, none."""
    flat = [(v, q.d) for v, found in zip(diagram.values, diagram.points, strict=True) for q in found]
    highest = max((abs(d) for _, d in flat), default=0.0)
    small = [(v, d) for v, d in flat if 0 < abs(d) < SMALL * highest]
    if not small:
        return
    near = [v for v in diagram.stability_changes if min(abs(v - w) for w, _ in small) < 2]
    values = [*(v for v, _ in small), *near]
    first, last = ax.get_xlim()
    places = ((line - first) / (last - first) for line in lines)
    right = min([0.96, *(place - 0.03 for place in places if 0.5 < place < 1)])
    own = ax.inset_axes((right - 0.4, 0.4, 0.4, 0.52))
    low, high = min(0.0, *(d for _, d in small)), max(0.0, *(d for _, d in small))
    _diagram(own, diagram)
    pad = 0.15 * (max(values) - min(values) or 1.0)
    edge = 0.2 * (high - low)
    own.set(xlim=(min(values) - pad, max(values) + pad), ylim=(low - edge, high + edge))
    own.tick_params(labelsize=7.5)
    own.ticklabel_format(axis="y", scilimits=(-2, 2), useMathText=True)
    own.yaxis.get_offset_text().set_fontsize(7.5)
    own.set_title("magnified, same units", loc="right", fontsize=7.5, color=GREY,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    ax.indicate_inset_zoom(own, edgecolor=GREY)


def _sampled(
    event_map: Any, lo: float, hi: float, points: int, samples: tuple[Any, Any] | None
) -> tuple[Array, Array]:
    if not hi > lo:
        raise UsageError(f"the interval is [{lo}, {hi}], expected lo < hi.")
    if points < 2:
        raise UsageError(f"points is {points!r}, expected at least 2.")
    d = np.linspace(lo, hi, points) if samples is None else np.asarray(samples[0], dtype=float)
    image = np.asarray(event_map(d) if samples is None else samples[1], dtype=float)
    return bisected(event_map, d, image)


def bisected(event_map: Any, d: Array, image: Array) -> tuple[Array, Array]:
    """More points where the map seems to jump: across what is steep only, the steps become small."""
    for _ in range(BISECTIONS):
        at = _jumps(image)
        if not 0 < at.size <= MOST_JUMPS:
            break
        between = 0.5 * (d[at - 1] + d[at])
        found = np.asarray(event_map(between), dtype=float)
        d, image = np.insert(d, at, between), np.insert(image, at, found)
    return d, image


def with_gaps(d: Array, image: Array) -> tuple[Array, Array]:
    """The points of a map as a line with a gap where it jumps: a step far beyond its neighbours."""
    at = _jumps(image)
    return np.insert(d, at, np.nan), np.insert(image, at, np.nan)


def _jumps(image: Array) -> npt.NDArray[np.intp]:
    """The points before which the values step far beyond what they do elsewhere."""
    rise = np.abs(np.diff(image))
    seen = rise[np.isfinite(rise)]
    if image.size <= 4 or not seen.size:
        return np.zeros(0, dtype=np.intp)
    height = float(np.ptp(image[np.isfinite(image)]))
    return np.flatnonzero(rise > max(30 * float(np.median(seen)), 0.04 * height)) + 1


def _curve(ax: Any, lo: float, hi: float, d: Array, image: Array, name: str) -> None:
    """The map with the diagonal."""
    ax.plot([lo, hi], [lo, hi], color=GREY, linewidth=0.8, linestyle=":", zorder=1, label=f"{name} = d")
    ax.plot(*with_gaps(d, image), color=BLUE, zorder=2, label=name)


def _fixed(ax: Any, points: Iterable[Any]) -> None:
    _scatter(ax, [(float(q.d), float(q.d), q) for q in points])


def _scatter(ax: Any, points: Sequence[tuple[float, float, Any]]) -> None:
    """Marks by kind and stability, one entry in the legend each."""
    for verdict, face in (("stable", INK), ("unstable", "white"), ("undecided", GREY)):
        for rest in (True, False):
            wanted = verdict, rest
            chosen = [(x, y) for x, y, q in points if (q.verdict, q.kind == "equilibrium set") == wanted]
            if not chosen:
                continue
            name = f"{verdict} {'equilibrium set' if rest else 'cycle'}"
            ax.plot(
                *np.array(chosen).T, "s" if rest else "o", color=INK, zorder=5, label=name,
                markersize=(6.0 if rest else 5.5) if len(points) < 30 else 4.0,
                markerfacecolor=face, markeredgewidth=1.0,
            )  # fmt: skip


def _branch(ax: Any, branch: Any) -> None:
    """A branch with values and d (and stable, one per point): solid where stable, else dashed."""
    values, d = np.asarray(branch.values, dtype=float), np.asarray(branch.d, dtype=float)
    stable = np.broadcast_to(np.asarray(getattr(branch, "stable", True), dtype=bool), d.shape)
    ax.plot(values, d, color=PALE, linewidth=2.4, zorder=1)
    for kind, line in ((True, "-"), (False, "--")):
        part = np.where(stable == kind, d, np.nan)
        ax.plot(values, part, color=BLUE, linewidth=1.2, linestyle=line, zorder=2)


def _labels(given: Mapping[str, str] | None, known: Mapping[str, str]) -> dict[str, str]:
    named = dict(given or {})
    if "P" in named and "image" in known:  # its earlier name
        named["image"] = named.pop("P")
    check_known("label", named, known, UsageError)
    return {**known, **named}


def _named(event_map: Any) -> dict[str, str]:
    """Labels of a map's axes: those of its system where it has one."""
    section, order = getattr(event_map, "section", None), getattr(event_map, "order", 1)
    own = coordinate_labels(getattr(event_map, "system", None), section, order) if section is not None else {}
    return {"d": "d", "image": "R(d)", "map": "R(d)", **own}


def _finish(ax: Any, title: str) -> None:
    handles, names = ax.get_legend_handles_labels()
    columns = 3
    if title:
        ax.set_title(title, loc="left", pad=10 + 15 * -(-len(names) // columns), fontsize=10.5)
    ax.legend(
        handles, names, loc="lower left", bbox_to_anchor=(0, 1.0), ncols=min(len(names), columns),
        borderpad=0.1, borderaxespad=0.3, handletextpad=0.4, columnspacing=1.2,
    )  # fmt: skip
