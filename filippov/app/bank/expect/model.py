"""What is expected of the model and not of one motion: a parameter at which it grazes, harmonic balance."""

from __future__ import annotations

import re
from typing import Any

from sympy import Symbol

from filippov.analysis.harmonic.describing_function import describing_function
from filippov.app.bank.build import build
from filippov.app.bank.motion import Motion
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import NotUnderstoodError
from filippov.base.errors import ModelError, UsageError
from filippov.base.status import EventKind

SETTLED = 0.75  # what of a doubled span counts as settled


@reads(
    r"(?P<name>\w+)_(?:grazing|graze|critical_grazing)|grazing_(?P<name2>\w+)",
    "value of a parameter that parts settled motions with events from those without: tried at value -+ tol",
)
def _grazing(ask: Ask, match: re.Match[str]) -> Any:
    name = match["name"] or match["name2"]
    value = float(ask.wanted())
    if name not in (ask.case.raw.get("params") or {}):
        raise NotUnderstoodError(f"the case has no parameter {name!r}")
    if ask.entry.tol == 0:
        raise NotUnderstoodError("it has no tolerance")
    sides = [_has_contact(ask, name, value + shift) for shift in (-ask.entry.tol, ask.entry.tol)]
    # Contact on one side only: the value lies between the two that were tried.
    if sides[0] != sides[1]:
        return Outcome(ask.entry.tol, ask.entry.tol)
    said = "contact" if sides[0] else "no contact"
    return Outcome(float("inf"), ask.entry.tol, f"{said} on both sides of {name} = {value:.9g}")


def _has_contact(ask: Ask, name: str, value: float) -> bool:
    raw = {**ask.case.raw, "params": {**ask.case.raw["params"], name: repr(value)}}
    motion = Motion(build(raw), ask.motion.settings, ask.motion.deadline)
    start, end = motion.built.t_span
    last = start + 2 * (end - start)
    run = motion.solve(t_end=last)
    ask.motion.field_calls += motion.field_calls
    after = start + SETTLED * (last - start)
    return any(e.t > after and e.kind is not EventKind.GRAZING for e in motion.events(run))


@reads(
    r"describing_function_(?P<what>period|frequency|amplitude)|harmonic_balance_(?P<what2>period|frequency|amplitude)",
    "what harmonic balance predicts for a limit cycle",
)
def _harmonic(ask: Ask, match: re.Match[str]) -> Any:
    try:
        found = describing_function(ask.motion.built.system)
    except (ModelError, UsageError) as error:
        raise NotUnderstoodError(str(error)) from None
    return Either([getattr(cycle, match["what"] or match["what2"]) for cycle in found.cycles])


@reads(r"\w+", "the name of a parameter: its value")
def _parameter(ask: Ask, _match: re.Match[str]) -> Any:
    names = ask.motion.built.names
    value = names.get(ask.entry.name, names.get(ask.entry.name + "_"))
    if value is None or isinstance(value, Symbol):
        raise NotUnderstoodError("no reader knows the name")
    return float(value)
