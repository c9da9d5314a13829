"""Resets at a surface: impacts, resting contact, two-state automata; closed forms throughout."""

import math
from itertools import accumulate

import numpy as np
import pytest

from filippov import ModelError, Status, Surface, System, cos, models, parameters, sign, sin, solve, states, t
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.solving.solution import Solution
from filippov.solving.state.events import Stop

y, v, q, T = states("y v q T")
g = 9.81


def ball(**options: object) -> System:
    p = parameters(g=g, e=0.7)
    return System({y: v, v: -p.g}, surfaces=[Surface("floor", y, reset={v: -p.e * v}, **options)])


def impact_times(e: float, h: float, count: int, gravity: float = g) -> list[float]:
    """t1 (1 + 2 e + 2 e**2 + ...), t1 the time of the first fall."""
    first = math.sqrt(2 * h / gravity)
    return list(accumulate([first] + [2 * first * e**j for j in range(1, count)]))


@pytest.mark.parametrize("e", [0.5, 0.7, 0.9, 0.99])
def test_a16_zeno_ball_comes_to_rest_at_the_zeno_time(e: float) -> None:
    limit = math.sqrt(2 / g) * (1 + e) / (1 - e)
    stopped = solve(ball(), (1, 0), (0, 2 * limit), parameters={"e": e})
    assert stopped.status is Status.ZENO
    assert f"{limit:.9g}"[:7] in stopped.message
    assert str(stopped) == f"{stopped!r}\n{stopped.message}"
    assert "zeno='continue'" in str(stopped)
    on = solve(ball(), (1, 0), (0, 2 * limit), parameters={"e": e}, zeno="continue")
    assert on.success
    assert str(on) == repr(on)
    assert on.end_mode == (0,)
    entry = on.events[-1]
    assert entry.kind == "sliding entry"
    assert entry.t == pytest.approx(limit, rel=1e-11)
    assert np.all(on.x_end == 0)
    assert np.all(on.y[0] >= 0)
    assert np.min(on.sol(np.linspace(0, 2 * limit, 20001))[0]) > -1e-12
    expected = impact_times(e, 1, len(on.events) - 1)
    assert on.events.t[:-1] == pytest.approx(expected, rel=1e-10)
    # The floor pushes with g: (1 - s)/2.
    assert (1 - on.multiplier("floor", 1.5 * limit)) / 2 == pytest.approx(g, rel=1e-12)
    if e == 0.7:
        assert entry.t == pytest.approx(2.558634, abs=5e-7)


def test_bank_a03_impact_times_and_velocities() -> None:
    p = parameters(g=9.8, e=0.9)
    system = System({y: v, v: -p.g}, surfaces=[Surface("floor", y, reset={v: -p.e * v})])
    run = solve(system, (10, 0), (0, 20))
    assert run.success
    assert run.events.t == pytest.approx(impact_times(0.9, 10, 13, 9.8), abs=1e-8)
    assert run.events.x[:, 1] == pytest.approx([-14 * 0.9**n for n in range(13)], abs=1e-8)
    zeno = solve(system, (10, 0), (0, 30), zeno="continue")
    assert zeno.events[-1].t == pytest.approx(190 / 7, abs=1e-6)


def test_both_sides_of_a_jump() -> None:
    run = solve(ball(), (1, 0), (0, 1))
    (event,) = run.events.of(kind="reset")[:1]
    assert event.before == event.after == (1,)
    assert event.x_after is not None
    assert event.x_after[1] == -0.7 * event.x[1]
    assert event.x_after[0] == event.x[0] == 0
    assert run.sol(event.t, side="-")[1] == pytest.approx(event.x[1], rel=1e-11)
    assert np.array_equal(run.sol(event.t, side="+"), event.x_after)
    # B24: strictly increasing, but for the pair at each jump.
    assert run.jumps.tolist() == [event.t]
    same = np.flatnonzero(np.diff(run.t) == 0)
    assert run.t[same].tolist() == [event.t]
    assert np.all(np.diff(run.t) >= 0)
    assert np.array_equal(run.y[:, same[0]], event.x)
    assert np.array_equal(run.y[:, same[0] + 1], event.x_after)
    assert len(run.segments) == 1
    assert run.segments[0].dwell == 1
    sampled = solve(ball(), (1, 0), (0, 1), t_eval=[0, event.t, 1])
    assert sampled.t.tolist() == [0, event.t, 1]
    assert sampled.y[1, 1] == pytest.approx(event.x[1], rel=1e-11)
    corners = solve(ball(), (1, 0), (0, 1), dense_output=False)
    assert corners.t.tolist() == [0, event.t, event.t, 1]
    assert np.array_equal(corners.y[:, 2], event.x_after)


