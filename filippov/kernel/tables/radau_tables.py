"""Constants of the Radau IIA method with three stages (Hairer & Wanner 1996, section IV.8), and positions.

Collocation at C: Z = step (A x I) F(x + Z). The inverse of A has one real eigenvalue REAL and a pair
PAIR -+ i SPIN; with Z = (TO_Z x I) W Newton's matrices decouple into a real and a complex one of n rows.
"""

import numpy as np

from filippov.base.arrays import Array

_ROOT = 6.0**0.5


def _matrix() -> Array:
    """The coefficients A of the method (there, table 5.6)."""
    s = _ROOT
    rows = np.array(
        [
            [(88 - 7 * s) / 360, (296 - 169 * s) / 1800, (-2 + 3 * s) / 225],
            [(296 + 169 * s) / 1800, (88 + 7 * s) / 360, (-2 - 3 * s) / 225],
            [(16 - s) / 36, (16 + s) / 36, 1 / 9],
        ]
    )
    return np.asarray(rows, dtype=np.float64)


def _split(inverse: Array) -> tuple[float, float, float, Array]:
    """Real eigenvalue, real and imaginary part of the pair, and the matrix that splits the inverse of A."""
    values, vectors = np.linalg.eig(inverse)
    real = int(np.argmin(np.abs(values.imag)))
    one = int(np.argmax(values.imag))
    single = (vectors[:, real] / vectors[2, real]).real
    double = vectors[:, one] / vectors[2, one]
    columns = np.column_stack([single, double.real, double.imag])
    return float(values[real].real), float(values[one].real), float(values[one].imag), columns


def _polynomials(nodes: Array) -> Array:
    """Lagrange polynomials of the nodes: row j has the coefficients of the one that is 1 at node j."""
    return np.asarray(np.linalg.inv(np.vander(nodes, len(nodes), increasing=True)).T, dtype=np.float64)


_A = _matrix()
_C = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
_A_INVERSE = np.asarray(np.linalg.inv(_A), dtype=np.float64)
_REAL, _PAIR, _SPIN, _TO_Z = _split(_A_INVERSE)

REAL, PAIR, SPIN = _REAL, _PAIR, _SPIN
C: list[float] = _C.tolist()
A_INVERSE: list[float] = _A_INVERSE.ravel().tolist()
TO_Z: list[float] = _TO_Z.ravel().tolist()
TO_W: list[float] = np.linalg.inv(_TO_Z).ravel().tolist()
# Weights of the three Z in the error estimate, after the field at the start (there, equation 8.19).
ERROR_Z: list[float] = [(-13 - 7 * _ROOT) / 3, (-13 + 7 * _ROOT) / 3, -1 / 3]
# The collocation polynomial through 0 and the three Z: powers 1, 2, 3 of theta, one row per Z.
FROM_Z: list[float] = _polynomials(np.array([0.0, *_C]))[1:, 1:].ravel().tolist()

# Where a step is compared with the field between its nodes; there the collocation polynomial and its slope,
# one weight per Z.
BETWEEN = 0.4
_ROWS = np.array(FROM_Z).reshape(3, 3)
VALUE_Z: list[float] = (_ROWS @ [BETWEEN, BETWEEN**2, BETWEEN**3]).tolist()
SLOPE_Z: list[float] = (_ROWS @ [1.0, 2 * BETWEEN, 3 * BETWEEN**2]).tolist()


def dense_rows() -> tuple[tuple[float, ...], ...]:
    """Powers of theta of the collocation polynomial for each stage: start, three in the step, end."""
    inside = [(0.0, *(float(row[q]) / (q + 1) for q in range(3))) for row in _polynomials(_C)]
    return ((0.0,) * 4, *inside, (0.0,) * 4)


# Also returned by `newton`, besides the codes of `field`.
NOT_CONVERGED, UNDEFINED = 3, 4
MOST_ITERATIONS = 10
# A rate of convergence below which J is kept; spacing of doubles at 1, and its root.
FAST, SPACING, ROOT_SPACING = 1e-3, 2.220446049250313e-16, 1.4901161193847656e-08
# A part of the field: a difference that is smaller may be lost in its rounding.
LEAST_CHANGE = 1e-12
# A part of the steepness by which the stages of a step were solved, with which it is not that of its end.
GONE = 1e-2
