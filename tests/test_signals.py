"""Signals in (issue 16, item 3): inputs from samples, lookup tables, test signals."""

import pickle

import numpy as np
import pytest
from scipy.linalg import expm

from filippov import (
    Input,
    Max,
    Min,
    ModelError,
    Parameter,
    Smooth,
    Solution,
    SolveError,
    Stop,
    Surface,
    System,
    Table,
    TimeEvent,
    UsageError,
    chirp,
    export_system,
    parameters,
    prbs,
    sign,
    solve,
    solve_many,
    square,
    states,
    step,
    t,
)
from filippov.analysis import find_orbit, flow_derivative
from filippov.analysis.steady.forcing import forcing_period

x, v = states("x v")
A = np.array([[0.0, 1.0], [-4.0, -0.3]])
KINDS = ("linear", "hold", "cubic")


def oscillator(r) -> System:
    return System({x: v, v: -4 * x - 0.3 * v + r})


def exact(samples, end: float) -> np.ndarray:
    """x' = A x + b u, u a cubic on each piece: matrix exponentials with u and its derivatives (Van Loan)."""
    whole = np.zeros((6, 6))
    whole[:2, :2], whole[1, 2] = A, 1.0
    whole[[2, 3, 4], [3, 4, 5]] = 1.0
    state = np.zeros(2)
    for k, (low, high) in enumerate(zip(samples.t[:-1], samples.t[1:], strict=True)):
        if low >= end:
            break
        u = samples.coef[k] * [1.0, 1.0, 2.0, 6.0]
        state = (expm(whole * (min(high, end) - low)) @ np.append(state, u))[:2]
    return state


@pytest.mark.parametrize("kind", KINDS)
def test_16_3_a_linear_system_follows_its_matrix_exponential(kind: str) -> None:
    draw = np.random.default_rng(7)
    for n in (2, 5, 40):
        times = np.concatenate(([0.0], np.sort(draw.uniform(0.0, 6.0, n)), [6.0]))
        r = Input("r", times, draw.normal(size=n + 2), kind)
        for end in (6.0, 4.321):
            run = solve(oscillator(r), (0, 0), (0, end), rtol=1e-11)
            assert run.success
            assert run.x_end == pytest.approx(exact(r.samples, end), rel=1e-9, abs=1e-10)
            assert not len(run.events)


def test_16_3_samples_are_read_as_scipy_and_numpy_read_them() -> None:
    from scipy.interpolate import CubicSpline

    times, values = np.array([0.0, 1.0, 2.5, 4.0]), np.array([1.0, -2.0, 0.5, 3.0])
    fine = np.linspace(0.0, 4.0, 401)
    linear, held, cubic = (Input("r", times, values, kind).samples for kind in KINDS)
    assert linear.at(fine) == pytest.approx(np.interp(fine, times, values), abs=1e-14)
    assert held.at(fine) == pytest.approx(values[np.searchsorted(times, fine, side="right") - 1], abs=0)
    assert cubic.at(fine) == pytest.approx(CubicSpline(times, values)(fine), abs=1e-13)
    assert cubic.at(fine, 2) == pytest.approx(CubicSpline(times, values)(fine, 2), abs=1e-12)
    assert (held.at(1.0, side="-"), held.at(1.0)) == (1.0, -2.0)
    assert (linear.at(1.0, 1, "-"), linear.at(1.0, 1)) == pytest.approx((-3.0, 2.5 / 1.5))
    turn = Input("r", times, values, "hold", period=5.0).samples
    assert turn.at([-0.5, 4.5, 5.0, 6.2]).tolist() == [3.0, 3.0, 1.0, -2.0]
    assert turn.at(5.0, side="-") == 3.0
    loop = Input("r", times, [*values[:-1], 1.0], "cubic", period=4.0).samples
    assert loop.at(9.25) == pytest.approx(CubicSpline(times, [*values[:-1], 1.0], bc_type="periodic")(1.25))


