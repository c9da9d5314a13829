"""From a case's texts to a System, by the safe expression reader."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Expr, Symbol

from filippov import ModelError, Surface, System, TimeEvent, parameters
from filippov.app.bank.notation import formula, number, words
from filippov.app.bank.system_form import SurfaceForm, SystemForm, TimeEventForm, read_system
from filippov.base.names import check_known, check_name
from filippov.model.extract import NONSMOOTH
from filippov.model.size import Scale
from filippov.solving.state.options import Options

NUMBERS = ("rtol", "atol", "first_step", "max_step", "max_steps", "max_events")
OPTIONS = (*NUMBERS, "method", "nonunique", "zeno", "simultaneous", "sliding")
MOST_SURFACES = 12
# The steepest exponent in place of the h of a relay: its slope at the flat end is still 0.003.
STEEPEST = 4.0
# The most surfaces, with those in formulas (Abs, sign, Max ...), and the most nodes of all fields together.
MOST_KINKS, MOST_NODES = 64, 40_000


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
        form = read_system(self.raw)
        return _start(form, _names(form, self.states, {name: value}), len(self.states))


def build(raw: Mapping[str, Any], free: str = "") -> Built:
    """The problem of a case; `free` names a parameter that remains one of the system.

    Raises ModelError with what is missing or wrong.
    """
    if raw.get("wrong"):
        raise ModelError(str(raw["wrong"]))
    form = _as_relay(read_system(raw))
    if not form.states:
        raise ModelError(f"states are {raw.get('states')!r:.60}, expected a list of names.")
    states = [Symbol(check_name(name, "state"), real=True) for name in form.states]
    names = values = _names(form, states)
    options: dict[str, Any] = {}
    if free:
        check_known("parameter", [free], form.params or {})
        options["parameters"] = space = parameters(**{free: float(values[free])})
        names = _names(form, states, {free: getattr(space, free)})
    h, functions = form.h or (), form.event_functions or ()
    if max(len(h), len(functions)) > MOST_SURFACES:
        found = f"{len(h)} h and {len(functions)} event_functions"
        raise ModelError(f"the case has {found}, expected at most {MOST_SURFACES} of each.")
    entries = [entry if isinstance(entry, SurfaceForm) else SurfaceForm(entry) for entry in (*h, *functions)]
    every = [Surface(**_given(entry, "surface", f"h{i}", names)) for i, entry in enumerate(entries)]
    every[len(h) :] = [dataclasses.replace(surface, kind="observer") for surface in every[len(h) :]]
    fields = _fields(form, raw, names, len(states))
    _check_size(fields)
    if form.time_events:
        options["time_events"] = [
            TimeEvent(**_given(entry, "time event", f"clock{i}", names))
            for i, entry in enumerate(form.time_events)
        ]
    if every:
        wide = {signs + "*" * len(functions): row for signs, row in fields.items()}
        system = System.from_modes(every, wide, states, **options)
    else:
        system = System(dict(zip(states, fields[""], strict=True)), **options)
    if (count := len(system.surfaces)) > MOST_KINKS:
        raise ModelError(f"the formulas jump or bend on {count} surfaces, expected at most {MOST_KINKS}.")
    x0, span = _start(form, values, len(states))
    declared = (*(s.name for s in every), *(event.name for event in system.time_events))
    return Built(system, x0, span, values, declared, fields, _options(form, values), raw)


def _names(
    form: SystemForm, states: Sequence[Symbol], put: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The meaning of states and parameters, these in any order; `put` replaces values of the case."""
    names: dict[str, Any] = {symbol.name: symbol for symbol in states}
    left = {check_name(key, "parameter"): value for key, value in (form.params or {}).items()}
    for name in [name for name in left if put and name in put]:
        names[name] = (put or {})[name]
        del left[name]
    while left:
        # Those that hold none of the others; where there are none, the first one says what is unknown.
        ready = [name for name, value in left.items() if left.keys().isdisjoint({*words(value)} - {name})]
        for name in ready or list(left)[:1]:
            names[name] = formula(left.pop(name), names)
    return names


def _as_relay(form: SystemForm) -> SystemForm:
    """A two-mode automaton as a relay with hysteresis between its two thresholds."""
    if form.automaton is None:
        return form
    if form.h or form.fields:
        raise ModelError("a case has an automaton or h and fields, not both.")
    until = [mode.until for mode in form.automaton]
    if len(until[0]) != 1 or set(until[0]) != set(until[1]):
        raise ModelError(f"until is {until!r:.60}, expected {{state: threshold}}, one state for both modes.")
    (where,) = until[0]
    first, second = (f"({u[where]})" for u in until)
    # The mode that lasts until the upper threshold is the one below it.
    params = _names(form, ())
    upper = number(first, params) > number(second, params)
    low, high = (mode.field for mode in (form.automaton if upper else form.automaton[::-1]))
    half = f"({first}-{second})/2" if upper else f"({second}-{first})/2"
    surface = SurfaceForm(f"{where}-({first}+{second})/2", width=half)
    states, x0 = form.states or (), form.x0 or ()
    if where in states and len(x0) == len(states):
        middle, width = number(f"({first}+{second})/2", params), number(half, params)
        inside = (number(x0[states.index(where)], params) - middle) / width
        if abs(inside) < 1 and inside * (-1 if upper else 1) < 1e-6:
            surface = SurfaceForm(_bent(f"(({where})-({first}+{second})/2)/({half})", inside, upper), width=1)
    return dataclasses.replace(form, h=(surface,), fields={"-": low, "+": high})


