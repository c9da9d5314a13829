"""User events: scipy's meaning, every root, directions in true time, terminal counts."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from filippov import (
    ModelError,
    Status,
    Surface,
    System,
    TimeEvent,
    UsageError,
    UserEvent,
    sign,
    solve,
    states,
    t,
)
from filippov.model.expression import parse_expression
from filippov.solving.solution import Solution

x, y = states("x y")
SYMBOLIC = System({x: y, y: -x})
FUNCTIONS = System(field=lambda t, x, p, s: [x[1], -x[0]], states="x y")
BOTH = pytest.mark.parametrize("system", [SYMBOLIC, FUNCTIONS], ids=["symbolic", "functions"])


def event(g, terminal=False, direction=0.0):
    def called(t, y):
        return g(t, y)

    called.terminal, called.direction = terminal, direction
    return called


@BOTH
def test_the_same_events_as_scipy(system) -> None:
    events = [
        event(lambda t, y: y[0]),
        event(lambda t, y: y[1] - 0.5, direction=1),
        event(lambda t, y: y[0] * y[1] - 0.25, direction=-1),
        event(lambda t, y: math.cos(3 * t)),
    ]
    run = solve(system, (1, 0), (0, 10), events=events)
    peer = solve_ivp(
        lambda t, y: [y[1], -y[0]], (0, 10), (1, 0), events=events, rtol=1e-12, atol=1e-13, max_step=0.05
    )
    assert len(run.t_events) == len(run.y_events) == 4
    for mine, other, states_ in zip(run.t_events, peer.t_events, run.y_events, strict=True):
        assert mine == pytest.approx(other, abs=1e-8)
        assert states_ == pytest.approx(np.array([np.cos(mine), -np.sin(mine)]).T, abs=1e-8)
    assert run.modes == (".",)
    assert {e.kind for e in run.events} == {"user event"}


def test_every_root_of_a_fast_function_is_found() -> None:
    """cos(40 t) has 127 roots in (0, 10); few of them change the sign between the ends of a step."""
    run = solve(SYMBOLIC, (1, 0), (0, 10), events=lambda t, y: math.cos(40 * t))
    assert run.t_events[0] == pytest.approx(math.pi / 80 * np.arange(1, 255, 2), abs=1e-11)
    pair = solve(SYMBOLIC, (0, 1), (0, 3), rtol=1e-12, events=lambda t, y: y[0] - (1 - 1e-8))
    assert pair.t_events[0] == pytest.approx(math.pi / 2 + math.acos(1 - 1e-8) * np.array([-1, 1]), abs=1e-7)


@BOTH
def test_terminal(system) -> None:
    first = solve(system, (1, 0), (0, 20), events=event(lambda t, y: y[0], terminal=True))
    assert first.status is Status.STOPPED
    assert first.t[-1] == first.t_events[0][-1] == pytest.approx(math.pi / 2, rel=1e-10)
    third = solve(system, (1, 0), (0, 20), events=event(lambda t, y: y[0], terminal=3))
    assert third.t_events[0] == pytest.approx(math.pi / 2 * np.array([1, 3, 5]), rel=1e-9)
    assert third.t[-1] == third.t_events[0][2]
    rising = solve(system, (1, 0), (0, 20), events=[UserEvent(lambda t, y: y[0], terminal=2, direction=1)])
    assert rising.t_events[0] == pytest.approx(math.pi / 2 * np.array([3, 7]), rel=1e-9)


@BOTH
def test_directions_are_in_true_time(system) -> None:
    back = solve(system, (1, 0), (0, -10), backward=True, events=event(lambda t, y: y[0], direction=1))
    assert back.t_events[0] == pytest.approx([-math.pi / 2, -5 * math.pi / 2], rel=1e-9)
    assert [e.direction for e in back.events] == [1, 1]
    falls = event(lambda t, y: y[0], direction=-1, terminal=True)
    stop = solve(system, (1, 0), (0, -10), backward=True, events=falls)
    assert stop.t[-1] == pytest.approx(-3 * math.pi / 2, rel=1e-9)


def test_a_start_on_a_root_and_a_touching_are_no_events() -> None:
    run = solve(SYMBOLIC, (0, 1), (0, 4), events=[lambda t, y: y[0], lambda t, y: y[1] ** 2])
    assert run.t_events[0] == pytest.approx([math.pi], rel=1e-9)
    assert run.t_events[1].size == 0
    assert [e.kind for e in run.events if e.index == 1] == ["grazing"]


@pytest.mark.parametrize("backend", ["compiled", "python"])
@pytest.mark.parametrize("start", [1, -1])
def test_what_sticks_at_zero_has_arrived(start: int, backend: str) -> None:
    """x' = -2 sign(x) + t: x = +-1 -+ 2 t + t^2/2 sticks at its root and leaves upwards at t = 2."""
    symbolic = System({x: -2 * sign(x) + y, y: 1 + 0 * y})
    plain = System(
        field=lambda t, x, p, s: [-2 * s[0] + x[1], 1],
        surfaces=[Surface("x", lambda t, x, p: x[0])],
        states="x y",
    )
    arrives = 2 - math.sqrt(2) if start > 0 else math.sqrt(6) - 2
    for system, g in ((symbolic, x), (symbolic, lambda t, y: y[0]), (plain, lambda t, y: y[0])):
        stop = solve(system, (start, 0), (0, 4), events=UserEvent(g, terminal=True), backend=backend)
        assert stop.status is Status.STOPPED
        assert stop.t_end == pytest.approx(arrives, abs=1e-9)
        users = [UserEvent(g, direction=d) for d in (0, 1, -1)]
        run = solve(system, (start, 0), (0, 4), events=users, backend=backend)
        falls, rises = ([arrives], [2]) if start > 0 else ([], [arrives])
        assert run.success
        assert run.t_events[-3] == pytest.approx([*falls, *rises], abs=1e-9)
        assert run.t_events[-2] == pytest.approx(rises, abs=1e-9)
        assert run.t_events[-1] == pytest.approx(falls, abs=1e-9)