def test_16_3_the_error_of_a_spline_falls_with_the_fourth_power() -> None:
    """x' = -x + cos t from samples, against (cos t + sin t - exp(-t))/2."""
    errors = []
    for n in (20, 40, 80):
        times = np.linspace(0.0, 5.0, n + 1)
        run = solve(System({x: -x + Input("r", times, np.cos(times), "cubic")}), (0,), (0, 5))
        errors.append(abs(run.x_end[0] - (np.cos(5) + np.sin(5) - np.exp(-5)) / 2))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.6)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.6)


def test_16_3_nothing_is_stepped_over_and_nothing_restarted_in_vain() -> None:
    """A pulse of a microsecond in a motion at rest; and one step a knot, where the field is easy."""
    pulse = Input("r", [0, 50, 50 + 1e-6, 100], [0, 1e6, 0, 0], "hold")
    run = solve(oscillator(pulse), (0, 0), (0, 100))
    late = expm(A * (50.0 - 0.5e-6)) @ [0.0, 1.0]
    assert run.x_end == pytest.approx(late, abs=1e-9)
    times = np.linspace(0.0, 100.0, 10_001)
    r = Input("r", times, np.sin(times), "linear")
    run = solve(oscillator(r), (0, 0), (0, 100))
    assert run.steps + run.rejected <= 10_010
    assert run.x_end == pytest.approx(exact(r.samples, 100.0), abs=1e-8)


def test_16_3_sliding_follows_a_signal_and_leaves_it_at_a_knot() -> None:
    """x' = -sign(x - r) stays on r while |r'| < 1, the sign being -r'; a steeper piece leaves it behind."""
    times = [0.0, 1.0, 3.0, 4.0, 6.0]
    r = Input("r", times, [0.0, 0.5, -0.5, 2.0, 2.0], "linear")
    system = System({x: -sign(x - r)}, surfaces=[Surface("error", x - r)])
    run = solve(system, (0,), (0, 6))
    found = [(e.t, str(e.kind)) for e in run.events]
    # From -0.5 at t = 3 it climbs with slope 1, and meets r = 2 at t = 5.5.
    assert [kind for _, kind in found] == ["sliding exit", "sliding entry"]
    assert [when for when, _ in found] == pytest.approx([3.0, 5.5], rel=1e-12)
    assert run.sol(2.2)[0] == pytest.approx(0.5 - 0.6, abs=1e-14)
    assert run.multiplier("error", [0.5, 2.0, 4.5, 5.8]) == pytest.approx([-0.5, 0.5, -1.0, 0.0], abs=1e-12)
    assert run.evaluate("r", [0.5, 4.5]) == pytest.approx([0.25, 2.0])
    assert run["r"][-1] == 2.0


def test_16_3_a_jump_over_a_surface_changes_the_mode() -> None:
    r = Input("r", [0, 1, 2, 3], [0.0, 1.0, -0.2, -0.2], "hold")
    run = solve(System({x: -sign(x - r)}), (0.25,), (0, 3))
    modes = [(e.t, str(e.kind), e.before, e.after) for e in run.events]
    assert modes[0] == (pytest.approx(0.25), "sliding entry", (1,), (0,))
    assert [q[0] for q in modes] == pytest.approx([0.25, 1.0, 2.0, 2.0])
    assert run.x_end == pytest.approx([0.0], abs=1e-12)
    # A relay keeps its side inside its band, also where the signal jumps back and forth in it.
    small = Input("w", [0, 0.5, 1, 1.5, 2], [0.0, 0.05, -0.05, 0.3, 0.3], "hold")
    relay = Surface("relay", x - small, width=0.1)
    run = solve(System({x: 0.01 * sign(x - small)}, surfaces=[relay]), (0.02,), (0, 2))
    assert [(e.t, e.before, e.after) for e in run.events] == [(1.5, (1,), (-1,))]
    assert run.x_end == pytest.approx([0.02 + 0.015 - 0.005], abs=1e-12)


