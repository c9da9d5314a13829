"""Linear matrix inequalities: solved in floats by cvxpy and Clarabel, decided in exact rational numbers.

What the solver returns is only a suggestion: it is rounded to fractions, and a verdict rests on the signs of
the pivots of L D L^T of these. Needs the extra `certificates`; `available()` says whether it is there.
"""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import sympy

from filippov.base.arrays import Array

INSTALL = "pip install 'filippov[certificates]'"
DIGITS = (3, 5, 8, 11)
CLEAR = 1e-7


def available() -> bool:
    """Whether cvxpy and Clarabel are installed."""
    return all(importlib.util.find_spec(name) is not None for name in ("cvxpy", "clarabel"))


def feasible(
    unknowns: Sequence[Any], positive: Sequence[Any], more: Sequence[Any], size: Sequence[Any]
) -> bool:
    """Solve max t with every matrix of `positive` >= t I, every one of `size` <= I; whether t is above 0.

    unknowns  cvxpy variables, which hold the solution afterwards
    more      further constraints of cvxpy
    """
    import cvxpy

    t = cvxpy.Variable()
    rules = [_symmetric(m) >> t * np.eye(m.shape[0]) for m in positive]
    rules += [_symmetric(m) << np.eye(m.shape[0]) for m in size]
    problem: Any = cvxpy.Problem(cvxpy.Maximize(t), [*rules, *more, t <= 1])
    try:
        with warnings.catch_warnings():
            # An inaccurate solution is a suggestion like any other: exact numbers decide.
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cvxpy.CLARABEL)
    except cvxpy.SolverError:
        return False
    done = all(u.value is not None for u in unknowns)
    return bool(done and t.value is not None and float(t.value) > CLEAR)


def symmetric(n: int, free: Iterator[sympy.Symbol]) -> sympy.Matrix:
    """The symmetric matrix of the next n (n + 1)/2 symbols, row by row of its lower half."""
    out = sympy.zeros(n, n)
    for i in range(n):
        for j in range(i + 1):
            out[i, j] = out[j, i] = next(free)
    return out


def _symmetric(m: Any) -> Any:
    return (m + m.T) / 2


def rounded(value: Array, digits: int) -> sympy.Matrix:
    """A matrix of fractions with this many decimals."""
    scale = 10**digits
    rows = np.atleast_2d(np.asarray(value, dtype=float))
    return sympy.Matrix(rows.shape[0], rows.shape[1], [
        sympy.Rational(round(Fraction(float(e)) * scale), scale) for e in rows.ravel()
    ])  # fmt: skip


def positive_definite(m: sympy.Matrix) -> bool:
    """Whether a symmetric matrix of fractions is positive definite: all pivots of L D L^T are above 0."""
    rows = [[Fraction(int(e.p), int(e.q)) for e in m.row(i)] for i in range(m.rows)]
    if any(rows[i][j] != rows[j][i] for i in range(m.rows) for j in range(i)):
        return False
    for k in range(len(rows)):
        pivot = rows[k][k]
        if pivot <= 0:
            return False
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / pivot
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return True
