"""What is asked of every solver: quantities of the state that a case gives at known times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy
from sympy import Expr

from filippov import ModelError
from filippov import t as time_symbol
from filippov.app.bank import typed_json
from filippov.app.bank.build import Built
from filippov.app.bank.case import Case, read_bank
from filippov.app.bank.case_runs import CaseRuns, Settings
from filippov.app.bank.expectation import Expectation
from filippov.app.bank.notation import number
from filippov.app.bank.quantities.events import Accumulation, OneEvent, SomeEvents
from filippov.app.bank.quantities.quantity import Quantity
from filippov.app.bank.quantities.states import End, State
from filippov.app.bank.subjects import Subjects
from filippov.app.bank.system_form import SystemForm
from filippov.base.arrays import Array


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


def stated(case: Case) -> tuple[Built, list[Expectation]]:
    """The problem of a case, and what is expected of it. Raises ModelError."""
    subjects = Subjects(case, Settings())
    subject = subjects()
    assert isinstance(subject, CaseRuns)
    return subject.built, subjects.expectations()


def whole_and_parts(case: Case) -> list[Case]:
    """The case, or, where it has labelled parts, it and each of them as a case of its own, "ID LABEL"."""
    if not case.raw.get("parts"):
        return [case]
    subjects = Subjects(case, Settings())
    expected, found = subjects.expectations(), []
    for label in dict.fromkeys(expectation.part for expectation in expected):
        own = [replace(expectation, part="") for expectation in expected if expectation.part == label]
        known, given = typed_json.hints(SystemForm), subjects.system(label)
        system = {k: v for k, v in given.items() if k in known and v is not None}
        name = f"{case.id} {label}".strip()
        found += read_bank([{**system, "id": name, "expected": typed_json.written(own)}])
    return found


def targets(built: Built, expected: list[Expectation]) -> tuple[Target, ...]:
    """States at a time; the switching function at switches that are known; all of them where they all end."""
    found: list[Target] = []
    for expectation in expected:
        try:
            found += _of(expectation.measure, expectation.value, built, expected)
        except ModelError:
            continue
    return tuple(target for target in found if target.t > built.t_span[0])


def ambiguous(expected: list[Expectation]) -> bool:
    """Whether what is expected is that the solution is not unique."""
    return any(isinstance(e.measure, End) and e.text == "non_unique" for e in expected)


def _of(measure: Quantity, value: Any, built: Built, expected: list[Expectation]) -> list[Target]:
    named = {s.name: s.h for s in built.system.surfaces}
    h = tuple(named[name] for name in built.declared if name in named)
    if isinstance(measure, State) and measure.sliding is None and not isinstance(measure.t, Quantity):
        t = built.t_span[1] if measure.t is None else number(measure.t, built.names)
        return [_state(built, measure.component, t, value)]
    if isinstance(measure, Accumulation) and measure.take == "t":
        return [Target(number(value, built.names), h, (0.0,) * len(h))]
    if isinstance(measure, SomeEvents) and measure.take == "t" and len(h) == 1 and isinstance(value, list):
        return [Target(number(time, built.names), h, (0.0,)) for time in value]
    if isinstance(measure, OneEvent) and measure.take == "state":
        # The state at an event is one at a known time where the event's time is expected too.
        same = [e.value for e in expected if e.measure == replace(measure, take="t") and e.value is not None]
        return [_state(built, None, number(time, built.names), value) for time in same[:1]]
    return []


def _state(built: Built, component: str | None, t: float, value: Any) -> Target:
    """One state, or all states."""
    values = tuple(number(v, built.names) for v in (value if isinstance(value, list | tuple) else [value]))
    names = built.states if component is None else [built.names[component]]
    return Target(t, tuple(names[: len(values)]), values)
