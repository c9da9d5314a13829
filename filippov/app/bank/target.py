"""What is asked of every solver: quantities of the state that a case gives at known times."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Float

from filippov.app.bank.build import Built
from filippov.app.bank.case import Case, Expectation, number
from filippov.app.bank.part import part, part_of
from filippov.app.bank.reason import NotUnderstoodError
from filippov.base.errors import ModelError
from filippov.model.symbols import t as time_symbol

Array = npt.NDArray[np.float64]
_AT = re.compile(r"(?P<state>\w+)(?:_at_|\()(?P<time>[^()\[\]=]+(?:\([^()]*\))?)\)?")
_AT_EACH = re.compile(r"(?P<state>\w+)_at_\[(?P<times>[^\[\]]+)\]")


@dataclass(frozen=True)
class Target:
    """Quantities (formulas in t and the states) with their values at a time."""

    t: float
    what: tuple[Expr, ...]
    values: tuple[float, ...]

    def gaps(self, built: Built, x: Array) -> Array:
        """The differences at a state."""
        found = sympy.lambdify([time_symbol, *built.states], list(self.what), "numpy")(self.t, *x)
        gaps: Array = np.abs(np.asarray(found, dtype=float) - np.asarray(self.values))
        return gaps


def whole_and_parts(case: Case) -> list[Case]:
    """The case, or, where it has labelled parts, each of them as a case of its own, "ID LABEL"."""
    if not case.raw.get("parts"):
        return [case]
    found: dict[str, list[Expectation]] = {}
    for entry in case.expected:
        try:
            label, inner = part_of(case, entry)
        except NotUnderstoodError:
            continue
        found.setdefault(label or entry.name.partition("_")[0], []).append(
            inner if label else _unlabelled(entry)
        )
    return [_alone(case, label, entries) for label, entries in found.items()]


def _unlabelled(entry: Expectation) -> Expectation:
    name = entry.name.partition("_")[2] if re.match(r"[A-Z]\d+_", entry.name) else entry.name
    return Expectation(name, entry.value, entry.tol, entry.fields)


def _alone(case: Case, label: str, entries: list[Expectation]) -> Case:
    one = part(case, label) if label in case.raw["parts"] else case
    raw: dict[str, Any] = {k: v for k, v in one.raw.items() if k not in ("parts", "more")}
    raw["id"] = f"{case.id} {label}"
    raw["expected"] = [{**e.fields, "name": e.name, "value": e.value, "tol": e.tol} for e in entries]
    return Case(raw["id"], raw, tuple(entries))


def targets(case: Case, built: Built) -> tuple[Target, ...]:
    """States at a time; the switching function at switches that are known; all of them where they all end."""
    found: list[Target] = []
    for entry in case.expected:
        try:
            found += _of(case, entry, built)
        except ModelError:
            continue
    return tuple(target for target in found if target.t > built.t_span[0])


def _of(case: Case, entry: Expectation, built: Built) -> list[Target]:
    end, names = built.t_span[1], {**built.names, "t": Float(built.t_span[1])}
    named = {s.name: s.h for s in built.system.surfaces}
    h = tuple(named[name] for name in built.declared if name in named)
    at, each = _AT.fullmatch(entry.name), _AT_EACH.fullmatch(entry.name)
    states = built.system.states
    if entry.name in ("final_state", "final"):
        return [_state(built, "state", number(entry.fields.get("t", end), names), entry.value)]
    if each is not None and each["state"] in states and isinstance(entry.value, list):
        times = [number(text, names) for text in each["times"].split(",")]
        return [_state(built, each["state"], t, x) for t, x in zip(times, entry.value, strict=True)]
    if entry.name == "point_first_crossing":
        first = case.expectation("t_first_crossing")
        return [] if first is None else [_state(built, "state", number(first.value, names), entry.value)]
    if entry.name == "t_converge":
        return [Target(number(entry.value, names), h, (0.0,) * len(h))]
    if entry.name == "switch_times" and len(h) == 1 and isinstance(entry.value, list):
        return [Target(number(value, names), h, (0.0,)) for value in entry.value]
    if at is not None and at["state"] in (*states, "state", "x", "y"):
        return [_state(built, at["state"], number(at["time"], names), entry.value)]
    return []


def _state(built: Built, name: str, t: float, value: Any) -> Target:
    """A state by name, or all states, or the first ones where fewer values are given."""
    names = {**built.names, "t": Float(t)}
    values = tuple(number(v, names) for v in (value if isinstance(value, list) else [value]))
    alone = len(values) == 1 and name in built.system.states
    what = [built.states[built.system.states.index(name)]] if alone else built.states[: len(values)]
    return Target(t, tuple(what), values)
