"""Equilibria on kinks, where the field is continuous but its Jacobian is not: all sides decide together.

A single Jacobian says nothing: x' = -0.4 x + 0.6 |x| + v, v' = -x has an unstable focus on one side and
converges, and two stable sides together may diverge in dimension 3 and up. Decided are: dimension 1,
dimension 2 (filippov.analysis.local_stability.planar_cone), and instability by an eigenvector inside its own
cone. For a point on kinks that slides on other surfaces the sliding field decides, and for a set of
equilibria on a kink the field across the set. Source: Carmona, Freire, Ponce, Torres 2006, Internat. J.
Bifur. Chaos 16, 1469 (the cones of dimension 3).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy
from sympy import Expr, Rational, Symbol

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability import straight_lines
from filippov.analysis.local_stability.planar_cone import planar_cone
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer, Statement
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.linearisation import linearise
from filippov.base.arrays import Array

CLEAR = 1e-9
# Where along a set the verdict is asked.
SPOTS = (0.47, 0.03, 0.26, 0.71, 0.97)
PLANE = "proved in filippov.analysis.local_stability.planar_cone"


@dataclass(frozen=True)
class Cone:
    """The linear parts beside a point that lies on kinks: one Jacobian for each choice of sides.

    rows    gradients of the kinks, shape (k, n)
    sides   {signs of the k kinks: Jacobian (n, n)}
    """

    rows: Array
    sides: dict[tuple[int, ...], Array]

    def at(self, direction: Array) -> Array:
        """The Jacobian of the side in which a direction lies."""
        return self.sides[tuple(1 if v >= 0 else -1 for v in self.rows @ direction)]

    def balanced(self) -> tuple[Cone, Array]:
        """The same in units of the states in which the matrices are of one size, and these units (n,)."""
        sizes = sum(np.abs(A) for A in self.sides.values())
        units = linalg.balance(sizes)
        sides = {signs: A * units / units[:, None] for signs, A in self.sides.items()}
        rows = self.rows * units
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        return Cone(rows / np.where(size > 0, size, 1.0), sides), units

    def leaves(self) -> bool:
        """Whether an eigenvector to an eigenvalue > 0 lies inside the cone of its own side."""
        for signs, matrix in self.sides.items():
            values, vectors = linalg.eig(matrix)
            size = max(1.0, float(np.max(np.abs(values), initial=0.0)))
            for value, vector in zip(values, vectors.T, strict=True):
                if abs(value.imag) > CLEAR * size or value.real <= CLEAR * size:
                    continue
                # On a kink the sides agree, so the border belongs to the cone.
                where = self.rows @ vector.real * np.array(signs)
                if np.all(where > -CLEAR) or np.all(where < CLEAR):
                    return True
        return False


def surfaces_at(context: Context, found: EquilibriumPoint | EquilibriumSet) -> list[int]:
    """The kinks and surfaces with resets that a point, or a whole set, lies on without sliding there."""
    form = context.form
    put = dict(zip(form.x, found.x, strict=True))
    places = [h.subs(context.put).subs(put) for h in form.h_at_mode(found.mode)]
    return [
        i
        for i, h in enumerate(places)
        if found.mode[i] != "0"
        and context.system.surfaces[i].kind in {"kink", "reset"}
        and all(context.vanishes(h, at) for at in _spots(found))
    ]


def modes_beside(context: Context, mode: str, on: Sequence[int]) -> dict[tuple[int, ...], tuple[int, ...]]:
    """The modes around a point on the surfaces `on`, by the signs of these."""
    signs = context.form.signs(mode)
    out = {}
    for choice in itertools.product((1, -1), repeat=len(on)):
        beside = dict(zip(on, choice, strict=True))
        out[choice] = tuple(beside.get(i, m) for i, m in enumerate(signs))
    return out


def cone(
    context: Context, found: EquilibriumPoint | EquilibriumSet, at: Mapping[Symbol, Expr] | None = None
) -> Cone | None:
    """The linear parts beside a point, or beside the point `at` of a set; None if not on kinks alone.

    Where it slides they are those of the sliding field on its surfaces; along a set they are those across it.
    """
    form, on = context.form, surfaces_at(context, found)
    if not on or any(context.system.surfaces[i].kind != "kink" for i in on):
        return None
    put = dict(zip(form.x, found.x, strict=True))
    gradients = form.gradients(found.mode).extract(on, list(range(len(form.x))))
    rows = context.numbers(gradients.subs(context.put).subs(put), at)
    fixed = [np.zeros((0, len(form.x)))]
    if isinstance(found, EquilibriumSet):
        fixed.append(context.numbers(sympy.Matrix(found.x).jacobian(found.free).T, at))
    sides: dict[tuple[int, ...], Array] = {}
    for choice, mode in modes_beside(context, found.mode, on).items():
        text = "".join("-0+"[m + 1] for m in mode)
        linear = linearise(context.system, replace(found, mode=text), values=context.put, sides=[])
        sliding = linear.sliding
        matrix = linear.smooth if sliding is None else sliding.matrix
        if matrix is None:
            return None
        if sliding is not None and len(sides) == 0:
            fixed.append(context.numbers(sliding.gradient, at))
        sides[choice] = context.numbers(matrix, at)
    if not all(np.all(np.isfinite(part)) for part in (rows, *fixed, *sides.values())):
        return None
    across = linalg.null_space(np.vstack(fixed)) if len(fixed) > 1 else np.eye(len(form.x))
    rows = rows @ across
    # What does not change across the set is on no side of it.
    seen = np.flatnonzero(np.linalg.norm(rows, axis=1) > CLEAR)
    inside = {tuple(signs[k] for k in seen): across.T @ A @ across for signs, A in sides.items()}
    return Cone(rows[seen], inside)


def kink_stability(context: Context, found: EquilibriumPoint | EquilibriumSet) -> tuple[Answer, Statement]:
    """The verdict on a point that lies on kinks, or on a set that lies on them as a whole.

    Where it slides, the verdict is that on solutions that slide.
    """
    answers: dict[Answer, Statement] = {}
    for at in _spots(found):
        beside = cone(context, found, at)
        if beside is None:
            if isinstance(found, EquilibriumPoint) and straight_lines.leads_away(context, found):
                return "unstable", Statement(straight_lines.TEXT, straight_lines.SOURCE)
            text = "it lies on a surface with a reset, or the linear parts beside it are not determined"
            return "undecided", Statement(text)
        answer, statement = _decided(beside, (), "it lies on a kink")
        answers.setdefault(answer, statement)
    if len(answers) > 1:
        text = "it lies on a kink: beside some of its points solutions come back, beside others they do not"
        return "undecided", Statement(text)
    return next(iter(answers.items()))


def _spots(found: EquilibriumPoint | EquilibriumSet) -> list[dict[Symbol, Expr]]:
    """Points of a set by its free symbols; one without any for a point."""
    if isinstance(found, EquilibriumPoint):
        return [{}]
    ranges = []
    for low, high in found.bounds:
        a = max(low, min(high, 0.0) - 10.0)
        ranges.append((a, min(high, a + 20.0)))
    return [
        {q: Rational(str(a + part * (b - a))) for q, (a, b) in zip(found.free, ranges, strict=True)}
        for part in SPOTS
    ]


def set_ends(context: Context, found: EquilibriumSet) -> list[EquilibriumPoint]:
    """The ends of a segment or half line in a smooth mode that lie on surfaces."""
    if found.dimension > 1:
        return []
    form, ends, along = context.form, [], surfaces_at(context, found)
    for edge in found.domain[0]:
        if edge.is_infinite:
            continue
        x = tuple(e.subs(found.free[0], edge) for e in found.x)
        put = dict(zip(form.x, x, strict=True))
        places = [h.subs(context.put) for h in form.h_at_mode(found.mode)]
        if any(i not in along and context.vanishes(place, put) for i, place in enumerate(places)):
            value = tuple(context.number(e) for e in x)
            ends.append(EquilibriumPoint(found.mode, found.states, x, (), value, (), "boundary equilibrium"))
    return ends


def end_stability(context: Context, found: EquilibriumSet, end: EquilibriumPoint) -> tuple[Answer, Statement]:
    """The verdict on an end of a set in a smooth mode: whether solutions that start beyond it return."""
    where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(end.states, end.value, strict=True))
    at = cone(context, end)
    if at is None:
        return "undecided", Statement(f"what happens beyond the end {where} is not decided")
    inner = np.array([context.number(e, _spots(found)[0]) for e in found.x])
    rest = [inner - np.array(end.value), *_rests(context, end, at)]
    return _decided(at, rest, f"beyond the end {where}")


def _rests(context: Context, end: EquilibriumPoint, at: Cone) -> list[Array]:
    """The rays from an end along which another set begins."""
    form, rays = context.form, []
    modes = modes_beside(context, end.mode, surfaces_at(context, end))
    for signs, A in at.sides.items():
        for v in (k * e for e in linalg.null_space(A).T for k in (1, -1)):
            if signs in modes and np.all(at.rows @ v * np.array(signs) > CLEAR):
                x = np.array(end.value) + 1e-3 * v
                put = dict(zip(form.x, map(sympy.Float, x), strict=True))
                field = [context.number(f.subs(context.put), put) for f in form.at_mode(modes[signs])]
                rays += [v] if all(abs(f) <= CLEAR * 1e-3 for f in field) else []
    return rays


def _decided(found: Cone, rest: Sequence[Array], where: str) -> tuple[Answer, Statement]:
    n = found.rows.shape[1]
    # What counts as 0 does not depend on the units of the states.
    found, units = found.balanced()
    rest = [r / units for r in rest]
    if found.leaves():
        return "unstable", Statement(f"{where}: on one of its sides a solution leads straight away")
    first, *others = found.sides.values()
    if all(np.allclose(first, A, rtol=0, atol=CLEAR) for A in others):
        largest = float(np.max(linalg.eigvals(first).real, initial=-np.inf))
        if not rest and abs(largest) > CLEAR * max(1.0, float(np.linalg.norm(first))):
            same = f"{where}, and all sides have the same linear part"
            if largest < 0:
                return "asymptotically stable", Statement(f"{same}: all roots lie on the left")
            return "unstable", Statement(f"{same}: a root lies on the right")
    if n == 1:
        sides = [v for v in (-1.0, 1.0) if all(v * r[0] < 0 for r in rest)]
        if all(found.at(np.array([v]))[0, 0] < 0 for v in sides):
            return "asymptotically stable", Statement(f"{where}: solutions beside it come back")
    elif n == 2:
        decided = planar_cone(found.at, rest)
        if decided is not None:
            text = "solutions beside it come back" if decided else "solutions beside it grow"
            return ("asymptotically stable" if decided else "unstable"), Statement(f"{where}: {text}", PLANE)
    return "undecided", Statement(f"{where}: the Jacobian is that of one side, and all sides together decide")
