"""What a system has to be for time stepping; everything else is refused by its name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from filippov.base.errors import UsageError
from filippov.model.size import cancelled
from filippov.model.surface import Surface
from filippov.model.symbolic import Contact, SymbolicForm
from filippov.model.system import System
from filippov.model.table import vanishes
from filippov.solving.stepping.unit import generated

# Options of `solve` that have a meaning for steps of one length.
MEANT = (
    "method", "dt", "theta", "max_steps", "max_events", "max_time", "dense_output", "save_events", "compile",
    "backend",
)  # fmt: skip
_EVENTS = "leave the method out, which finds every event."


def check_options(options: Mapping[str, Any], events: Any, backward: bool) -> None:
    """Refuse options that were given and mean nothing here."""
    odd = [name for name in options if name not in MEANT and not (name == "stop" and not options[name])]
    odd += ["events"] * (events is not None) + ["backward"] * backward
    if odd:
        raise UsageError(
            f"method 'Moreau' takes steps of one length and looks for no events: {', '.join(odd)} "
            f"mean{'s' if len(odd) == 1 else ''} nothing to it. It takes dt, theta and budgets."
        )


def check_fits(system: System) -> None:
    """Refuse a system that the scheme does not hold for."""
    form = system.symbolic
    if form is None:
        raise UsageError(
            "method 'Moreau' needs a system of expressions: that its field is affine in the signs is seen in "
            f"them, and of a plain function nobody knows. Write System({{x: v, v: ...}}), or {_EVENTS}"
        )
    if not generated(system).constants["AFFINE"]:
        raise UsageError(
            "method 'Moreau' needs a field that is affine in its signs; here signs multiply each other or "
            f"stand inside a function (a step would have several solutions). Write it as a sum, or {_EVENTS}"
        )
    if system.inputs:
        raise UsageError(f"method 'Moreau' knows no inputs ({system.inputs[0].name!r}): {_EVENTS}")
    if system.time_events:
        raise UsageError(f"method 'Moreau' knows no time events ({system.time_events[0].name!r}): {_EVENTS}")
    for i, surface in enumerate(system.surfaces):
        why = _unfit(form, surface, i)
        if why:
            raise UsageError(f"method 'Moreau': surface {surface.name!r} {why}; {_EVENTS}")


def _unfit(form: SymbolicForm, surface: Surface, i: int) -> str:
    if surface.width != 0:
        return "has a hysteresis: its sign follows from the past, not from a complementarity problem"
    if surface.reset is None:
        return ""
    contact = form.contact[i] if form.contact else None
    if surface.kind != "reset":
        return "jumps the state and switches the field as well"
    if contact is None:
        return "has a reset that is no impact at which the state may come to rest (see contact)"
    after = form.reset[i]
    assert after is not None
    if not _newtonian(form, contact, after):
        return "has a reset that does more than turn dh/dt round along the push of the surface (Newton's law)"
    return ""


def _newtonian(form: SymbolicForm, contact: Contact, after: tuple[sympy.Expr, ...]) -> bool:
    """Whether what the reset changes lies along the push, so that dh/dt after it says all."""
    if any(e.free_symbols & {*form.s, *form.a} for e in after):
        return False
    landed = contact.rate.subs(dict(zip(form.x, after, strict=True)), simultaneous=True)
    jump = landed - contact.rate
    rows = zip(after, form.x, contact.direction, strict=True)
    return all(_zero(e - x - d * jump) for e, x, d in rows)


def _zero(e: sympy.Expr) -> bool:
    return bool(vanishes(cancelled(e)))
