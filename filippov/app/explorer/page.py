"""The page: controls on the left, pictures beside them; below 760 pixels everything in one column."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dash import dcc, html

from filippov.app.explorer.export import offered
from filippov.app.explorer.field import Field
from filippov.app.explorer.look import HEIGHT, LOW, empty, points
from filippov.app.explorer.solutions import Solutions
from filippov.app.explorer.time_figure import time_height
from filippov.app.explorer.view import View, diagram_ranges
from filippov.plot.style import INK

HERE = Path(__file__).parent
GROUPS = {"parameters": "Parameters", "start": "Start and time", "shown": "Pictures", "map": "Event map"}
PLOTS = {"time": "Time response", "phase": "Phase portrait", "graph": "Modes and transitions",
         "map": "Event map", "diagram": "Over a parameter"}  # fmt: skip
MENU: dict[str, Any] = {
    "displaylogo": False, "responsive": True, "toImageButtonOptions": {"format": "svg", "filename": "figure"},
    "modeBarButtonsToRemove": ["select2d", "lasso2d"],
}  # fmt: skip


def index() -> str:
    """The HTML around the page, with style and script inline: nothing is loaded from elsewhere."""
    files = ("page.css", "film.js", "page.js")
    style, *scripts = ((HERE / name).read_text(encoding="utf-8") for name in files)
    client = "\n".join(scripts)
    return (
        '<!DOCTYPE html><html lang="en"><head>{%metas%}<title>{%title%}</title>{%favicon%}{%css%}'
        f"<style>{style}</style><script>{client}</script></head>"
        "<body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}</footer></body></html>"
    )


def page(solutions: Solutions, view: View) -> html.Div:
    """The layout of the page for a view."""
    subject, files = solutions.subject, offered(solutions, view)

    # A trace for the point that follows the slider, before its diagram is computed.
    waiting = {**empty("…"), "data": [points([], [], "circle", INK, "")]}

    def height(name: str) -> int:
        return {"time": time_height(subject), "graph": LOW}.get(name, HEIGHT)

    links = [html.A(name, id="file-" + name.replace(".", "-"), href=f"export/{name}", download=name)
             for name in files]  # fmt: skip
    plots = [
        html.Section(
            [html.H2(title),
             dcc.Graph(id=f"figure-{name}", figure=waiting, config=MENU, style={"height": height(name)})],
            className="plot wide" if name == "time" else "plot", **{"aria-label": title},
        )
        for name, title in PLOTS.items()
        if (name != "map" or subject.section is not None) and (name != "diagram" or "over" in view.values)
    ]  # fmt: skip
    return html.Div([
        html.A("Skip to the pictures", href="#plots", className="skip"),
        html.Header([html.H1(subject.name), html.P("Solving …", id="message", role="status")]),
        html.Div([
            html.Aside(controls(view), className="controls", **{"aria-label": "settings"}),
            html.Main([
                html.Div(id="film", role="group", **{"aria-label": "the solution as a film"}),
                html.Div(plots, className="plots"),
                html.P([html.A("Link to this view", id="link", href=""), *links], className="files"),
            ], id="plots"),
        ], className="page"),
        dcc.Location(id="url", refresh=False), dcc.Store(id="ranges", data=diagram_ranges(subject)),
    ])  # fmt: skip


def controls(view: View) -> list[Any]:
    """The settings in collapsible groups."""
    out = []
    for group, title in GROUPS.items():
        rows = [_row(item, view) for item in view.fields.values() if item.group == group]
        if rows:
            out.append(html.Details([html.Summary(title), *rows], open=group in {"parameters", "start"}))
    return out


def _row(item: Field, view: View) -> html.Div:
    name = item.key.partition(".")[2] if item.group == "parameters" else item.label
    unit = f" [{item.unit}]" if item.unit else ""
    told = [html.Small(f" {item.label}")] if item.group == "parameters" and item.label else []
    label = html.Label([f"{name}{unit}", *told], htmlFor=item.id)
    if item.choices:
        # A native list of the browser works with the keyboard and with screen readers.
        choice = dcc.Dropdown(
            list(item.choices), view[item.key], id=item.id, clearable=False, searchable=False
        )
        return html.Div([label, choice], className="row")
    box = dcc.Input(id=item.id, type="number", value=view[item.key], step="any")
    parts = [label, box]
    if item.slider is not None:
        low, high, step = item.slider
        slider = dcc.Input(
            id=f"range-{item.id}", type="range", value=view[item.key], min=low, max=high, step=step
        )
        hint = html.Span(f"slider of {name}", className="unseen")
        parts.append(html.Label([hint, slider], className="range"))
    return html.Div(parts, className="row")
