"""l <= z <= u, w = A z + q:  w_i >= 0 where z_i = l_i, w_i <= 0 where z_i = u_i, w_i = 0 between.

The box-constrained linear complementarity problem (l = 0, u = inf: the standard one). Up to ENUMERATED
unknowns every choice of active bounds is tried, so that all solutions are found, or that there is none.
Beyond, Lemke's method with lexicographic pivoting finds one solution; on a bounded box it cannot end on a
ray, whatever A is, for no direction of the box is unbounded. A positive definite A proves that it is the only
one.

Sources: Cottle, Pang & Stone 1992, The Linear Complementarity Problem, sections 3.1, 4.4 and 4.9.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import UsageError

ENUMERATED = 6
ROUNDING = 1e-10
RANK = 1e-11
# Stands for infinity where the end of a family is asked for.
FAR = 1e6
STARTS, PIVOTS = 8, 10


@dataclass(frozen=True)
class Complementarity:
    """What is known of the solutions.

    solutions   isolated ones, and two ends of every family; shape (k,) each
    complete    whether there are no others, besides the members of families
    family      a direction in which solutions[0] can be moved, None where it is isolated
    """

    solutions: tuple[Array, ...]
    complete: bool
    family: Array | None = None

    @property
    def unique(self) -> bool | None:
        """Whether there is exactly one solution; None where at most one is known and no more is proved."""
        if len(self.solutions) <= 1 and self.family is None:
            return len(self.solutions) == 1 if self.complete else None
        return False


@dataclass(frozen=True)
class Box:
    """The problem: A of shape (k, k), q, lower and upper of shape (k,), lower <= upper."""

    A: Array
    q: Array
    lower: Array
    upper: Array

    @property
    def size(self) -> float:
        """What residuals are measured by."""
        widths = np.minimum(np.maximum(np.abs(self.lower), np.abs(self.upper)), 1e300)
        reach = float(np.max(np.where(widths < 1e300, widths, 1.0), initial=1.0))
        largest = float(np.max(np.abs(self.A), initial=0.0))
        return largest * reach + float(np.max(np.abs(self.q), initial=0.0)) + 1e-300

    def slack(self, z: Array) -> Array:
        """w = A z + q."""
        return np.asarray(self.A @ z + self.q)

    def violation(self, z: Array) -> float:
        """The certificate: the largest |z - mid(l, z - w, u)|, w in units of `size`; 0 for a solution."""
        w = self.slack(z) / self.size
        return float(np.max(np.abs(z - np.clip(z - w, self.lower, self.upper)), initial=0.0))


def complementarity(A: Array, q: Array, lower: Array, upper: Array) -> Complementarity:
    """Solve the problem; UsageError where its parts do not fit. No solution: `solutions` is empty."""
    box = _checked(A, q, lower, upper)
    if len(box.q) <= ENUMERATED:
        return enumerate_solutions(box)
    return _beyond(box)


def _checked(A: Array, q: Array, lower: Array, upper: Array) -> Box:
    arrays = [np.array(a, dtype=np.float64) for a in (A, q, lower, upper)]
    k = arrays[1].size
    if [a.shape for a in arrays] != [(k, k), (k,), (k,), (k,)]:
        shapes = ", ".join(str(a.shape) for a in arrays)
        raise UsageError(f"A, q, lower, upper have shapes {shapes}, expected (k, k), (k,), (k,), (k,).")
    box = Box(*arrays)
    if not np.all(np.isfinite(box.A)) or not np.all(np.isfinite(box.q)):
        raise UsageError("A or q is not finite.")
    if not np.all(box.lower <= box.upper):
        raise UsageError("lower is above upper. Every unknown needs an interval.")
    if np.any(np.isinf(box.lower)):
        raise UsageError("lower is not finite. Replace z by -z where only the upper bound is.")
    return box


def _choices(box: Box) -> Iterator[tuple[int, ...]]:
    """-1, 0, +1 for every unknown: at its lower bound, between, at its upper bound."""
    each = [(-1, 0, 1) if np.isfinite(u) else (-1, 0) for u in box.upper]
    return itertools.product(*each)


def enumerate_solutions(box: Box) -> Complementarity:
    """All solutions, by trying every choice of active bounds."""
    found: list[Array] = []
    family: Array | None = None
    for choice in _choices(box):
        active = np.array(choice, dtype=int)
        free = np.flatnonzero(active == 0)
        z = np.where(active > 0, box.upper, box.lower)
        z[free] = 0.0
        block = box.A[np.ix_(free, free)]
        values = np.linalg.svd(block, compute_uv=False) if len(free) else np.ones(1)
        ends: list[Array]
        if values[-1] > RANK * max(values[0], box.size * 1e-3):
            z[free] = np.linalg.solve(block, -box.slack(z)[free]) if len(free) else z[free]
            ends = [z] if box.violation(z) <= ROUNDING * (1.0 + np.max(np.abs(z), initial=0.0)) else []
        else:
            ends = _family(box, active, free, z)
        if len(ends) == 2 and family is None:
            family = ends[1] - ends[0]
            found = [ends[0], *(other for other in found if _apart(other, ends[0]))]
        found += [end for end in ends if all(_apart(end, other) for other in found)]
    return Complementarity(tuple(found), True, family)


def _apart(z: Array, other: Array) -> bool:
    return bool(np.max(np.abs(z - other), initial=0.0) > 1e-8 * (1.0 + np.max(np.abs(z), initial=0.0)))


def _family(box: Box, active: npt.NDArray[np.int64], free: npt.NDArray[np.int64], z: Array) -> list[Array]:
    """Two ends, or the only point, of the polyhedron of solutions with these active bounds."""
    from scipy.optimize import linprog  # takes longer to import than all else

    fixed = np.flatnonzero(active != 0)
    w = box.slack(z)
    scale = box.size
    parts = {
        "A_eq": box.A[np.ix_(free, free)] / scale,
        "b_eq": -w[free] / scale,
        "A_ub": active[fixed, None] * box.A[np.ix_(fixed, free)] / scale if len(fixed) else None,
        "b_ub": -active[fixed] * w[fixed] / scale if len(fixed) else None,
        "bounds": list(zip(box.lower[free], np.minimum(box.upper[free], FAR), strict=True)),
    }
    best: list[Array] = []
    widest = -1.0
    for j in range(len(free)):
        pair = []
        for sign in (1.0, -1.0):
            cost = np.zeros(len(free))
            cost[j] = sign
            result = linprog(cost, method="highs", **parts)
            if result.status != 0:
                return []
            end = z.copy()
            end[free] = result.x
            pair.append(end)
        width = float(pair[1][free[j]] - pair[0][free[j]])
        if width > widest:
            widest, best = width, pair
    if any(box.violation(end) > 1e-7 * (1.0 + np.max(np.abs(end))) for end in best):
        return []
    return best if widest > 1e-8 else best[:1]


def _beyond(box: Box) -> Complementarity:
    """One solution by Lemke's method; others from other directions where nothing proves it the only one."""
    first = lemke(box, np.ones(len(box.q)))
    definite = bool(np.min(np.linalg.eigvalsh(box.A + box.A.T)) > RANK * np.max(np.abs(box.A)))
    if first is None:
        return Complementarity((), definite)
    if definite:
        return Complementarity((first,), True)
    found = [first]
    generator = np.random.default_rng(0)
    for _ in range(STARTS):
        other = lemke(box, generator.uniform(0.1, 1.0, len(box.q)))
        if other is not None and all(np.max(np.abs(other - z)) > 1e-8 for z in found):
            found.append(other)
    return Complementarity(tuple(found), False, _direction(box, first))


