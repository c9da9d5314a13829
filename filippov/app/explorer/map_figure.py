"""The event map with a cobweb, and iterates of it over a parameter with the current point."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.explorer.look import HEIGHT, Figure, empty, figure, label, line, plain, points
from filippov.app.explorer.solutions import MapData
from filippov.app.explorer.view import View
from filippov.base.arrays import Array
from filippov.plot.maps import with_gaps
from filippov.plot.style import BLUE, GREY, INK, ORANGE, RED, where_read

LETTERS = "RMQW"  # of the map, the first that the model does not use


def map_figure(view: View, found: MapData) -> Figure:
    """R(d), the diagonal, and the steps from the start that was chosen.

    Without a parametrisation R is known along the solution only, as points. Where the model has an R of
    its own, a resistance or a radius, the map has another letter.
    """
    system = view.subject.system
    taken = {*system.parameters.names, *system.states}
    image = f"{next((letter for letter in LETTERS if letter not in taken), LETTERS[0])}(d)"
    known = found.orbit[np.isfinite(found.orbit)]
    if view.subject.interval is None and not found.d.size:
        return empty(f"There is no pair of returns to show: {found.note or 'the solution has one event'}.")
    x = np.repeat(known, 2)[:-1]
    y = np.concatenate([known[:1], np.repeat(known[1:], 2)])
    if view.subject.interval is None:
        ends = _ends(np.concatenate([found.d, found.image]))
        curve = points(found.d, found.image, "circle", BLUE, f"{image} along the solution", size=5)
    else:
        ends, curve = found.d[[0, -1]], line(*with_gaps(found.d, found.image), BLUE, image, width=2)
    data = [
        line(ends, ends, GREY, f"{image} = d", dash="dot", width=1.2),
        curve,
        line(x, y, ORANGE, "cobweb", width=1.2),
        points(known[:1], known[:1], "square", INK, "start"),
    ]
    name, returns = coordinate(view), view["order"]
    after = "one return later" if returns == 1 else f"{returns} returns later"
    where = where_read(view.subject.section)[0]
    axes = {"x": {"title": {"text": f"d: {name} {where}"}, "range": ends.tolist()},
            "y": {"title": {"text": f"{image}: {after}"}}}  # fmt: skip
    return figure(data, axes, height=HEIGHT, hovermode="closest")


def diagram_figure(view: View, found: tuple[Array, Array] | None, now: MapData | None) -> Figure:
    """Iterates after a transient over a parameter; the first trace is `here`, which follows the slider."""
    low, high = view["low"], view["high"]
    data = [here(view, now)]
    if found is not None:
        values, d = found
        grid = np.repeat(values, d.shape[1])
        kept = np.isfinite(d.ravel())
        data.append(points(grid[kept], d.ravel()[kept], "circle", BLUE, "iterates", size=4))
    axes = {"x": {"title": {"text": label(view.subject, view["over"])}, "range": [low, high]},
            "y": {"title": {"text": coordinate(view)}}}  # fmt: skip
    return figure(data, axes, height=HEIGHT, hovermode="closest")


def here(view: View, now: MapData | None) -> dict[str, Any]:
    """The iterates at the value of the slider."""
    value = view[f"p.{view['over']}"]
    d = np.array([]) if now is None else now.last[np.isfinite(now.last)]
    return points(np.full(d.size, value), d, "diamond", RED, "here", size=9)


def _ends(d: Array) -> Array:
    """An interval around the pairs, not magnified where they differ by rounding only."""
    low, high = float(d.min()), float(d.max())
    margin = max(0.08 * (high - low), 1e-3 * max(abs(low), abs(high))) or 1.0
    return np.array([low - margin, high + margin])


def coordinate(view: View) -> str:
    """The label of the section's coordinate."""
    section = view.subject.section
    assert section is not None
    name = str(section.coordinate)
    return label(view.subject, name) if name in view.subject.system.states else plain(name)
