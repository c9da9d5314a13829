"""Instants of time events: decided in the compiled loop as by the general path, one by one and in batches."""

from fractions import Fraction

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
from filippov.kernel.loop.state import Tick
from filippov.kernel.loop.ticks import following, preceding

x, y, z = states("x y z")
p = parameters(T=0.3, a=0.5, k=1.0, c=0.1)
# A relay that is slid on, one with hysteresis, and resets that jump over both.
SAMPLED = System(
    {x: y, y: -x - sign(y - p.c) + z, z: 0.2 * sign(x) - z},
    surfaces=[Surface("relay", y - p.c), Surface("band", x, width=0.2)],
    parameters=p,
    time_events=[
        TimeEvent("sample", period=p.T, start=p.T / 2, reset={z: p.a * x}),
        TimeEvent("kick", times=(0.7, 1.7, 6 * p.T), reset={y: -y + p.k, x: x - p.k}),
        TimeEvent("beat", period=0.25),
    ],
)
SPAN = (0, 4)


def draws(count: int) -> list[tuple[tuple[float, ...], dict[str, float]]]:
    rng = np.random.default_rng(141)
    out = []
    for _ in range(count):
        x0 = tuple(rng.uniform(-2, 2, 3))
        names = {"T": rng.uniform(0.29, 0.5), "a": rng.uniform(-3, 3), "k": rng.choice([0, 0.3, 1, 2])}
        out.append((x0, {**names, "c": rng.uniform(-0.3, 0.3)}))
    return out


def shown(run):
    return [
        (e.surface, e.kind, e.before, e.after, e.group, e.note, e.x_after is None, round(e.t, 9))
        for e in run.events
        if not e.surface.startswith("event")
    ]


def general(x0, values, **options):
    """The same with a function to watch, which leaves all instants to the general path."""
    return solve(SAMPLED, x0, SPAN, parameters=values, events=lambda t, y: 1.0, **options)


@pytest.fixture
def alone(monkeypatch):
    """Let no row of a batch be solved again."""

    def refuse(*_, **__):
        raise AssertionError("left the compiled loop")

    return lambda: monkeypatch.setattr("filippov.solving.solver.solve", refuse)


def test_14_1_instants_are_decided_as_by_the_general_path() -> None:
    left = 0
    for x0, values in draws(40):
        here, there = solve(SAMPLED, x0, SPAN, parameters=values), general(x0, values)
        assert shown(here) == shown(there)
        assert (here.status, here.end_mode) == (there.status, there.end_mode[:2])
        assert here.x_end == pytest.approx(there.x_end, rel=1e-9, abs=1e-9)
        for one, other in zip(here.events, there.events, strict=True):
            assert one.x == pytest.approx(other.x, rel=1e-8, abs=1e-8)
            if one.x_after is not None:
                assert one.x_after == pytest.approx(other.x_after, rel=1e-8, abs=1e-8)
        left += any(e.kind == "sliding exit" and e.t in here.t_events[2] for e in here.events)
    assert left > 3


def test_14_1_a_reset_that_takes_its_sign_from_a_slide_is_decided_in_the_loop(alone) -> None:
    """x' = (1 - q^2) (w sin - k Sgn(x)) + q u, q = -1, 0, 1 by clocks: nothing holds x = 0 unless q = 0."""
    q, r = states("x q")
    by = parameters(k=1.0, u=0.5, T=0.3, w=0.4, d=0.1)
    bridge = System(
        {q: (1 - r**2) * (by.w * sin(7 * t) - by.k * sign(q)) + r * by.u - 0.2 * q, r: 0 * r},
        surfaces=[Surface("current", q)],
        parameters=by,
        time_events=[
            TimeEvent("up", period=2 * by.T, start=by.d, reset={r: 1}),
            TimeEvent("off", period=by.T, start=by.T, reset={r: 0}),
            TimeEvent("down", period=2 * by.T, start=by.T + by.d, reset={r: -1}),
        ],
    )
    rng, count = np.random.default_rng(8), 64
    starts = np.column_stack([rng.uniform(-0.3, 0.3, count), np.zeros(count)])
    ranges = {"k": (0.5, 3), "u": (-1, 1), "T": (0.2, 0.6), "w": (0, 2), "d": (0.05, 0.15)}
    rows = {name: rng.uniform(*ends, count) for name, ends in ranges.items()}
    singles, released = [], 0
    for k in range(count):
        values = {name: float(column[k]) for name, column in rows.items()}
        here = solve(bridge, starts[k], SPAN, parameters=values)
        singles.append(here)
        if k < 12:
            there = solve(bridge, starts[k], SPAN, parameters=values, events=lambda t, y: 1.0)
            assert shown(here) == shown(there)
            assert here.x_end == pytest.approx(there.x_end, rel=1e-9, abs=1e-9)
        released += any(e.kind == "sliding exit" and e.x[0] == 0 and e.note == "" for e in here.events)
    assert released > 20
    alone()
    for lanes in (1, 8):
        many = solve_many(bridge, starts, SPAN, parameters=rows, lanes=lanes)
        assert many.success.all()
        assert np.allclose(many.x, [run.x_end for run in singles], rtol=1e-7, atol=1e-8)


