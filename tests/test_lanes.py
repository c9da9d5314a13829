"""Trajectories in lanes end where the plain loop ends them; neighbours, order and threads change nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.special
import sympy

from filippov import (
    ModelError,
    Status,
    Surface,
    System,
    TimeEvent,
    UsageError,
    parameters,
    sign,
    solve,
    sqrt,
    states,
)
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.kernel.codegen.build import widest
from filippov.models import get
from filippov.models.registry import BUILT_IN
from filippov.solving import ensemble as ensembles
from filippov.solving import solver
from filippov.solving.ensemble import Ensemble, solve_many
from filippov.solving.state.events import Stop

RTOL, ATOL = 1e-9, 1e-12
# Short enough that the hunting loop does not magnify the last digit, where lanes and the plain loop differ.
SPAN = (0.0, 4.0)
OPTIONS: dict[str, Any] = {"rtol": RTOL, "atol": ATOL, "nonunique": "stick", "max_steps": 50_000}
# Those of the gallery are short variants of them.
MODELS = [name for name, module in sorted(BUILT_IN.items()) if not module.startswith("gallery.")]
# Of the span that the model proposes: stiff models take too many steps for a test, others part from each
# other where the motion magnifies what the tolerance leaves.
SHARE = {"hunting_lugre": 1e-3, "hunting_karnopp": 0.1, "hunting_switch": 0.1, "two_blocks": 0.3}


def starts(name: str, count: int) -> tuple[System, np.ndarray, tuple[float, float]]:
    model = get(name)
    centre = np.array(model.x0)
    spread = np.random.default_rng(7).uniform(-1, 1, (count, centre.size))
    x0 = centre + 0.3 * (1 + np.abs(centre)) * spread
    # As given, and on the border of most models' surfaces: what begins in the general path or on a surface.
    x0[0], x0[1] = centre, 0.0
    return model.build(), x0, (model.t_span[0], model.t_span[1] * SHARE.get(name, 1.0))


def assert_alike(one: Ensemble, other: Ensemble, allowed: float = 10.0) -> None:
    assert one.status == other.status
    np.testing.assert_array_equal(one.mode, other.mode)
    np.testing.assert_array_equal(one.counts, other.counts)
    np.testing.assert_array_equal(one.last, other.last)
    np.testing.assert_allclose(one.x, other.x, rtol=allowed * RTOL, atol=allowed * (ATOL + RTOL))
    np.testing.assert_allclose(one.t, other.t, rtol=allowed * RTOL, atol=allowed * RTOL)


# Series in lanes take seconds to compile: events, slides on one and on either of two surfaces, impacts,
# clocks, an exponent that is a parameter, what leaves the compiled loop, a short step beside long ones.
IN_SERIES = ("hunting", "belt", "relay_two_slides", "two_blocks", "buck_pwm", "impact_oscillator", "twisting")


@pytest.mark.parametrize(
    ("name", "method"), [*((name, "DOP853") for name in MODELS), *((name, "Taylor") for name in IN_SERIES)]
)
def test_lanes_end_where_the_plain_loop_does(name: str, method: str) -> None:
    system, x0, span = starts(name, 21)
    plain = solve_many(system, x0, span, lanes=1, threads=1, method=method, **OPTIONS)
    lanes = solve_many(system, x0, span, lanes=widest(), threads=1, method=method, **OPTIONS)
    assert (plain.lanes, lanes.lanes) == (1, widest())
    assert_alike(plain, lanes)


def spring() -> System:
    """An undamped oscillator with Coulomb friction: in each half turn the amplitude falls by 2 f."""
    x, v = states("x v")
    p = parameters(f=1.0)
    return System({x: v, v: -x - p.f * sign(v)})


@pytest.mark.parametrize("lanes", [1, 8, 16])
def test_surfaces_left_and_met_again_in_one_step(lanes: int) -> None:
    """Parabolas, exact at any step: a quarter turn from rest at x = a takes sqrt(2 a)."""
    x, y = states("x y")
    bounce = System({x: y, y: -sign(x)})
    quarter = np.sqrt(2 * np.linspace(0.5, 2.0, 70))
    ends = solve_many(bounce, np.column_stack([quarter**2 / 2, 0 * quarter]), (0, 40), lanes=lanes)
    np.testing.assert_array_equal(ends.events("x", "crossing"), np.floor((40 / quarter + 1) / 2))
    angle = (40 / quarter) % 4
    height = np.where((angle < 1) | (angle > 3), 1 - np.minimum(angle, 4 - angle) ** 2, (angle - 2) ** 2 - 1)
    np.testing.assert_allclose(ends.x[:, 0], height * quarter**2 / 2, atol=1e-8)


def test_half_turns_of_a_dry_oscillator_are_those_of_the_closed_form() -> None:
    amplitude = np.linspace(1.05, 9.7, 200)
    ends = solve_many(spring(), np.column_stack([amplitude, 0 * amplitude]), (0, 40), lanes=8, threads=1)
    turns = np.ceil((amplitude - 1) / 2)
    rest = (amplitude - 2 * turns) * (-1) ** turns
    assert ends.success.all()
    assert np.all(ends.mode == 0)
    np.testing.assert_allclose(ends.x[:, 0], rest, atol=1e-7)
    np.testing.assert_array_equal(ends.events(kind="sliding entry"), 1)
    np.testing.assert_array_equal(ends.events("v", "crossing"), turns - 1)


def test_parameters_of_every_trajectory_are_its_own() -> None:
    f = np.random.default_rng(1).uniform(0.1, 2.9, 100)
    ends = solve_many(spring(), (3.0, 0.0), (0, np.pi / 2), parameters={"f": f}, lanes=8, rtol=1e-11)
    np.testing.assert_allclose(ends.x[:, 0], f, atol=1e-8)


def test_lanes_follow_a_linear_system_to_its_matrix_exponential() -> None:
    a = np.array([[-0.3, 2.0, 0.1], [-2.0, -0.2, 0.3], [0.2, 0.1, -1.0]])
    names = states("x y z")
    system = System({q: sum(a[i, j] * names[j] for j in range(3)) for i, q in enumerate(names)})
    x0 = np.random.default_rng(2).normal(size=(77, 3))
    for method in ("DOP853", "DP5", "Taylor"):
        ends = solve_many(system, x0, (0, 7), lanes=8, rtol=1e-11, atol=1e-13, method=method)
        np.testing.assert_allclose(ends.x, x0 @ scipy.linalg.expm(7 * a).T, atol=1e-9)
        options = {"lanes": 8, "rtol": 1e-11, "atol": 1e-13, "method": method}
        back = solve_many(system, ends.x, (7, 0), backward=True, **options)
        np.testing.assert_allclose(back.x, x0, atol=1e-7)


@pytest.mark.parametrize("exponent", [2.0, 1.0, 1.7, -1.3])
def test_series_in_lanes_meet_exponents_that_are_parameters(exponent: float) -> None:
    """x' = -x**e has x**(1 - e) = x0**(1 - e) - (1 - e) t; lanes with e = 2 alone have their own kernel."""
    x = states("x")
    p = parameters(e=2.0)
    x0 = np.linspace(0.3, 2.0, 40)
    every = np.where(np.arange(40) % 3 == 0, exponent, 2.0)
    ends = solve_many(
        System({x: -(x**p.e)}), x0[:, None], (0, 0.4), parameters={"e": every}, lanes=16, rtol=1e-11,
        atol=1e-14, method="Taylor",
    )  # fmt: skip
    rest = 1 - every
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.where(rest == 0, x0 * np.exp(-0.4), (x0**rest - rest * 0.4) ** (1 / rest))
    there = np.isfinite(exact)
    assert there.sum() > 25
    np.testing.assert_allclose(ends.x[there, 0], exact[there], rtol=1e-10)


