"""The form of a bank: what a case may say, as dataclasses, and the JSON Schema made from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from filippov.app.bank import measures, typed_json
from filippov.app.bank.expectation import Expectation
from filippov.app.bank.measures.measure import Number

__all__ = ["BankForm", "CaseForm", "measures", "read_case", "schema"]


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


@dataclass(frozen=True)
class _Whole:
    id: str
    expected: tuple[Expectation, ...]


@dataclass(frozen=True)
class CaseForm(SystemForm, _Whole):
    """A system, or a polynomial, and what is expected of it.

    id          its name; --only takes it, or the part before the first _
    polynomial  in place of a system: coefficients, highest power first, numbers or formulas in parameters
    parts       systems of its own by label, with the case's params where they have none
    about       sources and notes, in any form
    """

    polynomial: tuple[Number, ...] | None = None
    parts: dict[str, SystemForm] | None = None
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BankForm:
    """A file of cases."""

    cases: tuple[CaseForm, ...]
    about: dict[str, Any] = field(default_factory=dict)


def read_case(given: Mapping[str, Any]) -> CaseForm:
    """A checked case of this form. Raises ModelError that names what is wrong, and where."""
    case: CaseForm = typed_json.read(CaseForm, given, "the case")
    return case


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a bank."""
    return typed_json.schema(BankForm, "A bank of cases for filippov")
