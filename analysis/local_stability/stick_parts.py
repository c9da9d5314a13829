"""Sets of equilibria that touch: a segment that kinks cut into parts, and what is said of one beside another.

At a kink the field is continuous: the next part begins where one ends, with the same multiplier, and
nothing breaks away there. Parts that share an end are one segment; its ends are those that no other part
has.

What has other equilibria arbitrarily near it attracts nothing alone: from these, no solution comes. What is
proved by a function that falls on all solutions but the equilibria (LaSalle's principle) is then that
solutions come to all of them together.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.local_stability.stability_result import Answer
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.base.arrays import Array
from filippov.model.symbols import t as time

Equilibrium = EquilibriumPoint | EquilibriumSet
NEAR = 1e-9
# Of places of two sets that a search without formulas tells apart, and how far it looks on unbounded ones.
APART, REACH = 1e-6, 20.0


def joined(
    found: Iterable[EquilibriumPoint | EquilibriumSet],
) -> dict[int, tuple[EquilibriumPoint, ...]]:
    """By the id of each set that is part of a longer segment: the ends of the segment."""
    sets = [e for e in found if isinstance(e, EquilibriumSet)]
    parts = [e for e in sets if e.dimension == 1 and e.mode.count("0") == 1]
    group = list(range(len(parts)))
    for i, first in enumerate(parts):
        for j, second in enumerate(parts[:i]):
            same = first.mode.index("0") == second.mode.index("0") and first.mode != second.mode
            if same and any(_meet(a, b) for a in first.ends for b in second.ends):
                old, new = group[i], group[j]
                group = [new if g == old else g for g in group]
    out: dict[int, tuple[EquilibriumPoint, ...]] = {}
    for number in set(group):
        members = [part for part, g in zip(parts, group, strict=True) if g == number]
        if len(members) < 2:
            continue
        every = [(part, end) for part in members for end in part.ends]
        outer = tuple(
            end for part, end in every if not any(other is not part and _meet(end, e) for other, e in every)
        )
        infinite = sum(abs(b) == float("inf") for part in members for b in part.bounds[0])
        if len(outer) + infinite == 2:
            out |= {id(part): outer for part in members}
    return out


def _meet(a: EquilibriumPoint, b: EquilibriumPoint) -> bool:
    pairs = zip((*a.value, *a.s_value), (*b.value, *b.s_value), strict=True)
    return all(abs(p - q) <= NEAR * max(1.0, abs(p)) for p, q in pairs)


@dataclass(frozen=True)
class Judged:
    """An equilibrium or a part of a set with its verdict; drift: solutions beside it move along it."""

    equilibrium: Equilibrium
    answer: Answer
    drift: bool = False


@dataclass(frozen=True)
class Beside:
    """What others arbitrarily near leave of "asymptotically stable".

    together   the modes of the sets with which it is one set: the verdict is that of their union
    """

    answer: Answer
    text: str
    together: tuple[str, ...] = ()


def beside_others(
    found: Iterable[Equilibrium], judged: Sequence[Judged], values: Mapping[Symbol, Expr]
) -> list[Beside | None]:
    """For each of the judged what other equilibria near it change; None where they change nothing."""
    sets = [e for e in found if isinstance(e, EquilibriumSet)]
    out: list[Beside | None] = [None] * len(judged)
    if not sets:
        return out
    places: dict[int, _Place] = {}

    def place(e: Equilibrium) -> _Place:
        if id(e) not in places:
            places[id(e)] = _Place.of(e, values)
        return places[id(e)]

    def near(e: Equilibrium) -> list[EquilibriumSet]:
        others = [s for s in sets if not _part(e, s) and set(s.behind) <= set(e.behind)]
        return [s for s in others if place(e).others(place(s))]

    for k, one in enumerate(judged):
        if one.answer != "asymptotically stable" or not (close := near(one.equilibrium)):
            continue
        names = ", ".join(dict.fromkeys(s.mode for s in close))
        if isinstance(one.equilibrium, EquilibriumPoint):
            text = f"equilibria in mode {names} come arbitrarily near it: it attracts only together with them"
            out[k] = Beside("stable", text)
            continue
        union = list(close)
        for s in union:
            union += [other for other in near(s) if not any(other is u for u in union)]
        union = [s for s in union if not _part(one.equilibrium, s)]
        said = [{j.answer for j in judged if _part(j.equilibrium, s)} for s in union]
        modes = tuple(dict.fromkeys(s.mode for s in union))
        if all(answers == {"asymptotically stable"} for answers in said):
            text = f"it is one set with the equilibria in mode {', '.join(modes)}, which it touches: "
            text += "the verdict is that of their union, and of none of them alone"
            out[k] = Beside("asymptotically stable", text, modes)
            continue
        text = f"it touches equilibria in mode {names}: it attracts only together with them"
        moves = one.drift or any("unstable" in answers for answers in said)
        out[k] = Beside("undecided" if moves else "stable", text)
    return out


def _part(e: Equilibrium, whole: EquilibriumSet) -> bool:
    """Whether it is the set, or was cut from it where its stability changes."""
    same = isinstance(e, EquilibriumSet) and (e.mode, e.x, e.free) == (whole.mode, whole.x, whole.free)
    return e is whole or same


@dataclass(frozen=True)
class _Place:
    """The states x(c) of an equilibrium: c between low and high, and g(c) >= 0 for all the sides.

    lines   (x(0), dx/dc) where x is affine in c, and (g(0), dg/dc) of each side; None where one is not
    """

    x: Callable[[Array], Array]
    low: Array
    high: Array
    sides: Callable[[Array], Array]
    lines: tuple[Array, Array, Array, Array] | None

    @classmethod
    def of(cls, e: Equilibrium, values: Mapping[Symbol, Expr]) -> _Place:
        if isinstance(e, EquilibriumPoint):
            return cls.at(np.array(e.value))
        put = {**values, time: sympy.S.Zero}
        x = [sympy.S(q).subs(put) for q in e.x]
        # The domain of one free symbol says all.
        given = [c for c in e.conditions if e.dimension > 1 and isinstance(c, sympy.Ge | sympy.Gt)]
        sides = [(c.gts - c.lts).subs(put) for c in given]
        low, high = np.array(e.bounds, dtype=float).T
        return cls(_function(e.free, x), low, high, _function(e.free, sides), _lines(e.free, x, sides))

    @classmethod
    def at(cls, x: Array) -> _Place:
        """One state."""
        none, n = np.zeros(0), len(x)
        return cls(lambda _: x, none, none, lambda _: none, (x, np.zeros((n, 0)), none, np.zeros((0, 0))))

    def others(self, other: _Place) -> bool:
        """Whether states of the other that are none of this one come arbitrarily near it."""
        return self.touches(other) and any(not _Place.at(x).touches(self) for x in other.states())

    def starts(self) -> list[Array]:
        """Parameters c all over the domain."""
        low = np.where(np.isfinite(self.low), self.low, np.minimum(self.high, REACH) - 2 * REACH)
        high = np.where(np.isfinite(self.high), self.high, low + 2 * REACH)
        shares = (0.0, 0.03, 0.31, 0.52, 0.77, 1.0) if len(low) < 2 else (0.03, 0.52, 0.97)
        every = (low + np.array(q) * (high - low) for q in itertools.product(shares, repeat=len(low)))
        return [c for c in every if np.all(self.sides(c) >= -NEAR)]

    def states(self) -> list[Array]:
        """States all over it."""
        return [x for c in self.starts() if np.all(np.isfinite(x := self.x(c)))]

    def touches(self, other: _Place) -> bool:
        """Whether they have a state in common, their borders included."""
        if self.lines is not None and other.lines is not None:
            return _meet_in_lines(self, other)
        return self._meets(other)

    def _meets(self, other: _Place) -> bool:
        from scipy.optimize import least_squares

        k = len(self.low)

        def apart(c: Array) -> Array:
            inside = np.concatenate([self.sides(c[:k]), other.sides(c[k:])])
            left = np.concatenate([self.x(c[:k]) - other.x(c[k:]), np.minimum(inside, 0.0)])
            return np.asarray(np.nan_to_num(left, nan=1e6))

        low, high = np.concatenate([self.low, other.low]), np.concatenate([self.high, other.high])
        if np.any(low >= high):
            return False
        tight = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}
        mine, others = ((p.starts()[::2] if len(p.low) else [p.low]) for p in (self, other))
        for pair in itertools.product(mine, others):
            start = np.clip(np.concatenate(pair), low, high)
            with np.errstate(all="ignore"):
                result = least_squares(apart, start, bounds=(low, high), **tight)
            if np.max(np.abs(result.fun)) <= APART:
                return True
        return False


def _meet_in_lines(a: _Place, b: _Place) -> bool:
    """By linear programming: the least distance of two polytopes."""
    from scipy.optimize import linprog

    assert a.lines is not None
    assert b.lines is not None
    (x, D, g, G), (y, E, h, H) = a.lines, b.lines
    n, k = len(x), D.shape[1] + E.shape[1]
    if k == 0:
        return bool(np.max(np.abs(x - y)) <= NEAR * (1 + np.max(np.abs(x))))
    apart, ones = np.hstack([D, -E]), np.ones((n, 1))
    sides = np.block([[G, np.zeros((len(G), E.shape[1]))], [np.zeros((len(H), D.shape[1])), H]])
    inside = np.hstack([-sides, np.zeros((len(sides), 1))])
    rows = np.vstack([np.hstack([apart, -ones]), np.hstack([-apart, -ones]), inside])
    right = np.concatenate([y - x, x - y, g, h])
    ends = [*zip(np.concatenate([a.low, b.low]), np.concatenate([a.high, b.high]), strict=True), (0, None)]
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    result = linprog([*[0.0] * k, 1.0], rows, right, bounds=ends, options=options)
    return bool(result.success and result.fun <= NEAR * (1 + np.max(np.abs(x + D @ result.x[: D.shape[1]]))))


def _function(free: Sequence[Symbol], rows: Sequence[Expr]) -> Callable[[Array], Array]:
    raw: Any = sympy.lambdify([free], list(rows), "numpy")

    def function(c: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.array([complex(q).real if not np.iscomplex(q) else np.nan for q in raw(c)], dtype=float)

    return function


def _lines(
    free: Sequence[Symbol], x: Sequence[Expr], sides: Sequence[Expr]
) -> tuple[Array, Array, Array, Array] | None:
    out = []
    for rows in (x, sides):
        slopes = sympy.Matrix(len(rows), len(free), [e.diff(q) for e in rows for q in free])
        if slopes.free_symbols or any(not q.is_number for q in slopes):
            return None
        at = np.array([float(q.subs(dict.fromkeys(free, 0))) for q in rows], dtype=float)
        out += [at, np.array(slopes.tolist(), dtype=float).reshape(len(rows), len(free))]
    return out[0], out[1], out[2], out[3]