def _direction(box: Box, z: Array) -> Array | None:
    """A direction both ways along which z stays a solution: from the null space on its free unknowns."""
    margin = 1e-8 * np.minimum(box.upper - box.lower, 1.0)
    free = np.flatnonzero((z > box.lower + margin) & (z < box.upper - margin))
    if len(free) == 0:
        return None
    _, values, rows = np.linalg.svd(box.A[np.ix_(free, free)])
    if values[-1] > RANK * max(values[0], box.size * 1e-3):
        return None
    direction = np.zeros(len(z))
    direction[free] = rows[-1]
    small = 1e-6 * direction
    moved = max(box.violation(z + small), box.violation(z - small))
    return direction if moved <= ROUNDING else None


def lemke(box: Box, cover: Array) -> Array | None:
    """One solution by complementary pivoting from a positive covering vector; None where it ends on a ray.

    With y for the multipliers of the upper bounds and x = z - l, the problem is w = M (x, y) + b >= 0 with
    M = [[A, I], [-I, 0]]. The covering vector is zero on the bounds: x stays in its box along every ray.
    """
    k = len(box.q)
    capped = np.flatnonzero(np.isfinite(box.upper))
    n = k + len(capped)
    M = np.zeros((n, n))
    M[:k, :k] = box.A
    M[capped, k + np.arange(len(capped))] = 1.0
    M[k + np.arange(len(capped)), capped] = -1.0
    b = np.concatenate([box.slack(box.lower), (box.upper - box.lower)[capped]])
    d = np.concatenate([cover, np.zeros(len(capped))])
    scale = box.size
    M[:k, :k] /= scale
    b[:k] /= scale
    x = _pivot(M, b, d)
    return None if x is None else polished(box, box.lower + x[:k])


