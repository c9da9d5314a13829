"""Where a label stands beside a point of a figure without lying on a line."""

from __future__ import annotations

from typing import Any

import numpy as np

# Offsets from the point in points of print, the first that is free is taken; "right" ends the text there.
_OFFSETS = (
    (7, 4, "left"), (7, -11, "left"), (7, 13, "left"), (-7, 13, "right"), (7, 24, "left"), (0, 30, "center"),
    (-7, -11, "right"), (-7, 4, "right"), (0, -24, "center"), (7, 35, "left"), (-7, 24, "right"),
    (0, -36, "center"), (7, 46, "left"),
)  # fmt: skip
_SIZE, _WIDE, _GAP = 8.0, 0.62, 1.5


def label_beside(ax: Any, x: float, y: float, text: str, colour: str) -> None:
    """Write a label beside (x, y), where no other label is and, if there is such a place, no line of the
    axes; nothing where the same text stands at a point that cannot be told from this one.

    To be called when every line is drawn: it takes the limits as they are then.
    """
    ax.get_figure(root=True).draw_without_rendering()
    point = ax.get_figure(root=True).dpi / 72
    paths = [line.get_transform().transform(line.get_xydata()) for line in ax.lines if len(line.get_xydata())]
    dense = np.vstack([_dense(path, point) for path in paths]) if paths else np.empty((0, 2))
    taken = [label.get_window_extent() for label in ax.texts]
    at = ax.transData.transform((x, y))
    wide, high = _WIDE * _SIZE * len(text) * point, _SIZE * point
    frame = ax.get_window_extent()

    marked = [ax.transData.transform(label.xy) for label in ax.texts if label.get_text() == text]
    if any(np.hypot(*(at - other)) < _GAP * point for other in marked):
        return

    def cost(offset: tuple[int, int, str]) -> tuple[int, bool, int]:
        left = at[0] + offset[0] * point - {"left": 0.0, "center": 0.5, "right": 1.0}[offset[2]] * wide
        low, gap = at[1] + offset[1] * point, _GAP * point
        inside = (dense > (left - gap, low - gap)) & (dense < (left + wide + gap, low + high + gap))
        over = sum(t.x0 < left + wide and left < t.x1 and t.y0 < low + high and low < t.y1 for t in taken)
        return over, low < frame.y0 or left < frame.x0, int(np.sum(np.all(inside, axis=1)))

    dx, dy, side = min(_OFFSETS, key=cost)
    ax.annotate(
        text, (x, y), xytext=(dx, dy), textcoords="offset points", fontsize=_SIZE, color=colour, ha=side
    )


def _dense(path: Any, point: float) -> Any:
    """Points along a line, at most three points of print apart."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    out = [path]
    for a, b, length in zip(path[:-1], path[1:], steps, strict=True):
        if np.isfinite(length) and length > 3 * point:
            out.append(np.linspace(a, b, min(400, int(length / point)) + 1))
    return np.vstack(out)