def test_a_jump_at_either_end_of_the_run() -> None:
    start = solve(ball(), (0, -1), (0, 0.1))
    assert start.t[:2].tolist() == [0, 0]
    assert start.y[1, :2].tolist() == [-1, 0.7]
    assert start.sol(0)[1] == -1
    assert start.sol(0, side="+")[1] == 0.7
    assert start.events[0].t == 0
    assert start.x_end[1] == pytest.approx(0.7 - 0.1 * g, rel=1e-12)
    end = solve(ball(), (1, 0), (0, 2), stop=Stop("floor", "reset", 2))
    assert end.status is Status.STOPPED
    assert end.t[-1] == end.t[-2] == end.t_end
    assert np.array_equal(end.sol(end.t_end, side="+"), end.x_end)
    assert end.x_end[1] == pytest.approx(0.49 * math.sqrt(2 * g), rel=1e-11)
    up = solve(ball(), (0, 1), (0, 0.1))
    assert not up.events
    assert up.start_mode == (1,)


def test_round_trip_of_a_file(tmp_path) -> None:
    run = solve(ball(), (1, 0), (0, 3), zeno="continue")
    back = Solution.load(run.save(tmp_path / "run.npz"))
    assert back.system == run.system
    assert back.system.surfaces[0].contact is True
    assert [e.kind for e in back.events] == [e.kind for e in run.events]
    assert np.array_equal(back.events[2].x_after, run.events[2].x_after)
    assert back.events[-1].x_after is None
    assert np.array_equal(back.t, run.t)
    assert np.array_equal(back.jumps, run.jumps)
    again = solve(back.system, (1, 0), (0, 3), zeno="continue")
    assert np.array_equal(again.x_end, run.x_end)


def table(e: float) -> System:
    p = parameters(e=e, w=5.0)
    height, speed = sin(p.w * t), p.w * cos(p.w * t)
    return System(
        {y: v, v: -g + 0 * y}, surfaces=[Surface("table", y - height, reset={v: speed - p.e * (v - speed)})]
    )


