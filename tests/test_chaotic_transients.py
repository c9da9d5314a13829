"""Attractors beside chaotic saddles, against the maps iterated until they repeat.

A clock makes any map of the plane: states are held between its ticks. Inside periodic windows, and at cycles
far from where solutions start, they go round irregularly for hundreds of iterates before they settle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from sympy import Expr

from filippov import Max, Min, System, TimeEvent, states
from filippov.analysis import attractors

Array = npt.NDArray[np.float64]
x, y = states("x y")


def clocked(*after: Expr) -> System:
    """A system that a clock takes by a map once a second."""
    free = (x, y)[: len(after)]
    clock = TimeEvent("tick", period=1.0, reset=dict(zip(free, after, strict=True)))
    return System({q: 0 * q for q in free}, time_events=[clock])


def periods(step: Callable[[Array], Array], box: float, n: int) -> set[int]:
    """The least periods of what a hundred starts come to; 0 for what repeats after no 64 iterates."""
    rng = np.random.default_rng(5)
    z = rng.uniform(-box, box, (100, n))
    with np.errstate(all="ignore"):
        for _ in range(60_000):
            z = step(z)
        rows = [z := step(z) for _ in range(200)]
    path = np.array(rows)
    out = set()
    for k in range(len(z)):
        own = path[:, k]
        if np.all(np.isfinite(own)):
            fits = (q for q in range(1, 65) if np.max(np.abs(own[q:] - own[:-q])) < 1e-8)
            out.add(next(fits, 0))
    return out


# In windows of period 7, at a cycle of period 4, and where it is chaotic (`periods` says which).
@pytest.mark.parametrize(("a", "known"), [(1.3, {7}), (1.4, {0}), (1.0, {4})])
def test_henon(a: float, known: set[int]) -> None:
    def step(z: Array) -> Array:
        return np.stack([1 - a * z[:, 0] ** 2 + z[:, 1], 0.3 * z[:, 0]], axis=1)

    truth = periods(step, 0.6, 2)
    found = attractors(clocked(1 - a * x**2 + y, 0.3 * x), {"x": (-0.6, 0.6), "y": (-0.6, 0.6)}, samples=100)
    told = {one.period if one.kind == "periodic" else 0 for one in found.attractors}
    assert told == truth
    assert truth == known
    assert len(found.attractors) == len(truth)


@pytest.mark.parametrize("r", [3.83, 3.6275, 3.9])
def test_logistic(r: float) -> None:
    # Starts of z - 1/2 in (-0.45, 0.45).
    truth = periods(lambda z: r * (z + 0.5) * (0.5 - z) - 0.5, 0.45, 1)
    found = attractors(clocked(r * x * (1 - x)), {"x": (0.05, 0.95)}, samples=100)
    assert {one.period if one.kind == "periodic" else 0 for one in found.attractors} == truth
    assert all(one.kind in {"periodic", "chaotic"} for one in found.attractors)


@pytest.mark.parametrize(("a", "b", "known"), [(0.9, -1.2, {0}), (0.4, -1.4, {2}), (0.6, -2.9, {0})])
def test_skew_tent(a: float, b: float, known: set[int]) -> None:
    truth = periods(lambda z: 0.3 + a * np.minimum(z, 0) + b * np.maximum(z, 0), 1.0, 1)
    rule = 0.3 + a * Min(x, 0) + b * Max(x, 0)
    found = attractors(clocked(rule), {"x": (-1, 1)}, samples=100)
    assert {one.period if one.kind == "periodic" else 0 for one in found.attractors} == truth == known


@pytest.mark.parametrize(("rho", "chaotic"), [(23.5, False), (24.5, True)])
def test_lorenz(rho: float, chaotic: bool) -> None:
    """Chaos attracts above rho = 24.06 only (Sparrow 1982); below it is a transient, however long."""
    (z,) = states("z,")
    field = {x: 10 * (y - x), y: rho * x - y - x * z, z: x * y - 8 * z / 3}
    found = attractors(System(field), {"x": (-20, 20), "y": (-20, 20), "z": (0, 45)}, samples=150, cells=30)
    assert any(one.kind == "chaotic" for one in found.attractors) == chaotic
    assert all(one.kind in {"chaotic", "equilibrium"} for one in found.attractors)
