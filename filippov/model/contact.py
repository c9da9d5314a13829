"""Resting contact: the limit of ever smaller impacts, written as sliding on a surface with a reset.

At rest on the surface h = 0 the rate L = dh/dt vanishes, and there the reset leaves h and L as they are. A
reset just off rest moves the state along one direction D, scaled here to grad(L) . D = 1. In contact

    x' = f + side (1 - side s)/2 D,   L' = 0,   s in (-inf, 1] for side +1, [-1, inf) for side -1

so (1 - side s)/2 is the acceleration by which the surface pushes; contact is left where it becomes negative.
Sources: Brogliato 2016, section 5; di Bernardo et al. 2008, section 2.2 (sticking region).
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence

import sympy
from sympy import Expr, Float, Symbol

from filippov.model.push import (
    CLOSE,
    DIGITS,
    Approach,
    Row,
    Tree,
    UndecidedError,
    each,
    has_choices,
    joined,
    limit,
    place,
    rounding,
    rows,
    slips,
)
from filippov.model.signals.input import as_symbols
from filippov.model.size import cancelled, expanded
from filippov.model.surface import Surface
from filippov.model.symbolic import Contact, Select, SymbolicForm
from filippov.model.symbols import t
from filippov.model.table import samples, vanishes

TRIALS = 6
KINK = "h has a kink"
JUMPS = "dh/dt depends on the sign of a surface"
SIGNED = "the reset depends on signs"
ACROSS = "the field jumps across the surface"
BOTH = "it acts on both sides"
CHOICES = "what the reset chooses at rest (by |u|, Min, Max) cannot be told"
# Reasons for which none is derived although the state may rest; the others say that it cannot.
UNDERIVED = (KINK, JUMPS, SIGNED, ACROSS, BOTH, CHOICES)


def found_contact(form: SymbolicForm, surface: Surface, i: int) -> Contact | str:
    """The contact on surface i, whatever `contact` says, or the reason why there is none."""
    after = form.reset[i] if form.reset else None
    if after is None:
        return "it has no reset"
    if surface.side == "both":
        return BOTH
    if surface.kind != "reset":
        return ACROSS
    return contact_of(form, i, after, 1 if surface.side == "+" else -1)


def not_derived(form: SymbolicForm, surface: Surface, i: int) -> str:
    """Why the state may rest on surface i without a contact: its reset keeps h = 0, and a sign is in the way.

    "" where there is a contact, or none by what the reset does or the user says.
    """
    after = form.reset[i] if form.reset else None
    if after is None or surface.contact:
        return ""
    found = found_contact(form, surface, i)
    if found not in UNDERIVED:
        return ""
    moved = {x: e for x, e in zip(form.x, after, strict=True) if e != x}
    h = form.plain_h()[i]
    x = [q for q in form.x if q in h.free_symbols]
    return str(found) if x and _kept(x, [h], [h.subs(moved, simultaneous=True)]) else ""


def contact_of(form: SymbolicForm, i: int, after: Sequence[Expr], side: int) -> Contact | str:
    """The contact on surface i whose reset gives `after`, or the reason why there is none."""
    found = _push(form, i, after, side)
    if isinstance(found, str):
        return found
    rate, tree = found
    try:
        return Contact(side, rate, joined(tree, lambda g: _sign(form, i, g)))
    except UndecidedError:
        return CHOICES


def slips_of(form: SymbolicForm, surface: Surface, i: int) -> list[Expr]:
    """Functions on whose signs the push of surface i depends while the state rests on it."""
    after = form.reset[i] if form.reset else None
    if after is None or surface.contact is False or surface.side == "both" or not has_choices(after):
        return []
    found = _push(form, i, after, 1 if surface.side == "+" else -1)
    return [] if isinstance(found, str) else list(slips(found[1]))


def _sign(form: SymbolicForm, i: int, g: Expr) -> Expr | None:
    """The sign of g as that of a surface, other than i, that is a multiple of it."""
    found = place(form.plain_h(), g)
    if found is None or found[0] == i:
        return None
    k, factor = found
    return form.s[k] if factor == 1 else Select(factor, form.s[k], -form.s[k])


def _push(form: SymbolicForm, i: int, after: Sequence[Expr], side: int) -> tuple[Expr, Tree] | str:
    """The rate of a contact and the direction in which it pushes, by cases, or why there is none."""
    h, n = form.h[i], len(form.x)
    if not h.free_symbols.isdisjoint(form.a):
        return KINK
    inside = h.free_symbols
    steps = ((j, h.diff(x)) for j, x in enumerate(form.x) if x in inside)
    rate = expanded(h.diff(t) + sum(g * form.field[j] for j, g in steps))
    if not rate.free_symbols.isdisjoint((*form.s, *form.a)):
        return JUMPS
    moved = {x: e for x, e in zip(form.x, after, strict=True) if e is not x and e != x}
    if not set().union(*(e.free_symbols for e in moved.values())).isdisjoint((*form.s, *form.a)):
        return SIGNED
    # Of many states few have to do with one surface: those that it, its rate and its reset name.
    near = inside | rate.free_symbols | moved.keys()
    places = [j for j, x in enumerate(form.x) if x in near]
    x = [form.x[j] for j in places]
    slope, across = (sympy.Matrix([e.diff(q) for q in x]) for e in (h, rate))
    if slope.norm() == 0 or across.norm() == 0:
        return "dh/dt does not depend on the state"
    # A direction across L = 0 that keeps h: what the reset does along it is the push of the surface.
    probe = across - slope * (across.dot(slope) / slope.dot(slope))
    row: Row = tuple(after[j] for j in places)
    tree: Tree = row
    if has_choices(row):
        steps_off = {q: -side * e / across.dot(probe) for q, e in zip(x, probe, strict=True) if e != 0}
        try:
            inputs = as_symbols([h, rate, *after])
            zero, others = ([e.xreplace(inputs) for e in part] for part in ((h, rate), after))
            tree = limit(row, Approach(steps_off, rate, inputs, tuple(_points(x, zero, others))))
        except UndecidedError:
            return CHOICES

    def pushed(row: Row) -> Row:
        """What the reset does to the rate, and the direction of its push with its share in that as 1."""
        jump = sympy.Matrix([e - q for e, q in zip(row, x, strict=True)])
        push = jump.jacobian(x) * probe
        along = cancelled(across.dot(push)) if n < 9 else across.dot(push)
        return (along, *(sympy.nan if along == 0 else cancelled(e / along) for e in push))

    tree = each(tree, pushed)
    pushes = list(rows(tree))
    if any(vanishes(row[0]) or any(e.has(sympy.nan, sympy.zoo) for e in row) for row in pushes):
        return "the reset does not act on dh/dt"
    after_rest = [e.subs(moved, simultaneous=True) for e in (h, rate)]
    if not _kept(x, (h, rate), after_rest, [row[0] for row in pushes]):
        return "the reset changes h or dh/dt where both are 0"
    nothing = dict.fromkeys(range(n), sympy.S.Zero)
    return rate, each(tree, lambda row: tuple((nothing | dict(zip(places, row[1:], strict=True))).values()))


def _kept(
    x: Sequence[Symbol], zero: Sequence[Expr], after: Sequence[Expr], along: Sequence[Expr] = ()
) -> bool:
    """Whether h = dh/dt = 0 (`zero`) holds after the reset (`after`) where it did, at points Newton finds.

    x: the states on which they depend; along: what must not vanish there.

    What else the reset changes, a counter or the speed along the surface, it changes once at each impact.
    """
    # As long as it holds for any value of an input, and of its slope.
    inputs = as_symbols([*zero, *along, *after])
    after, along = ([e.xreplace(inputs) for e in part] for part in (after, along))
    found = 0
    for at in _points(x, [e.xreplace(inputs) for e in zero], [*along, *after]):
        values = [e.xreplace(at).evalf(DIGITS) for e in (*after, *along)]
        if not all(v.is_number and v.is_finite for v in values):
            continue
        if any(abs(v) < CLOSE for v in values[len(after) :]):
            return False
        if any(abs(v) > CLOSE and abs(v) > rounding(e, at) for v, e in zip(values, after, strict=False)):
            return False
        found += 1
    return found > 0


def _points(
    x: Sequence[Symbol], zero: Sequence[Expr], others: Sequence[Expr]
) -> Iterator[dict[Symbol, Expr]]:
    """Points at which the expressions of `zero` vanish, with values for what the others hold."""
    symbols: set[Symbol] = set().union(*(e.free_symbols for e in (*zero, *others))) | {*x, t}
    for point in samples(symbols, TRIALS, seed=random.Random(7).randint(1, 99)):  # noqa: S311
        at = _solved({q: Float(v, DIGITS) for q, v in point.items()}, x, sympy.Matrix(zero))
        if at is not None:
            yield at


def _solved(
    point: dict[Symbol, Expr], x: Sequence[Symbol], equations: sympy.Matrix
) -> dict[Symbol, Expr] | None:
    """The point moved along the gradients to where the equations hold; None where it does not get there."""
    slopes = equations.jacobian(x)
    for _ in range(40):
        value = equations.xreplace(point).evalf(DIGITS)
        if not all(v.is_number and v.is_finite for v in value):
            return None
        if max(abs(v) for v in value) < Float("1e-25"):
            return point
        g = slopes.xreplace(point).evalf(DIGITS)
        matrix = g * g.T
        determinant = matrix.det()
        if not determinant.is_number or abs(determinant) < Float("1e-40"):
            return None
        # The inverse by the adjugate: that of sympy asks again whether the determinant is 0, in its own way.
        step = g.T * matrix.adjugate() * value / determinant
        point = {**point, **{q: point[q] - d for q, d in zip(x, step, strict=True)}}
    return None
