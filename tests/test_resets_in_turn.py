"""Resets of one instant whose conditions read what others have changed, against maps in plain Python."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from filippov import Heaviside, Status, Surface, System, TimeEvent, sign, solve, states
from filippov.analysis import flow_derivative

A, B, C = QUANTITIES = states("a b c")
Map = tuple[int, int, int, float, float, int]


def draw(seed: int) -> tuple[list[Map], Any]:
    """Two or three maps, each of one state with a condition on others, and a start."""
    r = np.random.default_rng([7, seed])
    count = r.integers(2, 4)
    maps: list[Map] = []
    for _ in range(count):
        i, j, k, kind = map(int, r.integers((3, 3, 3, 4)))
        maps.append((i, j, k, r.uniform(-1, 1), r.uniform(-1.5, 1.5), kind))
    return maps, r.uniform(-1, 1, 3)


def formula(one: Map) -> dict[Any, Any]:
    i, j, k, c, d, kind = one
    q = QUANTITIES
    if kind == 0:
        return {q[i]: np.where(q[j] > c, q[i] + d, q[i])}
    if kind == 1 and j != k:
        return {q[i]: q[i] + d * Heaviside(q[j] - q[k] - c)}
    return {q[i]: d * sign(q[j] - c) if kind == 2 else q[i] + d}


def value(one: Map, x: Any) -> Any:
    i, j, k, c, d, kind = one
    after = np.array(x)
    if kind == 0:
        after[i] = x[i] + d if x[j] > c else x[i]
    elif kind == 1 and j != k:
        after[i] = x[i] + (d if x[j] - x[k] > c else 0)
    else:
        after[i] = d * np.sign(x[j] - c) if kind == 2 else x[i] + d
    return after


def ends_of(maps: list[Map], x0: Any) -> list[Any]:
    """The states after the maps, in every order."""
    ends = []
    for order in itertools.permutations(maps):
        x = x0
        for one in order:
            x = value(one, x)
        ends.append(x)
    return ends


@pytest.mark.parametrize("seed", range(16))
def test_clocks_of_one_instant_are_maps_one_after_the_other(seed: int) -> None:
    maps, x0 = draw(seed)
    ends = ends_of(maps, x0)
    ticks = [TimeEvent(f"tick{k}", times=(1.0,), reset=formula(one)) for k, one in enumerate(maps)]
    system = System({q: 0 * q for q in QUANTITIES}, time_events=ticks)
    run = solve(system, x0, (0, 2))
    if np.ptp(np.array(ends), axis=0).max() > 1e-12:
        assert run.status is Status.NON_UNIQUE
    else:
        assert run.success
        assert run.x_end == pytest.approx(ends[0], abs=1e-12)


def test_the_flow_through_two_resets_of_which_the_first_settles_the_second() -> None:
    """Both would make 2 a + 5 of a state below 2: after one of them it is above."""
    ticks = [TimeEvent(n, times=(1.0,), reset={A: np.where(A > 2, A, 2 * A + 5)}) for n in ("one", "other")]
    run = solve(System({A: -A}, time_events=ticks), (0.3,), (0, 2))
    assert run.x_end[0] == pytest.approx((0.6 * math.exp(-1) + 5) * math.exp(-1), abs=1e-9)
    assert flow_derivative(run)[0, 0] == pytest.approx(2 * math.exp(-2), abs=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_oscillators_that_absorb_each_other(seed: int) -> None:
    """Mirollo & Strogatz 1990: x' = S - x, a pulse of eps at x = 1; whom it takes to 1 is absorbed."""
    r, eps, level = np.random.default_rng(seed), 0.2, 1.05
    x = start = r.uniform(0, 0.95, 3)

    def heard(q: Any) -> Any:
        return np.where(q + eps >= 1, 0, q + eps)

    surfaces = [
        Surface(f"fire{i}", q - 1, side="-", reset={p: 0 if p is q else heard(p) for p in QUANTITIES})
        for i, q in enumerate(QUANTITIES)
    ]
    system = System({q: level - q for q in QUANTITIES}, surfaces=surfaces)
    t, t_end, together = 0.0, 20.0, 0
    while True:
        wait = math.log((level - x.max()) / (level - 1))
        if t + wait > t_end:
            break
        t, x = t + wait, level - (level - x) * math.exp(-wait)
        fires = x > 1 - 1e-9
        together += fires.sum() > 1
        # Whoever is first, the others that have arrived are absorbed.
        x = np.where(fires | (x + eps >= 1), 0.0, x + eps)
    run = solve(system, start, (0, t_end), simultaneous="sequential")
    assert together > 0
    assert run.success
    assert run.x_end == pytest.approx(level - (level - x) * math.exp(t - t_end), abs=1e-7)
    assert solve(system, start, (0, t_end)).status is Status.NON_UNIQUE