def test_series_in_lanes_see_a_peak_that_none_of_their_terms_shows() -> None:
    """x' = 1, y' = exp(-((x - c)/w)**2): the peak is far below the least number where each lane begins."""
    x, y = states("x y")
    p = parameters(c=0.0, w=1.0)
    c, w = np.linspace(-8, 8, 120), 10.0 ** np.linspace(-3.5, 0, 120)
    ends = solve_many(
        System({x: 1 + 0 * x, y: sympy.exp(-(((x - p.c) / p.w) ** 2))}), (-10, 0), (0, 20), method="Taylor",
        parameters={"c": c, "w": w}, lanes=16, rtol=1e-9, atol=1e-12,
    )  # fmt: skip
    exact = 0.5 * np.sqrt(np.pi) * w * (scipy.special.erf((10 - c) / w) + scipy.special.erf((10 + c) / w))
    np.testing.assert_allclose(ends.x[:, 1], exact, rtol=1e-6)


def test_large_systems_have_no_series_in_lanes() -> None:
    v = states(" ".join(f"v{k}" for k in range(7)))
    seven = System({q: -sign(q) for q in v})
    with pytest.raises(UsageError, match="one by one for a system of this size; lanes know DOP853"):
        solve_many(seven, np.ones((2, 7)), (0, 1e-3), method="Taylor", lanes=8)