def test_16_3_a_table_that_kicks_is_an_impact_and_one_that_falls_away_is_left() -> None:
    """A ball at rest on a table r(t): where the table sets off upwards, it is struck; downwards, it falls."""
    e, g = 0.5, 10.0
    for slope in (1.0, -1.0):
        r = Input("r", [0, 1, 1.1], [0, 0, 0.1 * slope], "linear")
        floor = Surface("floor", x - r, reset={v: r.diff(t) - e * (v - r.diff(t))})
        run = solve(System({x: v, v: -g + 0 * x}, surfaces=[floor]), (0.0, 0.0), (0, 1.1))
        assert run.success
        if slope > 0:
            # u = v - r' jumps from -1 to 0.5 and falls back after 2 u/g = 0.1.
            assert run.events[0].t == 1.0
            assert run.sol(1.05) == pytest.approx([0.05 + 0.5 * 0.05 - 5 * 0.05**2, 1.5 - 0.5], abs=1e-10)
        else:
            assert run.x_end == pytest.approx([-0.05, -1.0], abs=1e-10)


def test_16_3_an_event_at_the_instant_of_a_knot_is_one() -> None:
    r = Input("r", [0, 1, 2], [1.0, 1.0, 3.0], "linear")
    run = solve(System({x: r + 0 * x, v: sign(x - 1) + 0 * v}), (0, 0), (0, 2))
    assert [(e.t, str(e.kind)) for e in run.events] == [(1.0, "crossing")]
    assert run.x_end == pytest.approx([3.0, 0.0], abs=1e-12)
    both = System({x: r + 0 * x}, time_events=[TimeEvent("clock", times=(1.0,), reset={x: x + 5})])
    run = solve(both, (0,), (0, 2))
    assert [(e.t, str(e.kind)) for e in run.events] == [(1.0, "time event")]
    assert run.x_end == pytest.approx([8.0])
    with_root = solve(both, (0,), (0, 2), events=lambda t, y: y[0] - 0.5)
    assert with_root.t_events[-1] == pytest.approx([0.5])


@pytest.fixture(scope="module")
def friction() -> System:
    draw = np.random.default_rng(3)
    p = parameters(mu=0.4, gain=1.0)
    r = Input("r", np.linspace(0, 10, 101), draw.normal(size=101), "linear")
    return System(
        {x: v, v: -x - p.mu * sign(v) + p.gain * r}, outputs={"effort": p.gain * r, "drive": r.diff(t)}
    )


def test_16_3_ensembles_files_and_processes_know_inputs(friction: System, tmp_path) -> None:
    run = solve(friction, (0.2, 0.0), (0, 10))
    many = solve_many(friction, [(0.2, 0.0)] * 2, (0, 10), parameters={"gain": [1.0, 0.0]})
    assert many.x[0] == pytest.approx(run.x_end, abs=1e-12)
    assert many.x[1] == pytest.approx([0.2, 0.0], abs=1e-12)
    again = pickle.loads(pickle.dumps(friction))  # noqa: S301  # its own parcel
    assert again == friction
    assert again.digest == friction.digest
    run.save(tmp_path / "run.npz")
    read = Solution.load(tmp_path / "run.npz")
    assert read.system == friction
    assert read["effort"] == pytest.approx(run["effort"], abs=0)
    assert solve(read.problem).x_end == pytest.approx(run.x_end, abs=0)
    # Other samples are another model, with the same machine code.
    (samples,) = friction.inputs
    other = oscillator(Input("r", samples.t, samples.values, "hold"))
    assert other.digest != oscillator(Input("r", samples.t, samples.values + 1e-9, "hold")).digest


def test_16_3_backwards_the_way_is_the_same() -> None:
    r = Input("r", [0, 1, 2, 3], [0.0, 1.0, -1.0, 0.5], "hold")
    there = solve(oscillator(r), (0.3, 0.0), (0, 3))
    back = solve(oscillator(r), there.x_end, (3, 0), backward=True)
    assert back.x_end == pytest.approx([0.3, 0.0], abs=1e-10)


