"""Hybrid texts that are regular enough to be read: a flow with a reset, a two-state automaton.

    flow x'=v, v'=-9.8; guard x=0, v<0; reset v->-0.9 v
    on: T'=-(T-18)/10+2 until 23.5; off: T'=-(T-18)/10 until 22; starts in off

The first becomes a smooth field with a surface that resets; the second an automaton. Anything else stays as
it is, and the case has to give h and fields.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from filippov.app.bank.notation import strict
from filippov.base.errors import ModelError

_OTHERS = ("fields", "smooth_field", "automaton")
_DERIVATIVE = re.compile(r"^\s*(?:d?(\w+)'|d(\w+)/dt)\s*=\s*(.+?)\s*$")
_AUTOMATON = re.compile(r"^\s*(?P<name>\w+)\s*:\s*(?P<flow>.+?)\s+until\s+(?P<until>.+?)\s*$")
_BEGIN = re.compile(
    r"^\s*(?:(?:it )?(?:starts?|begins?)(?: in| with)?|initially|initial mode:?) (?P<name>\w+)\s*$"
)
_SIDE = re.compile(r"^\s*(?P<state>\w+)\s*(?P<relation>[<>]=?|=)\s*(?P<value>.+?)\s*$")


def written_out(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The case with h and fields, or an automaton, from its hybrid text, if that can be read."""
    text = raw.get("hybrid")
    if not isinstance(text, str) or any(raw.get(key) is not None for key in _OTHERS):
        return dict(raw)
    states = [str(name) for name in raw.get("states") or ()]
    clauses = [clause.strip() for clause in text.split(";") if clause.strip()]
    for read in (_automaton, _flow):
        with suppress(ModelError):
            if (found := read(clauses, states)) is not None:
                return {**{key: value for key, value in raw.items() if key != "hybrid"}, **found}
    return dict(raw)


def _automaton(clauses: list[str], states: list[str]) -> dict[str, Any] | None:
    *clauses, last = clauses
    begin = _BEGIN.match(last)
    if begin is None:
        clauses.append(last)
    parts = [match for match in map(_AUTOMATON.match, clauses) if match]
    if not len(parts) == len(clauses) == 2 or not states:
        return None
    if begin is not None:
        # The first mode is the one that the solution begins in.
        parts.sort(key=lambda part: part["name"] != begin["name"])
        if parts[0]["name"] != begin["name"]:
            return None
    bounds = [_SIDE.match(part["until"]) for part in parts]
    where = [states[0], *(bound["state"] for bound in bounds if bound)][-1]
    if where not in states:
        return None
    levels = [b["value"] if b else part["until"] for part, b in zip(parts, bounds, strict=True)]
    return {"automaton": [
        {"name": p["name"], "field": _field(p["flow"], states), "until": {where: strict(level, states)}}
        for p, level in zip(parts, levels, strict=True)
    ]}  # fmt: skip


def _flow(clauses: list[str], states: list[str]) -> dict[str, Any] | None:
    said = dict(clause.split(None, 1) for clause in clauses if " " in clause)
    if set(said) != {"flow", "guard", "reset"}:
        return None
    surface, side = "", None
    for condition in said["guard"].split(","):
        match = _SIDE.match(condition)
        if match is None:
            return None
        if match["relation"] == "=":
            surface = f"{match['state']}-({strict(match['value'], states)})"
            # The guard is reached from above where it is a falling one.
            side = side or "+"
        elif match["relation"].startswith(">"):
            side = "-"
    resets = {}
    for change in said["reset"].split(","):
        name, arrow, value = change.partition("->")
        if not arrow or name.strip() not in states:
            return None
        resets[name.strip()] = strict(value, states)
    if not surface:
        return None
    return {
        "h": [{"h": surface, "reset": resets, "side": side}],
        "fields": {"*": _field(said["flow"], states)},
    }


def _field(text: str, states: list[str]) -> list[str]:
    found: dict[str, str] = {}
    for piece in text.split(","):
        match = _DERIVATIVE.match(piece)
        if match is None:
            raise ModelError(f"{piece!r} is not an equation such as x'=v.")
        found[match[1] or match[2]] = strict(match[3], states)
    if set(found) != set(states):
        raise ModelError(f"equations are given for {', '.join(found)}, the states are {', '.join(states)}.")
    return [found[name] for name in states]
