"""Two bands of Switch or Karnopp models whose signs act on each other's rate: both frictions of one body.

    dh_i/dt = R_i + A_i1 s_1 + A_i2 s_2,   lo_i <= s_i <= hi_i

With one surface outside its band its sign is +-1, and the other is as alone. Within both, the signs are those
of the stick of the pair: the s in the box at which each dh_i/dt is 0, or < 0 with s_i = lo_i, or > 0 with
s_i = hi_i. There is exactly one, because A_11, A_22 < 0 < det A is asked for (Cottle, Pang & Stone 1992).
s_1 is lo_1 just where dh_1/dt < 0 at lo_1 with s_2 clipped to its own stick there, which decides the pair by
four signs. Those that stick then solve dh_i/dt = -alpha_i h_i together.

Where det A = 0, as for a body between two belts, both cannot be brought to 0. Within both bands the second
has then s_2 = h_2/eta_2, as `filippov.model.comparator.Band` has. Source: Leine & van de Wouw 2008 for the
problem of the pair, Karnopp 1985 and Leine 2000 for the bands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.model.comparator import BALANCES, Karnopp
from filippov.model.comparators.stick_band import OTHERS, UNIT, NewSurfaces, StickBand, moved_onto
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, convex
from filippov.model.symbols import t

DOWN, STICK, UP = "down", "stick", "up"
Leaves = dict[tuple[str, ...], dict[Symbol, Expr]]
SIDES = (1, 0, -1)  # above its band, within it, below it


def coupled(bands: Sequence[StickBand]) -> tuple[list[StickBand], list[CoupledBands]]:
    """The bands that are alone, and the pairs that share a rate. Raises ModelError for three that do.

    Of n bands that share a rate k are within theirs in C(n, k) 2**(n - k) ways, with 2 k static levels each:
    2 n 3**(n - 1) surfaces, and those that clip the other signs. That is 24 for two, more than 100 for three,
    each with an event where it is passed.
    """
    groups: list[list[StickBand]] = []
    for band in bands:
        near = [group for group in groups if any(_meet(band, other) for other in group)]
        groups = [group for group in groups if group not in near] + [[band, *(q for g in near for q in g)]]
    for group in groups:
        if len(group) > 2:
            names = ", ".join(repr(band.surface.name) for band in sorted(group, key=lambda band: band.i))
            raise ModelError(
                f"{group[0].name}: {len(group)} surfaces, {names}, act on each other's dh/dt; Switch and "
                "Karnopp are there for two that do. Choose Band or Smooth for all but two of them, or "
                'method="Moreau", which solves for the sticks of any number.'
            )
    alone = [group[0] for group in groups if len(group) == 1]
    pairs = [CoupledBands(*sorted(group, key=lambda band: band.i)) for group in groups if len(group) == 2]
    return alone, pairs


def _meet(one: StickBand, two: StickBand) -> bool:
    return bool(one.rate.has(two.s, two.a) or two.rate.has(one.s, one.a))


class CoupledBands:
    """The pair of two bands. Raises ModelError where its stick is not one of a kind."""

    def __init__(self, one: StickBand, two: StickBand) -> None:
        self.bands = (one, two)
        self.form = one.form
        self.name = f"{one.name} beside {two.surface.name!r}"
        self.free = {one.s, two.s}
        self.tests: dict[tuple[int, int, int, str], Symbol] = {}
        still = {one.a: sympy.S.Zero, two.a: sympy.S.Zero}
        fields = [convex(f, self.free).xreplace(still) for f in one.equations]
        self.effects = [[f.diff(band.s) for f in fields] for band in self.bands]
        self.gradients = [[band.h.diff(x) for x in self.form.x] for band in self.bands]
        if any(e.has(*self.free) for row in self.effects for e in row):
            raise ModelError(f"{self.name}: the product of their signs acts on the state. {OTHERS}")
        matrix = sympy.Matrix(2, 2, lambda i, j: _dot(self.gradients[i], self.effects[j]))
        det = sympy.factor(matrix.det())
        self.parallel = det == 0
        signs = [sympy.factor(matrix[0, 0]).is_negative, sympy.factor(matrix[1, 1]).is_negative]
        if not all([*signs, self.parallel or det.is_positive]):
            raise ModelError(
                f"{self.name}: their signs act on dh/dt by {matrix.tolist()}, expected a negative diagonal "
                "and a determinant >= 0 for all states and parameters, so that the stick of the two is "
                "unique. Bounds of the parameters show it: parameters(m=Parameter(2, lower=1e-9)). Otherwise "
                f"c{OTHERS[1:]}"
            )

    def _projection(self, inside: Sequence[int]) -> list[Expr]:
        """What each state loses where h is brought to 0 along what the signs do, as by an impulse."""
        return moved_onto(
            [self.bands[i].h for i in inside], [self.gradients[i] for i in inside],
            [self.effects[i] for i in inside], (), self.form.p,
        )  # fmt: skip

    def _seen(self, sides: tuple[int, int], tested: bool) -> dict[Symbol, Expr]:
        """What signs, sizes and states are, with each surface on its side; within their bands signs stay."""
        out: dict[Symbol, Expr] = {}
        kept = [i for i in (0, 1) if sides[i] == 0]
        if self.parallel:
            kept = kept[:1]
        still = [i for i in kept if self._still(i, tested)]
        lost = self._projection(still) if still else []
        for x, less in zip(self.form.x, lost, strict=False):
            if less != 0:
                out[x] = x - less
        for band, side in zip(self.bands, sides, strict=True):
            if side == 0:
                out[band.a] = sympy.S.Zero
                continue
            out[band.s] = sympy.Integer(side)
            shift = band.h.xreplace(out) - band.h if lost else sympy.S.Zero
            out[band.a] = band.width + (band.above if side > 0 else band.below) + side * sympy.expand(shift)
        if self.parallel and sides == (0, 0):
            second = self.bands[1]
            out[second.s] = second.h / second.width
        return out

    def _still(self, i: int, tested: bool) -> bool:
        """Whether the state is taken at h = 0 of a band: by Karnopp, in the tests by Switch at rest."""
        own = self.bands[i].own
        if isinstance(own, Karnopp):
            return True
        return tested and own.balance == BALANCES[0] and bool(self._projection([i]))

    def _rates(self, sides: tuple[int, int], tested: bool) -> list[Expr]:
        """dh/dt of both."""
        seen = self._seen(sides, tested)
        fields = [convex(f, self.free).xreplace(seen) for f in self.bands[0].equations]
        return [
            band.h.diff(t) + _dot(row, fields) for band, row in zip(self.bands, self.gradients, strict=True)
        ]

    @cached_property
    def _bounds(self) -> list[tuple[Expr, Expr]]:
        return [self.form.radius[band.i] for band in self.bands]

    def add_rates(self, new: NewSurfaces, even: Callable[[Expr], Expr]) -> None:
        """Add the surfaces on which the static levels are reached, for each side of the other surface."""
        for sides in ((a, b) for a in SIDES for b in SIDES if 0 in (a, b)):
            rates = [even(rate) for rate in self._rates(sides, True)]
            both = sides == (0, 0) and not self.parallel
            for i, band in enumerate(self.bands):
                if sides[i] != 0 or (sides == (0, 0) and self.parallel and i == 1):
                    continue
                for bound, end in zip(self._bounds[i], (DOWN, UP), strict=True):
                    other = 1 - i
                    mark = {1: "+", 0: "0", -1: "-"}[sides[other]]
                    name = f"{band.surface.name}:{end} {self.bands[other].surface.name}{mark}"
                    level = -rates[i].xreplace({band.s: bound})
                    if both:
                        s = self.bands[other].s
                        level = level.xreplace({s: self._clipped(other, rates, bound, name, new)})
                    left = [q for q in (*self.form.s, *self.form.a) if level.has(q)]
                    if left:
                        raise ModelError(
                            f"{band.name}: dh/dt depends on the sign of another surface than that of "
                            f"{self.bands[other].surface.name!r}, which is no function of the state. {OTHERS}"
                        )
                    surface = Surface(name, new.plain(level))
                    self.tests[(i, *sides, end)] = new.add(surface, level, UNIT)[0]

    def _clipped(self, j: int, rates: Sequence[Expr], bound: Expr, name: str, new: NewSurfaces) -> Expr:
        """s_j of the stick of j with the other sign at a bound, clipped to the set of j."""
        band, other = self.bands[j], self.bands[1 - j]
        free = rates[j].xreplace({other.s: bound})
        s = -free.xreplace({band.s: sympy.S.Zero}) / free.diff(band.s)
        low, high = self._bounds[j]
        sizes = []
        for level, end in ((low, "low"), (high, "high")):
            h = s - level
            surface = replace(Surface(f"{name} {end}", new.plain(h)), kind="kink")
            sizes.append(new.add(surface, h, UNIT)[1])
        return (low + high + sizes[0] - sizes[1]) / 2

    def put_into(self, equations: Sequence[Expr]) -> list[Expr]:
        """The equations, divided by the two bands where the surfaces act on them."""
        leaves = {(a, b): self._leaves((a, b)) for a in SIDES for b in SIDES}
        return [self._divided(convex(f, self.free), leaves) for f in equations]

    def _leaves(self, sides: tuple[int, int]) -> Leaves:
        """What stands for signs, sizes and states, by what each band does: slides, or is at an end."""
        seen = self._seen(sides, False)
        inside = [i for i in (0, 1) if sides[i] == 0]
        if self.parallel:
            inside = inside[:1]
        if not inside:
            return {(): seen}
        rates = self._rates(sides, False)
        out = {}
        for states in ((a, b) for a in (DOWN, STICK, UP) for b in (DOWN, STICK, UP)):
            if any(states[i] != STICK for i in (0, 1) if i not in inside):
                continue
            fixed = {
                self.bands[i].s: self._bounds[i][0 if states[i] == DOWN else 1]
                for i in inside if states[i] != STICK
            }  # fmt: skip
            stuck = [i for i in inside if states[i] == STICK]
            out[tuple(states[i] for i in inside)] = seen | fixed | self._sticking(stuck, rates, fixed)
        return out

    def _sticking(
        self, stuck: Sequence[int], rates: Sequence[Expr], fixed: dict[Symbol, Expr]
    ) -> dict[Symbol, Expr]:
        """The signs of those that stick, where the others are fixed: dh/dt = -alpha h for all of them."""
        names = [self.bands[i].s for i in stuck]
        zero = dict.fromkeys(names, sympy.S.Zero)
        left = [rates[i].xreplace(fixed) + self.bands[i].alpha * self.bands[i].h for i in stuck]
        rest = [-e.xreplace(zero) for e in left]
        if len(stuck) == 2:
            (a, b), (c, d) = ([e.diff(s) for s in names] for e in left)
            det = sympy.factor(a * d - b * c)
            rest = [(rest[0] * d - rest[1] * b) / det, (a * rest[1] - c * rest[0]) / det]
        elif stuck:
            rest = [rest[0] / left[0].diff(names[0])]
        return dict(zip(names, rest, strict=True))

    def _divided(self, f: Expr, leaves: dict[tuple[int, int], Leaves]) -> Expr:
        one, two = self.bands
        at = {sides: self._within(f, sides, leaves[sides]) for sides in leaves}
        rows = [Select(two.upper, at[a, 1], Select(two.lower, at[a, 0], at[a, -1])) for a in SIDES]
        return Select(one.upper, rows[0], Select(one.lower, rows[1], rows[2]))

    def _within(self, f: Expr, sides: tuple[int, int], leaves: Leaves) -> Expr:
        """An equation on one side of each surface, divided by the tests of those that are in their bands."""
        count = len(next(iter(leaves)))
        inside = [i for i in (0, 1) if sides[i] == 0][:count]

        def chosen(done: tuple[str, ...]) -> Expr:
            if len(done) == count:
                return f.xreplace(leaves[done])
            i = inside[len(done)]
            down, up = (self.tests[(i, *sides, end)] for end in (DOWN, UP))
            return Select(
                down, chosen((*done, DOWN)), Select(up, chosen((*done, STICK)), chosen((*done, UP)))
            )

        return chosen(())


def _dot(row: Sequence[Expr], other: Sequence[Expr]) -> Expr:
    return sympy.Add(*(a * b for a, b in zip(row, other, strict=True) if a != 0))