def difficult() -> tuple[System, np.ndarray]:
    """A system some of whose trajectories blow up, leave the field's domain, meet a corner or chatter."""
    x, y = states("x y")
    return System({x: -sign(y) + 0.3 * sqrt(x + 2), y: sign(x) - 0.2 * y + y**3 / 400}), np.array(
        [[1.0, 30.0], [0.0, 0.0], [-1.9999999, 2.0], [-2.5, 1.0], [0.5, 60.0], [3.0, 0.0]]
    )


def test_neighbours_of_difficult_trajectories_are_as_without_them() -> None:
    system, bad = difficult()
    calm = np.random.default_rng(3).uniform(0.2, 3, (40, 2))
    options = OPTIONS | {"max_events": 400}
    alone = solve_many(system, calm, (0, 3), lanes=8, threads=1, **options)
    mixed = np.concatenate([calm[:20], bad, calm[20:]])
    together = solve_many(system, mixed, (0, 3), lanes=8, threads=1, **options)
    keep = np.r_[0:20, 26:46]
    np.testing.assert_array_equal(together.x[keep], alone.x)
    assert tuple(together.status[q] for q in keep) == alone.status
    plain = solve_many(system, bad, (0, 3), lanes=1, **options)
    assert together.status[20:26] == plain.status
    assert not plain.success.all()


@pytest.mark.parametrize(
    ("name", "lanes", "method"),
    [
        *((name, 8, "DOP853") for name in MODELS),
        *((name, 16, method) for name in ("hunting", "two_blocks") for method in ("DOP853", "Taylor")),
    ],
)
def test_neighbours_order_and_threads_change_no_bit(name: str, lanes: int, method: str) -> None:
    # 150 rows are more than both groups of lanes hold, so that some wait; 7 are fewer than one group holds.
    system, x0, (t0, t1) = starts(name, 150)
    span = (t0, t0 + 0.3 * (t1 - t0))
    options = OPTIONS | {"method": method, "lanes": lanes}
    ends = solve_many(system, x0, span, threads=1, **options)
    order = np.random.default_rng(4).permutation(150)
    for rows, threads in ((order, 1), (order[:7], 1), (order[::-1], 2)):
        other = solve_many(system, x0[rows], span, threads=threads, **options)
        np.testing.assert_array_equal(other.x, ends.x[rows])
        np.testing.assert_array_equal(other.t, ends.t[rows])
        np.testing.assert_array_equal(other.nfev, ends.nfev[rows])
        np.testing.assert_array_equal(other.counts, ends.counts[rows])
        assert other.status == tuple(ends.status[q] for q in rows)


def test_many_that_begin_at_rest_wait_for_their_lanes() -> None:
    # All slide from the first moment on, and no more of them are taken from the queue than have room to wait.
    (v,) = states("v")
    p = parameters(mu=1.0)
    system = System({v: 0.5 - p.mu * sign(v)}, surfaces=[Surface("rest", v)])
    mu = np.where(np.arange(400) % 5 == 0, 0.25, 1.0)
    ends = solve_many(system, [0.0], (0, 2), parameters={"mu": mu}, lanes=8, threads=1)
    np.testing.assert_allclose(ends.x[:, 0], np.where(mu == 0.25, 0.5, 0.0), rtol=1e-12, atol=1e-12)
    assert ends.success.all()


@pytest.mark.parametrize("lanes", [1, 8, 16])
def test_threads_share_the_rows(lanes: int) -> None:
    system, x0 = spring(), np.random.default_rng(7).uniform(-9, 9, (300, 2))
    one = solve_many(system, x0, (0, 20), lanes=lanes, threads=1, **OPTIONS)
    two = solve_many(system, x0, (0, 20), lanes=lanes, threads=2, **OPTIONS)
    assert two.threads == 2
    np.testing.assert_array_equal(two.x, one.x)
    np.testing.assert_array_equal(two.counts, one.counts)


