"""Constant tables of root isolation: Chebyshev points of a step and the way from values to Bernstein form."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

DEGREE = 8
NODES = DEGREE + 1
DEPTH = 46
RESOLUTION = 1e-3
NO_ROOT, SIMPLE_ROOT, TANGENT_ROOT = 0, 1, 2


def _binomial(n: int, k: int) -> float:
    value = 1.0
    for i in range(k):
        value = value * (n - i) / (i + 1)
    return value


def _positions(degree: int) -> npt.NDArray[np.float64]:
    """Chebyshev-Lobatto points on [0, 1]."""
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * np.arange(degree + 1) / degree)), dtype=np.float64)


def _values_to_bernstein(degree: int) -> npt.NDArray[np.float64]:
    theta = _positions(degree)
    basis = np.empty((degree + 1, degree + 1))
    for j in range(degree + 1):
        basis[:, j] = _binomial(degree, j) * theta**j * (1.0 - theta) ** (degree - j)
    return np.asarray(np.linalg.inv(basis), dtype=np.float64)


def to_bernstein(rows: Sequence[Sequence[float]], degree: int = DEGREE) -> list[float]:
    """Polynomials in powers, one per row, as Bernstein coefficients of a degree."""
    return [
        sum(row[j] * _binomial(a, j) / _binomial(degree, j) for j in range(min(a + 1, len(row))))
        for row in rows
        for a in range(degree + 1)
    ]


def by_degree(degree: int) -> dict[str, int | list[float]]:
    """The tables for a degree, by their names here."""
    size = degree + 1
    return {
        "DEGREE": degree,
        "NODES": size,
        "POSITION": _positions(degree).tolist(),
        "TO_BERNSTEIN": _values_to_bernstein(degree).ravel().tolist(),
        "BINOMIAL": [_binomial(n, k) for n in range(size) for k in range(size)],
    }


POSITION: list[float] = _positions(DEGREE).tolist()
TO_BERNSTEIN: list[float] = _values_to_bernstein(DEGREE).ravel().tolist()
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
