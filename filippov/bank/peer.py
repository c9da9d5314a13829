"""Other solvers put to the same cases naively: the sign of h as the language has it, no events.

What is compared are states at given times (`final_state`, `x_at_3`, ...), which any solver can give.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import itertools
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Symbol

from filippov.bank.build import Built
from filippov.bank.case import Case, number
from filippov.errors import ModelError
from filippov.symbols import t as time_symbol

Array = npt.NDArray[np.float64]
_AT = re.compile(r"(?P<state>\w+)(?:_at_|\()(?P<time>[^()\[\]=]+(?:\([^()]*\))?)\)?")


class HangError(Exception):
    """The solver did not come to the end within what it was allowed."""


class CannotError(Exception):
    """The case cannot be written for this solver."""


@dataclass(frozen=True)
class Target:
    """A state that is known at a time: values of some components."""

    t: float
    places: tuple[int, ...]
    values: tuple[float, ...]


@dataclass(frozen=True)
class Given:
    """A case as a naive user has it: x' = f(t, x, sgn h), a start, and times at which x is asked for."""

    built: Built
    targets: tuple[Target, ...]
    h: tuple[Expr, ...]
    rows: Mapping[tuple[int, ...], Sequence[Expr]]

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


# Returns states (one row a time) and whether the solver reported success.
Solve = Callable[[Given, Limits], tuple[Array, bool]]


@dataclass(frozen=True)
class Peer:
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


def given(case: Case, built: Built) -> Given | None:
    """The case for naive solvers; None where it has no targets, or more than signs in it."""
    if any(s.reset is not None or s.width or s.wide for s in built.system.surfaces):
        return None
    targets = tuple(_targets(case, built))
    if not targets:
        return None
    count = len(next(iter(built.fields)))
    named = {s.name: s for s in built.system.surfaces}
    h = tuple(named[name].h for name in built.declared[:count])
    rows = {tuple(1 if c == "+" else -1 for c in signs): row for signs, row in built.fields.items()}
    return Given(built, targets, h, rows)


def _targets(case: Case, built: Built) -> list[Target]:
    start, end = built.t_span
    states, found = built.system.states, []
    for entry in case.expected:
        match = _AT.fullmatch(entry.name)
        try:
            if entry.name in ("final_state", "final"):
                at, name = number(entry.fields.get("t", end), built.names), "state"
            elif match is not None and (match["state"] in states or match["state"] in ("state", "x", "y")):
                at, name = number(match["time"], built.names), match["state"]
            else:
                continue
            values = entry.value if isinstance(entry.value, list) else [entry.value]
            numbers = tuple(number(value, built.names) for value in values)
        except ModelError:
            continue
        if start < at <= end * (1 + 1e-12):
            alone = len(numbers) == 1 and name in states
            places = (states.index(name),) if alone else tuple(range(len(numbers)))
            found.append(Target(min(at, end), places, numbers))
    return found


def worst(case: Given, states: Array, tolerance: float) -> tuple[float, float]:
    """Largest error, and the largest error over its tolerance, which is relative to 1 + |x|."""
    error = ratio = 0.0
    for target in case.targets:
        x = states[case.times.index(target.t)]
        for place, value in zip(target.places, target.values, strict=True):
            gap = abs(float(x[place]) - value)
            error = max(error, gap) if np.isfinite(gap) else np.inf
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
