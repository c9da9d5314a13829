"""A point of a domain that is given by inequalities, or that there is none.

Of affine ones the centre of the largest ball inside, by linear programming; of others the best of many places
at all scales, and of searches from these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import sympy
from scipy.optimize import linprog, minimize
from scipy.stats import qmc
from sympy import Expr, Symbol

from filippov.base.arrays import Array

# A domain is no wider than LEAST where it has no inner points. Places are looked for at these scales.
LEAST, SCALES = 1e-9, (1.0, 10.0, 100.0, 0.1, 0.01)
PLACES, BEST = 1024, 4
# The largest radius of a ball, and the price of its distance from 0.
LARGEST, PRICE = 1.0, 1e-10


def inner_point(
    free: Sequence[Symbol], positive: Sequence[Expr], values: Mapping[Symbol, Expr]
) -> tuple[float, ...] | None:
    """c with g(c) > 0 for all g, at parameter values, well inside; None where there is none."""
    rows = [sympy.S(g).subs(values) for g in positive]
    if is_affine(free, rows):
        return _centre(*_lines(free, rows))
    places = places_inside(free, rows)
    return tuple(places[0].tolist()) if len(places) else None


def places_inside(free: Sequence[Symbol], positive: Sequence[Expr]) -> Array:
    """Places (k, n) all over a domain, that of the largest min g first; (0, n) where none was found."""
    n = len(free)
    at = [sympy.lambdify(list(free), g, "numpy") for g in positive]

    def least(c: Array) -> Array:
        """min g at places (k, n), -inf where one is no real number."""
        with np.errstate(all="ignore"):
            values = np.array([np.broadcast_to(np.asarray(g(*c.T), dtype=complex), len(c)) for g in at])
        real = np.isfinite(values) & (np.abs(values.imag) <= LEAST * (1.0 + np.abs(values.real)))
        return np.asarray(np.min(np.where(real, values.real, -np.inf), axis=0, initial=LARGEST))

    unit = 2.0 * qmc.Sobol(n, scramble=True, seed=1).random(PLACES) - 1.0
    c = np.concatenate([scale * unit for scale in SCALES])
    size = least(c)
    if not np.any(size > LEAST):
        # Downhill from the places that lack least.
        finite = c[np.isfinite(size)]
        starts = finite[np.argsort(-size[np.isfinite(size)], kind="stable")[:BEST]]
        found = [
            minimize(lambda q: -float(least(q[None])[0]), start, method="Nelder-Mead").x for start in starts
        ]
        c = np.array(found).reshape(-1, n)
        size = least(c) if len(c) else np.zeros(0)
    c, size = c[size > LEAST], size[size > LEAST]
    return c[np.argsort(-size, kind="stable")]


def is_affine(free: Sequence[Symbol], rows: Sequence[Expr]) -> bool:
    """Whether expressions without parameters are affine in c."""
    return all(g.diff(q).is_number for g in rows for q in free)


def _lines(free: Sequence[Symbol], rows: Sequence[Expr]) -> tuple[Array, Array]:
    """g(0) and dg/dc of affine expressions."""
    levels = np.array([float(g.subs(dict.fromkeys(free, 0))) for g in rows])
    slopes = np.array([[float(g.diff(q)) for q in free] for g in rows])
    return levels, slopes.reshape(len(rows), len(free))


def _centre(levels: Array, slopes: Array) -> tuple[float, ...] | None:
    """The centre of the largest ball in g >= 0."""
    n = slopes.shape[1]
    size = np.linalg.norm(slopes, axis=1)
    if np.any(levels[size == 0.0] <= LEAST):
        return None
    held = size > 0.0
    # Of many such centres the one next to 0: u >= |c|, at a price that moves the radius by rounding only.
    rows = np.column_stack([-slopes[held], size[held], np.zeros((held.sum(), n))])
    one, none = np.eye(n), np.zeros((n, 1))
    result = linprog(
        np.r_[np.zeros(n), -1.0, np.full(n, PRICE)],
        A_ub=np.vstack([rows, np.hstack([one, none, -one]), np.hstack([-one, none, -one])]),
        b_ub=np.r_[levels[held], np.zeros(2 * n)],
        bounds=[(None, None)] * n + [(0.0, LARGEST)] + [(0.0, None)] * n,
    )  # fmt: skip
    if result.status != 0 or result.x[n] <= LEAST:
        return None
    return tuple((result.x[:n] + 0.0).tolist())
