"""Continuation of orbits whose resets have kinks, against the piecewise linear map of the line.

A clock takes x to mu + a x for x < 0 and to mu + b x for x > 0. Fixed points are mu/(1 - a) and mu/(1 - b)
on their sides, and meet at mu = 0: one goes over into the other if (1 - a)(1 - b) > 0, else both are on one
side of mu. Source: di Bernardo, Budd, Champneys, Kowalczyk 2008, section 3.1.
"""

from __future__ import annotations

import numpy as np
import pytest

from filippov import Abs, Max, Min, Piecewise, System, TimeEvent, parameters, states
from filippov.analysis import continuation, find_orbit
from filippov.base.errors import UsageError

(x,) = states("x,")
SPELLINGS = {
    "min": lambda a, b: a * Min(x, 0) + b * Max(x, 0),
    "abs": lambda a, b: (a + b) * x / 2 + (b - a) * Abs(x) / 2,
    "piecewise": lambda a, b: Piecewise((a * x, x < 0), (b * x, True)),
}


def system(a: float, b: float, decay: float, spelling: str) -> System:
    q = parameters(a=a, b=b, mu=0.3)
    grown = SPELLINGS[spelling](q.a, q.b) * float(np.exp(decay))
    return System(
        {x: -decay * x}, time_events=[TimeEvent("tick", period=1.0, reset={x: q.mu + grown})], parameters=q
    )


@pytest.mark.parametrize("seed", range(12))
def test_a_fixed_point_meets_the_kink(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = np.round(rng.uniform(-2.5, 2.5, 2), 2)
    if min(abs(a - 1), abs(b - 1), abs(a - b)) < 0.1:
        a, b = 0.5, -0.7
    side = 1 if rng.random() < 0.5 else -1
    of = {1: b, -1: a}
    mu = side * 0.3 * (1 if of[side] < 1 else -1)
    one = system(a, b, float(rng.choice([0.0, 0.4])), str(rng.choice(list(SPELLINGS))))
    start = mu / (1 - of[side])
    orbit = find_orbit(one, (start,), t0=0.0, period=1.0, parameters={"mu": mu})
    assert orbit.multipliers[0].real == pytest.approx(of[side], rel=1e-7)
    branch = continuation(one, orbit, parameter="mu", bounds=(-0.4, 0.4)).run()
    collisions = [point for point in branch.special if point.special == "border collision"]
    assert len(collisions) == 1
    assert abs(collisions[0].value) < 1e-8
    assert [point.special for point in branch.special] == ["border collision"]
    # On either side the multiplier and the place are those of the map there.
    through = (1 - a) * (1 - b) > 0
    for point in branch.points:
        if abs(point.value) < 1e-4:
            continue
        now = side if (point.value > 0) == (mu > 0) and through else -side if through else None
        candidates = (now,) if now else (1, -1)
        known = [of[k] for k in candidates]
        assert min(abs(point.multipliers[0].real - m) for m in known) < 1e-6
    if not through:
        assert all(point.value * mu > -1e-6 for point in branch.points)
        told = {round(point.multipliers[0].real, 5) for point in branch.points if abs(point.value) > 1e-3}
        assert told == {round(float(a), 5), round(float(b), 5)}


def test_an_orbit_that_is_held_between_ticks_has_the_size_of_its_state() -> None:
    """x' = 0: steps were measured by how far the orbit moves, which is not at all."""
    q = parameters(r=2.6)
    one = System(
        {x: 0 * x}, time_events=[TimeEvent("tick", period=1.0, reset={x: q.r * x * (1 - x)})], parameters=q
    )
    orbit = find_orbit(one, (0.6,), t0=0.5, period=1.0)
    branch = continuation(one, orbit, parameter="r", bounds=(2.2, 3.3)).run()
    assert [p.special for p in branch.special] == ["period doubling"]
    assert branch.special[0].value == pytest.approx(3.0, abs=1e-7)
    assert (branch.points[0].value, branch.points[-1].value) == pytest.approx((2.2, 3.3))
    assert len(branch.points) < 60


def test_an_orbit_in_place_of_the_system_is_answered() -> None:
    one = system(0.5, -0.5, 0.0, "abs")
    orbit = find_orbit(one, (0.2,), t0=0.5, period=1.0)
    with pytest.raises(UsageError, match="system is of type Orbit, expected a System"):
        continuation(orbit, (0.2,), parameter="mu", bounds=(0, 1))
