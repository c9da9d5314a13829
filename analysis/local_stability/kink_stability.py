"""Equilibria on kinks, where the field is continuous and its Jacobian is not: all sides decide together.

A single Jacobian says nothing: x' = -0.4 x + 0.6 |x| + v, v' = -x has an unstable focus on one side and
converges, and two stable sides together may diverge in dimension 3 and up. Decided are: dimension 1,
dimension 2 (filippov.analysis.local_stability.planar_cone), and instability by an eigenvector inside its own
cone.
Source: Carmona, Freire, Ponce, Torres 2006, Internat. J. Bifur. Chaos 16, 1469 (the cones of dimension 3).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from sympy import Expr

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.planar_cone import planar_cone
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer, Statement
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

Array = npt.NDArray[np.float64]
ON, CLEAR = 1e-9, 1e-9
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

    def leaves(self) -> bool:
        """Whether an eigenvector to an eigenvalue > 0 lies inside the cone of its own side."""
        for signs, matrix in self.sides.items():
            values, vectors = linalg.eig(matrix)
            size = max(1.0, float(np.max(np.abs(values))))
            for value, vector in zip(values, vectors.T, strict=True):
                if abs(value.imag) > CLEAR * size or value.real <= CLEAR * size:
                    continue
                where = self.rows @ vector.real * np.array(signs)
                if np.all(where > CLEAR) or np.all(where < -CLEAR):
                    return True
        return False


def cone(context: Context, mode: str, x: Sequence[Expr]) -> Cone | None:
    """The linear parts at a point of the closure of a mode; None if not on kinks alone."""
    form = context.form
    put = dict(zip(form.x, x, strict=True))
    signs = form.signs(mode)
    places = [abs(context.number(h.subs(context.put).subs(put))) for h in form.h_at_mode(mode)]
    on = [i for i, place in enumerate(places) if place <= ON]
    if not on or any(context.system.surfaces[i].kind != "kink" for i in on):
        return None
    gradients = form.gradients(mode).extract(on, list(range(len(form.x))))
    rows = context.numbers(gradients.subs(context.put).subs(put))
    sides = {}
    for choice in itertools.product((1, -1), repeat=len(on)):
        beside = dict(zip(on, choice, strict=True))
        jacobian = form.jacobian([beside.get(i, m) for i, m in enumerate(signs)])
        sides[choice] = context.numbers(jacobian.subs(context.put).subs(put))
    finite = all(np.all(np.isfinite(part)) for part in (rows, *sides.values()))
    return Cone(rows, sides) if finite else None


def kink_stability(context: Context, point: EquilibriumPoint) -> tuple[Answer, Statement]:
    """The verdict on a point that lies on kinks."""
    found = cone(context, point.mode, point.x)
    if found is None:
        text = "it lies on a surface with a reset, or the linear parts beside it are not determined"
        return "undecided", Statement(text)
    return _decided(found, None, "it lies on a kink")


def end_stability(context: Context, found: EquilibriumSet, end: EquilibriumPoint) -> tuple[Answer, Statement]:
    """The verdict on an end of a set in a smooth mode: whether motions that start beyond it come back."""
    where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(end.states, end.value, strict=True))
    at = cone(context, found.mode, end.x)
    if at is None:
        return "undecided", Statement(f"what happens beyond the end {where} is not decided")
    middle = np.array([_number(context, e, found) for e in found.x])
    return _decided(at, middle - np.array(end.value), f"beyond the end {where}")


def _number(context: Context, e: Expr, found: EquilibriumSet) -> float:
    inner = [0.45 * low + 0.55 * high for low, high in found.bounds]
    return context.number(e.subs(dict(zip(found.free, inner, strict=True))))


def _decided(found: Cone, rest: Array | None, where: str) -> tuple[Answer, Statement]:
    n = found.rows.shape[1]
    if found.leaves():
        return "unstable", Statement(f"{where}: on one of its sides a solution leads straight away")
    if n == 1:
        rates = [float(matrix[0, 0]) for matrix in found.sides.values()]
        if max(rates) < 0:
            return "asymptotically stable", Statement(f"{where}: both sides lead back to it")
    elif n == 2:
        decided = planar_cone(found.at, rest)
        if decided is not None:
            text = "solutions beside it come back" if decided else "solutions beside it grow"
            return ("asymptotically stable" if decided else "unstable"), Statement(f"{where}: {text}", PLANE)
    return "undecided", Statement(f"{where}: the Jacobian is that of one side, and all sides together decide")
