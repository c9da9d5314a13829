"""filippov explore: the page of one model; with -o its data, figures and Python, and no page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filippov import Problem, UsageError
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import Loaded, loaded_of
from filippov.app.explorer.explorer import Explorer, address
from filippov.app.explorer.export import FILES, UNNAMED, offered
from filippov.app.explorer.pictures import summary
from filippov.app.explorer.subject import of_file, subject
from filippov.app.explorer.view import View


def run(settings: dict[str, Any], console: Console) -> int:
    """Serve the page until Ctrl-C, or write the files of the view."""
    loaded = loaded_of(settings)
    explorer = explorer_of(loaded, settings)
    folder = Folder(settings["output"], console)
    if folder.path is not None:
        return _export(explorer, folder, console)
    server = explorer.server(settings["port"])
    url = address(server, explorer.start)
    console.result({"model": loaded.name, "url": url})
    console.say(f"{loaded.name} at {url}  (Ctrl-C ends it)")
    if settings["open"]:
        import webbrowser

        webbrowser.open(url)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        console.say("ended")
    finally:
        server.server_close()
    return 0


def explorer_of(loaded: Loaded, settings: dict[str, Any]) -> Explorer:
    """The explorer of a model as the command line names it, at the view that the flags ask for.

    The flags change the view: its link contains them and restores it without flags. Raises UsageError.
    """
    system, start = loaded.system, loaded.x0
    made: Any = loaded.model
    if made is None:
        start = [0.0] * system.dimension if start is None else start
        made = Problem(system, start, loaded.t_span or (0.0, 10.0), loaded.values(None))
    explored = subject(made, name=loaded.name, origin=_origin(settings))
    view = View.from_query(explored, settings["view"] or "")
    changes: dict[str, Any] = {f"p.{name}": value for name, value in (settings["parameters"] or {}).items()}
    if settings["t_span"] is not None:
        changes |= dict(zip(("t0", "t1"), settings["t_span"], strict=True))
    view = view.but(changes) if settings["x0"] is None else view.but(changes, x0=settings["x0"])
    return Explorer(explored, view=view.query)


def _origin(settings: dict[str, Any]) -> str:
    """Lines of Python that make the system of a file; for a registered model the subject has them."""
    name = settings["model"]
    if ".py" not in name or settings["input"]:
        return ""
    file, colon, attribute = name.rpartition(":")
    return of_file(f"{Path(file).resolve()}{colon}{attribute}")


def _export(explorer: Explorer, folder: Folder, console: Console) -> int:
    solutions, view = explorer.solutions, explorer.start
    solution = solutions.exact(view)
    if not explorer.subject.origin:
        console.warn(UNNAMED)
    for name in offered(solutions, view):
        try:
            content = FILES[name][0](solutions, view)
        except (ImportError, UsageError) as error:
            console.warn(f"no {name}: {error}")
            continue
        folder.content(name, content)
    system = solutions.subject.system
    console.result({
        "model": explorer.subject.name, "query": view.query, "parameters": view.parameters,
        "status": solution.status.value, "message": solution.message, "t_end": solution.t_end,
        "x_end": dict(zip(system.states, solution.x_end.tolist(), strict=True)),
        "events": len(solution.events), "files": folder.written,
    })  # fmt: skip
    console.say(summary(solution))
    folder.report()
    return 0 if solution.success else 1
