"""Closed branches: each special point once, from any start, either way.

Equilibria, zeros and fixed points of a clock on the ellipse (x/a)^2 + ((m - c)/b)^2 = 1 turn back at
m = c +- b. A neuron V' = I - V + A cos 2 pi t that fires at 1 and starts at 0 again is locked 1:1 where
I + A r cos(...) = 1/k, k = 1 - 1/e, r = 1/sqrt(1 + 4 pi^2): between the folds I = 1/k -+ A r the phase of
firing makes a turn.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from filippov import Surface, System, TimeEvent, cos, parameters, pi, states, t
from filippov.analysis import continuation, find_orbit

DRAWS = 46 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 2
(x,) = states("x,")


def ellipse(rng: np.random.Generator) -> tuple[float, float, float, float, float]:
    """a, b, c and a point (x, m) of it."""
    a, b, c, angle = rng.uniform(0.4, 2), rng.uniform(0.3, 2), rng.uniform(-1, 1), rng.uniform(0.2, 1.3)
    angle += rng.integers(4) * np.pi / 2
    return a, b, c, float(a * np.cos(angle)), float(c + b * np.sin(angle))


# At 46 the test of a fold was known too badly for its root search.
@pytest.mark.parametrize("seed", [*range(DRAWS), 46])
@pytest.mark.parametrize("kind", ["equilibria", "zeros", "clock"])
def test_an_ellipse_has_two_folds(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c, at, value = ellipse(rng)
    q = parameters(m=value)
    rest = 1 - (x / a) ** 2 - ((q.m - c) / b) ** 2
    ways = {"parameter": "m", "bounds": (c - 1.3 * b, c + 1.7 * b), "direction": int(rng.integers(-1, 2))}
    if kind == "zeros":
        run = continuation(
            lambda u, m: (u / a) ** 2 + ((m - c) / b) ** 2 - 1, (at,), value=value, **ways
        )
    elif kind == "equilibria":
        run = continuation(System({x: rest}, parameters=q), (at,), mode="", **ways)
    else:
        clock = TimeEvent("tick", period=1.0, reset={x: x + 0.3 * a * rest})
        system = System({x: 0 * x}, time_events=[clock], parameters=q)
        run = continuation(system, find_orbit(system, (at,), period=1.0, t0=0.5), **ways)
    branch = run.run()
    assert branch.message == "the branch is closed"
    folds = sorted(point.value for point in branch.special if point.special == "fold")
    assert np.allclose(folds, (c - b, c + b), rtol=0, atol=1e-7)
    # Each value inside has two solutions, that of the start too.
    for m in (c + 0.4 * b, value):
        half = a * np.sqrt(1 - ((m - c) / b) ** 2)
        got = sorted(point.u[0] for point in run.at(m))
        assert np.allclose(got, (-half, half), rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_a_locked_neuron_has_two_folds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    force, share = rng.uniform(0.1, 0.5), rng.uniform(-0.8, 0.8)
    k, reach = 1 - np.exp(-1), force / np.sqrt(1 + 4 * np.pi**2)
    q = parameters(I=1 / k + share * reach)
    fires = Surface("fires", x - 1, reset={x: 0 * x}, side="-")
    neuron = System({x: q.I - x + force * cos(2 * pi * t)}, surfaces=[fires], parameters=q)
    orbit = find_orbit(neuron, (0.3,), period=1.0, transient=50)
    way = int(rng.choice([-1, 1]))
    branch = continuation(neuron, orbit, parameter="I", bounds=(1.3, 1.9), direction=way).run()
    assert branch.message == "the branch is closed"
    assert [point.special for point in branch.special] == ["fold", "fold"]
    folds = sorted(point.value for point in branch.special)
    assert np.allclose(folds, (1 / k - reach, 1 / k + reach), rtol=0, atol=1e-8)


def test_a_closed_branch_that_is_resumed_closes_where_it_began() -> None:
    q = parameters(m=0.3)
    system = System({x: 1 - x**2 - q.m**2}, parameters=q)
    call = {"parameter": "m", "bounds": (-2, 2), "mode": ""}
    begun = continuation(system, (0.91**0.5,), max_points=20, **call).run()
    assert "cut off by max_points = 20" in begun.message
    branch = continuation(system, (0.91**0.5,), resume=begun, **call).run()
    assert branch.message == "the branch is closed"
    assert np.allclose([point.value for point in branch.special], (1, -1), rtol=0, atol=1e-9)