def _pivot(M: Array, b: Array, d: Array) -> Array | None:
    """Lemke's method on w = M x + b + d x0 with the lexicographic ratio test."""
    n = len(b)
    table = np.hstack([b[:, None], np.eye(n), -M, -d[:, None]])
    basis = list(range(1, n + 1))
    artificial = 2 * n + 1
    if np.all(b >= 0.0):
        return np.zeros(n)
    entering = artificial
    row = _least(table, d, np.flatnonzero(d > 0.0))
    for _ in range(PIVOTS * n):
        leaving = basis[row]
        table[row] /= table[row, entering]
        column = table[:, entering].copy()
        column[row] = 0.0
        table -= column[:, None] * table[row]
        basis[row] = entering
        if leaving == artificial:
            x = np.zeros(2 * n + 2)
            x[basis] = table[:, 0]
            return np.maximum(x[n + 1 : 2 * n + 1], 0.0)
        entering = leaving + n if leaving <= n else leaving - n
        column = table[:, entering]
        rows = np.flatnonzero(column > 1e-11)
        if len(rows) == 0:
            return None
        if artificial in basis:
            place = basis.index(artificial)
            if place in rows:
                # Where the artificial variable may leave, it must: the problem is solved then.
                ratios = table[rows, 0] / column[rows]
                if table[place, 0] / column[place] <= np.min(ratios) + 1e-14:
                    row = place
                    continue
        row = _least(table, column, rows)
    return None


def _least(table: Array, column: Array, rows: npt.NDArray[np.int64]) -> int:
    """The row whose (value, row of the inverse basis) divided by its pivot is lexicographically least."""
    n = table.shape[0]
    for position in range(n + 1):
        if len(rows) == 1:
            break
        ratios = table[rows, position] / column[rows]
        rows = rows[ratios <= np.min(ratios) + 1e-13 * (1.0 + abs(np.min(ratios)))]
    return int(rows[0])


def polished(box: Box, z: Array) -> Array:
    """The same choice of active bounds solved from the data, free of the rounding of the pivots."""
    z = np.clip(z, box.lower, box.upper)
    margin = 1e-9 * (1.0 + np.minimum(box.upper - box.lower, 1e300))
    free = np.flatnonzero((z > box.lower + margin) & (z < box.upper - margin))
    exact = np.where(z >= box.upper - margin, box.upper, box.lower)
    exact[free] = 0.0
    if len(free):
        right = -box.slack(exact)[free]
        exact[free] = z[free]
        block = box.A[np.ix_(free, free)]
        change, *_ = np.linalg.lstsq(block, right - block @ z[free], rcond=None)
        exact[free] += change
    return exact if box.violation(exact) <= box.violation(z) else z