@pytest.mark.parametrize("lanes", [1, 8, 16])
def test_budgets_end_a_trajectory_by_name(lanes: int) -> None:
    x0 = np.column_stack([np.linspace(7.1, 9, 16), np.zeros(16)])
    few = solve_many(spring(), x0, (0, 40), lanes=lanes, max_steps=5)
    assert set(few.status) == {Status.MAX_STEPS}
    assert few.complete
    few = solve_many(spring(), x0, (0, 40), lanes=lanes, max_events=2)
    assert set(few.status) == {Status.MAX_EVENTS}
    np.testing.assert_array_equal(few.events(), 2)


def test_terminal_events_leave_their_time_and_state() -> None:
    x0 = np.column_stack([np.linspace(5.5, 9, 24), np.zeros(24)])
    ends = solve_many(spring(), x0, (0, 40), lanes=8, stop=Stop("v", "crossing down"), rtol=1e-11)
    assert set(ends.status) == {Status.STOPPED}
    np.testing.assert_allclose(ends.t, 2 * np.pi, rtol=1e-9)
    np.testing.assert_allclose(ends.x[:, 0], x0[:, 0] - 4, rtol=1e-8)
    np.testing.assert_array_equal(ends.events("v", "crossing"), 2)
    np.testing.assert_array_equal(ends.last[:, 0], 0)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("lanes", [1, 8, 16])
def test_an_interrupted_ensemble_keeps_what_is_done(
    lanes: int, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, x0, _ = starts("hunting", 600)
    seen = []

    def interrupt(done: int, total: int) -> None:
        seen.append((done, total))
        if done > 0:
            raise KeyboardInterrupt

    monkeypatch.setattr("filippov.solving.state.batch._CHUNK", 8_000)
    ends = solve_many(
        system,
        x0,
        (0, 60),
        lanes=lanes,
        threads=threads,
        progress=interrupt,
        **OPTIONS | {"max_steps": 10**6},
    )
    assert not ends.complete
    assert seen[-1][1] == 600
    done = np.array([status is not Status.INTERRUPTED for status in ends.status])
    assert 0 < done.sum() < 600
    whole = solve_many(system, x0[done], (0, 60), lanes=1, **OPTIONS | {"max_steps": 10**6})
    np.testing.assert_allclose(ends.x[done], whole.x, atol=1e-5)
    assert np.all(ends.t[~done] < 60)


def test_a_measure_sees_blocks_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ensembles, "_BLOCK", 32)
    x0 = np.column_stack([np.linspace(1.5, 9, 100), np.zeros(100)])
    blocks = []

    def largest(ends: Ensemble) -> np.ndarray:
        blocks.append(len(ends.t))
        return np.abs(ends.x).max(axis=1)

    ends = solve_many(spring(), x0, (0, 3), lanes=8, measure=largest)
    assert blocks == [32, 32, 32, 4]
    np.testing.assert_array_equal(ends.measured, np.abs(ends.x).max(axis=1))
    with pytest.raises(UsageError, match="expected a row for each"):
        solve_many(spring(), x0, (0, 3), measure=lambda ends: 1.0)


def test_functions_without_a_lane_form_are_called_lane_by_lane() -> None:
    x, y = states("x y")
    system = System({x: sympy.atan(y) + sympy.sinh(x / 9), y: -sympy.tan(x / 5) - sympy.log(1 + y**2)})
    x0 = np.random.default_rng(6).uniform(-1, 1, (50, 2))
    plain = solve_many(system, x0, (0, 4), lanes=1, **OPTIONS)
    assert_alike(plain, solve_many(system, x0, (0, 4), lanes=8, **OPTIONS))


def test_plain_functions_have_no_lanes() -> None:
    system = System(
        field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("h", lambda t, x, p: x[0])], states=["x"]
    )
    ends = solve_many(system, np.linspace(0.5, 1.5, 80)[:, None], (0, 3))
    assert ends.lanes == 1
    assert ends.success.all()
    assert np.all(ends.x == 0)
    with pytest.raises(UsageError, match="plain Python functions"):
        solve_many(system, np.ones((80, 1)), (0, 3), lanes=8)
    with pytest.raises(UsageError, match="lanes is 4"):
        solve_many(spring(), np.ones((80, 2)), (0, 3), lanes=4)


