"""Random planar piecewise linear systems with two attractors whose basins have a known border.

relays    u' = -a u + B sgn u, w' = -q w + k u: the line u = 0, from which both sides move away
saddles   u' = -b u + (a + b) clip(u, -1, 1) + k w, w' = -q w: the stable line of the saddle at 0 and, beyond
          |u| = 1, the solution that leads onto it
wells     x'' = -K (x - L sgn x) - D x' - F sgn x', F < K L: the solution that comes to rest on x = 0,
          followed in pieces by exponentials

The first two are told in other coordinates.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import brentq
from sympy import Abs

from filippov import System, sign, states
from filippov.analysis.invariant_sets.attractors import attractors

Array = npt.NDArray[np.float64]
Side = Callable[[Array], float]
x, y = states("x y")
SAMPLES, SHOWN, NEAR = 50, 9, 2e-2


def _mixed(rng: np.random.Generator) -> Array:
    """Coordinates that are not far from orthogonal."""
    angle = rng.uniform(-np.pi, np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shear = np.array([[1, rng.uniform(-0.5, 0.5)], [0, 1]])
    return np.asarray(turn @ shear)


def relays(rng: np.random.Generator) -> tuple[System, Side]:
    """The system, and on which side of the border a state lies; 0 near the border."""
    a, B, q, k = rng.uniform(0.3, 2, 4) * [1, 1, 1, rng.choice([-1, 1])]
    T = _mixed(rng)
    back = np.linalg.inv(T)
    u, w = (float(row[0]) * x + float(row[1]) * y for row in back)
    du, dw = -a * u + B * sign(u), -q * w + k * u

    def side(state: Array) -> float:
        first = float((back @ state)[0])
        return float(np.sign(first)) if abs(first) > NEAR else 0.0

    return System({x: T[0, 0] * du + T[0, 1] * dw, y: T[1, 0] * du + T[1, 1] * dw}), side


def saddles(rng: np.random.Generator) -> tuple[System, Side]:
    """The same."""
    a, b, q, k = rng.uniform(0.4, 1.5, 4)
    q = q if abs(q - b) > 0.1 else b + 0.2
    T = _mixed(rng)
    back = np.linalg.inv(T)
    u, w = (float(row[0]) * x + float(row[1]) * y for row in back)
    clipped = (Abs(u + 1) - Abs(u - 1)) / 2
    du, dw = -b * u + (a + b) * clipped + k * w, -q * w

    def border(w: float) -> float:
        last = (a + q) / k
        if abs(w) <= last:
            return -w / last
        # For w > 0 u' = -b u - (a + b) + k w until u = -1 at w = last, so that
        # u = -(a + b)/b + k w/(b - q) + C exp(-b t).
        back_in_time, part = np.log(abs(w) / last) / q, k / (b - q)
        free = -1 + (a + b) / b - part * last
        return float(np.sign(w) * (-(a + b) / b + part * abs(w) + free * np.exp(b * back_in_time)))

    def side(state: Array) -> float:
        first, second = back @ state
        apart = first - border(float(second))
        return float(np.sign(apart)) if abs(apart) > NEAR else 0.0

    return System({x: T[0, 0] * du + T[0, 1] * dw, y: T[1, 0] * du + T[1, 1] * dw}), side


def wells(rng: np.random.Generator) -> tuple[System, Side]:
    """The same; near the border is where states close by go to the other side."""
    K, L, D = rng.uniform(0.7, 3), rng.uniform(0.4, 1), rng.uniform(0, 0.4)
    F = K * L * rng.uniform(0.1, 0.7)
    step = 0.05

    def rest(state: Array) -> float:
        q, v = state
        while True:
            # On v = 0 the spring decides where it goes on, if it goes on.
            s = np.sign(q) if q else np.sign(v)
            if v == 0 and abs(K * (q - L * s)) <= F:
                return float(s)
            r = np.sign(v) if v else -np.sign(q - L * s)
            matrix = np.array([[0, 1, 0], [-K, -D, K * L * s - F * r], [0, 0, 0]])
            z, forward = np.array([q, v, 1.0]), expm(matrix * step)
            while True:
                last, z = z, forward @ z
                if z[0] * s <= 0 or z[1] * r <= 0:
                    break
            ends = []
            for i, sense in ((0, s), (1, r)):
                # A root at the start is where this piece begins.
                if z[i] * sense <= 0 and last[i] * sense > 0:
                    ends.append((brentq(_component, 0, step, args=(matrix, last, i), xtol=1e-14), i))
            if not ends:
                return 0.0
            h, i = min(ends)
            q, v, _ = expm(matrix * h) @ last
            q, v = (0.0, v) if i == 0 else (q, 0.0)

    def side(state: Array) -> float:
        moves = np.vstack((np.zeros(2), np.eye(2), -np.eye(2)))
        goes = {rest(state + 0.5 * NEAR * move) for move in moves}
        return goes.pop() if len(goes) == 1 else 0.0

    return System({x: y, y: -K * (x - L * sign(x)) - D * y - F * sign(y)}), side


def _component(h: float, matrix: Array, start: Array, i: int) -> float:
    return float((expm(matrix * h) @ start)[i])


KINDS = {"relays": relays, "saddles": saddles, "wells": wells}


def basins(kind: str, seed: int) -> str:
    """What is wrong with the attractors of a box and the states that go to them."""
    rng = np.random.default_rng([71, seed])
    system, side = KINDS[kind](rng)
    wide = float(rng.uniform(2, 5))
    box = {"x": (-wide, wide), "y": (-wide, wide)}
    got = attractors(system, box, samples=SAMPLES, seed=seed, plane=("x", "y"), resolution=SHOWN)
    if len(got.attractors) != 2:
        return f"{len(got.attractors)} attractors: {got}"
    sides = [side(np.asarray(one.states).reshape(-1, 2)[0]) for one in got.attractors]
    if sorted(sides) != [-1.0, 1.0]:
        return f"attractors on the sides {sides}"
    grid = np.array([(p, q) for q in got.y for p in got.x])
    for state, label in zip(np.vstack((got.states, grid)), (*got.label, *got.picture.ravel()), strict=True):
        known = side(state)
        if known and (label < 0 or sides[label] != known):
            return f"{state} goes to {label} of {sides}, known {known}"
    return ""
