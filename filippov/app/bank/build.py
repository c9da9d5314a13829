"""From a case's texts to a System, by the safe expression reader."""

from __future__ import annotations

import dataclasses
import itertools
import keyword
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Expr, Symbol

from filippov.app.bank.notation import formula, number
from filippov.base.errors import ModelError
from filippov.base.names import check_known, check_name
from filippov.model.extract import NONSMOOTH
from filippov.model.parameter_symbol import parameters
from filippov.model.size import Scale
from filippov.model.surface import Surface
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.solving.state.options import Options

SURFACE_KEYS = ("name", "h", "radius", "width", "kind", "reset", "side", "contact")
TIME_EVENT_KEYS = ("name", "period", "start", "times", "reset")
NUMBERS = ("rtol", "atol", "first_step", "max_step", "max_steps", "max_events")
OPTIONS = (*NUMBERS, "method", "nonunique", "zeno", "simultaneous", "sliding")
MOST_SURFACES = 12
# The most surfaces, with those in formulas (Abs, sign, Max ...), and the most nodes of all fields together.
MOST_KINKS, MOST_NODES = 64, 40_000
_WORD = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True)
class Built:
    """A case as a problem: the system, its start and span, and the meaning of its names.

    declared   names of the surfaces in the order of `h` and `event_functions`, then of the time events; kinks
               have others
    fields     vertex fields by sign vector, as expressions
    options    options of the solver that the case gives
    raw        the case
    """

    system: System
    x0: tuple[float, ...]
    t_span: tuple[float, float]
    names: Mapping[str, Any]
    declared: tuple[str, ...]
    fields: Mapping[str, Sequence[Expr]]
    options: Mapping[str, Any]
    raw: Mapping[str, Any]

    @property
    def states(self) -> list[Symbol]:
        """The symbols of the states, in order."""
        return [self.names[name] for name in self.system.states]

    def start(self, name: str, value: float) -> tuple[tuple[float, ...], tuple[float, float]]:
        """x0 and t_span with another value of a parameter."""
        return _start(self.raw, _names(self.raw, self.states, {name: value}), len(self.states))


def build(raw: Mapping[str, Any], free: str = "") -> Built:
    """The problem of a case; `free` names a parameter that remains one of the system.

    Raises ModelError with what is missing or wrong.
    """
    if raw.get("wrong"):
        raise ModelError(str(raw["wrong"]))
    raw = _without_keywords(_automaton(raw))
    states = _states(raw)
    names = values = _names(raw, states)
    options: dict[str, Any] = {}
    if free:
        check_known("parameter", [free], raw.get("params") or {})
        options["parameters"] = space = parameters(**{free: float(values[free])})
        names = _names(raw, states, {free: getattr(space, free)})
    surfaces = [_surface(entry, f"h{i}", names) for i, entry in enumerate(_list(raw, "h"))]
    count = len(surfaces)
    observers = [
        dataclasses.replace(_surface(entry, f"h{count + i}", names), kind="observer")
        for i, entry in enumerate(_list(raw, "event_functions"))
    ]
    fields = _fields(raw, names, count, len(states))
    _check_size(fields)
    every = [*surfaces, *observers]
    options |= _time_events(raw, names)
    if every:
        wide = {signs + "*" * len(observers): row for signs, row in fields.items()}
        system = System.from_modes(every, wide, states, **options)
    else:
        system = System(dict(zip(states, fields[""], strict=True)), **options)
    if len(system.surfaces) > MOST_KINKS:
        raise ModelError(
            f"the formulas jump or bend on {len(system.surfaces)} surfaces, expected at most {MOST_KINKS}."
        )
    x0, span = _start(raw, values, len(states))
    declared = (*(s.name for s in every), *(event.name for event in system.time_events))
    return Built(system, x0, span, values, declared, fields, _options(raw, values), raw)