def test_order_of_the_lists() -> None:
    """Surfaces, then time events, then user events as they were given; modes know only surfaces."""
    system = System({x: y, y: -sign(x)}, time_events=[TimeEvent("clock", period=1)])
    events = [lambda t, y: y[1], x - 0.5, event(lambda t, y: y[0] + 0.5)]
    run = solve(system, (1, 0), (0, 4), events=events)
    assert run.user_events == ("event", str(x - 0.5), "called")
    root = math.sqrt(2)
    assert run.t_events[0] == pytest.approx([root], rel=1e-10)
    assert run.t_events[1].tolist() == [1, 2, 3, 4]
    assert run.t_events[2] == pytest.approx([2 * root], rel=1e-10)
    assert run.t_events[3] == pytest.approx([1], rel=1e-10)
    assert run.t_events[4] == pytest.approx([2 * root - 1, 2 * root + 1], rel=1e-10)
    assert run.modes == ("+", "-")
    assert run.end_mode == (-1,)
    assert len(run.end_multipliers) == 1
    assert run.multiplier("x", 0.5) == 1


def test_events_through_sliding_and_impacts() -> None:
    ball = System({x: y, y: -10 + 0 * x}, surfaces=[Surface("floor", x, reset={y: -y / 2})])
    run = solve(ball, (5, 0), (0, 5), zeno="continue", events=[lambda t, y: y[0] - 0.5, lambda t, y: t - 4])
    # Heights after the impacts: 5/4 and 5/16.
    fall, rise = math.sqrt(0.9), (5 - math.sqrt(25 - 10)) / 10
    assert run.t_events[1] == pytest.approx([fall, 1 + rise, 2 - rise], rel=1e-9)
    assert run.t_events[2] == pytest.approx([4], rel=1e-12)
    assert run.end_mode == (0,)


def test_an_expression_may_hold_time_and_parameters() -> None:
    run = solve(SYMBOLIC, (1, 0), (0, 3), events=[x - sympy.cos(2 * t) / 2])
    times = run.t_events[0]
    assert np.cos(times) == pytest.approx(np.cos(2 * times) / 2, abs=1e-9)
    assert len(times) == 1


def test_a_file_keeps_the_names(tmp_path) -> None:
    run = solve(SYMBOLIC, (1, 0), (0, 10), events=[x - 0.5, event(lambda t, y: y[1])])
    back = Solution.load(run.save(tmp_path / "run.npz"))
    assert back.user_events == run.user_events
    assert [q.tolist() for q in back.t_events] == [q.tolist() for q in run.t_events]


