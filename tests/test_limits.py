"""Impacts on one contact that accumulate: gone on from in the compiled loop as by the general path.

One by one, in batches, in lanes and in Python, by random draws; the ball's limits against their series.
"""

import math

import numpy as np
import pytest

from filippov import (
    Status,
    Stop,
    Surface,
    System,
    TimeEvent,
    parameters,
    sign,
    sin,
    solve,
    solve_many,
    states,
    t,
)
from filippov.kernel.tables import codes
from filippov.solving import settling

x, v, u, n = states("x v u n")
p = parameters(g=9.81, e=0.6, a=0.0, w=3.0, c=0.1)
BALL = System({x: v, v: -p.g}, surfaces=[Surface("floor", x, reset={v: -p.e * v})], parameters=p)
# A floor that moves, a wind against the flight, a wall and a clock that kicks.
MOVING = x - p.a * sin(p.w * t)
BOX = System(
    {x: v, v: -p.g - p.c * v, u: 0.3 - 0.2 * u + 0.1 * sign(u - 0.4)},
    surfaces=[
        Surface("floor", MOVING, reset={v: -p.e * v - (1 + p.e) * MOVING.diff(t)}),
        Surface("wall", 1.2 - x, reset={v: -p.e * v}),
    ],
    parameters=p,
    time_events=[TimeEvent("kick", period=2.3, reset={v: v + 2})],
)
# Impacts that go on changing another state have no limit at rest.
RUBBED = System(
    {x: v, v: -p.g, u: 0 * u, n: 0 * n},
    surfaces=[Surface("floor", x, reset={v: -p.e * v, u: (1 - p.c) * u, n: n + 1})],
    parameters=p,
)
ON = {"zeno": "continue"}


@pytest.fixture
def general(monkeypatch):
    """Leave every accumulation to the general path."""
    return lambda: monkeypatch.setattr(settling, "rest_on_contact", lambda run: (codes.GENERAL, None))


@pytest.fixture
def alone(monkeypatch):
    """Let no row of a batch be solved again."""

    def refuse(*_, **__):
        raise AssertionError("left the compiled loop")

    return lambda: monkeypatch.setattr("filippov.solving.solver.solve", refuse)


def draws(count: int, **ranges) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(941)
    return {name: rng.uniform(*ends, count) for name, ends in ranges.items()}


def rows(table) -> list[dict[str, float]]:
    return [dict(zip(table, map(float, row), strict=True)) for row in zip(*table.values(), strict=True)]


def shown(run):
    return [(e.surface, e.kind, e.before, e.after, e.note) for e in run.events]


def same(here, there, rel=1e-9) -> None:
    assert here.status is there.status
    assert here.end_mode == there.end_mode
    assert shown(here) == shown(there)
    assert here.t_end == pytest.approx(there.t_end, rel=1e-12)
    assert here.x_end == pytest.approx(there.x_end, rel=rel, abs=1e-9)
    assert len(here.accumulations) == len(there.accumulations)
    for one, other in zip(here.accumulations, there.accumulations, strict=True):
        assert one.t == pytest.approx(other.t, rel=1e-13)
        assert one.x == pytest.approx(other.x, rel=1e-9, abs=1e-12)
        assert (one.surfaces, one.ratio) == (other.surfaces, pytest.approx(other.ratio, rel=1e-9))
        assert one.error == pytest.approx(other.error, rel=1e-6)
        assert one.x_error == pytest.approx(other.x_error, rel=1e-3)


def test_14_1_limits_of_a_ball_are_those_of_its_series(alone) -> None:
    """From rest at h0 the impacts accumulate at sqrt(2 h0/g) (1 + e)/(1 - e)."""
    table = draws(96, g=(1, 20), e=(0.05, 0.9))
    heights = np.random.default_rng(2).uniform(0.1, 10, 96)
    limits = np.sqrt(2 * heights / table["g"]) * (1 + table["e"]) / (1 - table["e"])
    starts = np.column_stack([heights, 0 * heights])
    cases = zip(starts, rows(table), strict=True)
    runs = [solve(BALL, x0, (0, 80), parameters=values, **ON) for x0, values in cases]
    for run, limit in zip(runs, limits, strict=True):
        assert run.end_mode == ((0,) if limit < 80 else (1,))
        if limit < 80:
            assert run.events[-1].kind == "sliding entry"
            assert abs(run.zeno.t - limit) <= run.zeno.error < 1e-6 * limit
            assert run.multiplier("floor", 80.0) == pytest.approx(1 - 2 * run.problem.p[0], rel=1e-12)
    alone()
    for lanes in (1, 8):
        many = solve_many(BALL, starts, (0, 80), parameters=table, lanes=lanes, **ON)
        assert many.success.all()
        assert many.events().tolist() == [len(run.events) for run in runs]
        assert np.array_equal(many.mode[:, 0] == 0, limits < 80)
        assert np.all(many.x[limits < 80] == 0)


def test_14_1_a_span_that_ends_shortly_before_the_limit_ends_there() -> None:
    """It ended beyond its span, as no_continuation."""
    limit = math.sqrt(2 / 9.81) * 1.6 / 0.4
    for before in 10.0 ** np.arange(-13, -3, 0.5):
        run = solve(BALL, (1, 0), (0, limit - before), **ON)
        assert run.success
        assert run.t_end == limit - before
        assert abs(run.x_end[1]) <= max(9.81 * before * 4, 1e-7)
        many = solve_many(BALL, [(1, 0)], (0, limit - before), **ON)
        assert many.success[0]
        assert many.t[0] == run.t_end
        assert many.x[0] == pytest.approx(run.x_end, abs=1e-12)
        assert solve(BALL, (1, 0), (0, limit - before), zeno="stop").status in (Status.SUCCESS, Status.ZENO)


