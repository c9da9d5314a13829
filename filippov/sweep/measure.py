"""Measures: numbers computed from one solution, named by text such as "end(x)" or "amplitude(x)".

    end, end(x)                             state reached, all or one
    mode(s)                                 sign of a surface s reached
    t_end, nfev                             time reached, field calls
    events, events(s), events(s, kind)      number of events
    dwell(+0), sliding(s)                   time spent in a mode, sliding on a surface
    period(s), period(s, kind)              mean time between such events of one direction in the tail
    min(x), max(x), mean(x), amplitude(x)   of a state over the tail; amplitude: (max - min)/2
    path/to/file.py:name       function of the Solution that returns a number or {name: number}

end, min, max, mean and amplitude also take an output of the system; where it jumps, both values count.

The tail is the last part of the time reached. For a run that fails, only end, t_end, mode, nfev and events
are kept.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.given import as_float, several, shown
from filippov.base.names import unknown
from filippov.base.status import mode_text
from filippov.base.symbolic_value import is_expression
from filippov.base.user_file import load_file, read_file
from filippov.model.system import System
from filippov.solving.ensemble import Ensemble
from filippov.solving.state.events import Events, columns_of
from filippov.sweep.dependence import Dependence, dependence
from filippov.sweep.period import period_of

if TYPE_CHECKING:
    from filippov.solving.solution import Solution

ENDS = ("end", "t_end", "nfev", "mode", "events")
EVENTS = ("dwell", "sliding", "period")
TAIL = ("min", "max", "mean", "amplitude")
NAMES = (*ENDS, *EVENTS, *TAIL)
FINER = 8
# So many of the highest tops are refined, by so many rounds that each leave a quarter.
TOPS, ROUNDS = 256, 9
_NOTHING = Dependence("")
_TEXT = re.compile(r"\s*([A-Za-z_]+)\s*(?:\((.*)\))?\s*")


@dataclass(frozen=True)
class Measure:
    """One of the named measures with its arguments, checked against a system."""

    name: str
    arguments: tuple[str, ...] = ()

    @property
    def needs(self) -> int:
        """0: ends only; 1: the events; 2: the dense output."""
        return 0 if self.name in ENDS else 1 if self.name in EVENTS else 2

    def columns(self, system: System) -> tuple[str, ...]:
        """Names of what it gives."""
        if self.name == "end" and not self.arguments:
            return tuple(f"end({state})" for state in system.states)
        return (f"{self.name}({', '.join(self.arguments)})" if self.arguments else self.name,)

    def of_ends(self, ends: Ensemble, system: System) -> Array:
        """Its values for an ensemble, (k, c)."""
        if self.name == "end":
            return ends.x[:, [system.state_index(a) for a in self.arguments]] if self.arguments else ends.x
        if self.name == "mode":
            place, sense = system.surface_place(self.arguments[0])
            return sense * ends.mode[:, [place]].astype(float)
        if self.name == "events":
            return ends.events(*self.arguments)[:, None].astype(float)
        return np.asarray(ends.t if self.name == "t_end" else ends.nfev, dtype=float)[:, None]

    def of_solution(self, solution: Solution, tail: float) -> list[float]:
        """Its values for a solution."""
        system, first = solution.system, self.arguments[0] if self.arguments else ""
        if self.name == "end":
            return [float(solution.x_end[system.state_index(a)]) for a in self.arguments or system.states]
        if self.name == "mode":
            place, sense = system.surface_place(first)
            return [float(sense * solution.end_mode[place])]
        if self.name == "events":
            return [float(len(_events(solution, self.arguments)))]
        if self.name in ("t_end", "nfev"):
            return [float(getattr(solution, self.name))]
        if not solution.success:
            return [float("nan")]
        if self.name == "dwell":
            return [float(sum(s.dwell for s in solution.segments if mode_text(s.mode) == first))]
        if self.name == "sliding":
            place = system.surface_index(first)
            return [float(sum(s.dwell for s in solution.segments if s.mode[place] == 0))]
        begin = _begin(solution, tail)
        if self.name == "period":
            return [period_of(_events(solution, self.arguments), begin, solution.t_end)]
        sol, state = solution.sol, system.state_index(first)
        assert sol is not None
        return [_of_tail(self.name, solution, lambda t, side: sol(t, side=side)[state], begin)]


@dataclass(frozen=True)
class OfOutput(Measure):
    """A measure of an output; depends: on its formula, or what its function depends on."""

    depends: Dependence = _NOTHING

    @property
    def needs(self) -> int:
        """2: an output is read along the solution."""
        return 2

    def of_solution(self, solution: Solution, tail: float) -> list[float]:
        """Its value. Raises ModelError where the solved system does not have the output."""
        (name,) = self.arguments
        if name not in solution.system.outputs:
            raise ModelError(unknown("output", name, solution.system.outputs))
        if self.name == "end":
            return [float(solution.evaluate(name, solution.t_end))]
        return [
            _of_tail(
                self.name, solution, lambda t, side: solution.evaluate(name, t, side), _begin(solution, tail)
            )
        ]


@dataclass(frozen=True)
class Function:
    """A function of the user's, by path and name, or itself where it can be imported.

    names  of the numbers it returns
    text   of its file when the measure was made, which every worker runs whatever stands there by then
    """

    path: str
    name: str
    given: Callable[[Solution], Mapping[str, float]] | None = None
    names: tuple[str, ...] = ()
    text: bytes = field(default=b"", repr=False)
    needs = 2

    def columns(self, system: System) -> tuple[str, ...]:
        """Names of what it gives."""
        return self.names

    def of_solution(self, solution: Solution, tail: float) -> list[float]:
        """Its values for a solution. Raises UsageError for other names than at first."""
        found = self.call(solution)
        if tuple(found) != self.names:
            raise UsageError(f"{self.name} returned {', '.join(found)}; at first {', '.join(self.names)}.")
        return list(found.values())

    def call(self, solution: Solution) -> Mapping[str, float]:
        """What the function returns: numbers by name, or one of its own name. Raises UsageError otherwise."""
        found: Any = (self.given or _function(self.path, self.name, self.text))(solution)
        if isinstance(found, Real):
            return {self.name.rpartition(".")[2]: float(found)}
        if not isinstance(found, Mapping) or not all(isinstance(key, str) for key in found):
            raise UsageError(
                f"{self.name} returned {type(found).__name__}, expected a number, or a dict of them by "
                "name."
            )
        return {key: _number(f"{self.name}: {key!r}", value) for key, value in found.items()}

    @property
    def depends(self) -> Dependence:
        """What it depends on; of a file of its own, all of it."""
        if self.given is not None:
            return dependence(self.given)
        file = hashlib.sha256(self.text).hexdigest()
        return dependence(file, _function(self.path, self.name, self.text))


def read_measures(given: Any, system: System) -> tuple[Measure | Function, ...]:
    """Measures from texts and functions. Raises UsageError with a suggestion."""
    items = [given] if isinstance(given, str) or callable(given) else list(several("measure", given))
    if not items:
        raise UsageError(f"measure is empty, expected at least one of {', '.join(NAMES)} or a function.")
    found = tuple(_read(item, system) for item in items)
    if len(set(found)) < len(found):
        twice = next(item for place, item in enumerate(items) if found[place] in found[:place])
        raise UsageError(f"measure holds {getattr(twice, '__name__', twice)!r} twice. Leave one out.")
    return found


def _read(item: Any, system: System) -> Measure | Function:
    if callable(item):
        return Function("", getattr(item, "__qualname__", type(item).__name__), item)
    if not isinstance(item, str):
        raise UsageError(f"measure holds {item!r}, expected text or a function of the solution.")
    path, colon, name = item.rpartition(":")
    if colon and path.endswith(".py"):
        text = read_file(Path(path))
        _function(str(Path(path).resolve()), name, text)
        return Function(str(Path(path).resolve()), name, text=text)
    match = _TEXT.fullmatch(item)
    if match is None or match[1] not in NAMES:
        raise UsageError(f"{unknown('measure', item, NAMES)}; or path/to/file.py:name")
    arguments = tuple(part.strip() for part in (match[2] or "").split(",") if part.strip())
    return _checked(Measure(match[1], arguments), system)


_FORMS = {
    "t_end": "", "nfev": "", "dwell": "(mode)", "mode": "(surface)", "sliding": "(surface)",
    "events": "(surface, kind)", "period": "(surface, kind)",
}  # fmt: skip


def _checked(measure: Measure, system: System) -> Measure:
    name, arguments = measure.name, measure.arguments
    most = {"t_end": 0, "nfev": 0, "events": 2, "period": 2}.get(name, 1)
    least = 0 if name in ("end", "t_end", "nfev", "events") else 1
    if not least <= len(arguments) <= most:
        count = f"{least}" if least == most else f"{least} to {most}"
        of = _FORMS.get(name, f"({system.states[0]})")
        raise UsageError(
            f"measure {name!r} was given {len(arguments)} arguments, expected {count}: write '{name}{of}'."
        )
    if not arguments:
        return measure
    try:
        if name in ("events", "period", "sliding", "mode"):
            system.surface_index(arguments[0])
        elif name != "dwell" and arguments[0] in system.outputs:
            return OfOutput(name, arguments, _depends(system.outputs[arguments[0]]))
        elif name != "dwell":
            system.state_index(arguments[0])
    except ModelError as error:
        raise UsageError(f"measure {name!r}: {error}") from None
    if len(arguments) > 1:
        columns_of(arguments[1])
    if name == "dwell" and (len(arguments[0]) != len(system.surfaces) or set(arguments[0]) - set("+0-")):
        raise UsageError(
            f"measure dwell({arguments[0]}): expected one of +, 0, - for each of the "
            f"{len(system.surfaces)} surfaces."
        )
    return measure


def _number(name: str, value: Any) -> float:
    """A number, or whether something is so, as 1 or 0. Raises UsageError for text, None and complex ones."""
    found = float(value) if isinstance(value, bool | np.bool_) else as_float(value)
    if found is None:
        raise UsageError(f"{name} is {shown(value)}, expected a number.")
    return found


@lru_cache(maxsize=64)
def _function(path: str, name: str, text: bytes) -> Callable[[Solution], Mapping[str, float]]:
    module = load_file(Path(path), text)
    found = getattr(module, name, None)
    if not callable(found):
        own = [n for n, value in vars(module).items() if callable(value) and not n.startswith("_")]
        raise UsageError(f"{path!r}: {unknown('function', name, own)}")
    return found  # type: ignore[no-any-return]


def _events(solution: Solution, arguments: Sequence[str]) -> Events:
    """The events on a surface, of a kind as in `Stop`."""
    surface, kind = (*arguments, None, None)[:2]
    word, direction = kind, 0
    if kind is not None and kind.endswith((" up", " down")):
        word, _, way = kind.rpartition(" ")
        direction = 1 if way == "up" else -1
    return solution.events.of(surface, word, direction)


def _depends(output: Any) -> Dependence:
    """What tells one output from another."""
    return Dependence(str(output)) if is_expression(output) else dependence(output)


def _begin(solution: Solution, tail: float) -> float:
    """The time at which the tail begins."""
    return float(solution.t_end - tail * (solution.t_end - solution.problem.t_span[0]))


def _of_tail(name: str, solution: Solution, read: Callable[[Array, str], Array], begin: float) -> float:
    """min, max, mean or amplitude from `begin` to the end; read(t, side): values, those before or after t."""
    end = solution.t_end
    inner = solution.t[(np.abs(end - solution.t) < abs(end - begin)) & (solution.t != end)]
    nodes = np.concatenate(([begin], inner[np.append(True, np.diff(inner) != 0)[: inner.size]], [end]))
    if begin == end:
        value = float(read(nodes[:1], "-")[0])
        return 0.0 if name == "amplitude" else value
    if name == "mean":
        # Gauss's rule with 5 points is exact for the interpolant of a step, a polynomial of degree 9 or less.
        places, weights = np.polynomial.legendre.leggauss(5)
        half = 0.5 * np.diff(nodes)[:, None]
        t = 0.5 * (nodes[1:] + nodes[:-1])[:, None] + half * places
        return float(np.sum(half * weights * read(t.ravel(), "-").reshape(t.shape)) / (end - begin))
    # Each step from its first to its last point: an impact or a jump of an output lies between two of them.
    t = nodes[:-1, None] + np.diff(nodes)[:, None] * (np.arange(FINER + 1) / FINER)
    t[:, -1] = nodes[1:]
    y = np.empty_like(t)
    y[:, 0] = read(t[:, 0], "+")
    y[:, 1:] = read(t[:, 1:].ravel(), "-").reshape(len(t), FINER)
    low, high = -_highest(read, t, -y, -1.0), _highest(read, t, y, 1.0)
    return {"min": low, "max": high, "amplitude": 0.5 * (high - low)}[name]


def _highest(read: Callable[[Array, str], Array], t: Array, y: Array, sign: float) -> float:
    """The largest sign * value, samples and what lies between them: each step is looked at by itself.

    A top between samples is searched beside each that the parabola through it and its neighbours lifts above
    the best sample, twice as far to be sure, all of them side by side.
    """
    best, lift = float(np.max(y)), _lift(y)
    reach = y + 2.0 * lift
    # A best sample at the end of a step may have its top in the next one, and several tops are as high.
    steps, places = np.nonzero((reach >= best) & (lift > 0))
    if steps.size == 0:
        return best
    chosen = np.argsort(-reach[steps, places], kind="stable")[:TOPS]
    steps, places = steps[chosen], places[chosen]
    low, high = t[steps, np.maximum(places - 1, 0)], t[steps, np.minimum(places + 1, FINER)]
    for _ in range(ROUNDS):
        part = (high - low)[:, None] / FINER
        inner = low[:, None] + part * (0.5 + np.arange(FINER))
        found = sign * read(inner.ravel(), "-").reshape(inner.shape)
        best = max(best, float(np.max(found)))
        top = np.take_along_axis(inner, np.argmax(found, axis=1)[:, None], axis=1)
        low, high = np.maximum(low, (top - part)[:, 0]), np.minimum(high, (top + part)[:, 0])
    return best


def _lift(y: Array) -> Array:
    """How far the top of the parabola through a sample and its two neighbours is above it; at the ends of a
    step of the one through the last three, 0 where that has no top between the last two."""
    out = np.zeros_like(y)
    for j in range(y.shape[1]):
        at = min(max(j, 1), y.shape[1] - 2)
        a, b, c = y[:, at - 1], y[:, at], y[:, at + 1]
        bend = a - 2.0 * b + c
        with np.errstate(divide="ignore", invalid="ignore"):
            place = np.where(bend < 0, 0.5 * (a - c) / bend, 0.0)
        beside = np.abs(place - (j - at)) <= 1.0
        out[:, j] = np.where(beside, np.maximum(b - 0.5 * bend * place**2 - y[:, j], 0.0), 0.0)
    return out