def test_contact_with_an_oscillating_table_is_left_where_it_falls_faster_than_g() -> None:
    run = solve(table(0.0), (0, 5), (0, 5))
    assert run.start_mode == (0,)
    leaves = run.events.of(kind="sliding exit")
    assert len(leaves) == 4
    for event in leaves:  # y'' = -25 sin 5t = -g
        assert 25 * math.sin(5 * event.t) == pytest.approx(g, abs=1e-12)
        assert event.multiplier == pytest.approx(1, abs=1e-12)
        assert math.cos(5 * event.t) > 0
    flight = run.events[1].t - run.events[0].t
    a, b = run.events[0].t, run.events[0].x
    assert b[0] + b[1] * flight - g * flight**2 / 2 == pytest.approx(math.sin(5 * (a + flight)), abs=1e-11)
    for segment in run.segments:
        if segment.mode == (0,):
            steps = run.t[(run.t >= segment.t0) & (run.t < segment.t1)]
            assert np.max(np.abs(run.sol(steps, side="+")[0] - np.sin(5 * steps))) < 1e-12
            times = np.linspace(segment.t0, segment.t1, 9)[1:-1]
            push = (1 - run.multiplier("table", times)) / 2
            assert push == pytest.approx(g - 25 * np.sin(5 * times), abs=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_contact_of_a_reset_with_numbers_in_it(seed: int) -> None:
    """Numbers are known to their rounding: (1 + e) A w - e A w - A w is 0, or some 1e-17."""
    e, size, w = np.random.default_rng(seed).uniform((0.2, 0.05, 3), (0.8, 0.15, 7)).tolist()
    height = y - size * sin(w * t)
    moved = (1 + e) * size * w * cos(w * t) - e * v
    rest = System({y: v, v: -g + 0 * y}, surfaces=[Surface("table", height, reset={v: moved})])
    run = solve(rest, (0.5, 0), (0, 4), zeno="continue")
    assert run.success
    assert run.end_mode == (0,)
    assert run.x_end == pytest.approx([size * math.sin(4 * w), size * w * math.cos(4 * w)], abs=1e-12)
    assert (1 - run.multiplier("table", 3.9)) / 2 == pytest.approx(g - size * w**2 * math.sin(3.9 * w))
    off = System({y: v, v: -g + 0 * y}, surfaces=[Surface("table", height, reset={v: moved + 1e-9})])
    assert solve(off, (0.5, 0), (0, 4), zeno="continue").status is Status.ZENO


def test_contact_from_below_is_the_mirror_image() -> None:
    ceiling = System({y: v, v: g + 0 * y}, surfaces=[Surface("ceiling", y, reset={v: -0.7 * v}, side="-")])
    floor = solve(ball(), (1, 0), (0, 3), zeno="continue")
    run = solve(ceiling, (-1, 0), (0, 3), zeno="continue")
    assert run.end_mode == (0,)
    assert np.array_equal(run.events.t, floor.events.t)
    assert (1 + run.multiplier("ceiling", 2.8)) / 2 == pytest.approx(g, rel=1e-12)


def test_friction_and_contact_hold_together() -> None:
    x, u = states("x u")
    p = parameters(e=0.5)
    system = System(
        {x: u, u: -sign(u), y: v, v: -g + 0 * y}, surfaces=[Surface("floor", y, reset={v: -p.e * v})]
    )
    run = solve(system, (0, 2, 1, 0), (0, 5), zeno="continue")
    rest = 3 * math.sqrt(2 / g)
    assert run.success
    assert run.end_mode == (0, 0)
    assert run.events.of("floor", "sliding entry").t == pytest.approx([rest], rel=1e-11)
    assert run.events.of("u", "sliding entry").t == pytest.approx([2], rel=1e-11)
    assert run.x_end == pytest.approx([2, 0, 0, 0], abs=1e-10)


def test_without_contact_an_accumulation_ends_the_run() -> None:
    run = solve(ball(contact=False), (1, 0), (0, 5), zeno="continue")
    assert run.status is Status.ZENO
    assert "no resting contact on 'floor'" in run.message


def test_bank_a04_thermostat_as_a_two_state_automaton() -> None:
    system = System(
        {T: -(T - 18) / 10 + 2 * q, q: 0 * q},
        surfaces=[
            Surface("low", T - 22, reset={q: 1}),
            Surface("high", T - 23.5, reset={"q": 0}, side="-"),
        ],
    )
    assert [s.contact for s in system.surfaces] == [False, False]
    run = solve(system, (15, 1), (0, 20), rtol=1e-11)
    heat, cool = 10 * math.log(16 / 14.5), 10 * math.log(5.5 / 4)
    expected = list(accumulate([10 * math.log(23 / 14.5), *[cool, heat] * 3]))
    assert run.events.of(kind="reset").t == pytest.approx(expected, abs=1e-9)
    assert [e.surface for e in run.events.of(kind="reset")] == ["high", "low"] * 3 + ["high"]
    assert cool + heat == pytest.approx(4.1689380393178714, abs=1e-12)


def test_bank_a04_thermostat_with_a_width() -> None:
    system = System(
        {T: -(T - 18) / 10 + 1 - sign(T - 22.75)}, surfaces=[Surface("relay", T - 22.75, width=0.75)]
    )
    run = solve(system, (15,), (0, 20), rtol=1e-11)
    heat, cool = 10 * math.log(16 / 14.5), 10 * math.log(5.5 / 4)
    expected = list(accumulate([10 * math.log(23 / 14.5), *[cool, heat] * 3]))
    assert run.events.t == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["as declared", "turned"])
