"""Instants of clocks and inputs far from t = 0, or close together: none is lost, and none comes twice."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from exported import load

from filippov import (
    Input,
    Surface,
    System,
    TimeEvent,
    export_system,
    parameters,
    sign,
    solve,
    solve_many,
    states,
)

DRAWS = {"nightly": 400}.get(os.environ.get("FILIPPOV_PROFILE", ""), 30)
x, n = states("x n")
p = parameters(T=1.0, t0=0.0)
COUNTED = System(
    {x: n / p.T, n: 0 * n},
    time_events=[TimeEvent("clock", period=p.T, start=p.t0, reset={n: n + 1})],
)


def drawn(seed: int) -> tuple[float, float]:
    """An origin, and a time that is at least 1,000 roundings of it."""
    rng = np.random.default_rng((11, seed))
    origin = float(rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-3, 12))
    return origin, float(np.spacing(abs(origin)) * 10 ** rng.uniform(3, 7))


def staircase(instants: np.ndarray, end: float, period: float) -> float:
    """The integral of the number of instants passed, in periods."""
    return float(np.sum(end - instants[instants <= end])) / period


@pytest.mark.parametrize("many", [False, True])
def test_no_instant_of_a_clock_is_lost(many: bool) -> None:
    for seed in range(DRAWS):
        origin, period = drawn(seed)
        end = origin + 12.5 * period
        given = {"T": period, "t0": origin}
        instants = origin + period * np.arange(1, 13)
        if many:
            rows = solve_many(COUNTED, [(0, 0)] * 2, (origin, end), parameters=given, lanes=1)
            assert np.all(rows.success), seed
            got = rows.x[1]
        else:
            run = solve(COUNTED, (0, 0), (origin, end), parameters=given)
            assert run.success, seed
            assert run.events.t.tolist() == instants.tolist(), seed
            got = run.x_end
        assert got[1] == 12, seed
        assert got[0] == pytest.approx(staircase(instants, end, period), abs=0.1), seed


def test_no_instant_of_a_list_and_no_knot_is_lost() -> None:
    for seed in range(DRAWS):
        origin, least = drawn(seed)
        rng = np.random.default_rng((12, seed))
        times = origin + least * np.cumsum(rng.integers(1, 10, 10))
        end = float(times[-1] + 5.5 * least)
        clock = TimeEvent("clock", times=times.tolist(), reset={n: n + 1})
        # Each instant is as far from the next as from a knot: a part of the pulses is 1 while n is even.
        knots = np.concatenate([[origin - least], times, [end]])
        pulses = Input("pulses", knots, np.arange(12) % 2, kind="hold", outside="hold")
        run = solve(System({x: pulses / least, n: 0 * n}, time_events=[clock]), (0, 0), (origin, end))
        assert run.success, seed
        assert run.events.t.tolist() == times.tolist(), seed
        area = sum(b - a for k, (a, b) in enumerate(pairwise(knots)) if k % 2 == 1) / least
        assert run.x_end == pytest.approx([area, 10], abs=0.05), seed


def test_a_surface_beside_a_clock_keeps_its_own_time() -> None:
    """A relay of a place that is crossed half of a period before each instant, long after t = 0."""
    for seed in range(DRAWS):
        origin, period = drawn(seed)
        system = System(
            {x: -2 / p.T + 0 * x, n: sign(x) / p.T},
            surfaces=[Surface("x", x)],
            time_events=[TimeEvent("clock", period=p.T, start=p.t0, reset={x: 1})],
        )
        end = origin + 8.75 * period
        run = solve(system, (1, 0), (origin, end), parameters={"T": period, "t0": origin})
        assert run.success, seed
        assert [len(run.events.of("x", kind="crossing")), len(run.events.of("clock"))] == [17, 8], seed
        late = run.events.of("x", direction=-1).t - (origin + period * (np.arange(9) + 0.5))
        assert np.max(np.abs(late)) <= 8 * np.spacing(abs(origin)), seed
        assert run.x_end[1] == pytest.approx(0.25, abs=0.05), seed


def test_instants_a_few_roundings_apart() -> None:
    for gap in (2.0**-52, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-9):
        times = [1.0, 1.0 + gap, 1.0 + 2 * gap]
        doubled = System({n: 0 * n}, time_events=[TimeEvent("clock", times=times, reset={n: 2 * n})])
        assert solve(doubled, (1,), (0, 2)).x_end[0] == 8, gap


@pytest.mark.parametrize(("origin", "period"), [(0.0, 1e-3), (1e4, 1e-8), (1e6, 1e-6)])
def test_a_module_that_is_exported_loses_none(tmp_path: Path, origin: float, period: float) -> None:
    end, instants = origin + 12.5 * period, origin + period * np.arange(1, 13)
    module = load(export_system(COUNTED, tmp_path / "counted.py"))
    got = module.run((0, 0), (origin, end), {"T": period, "t0": origin}, atol=1e-6)
    assert got.success
    assert got.x[-1][1] == 12
    assert got.x[-1][0] == pytest.approx(staircase(instants, end, period), rel=1e-2)