@pytest.mark.parametrize("backend", ["compiled", "python"])
def test_14_1_rest_on_a_contact_begins_as_by_the_general_path(general, backend) -> None:
    count = 60 if backend == "compiled" else 3
    table = draws(count, e=(0.1, 0.8), a=(0, 0.05), w=(1, 12), c=(0, 1))
    starts = np.random.default_rng(5).uniform((0.1, -2, 0), (1.1, 2, 1), (count, 3))
    span = (0.1, 8) if backend == "compiled" else (0.1, 3)
    cases = list(zip(starts, rows(table), strict=True))
    here = [solve(BOX, x0, span, parameters=values, backend=backend, **ON) for x0, values in cases]
    general()
    for (x0, values), run in zip(cases, here, strict=True):
        same(run, solve(BOX, x0, span, parameters=values, backend=backend, **ON))
    assert sum(len(run.accumulations) for run in here) >= count
    assert sum(run.events.of("floor", kind="sliding exit").t.size for run in here) > count // 20


def test_14_1_rows_rest_as_single_runs_do_in_lanes_too() -> None:
    table = draws(64, e=(0.1, 0.8), a=(0, 0.05), w=(1, 12), c=(0, 1))
    starts = np.random.default_rng(5).uniform((0.1, -2, 0), (1.1, 2, 1), (64, 3))
    cases = zip(starts, rows(table), strict=True)
    singles = [solve(BOX, x0, (0.1, 8), parameters=values, **ON) for x0, values in cases]
    for lanes in (1, 8):
        many = solve_many(BOX, starts, (0.1, 8), parameters=table, lanes=lanes, **ON)
        assert list(many.status) == [run.status for run in singles]
        assert np.allclose(many.x, [run.x_end for run in singles], rtol=1e-7, atol=1e-8)
        for name in BOX.surface_names:
            for kind in ("reset", "sliding entry", "sliding exit"):
                found = many.events(name, kind).tolist()
                assert found == [len(run.events.of(name, kind=kind)) for run in singles]
        # Whoever the neighbours are: nothing changes.
        order = np.random.default_rng(1).permutation(64)[:40]
        some = {name: column[order] for name, column in table.items()}
        fewer = solve_many(BOX, starts[order], (0.1, 8), parameters=some, lanes=lanes, **ON)
        assert np.array_equal(fewer.x, many.x[order])
        assert np.array_equal(fewer.counts, many.counts[order])


def test_14_1_a_run_stops_at_the_limit_where_it_is_told_to(alone) -> None:
    table = draws(70, g=(5, 15), e=(0.2, 0.7))
    starts = np.column_stack([np.linspace(0.5, 2, 70), np.zeros(70)])
    limits = np.sqrt(2 * starts[:, 0] / table["g"]) * (1 + table["e"]) / (1 - table["e"])
    alone()
    for lanes in (1, 8):
        stop = Stop("floor", "sliding entry")
        many = solve_many(BALL, starts, (0, 30), parameters=table, lanes=lanes, stop=stop, **ON)
        assert set(many.status) == {Status.STOPPED}
        assert many.t == pytest.approx(limits, rel=1e-9)


def test_14_1_impacts_that_change_another_state_are_left_to_the_general_path(general) -> None:
    table = draws(12, e=(0.2, 0.8), c=(0.05, 0.5))
    starts = [(1, 0, 0, 0), (1, 0, 3, 0)] * 6
    cases = list(zip(starts, rows(table), strict=True))
    here = [solve(RUBBED, x0, (0, 9), parameters=values, **ON) for x0, values in cases]
    many = solve_many(RUBBED, starts, (0, 9), parameters=table, **ON)
    assert {run.status for run in here} == {Status.ZENO}
    assert all("'n'" in run.message for run in here)
    assert list(many.message) == [run.message for run in here]
    general()
    for (x0, values), run in zip(cases, here, strict=True):
        same(run, solve(RUBBED, x0, (0, 9), parameters=values, **ON))


def test_14_1_rows_that_stop_at_a_limit_say_what_single_runs_say(alone) -> None:
    table = draws(80, g=(5, 15), e=(0.2, 0.7))
    starts = np.column_stack([np.linspace(0.5, 2, 80), np.zeros(80)])
    cases = zip(starts, rows(table), strict=True)
    singles = [solve(BALL, x0, (0, 3), parameters=values) for x0, values in cases]
    assert {run.status for run in singles} == {Status.ZENO, Status.SUCCESS}
    alone()
    for lanes in (1, 8):
        many = solve_many(BALL, starts, (0, 3), parameters=table, lanes=lanes)
        assert list(many.status) == [run.status for run in singles]
        assert np.allclose(many.t, [run.t_end for run in singles], rtol=1e-10)
        for q, run in enumerate(singles):
            assert many.x[q] == pytest.approx(run.x_end, rel=1e-6, abs=1e-15)
            if run.status is Status.ZENO and lanes == 1:
                assert many.message[q] == run.message
            elif run.status is Status.ZENO:
                assert many.message[q][:20] == run.message[:20]
                assert many.message[q].endswith(run.message[-40:])