def test_two_impacts_at_once_that_commute(order) -> None:
    a, c, d, e = states("a c d e")
    walls = [Surface("one", a, reset={c: -c}), Surface("two", d, reset={e: -e / 2})]
    run = solve(
        System({a: c, c: 0 * a, d: e, e: 0 * a}, surfaces=[walls[k] for k in order]), (1, -1, 2, -2), (0, 3)
    )
    assert run.success
    assert len({e.group for e in run.events}) == 1
    assert len(run.events) == 2
    assert {e.surface for e in run.events} == {"one", "two"}
    assert run.x_end == pytest.approx([2, 1, 2, 1], abs=1e-12)


def test_two_impacts_at_once_that_do_not_commute_are_named() -> None:
    a, c, d, e = states("a c d e")
    walls = [Surface("one", a, reset={c: -c, e: e + c}), Surface("two", d, reset={e: -e, c: c + e})]
    for surfaces in (walls, walls[::-1]):
        run = solve(System({a: c, c: 0 * a, d: e, e: 0 * a}, surfaces=surfaces), (1, -1, 2, -2), (0, 3))
        assert run.status is Status.NON_UNIQUE
        assert run.t_end == pytest.approx(1, rel=1e-14)
        assert "'one'" in run.message
        assert "'two'" in run.message
        assert "order" in run.message


def test_a_jump_may_land_on_another_surface_or_beyond_it() -> None:
    # x falls with 1 and is set to `target` at 0; y' tells the side of x = 2.
    x, z = states("x z")
    p = parameters(target=2)
    system = System(
        {x: -1 + 0 * x, z: sign(x - 2)},
        surfaces=[Surface("zero", x, reset={x: p.target}), Surface("two", x - 2)],
    )
    on = solve(system, (1, 0), (0, 2.5))
    assert on.events.of("zero").t == pytest.approx([1], rel=1e-12)
    assert on.success
    assert on.x_end == pytest.approx([0.5, -2.5], abs=1e-12)
    beyond = solve(system, (1, 0), (0, 2.5), parameters={"target": 3})
    assert [e.surface for e in beyond.events] == ["zero", "two", "two"]
    assert beyond.events[0].group == beyond.events[1].group
    assert beyond.events[2].t == pytest.approx(2, rel=1e-12)
    assert beyond.x_end == pytest.approx([1.5, -1 + 1 - 0.5], abs=1e-12)


def test_a_jump_may_leave_a_sliding_surface() -> None:
    x, z, c = states("x z c")
    system = System(
        {x: -sign(x), z: 0 * x, c: 1 + 0 * x},
        surfaces=[Surface("clock", c - 1, reset={x: x + 0.5, c: 0}, side="-")],
    )
    run = solve(system, (0.25, 0, 0), (0, 2.75))
    kinds = [(e.surface, str(e.kind), round(e.t, 9)) for e in run.events if e.surface == "x"]
    assert kinds == [
        ("x", "sliding entry", 0.25), ("x", "sliding exit", 1), ("x", "sliding entry", 1.5),
        ("x", "sliding exit", 2), ("x", "sliding entry", 2.5),
    ]  # fmt: skip
    assert run.end_mode[0 if run.system.surfaces[0].name == "x" else 1] == 0


def test_a_surface_may_switch_the_field_and_reset() -> None:
    """x' = -2 for x > 0 and -1 below; at 0 from above z counts, and the motion goes through."""
    x, z = states("x z")
    system = System(
        {x: -1.5 - 0.5 * sign(x), z: 0 * x}, surfaces=[Surface("gate", x, reset={z: z + 1}, kind="switching")]
    )
    assert system.surfaces[0].kind == "switching"
    run = solve(system, (1, 0), (0, 2))
    assert run.events.t == pytest.approx([0.5], rel=1e-12)
    assert run.events[0].kind == "reset"
    assert run.events[0].after == (-1,)
    assert run.x_end == pytest.approx([-1.5, 1], abs=1e-12)


def test_sides() -> None:
    x, z = states("x z")
    for side, expected in (("+", 1), ("-", 2), ("both", 3)):
        system = System({x: cos(t), z: 0 * x}, surfaces=[Surface("zero", x, reset={z: z + 1}, side=side)])
        run = solve(system, (0.5, 0), (0, 15))  # x = 0.5 + sin t: down, up, down, up
        downs = sum(math.pi * 7 / 6 + 2 * math.pi * k < 15 for k in range(5))
        ups = sum(math.pi * 11 / 6 + 2 * math.pi * k < 15 for k in range(5))
        assert run.x_end[1] == {"+": downs, "-": ups, "both": downs + ups}[side], expected
        assert len(run.events) == downs + ups


