"""The page as a local server: its requests are answered here, and none goes elsewhere."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from dash import ClientsideFunction, Dash, Input, Output
from flask import Response, abort, request
from plotly.io.json import to_json_plotly
from werkzeug.serving import BaseWSGIServer, WSGIRequestHandler, make_server

from filippov.app.explorer.export import FILES, offered
from filippov.app.explorer.look import packed
from filippov.app.explorer.page import index, page
from filippov.app.explorer.pictures import draw, draw_diagram, told
from filippov.app.explorer.solutions import PostponedError, Solutions
from filippov.app.explorer.subject import Subject
from filippov.app.explorer.view import View

ADDRESS = "127.0.0.1"
# The browser also refuses what plotly and Dash might request elsewhere.
POLICY = (
    "default-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; frame-ancestors *"
)


def application(solutions: Solutions, start: View) -> Dash:
    """The Dash application of a subject, at a view."""
    # Runs of the solver share buffers: one at a time.
    lock = threading.Lock()
    app = Dash(
        __name__, serve_locally=True, include_assets_files=False, title=f"filippov: {start.subject.name}",
        update_title="", index_string=index(), add_log_handler=False,
        meta_tags=[{"name": "viewport", "content": "width=device-width, initial-scale=1"}],
    )  # fmt: skip
    app.layout = page(solutions, start)
    items = list(start.fields.values())

    def restore(search: str | None) -> list[Any]:
        """The controls of a link; those of the subject where it cannot be read, with the reason."""
        view, _ = read_link(solutions.subject, search or "")
        return [view[item.key] for item in items]

    app.callback([Output(item.id, "value") for item in items], Input("url", "search"))(restore)
    controls = [Input(item.id, "value") for item in items]
    sliders = [Input(f"range-{item.id}", "value") for item in items if item.slider is not None]
    sync = [*controls, *sliders, Input("ranges", "data")]
    for function, inputs in (("gate", controls), ("sync", sync)):
        app.clientside_callback(ClientsideFunction("explorer", function), *inputs)
    _routes(app.server, solutions, start, lock)
    return app


def redraw(
    solutions: Solutions, settings: Mapping[str, Any], search: str, files: list[str]
) -> dict[str, Any]:
    """The output of the page at settings by key; search: the link with which it was opened."""
    made = draw(solutions, settings)
    _, wrong = read_link(solutions.subject, search)
    # The page reports a link that was refused until a setting is changed.
    wrong = "" if made.query else wrong
    return {
        "said": f"{wrong} {made.said}".strip(), "good": made.good and not wrong, "drawn": bool(made.figures),
        "query": made.query, "files": files, "here": made.here, "film": made.film,
        "figures": {name: packed(figure) for name, figure in made.figures.items()},
    }  # fmt: skip


def read_link(explored: Subject, search: str) -> tuple[View, str]:
    """The view of a link and its error; the subject's own view where it cannot be read."""
    try:
        return View.from_query(explored, search), ""
    except ValueError as error:
        return View(explored), f"The link was not taken: {told(error)}"


def _routes(flask: Any, solutions: Solutions, start: View, lock: threading.Lock) -> None:
    keys, files = {item.id: item.key for item in start.fields.values()}, offered(solutions, start)

    def answer(make: Callable[[dict[str, Any], str], Any], hurry: bool) -> Response:
        """From the settings of the page's controls, by their ids, to its output.

        hurry: interrupt a diagram.
        """
        asked = request.get_json(silent=True)
        if not isinstance(asked, dict) or not isinstance(held := asked.get("settings"), dict):
            abort(400)
        named = {keys[name]: value for name, value in held.items() if name in keys}
        if hurry:
            solutions.hurry.set()
        with lock:
            if hurry:
                solutions.hurry.clear()
            made = make(named, str(asked.get("search") or ""))
        return Response(to_json_plotly(made), mimetype="application/json")

    def live() -> Response:
        return answer(lambda named, search: redraw(solutions, named, search, files), True)

    def diagram() -> Response:
        def make(named: dict[str, Any], _: str) -> Any:
            try:
                return packed(draw_diagram(solutions, named))
            except PostponedError:
                return {"postponed": True}

        return answer(make, False)

    def own_host() -> None:
        """Refuse a request with a foreign host name (DNS rebinding)."""
        if request.host.partition(":")[0] not in {ADDRESS, "localhost"}:
            abort(403)

    def only_here(response: Response) -> Response:
        response.headers["Content-Security-Policy"] = POLICY
        return response

    def export(name: str) -> Response:
        if name not in FILES:
            abort(404)
        make, kind = FILES[name]
        try:
            view = View.from_query(solutions.subject, request.query_string.decode("ascii", "replace"))
            with lock:
                content = make(solutions, view)
        except Exception as error:  # noqa: BLE001  # also a function of the user's
            return Response(told(error), status=400, mimetype="text/plain")
        headers = {"Content-Disposition": f"attachment; filename={name}"}
        return Response(content, mimetype=kind, headers=headers)

    flask.before_request(own_host)
    flask.after_request(only_here)
    flask.add_url_rule("/export/<name>", "export", export)
    flask.add_url_rule("/redraw", "redraw", live, methods=["POST"])
    flask.add_url_rule("/diagram", "diagram", diagram, methods=["POST"])


class _Quiet(WSGIRequestHandler):
    def log(self, type: str, message: str, *args: Any) -> None:  # noqa: A002  # its name there
        """Do not log requests."""


def listen(app: Dash, port: int = 0) -> BaseWSGIServer:
    """A server at a port of this machine, any free one for 0. Raises OSError where the port is taken."""
    return make_server(ADDRESS, port, app.server, threaded=True, request_handler=_Quiet)
