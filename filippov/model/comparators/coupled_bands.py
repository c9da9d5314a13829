"""Two or three bands of Switch or Karnopp models whose signs act on each other's rate: a robot's joints.
More of them are in `filippov.model.comparators.moving_stick`.

    dh_i/dt = R_i + sum_j A_ij s_j,   lo_i <= s_i <= hi_i

A surface outside its band has the sign +-1. Within the bands of a set K of them the signs are those of their
stick (`filippov.model.comparators.stick_levels`): the s in the box at which each dh_i/dt is 0, or < 0 with
s_i = lo_i, or > 0 with s_i = hi_i. There is exactly one where -A is a P-matrix (Cottle, Pang & Stone 1992),
as friction through any mass matrix has it. With the parameters at their defaults this is proved where states
act on A by angles only (`filippov.model.comparators.unique_stick`), and sampled elsewhere, in states drawn at
random. Those that stick then solve dh_i/dt = -alpha_i h_i together.

Where the rows of A in K are dependent, as for a body between two belts, not all can be brought to 0: within
all bands those that depend on the ones before have s = h/eta, as `filippov.model.comparator.Band` has.
Source: Leine & van de Wouw 2008 for the stick of several, Karnopp 1985 and Leine 2000 for the bands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import combinations, product

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.model.comparator import BALANCES, Karnopp
from filippov.model.comparators.stick_band import OTHERS, NewSurfaces, StickBand, moved_onto
from filippov.model.comparators.stick_levels import (
    DOWN,
    MOST,
    STICK,
    UP,
    Affine,
    StickLevels,
    balanced,
)
from filippov.model.comparators.unique_stick import unique
from filippov.model.symbolic import Select, convex
from filippov.model.symbols import t

SAMPLES = 64
SINGULAR = 1e-9  # a determinant over the product of the diagonal that is 0 but for rounding
WITHIN = 10  # how far levels are moved within the band of one that is to be outside, in ranges of signs
Leaves = dict[tuple[str, ...], dict[Symbol, Expr]]
Places = tuple[int, ...]  # of each band: 1 above it, 0 within it, -1 below it


def coupled(bands: Sequence[StickBand]) -> tuple[list[StickBand], list[CoupledBands], list[StickBand]]:
    """The bands that are alone, the groups that share a rate, and all bands of groups of more than MOST."""
    groups: list[list[StickBand]] = []
    for band in bands:
        near = [group for group in groups if any(_meet(band, other) for other in group)]
        groups = [group for group in groups if group not in near] + [[band, *(q for g in near for q in g)]]
    groups = [sorted(group, key=lambda band: band.i) for group in groups]
    return (
        [group[0] for group in groups if len(group) == 1],
        [CoupledBands(group) for group in groups if 1 < len(group) <= MOST],
        [band for group in groups if len(group) > MOST for band in group],
    )


def _meet(one: StickBand, two: StickBand) -> bool:
    return bool(one.rate.has(two.s, two.a) or two.rate.has(one.s, one.a))


class CoupledBands:
    """A group of bands. Raises ModelError where its stick is not one of a kind."""

    def __init__(self, bands: Sequence[StickBand]) -> None:
        self.bands = tuple(bands)
        self.form = bands[0].form
        self.name = f"{bands[0].name} beside " + " and ".join(repr(band.surface.name) for band in bands[1:])
        self.free = {band.s for band in bands}
        self.levels: dict[tuple[int, ...], StickLevels] = {}
        self.place = [sympy.Dummy(f"h{band.i}", real=True) for band in bands]
        self._lost: dict[tuple[int, ...], list[Expr]] = {}
        still = {band.a: sympy.S.Zero for band in bands}
        fields = [convex(f, self.free).xreplace(still) for f in bands[0].equations]
        self.effects = [[f.diff(band.s) for f in fields] for band in bands]
        self.gradients = [[band.h.diff(x) for x in self.form.x] for band in bands]
        if any(e.has(*self.free) for row in self.effects for e in row):
            raise ModelError(f"{self.name}: the product of their signs acts on the state. {OTHERS}")
        numbers = range(len(bands))
        self.sets = [k for size in range(1, len(bands) + 1) for k in combinations(numbers, size)]
        self.kept = self._independent()

    def _independent(self) -> dict[tuple[int, ...], tuple[int, ...]]:
        """Of every set within its bands those that do not depend on the ones before; ModelError."""
        count = len(self.bands)
        matrix = sympy.Matrix(count, count, lambda i, j: -_dot(self.gradients[i], self.effects[j]))
        defaults = {q: sympy.Float(q.parameter.default) for q in self.form.p}
        # With dependent rows there is no P-matrix: of these the minors are 0, and what is drawn shows them.
        held = unique(matrix.xreplace(defaults), self.sets)
        self.proved = held.proved
        drawn = [q for q in self._drawn(matrix, held.at) if q is not None]
        if not drawn:
            raise ModelError(f"{self.name}: how their signs act on dh/dt has no value in any state. {OTHERS}")
        minors = {k: [_minor(numbers, k) for numbers, _ in drawn] for k in self.sets}
        for k in self.sets:
            least = int(np.argmin(minors[k]))
            if minors[k][least] < (SINGULAR if len(k) == 1 else -SINGULAR):
                numbers, at = drawn[least]
                raise ModelError(
                    f"{self.name}: their signs act on dh/dt by {(-numbers).tolist()} where {at}, expected a "
                    "negative diagonal and determinants of the sign of as many friction forces, so that the "
                    f"stick of all is unique. {OTHERS}"
                )
        out = {}
        for k in self.sets:
            kept: tuple[int, ...] = ()
            for i in k:
                if max(minors[*kept, i]) > SINGULAR:
                    kept = (*kept, i)
            out[k] = kept
        return out

    def _drawn(
        self, matrix: sympy.Matrix, first: Mapping[Symbol, float] | None
    ) -> Iterator[tuple[np.ndarray, str] | None]:
        """-A in a first state and at random, parameters at their defaults; None where it has no value."""
        rng = np.random.default_rng(0)
        held = sorted((q for q in matrix.free_symbols if q not in self.form.p), key=lambda q: str(q.name))
        defaults = {q: sympy.Float(q.parameter.default) for q in self.form.p}
        for k in range(SAMPLES if held else 1):
            at = dict(zip(held, rng.uniform(-4, 4, len(held)).round(3).tolist(), strict=True))
            at |= first if first is not None and k == 0 else {}
            known = defaults | {q: sympy.Float(abs(v) if q.is_nonnegative else v) for q, v in at.items()}
            values = [sympy.N(e.xreplace(known)) for e in matrix]
            if not all(v.is_Float or v.is_Integer for v in values):
                yield None
                continue
            words = ", ".join(f"{q.name} = {known[q]:.4g}" for q in held) or "parameters have their defaults"
            yield np.array(values, dtype=float).reshape(matrix.shape), words

    def _projection(self, inside: Sequence[int]) -> list[Expr]:
        """What each state loses where h (here its `place`) is brought to 0 along what the signs do."""
        key = tuple(inside)
        if key not in self._lost:
            self._lost[key] = moved_onto(
                [self.place[i] for i in key], [self.gradients[i] for i in key],
                [self.effects[i] for i in key], self.form.x, self.form.p,
            )  # fmt: skip
        return self._lost[key]

    def _seen(self, inside: tuple[int, ...], outside: Mapping[int, Expr], tested: bool) -> dict[Symbol, Expr]:
        """What signs, sizes and states are within some bands; the signs of those kept there stay.

        outside: the sign of each other one, +-1 or an expression that is either.
        """
        out: dict[Symbol, Expr] = {}
        still = [i for i in self.kept[inside] if self._still(i, tested)]
        # Beyond its band, where a level says nothing, its formula must have a value nevertheless.
        reach = [band.h * band.width / size if tested else band.h
                 for band, size in zip(self.bands, self._larger, strict=True)]  # fmt: skip
        by = dict(zip(self.place, reach, strict=True))
        lost = [less.xreplace(by) for less in self._projection(still)] if still else []
        if still and not lost:
            names = ", ".join(repr(self.bands[i].surface.name) for i in still)
            raise ModelError(
                f"{self.name}: the ratio in which the signs of {names} act on the velocities changes with "
                f"these, expected one of the places alone, as a mass matrix has it. {OTHERS}"
            )
        for x, less in zip(self.form.x, lost, strict=False):
            if less != 0:
                out[x] = x - less
        for i in inside:
            band = self.bands[i]
            out[band.a] = sympy.S.Zero
            if i not in self.kept[inside]:
                out[band.s] = band.h / band.width
        for j, side in outside.items():
            band = self.bands[j]
            out[band.s] = side
            shift = band.h.xreplace(out) - band.h if lost else sympy.S.Zero
            size = {1: band.width + band.above, -1: band.width + band.below}
            out[band.a] = size.get(side, self._larger[j]) + side * sympy.expand(shift)
        return out

    def _still(self, i: int, tested: bool) -> bool:
        """Whether the state is taken at h = 0 of a band: by Karnopp, in the tests by Switch at rest."""
        own = self.bands[i].own
        if isinstance(own, Karnopp):
            return True
        return tested and own.balance == BALANCES[0] and bool(self._projection([i]))

    def _rates(self, seen: dict[Symbol, Expr]) -> list[Expr]:
        """dh/dt of all."""
        fields = [convex(f, self.free).xreplace(seen) for f in self.bands[0].equations]
        return [
            band.h.diff(t) + _dot(row, fields) for band, row in zip(self.bands, self.gradients, strict=True)
        ]

    @cached_property
    def _larger(self) -> list[Expr]:
        """max(|h|, eta) of every band, as its edges measure it."""
        return [(band.above + band.below) / 2 for band in self.bands]

    @cached_property
    def _bounds(self) -> list[tuple[Expr, Expr]]:
        return [self.form.radius[band.i] for band in self.bands]

    def add_rates(self, new: NewSurfaces, even: Callable[[Expr], Expr]) -> None:
        """Add the surfaces on which static levels are reached, for every set that is within its bands.

        Beyond a band its sign is h/max(|h|, eta), which its edges measure: both sides have one level.
        """
        names = [band.surface.name for band in self.bands]
        for inside in self.sets:
            beyond = [j for j in range(len(self.bands)) if j not in inside]
            outside = {j: self.bands[j].h / self._larger[j] for j in beyond}
            away = sympy.Add(
                *(self._larger[i] / self.bands[i].width - 1 for i in inside),
                *(WITHIN * (1 - side**2) for side in outside.values()),
            )
            kept = self.kept[inside]
            rates = [even(rate) for rate in self._rates(self._seen(inside, outside, True))]
            left = [q for i in kept for q in (*self.form.s, *self.form.a) if rates[i].has(q)]
            if set(left) - self.free:
                raise ModelError(
                    f"{self.name}: dh/dt depends on the sign of another surface than theirs, which is no "
                    f"function of the state. {OTHERS}"
                )
            signs = [self.bands[i].s for i in kept]
            given = Affine.of([rates[i] for i in kept], signs)
            bounds = [self._bounds[i] for i in kept]
            own = [names[i] for i in kept]
            others = [tuple(names[j] for j in inside if j != i) for i in kept]
            self.levels[inside] = StickLevels(own, others, bounds, given, away, new)

    def put_into(self, equations: Sequence[Expr]) -> list[Expr]:
        """The equations, divided by the bands where the surfaces act on them."""
        leaves = {places: self._leaves(places) for places in product((1, 0, -1), repeat=len(self.bands))}
        return [self._divided(convex(f, self.free), (), leaves) for f in equations]

    def _leaves(self, places: Places) -> Leaves:
        """What stands for signs, sizes and states, by what each kept band does: slides, or is at an end."""
        inside = tuple(i for i, place in enumerate(places) if place == 0)
        outside = {i: sympy.Integer(place) for i, place in enumerate(places) if place}
        if not inside:
            self.kept[()] = ()
        seen = self._seen(inside, outside, False)
        kept = self.kept[inside]
        if not kept:
            return {(): seen}
        rates = self._rates(seen)
        signs = [self.bands[i].s for i in kept]
        moving = Affine.of([rates[i] + self.bands[i].alpha * self.bands[i].h for i in kept], signs)
        out = {}
        for states in product((DOWN, STICK, UP), repeat=len(kept)):
            ends = {k: state == UP for k, state in enumerate(states) if state != STICK}
            fixed = {k: self._bounds[kept[k]][end] for k, end in ends.items()}
            out[states] = seen | dict(zip(signs, balanced(moving, fixed), strict=True))
        return out

    def _divided(self, f: Expr, places: Places, leaves: dict[Places, Leaves]) -> Expr:
        if len(places) == len(self.bands):
            inside = tuple(i for i, place in enumerate(places) if place == 0)
            at = {states: f.xreplace(values) for states, values in leaves[places].items()}
            return self.levels[inside].chosen(at) if inside else at[()]
        band = self.bands[len(places)]
        above, within, below = (self._divided(f, (*places, place), leaves) for place in (1, 0, -1))
        return Select(band.upper, above, Select(band.lower, within, below))


def _dot(row: Sequence[Expr], other: Sequence[Expr]) -> Expr:
    return sympy.Add(*(a * b for a, b in zip(row, other, strict=True) if a != 0))


def _minor(numbers: np.ndarray, k: tuple[int, ...]) -> float:
    """A principal minor over the product of its diagonal; of one number its sign."""
    part = numbers[np.ix_(k, k)]
    if len(k) == 1:
        return float(np.sign(part[0, 0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.linalg.det(part) / np.prod(np.diag(part)))