@BOTH
@pytest.mark.parametrize(
    ("value", "message"),
    [(None, "None"), ([1.0, 2.0], "shape"), (True, "condition")],
    ids=["none", "array", "condition"],
)
def test_b11_what_is_no_number_is_refused(system, value, message) -> None:
    with pytest.raises(ModelError, match=message):
        solve(system, (1, 0), (0, 10), events=lambda t, y: value)


@BOTH
@pytest.mark.parametrize("value", [math.nan, math.inf], ids=str)
def test_b11_what_is_not_finite_ends_the_run(system, value) -> None:
    run = solve(system, (1, 0), (0, 10), events=lambda t, y: value)
    assert run.status is Status.NOT_FINITE
    assert "'event'" in run.message
    later = solve(system, (1, 0), (0, 10), events=lambda t, y: 1.0 if t < 5 else value)
    assert later.status is Status.NOT_FINITE
    assert later.t_end == pytest.approx(5, abs=0.05)  # dg/dt is a central difference


@pytest.mark.parametrize(
    "attributes",
    [{"direction": None}, {"terminal": "no"}, {"terminal": -1}, {"direction": "up"}, {"terminal": 1.5}],
    ids=["direction none", "terminal no", "terminal -1", "direction up", "terminal 1.5"],
)
def test_b12_attributes_are_checked(attributes) -> None:
    def g(t, y):
        return y[0]

    for name, value in attributes.items():
        setattr(g, name, value)
    with pytest.raises(UsageError, match=f"{next(iter(attributes))} is"):
        solve(SYMBOLIC, (1, 0), (0, 10), events=g)


def test_events_that_are_none_of_these() -> None:
    z = states("z")[0]
    for events, message in (([3], "an event is 3"), ([z], "holds z"), ([sympy.Abs(x) - 1], "kink")):
        with pytest.raises(UsageError, match=message):
            solve(SYMBOLIC, (1, 0), (0, 1), events=events)
    with pytest.raises(UsageError, match="expression"):
        solve(FUNCTIONS, (1, 0), (0, 1), events=[x])


# Functions that touch 0, pass it, or arrive there and stay, as the last, at the turning points of a friction
# oscillator and elsewhere: their tangencies and their roots in (0, 7].
AT_TURNS = {
    "1 + cos 5t": (lambda t, y: 1 + math.cos(5 * t), math.pi / 5 * np.arange(1, 12, 2), []),
    "1 - cos 2t": (lambda t, y: 1 - math.cos(2 * t), [math.pi, 2 * math.pi], []),
    "sin t": (lambda t, y: math.sin(t), [], [math.pi, 2 * math.pi]),
    "(t - 1)**2": (lambda t, y: (t - 1) ** 2, [1], []),
    "v**2": (lambda t, y: y[1] ** 2, [math.pi, 2 * math.pi], []),
    "(x + 0.5) v": (lambda t, y: (y[0] + 0.5) * y[1], [], [math.pi, 2 * math.pi]),
}


@pytest.mark.parametrize("name", AT_TURNS)
@pytest.mark.parametrize("max_step", [math.inf, 0.1, 0.03])
def test_what_is_watched_changes_nothing(name: str, max_step: float) -> None:
    """Each tangency and each root is found once, also at the instant of another event; from closed forms."""
    watched, touches, roots = AT_TURNS[name]
    plain = System(
        field=lambda t, x, p, s: [x[1], -x[0] - 0.2 * s[0]],
        surfaces=[Surface("v", lambda t, x, p: x[1])],
        states="x v",
    )
    for system in (System({x: y, y: -x - sign(y) / 5}), plain):
        run = solve(system, (0.9, 0), (0, 7), events=watched, max_step=max_step)
        assert run.success, run.message
        assert run.x_end == pytest.approx([0.1, 0], abs=1e-9)
        mine = [e for e in run.events if e.index == 1]
        assert [e.t for e in mine if e.kind == "grazing"] == pytest.approx(touches, abs=1e-7)
        assert run.t_events[-1] == pytest.approx(roots, abs=1e-7)
        assert len([e for e in run.events if e.index == 0]) == 2


