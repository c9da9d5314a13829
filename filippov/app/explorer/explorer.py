"""`Explorer(system)`: the page in a notebook or a browser, and its views, figures and files from Python."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filippov import Solution, UsageError
from filippov.app.explorer.export import FILES, offered
from filippov.app.explorer.look import Figure
from filippov.app.explorer.map_figure import diagram_figure
from filippov.app.explorer.pictures import pictures
from filippov.app.explorer.solutions import Solutions
from filippov.app.explorer.subject import Subject, subject
from filippov.app.explorer.view import View
from filippov.base.keywords import keywords
from filippov.base.whole_file import write_whole

if TYPE_CHECKING:
    from werkzeug.serving import BaseWSGIServer

    from filippov.analysis.maps.section import Section
    from filippov.analysis.maps.stroboscope import Stroboscope

MISSING = "the page of the explorer needs Dash: pip install 'filippov[explorer]'."


class Explorer:
    """Sliders for the parameters of a system, with its pictures.

    system       a System, a Problem, or a registered Model (filippov.models.get(NAME))
    x0, t_span   where the solution starts and how long it is followed; default those of the Problem or Model
    parameters   values by name, over the defaults
    section      the event map that is shown, with the interval of its coordinate where it has a
                 parametrisation; default the Model's own, else one that is found along the solution
    view         the link, or its part after the question mark, that another page gave

    As the value of a notebook's cell it displays the page; `open()` shows it in a browser. The page is served
    from 127.0.0.1, to this machine only, until `close()` or the end of the process. The other methods take
    changes of the settings: figures(P=20, x0={"x": 0.2}, t1=30, against="Smooth", width=1e-3), or
    figures({"p.P": 20}), by the keys of a link.

    Raises UsageError, ModelError.
    """

    @keywords(same={"y0": "x0", "tspan": "t_span"}, own=("parameters", "interval", "section"))
    def __init__(
        self, system: Any, x0: Any = None, t_span: Any = None, *,
        parameters: Mapping[str, float] | None = None, section: Section | Stroboscope | None = None,
        interval: tuple[float, float] | None = None, view: str = "", name: str = "",
    ) -> None:  # fmt: skip
        made = system
        if not isinstance(system, Subject):
            made = subject(
                system, x0, t_span, parameters=parameters, section=section, interval=interval, name=name
            )
        self.subject: Subject = made
        self.solutions = Solutions(made)
        self.start = View.from_query(made, view)
        self._server: BaseWSGIServer | None = None

    def view(self, settings: Mapping[str, Any] | None = None, /, **changes: Any) -> View:
        """The view with some settings changed. Raises UsageError."""
        return self.start.but(settings, **changes)

    def query(self, settings: Mapping[str, Any] | None = None, /, **changes: Any) -> str:
        """The part of a link after the question mark that restores the view."""
        return self.view(settings, **changes).query

    def solution(self, settings: Mapping[str, Any] | None = None, /, **changes: Any) -> Solution:
        """The solution that the page shows."""
        return self.solutions.exact(self.view(settings, **changes))

    def figures(self, settings: Mapping[str, Any] | None = None, /, **changes: Any) -> dict[str, Figure]:
        """The figures by name (time, phase, graph, map, diagram) in the form of plotly: go.Figure(figure)."""
        view = self.view(settings, **changes)
        made = dict(pictures(self.solutions, view).figures)
        found = self.solutions.diagram(view)
        if found is not None:
            made["diagram"] = diagram_figure(view, found, self.solutions.map(view))
        return made

    def export(
        self, folder: str | Path, settings: Mapping[str, Any] | None = None, /, **changes: Any
    ) -> list[Path]:
        """Write data, figures, the solution and the Python that makes them; returns the paths.

        There is no view.py for plain functions that are not part of a system with a name in their module.
        """
        view, target = self.view(settings, **changes), Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        names = offered(self.solutions, view)
        return [write_whole(target / n, FILES[n][0](self.solutions, view)) for n in names]

    # -- the page -----------------------------------------------------------------------------------------

    def server(self, port: int = 0) -> BaseWSGIServer:
        """The server of the page, not yet running. Raises UsageError without Dash, or for a port in use."""
        try:
            from filippov.app.explorer.server import application, listen
        except ImportError as error:
            raise UsageError(MISSING) from error
        try:
            return listen(application(self.solutions, self.start), port)
        except (OSError, OverflowError, SystemExit) as error:
            raise UsageError(
                f"port {port} cannot be used: choose another one, or 0 for any free one."
            ) from error

    @property
    def url(self) -> str:
        """The address of the page; starts the server."""
        if self._server is None:
            self._server = self.server()
            threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return address(self._server, self.start)

    def open(self) -> str:
        """Show the page in a browser; returns its address."""
        import webbrowser

        webbrowser.open(self.url)
        return self.url

    def close(self) -> None:
        """Stop the server."""
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()
            self._server = None

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{escape(self.url)}" style="width: 100%; height: 900px; border: 1px solid #d9d9d9" '
            f'title="{escape(self.subject.name)}"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Explorer({self.subject.name!r}, {len(self.subject.parameters)} parameters)"


def address(server: BaseWSGIServer, view: View) -> str:
    """The address at which a server shows a view."""
    return f"http://127.0.0.1:{server.server_port}/" + ("?" + view.query if view.query else "")
