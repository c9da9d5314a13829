"""Sliding of higher order: the solution on surfaces whose signs act on a higher derivative of h only.

Where the sign of a surface does not act on dh/dt, the solution can stay on it only with h = h' = ... =
h^(r-1) = 0, and the multiplier follows from h^(r) = 0 (sliding of order r: Levant 1993; Fridman & Levant
2002, section 1). The derivatives are taken on the surface, where |h| = 0: a term |h|^(1/2) sign h is gone
there. This is an index reduction: the system that comes out has h^(r-1) in place of h, slides on it to
first order, and is followed like any other.

Signs that act on one rate only in a fixed proportion (twisting: x'' = -a sign x - b sign x') are tied to each
other, so that together they reach what they can reach apart; what they hold besides is a constraint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.arrays import Array
from filippov.model.symbolic import SymbolicForm, convex, lie_derivative, rate_along
from filippov.model.symbols import t
from filippov.model.system import System

HIGHEST_ORDER = 6
# Singular values that are zero, on the scale of the largest.
NO_RANK = 1e-9
# Of the way to the surfaces, the part that a state goes for each further state between the signs and it.
GIVES_WAY, FARTHEST = 1e-2, 6
# Answers on the same surfaces that are kept, for other values.
MOST_ANSWERS = 8
# Ends of the set of a sign that only keeps a constraint from drifting: it is 0 but for rounding.
FREE = 1e6


@dataclass(frozen=True)
class Reduction:
    """Surfaces slid on together, and the system that follows the solution on them.

    system       guards that hold the solution, in a mode with 0 for every surface of `zero`
    zero         numbers of the surfaces
    kinks        other surfaces with h = 0 on the solution, which does not depend on their signs
    sides        the sign that each of them keeps
    orders       order of sliding of each surface of `zero`
    pivots       of those the ones whose multipliers are solved for
    ties         (surface, pivot, factor): a sign that is the factor times that of a pivot
    constraints  all expressions that vanish on the solution
    distance     for every state through how many others the signs act on it
    """

    system: System
    zero: tuple[int, ...]
    kinks: tuple[int, ...]
    sides: tuple[int, ...]
    orders: tuple[int, ...]
    pivots: tuple[int, ...]
    ties: tuple[tuple[int, int, float], ...]
    constraints: tuple[Expr, ...]
    distance: tuple[int, ...]

    @property
    def order(self) -> int:
        """The highest order of sliding; 1 along kinks alone."""
        return max(self.orders, default=1)

    def projected(
        self, time: float, x: Array, values: Mapping[Symbol, float], along: Array | None = None
    ) -> Array:
        """A state close by at which every constraint holds (Gauss-Newton).

        along: the direction of the first step. What the signs act on gives way to what they do not act on, or
        by way of more states.
        """
        assert self.system.symbolic is not None
        states = self.system.symbolic.x
        slopes = _slopes(self.constraints, tuple(states))
        weights = GIVES_WAY ** np.minimum(self.distance, FARTHEST)
        moves = any(e.free_symbols & {t, *states} for row in slopes for e in row)
        x, rows = x.copy(), np.zeros(0)
        for _ in range(4):
            at = {**values, t: time, **dict(zip(states, x.tolist(), strict=True))}
            c = _numbers([self.constraints], at).ravel()
            if not np.any(c):
                break
            rows = _numbers(slopes, at) if moves or not rows.size else rows
            if along is not None:
                effect = np.nan_to_num(rows @ along)
                x, along = x - along * (effect @ c / (effect @ effect or 1.0)), None
                continue
            scale = np.linalg.norm(rows * weights, axis=1)
            scale = np.where(scale > 0.0, scale, 1.0)
            step, *_ = np.linalg.lstsq(rows * weights / scale[:, None], c / scale, rcond=1e-13)
            x = np.ascontiguousarray(x - weights * step)
        return x

    def multipliers(self, lam: Array) -> Array:
        """All signs, from those of the pivots."""
        out = lam.copy()
        for i, pivot, factor in self.ties:
            out[i] = factor * lam[pivot]
        return out


def reduction(
    system: System,
    zero: Sequence[int],
    kinks: Sequence[int],
    at: Mapping[Symbol, float],
    sliding: str = "filippov",
) -> Reduction | str:
    """The reduction of the surfaces `zero` at a point, or the reason why there is none.

    at: values of t, states, parameters, signs and sizes at a point close to the solution.
    sliding: the rule; all but "utkin" blend fields at signs of -1 and +1.
    """
    zero, kinks = tuple(sorted(zero)), tuple(sorted(kinks))
    system = system if sliding == "utkin" else _blended(system, zero)
    form = system.symbolic
    assert form is not None
    known = _answers(system, zero, kinks)
    for values, answer in known:
        if all(at.get(q) == value for q, value in values.items()):
            return answer
    asked = _Asked(at)
    answer = _reduction(system, form, zero, kinks, asked)
    known.append(({q: at.get(q) for q in asked.symbols}, answer))
    del known[:-MOST_ANSWERS]
    return answer


@lru_cache(maxsize=64)
def _blended(system: System, zero: tuple[int, ...]) -> System:
    """The system with its field as a blend of those at both signs, where it is not affine in one of them."""
    form = system.symbolic
    assert form is not None
    field = list(form.field)
    for s in (form.s[i] for i in zero):
        for k, f in enumerate(field):
            if s not in f.free_symbols or s not in convex(f, {s}).diff(s).free_symbols:
                continue
            plus, minus = f.xreplace({s: sympy.S.One}), f.xreplace({s: sympy.S.NegativeOne})
            field[k] = (plus + minus) / 2 + s * (plus - minus) / 2
    if all(f is g for f, g in zip(field, form.field, strict=True)):
        return system
    return system.with_form(replace(form, field=tuple(field)), system.surfaces)


class _Asked(Mapping[Symbol, float]):
    """Values that note which of them were looked at: where these are the same again, so is the answer."""

    def __init__(self, values: Mapping[Symbol, float]) -> None:
        self.known, self.symbols = values, set[Symbol]()

    def __getitem__(self, q: Symbol) -> float:
        self.symbols.add(q)
        return self.known[q]

    def __iter__(self) -> Iterator[Symbol]:
        return iter(self.known)

    def __len__(self) -> int:
        return len(self.known)


_Answers = list[tuple[dict[Symbol, float | None], Reduction | str]]


@lru_cache(maxsize=64)
def _answers(system: System, zero: tuple[int, ...], kinks: tuple[int, ...]) -> _Answers:
    """The last answers on these surfaces, each with the values that it was made with."""
    return []


def _reduction(
    system: System, form: SymbolicForm, zero: tuple[int, ...], kinks: tuple[int, ...],
    at: Mapping[Symbol, float],
) -> Reduction | str:  # fmt: skip
    """The answer itself."""
    sides = tuple(1 if at[form.s[i]] >= 0.0 else -1 for i in kinks)
    gone = _gone(form, zero, kinks, sides)
    signs = tuple(form.s[i] for i in zero)
    if not kinks and _of_first_order(form, zero, signs, gone, at):
        return "their signs act on the rates themselves"
    field = [_on_surface(convex(f, set(signs)).xreplace(gone), at) for f in form.field]
    if any(f.has(sympy.nan, sympy.zoo, sympy.oo) for f in field):
        return "the field has no value on the surfaces"
    found = _rows(system, form, zero, signs, field, gone, at)
    if isinstance(found, str):
        return found
    rows, constraints, orders = found
    for k in kinks:
        phi = sympy.expand(form.h[k].xreplace(gone))
        if constraints and _implied(phi, constraints, form.x, at):
            continue
        rate, effects = _rate(phi, tuple(form.x), tuple(field), signs)
        if any(effects) or not _implied(rate, constraints if zero else (*constraints, phi), form.x, at):
            return f"the solution on the surfaces leaves {_name(system, k)}"
        if not zero and rate.free_symbols - {t, *form.x, *form.p}:
            return f"the rate of {_name(system, k)} depends on other signs or sizes"
        # It stays where it is.
        constraints = (*constraints, phi)
    if not zero:
        reduced = _system(system, zero, kinks, sides, (), ())
        return Reduction(reduced, zero, kinks, sides, (), (), (), constraints, _distances(form, signs))
    # What acts only on the other side of a kink is as idle as the kink.
    idle = {i for k, i in enumerate(zero) if not any(e[k] for _, e in rows.values())}
    if idle and len(idle) < len(zero):
        resting = [i for i in idle if system.surfaces[i].reset]
        if resting:
            return f"the contact at {_name(system, resting[0])} acts on no rate"
        more = tuple(sorted({*kinks, *idle}))
        return _reduction(system, form, tuple(i for i in zero if i not in idle), more, at)
    chosen = _pivots(form, zero, rows, at)
    if isinstance(chosen, str):
        return chosen
    pivots, ties = chosen
    guards = tuple((pivot, rows[i][0]) for i, pivot in pivots)
    reduced = _system(system, zero, kinks, sides, guards, ties)
    order = tuple(orders[i] for i in zero)
    held = tuple(pivot for _, pivot in pivots)
    return Reduction(reduced, zero, kinks, sides, order, held, ties, constraints, _distances(form, signs))


def _of_first_order(
    form: SymbolicForm, zero: tuple[int, ...], signs: tuple[Symbol, ...], gone: Mapping[Symbol, Expr],
    at: Mapping[Symbol, float],
) -> bool:  # fmt: skip
    """Whether each sign acts on the rate of a surface, and each rate feels one: all slide to first order.

    Told from the states in these surfaces alone, of which a large system has many others.
    """
    guards = [sympy.expand(form.h[i].xreplace(dict(gone))) for i in zero]
    moved = [k for k, q in enumerate(form.x) if any(q in phi.free_symbols for phi in guards)]
    states = tuple(form.x[k] for k in moved)
    field = tuple(_on_surface(convex(form.field[k], set(signs)).xreplace(dict(gone)), at) for k in moved)
    if any(f.has(sympy.nan, sympy.zoo, sympy.oo) for f in field):
        return False
    slopes = [tuple(f.diff(s) for f in field) for s in signs]
    rows = [[sympy.expand(lie_derivative(phi, slope, states)) for slope in slopes] for phi in guards]
    if any(e.free_symbols & set(signs) for row in rows for e in row):
        return False
    felt = all(any(not _vanishes(e, guards, form.x) for e in row) for row in rows)
    return felt and all(any(row[k] != 0 for row in rows) for k in range(len(signs)))


def _gone(
    form: SymbolicForm, zero: Sequence[int], kinks: Sequence[int], sides: Sequence[int]
) -> dict[Symbol, Expr]:
    """What sizes and signs are on the surfaces."""
    gone: dict[Symbol, Expr] = {form.a[i]: sympy.S.Zero for i in (*zero, *kinks)}
    return gone | {form.s[i]: sympy.Integer(side) for i, side in zip(kinks, sides, strict=True)}


def _distances(form: SymbolicForm, signs: Sequence[Symbol]) -> tuple[int, ...]:
    """For every state the least number of states between the signs and it; FARTHEST where they do not act."""
    place = {q: k for k, q in enumerate(form.x)}
    read = [f.free_symbols for f in form.field]
    distance = [0 if symbols & set(signs) else FARTHEST for symbols in read]
    through = [[place[q] for q in symbols & place.keys()] for symbols in read]
    for _ in range(FARTHEST):
        for j, by in enumerate(through):
            distance[j] = min([distance[j], *(distance[k] + 1 for k in by)])
    return tuple(distance)


def _on_surface(f: Expr, at: Mapping[Symbol, float]) -> Expr:
    """A field on h = 0, where a power of |h| with a parameter for its exponent is 0 too."""
    powers = [q for q in f.atoms(sympy.Pow) if q.base == 0]
    return f.xreplace({q: sympy.S.Zero if _number(q.exp, at) > 0 else sympy.nan for q in powers})


_Rows = dict[int, tuple[Expr, tuple[Expr, ...]]]


@lru_cache(maxsize=256)
def _rate(
    phi: Expr, states: tuple[Symbol, ...], field: tuple[Expr, ...], signs: tuple[Symbol, ...]
) -> tuple[Expr, tuple[Expr, ...]]:
    """d/dt phi along the field, and what each sign does to it."""
    rate = sympy.expand(rate_along(phi, field, states))
    return rate, tuple(rate.diff(s) for s in signs)


@lru_cache(maxsize=256)
def _slopes(rows: tuple[Expr, ...], by: tuple[Symbol, ...]) -> tuple[tuple[Expr, ...], ...]:
    """The derivatives of each expression by each symbol."""
    return tuple(tuple(e.diff(q) for q in by) for e in rows)


def _rows(
    system: System, form: SymbolicForm, zero: Sequence[int], signs: Sequence[Symbol], field: Sequence[Expr],
    gone: Mapping[Symbol, Expr], at: Mapping[Symbol, float],
) -> tuple[_Rows, tuple[Expr, ...], dict[int, int]] | str:  # fmt: skip
    """Per surface the derivative whose rate feels the signs, and what each does to it; constraints; orders.

    A surface whose derivatives are those of others, already held, has no row.
    """
    free = {t, *form.x, *form.p}
    waiting = {i: sympy.expand(form.h[i].xreplace(dict(gone))) for i in zero}
    constraints = list(waiting.values())
    orders = dict.fromkeys(zero, 1)
    rows: _Rows = {}
    while waiting:
        i, phi = waiting.popitem()
        if phi.free_symbols - free:
            return f"the rate of {_name(system, i)} depends on other signs or sizes"
        rate, effects = _rate(phi, tuple(form.x), tuple(field), tuple(signs))
        if any(e.free_symbols & set(signs) for e in effects):
            return f"the rate of {_name(system, i)} holds products of signs"
        if any(not _vanishes(e, constraints, form.x) for e in effects):
            rows[i] = phi, effects
            continue
        following = sympy.expand(rate.xreplace(dict.fromkeys(signs, sympy.S.Zero)))
        if following.free_symbols - free:
            return f"the rate of {_name(system, i)} depends on other signs or sizes"
        orders[i] += 1
        if orders[i] > HIGHEST_ORDER:
            return f"no sign acts on the first {HIGHEST_ORDER} derivatives of {_name(system, i)}"
        if _implied(following, constraints, form.x, at):
            continue
        constraints.append(following)
        waiting[i] = following
    return rows, tuple(constraints), orders


def _vanishes(effect: Expr, constraints: Sequence[Expr], x: Sequence[Symbol]) -> bool:
    """Whether what a sign does to a rate is 0 on the surfaces; those linear in a state are solved for it."""
    if effect == 0:
        return True
    for c in constraints:
        for q in (q for q in x if q in c.free_symbols):
            slope = c.diff(q)
            if slope.is_number and slope != 0:
                effect = effect.xreplace({q: q - c / slope})
                break
    return bool(sympy.expand(effect) == 0)


def _implied(e: Expr, constraints: Sequence[Expr], x: Sequence[Symbol], at: Mapping[Symbol, float]) -> bool:
    """Whether an expression vanishes where the constraints do: its slopes are a combination of theirs."""
    by = (*x, t)
    rows = _numbers(_slopes((*constraints, e), by), at)
    scale = np.max(np.abs(rows), axis=1, keepdims=True)
    if scale[-1] == 0.0:
        return True
    rows = rows / np.where(scale > 0, scale, 1.0)
    return bool(np.linalg.matrix_rank(rows, NO_RANK) == np.linalg.matrix_rank(rows[:-1], NO_RANK))


def _pivots(
    form: SymbolicForm, zero: Sequence[int], rows: _Rows, at: Mapping[Symbol, float]
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int, float], ...]] | str:
    """(row, surface whose sign holds it) for every row, and the other signs tied to these."""
    acting = {i: [k for k, e in enumerate(effects) if e != 0] for i, (_, effects) in rows.items()}
    numbers = np.array([[_number(e, at) for e in effects] for _, effects in rows.values()])
    if not np.all(np.isfinite(numbers)):
        return "what the signs act on is not a finite number here"
    if not len(rows) or np.linalg.matrix_rank(numbers, NO_RANK * float(np.max(np.abs(numbers)))) < len(rows):
        return "the signs do not tell the derivatives that they act on apart"
    pivots, taken = [], set()
    for i in sorted(rows, key=lambda i: (zero.index(i) not in acting[i], len(acting[i]))):
        own = zero.index(i)
        able = [k for k in ([own] if own in acting[i] else acting[i]) if k not in taken]
        if not able:
            return "the signs do not tell the derivatives that they act on apart"
        taken.add(able[0])
        pivots.append((i, zero[able[0]]))
    ties = []
    for k, j in enumerate(zero):
        if k in taken:
            continue
        felt = [i for i in rows if k in acting[i]]
        if len(felt) != 1:
            return "several signs act on several rates"
        pivot = dict(pivots)[felt[0]]
        ratio = sympy.cancel(rows[felt[0]][1][k] / rows[felt[0]][1][zero.index(pivot)])
        if ratio.free_symbols - set(form.p):
            return "the proportion in which two signs act on a rate changes"
        if any(set(form.radius[i]) != {-sympy.S.One, sympy.S.One} for i in (j, pivot)):
            return "a sign that acts together with others has a set wider than [-1, 1]"
        ties.append((j, pivot, 1.0 if _number(ratio, at) > 0 else -1.0))
    return tuple(pivots), tuple(ties)


def non_lipschitz_surface(system: System) -> int | None:
    """A switching surface on whose rate its sign acts by a power of |h| below 1 only; None without one."""
    form = system.symbolic
    if form is None:
        return None
    defaults = {q: q.parameter.default for q in form.p}
    for i, surface in enumerate(system.surfaces):
        powers = {q for f in form.field for q in f.atoms(sympy.Pow) if q.base == form.a[i]}
        if surface.kind != "switching" or not any(0 < _number(q.exp, defaults) < 1 for q in powers):
            continue
        gone = {form.a[i]: sympy.S.Zero}
        slopes = [form.h[i].diff(x) for x in form.x]
        field = [_at_zero(convex(f, {form.s[i]}).xreplace(gone)) for f in form.field]
        rate = sum((g * f for g, f in zip(slopes, field, strict=True)), sympy.S.Zero)
        if sympy.expand(rate.diff(form.s[i])) == 0:
            return i
    return None


@lru_cache(maxsize=64)
def _system(
    system: System, zero: tuple[int, ...], kinks: tuple[int, ...], sides: tuple[int, ...],
    guards: tuple[tuple[int, Expr], ...], ties: tuple[tuple[int, int, float], ...],
) -> System:  # fmt: skip
    """The system with the guards of a reduction."""
    form = system.symbolic
    assert form is not None
    gone = _gone(form, zero, kinks, sides)
    free = {form.s[i] for i in zero}
    tied = {form.s[i]: sympy.Integer(int(factor)) * form.s[pivot] for i, pivot, factor in ties}
    field = [_at_zero(convex(f, free).xreplace(gone)).xreplace(tied) for f in form.field]
    h, radius = [e.xreplace(gone) for e in form.h], [tuple(e.xreplace(gone) for e in q) for q in form.radius]
    for i, side in zip(kinks, sides, strict=True):
        h[i] = sympy.Integer(side)
    for i, guard in guards:
        h[i] = guard
    for i, _, _ in ties:
        # Its own constraint is kept by a push along the gradient (Gear, Leimkuhler & Gupta 1985).
        field = [f - form.s[i] * h[i].diff(x) for f, x in zip(field, form.x, strict=True)]
        radius[i] = (-sympy.Float(FREE), sympy.Float(FREE))
    held = {i for i, _ in guards}
    return system.with_form(
        replace(
            form,
            field=tuple(field),
            h=tuple(h),
            radius=tuple((low, high) for low, high in radius),
            reset=tuple(r and tuple(e.xreplace(gone) for e in r) for r in form.reset),
            time_reset=tuple(r and tuple(e.xreplace(gone) for e in r) for r in form.time_reset),
            held=tuple(i in held for i in range(len(form.h))),
        ),
        tuple(replace(s, kind="observer") if i in kinks else s for i, s in enumerate(system.surfaces)),
    )


def _at_zero(f: Expr) -> Expr:
    return f.xreplace({q: sympy.S.Zero for q in f.atoms(sympy.Pow) if q.base == 0})


def _name(system: System, i: int) -> str:
    return repr(system.surface_names[i])


def _number(e: Expr, at: Mapping[Symbol, float]) -> float:
    # Of many values few stand in an expression, and most entries of a matrix are numbers.
    value = e.xreplace({q: sympy.Float(at[q]) for q in e.free_symbols if q in at}).evalf()
    return float(value) if value.is_number and value.is_real else float("nan")


def _numbers(rows: Sequence[Sequence[Expr]], at: Mapping[Symbol, float]) -> Array:
    return np.array([[_number(e, at) for e in row] for row in rows], dtype=float)