def _bent(h: str, inside: float, below: bool) -> str:
    """A growing function of h that is -1 and 1 where h is, with h = `inside` on the side of the first mode.

    Between its thresholds a relay begins with the sign of h, an automaton in its first mode. The function is
    (exp(a h) - cosh a)/sinh a, zero at h = log(cosh a)/a > 1 - log(2)/a for a > 0; -a mirrors it.
    Raises ModelError.
    """
    a = (1 if below else -1) * 1.2 * math.log(2) / (1 - abs(inside))
    if abs(a) > STEEPEST:
        raise ModelError(
            "the automaton begins near to the threshold that ends its first mode: start it farther from it, "
            "or in the other mode."
        )
    return f"(exp({a!r}*({h}))-cosh({a!r}))/sinh({a!r})"


def _options(form: SystemForm, names: Mapping[str, Any]) -> dict[str, Any]:
    """The case's options of the solver, checked. Raises ModelError, UsageError."""
    given = form.options or {}
    check_known("option", given, OPTIONS)
    found: dict[str, Any] = {key: number(v, names) if key in NUMBERS else v for key, v in given.items()}
    found |= {key: int(found[key]) for key in ("max_steps", "max_events") if key in found}
    Options(**found)
    return found


def _check_size(fields: Mapping[str, Sequence[Expr]]) -> None:
    """Refuse fields that would take minutes to compile; equal rows count once."""
    scale = Scale()
    rows = {id(row): row for row in fields.values()}.values()
    nodes = sum(scale.weigh(e)[0] for row in rows for e in row)
    if nodes > MOST_NODES:
        raise ModelError(f"the fields have {nodes} nodes together, expected at most {MOST_NODES}.")
    kinks = len(set().union(*(e.atoms(*NONSMOOTH) for row in rows for e in row)))
    if kinks > MOST_KINKS:
        found = f"the fields hold {kinks} different functions that jump or bend"
        raise ModelError(f"{found}, expected at most {MOST_KINKS}.")


def _given(
    form: SurfaceForm | TimeEventForm, what: str, name: str, names: Mapping[str, Any]
) -> dict[str, Any]:
    """What the form gives of a surface or a time event, read; `name`: that of one without a name."""

    def read(key: str, value: Any) -> Any:
        if key == "reset":
            check_known(f"state in the reset of {what} {name}:", value, names)
            return {names[state]: formula(after, names) for state, after in value.items()}
        if isinstance(value, tuple):
            return tuple(read(key, one) for one in value)
        if key in ("h", "radius"):
            return formula(value, names)
        return number(value, names) if key in ("width", "period", "start", "times") else value

    given = {field.name: getattr(form, field.name) for field in dataclasses.fields(form)}
    return {k: read(k, v) for k, v in given.items() if v is not None} | {"name": form.name or name}


def _fields(
    form: SystemForm, raw: Mapping[str, Any], names: Mapping[str, Any], n: int
) -> dict[str, list[Expr]]:
    """The vertex fields; missing sign vectors take the nearest one given."""
    count, given = len(form.h or ()), form.fields
    if given is None and form.smooth_field is not None:
        given = {"*" * count: form.smooth_field}
    if given and raw.get("hybrid"):
        raise ModelError(
            f"the case has fields and a `hybrid` text, {str(raw['hybrid'])[:80]!r}, which is not read beside "
            'fields: give a reset with its h, as in {"h": "x", "reset": {"v": "-v/2"}, "side": "+"}.'
        )
    if not given:
        prose = "; its `hybrid` text is prose that is not understood" if raw.get("hybrid") else ""
        near = [key for key in raw if key not in ("fields", "smooth_field") and "field" in key.casefold()]
        hint = f" (did you mean 'fields' by {near[0]!r}?)" if near else ""
        raise ModelError(f"the case has no fields{prose}{hint}: give h and fields, or smooth_field.")
    out: dict[str, list[Expr]] = {}
    for signs, row in given.items():
        if len(row) != n:
            raise ModelError(f"field {signs!r} is {row!r:.60}, expected {n} formulas, one per state.")
        if len(signs) != count or set(signs) - set("+-*"):
            raise ModelError(f"fields has the sign vector {signs!r}, expected {count} of '+', '-' or '*'.")
        out[signs] = [formula(value, names) for value in row]

    def nearest(wanted: str) -> list[Expr]:
        return out[min(out, key=lambda key: sum(a not in (b, "*") for a, b in zip(key, wanted, strict=True)))]

    return {signs: nearest(signs) for signs in map("".join, itertools.product("+-", repeat=count))}


def _start(
    form: SystemForm, names: Mapping[str, Any], n: int
) -> tuple[tuple[float, ...], tuple[float, float]]:
    if form.x0 is None or len(form.x0) != n:
        raise ModelError(f"x0 is {form.x0!r:.60}, expected {n} numbers, one per state.")
    if form.t_span is None:
        raise ModelError("t_span is missing, expected [t0, t1].")
    start, end = (number(value, names) for value in form.t_span)
    return tuple(number(value, names) for value in form.x0), (start, end)
