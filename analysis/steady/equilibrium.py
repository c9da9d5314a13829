"""Equilibria of an inclusion, 0 in F(x): points, and sets such as those that dry friction holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import sympy
from sympy import Expr, Symbol

from filippov.base.shown import Shown

PointKind = Literal["equilibrium", "pseudo-equilibrium", "resting contact", "boundary equilibrium"]


@dataclass(frozen=True)
class EquilibriumPoint(Shown):
    """x with 0 in F(x).

    mode         sign of each surface, 0 where the point lies on it
    states       names, in the order of x
    x            one expression in the parameters per state; a number where it was found numerically
    multipliers  (surface, s) for each surface that the point lies on: f(x, s) = 0
    value        x at the parameter values, floats
    s_value      the multipliers at the parameter values
    kind         "equilibrium" of a smooth mode, "pseudo-equilibrium" on a switching surface, "resting
                 contact" on a surface with impacts, or "boundary equilibrium": a multiplier is at an end of
                 its set, or the point lies on a kink or on a surface with a reset
    conditions   inequalities in the parameters under which it exists
    exact        whether x holds for all parameters near the values
    degenerate   the special parameter values on which the result rests, such as "I = 0"
    behind       stops: surfaces that no solution passes to the side on which it lies
    """

    _write: ClassVar[str] = ", one of equilibria(system)"

    mode: str
    states: tuple[str, ...]
    x: tuple[Expr, ...]
    multipliers: tuple[tuple[str, Expr], ...]
    value: tuple[float, ...]
    s_value: tuple[float, ...]
    kind: PointKind
    conditions: tuple[Any, ...] = ()
    exact: bool = True
    degenerate: tuple[str, ...] = ()
    behind: tuple[str, ...] = ()

    def __str__(self) -> str:
        value = ", ".join(f"{v:.9g}" for v in self.value)
        pairs = zip(self.multipliers, self.s_value, strict=True)
        held = "".join(f", multiplier of {name} = {s:.9g}" for (name, _), s in pairs)
        return f"{_head(self)}; value ({value}){held}{_stops(self)}"

    @property
    def dimension(self) -> int:
        """0."""
        return 0


@dataclass(frozen=True)
class EquilibriumSet(Shown):
    """{x(c) : c in a domain} with 0 in F(x), all in one mode.

    mode         as for a point
    x            one expression in `free` and the parameters per state
    multipliers  (surface, s) for each surface that the set lies on
    free         the symbols c: multipliers where possible, else states
    domain       (least, greatest) for each of `free`, in the parameters; -oo and oo where it is unbounded
    bounds       the domain at the parameter values
    ends         end points (dimension 1), one of a half line, or corners (more) that exist
    conditions   inequalities in `free` and the parameters that bound the set
    inside       values of `free` well inside the domain at the parameter values, () where it is an interval
    exact, degenerate, behind   as for a point
    """

    _write: ClassVar[str] = ", one of equilibria(system)"

    mode: str
    states: tuple[str, ...]
    x: tuple[Expr, ...]
    multipliers: tuple[tuple[str, Expr], ...]
    free: tuple[Symbol, ...]
    domain: tuple[tuple[Expr, Expr], ...]
    bounds: tuple[tuple[float, float], ...]
    ends: tuple[EquilibriumPoint, ...]
    conditions: tuple[Any, ...] = ()
    exact: bool = True
    degenerate: tuple[str, ...] = ()
    behind: tuple[str, ...] = ()
    inside: tuple[float, ...] = ()

    def __str__(self) -> str:
        pairs = zip(self.free, self.bounds, strict=True)
        free = ", ".join(f"{c} in [{a:.9g}, {b:.9g}]" for c, (a, b) in pairs)
        return f"{_head(self)}; {free}{_stops(self)}"

    @property
    def kind(self) -> str:
        """What a point is called by, of a set."""
        return "equilibrium set"

    @property
    def dimension(self) -> int:
        """Number of free symbols."""
        return len(self.free)

    @property
    def bounded(self) -> bool:
        """Whether the domain is finite at the parameter values."""
        return all(abs(b) < float("inf") for pair in self.bounds for b in pair)

    @property
    def inner(self) -> tuple[float, ...]:
        """Values of the free symbols inside the domain."""
        return self.inside or tuple(_inner(*pair) for pair in self.bounds)

    def at(self, *c: Any) -> tuple[Expr, ...]:
        """x at values of the free symbols, in order."""
        put = dict(zip(self.free, map(sympy.S, c), strict=True))
        return tuple(e.subs(put) for e in self.x)


def _inner(low: float, high: float) -> float:
    """A place in an interval, not its middle: that may be special."""
    ends = [e for e in (low, high) if abs(e) < float("inf")]
    if len(ends) == 2:
        return 0.53 * low + 0.47 * high
    return ends[0] + (1.0 if ends[0] == low else -1.0) if ends else 0.1


def _head(found: EquilibriumPoint | EquilibriumSet) -> str:
    where = ", ".join(f"{name} = {x}" for name, x in zip(found.states, found.x, strict=True))
    return f"{found.kind}, mode {found.mode or '(smooth)'}: {where}"


def _stops(found: EquilibriumPoint | EquilibriumSet) -> str:
    return f", behind {' and '.join(found.behind)}" if found.behind else ""


class Missing(str):
    """A note on what was not searched, or not to its end: other equilibria may exist."""

    __slots__ = ()


class Stopped(Missing):
    """A note that the search was stopped before its end."""

    __slots__ = ()


@dataclass(frozen=True)
class Equilibria(Shown):
    """All that were found, with the parameter values at which existence was decided.

    notes   what was not searched or not decided, one sentence each
    """

    points: tuple[EquilibriumPoint, ...]
    sets: tuple[EquilibriumSet, ...]
    parameters: tuple[tuple[str, float], ...] = ()
    notes: tuple[str, ...] = ()

    def __iter__(self) -> Iterator[EquilibriumPoint | EquilibriumSet]:
        yield from self.sets
        yield from self.points

    def __len__(self) -> int:
        return len(self.sets) + len(self.points)

    def __str__(self) -> str:
        return "\n".join([*map(str, self), *self.notes]) or "no equilibria"

    @property
    def complete(self) -> bool:
        """Whether all modes were searched to their end, in formulas: there are no others."""
        return not any(isinstance(note, Missing) for note in self.notes)