def test_plain_functions() -> None:
    system = System(
        field=lambda t, x, p, s: [x[1], -p.g],
        surfaces=[Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], -0.7 * x[1]])],
        states="y v",
        parameters={"g": g},
    )
    run = solve(system, (1, 0), (0, 2))
    assert run.events.t == pytest.approx(impact_times(0.7, 1, 4), rel=1e-10)
    rest = solve(system, (1, 0), (0, 3), zeno="continue")
    assert rest.status is Status.ZENO
    assert "no resting contact" in rest.message


@pytest.mark.parametrize(
    ("value", "message"),
    [(None, "None"), ([1.0], "shape"), ([1j, 0], "complex")],
    ids=["none", "short", "complex"],
)
def test_reset_functions_are_checked(value, message) -> None:
    surface = Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: value)
    system = System(field=lambda t, x, p, s: [x[1], -1.0], surfaces=[surface], states="y v")
    with pytest.raises(ModelError, match=rf"reset of 'floor'.*{message}"):
        solve(system, (1, 0), (0, 2))


def test_a_reset_that_is_not_finite() -> None:
    x, z = states("x z")
    run = solve(
        System({x: -1 + 0 * x, z: 0 * x}, surfaces=[Surface("zero", x, reset={z: 1 / z})]), (1, 0), (0, 2)
    )
    assert run.status is Status.NOT_FINITE
    assert run.t_end == pytest.approx(1)


def test_backwards_in_time_a_reset_is_not_undone() -> None:
    run = solve(ball(), (1, 0), (2, 0), backward=True)
    assert run.status is Status.NON_UNIQUE
    assert "'floor'" in run.message
    assert run.t_end == pytest.approx(2 - math.sqrt(2 / g), rel=1e-12)


@pytest.mark.parametrize("change", [1e-8, 1e8], ids=str)
def test_units_do_not_matter(change: float) -> None:
    p = parameters(g=g * change, e=0.7)
    system = System({y: v, v: -p.g}, surfaces=[Surface("floor", y, reset={v: -p.e * v})])
    run = solve(system, (change, 0), (0, 3), zeno="continue", atol=1e-12 * change)
    assert run.end_mode == (0,)
    assert run.events[-1].t == pytest.approx(2.5586339656, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reset": {"w": 1}}, "unknown state 'w'"),
        ({"reset": {v: -v}, "side": "up"}, "side is 'up'"),
        ({"reset": 3}, "expected a mapping"),
        ({"reset": {}}, "expected a mapping"),
        ({"reset": {v: -v, "v": 0}}, "twice"),
        ({"reset": {v: -v}, "width": 0.1}, "hysteresis"),
        ({"reset": {v: -v}, "kind": "observer"}, "observer"),
        ({"kind": "reset"}, "needs a reset"),
        ({"contact": True}, "needs a reset"),
        ({"reset": {v: 1}, "contact": True}, "no resting contact"),
        ({"reset": {v: -v}, "contact": True, "side": "both"}, "one side"),
    ],
    ids=lambda q: q if isinstance(q, str) else "",
)
def test_declarations_are_checked(options, message) -> None:
    with pytest.raises(ModelError, match=message):
        System({y: v, v: -g + 0 * y}, surfaces=[Surface("floor", y, **options)])


def test_the_digest_tells_resets_apart() -> None:
    digests = {ball().digest, ball(contact=False).digest, ball(side="both").digest}
    assert len(digests) == 3


def test_bank_f13_block_on_a_belt_with_static_friction() -> None:
    run = solve(models.get("belt_static").build(), models.get("belt_static").x0, (0, 60))
    sticks = [q for q in run.segments if q.mode == (0,)][1:-1]
    slips = [q for q in run.segments if q.mode != (0,)][1:-1]
    assert len(sticks) >= 3
    assert [q.dwell for q in sticks] == pytest.approx([5] * len(sticks), rel=1e-9)
    assert [q.dwell for q in slips] == pytest.approx(
        [2 * math.pi - 2 * math.atan(2.5)] * len(slips), rel=1e-9
    )
    assert run.sol(sticks[1].t1)[0] == pytest.approx(1, abs=1e-10)
    assert run.sol(sticks[1].t0)[0] == pytest.approx(0, abs=1e-10)


