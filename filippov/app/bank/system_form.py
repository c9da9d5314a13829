"""What a case says of its system, as dataclasses, and its reading from JSON."""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from filippov.app.bank import typed_json
from filippov.app.bank.notation import WORD, Number


@dataclass(frozen=True)
class SurfaceForm:
    """A switching function h and what happens on its surface.

    radius   the set of the sign at h = 0: r for [-r, r], or [lo, hi]; static friction Fs above the limit Fc
             of the slip curve is Fs/Fc
    width    half-width of a hysteresis
    reset    {state: formula}: the state after the surface is reached; those left out keep their values
    side     for a reset, the side from which it is reached
    contact  for a reset, whether the state may come to rest on the surface
    """

    h: Number
    name: str | None = None
    radius: Number | tuple[Number, Number] | None = None
    width: Number | None = None
    kind: Literal["switching", "kink", "observer", "reset"] | None = None
    reset: dict[str, Number] | None = None
    side: Literal["+", "-", "both"] | None = None
    contact: bool | None = None


@dataclass(frozen=True)
class TimeEventForm:
    """A clock: at start, start + period, ..., or at some times, the state is reset."""

    name: str | None = None
    period: Number | None = None
    start: Number | None = None
    times: tuple[Number, ...] | None = None
    reset: dict[str, Number] | None = None


@dataclass(frozen=True)
class ModeForm:
    """A mode of a two-mode automaton: its field, which holds until a state reaches its threshold."""

    name: str
    field: tuple[Number, ...]
    until: dict[str, Number]


@dataclass(frozen=True)
class SystemForm:
    """A system with its start and span; formulas use numbers, states, params and t.

    params           numbers or formulas by name, substituted exactly
    h                switching functions
    fields           sign vector to formulas, one for each state: "+-" is h_0 > 0, h_1 < 0; * is either sign
    smooth_field     the formulas, where there is no h; signs and absolute values in them are recognised
    event_functions  formulas whose zeros are events and change nothing
    automaton        two modes, in place of h and fields
    options          of the solver, such as rtol, atol, method, max_step; left out: the solver's defaults
    """

    states: tuple[str, ...] | None = None
    params: dict[str, Number] | None = None
    h: tuple[Number | SurfaceForm, ...] | None = None
    fields: dict[str, tuple[Number, ...]] | None = None
    smooth_field: tuple[Number, ...] | None = None
    event_functions: tuple[Number | SurfaceForm, ...] | None = None
    time_events: tuple[TimeEventForm, ...] | None = None
    automaton: tuple[ModeForm, ModeForm] | None = None
    x0: tuple[Number, ...] | None = None
    t_span: tuple[Number, Number] | None = None
    options: dict[str, Number] | None = None


def read_system(raw: Mapping[str, Any]) -> SystemForm:
    """The system of a case, in loose notation too. Raises ModelError that names what is wrong, and where.

    An entry stands for a list of one; x0 may be an object by state, t_span the end alone, states a text of
    names, fields a list that holds on every side. Other keys of the case are passed over.
    """
    known = typed_json.hints(SystemForm)
    given = {key: _without_keywords(raw[key]) for key in known if raw.get(key) is not None}
    if isinstance(given.get("states"), str):
        given["states"] = given["states"].replace(",", " ").split()
    x0, span, fields = given.get("x0"), given.get("t_span"), given.get("fields")
    if isinstance(x0, Mapping):
        given["x0"] = [x0[name] for name in given.get("states", ()) if name in x0]
    if isinstance(span, str | int | float):
        given["t_span"] = [0, span]
    for key in ("h", "event_functions", "time_events", "smooth_field", "x0"):
        if key in given:
            given[key] = _listed(given[key])
    if isinstance(fields, list | tuple):
        given["fields"] = {"*" * len(given.get("h", ())): fields}
    elif isinstance(fields, Mapping):
        given["fields"] = {signs: _listed(row) for signs, row in fields.items()}
    form: SystemForm = typed_json.read(SystemForm, given, "the case")
    return form


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str | int | float | Mapping) else value


def _without_keywords(value: Any) -> Any:
    """Reserved words of Python, such as lambda, get an underscore wherever they occur."""
    if isinstance(value, str):
        return WORD.sub(lambda m: m[0] + "_" if keyword.iskeyword(m[0]) and m[0].islower() else m[0], value)
    if isinstance(value, Mapping):
        return {_without_keywords(key): _without_keywords(item) for key, item in value.items()}
    return [_without_keywords(item) for item in value] if isinstance(value, list | tuple) else value
