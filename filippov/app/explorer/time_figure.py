"""States and outputs over time: a band behind every mode, events marked, the comparator dashed."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.explorer.look import (
    BANDS,
    FAINT,
    HEIGHT,
    LOW,
    MARKS,
    MOST_MARKS,
    OTHER,
    Figure,
    figure,
    label,
    line,
    plain,
    points,
)
from filippov.app.explorer.subject import Subject
from filippov.base.status import mode_text
from filippov.plot.pieces import output_pieces, pieces_of
from filippov.plot.style import BLUE, RED, panel_label
from filippov.solving.segments import Segment
from filippov.solving.solution import Solution

POINTS = 800
MOST_ROWS = 8


def time_figure(subject: Subject, solution: Solution, other: Solution | None, against: str = "") -> Figure:
    """One panel per state and output, at most eight, the first at the top."""
    names, states = subject.quantities[:MOST_ROWS], subject.system.states
    pieces = list(pieces_of(solution, POINTS))
    beside = None if other is None else list(pieces_of(other, POINTS))
    data: list[dict[str, Any]] = []
    axes: dict[str, Any] = {}
    for row, name in enumerate(names):
        key = "y" if row == 0 else f"y{row + 1}"
        bottom = 1 - (row + 1) / len(names)
        domain = [bottom + 0.02, bottom + 1 / len(names) - 0.02]
        beneath = panel_label(label(subject, name)).replace("\n", "<br>")
        axes[key] = {"domain": domain, "title": {"text": beneath, "font": {"size": 12}}, "nticks": 5}
        first: dict[str, Any] = {"yaxis": key, "showlegend": row == 0}
        x, y = _values(subject, solution, pieces, name)
        data.append(line(x, y, BLUE if name in states else RED, "exact", **first))
        if other is not None and beside is not None:
            x, y = _values(subject, other, beside, name)
            data.append(line(x, y, OTHER, against, dash="dash", width=1.3, **first))
        if name in states and len(solution.events) <= MOST_MARKS:
            data += _marks(solution, states.index(name), first)
    low, high = solution.problem.t_span
    axes["x"] = {"title": {"text": label(subject, "t")}, "range": [low, high], "domain": [0, 1],
                 "anchor": "y" if len(names) == 1 else f"y{len(names)}"}  # fmt: skip
    return figure(data, axes, shapes=_bands(solution), height=time_height(subject), hovermode="x unified")


def time_height(subject: Subject) -> int:
    """Its height in pixels."""
    return max(HEIGHT + LOW + 30, 150 + 130 * len(subject.quantities[:MOST_ROWS]))


def mode_words(surfaces: tuple[str, ...], mode: tuple[int, ...]) -> str:
    """A mode in words: its signs, and its sliding surfaces."""
    on = [name for name, sign in zip(surfaces, mode, strict=True) if sign == 0]
    return f"mode {mode_text(mode)}" + (f", on {', '.join(on)}" if on else "")


def _values(subject: Subject, solution: Solution, pieces: list[tuple[Segment, Any, Any]], name: str) -> Any:
    if name not in subject.system.states:
        return output_pieces(solution, name, pieces)
    i = subject.system.states.index(name)
    return np.concatenate([t for _, t, _ in pieces]), np.concatenate([x[i] for _, _, x in pieces])


def _marks(solution: Solution, i: int, more: dict[str, Any]) -> list[dict[str, Any]]:
    out = []
    for kind, (symbol, colour) in MARKS.items():
        chosen = [event for event in solution.events if event.kind is kind]
        if chosen:
            out.append(
                points([e.t for e in chosen], [e.x[i] for e in chosen], symbol, colour, str(kind), **more)
            )
    return out


def _bands(solution: Solution) -> list[dict[str, Any]]:
    """One shape for each mode, with a rectangle for each of its segments."""
    spans: dict[tuple[int, ...], list[str]] = {}
    for segment in solution.segments:
        low, high = segment.t0, segment.t1
        spans.setdefault(segment.mode, []).append(f"M{low!r},0L{low!r},1L{high!r},1L{high!r},0Z")
    surfaces, shapes = solution.system.surface_names, []
    counts = [0, 0]
    for mode, paths in sorted(spans.items()):
        sliding = 0 in mode
        colours = BANDS if sliding else FAINT
        colour = colours[counts[sliding] % len(colours)]
        counts[sliding] += 1
        shapes.append({
            "type": "path", "path": "".join(paths), "xref": "x", "yref": "paper", "layer": "below",
            "fillcolor": colour, "opacity": 0.3 if sliding else 0.07, "line": {"width": 0},
            "showlegend": True, "name": plain(mode_words(surfaces, mode)),
        })  # fmt: skip
    return shapes