def test_clegg_integrator_has_its_describing_function() -> None:
    """Driven by sin t, its first harmonic is (1 + 4j/pi)/j times the input (Clegg 1958)."""
    (u,) = states("u")
    system = System({u: sin(t)}, surfaces=[Surface("zero", sin(t), reset={u: 0}, side="both")])
    run = solve(system, (0,), (0, 4 * math.pi), rtol=1e-12)
    assert run.events.t[:3] == pytest.approx([math.pi, 2 * math.pi, 3 * math.pi], rel=1e-13)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    total = 0j
    for k in (2, 3):
        times = math.pi * (k + (nodes + 1) / 2)
        total += np.sum(weights * math.pi / 2 * run.sol(times)[0] * np.exp(-1j * times))
    assert total / math.pi * 1j == pytest.approx((1 + 4j / math.pi) / 1j, abs=1e-10)


def test_reset_control_overshoots_less_than_its_base_loop() -> None:
    """Beker et al. 2004; after each zero of the error the element starts from 0."""
    model = models.get("reset_control")
    run = solve(model.build(), model.x0, (0, 20))
    assert run.success
    resets = run.events.of(kind="reset")
    assert len(resets) >= 2
    assert all(e.x_after[2] == 0 and abs(1 - e.x[0] - e.x[1]) < 1e-12 for e in resets)
    z, w, u = states("z w u")
    base = solve(System({z: w, w: u - 0.2 * w, u: 1 - z - w - u}), model.x0, (0, 20))
    times = np.linspace(0, 20, 2001)
    reset_peak, base_peak = (np.max(q.sol(times)[0] + q.sol(times)[1]) for q in (run, base))
    assert reset_peak < base_peak


def oscillator_end(run_state: np.ndarray, phase: float = 0.0) -> np.ndarray:
    run = solve(models.get("impact_oscillator").build(), run_state, (phase, 12), rtol=1e-12, atol=1e-14)
    return np.asarray(run.x_end)


def test_saltation_of_a_reset_against_differences_and_liouville() -> None:
    system = models.get("impact_oscillator").build()
    x0 = np.array([-0.5, 0.1])
    run = solve(system, x0, (0, 12), rtol=1e-12, atol=1e-14)
    impacts = len(run.events.of(kind="reset"))
    assert impacts >= 3
    exact = flow_derivative(run)
    step = 1e-6
    columns = [(oscillator_end(x0 + d) - oscillator_end(x0 - d)) / (2 * step) for d in step * np.eye(2)]
    assert exact == pytest.approx(np.array(columns).T, rel=1e-6, abs=1e-6)
    # Each impact multiplies areas by e**2, the damping by exp(-2 zeta t).
    assert np.linalg.det(exact) == pytest.approx(0.8 ** (2 * impacts) * math.exp(-2 * 0.05 * 12), rel=1e-8)


def test_saltation_of_a_moving_surface_and_of_time_events() -> None:
    moving = table(0.5)
    clock = models.get("buck_pwm").build()
    for system, x0, end in (
        (moving, np.array([1.0, 0.0]), 1.0),
        (clock, np.array([12.0, 0.55, 3.8]), 1.1e-3),
    ):
        options = {"rtol": 1e-13, "atol": 1e-15}
        run = solve(system, x0, (0, end), **options)
        assert run.jumps.size
        exact = flow_derivative(run)
        steps = 1e-6 * np.eye(len(x0))
        ends = [[solve(system, x0 + s * d, (0, end), **options).x_end for s in (1, -1)] for d in steps]
        columns = [(a - b) / 2e-6 for a, b in ends]
        assert exact == pytest.approx(np.array(columns).T, rel=2e-5, abs=2e-5)


def test_the_accumulation_of_impacts_has_no_derivative() -> None:
    run = solve(ball(), (1, 0), (0, 3), zeno="continue")
    with pytest.raises(NotDifferentiableError, match="impacts accumulate"):
        flow_derivative(run)
