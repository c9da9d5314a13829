"""Random linear plants with one feedback, and their motions by small steps: what certificates are tested by.

The motions are followed with the exponential of the linear part and the feedback held over each step, which
knows nothing of equilibria, sectors or multipliers; a relay chatters within a step of its surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sympy
from scipy.linalg import expm

from filippov import Abs, Max, Min, Piecewise, System, sign, states

NAMES = states("x1 x2 x3 x4")


@dataclass(frozen=True)
class Loop:
    """x' = A x - b psi(c . x), and the linear gains psi(y)/y between which psi lies (gains[1] may be inf)."""

    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    kind: str
    psi: Callable[[float], float]
    gains: tuple[float, float]
    system: System


def feedback(
    kind: str, y: sympy.Expr, k: float, m: float
) -> tuple[sympy.Expr, Callable[[float], float], tuple]:
    """(psi as an expression, as a function, its gains) by name."""
    if kind == "saturation":
        return k * Max(-1, Min(1, y)), lambda q: k * max(-1.0, min(1.0, q)), (0.0, k)
    if kind == "dead zone":
        e = k * Piecewise((y - 1, y > 1), (y + 1, y < -1), (0, True))
        return e, lambda q: k * (q - max(-1.0, min(1.0, q))), (0.0, k)
    if kind == "kink":
        return k * Max(0, y) + m * Min(0, y), lambda q: k * q if q > 0 else m * q, (min(k, m), max(k, m))
    if kind == "uneven saturation":
        return k * Max(-0.5, Min(2, y)), lambda q: k * max(-0.5, min(2.0, q)), (0.0, k)
    if kind == "relay":
        return k * sign(y), lambda q: k * float(np.sign(q)), (0.0, np.inf)
    if kind == "relay and slope":
        return k * sign(y) - m * y, lambda q: k * float(np.sign(q)) - m * q, (-m, np.inf)
    if kind == "quadratic":
        return k * y * Abs(y), lambda q: k * q * abs(q), (0.0, np.inf)
    raise ValueError(kind)


KINDS = ("saturation", "dead zone", "kink", "uneven saturation", "relay", "relay and slope", "quadratic")


def random_loop(rng: np.random.Generator, kind: str | None = None, n: int | None = None) -> Loop:
    """A loop of order 2 to 4 with coefficients in tenths, around the border of absolute stability."""
    kind = str(rng.choice(KINDS)) if kind is None else kind
    n = int(rng.integers(2, 5)) if n is None else n
    roots: list[complex] = []
    while len(roots) < n:
        if n - len(roots) >= 2 and rng.random() < 0.5:
            r = complex(-rng.uniform(0.05, 1), rng.uniform(0.3, 3))
            roots += [r, r.conjugate()]
        else:
            roots.append(-float(rng.uniform(0.1, 3)))
    a = np.round(np.real(np.poly(roots)), 1)
    A = np.eye(n, k=1)
    A[-1] = -a[:0:-1]
    b = np.zeros(n)
    b[-1] = 1.0
    c = np.round(rng.uniform(-0.5, 2, n), 1) * (rng.random(n) < 0.7)
    if not c.any():
        c[0] = 1.0
    if kind in {"relay", "relay and slope"} and c[-1] == 0 and n > 2:
        c[-2] = max(c[-2], 0.5)
    k, m = (round(float(q), 1) for q in rng.uniform(0.2, 6, 2))
    m = m / 4 if kind == "relay and slope" else m
    x = NAMES[:n]
    y = sum((sympy.Rational(str(q)) * e for q, e in zip(c, x, strict=True) if q), sympy.S.Zero)
    e, psi, gains = feedback(kind, y, k, m)
    rows = {}
    for name, row in zip(x, A, strict=True):
        terms = [sympy.Rational(str(q)) * s for q, s in zip(row, x, strict=True) if q]
        rows[name] = sum(terms, sympy.S.Zero)
    rows[x[-1]] -= e
    return Loop(A, b, c, kind, psi, gains, System(rows))


def ends(
    loop: Loop, start: np.ndarray, length: float, dt: float = 5e-3, of_set: bool = False
) -> tuple[float, float]:
    """The largest size of x over the last tenth, and over the tenth before the middle.

    of_set   of x less its mean over that tenth: for equilibria that are not alone
    """
    n = len(loop.A)
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[:n, n] = loop.A * dt, -loop.b * dt
    step = expm(big)
    E, g = step[:n, :n], step[:n, n]
    q, count = start.astype(float), int(length / dt)
    kept: dict[bool, list[np.ndarray]] = {True: [], False: []}
    for i in range(count):
        q = E @ q + g * loop.psi(float(loop.c @ q))
        if i > 0.9 * count or 0.4 * count < i < 0.5 * count:
            kept[i > 0.9 * count].append(q)
        if not np.all(np.abs(q) < 1e9):
            return np.inf, np.inf
    rows = [np.array(kept[late]) for late in (True, False)]
    last, middle = (float(np.max(np.abs(r - (np.mean(r, axis=0) if of_set else 0)))) for r in rows)
    return last, middle
