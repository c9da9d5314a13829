"""The event map with a cobweb, and iterates of it over a parameter with the current point."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.app.explorer.look import HEIGHT, Figure, figure, label, line, plain, points
from filippov.app.explorer.motion import MapData
from filippov.app.explorer.view import View
from filippov.plot.maps import with_gaps
from filippov.plot.style import BLUE, GREY, INK, ORANGE, RED

Array = npt.NDArray[np.float64]


def map_figure(view: View, found: MapData) -> Figure:
    """P(d), the diagonal, and the steps from the start that was chosen."""
    known = found.orbit[np.isfinite(found.orbit)]
    x = np.repeat(known, 2)[:-1]
    y = np.concatenate([known[:1], np.repeat(known[1:], 2)])
    ends = found.d[[0, -1]]
    data = [
        line(ends, ends, GREY, "P(d) = d", dash="dot", width=1.2),
        line(*with_gaps(found.d, found.image), BLUE, "P(d)", width=2),
        line(x, y, ORANGE, "cobweb", width=1.2),
        points(known[:1], known[:1], "square", INK, "start"),
    ]
    name, turns = coordinate(view), view["order"]
    after = "one turn later" if turns == 1 else f"{turns} turns later"
    axes = {"x": {"title": {"text": f"d: {name} at the event"}, "range": ends.tolist()},
            "y": {"title": {"text": f"P(d): {after}"}}}  # fmt: skip
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
    """Where the iterates are at the value that the slider has."""
    value = view[f"p.{view['over']}"]
    d = np.array([]) if now is None else now.last[np.isfinite(now.last)]
    return points(np.full(d.size, value), d, "diamond", RED, "here", size=9)


def coordinate(view: View) -> str:
    """The label of the section's coordinate."""
    section = view.subject.section
    assert section is not None
    name = str(section.coordinate)
    return label(view.subject, name) if name in view.subject.system.states else plain(name)