def test_16_3_periodic_signals_are_forcing_with_a_period() -> None:
    wave = square("u", 2.0, (1.0, 0.0), duty=0.25)
    system = System({x: -x + wave})
    run = solve(system, (0,), (0, 40))
    # Fixed point of the map over one period: x = (exp(0.5) - 1) exp(-2)/(1 - exp(-2)).
    assert run.x_end[0] == pytest.approx((np.exp(0.5) - 1) * np.exp(-2) / (1 - np.exp(-2)), rel=1e-10)
    assert float(forcing_period(system)) == 2.0
    assert forcing_period(System({x: -x + step("r", 1.0, (0, 1))})) is None
    noise = prbs("d", 0.1, (-2.0, 2.0), order=5).samples
    bits = noise.at(0.05 + 0.1 * np.arange(31))
    assert np.sum(bits == 2.0) == 16
    assert np.sum(bits == -2.0) == 15
    lags = [np.mean(bits * np.roll(bits, k)) / 4.0 for k in range(1, 31)]
    assert lags == pytest.approx([-1 / 31] * 30)
    up = solve(System({x: -x + step("r", (1.0, 2.0), (0.0, 1.0, 0.0))}), (0,), (0, 3))
    assert up.x_end[0] == pytest.approx((1 - np.exp(-1)) * np.exp(-1), rel=1e-10)
    sweep = chirp(0.0, 2.0, 4.0)
    assert float(sweep.subs(t, 1.0)) == pytest.approx(np.sin(2 * np.pi * 0.25))


def test_16_3_inputs_from_files_and_tables(tmp_path) -> None:
    path = tmp_path / "road.csv"
    path.write_text("time,height,speed\n0.0,1.0,5\n0.5,2.0,6\n1.0,4.0,7\n")
    r = Input.from_csv("r", path, time="time", value="height", kind="hold")
    assert r.samples.values.tolist() == [1.0, 2.0, 4.0]
    assert Input.from_csv("r", path, value=2).samples.values.tolist() == [5.0, 6.0, 7.0]
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(path)
    assert Input("r", frame["time"], frame["height"], "hold") == r
    assert Input("r", frame.set_index("time")["height"], kind="hold") == r
    with pytest.raises(ModelError, match="unknown column 'hight'; did you mean 'height'"):
        Input.from_csv("r", path, value="hight")
    path.write_text("0,1\n1,x\n")
    with pytest.raises(ModelError, match="line 2: '1,x' has no numbers"):
        Input.from_csv("r", path)


def test_16_3_what_is_no_signal_is_refused() -> None:
    r = Input("r", [0, 1], [0, 1])
    for make, text in (
        (lambda: Input("r", [0, 0], [1, 2]), r"t\[0\] = 0 is followed by 0"),
        (lambda: Input("r", [0, 1], [1]), "2 times and 1 values"),
        (lambda: Input("r", [0, 1], [1, np.nan]), "not finite"),
        (lambda: Input("r", [0, 1], [1, 2], "square"), "kind is 'square'"),
        (lambda: Input("sin", [0, 1], [1, 2]), "taken by a function"),
        (lambda: Input("r", [0, 1], [1, 2], periods=3), "did you mean 'period'"),
        (lambda: Input("r", [0, 1, 2], [1, 2, 3], period=2.0), "ends at 3 and begins with 1"),
        (lambda: System({x: r + Input("r", [0, 1], [0, 2])}), "two inputs are named 'r'"),
        (lambda: System({x: Input("x", [0, 1], [0, 2])}), "both an input and a state"),
        (lambda: System({x: r.subs(t, t - x)}), "is taken at"),
        (lambda: Table([0, 1, 1], [0, 1, 2]), r"x\[1\] = 1 is followed by 1"),
        (lambda: Table(np.arange(99), np.arange(99)), "at most 64"),
        (lambda: prbs("d", 0.1, order=40), "from 2 to 16"),
        (lambda: step("d", (1, 2), (0, 1)), "one level more"),
    ):
        with pytest.raises(ModelError, match=text):
            make()
    with pytest.raises(UsageError, match="'Moreau' knows no inputs"):
        solve(oscillator(r), (0, 0), (0, 1), method="Moreau", dt=1e-3)
    with pytest.raises(ModelError, match="samples are not written into the file"):
        export_system(oscillator(r), "oscillator.py")
    with pytest.raises(UsageError, match=r"known for t in \[0, 1\], but the run is over \[0, 2\]"):
        solve(oscillator(r), (0, 0), (0, 2))
    with pytest.raises(UsageError, match="known for t in"):
        solve_many(oscillator(r), [(0, 0)], (0, 2))


