"""The look of the page's figures: data and layout in the form of plotly.js, as plain dictionaries."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np

from filippov.app.explorer.subject import Subject
from filippov.base.status import EventKind
from filippov.plot.style import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, RED, SKY

Figure = dict[str, Any]
# A strong tint for a sliding mode, a faint one for others.
BANDS = (ORANGE, SKY, GREEN, PURPLE)
FAINT = (BLUE, RED, GREY, INK)
MARKS = {
    EventKind.CROSSING: ("circle", INK), EventKind.ENTRY: ("triangle-down", RED),
    EventKind.EXIT: ("triangle-up", GREEN), EventKind.GRAZING: ("x-thin-open", PURPLE),
    EventKind.RESET: ("diamond", INK),
}  # fmt: skip
OTHER = PURPLE  # the comparator
MOST_MARKS = 400
HEIGHT, LOW = 400, 260  # pixels
SHORT = 32
AXIS: dict[str, Any] = {
    "showline": True, "linecolor": GREY, "ticks": "outside", "tickcolor": GREY, "gridcolor": PALE,
    "zeroline": False, "showgrid": False, "exponentformat": "power", "ticklabeloverflow": "allow",
}  # fmt: skip


def figure(data: list[dict[str, Any]], axes: Mapping[str, Any], **layout: Any) -> Figure:
    """A figure with axes x, y, y2, ...; its zoom is kept while a slider moves."""
    shown = {
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": INK}, "paper_bgcolor": "white",
        "plot_bgcolor": "white", "margin": {"l": 70, "r": 26, "t": 8, "b": 48}, "uirevision": "kept",
        "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.01, "x": 0, "font": {"size": 12}},
        "hoverlabel": {"namelength": -1}, "showlegend": True,
    }  # fmt: skip
    named = {f"{key[0]}axis{key[1:]}": {**AXIS, **axis} for key, axis in axes.items()}
    return {"data": data, "layout": {**shown, **named, **layout}}


def empty(text: str) -> Figure:
    """A figure with a sentence in place of a picture."""
    words = plain(_wrapped(text)).replace("\n", "<br>")
    note = {"text": words, "showarrow": False, "x": 0.5, "y": 0.5, "xref": "paper", "yref": "paper",
            "font": {"size": 13, "color": GREY}}  # fmt: skip
    hidden = {"visible": False}
    return figure([], {"x": hidden, "y": hidden}, annotations=[note], showlegend=False)


def label(subject: Subject, name: str) -> str:
    """The label of an axis with its unit."""
    system = subject.system
    if name in system.labels:
        return plain(str(system.labels[name]).replace("\\$", "$"))
    unit = system.parameters[name].unit if name in system.parameters else ""
    return plain(f"{name} [{unit}]" if unit else name)


def plain(text: str) -> str:
    """Text escaped for plotly, which interprets tags."""
    return escape(text, quote=False)


def numbers(values: Iterable[float]) -> list[float | None]:
    """Numbers for JSON; None leaves a gap."""
    return [value if math.isfinite(value) else None for value in map(float, values)]


def line(x: Iterable[float], y: Iterable[float], colour: str, name: str, **more: Any) -> dict[str, Any]:
    """A line."""
    style = {"color": colour, "width": more.pop("width", 1.6), "dash": more.pop("dash", "solid")}
    return {"type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y), "line": style, "name": name,
            **more}  # fmt: skip


def points(
    x: Iterable[float], y: Iterable[float], symbol: str, colour: str, name: str, **more: Any
) -> dict[str, Any]:
    """Marks."""
    mark = {"symbol": symbol, "color": colour, "size": more.pop("size", 8)}
    mark |= {"line": {"width": 2, "color": colour}} if symbol.endswith("open") else {}
    return {"type": "scatter", "mode": "markers", "x": numbers(x), "y": numbers(y), "marker": mark,
            "name": name, **more}  # fmt: skip


def packed(part: Any) -> Any:
    """A figure with its long arrays as base64, which plotly.js decodes faster than numbers."""
    if isinstance(part, dict):
        return {key: packed(value) for key, value in part.items()}
    if isinstance(part, list) and len(part) > SHORT and all(isinstance(v, float | None) for v in part):
        row = np.array(part, dtype="<f8")
        return {"dtype": "f8", "bdata": base64.b64encode(row.tobytes()).decode("ascii")}
    if isinstance(part, list) and part and isinstance(part[0], dict):
        return [packed(value) for value in part]
    return part


def _wrapped(text: str, width: int = 46) -> str:
    out, row = [], ""
    for word in text.split():
        if row and len(row) + len(word) >= width:
            out.append(row)
            row = ""
        row += (" " if row else "") + word
    return "\n".join([*out, row])
