"""A system as plain data for people to read: formulas as text, numbers as numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sympy import Symbol

from filippov.base.symbolic_value import is_expression
from filippov.model.symbolic import SymbolicForm
from filippov.model.system import System

FUNCTION = "a function"


def field_data(system: System) -> dict[str, str] | None:
    """The right-hand side by state, None for a function."""
    form = system.symbolic
    if form is None:
        return None
    return {name: _readable(f, form) for name, f in zip(system.states, form.field, strict=True)}


def surface_data(system: System, i: int) -> dict[str, Any]:
    """A surface: h, its set at h = 0, the width of its hysteresis, and its reset."""
    surface, form = system.surfaces[i], system.symbolic
    h, width = None if form is None else form.h[i], surface.width
    if form is not None and form.widths and form.widths[i] is not None:
        h, width = form.h[i] * form.widths[i], form.widths[i]
    return {
        "name": surface.name,
        "kind": str(surface.kind),
        "h": None if form is None else _readable(h, form),
        "radius": [_value(bound, form) for bound in (surface.radius if form is None else form.radius[i])],
        "width": _value(width, form),
        "reset": _reset(surface.reset),
        "side": None if surface.reset is None else surface.side,
        "contact": None if surface.reset is None else bool(surface.contact),
    }


def clock_data(system: System) -> list[dict[str, Any]]:
    """The events at known times: start and period, or times; and their resets."""
    out = []
    for event in system.time_events:
        values = [_value(q, system.symbolic) for q in event.instants]
        when = {"start": values[0], "period": values[1]} if event.times is None else {"times": values}
        out.append({"name": event.name, **when, "reset": _reset(event.reset)})
    return out


def surface_lines(surface: Mapping[str, Any]) -> list[str]:
    """What `surface_data` gives, as lines of text; what says nothing is left out."""
    h = f"  h = {surface['h']}" if surface["h"] is not None else ""
    lines = [f"surface {surface['name']} ({surface['kind']}){h}"]
    low, high = surface["radius"]
    if (low, high) != (-1.0, 1.0):
        lines.append(f"  set at h = 0: [{_text(low)}, {_text(high)}]")
    if surface["width"] != 0.0:
        lines.append(f"  hysteresis: the sign s is left at h = -s width, width = {_text(surface['width'])}")
    if surface["reset"] is not None:
        side = "from either side" if surface["side"] == "both" else f"from the side {surface['side']}"
        rest = ", may come to rest on it" if surface["contact"] else ""
        lines.append(f"  reset {side}{rest}: {_reset_text(surface['reset'])}")
    return lines


def clock_line(clock: Mapping[str, Any]) -> str:
    """What `clock_data` gives of one, as text."""
    if "times" in clock:
        when = "at t = " + ", ".join(map(_text, clock["times"]))
    else:
        when = f"every {_text(clock['period'])} from t = {_text(clock['start'])}"
    reset = "" if clock["reset"] is None else f": {_reset_text(clock['reset'])}"
    return f"time event {clock['name']} {when}{reset}"


def _readable(expression: Any, form: SymbolicForm) -> str:
    """A formula with sign(h) and |h| in place of the symbols that stand for them."""
    names: dict[Any, Any] = {}
    for s, a, h in zip(form.s, form.a, form.h, strict=True):
        text = str(h.xreplace(names))
        names |= {s: Symbol(f"sign({text})"), a: Symbol(f"|{text}|")}
    return str(expression.xreplace(names))


def _value(value: Any, form: SymbolicForm | None) -> float | str:
    if is_expression(value):
        if value.is_number:
            return float(value)
        return str(value) if form is None else _readable(value, form)
    return FUNCTION if callable(value) else float(value)


def _reset(reset: Any) -> dict[str, str] | str | None:
    if reset is None or callable(reset):
        return None if reset is None else FUNCTION
    return {name: str(after) for name, after in reset}


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _reset_text(reset: Mapping[str, str] | str) -> str:
    if isinstance(reset, str):
        return f"x+ = {reset}"
    return ", ".join(f"{name}+ = {after}" for name, after in reset.items())
