"""One step of Dormand and Prince's method, and roots of a function on it.

Order 5 with an error estimate of order 4 and a dense output of order 4 (Dormand & Prince 1980; the dense
output as in scipy's RK45). A watched function is interpolated at nine Chebyshev points of the step; its first
zero is isolated in Bernstein form, where coefficients of one sign leave no zero out.

The text of this file is part of exported modules: it needs `math` alone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

EPS = 2.0**-52
NODES = (1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0)
STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
WEIGHTS = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
ERROR = (-71 / 57600, 0.0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40)
DENSE = (
    (1.0, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432),
    (0.0, 0.0, 0.0, 0.0),
    (0.0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799),
    (0.0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072),
    (0.0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632),
    (0.0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844),
    (0.0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423),
)
# Places in a step at which a watched function is sampled, and at which its polynomial is checked.
DEGREE = 8
PLACES = tuple(0.5 - 0.5 * math.cos(math.pi * k / DEGREE) for k in range(DEGREE + 1))
PROBES = (0.085, 0.31, 0.63, 0.925)

Field = Callable[[float, Sequence[float]], list[float]]


class Step:
    """x(t) over [t, t + length]: the state at its end, the error estimate a component, the dense output."""

    def __init__(self, field: Field, t: float, x: Sequence[float], length: float) -> None:
        n = range(len(x))
        self.t, self.x, self.length = t, list(x), length
        k = [field(t, x)]
        for node, row in zip(NODES, STAGES, strict=True):
            k.append(field(t + node * length, [x[i] + length * _sum(row, k, i) for i in n]))
        self.end = [x[i] + length * _sum(WEIGHTS, k, i) for i in n]
        k.append(field(t + length, self.end))
        self.error = [length * _sum(ERROR, k, i) for i in n]
        self.powers = [[_sum([row[q] for row in DENSE], k, i) for q in range(4)] for i in n]

    def at(self, theta: float) -> list[float]:
        """The state at t + theta length."""
        return [
            x + self.length * theta * (q[0] + theta * (q[1] + theta * (q[2] + theta * q[3])))
            for x, q in zip(self.x, self.powers, strict=True)
        ]


def _sum(weights: Sequence[float], k: Sequence[Sequence[float]], i: int) -> float:
    return sum(w * slope[i] for w, slope in zip(weights, k, strict=False) if w)


def bernstein_values(theta: float, degree: int) -> list[float]:
    """The Bernstein polynomials of a degree at theta."""
    return [math.comb(degree, j) * theta**j * (1 - theta) ** (degree - j) for j in range(degree + 1)]


def inverse(matrix: Sequence[Sequence[float]]) -> list[list[float]]:
    """The inverse of a small regular matrix, by elimination with pivots."""
    n = len(matrix)
    rows = [[*row, *(float(i == j) for j in range(n))] for i, row in enumerate(matrix)]
    for c in range(n):
        best = max(range(c, n), key=lambda r: abs(rows[r][c]))
        rows[c], rows[best] = rows[best], rows[c]
        rows[c] = [value / rows[c][c] for value in rows[c]]
        for r in range(n):
            if r != c:
                rows[r] = [a - rows[r][c] * b for a, b in zip(rows[r], rows[c], strict=True)]
    return [row[n:] for row in rows]


# From values at PLACES to coefficients in Bernstein form.
TO_BERNSTEIN = inverse([bernstein_values(theta, DEGREE) for theta in PLACES])


def coefficients(values: Sequence[float]) -> list[float]:
    """Bernstein coefficients of the polynomial with these values at PLACES."""
    return [sum(w * v for w, v in zip(row, values, strict=True)) for row in TO_BERNSTEIN]


def without_zeros_at_start(c: Sequence[float], order: int) -> list[float]:
    """Coefficients of p(theta)/theta**order up to a factor, its first `order` derivatives at 0 taken as 0."""
    for _ in range(order):
        c = [value / k for k, value in enumerate(c) if k]
    return list(c)


def first_zero(c: Sequence[float]) -> float | None:
    """The first theta in (0, 1] at which a polynomial that starts above 0 is no longer so; None if it stays.

    Zeros closer together than 1e-9 of the step are not told from a tangency, and are none.
    """
    if min(c) > 0.0:
        return None
    pieces = [(0.0, 1.0, list(c))]
    while pieces:
        low, high, q = pieces.pop()
        if min(q) > 0.0:
            continue
        if q[0] <= 0.0:
            return low
        if high - low < 1e-9:
            if q[-1] <= 0.0:
                return high
            continue
        left, right = [q[0]], [q[-1]]
        while len(q) > 1:
            q = [0.5 * (a + b) for a, b in itertools.pairwise(q)]
            left.append(q[0])
            right.append(q[-1])
        middle = 0.5 * (low + high)
        pieces += [(middle, high, right[::-1]), (low, middle, left)]
    return None