def test_14_1_batches_and_lanes_follow_time_events(alone) -> None:
    some = draws(64)
    starts = np.array([x0 for x0, _ in some])
    values = {name: np.array([row[name] for _, row in some]) for name in some[0][1]}
    singles = [solve(SAMPLED, x0, SPAN, parameters=row) for x0, row in some]
    for lanes in (1, 8):
        many = solve_many(SAMPLED, starts, SPAN, parameters=values, lanes=lanes)
        assert np.allclose(many.x, [run.x_end for run in singles], rtol=1e-7, atol=1e-8)
        for name in ("relay", "band"):
            assert many.events(name).tolist() == [len(run.events.of(name)) for run in singles]
        assert set(many.status) == {run.status for run in singles}
    # Without two resets at one instant nothing is left to `solve`.
    alone()
    assert solve_many(SAMPLED, starts, (0, 0.69), parameters=values, lanes=8).success.all()
    back = solve_many(SAMPLED, starts[:4], (0.1, 0), parameters={"T": 0.3}, backward=True, lanes=1)
    assert "left the compiled loop" in back.message[0]


@pytest.mark.parametrize("count", [1, 2])
def test_14_1_a_run_stops_where_a_reset_jumps_over_a_surface(count) -> None:
    stop = Stop("relay", "crossing", count)
    ended = 0
    for x0, values in draws(20):
        here, there = solve(SAMPLED, x0, SPAN, parameters=values, stop=stop), general(x0, values, stop=stop)
        assert shown(here) == shown(there)
        assert here.status is there.status
        assert here.t_end == pytest.approx(there.t_end, rel=1e-12)
        many = solve_many(SAMPLED, [x0], SPAN, parameters=values, stop=stop)
        assert many.status[0] is here.status
        assert many.x[0] == pytest.approx(here.x_end, rel=1e-8, abs=1e-9)
        ended += here.status is Status.STOPPED and here.events[-1].surface != "relay"
    assert ended > 2


def test_14_1_the_budget_of_events_counts_instants() -> None:
    for budget in (1, 5, 12):
        x0, values = draws(1)[0]
        given = {"max_events": budget}
        runs = solve(SAMPLED, x0, SPAN, parameters=values, **given), general(x0, values, **given)
        assert [run.status for run in runs] == [Status.MAX_EVENTS] * 2
        assert len(runs[0].events) == len(runs[1].events) >= budget
        many = solve_many(SAMPLED, [x0], SPAN, parameters=values, **given)
        assert many.status[0] is Status.MAX_EVENTS


def test_14_1_the_loop_in_python_takes_the_same_instants() -> None:
    x0, values = draws(3)[2]
    here, there = (solve(SAMPLED, x0, (0, 1), parameters=values, backend=b) for b in ("compiled", "python"))
    assert shown(here) == shown(there)
    assert there.x_end == pytest.approx(here.x_end, rel=1e-12)


def test_14_1_instants_are_the_neighbours_among_all() -> None:
    """Against exact numbers: the least fl(start + fl(k period)) above t, the largest below it."""
    rng = np.random.default_rng(3)
    tick, none = Tick.new(), np.zeros(0)
    for _ in range(1000):
        tick.period = 10.0 ** rng.uniform(-6, 6)
        tick.start = float(rng.choice([0.0, tick.period, rng.normal() * tick.period * 10]))
        near = tick.start + rng.integers(0, 10 ** rng.integers(1, 12)) * tick.period
        close = np.nextafter(near, np.inf), np.nextafter(near, -np.inf)
        t = float(rng.choice([near, *close, rng.normal() * near]))
        guess = round((Fraction(t) - Fraction(tick.start)) / Fraction(tick.period))
        some = [float(tick.start + k * tick.period) for k in range(max(guess - 3, 0), max(guess, 0) + 4)]
        assert following(tick, none, t) == min(q for q in some if q > t)
        below = [q for q in some if q < t]
        assert preceding(tick, none, t) == (max(below) if below else -np.inf)
    times = np.cumsum(rng.exponential(size=50))
    tick.first, tick.listed = 10, 30
    inside = times[10:40]
    for t in (*inside, *(inside + 1e-3), 0.0, 1e9):
        assert following(tick, times, t) == min(inside[inside > t], default=np.inf)
        assert preceding(tick, times, t) == max(inside[inside < t], default=-np.inf)
