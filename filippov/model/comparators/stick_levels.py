"""The static levels of up to three surfaces within their bands at once, and the signs of their stick.

    r_i = c_i + sum_j A_ij s_j,   lo_i <= s_i <= hi_i,   r_i = 0, or r_i < 0 at lo_i, or r_i > 0 at hi_i

With -A a P-matrix this has one solution, continuous and linear in pieces in c (Cottle, Pang & Stone 1992).
One alone is s = clip(-c/A, lo, hi). Of two, r_1 along the s_2 that belongs to s_1 is the middle one of three
falling lines, s_2 at an end or balanced: s_1 is the middle one of their zeros, clipped. Both are written by
|.| of surfaces, two for each clip. Of three, the last one is down where r_3 < 0 at lo_3 with the signs that
the other two then have, and up likewise; it is taken out where it is balanced (its Schur complement).

So there are 2, 6 and 20 levels for one, two and three, and one more for each A_ij that has no known sign: 14
or 15 surfaces with their edges for two frictions, and 50 to 56 for three, each with an event where it is
passed. Four had 194, and the signs of three would have to be written by |.|: these are in
`filippov.model.comparators.moving_stick`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import sympy
from sympy import Expr, Symbol

from filippov.model.comparators.stick_band import UNIT, NewSurfaces
from filippov.model.surface import Surface
from filippov.model.symbolic import Select

DOWN, STICK, UP = "down", "stick", "up"
MARKS = {DOWN: "-", STICK: "0", UP: "+"}
MOST = 3  # surfaces that share a rate
Bounds = tuple[Expr, Expr]


@dataclass(frozen=True)
class Affine:
    """r = c + A s."""

    c: tuple[Expr, ...]
    A: tuple[tuple[Expr, ...], ...]

    @classmethod
    def of(cls, rates: Sequence[Expr], signs: Sequence[Symbol]) -> Affine:
        """Rates that hold the signs linearly."""
        zero = dict.fromkeys(signs, sympy.S.Zero)
        return cls(
            tuple(r.xreplace(zero) for r in rates), tuple(tuple(r.diff(s) for s in signs) for r in rates)
        )

    def fixed(self, k: int, s: Expr) -> Affine:
        """The others, with the sign of number k given."""
        return self._without(k, [row[k] * s for row in self.A], self.A)

    def balanced(self, k: int) -> Affine:
        """The others, with r_k = 0."""
        share = [row[k] / self.A[k][k] for row in self.A]
        rows = [[e - q * own for e, own in zip(row, self.A[k], strict=True)]
                for row, q in zip(self.A, share, strict=True)]  # fmt: skip
        return self._without(k, [-q * self.c[k] for q in share], rows)

    def _without(self, k: int, more: Sequence[Expr], rows: Sequence[Sequence[Expr]]) -> Affine:
        left = [i for i in range(len(self.c)) if i != k]
        return Affine(
            tuple(self.c[i] + more[i] for i in left), tuple(tuple(rows[i][j] for j in left) for i in left)
        )


def balanced(given: Affine, fixed: Mapping[int, Expr]) -> list[Expr]:
    """The signs at which r is 0 for all but the fixed ones."""
    free = [k for k in range(len(given.c)) if k not in fixed]
    for k in sorted(fixed, reverse=True):
        given = given.fixed(k, fixed[k])
    stages = [given]
    for _ in free[1:]:
        stages.append(stages[-1].balanced(len(stages[-1].c) - 1))
    signs: list[Expr] = []
    for stage in reversed(stages[: len(free)]):
        k = len(signs)
        rest = sympy.Add(stage.c[k], *(a * s for a, s in zip(stage.A[k][:k], signs, strict=True)))
        signs.append(-rest / stage.A[k][k])
    out = dict(zip(free, signs, strict=True)) | dict(fixed)
    return [out[k] for k in range(len(out))]


class StickLevels:
    """The surfaces of a set of bands, added to new ones in their order.

    own, others   names: of each surface that has a level, and of those within their bands beside it
    away          0 where just these are within their bands, and > 0 elsewhere: there all levels are moved to
                  where they stick. Otherwise those of other sets, which then say nothing, would be passed as
                  well, many of them at once
    """

    def __init__(
        self, own: Sequence[str], others: Sequence[tuple[str, ...]], bounds: Sequence[Bounds], given: Affine,
        away: Expr, new: NewSurfaces,
    ) -> None:  # fmt: skip
        self.own, self.others, self.bounds, self.away, self.new = own, others, bounds, away, new
        self.tests: dict[tuple[int, str, str], Symbol] = {}  # number, state of the third, end
        if len(own) < MOST:
            self._add(list(range(len(own))), given, "")
            return
        level = []
        for state, bound in zip((DOWN, UP), bounds[2], strict=True):
            signs = self._add([0, 1], given.fixed(2, bound), state)
            level.append(-_at(given, 2, [*signs, bound]))
        self._add([0, 1], given.balanced(2), STICK)
        for end, h in zip((DOWN, UP), level, strict=True):
            self._level(2, "", end, h, given.A[2][2])

    def _add(self, numbers: Sequence[int], given: Affine, third: str) -> list[Expr]:
        """Add the levels of one or two; return their signs."""
        signs: list[Expr] = []
        if len(numbers) == 2:
            middle = self._middle(numbers, given, third)
            low, high = self.bounds[numbers[0]]
            sizes = [self._level(numbers[0], third, end, bound - middle, sympy.S.NegativeOne)
                     for end, bound in ((DOWN, low), (UP, high))]  # fmt: skip
            signs.append((low + high + sizes[0] - sizes[1]) / 2)
        k = numbers[-1]
        bounds = self.bounds[k]
        slope = given.A[-1][-1]
        sizes = [self._level(k, third, end, -_at(given, -1, [*signs, bound]), slope)
                 for end, bound in zip((DOWN, UP), bounds, strict=True)]  # fmt: skip
        signs.append((sum(bounds) - (sizes[0] - sizes[1]) / slope) / 2)
        return signs

    def _middle(self, numbers: Sequence[int], given: Affine, third: str) -> Expr:
        """The middle one of the zeros of r_1 with s_2 at its ends, and balanced."""
        first = numbers[0]
        (own, other), bounds = given.A[0], self.bounds[numbers[1]]
        if other == 0:
            return -given.c[0] / own
        ends = [-(given.c[0] + other * bound) / own for bound in bounds]
        mean, half = (ends[0] + ends[1]) / 2, (bounds[1] - bounds[0]) / 2
        if other.is_nonnegative or other.is_nonpositive:
            size = other if other.is_nonnegative else -other
        else:
            size = self._kink(first, third, "coupling", other)
        reach = -size * half / own
        alone = given.balanced(1)
        zero = -alone.c[0] / alone.A[0][0] - mean
        low, high = (
            self._kink(first, third, end, zero + side * reach) for end, side in (("low", 1), ("high", -1))
        )
        return mean + (low - high) / 2

    def _level(self, k: int, third: str, end: str, h: Expr, slope: Expr) -> Symbol:
        """Add a level; return its size. slope: what h falls with per sign."""
        low, high = self.bounds[k]
        h += slope * (high - low) * (self.away if end == DOWN else -self.away)
        surface = Surface(level_name(self.own[k], end, *self._beside(k, third)), self.new.plain(h))
        self.tests[k, third, end], size = self.new.add(surface, h, UNIT)
        return size

    def _kink(self, k: int, third: str, what: str, h: Expr) -> Symbol:
        low, high = self.bounds[k]
        h += (high - low) * self.away
        surface = Surface(level_name(self.own[k], what, *self._beside(k, third)), self.new.plain(h))
        return self.new.add(replace(surface, kind="kink"), h, UNIT)[1]

    def _beside(self, k: int, third: str) -> list[str]:
        return [name + (MARKS[third] if third and name == self.own[2] else "") for name in self.others[k]]

    def chosen(self, at: Mapping[tuple[str, ...], Expr]) -> Expr:
        """An expression for each combination of what the surfaces do, chosen by the levels."""
        count = len(self.own)
        order = [2, 0, 1] if count == MOST else list(range(count))

        def choose(done: dict[int, str]) -> Expr:
            if len(done) == count:
                return at[tuple(done[k] for k in range(count))]
            k = order[len(done)]
            third = done.get(2, "")
            down, up = (self.tests[k, third, end] for end in (DOWN, UP))
            return Select(
                down, choose(done | {k: DOWN}), Select(up, choose(done | {k: STICK}), choose(done | {k: UP}))
            )

        return choose({})


def _at(given: Affine, k: int, signs: Sequence[Expr]) -> Expr:
    return sympy.Add(given.c[k], *(a * s for a, s in zip(given.A[k], signs, strict=True)))


def level_name(surface: str, end: str, *beside: str) -> str:
    """The name of a level of a surface, within its band and those of others."""
    return f"{surface}:{end}" + (f" with {', '.join(beside)}" if beside else "")


def modes_of_stick(surface: str, surfaces: frozenset[str]) -> list[dict[str, str]]:
    """The modes in which a surface under Switch or Karnopp sticks, by the names of all surfaces."""
    def edges(name: str) -> dict[str, str]:
        return {f"{name}:upper": "-", f"{name}:lower": "+"}

    def present(name: str, beside: Sequence[str]) -> Iterator[dict[str, str]]:
        """Its stick, under the names that the levels have: in one order of those beside it."""
        for names in permutations(beside):
            if level_name(name, DOWN, *names) in surfaces:
                yield {level_name(name, DOWN, *names): "-", level_name(name, UP, *names): "+"}

    every = sorted(q.removesuffix(":upper") for q in surfaces if q.endswith(":upper"))
    group = [
        q for q in every
        if q != surface and {level_name(surface, DOWN, q), level_name(q, DOWN, surface)} & surfaces
    ]  # fmt: skip
    out = []
    for size in range(len(group) + 1):
        for within in combinations(group, size):
            outside = [({f"{q}:upper": "+"}, {f"{q}:lower": "-"}) for q in group if q not in within]
            inside = merged(edges(q) for q in (surface, *within))
            stuck = list(present(surface, within))
            for third, (state, mark) in product(within, MARKS.items()):
                marked = [q + mark if q == third else q for q in within]
                for levels in present(third, [q for q in (surface, *within) if q != third]):
                    down, up = levels
                    signs = {down: "+"} if state == DOWN else {down: "-", up: "+" if state == STICK else "-"}
                    stuck += [signs | own for own in present(surface, marked)]
            out += [merged((inside, own, *places)) for own in stuck for places in product(*outside)]
    return out


def merged(parts: Iterable[dict[str, str]]) -> dict[str, str]:
    """Signs of surfaces, put together."""
    return {name: sign for part in parts for name, sign in part.items()}