def test_16_3_equal_samples_tell_no_surfaces_apart() -> None:
    """Signals that are 0 for most of the time are no reason to take two surfaces for one, or for none."""
    a, b = Input("a", [0, 9, 10], [0, 0, 1]), Input("b", [0, 8, 10], [0, 0, 2])
    system = System({x: -sign(x - a) - sign(x - b), v: -a * sign(v)})
    assert [q.kind for q in system.surfaces] == ["switching"] * 3
    assert system.surface_place("x - a") == (0, 1)
    run = solve(system, (1.0, 0.5), (0, 10), stop=Stop("v"))
    assert run.success
    assert run.x_end[1] == pytest.approx(0.0, abs=1e-12)


def driven(u, w, e) -> System:
    """A plant with friction, a relay with hysteresis, a stop and a clock; u, w, e are numbers or signals."""
    p = parameters(k=4.0, width=Parameter(0.2, lower=0.0), tick=0.7)
    z = states("z")
    relay = Surface("relay", x - u, width=p.width)
    stop = Surface("stop", 1 + w - x, reset={v: -0.5 * v})
    return System(
        {x: v, v: -p.k * x - 0.3 * sign(v) - sign(x - u) + e, z: -z + w},
        surfaces=[relay, stop], parameters=p, outputs={"error": u - x},
        time_events=[TimeEvent("clock", period=p.tick, reset={z: z + e})], labels={"x": "place"},
    )  # fmt: skip


def test_16_3_a_signal_in_the_place_of_a_parameter_makes_the_system_that_is_written_with_it() -> None:
    q = parameters(u=0.1, w=0.2, e=0.3)
    draw = np.random.default_rng(11)
    times = np.linspace(0, 6, 13)
    u, w = (Input(name, times, draw.normal(size=13), kind) for name, kind in (("u", "hold"), ("w", "cubic")))
    e = chirp(0.1, 2.0, 6.0)
    written, made = driven(u, w, e), driven(q.u, q.w, q.e).with_inputs({"u": u, "w": w, "e": e})
    assert made.digest == written.digest
    assert made == written
    assert made.parameters.names == ("k", "width", "tick")
    other = Input("u", times, -draw.normal(size=13), "linear")
    assert made.with_inputs({"u": other}) == driven(other, w, e)
    floor = parameters(y=0.0, V=0.0)

    def ball(y, rate, contact=None) -> System:
        """It can rest on the table where the reset turns its speed against that of the table."""
        table = Surface("floor", x - y, reset={v: 1.5 * rate - 0.5 * v}, contact=contact)
        return System({x: v, v: -10 + 0 * x}, surfaces=[table])

    assert ball(w, w.diff(t)).surfaces[0].contact is True
    assert ball(floor.y, floor.V).with_inputs({"y": w, "V": w.diff(t)}) == ball(w, w.diff(t))
    assert ball(floor.y, 0).surfaces[0].contact is True
    assert ball(floor.y, 0).with_inputs({"y": w}) == ball(w, 0)
    assert ball(floor.y, 0, False).with_inputs({"y": e}).surfaces[0].contact is False
    soft = driven(q.u, q.w, q.e).with_comparator(Smooth(0.1)).with_inputs({"u": u, "w": w, "e": e})
    assert soft == written.with_comparator(Smooth(0.1))


