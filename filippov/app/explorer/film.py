"""The solution as a film: where it is at each moment, for the point that the page moves over its pictures."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.explorer.look import label, numbers
from filippov.app.explorer.time_figure import mode_words
from filippov.app.explorer.view import View
from filippov.plot.pieces import pieces_of
from filippov.solving.solution import Solution

POINTS = 600


def film(view: View, solution: Solution) -> dict[str, Any]:
    """Times t and the two states x, y of the phase portrait; modes: (first time, text) of each segment."""
    i, j = (view.subject.system.states.index(view[key]) for key in "xy")
    pieces = list(pieces_of(solution, POINTS))
    surfaces = view.subject.system.surface_names
    modes: list[tuple[float, str]] = []
    for segment, _, _ in pieces:
        words = mode_words(surfaces, segment.mode)
        if not modes or modes[-1][1] != words:
            modes.append((float(segment.t0), words))
    return {
        "t": numbers(np.concatenate([t for _, t, _ in pieces])),
        "x": numbers(np.concatenate([x[i] for _, _, x in pieces])),
        "y": numbers(np.concatenate([x[j] for _, _, x in pieces])),
        "modes": modes, "label": label(view.subject, "t"),
    }  # fmt: skip
