"""Resting contact: the limit of ever smaller impacts, written as sliding on a surface with a reset.

At rest on the surface h = 0 the rate L = dh/dt vanishes, and there the reset leaves h and L as they are. A
reset just off rest moves the state along one direction D, scaled here to grad(L) . D = 1. In contact

    x' = f + side (1 - side s)/2 D,   L' = 0,   s in (-inf, 1] for side +1, [-1, inf) for side -1

so (1 - side s)/2 is the acceleration by which the surface pushes; contact is left where it becomes negative.
Sources: Brogliato 2016, section 5; di Bernardo et al. 2008, section 2.2 (sticking region).
"""

from __future__ import annotations

import random
from collections.abc import Sequence

import sympy
from sympy import Expr, Float, Symbol

from filippov.model.signals.input import as_symbols
from filippov.model.size import cancelled, expanded
from filippov.model.symbolic import Contact, SymbolicForm
from filippov.model.symbols import t
from filippov.model.table import samples, vanishes

DIGITS = 30
CLOSE = Float("1e-18")
TRIALS = 6


def contact_of(form: SymbolicForm, i: int, after: Sequence[Expr], side: int) -> Contact | str:
    """The contact on surface i whose reset gives `after`, or the reason why there is none."""
    h, n = form.h[i], len(form.x)
    signs = set(form.s) | set(form.a)
    if h.free_symbols & set(form.a):
        return "h has a kink"
    slope = sympy.Matrix([h.diff(x) for x in form.x])
    rate = expanded(h.diff(t) + sum(g * f for g, f in zip(slope, form.field, strict=True)))
    if rate.free_symbols & signs:
        return "the field jumps along its gradient"
    if any(e.free_symbols & signs for e in after):
        return "the reset depends on signs"
    across = sympy.Matrix([rate.diff(x) for x in form.x])
    if slope.norm() == 0 or across.norm() == 0:
        return "dh/dt does not depend on the state"
    # A direction across L = 0 that keeps h: what the reset does along it is the push of the surface.
    probe = across - slope * (across.dot(slope) / slope.dot(slope))
    jump = sympy.Matrix([e - x for e, x in zip(after, form.x, strict=True)])
    push = jump.jacobian(form.x) * probe
    along = cancelled(across.dot(push)) if n < 9 else across.dot(push)
    if along == 0 or vanishes(along):
        return "the reset does not act on dh/dt"
    direction = tuple(cancelled(e / along) for e in push)
    if any(e.has(sympy.nan, sympy.zoo) for e in direction):
        return "the reset does not act on dh/dt"
    moved = dict(zip(form.x, after, strict=True))
    if not _rests(form, h, rate, [e.subs(moved, simultaneous=True) for e in (h, rate)], along):
        return "the reset changes h or dh/dt where both are 0"
    return Contact(side, rate, direction)


def _rests(form: SymbolicForm, h: Expr, rate: Expr, after: Sequence[Expr], along: Expr) -> bool:
    """Whether h = dh/dt = 0 holds after the reset (`after`) where it did before, at points Newton finds.

    What else the reset changes, a counter or the speed along the surface, it changes once at each impact.
    """
    # As long as it holds for any value of an input, and of its slope.
    inputs = as_symbols([h, rate, along, *after])
    if inputs:
        h, rate, along, *after = (e.xreplace(inputs) for e in (h, rate, along, *after))
    symbols: set[Symbol] = set().union(*(e.free_symbols for e in (h, rate, along, *after))) | {*form.x, t}
    found = 0
    for point in samples(symbols, TRIALS, seed=random.Random(7).randint(1, 99)):  # noqa: S311
        at = _solved({q: Float(v, DIGITS) for q, v in point.items()}, form.x, sympy.Matrix([h, rate]))
        if at is None:
            continue
        values = [e.xreplace(at).evalf(DIGITS) for e in (*after, along)]
        if not all(v.is_number and v.is_finite for v in values):
            continue
        if any(abs(v) > CLOSE for v in values[:-1]) or abs(values[-1]) < CLOSE:
            return False
        found += 1
    return found > 0


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
        step = g.T * matrix.inv() * value
        point = {**point, **{q: point[q] - d for q, d in zip(x, step, strict=True)}}
    return None
