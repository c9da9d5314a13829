"""Constant tables of root isolation: Chebyshev points of a step and the way from values to Bernstein form."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

DEGREE = 8
NODES = DEGREE + 1
DEPTH = 46
RESOLUTION = 1e-3
NO_ROOT, SIMPLE_ROOT, TOUCHING = 0, 1, 2


def _binomial(n: int, k: int) -> float:
    value = 1.0
    for i in range(k):
        value = value * (n - i) / (i + 1)
    return value


def _positions() -> npt.NDArray[np.float64]:
    """Chebyshev-Lobatto points on [0, 1]."""
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * np.arange(NODES) / DEGREE)), dtype=np.float64)


def _values_to_bernstein() -> npt.NDArray[np.float64]:
    theta = _positions()
    basis = np.empty((NODES, NODES))
    for j in range(NODES):
        basis[:, j] = _binomial(DEGREE, j) * theta**j * (1.0 - theta) ** (DEGREE - j)
    return np.asarray(np.linalg.inv(basis), dtype=np.float64)


def to_bernstein(rows: Sequence[Sequence[float]]) -> list[float]:
    """Polynomials by their powers, one a row, as Bernstein coefficients of degree DEGREE, row by row."""
    return [
        sum(row[j] * _binomial(a, j) / _binomial(DEGREE, j) for j in range(min(a + 1, len(row))))
        for row in rows
        for a in range(NODES)
    ]


POSITION: list[float] = _positions().tolist()
TO_BERNSTEIN: list[float] = _values_to_bernstein().ravel().tolist()
BINOMIAL: list[float] = [_binomial(n, k) for n in range(NODES) for k in range(NODES)]
# Gauss collocation with 3 nodes: matrix, nodes, weights.
_ROOT = 15.0**0.5
GAUSS_A: list[float] = [
    5 / 36, 2 / 9 - _ROOT / 15, 5 / 36 - _ROOT / 30,
    5 / 36 + _ROOT / 24, 2 / 9, 5 / 36 - _ROOT / 24,
    5 / 36 + _ROOT / 30, 2 / 9 + _ROOT / 15, 5 / 36,
]  # fmt: skip
GAUSS_C: list[float] = [0.5 - _ROOT / 10, 0.5, 0.5 + _ROOT / 10]
GAUSS_B: list[float] = [5 / 18, 4 / 9, 5 / 18]
# 2**(j/64), correctly rounded: 2**(j/64) is the 64th root of 2**j.
EXP2: list[float] = [2.0 ** (j / 64) for j in range(64)]
