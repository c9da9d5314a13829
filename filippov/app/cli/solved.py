"""For every command that solves: the solver's settings, a solution with its progress, events as data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from filippov import ModelError, Problem, Solution, UsageError, UserEvent, solve
from filippov.app.cli.console import Console
from filippov.base.status import Status, mode_text
from filippov.solving.state.events import Event, Stop
from filippov.solving.state.options import options_but

# The others are set by a command itself, or have a form of their own.
SOLVER = options_but("stop", "dense_output", "compile")
EVENT_COLUMNS = (
    "t", "surface", "kind", "before", "after", "direction", "multiplier", "residual", "group", "note",
)  # fmt: skip


def solved(problem: Problem, settings: Mapping[str, Any], console: Console, dense: bool) -> Solution:
    """The solution with the solver's settings; `dense` keeps what lies between the events, for files."""
    if settings.get("nonunique") == "branch":
        raise UsageError("--nonunique branch gives a tree of solutions; this command needs one solution.")
    events = [parse_root(text, problem) for text in settings.get("events") or ()]
    with console.progress("simulate") as progress:
        start = problem.t_span[0]
        solution: Solution = solve(
            problem, progress=lambda t, end: progress(abs(t - start), abs(end - start), f"t = {t:.6g}"),
            events=events or None, dense_output=dense, **solver_options(settings),
        )  # fmt: skip
    return solution


def solver_options(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What the settings say about the solver, as its keywords."""
    options = {name: settings[name] for name in SOLVER if settings.get(name) is not None}
    return options | {"stop": [parse_stop(text) for text in settings.get("stop") or ()]}


def exit_code(solution: Solution) -> int:
    """0 for a run that did what it was asked to do, 130 for an interrupted one, else 1."""
    if solution.status is Status.INTERRUPTED:
        return 130
    return 0 if solution.success else 1


def parse_stop(text: str) -> Stop:
    """SURFACE, SURFACE:KIND or SURFACE:KIND:COUNT."""
    surface, *rest = (piece.strip() for piece in text.split(":"))
    if len(rest) > 2 or (len(rest) == 2 and not rest[1].isdecimal()):
        raise UsageError(f"--stop is {text!r}, expected SURFACE, SURFACE:KIND or SURFACE:KIND:COUNT.")
    kind = rest[0] if rest else "crossing"
    return Stop(surface, kind, int(rest[1]) if len(rest) == 2 else 1)


def parse_root(text: str, problem: Problem) -> UserEvent:
    """FORMULA, FORMULA:DIRECTION or FORMULA:DIRECTION:COUNT."""
    formula, *rest = (piece.strip() for piece in text.split(":"))
    directions = {"up": 1.0, "down": -1.0, "both": 0.0}
    way = rest[0] if rest else "both"
    if len(rest) > 2 or way not in directions or (len(rest) == 2 and not rest[1].isdecimal()):
        raise UsageError(
            f"--events is {text!r}, expected FORMULA, FORMULA:DIRECTION or FORMULA:DIRECTION:COUNT with the "
            "directions up, down or both."
        )
    form = problem.system.symbolic
    if form is None:
        raise UsageError("--events needs a model of formulas; with functions use solve(..., events=g).")
    from filippov.model.expression import parse_expression

    try:
        g = parse_expression(formula, {symbol.name: symbol for symbol in (*form.x, *form.p)})
    except ModelError as error:
        raise UsageError(f"--events: {error}") from None
    count = int(rest[1]) if len(rest) == 2 else 0
    return UserEvent(g, terminal=count, direction=directions[way], name=formula)


def event_data(event: Event, states: tuple[str, ...]) -> dict[str, Any]:
    """One event by name; x holds the state, x_after the one after a reset."""
    data = dict(zip(EVENT_COLUMNS, event_row(event), strict=False))
    data["x"] = dict(zip(states, event.x.tolist(), strict=True))
    if event.x_after is not None:
        data["x_after"] = dict(zip(states, event.x_after.tolist(), strict=True))
    return data


def event_row(event: Event) -> list[Any]:
    """An event in the order of EVENT_COLUMNS, its state behind them."""
    return [
        float(event.t), event.surface, str(event.kind), mode_text(event.before), mode_text(event.after),
        int(event.direction), float(event.multiplier), float(event.residual), int(event.group), event.note,
        *event.x.tolist(),
    ]  # fmt: skip