def test_guards_of_time_that_touch_0_are_seen_wherever_that_is() -> None:
    """Also at a node of the samples, where the guard is 0 to the last digit, and in any unit."""
    rng = np.random.default_rng(0)
    for k in range(40):
        at = float(rng.choice([1.0, rng.integers(1, 32) / 16, rng.uniform(0.05, 1.95)]))
        size, power = 10 ** rng.uniform(-6, 6), 2 + 2 * (k % 2)
        run = solve(System({x: 0 * x}), (1,), (0, 2), events=size * (t - at) ** power)
        assert [e.kind for e in run.events] == ["grazing"], (size, at, power)
        assert run.events[0].t == pytest.approx(at, abs=1e-6 if power == 2 else 1e-2)


@pytest.mark.parametrize("power", [2, 3, 4, 5])
@pytest.mark.parametrize("side", [1, -1])
def test_multiple_roots_of_time(power: int, side: int) -> None:
    """Where nothing moves a step is as long as the run, and a guard of time has no terms where it starts."""
    run = solve(System({x: 0 * x}), (1,), (0, 2), events=side * (t - 1) ** power)
    assert run.success, run.message
    counted = [e for e in run.events if power % 2 == 0 or e.kind != "grazing"]
    assert [e.kind == "grazing" for e in counted] == [power % 2 == 0]
    assert counted[0].t == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("backend", ["compiled", "python"])
@pytest.mark.parametrize("event", ["1/y", "1/y - 3", "y/(y - 0.5)", "1/(y - 0.2)**2"])
def test_a_pole_of_an_event_moves_no_state(event: str, backend: str) -> None:
    """y = 1 - t and x its integral, with a pole passed: the state was moved by Newton steps on the event."""
    falling = System({y: -1 + 0 * x, x: y})
    g = parse_expression(event, {"y": y})
    run = solve(falling, {"y": 1, "x": 0}, (0, 2), events=[UserEvent(g, name="g")], backend=backend)
    assert run.success
    assert run["y"] == pytest.approx(1 - run.t, abs=1e-9)
    assert run["x"] == pytest.approx(run.t - run.t**2 / 2, abs=1e-9)
    if event == "1/y - 3":
        assert [float(e.t) for e in run.events if str(e.kind) == "user event"] == pytest.approx([2 / 3])


@pytest.mark.parametrize("seed", [10, 16, 56])
def test_functions_that_stay_zero_while_masses_stick(seed: int) -> None:
    """Whatever is left of 0 in a velocity that is held; and functions that overflow far away."""
    v, u = states("v u")
    r = np.random.default_rng(seed)
    friction, force, omega = r.uniform(0.2, 0.6), r.uniform(0.5, 1.5), r.uniform(0.3, 1.5)
    push = force * sympy.cos(omega * t)
    system = System({x: v, v: -x - friction * sign(v) + push, y: u, u: -y - friction * sign(u - v)})
    alone = solve(system, (1, 0.3, 0.2, -0.5), (0, 12))
    times = np.linspace(0, 12, 4001)
    for g in (
        lambda t, z: math.sin(z[1]),
        lambda t, z: z[1] * math.cos(t),
        lambda t, z: math.tanh(z[3] - z[1]),
        lambda t, z: math.expm1(z[1]) * z[0],
    ):
        run = solve(system, (1, 0.3, 0.2, -0.5), (0, 12), events=[g])
        assert run.success
        assert run.x_end == pytest.approx(alone.x_end, abs=1e-7)
        values = np.array([g(q, z) for q, z in zip(times, alone.sol(times).T, strict=True)])
        clear = values[np.abs(values) > 1e-9]
        assert len(run.t_events[-1]) >= np.sum(clear[1:] * clear[:-1] < 0)


@pytest.mark.parametrize("atol", [1e-12, 1e-2])
@pytest.mark.parametrize(
    "jump", [lambda t, y: 1.0 if y[0] > 0.3 else -1.0, lambda t, y: math.floor(3 * y[0]) + 0.5,
             lambda t, y: -1.0 if t < 1.2 else 2.0],
)  # fmt: skip
def test_a_function_that_jumps_is_no_event(jump: Callable[[float, Any], float], atol: float) -> None:
    """It was said that events do not leave the state, with a tangency as the cause."""
    system = System({x: y, y: -x - 0.3 * sign(y)})
    with pytest.raises(ModelError, match="without being 0"):
        solve(system, (2, 0), (0, 3), atol=atol, events=[jump])