def test_16_3_a_signal_that_cannot_stand_for_a_parameter_is_refused() -> None:
    q = parameters(u=0.1, w=0.2, e=Parameter(0.3, upper=1.0))
    system = driven(q.u, q.w, q.e)
    r = Input("r", [0, 1], [0, 2])
    for given, said in (
        ({"uu": r}, "unknown parameter or input 'uu'; did you mean 'u'"),
        ({"u": 2 * x}, "with x in it"),
        ({"e": r}, "outside its bounds"),
        ({"tick": r}, "tick sets the instants of time event 'clock'"),
        ({"width": r}, "width sets the width of surface 'relay'"),
        ({"w": Input("k", [0, 1], [0, 2])}, "'k' is both an input and a state or parameter"),
        ({"w": r, "u": Input("r", [0, 1], [5, 2])}, "two inputs are named 'r'"),
    ):
        with pytest.raises(ModelError, match=said):
            system.with_inputs(given)
    plain = System(field=lambda t, x, p, s: [-x[0]], states="x", parameters={"k": 1.0})
    with pytest.raises(ModelError, match=r"np\.interp"):
        plain.with_inputs({"k": r})


CURVE = Table([-1.0, -0.2, 0.2, 1.0], [-0.7, -1.0, 1.0, 0.7], outside="extend")


def test_16_3_a_table_is_straight_between_its_points() -> None:
    for table in (CURVE, Table(CURVE.x, CURVE.y)):
        e = table(v)
        for u in np.linspace(-2.0, 2.0, 41):
            assert float(e.subs(v, u)) == pytest.approx(table.values(u), abs=1e-14)
        assert float(table(0.5)) == table.values(0.5)
    assert Table(CURVE.x, CURVE.y).values([-5.0, 5.0]) == pytest.approx([-0.7, 0.7])
    assert CURVE.values([-5.0, 5.0]) == pytest.approx([-0.7 + 0.375 * 4, 0.7 - 0.375 * 4])


