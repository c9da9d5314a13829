"""From the settings of the page to its pictures and the sentence beside them; no error is raised."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from filippov.app.explorer.film import film
from filippov.app.explorer.graph_figure import graph_figure
from filippov.app.explorer.look import Figure, empty
from filippov.app.explorer.map_figure import diagram_figure, here, map_figure
from filippov.app.explorer.phase_figure import phase_figure
from filippov.app.explorer.solutions import PostponedError, Solutions
from filippov.app.explorer.time_figure import MOST_ROWS, time_figure
from filippov.app.explorer.view import View
from filippov.base.status import mode_text
from filippov.solving.solution import Solution


@dataclass(frozen=True)
class Drawn:
    """Figures by name (time, phase, graph, map); none where the settings cannot be used.

    said   the result of the run, or what is wrong; good: whether the run reached its end
    query  the link that restores the view; here: the point of the diagram that follows the slider
    film   where the solution is at each moment, see `film`
    """

    said: str
    good: bool
    query: str = ""
    figures: Mapping[str, Figure] = field(default_factory=dict)
    here: Mapping[str, Any] | None = None
    film: Mapping[str, Any] | None = None


def draw(solutions: Solutions, values: Mapping[str, Any]) -> Drawn:
    """Everything that is redrawn while a slider moves."""
    try:
        view = View(solutions.subject, values)
        return pictures(solutions, view)
    except Exception as error:  # noqa: BLE001  # also a function of the user's: the page says what happened
        return Drawn(f"Not redrawn. {told(error)}", False)


def pictures(solutions: Solutions, view: View) -> Drawn:
    """The figures of a view. Raises the errors of the exact solution; other figures show theirs in place."""
    solution = solutions.exact(view)
    said, other = summary(solution), None
    try:
        other = solutions.other(view)
        if other is not None and not other.success:
            said += f" {view['against']} ended at t = {other.t_end:.6g}: {other.message}"
    except Exception as error:  # noqa: BLE001
        said += f" No {view['against']} beside it. {told(error)}"
    if len(view.subject.quantities) > MOST_ROWS:
        said += f" The first {MOST_ROWS} of {len(view.subject.quantities)} states and outputs are shown."
    figures = {
        "time": time_figure(view.subject, solution, other, view["against"]),
        "phase": phase_figure(view, solution, other),
        "graph": graph_figure(solution),
    }
    point = None
    try:
        found = solutions.map(view)
        if found is not None:
            figures["map"] = map_figure(view, found)
            said += f" Event map: {found.note}." if found.note else ""
            point = here(view, found) if "over" in view.values else None
    except Exception as error:  # noqa: BLE001
        figures["map"] = empty(told(error))
    return Drawn(said, solution.success, view.query, figures, point, film(view, solution))


def draw_diagram(solutions: Solutions, values: Mapping[str, Any]) -> Figure | None:
    """The diagram, computed once the sliders rest; None without one, or where the settings are wrong.

    Raises PostponedError where a redraw waits.
    """
    try:
        view = View(solutions.subject, values)
    except Exception:  # noqa: BLE001  # `draw` tells of it
        return None
    if solutions.subject.section is None or "over" not in view.values:
        return None
    try:
        return diagram_figure(view, solutions.diagram(view), solutions.map(view))
    except PostponedError:
        raise
    except Exception as error:  # noqa: BLE001
        return {**empty(told(error)), "data": [here(view, None)]}


def summary(solution: Solution) -> str:
    """How the run ended, in a sentence or two."""
    number = len(solution.events)
    events = "1 event" if number == 1 else f"{number} events"
    end = f"t = {solution.t_end:.6g} in mode {mode_text(solution.end_mode)}, {events}."
    return f"Solved to {end}" if solution.success else f"Ended early at {end} {solution.message}"


def told(error: Exception) -> str:
    """An error as a sentence; a foreign one with its class name."""
    name = type(error).__name__
    text = str(error) or "no more is known"
    return text if name in ("ModelError", "UsageError", "SolveError") else f"{name}: {text}"
