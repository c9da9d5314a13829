"""The files of a view: data, figures, the solution, and the Python that makes them."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np

from filippov.app.cli.solved import EVENT_COLUMNS, event_row
from filippov.app.explorer.solutions import ATOL, MOST_EVENTS, MOST_STEPS, RTOL, Solutions
from filippov.app.explorer.view import EXACT, View
from filippov.base.csv_text import csv_text
from filippov.base.errors import UsageError

UNNAMED = (
    "no view.py: the system is made of plain functions, or of what no file holds exactly, and the module of "
    "its field has no name for it. Write it there, system = System(field=...), or give the command "
    "filippov explore file.py:system."
)


def solution_csv(solutions: Solutions, view: View) -> str:
    """Time, states and outputs at the ends of the steps."""
    solution, names = solutions.exact(view), solutions.subject.quantities
    return csv_text(("t", *names), np.vstack([solution.t, *(solution[name] for name in names)]).T.tolist())


def events_csv(solutions: Solutions, view: View) -> str:
    """The events, as `filippov simulate` writes them."""
    rows = (event_row(event) for event in solutions.exact(view).events)
    return csv_text((*EVENT_COLUMNS, *solutions.subject.system.states), rows)


def map_csv(solutions: Solutions, view: View) -> str:
    """d and R(d) over the interval. Raises UsageError without a section."""
    found = solutions.map(view)
    if found is None:
        raise UsageError("the subject has no section, so it has no event map.")
    return csv_text(("d", "R"), zip(found.d.tolist(), found.image.tolist(), strict=True))


def diagram_csv(solutions: Solutions, view: View) -> str:
    """Iterates over the diagram's parameter. Raises UsageError without a section."""
    found = solutions.diagram(view)
    if found is None:
        raise UsageError("the subject has no section, so it has no diagram.")
    values, d = found
    rows = ((value, each) for value, row in zip(values.tolist(), d.tolist(), strict=True) for each in row)
    return csv_text((view["over"], "d"), rows)


def solution_png(solutions: Solutions, view: View) -> bytes:
    """The time response by matplotlib."""
    solution = solutions.exact(view)
    height = 1.0 + 1.55 * len(solutions.subject.quantities)
    return _picture(lambda figure: solution.plot(figure=figure), height)


def phase_png(solutions: Solutions, view: View) -> bytes:
    """The phase portrait by matplotlib. Raises UsageError for a system of one state."""
    from filippov.plot.solution import plot_phase

    solution = solutions.exact(view)
    return _picture(lambda figure: plot_phase(solution, view["x"], view["y"], figure=figure), 5.0)


def solution_npz(solutions: Solutions, view: View) -> bytes:
    """The solution with its system, for `Solution.load`."""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        return solutions.exact(view).save(Path(folder) / "solution.npz").read_bytes()


def script(solutions: Solutions, view: View) -> str:
    """Python that solves the view again and writes solution.csv and its pictures.

    Raises UsageError where no Python that makes the system is known.
    """
    subject = solutions.subject
    if not subject.origin:
        raise UsageError(UNNAMED)
    lines = [
        f"# {subject.name!r}, as the explorer showed it: {view.query or 'nothing changed'}",
        "import matplotlib", "import numpy as np", "", "from filippov import solve",
        *subject.origin.split("\n"), "", 'matplotlib.use("Agg")', f"parameters = {view.parameters!r}",
        f"budget = {{'max_steps': {MOST_STEPS}, 'max_events': {MOST_EVENTS}}}",
        f"x0, t_span = {view.x0!r}, {view.t_span!r}",
        "solution = solve(system, x0, t_span, parameters=parameters, **budget)", "print(solution.message)",
        f"columns = {('t', *subject.quantities)!r}",
        "rows = np.column_stack([solution[name] for name in columns])",
        "np.savetxt('solution.csv', rows, fmt='%.17g', delimiter=',', header=','.join(columns), comments='')",
        "solution.plot().savefig('solution.png')",
    ]  # fmt: skip
    if view["x"] != view["y"]:
        lines += ["", "from filippov.plot import plot_phase", "",
                  f"plot_phase(solution, {view['x']!r}, {view['y']!r}).savefig('phase.png')"]  # fmt: skip
    if view["against"] != EXACT:
        lines += [
            "", f"from filippov import {view['against']}", "",
            f"approximate = system.with_comparator({view['against']}({view['width']!r}))",
            "whole = [*x0, *[0] * (approximate.dimension - len(x0))]  # its own states begin at 0",
            "other = solve(approximate, whole, t_span, parameters=parameters, **budget)",
            "print(other.message)",
        ]  # fmt: skip
    section = subject.section
    if section is not None and subject.interval is None and "<" not in repr(section):
        lines += [
            "", f"from filippov.analysis import {type(section).__name__}, returns", "",
            f"section = {section!r}",
            f"print(returns(system, section, x0, 24, parameters=parameters, rtol={RTOL!r}).d)",
        ]  # fmt: skip
    given = getattr(section, "parametrisation", None)
    if isinstance(given, dict) and all(isinstance(text, str) for text in given.values()):
        lines += [
            "", "from filippov.analysis import EventMap, Section", "", f"section = {section!r}",
            f"options = {{'order': {view['order']}, 'rtol': {RTOL!r}, 'atol': {ATOL!r}}}",
            "event_map = EventMap(system, section, parameters=parameters, **options)",
            f"print(event_map.iterate({view['d']!r}, 24))",
        ]  # fmt: skip
    return "\n".join(lines) + "\n"


# The files of the page and of `filippov explore -o DIR`: name -> (function, type).
FILES: dict[str, tuple[Callable[[Solutions, View], str | bytes], str]] = {
    "view.py": (script, "text/x-python"), "solution.csv": (solution_csv, "text/csv"),
    "events.csv": (events_csv, "text/csv"), "map.csv": (map_csv, "text/csv"),
    "diagram.csv": (diagram_csv, "text/csv"), "solution.png": (solution_png, "image/png"),
    "phase.png": (phase_png, "image/png"), "solution.npz": (solution_npz, "application/octet-stream"),
}  # fmt: skip


def offered(solutions: Solutions, view: View) -> list[str]:
    """Names of the files that the view has."""
    subject = solutions.subject
    without = set() if subject.section is not None else {"map.csv", "diagram.csv"}
    without |= {"diagram.csv"} if "over" not in view.values else set()
    without |= {"view.py"} if not subject.origin else set()
    without |= {"phase.png"} if view["x"] == view["y"] else set()
    return [name for name in FILES if name not in without]


def _picture(draw: Callable[[Any], object], height: float) -> bytes:
    """A plot on a figure without a window, as PNG; safe in any thread."""
    from matplotlib.figure import Figure

    figure, out = Figure(figsize=(7.0, height), layout="constrained"), io.BytesIO()
    draw(figure)
    figure.savefig(out, format="png", dpi=160)
    return out.getvalue()
