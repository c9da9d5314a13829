"""Reference solvers put to the same cases naively: the sign of h as the language has it, no events.

What is compared are states at given times (`final_state`, `x_at_3`, ...), which any solver can give.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

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


class HangError(Exception):
    """The solver did not come to the end within what it was allowed."""


class CannotError(Exception):
    """The case cannot be written for this solver."""


class SaidError(Exception):
    """The solver says that the solution is not unique."""


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


@dataclass(frozen=True)
class Given:
    """A case as a naive user has it: x' = f(t, x, sgn h), a start, and times at which x is asked for.

    ambiguous  whether its solution is not unique, so that what is asked for is that the solver says so
    """

    built: Built
    targets: tuple[Target, ...]
    h: tuple[Expr, ...]
    rows: Mapping[tuple[int, ...], Sequence[Expr]]
    ambiguous: bool = False

    @property
    def symbols(self) -> list[Symbol]:
        """Time and the states."""
        return [time_symbol, *self.built.states]

    @property
    def times(self) -> list[float]:
        """The times of the targets, in order, each once."""
        return sorted({target.t for target in self.targets})


@dataclass
class Limits:
    """What a solver is given: tolerances, field calls, seconds."""

    rtol: float
    atol: float
    calls: int
    seconds: float
    started: float = field(default_factory=time.monotonic)

    def check(self, calls: int = 0) -> None:
        """Raise HangError when so many field calls are too many, or the time is over."""
        if calls > self.calls or time.monotonic() - self.started > self.seconds:
            raise HangError


# Returns states (one row per time) and whether the solver reported success.
Solve = Callable[[Given, Limits], tuple[Array, bool]]


@dataclass(frozen=True)
class ReferenceSolver:
    """A solver by name, the module that it needs, and the function that runs a case."""

    name: str
    module: str
    solve: Solve

    @property
    def installed(self) -> bool:
        """Whether its module is there."""
        return importlib.util.find_spec(self.module) is not None

    @property
    def version(self) -> str:
        """Version of its module."""
        return importlib.metadata.version(self.module)


def given(case: Case) -> Given:
    """The case for naive solvers. Raises CannotError where it is more than a field with signs in it."""
    subjects = Subjects(case, Settings())
    subject, expected = subjects(), subjects.expectations()
    assert isinstance(subject, CaseRuns)
    built = subject.built
    for surface in built.system.surfaces:
        if surface.reset is not None:
            raise CannotError("a reset: it takes events and restarts")
        if surface.width:
            raise CannotError("a hysteresis: a sign has no memory")
        if surface.wide:
            raise CannotError("static friction above the slip curve: a sign has no such values")
    if built.system.time_events:
        raise CannotError("a clock: it takes restarts")
    several = ambiguous(expected)
    asked = (Target(built.t_span[1], (), ()),) if several else targets(built, expected)
    if not asked:
        raise CannotError("no state at a known time is expected")
    count = len(next(iter(built.fields)))
    named = {s.name: s for s in built.system.surfaces}
    h = tuple(named[name].h for name in built.declared[:count])
    rows = {tuple(1 if c == "+" else -1 for c in signs): row for signs, row in built.fields.items()}
    return Given(built, asked, h, rows, several)


def worst(case: Given, states: Array, tolerance: float) -> tuple[float, float]:
    """Largest error, and the largest error over its tolerance, which is relative to 1 + |value|."""
    error = ratio = 0.0
    for target in case.targets:
        gaps = target.gaps(case.built, states[case.times.index(target.t)])
        for gap, value in zip(gaps, target.values, strict=True):
            error = max(error, float(gap)) if np.isfinite(gap) else np.inf
            ratio = max(ratio, gap / (tolerance * (1 + abs(value)))) if np.isfinite(gap) else np.inf
    return error, ratio


def numeric_field(case: Given, limits: Limits) -> Callable[[float, Array], Array]:
    """f(t, x) as a user writes it with numpy: sgn 0 is 0, fields between are the mean of their neighbours."""
    h = sympy.lambdify(case.symbols, list(case.h), "numpy")
    rows = {signs: sympy.lambdify(case.symbols, list(row), "numpy") for signs, row in case.rows.items()}
    calls = itertools.count()

    def f(t: float, x: Array) -> Array:
        count = next(calls)
        if count % 64 == 0:
            limits.check(count)
        signs = [int(np.sign(v)) for v in h(t, *x)]
        corners = list(itertools.product(*((s,) if s else (1, -1) for s in signs)))
        mean: Array = np.mean([np.asarray(rows[c](t, *x), dtype=float) for c in corners], axis=0)
        return mean

    return f


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
        with suppress(ModelError):
            found += _of(expectation.measure, expectation.value, built, expected)
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