def test_an_event_map_in_lanes_is_the_plain_one() -> None:
    model = get("hunting")
    event_map = EventMap(model.build(), Section.from_model(model))
    d = np.linspace(0.01, 0.5, 90)
    single = np.array([event_map(float(value)) for value in d])
    np.testing.assert_allclose(event_map(d), single, atol=1e-9)


def test_the_name_of_a_time_event_is_told_from_that_of_a_surface() -> None:
    x = states("x")
    clock = TimeEvent("clock", period=0.5, reset={x: -x})
    ends = solve_many(System({x: 1 - sign(x)}, time_events=[clock]), [[1.0], [2.0]], (0, 2))
    with pytest.raises(UsageError, match="unknown surface 'clock'; a time event is no surface; known: x"):
        ends.events("clock")


def test_names_of_kinds_and_surfaces_are_checked() -> None:
    ends = solve_many(spring(), np.ones((3, 2)), (0, 1))
    with pytest.raises(UsageError, match="unknown surface"):
        ends.events("w")
    with pytest.raises(UsageError, match="unknown kind of event"):
        ends.events(kind="landing")
    with pytest.raises(ModelError):
        solve_many(spring(), np.ones((3, 2)), (0, 1), parameters={"g": 1.0})


def test_14_6_slides_that_begin_next_to_an_end_of_their_set_are_decided_where_events_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From above at y' = -e + k x, from below at 1; on y = c at x = 0, where the multiplier is 1 - 2 e or so.

    A slide lasts until x = e/k, forever with k <= 0; the curve from there on is a parabola.
    """
    x, y = states("x y")
    q = parameters(e=0.1, k=0.0, c=0.0)
    s = sign(y - q.c)
    system = System({x: 1 + 0 * x, y: (1 + s) / 2 * (-q.e + q.k * x) + (1 - s) / 2})
    e, k, c = (a.ravel() for a in np.meshgrid(10.0 ** np.arange(-11.5, -2), (-0.1, 0.0, 0.5), (0.0, 1.0)))
    start = -0.5 + 0.0 * e
    x0 = np.column_stack([start, c - e * start + k * start**2 / 2])
    x0, e, k, c = (a[x0[:, 1] > c] for a in (x0, e, k, c))
    named = {"e": e, "k": k, "c": c}
    single = [
        solve(system, row, (0.0, 1.0), parameters=dict(zip(named, values, strict=True)), nonunique="stick")
        for row, *values in zip(x0, *named.values(), strict=True)
    ]
    asked: list[Any] = []

    def noted(problem: Any, **rest: Any) -> Any:
        asked.append(problem)
        return solve(problem, **rest)

    monkeypatch.setattr(solver, "solve", noted)
    many = solve_many(system, x0, (0.0, 1.0), parameters=named, lanes=1, nonunique="stick")
    assert many.status == tuple(run.status for run in single)
    np.testing.assert_array_equal(many.mode, [run.end_mode for run in single])
    np.testing.assert_array_equal(many.events(), [len(run.events) for run in single])
    left = 0.5 - e / np.where(k > 0, k, np.inf)
    exact = c + np.where((k > 0) & (left > 0), k * left**2 / 2, 0.0)
    np.testing.assert_allclose(many.x[:, 1], exact, atol=1e-9)
    assert all(problem.parameters["e"] < 1e-8 or problem.parameters["k"] > 0 for problem in asked)


@pytest.mark.parametrize("sizes", [(0.9, 1.2), (2.0, 3.0)])
def test_solutions_that_escape_in_finite_time_end_in_lanes(sizes: tuple[float, float]) -> None:
    """x' = x**2: at t = 1/x0, after as many steps as in the plain loop, not as many as the budget has."""
    x, v = states("x v")
    system = System({x: x**2 + 0 * v, v: sign(x - 1e3)})
    states_0 = np.column_stack([np.linspace(*sizes, 64), np.zeros(64)])
    ends = solve_many(system, states_0, (0, 40), lanes=8, threads=1)
    alone = solve_many(system, states_0, (0, 40), lanes=1, threads=1)
    assert ends.lanes == 8
    assert set(ends.status) == {Status.MIN_STEP}
    assert ends.t == pytest.approx(1 / states_0[:, 0], abs=1e-8)
    assert ends.nfev.max() < 1.2 * alone.nfev.max()