def test_16_3_knots_of_a_table_are_kinks_also_in_lanes() -> None:
    plain = System({x: v, v: -x - CURVE(v)})
    assert [q.kind for q in plain.surfaces] == ["kink"] * 2
    run = solve(plain, (0.0, 1.5), (0, 3))
    assert {e.surface for e in run.events} <= set(plain.surface_names)
    for event in run.events:
        assert min(abs(event.x[1] - knot) for knot in (-0.2, 0.2)) < 1e-14
    # Between knots the field is linear: matrix exponentials from event to event.
    state, now = np.array([0.0, 1.5]), 0.0
    for end in [*run.events.t, 3.0]:
        k = np.searchsorted(CURVE.x[1:-1], run.sol((now + end) / 2)[1])
        slope = np.diff(CURVE.y)[k] / np.diff(CURVE.x)[k]
        offset = CURVE.y[k] - slope * CURVE.x[k]
        whole = np.array([[0, 1, 0], [-1, -slope, -offset], [0, 0, 0]], dtype=float)
        state, now = (expm(whole * (end - now)) @ np.append(state, 1.0))[:2], end
    assert run.x_end == pytest.approx(state, abs=1e-9)
    starts = np.column_stack((np.linspace(-1, 1, 64), np.full(64, 1.5)))
    wide = solve_many(plain, starts, (0, 3))
    assert wide.lanes > 1
    assert wide.x == pytest.approx(solve_many(plain, starts, (0, 3), lanes=1).x, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_16_3_the_flow_is_differentiated_through_knots(kind: str) -> None:
    """Where a signal jumps over a surface no neighbouring motion does so at another time."""
    draw = np.random.default_rng(5)
    r = Input("r", np.linspace(0, 2.7, 10), draw.normal(size=10), kind, period=3.0)
    system = System({x: v, v: -(1 + 0.8 * r) * x - 0.2 * v - 0.3 * sign(v - 0.3 * r) + r})
    start, end = np.array([0.4, 0.9]), 7.3

    def ending(x0) -> Solution:
        return solve(system, x0, (0, end), rtol=1e-12)

    run = ending(start)
    assert any(e.note == "knot of an input" for e in run.events) == (kind == "hold")
    moved = 1e-6 * np.eye(2)
    differences = np.array([(ending(start + d).x_end - ending(start - d).x_end) / 2e-6 for d in moved]).T
    assert flow_derivative(run) == pytest.approx(differences, abs=1e-7)
    orbit = find_orbit(system, run.x_end)
    again = solve(system, orbit.x0, (orbit.t0, orbit.t0 + 3.0))
    assert again.x_end == pytest.approx(orbit.x0, abs=1e-8)
    with pytest.raises((UsageError, SolveError), match="collocation"):
        find_orbit(system, run.x_end, method="collocation")


def test_16_3_a_file_drives_a_model_from_the_command(tmp_path, capsys) -> None:
    from filippov.app.cli.main import main
    from filippov.models import get

    (tmp_path / "steps.csv").write_text("time,load,r\n0,9,0.5\n2,9,2.0\n6,9,0.4\n8,9,0.4\n")
    flag = f"r={tmp_path}/steps.csv,kind=hold"
    words = [
        "simulate",
        "anti_windup",
        "--evaluate",
        "r",
        "--points",
        "5",
        "-o",
        str(tmp_path / "run"),
        "--quiet",
    ]
    assert main([*words, "--input", flag]) == 0
    rows = np.loadtxt(tmp_path / "run" / "trajectory.csv", delimiter=",", skiprows=1)
    table = Input("r", [0, 2, 6, 8], [0.5, 2.0, 0.4, 0.4], "hold")
    run = solve(get("anti_windup").build().with_inputs({"r": table}), (0, 0), (0, 8))
    np.testing.assert_allclose(rows[:, 1:3].T, run.sol(rows[:, 0]), atol=1e-12)
    assert rows[:, 3].tolist() == [0.5, 0.5, 2.0, 2.0, 0.4]
    again = tmp_path / "run.toml"
    again.write_text(
        f'model = "anti_windup"\n[simulate.input]\nr = {{file = "{tmp_path}/steps.csv", kind = "hold"}}\n'
    )
    assert (
        main(["simulate", "--config", str(again), "--points", "5", "-o", str(tmp_path / "toml"), "--quiet"])
        == 0
    )
    same = np.loadtxt(tmp_path / "toml" / "trajectory.csv", delimiter=",", skiprows=1)
    assert same.tolist() == rows[:, :3].tolist()
    for wrong, said in (
        ("steps.csv", "expected NAME=FILE.csv"), (flag + ",kin=hold", "did you mean 'kind'"),
        (flag.replace("r=", "rr=", 1), "did you mean 'r'"), (f"r={tmp_path}/none.csv", "there is no file"),
        (flag + ",value=h", "unknown column 'h'"), (flag + ",period=x", "expected a number"),
    ):  # fmt: skip
        assert main([*words, "--input", wrong]) == 2
        assert said in capsys.readouterr().err


def test_16_2_a_figure_shows_outputs_before_a_knot_as_they_are_before_it() -> None:
    """An effort within its limits: at the end of a piece the signal is that before its jump, not after it."""
    from filippov.plot.pieces import output_pieces, pieces_of

    r = Input("r", [0, 2, 6, 8], [0.5, 2.0, -3.0, 0.4], "hold")
    effort = Min(Max(2 * (r - x), -1.2), 1.2)
    system = System({x: -x + effort, v: 0 * v}, outputs={"effort": effort})
    for span, jumps in (((0, 8), 2), ((2.3, 1.7), 1)):
        run = solve(system, (0.6, 0), span, backward=jumps == 1)
        t_shown, shown = output_pieces(run, "effort", list(pieces_of(run, 200)))
        assert np.nanmax(np.abs(shown)) <= 1.2 + 1e-12
        # At a jump the value before it, a gap, the value after it.
        gaps = np.flatnonzero(np.isnan(shown))
        assert len(gaps) == jumps
        for k in gaps:
            at = t_shown[k]
            assert shown[k - 1] == pytest.approx(run.evaluate("effort", at, side="-"), abs=1e-12)
            assert shown[k + 1] == pytest.approx(run.evaluate("effort", at, side="+"), abs=1e-12)
