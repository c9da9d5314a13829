"""Phase portrait: free parts thin, sliding parts thick, the surfaces as lines of their h = 0."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import Any

import numpy as np
import sympy

from filippov import Solution, System
from filippov import t as time_symbol
from filippov.app.explorer.look import (
    HEIGHT,
    MARKS,
    MOST_MARKS,
    OTHER,
    Figure,
    empty,
    figure,
    label,
    line,
    numbers,
    plain,
    points,
)
from filippov.app.explorer.view import View
from filippov.base.arrays import Array
from filippov.plot.pieces import pieces_of
from filippov.plot.style import BLUE, GREY, INK, ORANGE

POINTS = 1000
GRID = 41


def phase_figure(view: View, solution: Solution, other: Solution | None) -> Figure:
    """Two states against each other, in front of the surfaces."""
    subject, pair = view.subject, (view["x"], view["y"])
    if pair[0] == pair[1]:
        return empty("A phase portrait needs two states: choose another one for the other axis.")
    i, j = (subject.system.states.index(name) for name in pair)
    data: list[dict[str, Any]] = []
    for kind, run in ((view["against"], other), ("exact", solution)):
        if run is None:
            continue
        gap, parts = np.full((2, 1), np.nan), {False: [np.zeros((2, 0))], True: [np.zeros((2, 0))]}
        for sliding, group in groupby(pieces_of(run, POINTS), key=lambda piece: 0 in piece[0].mode):
            parts[sliding and run is solution] += [*(x[[i, j]] for _, _, x in group), gap]
        free, slid = (np.concatenate(parts[key], axis=1) for key in (False, True))
        look: dict[str, Any] = (
            {"width": 1.6, "dash": "solid"} if run is solution else {"width": 1.3, "dash": "dash"}
        )
        data.append(line(free[0], free[1], BLUE if run is solution else OTHER, kind, **look))
        if slid.size:
            data.append(line(slid[0], slid[1], ORANGE, "sliding", width=4.5))
    data.append(points([view.x0[i]], [view.x0[j]], "square", INK, "start"))
    for event_kind, (symbol, colour) in MARKS.items() if len(solution.events) <= MOST_MARKS else ():
        at = [event.x for event in solution.events if event.kind is event_kind]
        if at:
            name = str(event_kind)
            data.append(points([x[i] for x in at], [x[j] for x in at], symbol, colour, name, size=7))
    data = surfaces(view, i, j, data) + data
    axes = {key: {"title": {"text": label(subject, name)}} for key, name in zip("xy", pair, strict=True)}
    return figure(data, axes, height=HEIGHT, hovermode="closest")


def surfaces(view: View, i: int, j: int, drawn: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The line h = 0 of every surface in the plane of two states, if h depends on no other."""
    ends = [_range([v for part in drawn for v in part[key] if v is not None]) for key in "xy"]
    across, up = (np.linspace(*pair, GRID) for pair in ends)
    out = []
    for name, h in functions(view.subject.system, view.parameters).items():
        heights = [_heights(h, across, up, i, j, view, shift) for shift in (0.0, 1.0)]
        values = heights[0]
        if values is None or heights[1] is None or not np.allclose(values, heights[1], 1e-9, 1e-12):
            continue
        finite = values[np.isfinite(values)]
        if not finite.size or finite.min() > 0 or finite.max() < 0:
            continue
        out.append({
            "type": "contour", "x": across.tolist(), "y": up.tolist(),
            "z": [numbers(row) for row in values], "hoverinfo": "skip",
            "contours": {"type": "constraint", "operation": "=", "value": 0}, "showscale": False,
            "line": {"color": GREY, "width": 1.3, "dash": "dot"}, "name": plain(f"{name} = 0"),
            "showlegend": True,
        })  # fmt: skip
    return out


def functions(system: System, parameters: dict[str, float]) -> dict[str, Callable[..., Any]]:
    """h(t, x) of every surface by name, for arrays of states."""
    form = system.symbolic
    if form is None:
        record = system.parameters.record(system.parameters.resolve(parameters))
        return {q.name: np.vectorize(lambda t, *x, h=q.h: h(t, np.array(x), record)) for q in system.surfaces}
    out: dict[str, Callable[..., Any]] = {}
    gone = {symbol: sympy.Float(parameters[symbol.name]) for symbol in form.p}
    sizes: dict[Any, Any] = {}
    for name, h, size in zip(system.surface_names, form.h, form.a, strict=True):
        plain_h = h.xreplace(sizes).xreplace(gone)
        sizes[size] = sympy.Abs(plain_h)
        out[name] = sympy.lambdify([time_symbol, *form.x], plain_h, "numpy")
    return out


def _heights(
    h: Callable[..., Any], across: Array, up: Array, i: int, j: int, view: View, shift: float
) -> Array | None:
    """h over the plane, the other states and time as at the start, shifted."""
    grid = np.meshgrid(across, up)
    x = [np.full(grid[0].shape, value + shift * (1.0 + abs(value))) for value in view.x0]
    x[i], x[j] = grid
    try:
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(h(view["t0"] + shift, *x), dtype=float), grid[0].shape)
    except (TypeError, ValueError, ArithmeticError, IndexError):
        return None


def _range(values: list[float]) -> tuple[float, float]:
    low, high = (min(values), max(values)) if values else (-1.0, 1.0)
    margin = 0.08 * (high - low) or 0.1 * abs(low) or 1.0
    return low - margin, high + margin