def _names(
    raw: Mapping[str, Any], states: Sequence[Symbol], put: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The meaning of states and parameters; `put` replaces values of the case."""
    names: dict[str, Any] = {symbol.name: symbol for symbol in states}
    for key, value in (raw.get("params") or {}).items():
        name = check_name(key, "parameter")
        names[name] = put[name] if put and name in put else expression(value, names)
    return names


def _automaton(raw: Mapping[str, Any]) -> dict[str, Any]:
    """A two-mode automaton as a relay with hysteresis between its two thresholds."""
    modes = raw.get("automaton")
    if modes is None:
        return dict(raw)
    if raw.get("h") or raw.get("fields"):
        raise ModelError("a case has an automaton or h and fields, not both.")
    said = "expected two modes {name, field, until: {state: threshold}}, one state for both."
    if not isinstance(modes, Sequence) or len(modes) != 2 or not all(isinstance(m, Mapping) for m in modes):
        raise ModelError(f"automaton is {modes!r:.60}, {said}")
    for mode in modes:
        check_known("key of a mode:", mode, ("name", "field", "until"))
    until = [mode.get("until") for mode in modes]
    if not all(isinstance(u, Mapping) and len(u) == 1 for u in until) or set(until[0]) != set(until[1]):
        raise ModelError(f"until is {until!r:.60}, {said}")
    (where,) = until[0]
    first, second = (f"({u[where]})" for u in until)
    # The mode that lasts until the upper threshold is the one below it.
    params = {key: number(value, {}) for key, value in (raw.get("params") or {}).items()}
    upper = number(first, params) > number(second, params)
    low, high = (mode.get("field") for mode in (modes if upper else modes[::-1]))
    half = f"({first}-{second})/2" if upper else f"({second}-{first})/2"
    surface = {"h": f"{where}-({first}+{second})/2", "width": half}
    return {**raw, "h": [surface], "fields": {"-": low, "+": high}}


def _options(raw: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """The case's options of the solver, checked. Raises ModelError, UsageError."""
    given = raw.get("options") or {}
    if not isinstance(given, Mapping):
        raise ModelError(f"options are {given!r:.60}, expected an object.")
    check_known("option", given, OPTIONS)
    found: dict[str, Any] = {key: number(v, names) if key in NUMBERS else v for key, v in given.items()}
    found |= {key: int(found[key]) for key in ("max_steps", "max_events") if key in found}
    Options(**found)
    return found


def expression(value: Any, names: Mapping[str, Any]) -> Expr:
    """A number or a formula as an expression, in loose notation too."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ModelError(f"{value!r:.80} is not a number or a formula.")
    return formula(value if isinstance(value, str) else repr(value), names)


def _check_size(fields: Mapping[str, Sequence[Expr]]) -> None:
    """Refuse fields that would take minutes to compile; equal rows count once."""
    scale = Scale()
    rows = {id(row): row for row in fields.values()}.values()
    nodes = sum(scale.weigh(e)[0] for row in rows for e in row)
    if nodes > MOST_NODES:
        raise ModelError(f"the fields have {nodes} nodes together, expected at most {MOST_NODES}.")
    kinks = set().union(*(e.atoms(*NONSMOOTH) for row in rows for e in row))
    if len(kinks) > MOST_KINKS:
        raise ModelError(
            f"the fields hold {len(kinks)} different functions that jump or bend, expected at most "
            f"{MOST_KINKS}."
        )


def _states(raw: Mapping[str, Any]) -> list[Symbol]:
    given = raw.get("states")
    if isinstance(given, str):
        given = given.replace(",", " ").split()
    if not isinstance(given, Sequence) or not given:
        raise ModelError(f"states are {given!r:.60}, expected a list of names.")
    return [Symbol(check_name(name, "state"), real=True) for name in given]


def _list(raw: Mapping[str, Any], key: str) -> Sequence[Any]:
    value = raw.get(key)
    if value is None:
        return []
    value = [value] if isinstance(value, str | Mapping) else value
    if not isinstance(value, Sequence) or len(value) > MOST_SURFACES:
        raise ModelError(f"{key} is {value!r:.60}, expected a list of at most {MOST_SURFACES} entries.")
    return value


def _surface(entry: Any, name: str, names: Mapping[str, Any]) -> Surface:
    if not isinstance(entry, Mapping):
        return Surface(name, expression(entry, names))
    check_known(f"key of surface {name}:", entry, SURFACE_KEYS)
    given: dict[str, Any] = {"name": str(entry.get("name", name)), "h": expression(entry.get("h"), names)}
    if "radius" in entry:
        value = entry["radius"]
        pair = isinstance(value, Sequence) and not isinstance(value, str)
        given["radius"] = tuple(expression(v, names) for v in value) if pair else expression(value, names)
    if "width" in entry:
        given["width"] = number(entry["width"], names)
    for key in ("kind", "side", "contact"):
        if key in entry:
            given[key] = entry[key]
    if "reset" in entry:
        given["reset"] = _reset(entry["reset"], f"surface {name}", names)
    return Surface(**given)


def _time_events(raw: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    given = raw.get("time_events")
    if not given:
        return {}
    entries = [given] if isinstance(given, Mapping) else given
    if not isinstance(entries, Sequence) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ModelError(f"time_events is {given!r:.60}, expected a list of objects.")
    return {"time_events": [_time_event(entry, f"clock{i}", names) for i, entry in enumerate(entries)]}


def _time_event(entry: Mapping[str, Any], name: str, names: Mapping[str, Any]) -> TimeEvent:
    check_known(f"key of time event {name}:", entry, TIME_EVENT_KEYS)
    given: dict[str, Any] = {"name": str(entry.get("name", name))}
    for key in ("period", "start"):
        if key in entry:
            given[key] = number(entry[key], names)
    if "times" in entry:
        times = entry["times"]
        if isinstance(times, str) or not isinstance(times, Sequence):
            raise ModelError(f"times of time event {name} is {times!r:.60}, expected a list.")
        given["times"] = [number(value, names) for value in times]
    if "reset" in entry:
        given["reset"] = _reset(entry["reset"], f"time event {name}", names)
    return TimeEvent(**given)


def _reset(entry: Any, where: str, names: Mapping[str, Any]) -> dict[Any, Any]:
    if not isinstance(entry, Mapping):
        raise ModelError(f"reset of {where} is {entry!r:.60}, expected {{state: formula}}.")
    check_known(f"state in the reset of {where}:", entry, names)
    return {names[key]: expression(value, names) for key, value in entry.items()}


def _fields(raw: Mapping[str, Any], names: Mapping[str, Any], count: int, n: int) -> dict[str, list[Expr]]:
    """The vertex fields; missing sign vectors take the nearest one given."""
    given = raw.get("fields")
    if given is None and raw.get("smooth_field") is not None:
        given = {"*" * count: raw["smooth_field"]}
    if isinstance(given, Sequence) and not isinstance(given, str):
        given = {"*" * count: given}
    if not isinstance(given, Mapping) or not given:
        prose = "; its `hybrid` text is prose that is not understood" if raw.get("hybrid") else ""
        near = [key for key in raw if key not in ("fields", "smooth_field") and "field" in key.casefold()]
        hint = f" (did you mean 'fields' by {near[0]!r}?)" if near else ""
        raise ModelError(f"the case has no fields{prose}{hint}: give h and fields, or smooth_field.")
    out: dict[str, list[Expr]] = {}
    for signs, entry in given.items():
        row = [entry] if isinstance(entry, str | int | float) else entry
        if not isinstance(row, Sequence) or len(row) != n:
            raise ModelError(f"field {signs!r} is {row!r:.60}, expected {n} formulas, one per state.")
        if len(signs) != count or set(signs) - set("+-*"):
            raise ModelError(f"fields has the sign vector {signs!r}, expected {count} of '+', '-' or '*'.")
        out[signs] = [expression(value, names) for value in row]
    return _complete(out, count)


def _complete(given: dict[str, list[Expr]], count: int) -> dict[str, list[Expr]]:
    out: dict[str, list[Expr]] = {}
    for letters in itertools.product("+-", repeat=count):
        signs = "".join(letters)
        nearest = min(given, key=lambda k: sum(a not in (b, "*") for a, b in zip(k, signs, strict=True)))
        out[signs] = given[nearest]
    return out


def _start(raw: Mapping[str, Any], names: Mapping[str, Any], n: int) -> tuple[tuple[float, ...], Any]:
    x0, span = raw.get("x0"), raw.get("t_span")
    if isinstance(x0, Mapping):
        x0 = [x0.get(name) for name in list(names)[:n]]
    x0 = [x0] if isinstance(x0, str | int | float) else x0
    if not isinstance(x0, Sequence) or len(x0) != n:
        raise ModelError(f"x0 is {x0!r:.60}, expected {n} numbers, one per state.")
    if span is None:
        raise ModelError("t_span is missing, expected [t0, t1].")
    span = [0, span] if isinstance(span, str | int | float) else span
    if not isinstance(span, Sequence) or len(span) != 2:
        raise ModelError(f"t_span is {span!r:.60}, expected two numbers.")
    start, end = (number(value, names) for value in span)
    return tuple(number(value, names) for value in x0), (start, end)


def _without_keywords(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Reserved words of Python, such as lambda, get an underscore wherever they occur."""

    def rename(value: Any) -> Any:
        if isinstance(value, str):
            return _WORD.sub(
                lambda m: m[0] + "_" if keyword.iskeyword(m[0]) and m[0].islower() else m[0], value
            )
        if isinstance(value, Mapping):
            return {rename(key): rename(item) for key, item in value.items()}
        return [rename(item) for item in value] if isinstance(value, list | tuple) else value

    parts = (
        "states", "params", "h", "fields", "smooth_field", "event_functions", "x0", "t_span", "time_events",
        "options",
    )  # fmt: skip
    return {key: rename(value) if key in parts else value for key, value in raw.items()}
