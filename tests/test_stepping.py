"""Time stepping: closed forms, orders, random members against the loop of events, what is refused."""

import os
from pathlib import Path

import numpy as np
import pytest
import stacks
from sympy import Abs, sin

from filippov import Status, Surface, System, UsageError, parameters, sign, solve, solve_many, states, t
from filippov.app.cli.main import main
from filippov.solving.stepping.box_kernels import SEVERAL, complementarity

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
DRAWS = {"default": 30, "ci": 60, "nightly": 3000}[PROFILE]
MU = 0.3
x, v = states("x v")
p = parameters(mu=MU, e=0.6)
BLOCK = System({x: v, v: -x - p.mu * sign(v)})
BALL = System({x: v, v: -9.81}, surfaces=[Surface("floor", x, reset={v: -p.e * v})])


def stepped(system, x0, end, dt, **options):
    return solve(system, x0, (0, end), method="Moreau", dt=dt, **options)


def order(steps, errors) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def test_15_3_a_block_comes_to_rest_where_it_should_and_does_not_creep() -> None:
    """From 2 it turns at -1.4 and 0.8 and stops at -0.2 after three half periods of pi."""
    for theta, bound in ((0.5, 1e-4), (1.0, 0.1)):
        run = stepped(BLOCK, (2, 0), 15, 1e-2, theta=theta)
        assert run.success
        assert run.modes[-1] == "0"
        assert abs(run.x_end[0] + 0.2) < bound
        stay = run.segments.of("stick")[-1]
        assert abs(stay.t0 - 3 * np.pi) < 2e-2 + (theta == 1.0) * 0.1
        held = run.sol(np.linspace(stay.t0, stay.t1, 500))
        assert np.ptp(held[0]) == 0.0
        assert np.max(np.abs(held[1])) < 1e-15
        # In stick the sign is the force of the spring over mu.
        assert run.end_multipliers[0] == pytest.approx(-run.x_end[0] / MU, rel=1e-9)


def test_15_3_the_order_is_2_for_theta_a_half_and_1_for_implicit_euler() -> None:
    steps = np.array([0.04, 0.02, 0.01])
    for theta, expected in ((0.5, 2.0), (1.0, 1.0)):
        runs = [stepped(System({x: -x}), (1,), 2, dt, theta=theta) for dt in steps]
        smooth = [abs(run.x_end[0] - np.exp(-2)) for run in runs]
        assert order(steps, smooth) == pytest.approx(expected, abs=0.05)
    # x' = sin(t)/2 - sgn(x): from 0.6 at x = 1.1 - t - cos(t)/2 onto the surface, and along it.
    slide = System({x: 0.5 * sin(t) - sign(x)})
    for dt in steps:
        run = stepped(slide, (0.6,), 3, dt)
        assert abs(run.x_end[0]) < 1e-15
        assert run.multiplier(run.system.surfaces[0].name, 2.5) == pytest.approx(np.sin(2.5) / 2, abs=1e-12)
        assert run.end_multipliers[0] == pytest.approx((np.sin(3) + np.sin(3 - dt)) / 4, abs=1e-3 * dt)


def test_15_3_a_ball_comes_to_rest_without_an_accumulation() -> None:
    exact = solve(BALL, (1, 0), (0, 4), zeno="continue")
    for dt in (1e-3, 1e-4):
        run = stepped(BALL, (1, 0), 4, dt)
        assert run.success
        assert run.modes[-1] == "0"
        assert run.x_end[1] == 0.0
        assert abs(run.x_end[0]) < 5 * dt
        assert 5 < run.events.count("floor", "reset") < 40
        (rest,) = run.segments.of("stick")
        assert abs(rest.t0 - exact.zeno.t) < 30 * dt
    flight = np.sqrt(2 / 9.81)
    assert abs(run.events.of("floor", "reset")[0].t - flight) < 2e-4


@pytest.mark.parametrize("n", [1, 2])
def test_15_3_impacts_of_several_bodies_make_no_energy(n: int) -> None:
    random = np.random.default_rng(n)
    for _ in range(DRAWS // 3):
        start, values = stacks.draw(random, n)
        run = stepped(stacks.stack(n), start, 2, 1e-3, parameters=values)
        assert run.success, run.message
        power = stacks.energy(n, run.y, values)
        assert np.max(np.diff(power)) < 5e-4 * (1 + np.max(np.abs(power)))
        assert np.min(stacks.gaps(n, run.y, values)) > -0.5


N, M = 3, 2
WORDS = [f"a{i}{j}" for i in range(N) for j in range(N)] + [f"f{i}" for i in range(N)]
WORDS += [f"{c}{i}{j}" for c in "bc" for i in range(N) for j in range(M)]


def family() -> System:
    """x' = A x + k sin(x) + f sin(w t) + sum_j b_j (1 + 1/(1 + |h_j|)) s_j, h = C x, static sets up to 2."""
    q = parameters(**dict.fromkeys(WORDS, 0.0), w=1.0, k=0.0, r0=1.0, r1=1.0)
    y = states("y0 y1 y2")
    h = [sum(getattr(q, f"c{i}{j}") * y[i] for i in range(N)) for j in range(M)]
    pushes = [sign(e) * (1 + 1 / (1 + Abs(e))) for e in h]
    equations = {
        y[i]: sum(getattr(q, f"a{i}{j}") * y[j] for j in range(N)) + q.k * sin(y[(i + 1) % N])
        + getattr(q, f"f{i}") * sin(q.w * t) + sum(getattr(q, f"b{i}{j}") * pushes[j] for j in range(M))
        for i in range(N)
    }  # fmt: skip
    radii = [getattr(q, f"r{j}") for j in range(M)]
    surfaces = [Surface(f"s{j}", h[j], radius=(-1 - radii[j], 1 + radii[j])) for j in range(M)]
    return System(equations, surfaces=surfaces)


def member(random: np.random.Generator):
    a, c = random.uniform(-1, 1, (N, N)) - 0.5 * np.eye(N), random.uniform(-1, 1, (M, N))
    b = -c.T * random.uniform(0.2, 1.5, M) + 0.5 * random.uniform(-1, 1, (N, M)) * (random.random() < 0.7)
    f = random.uniform(-2, 2, N)
    numbers = [*a.ravel(), *f, *b.ravel(), *c.T.ravel()]
    values = dict(zip(WORDS, map(float, numbers), strict=True))
    values |= {"w": random.uniform(0.5, 4), "k": float(random.integers(2))}
    values |= {f"r{j}": float(random.choice([0.0, 0.3])) for j in range(M)}
    return values, random.uniform(-2, 2, N), c, float(random.choice([0.5, 0.75, 1.0]))


def test_15_3_random_systems_converge_to_the_inclusion_and_do_not_drift() -> None:
    system, refused, times = family(), 0, np.linspace(0, 4, 201)
    for k in range(DRAWS):
        values, start, c, theta = member(np.random.default_rng([7, k]))
        exact = solve(system, start, (0, 4), parameters=values)
        coarse, fine = (
            stepped(system, start, 4, dt, parameters=values, theta=theta) for dt in (4e-3, 1e-3)
        )  # fmt: skip
        if exact.status is Status.NON_UNIQUE:
            # What has several solutions is not followed along one of them in silence.
            assert fine.status is Status.NON_UNIQUE, (k, exact.message)
        if not (coarse.success and fine.success):
            assert {coarse.status, fine.status} <= {Status.NON_UNIQUE, Status.SUCCESS}, (k, fine.message)
            refused += exact.success
            continue
        wide, near = (np.max(np.abs(run.sol(times) - exact.sol(times))) for run in (coarse, fine))
        assert near < 1e-2 or near < 0.45 * wide, (k, wide, near)
        for stay in fine.segments:
            held = [j for j in range(M) if stay.mode[j] == 0]
            inside = fine.sol(np.linspace(stay.t0, stay.t1, 5))
            assert not held or np.max(np.abs(c[held] @ inside)) < 1e-13, k
    assert refused <= 1 + DRAWS // 50


def test_15_3_surfaces_that_hold_the_state_in_a_fixed_proportion() -> None:
    """Twisting, x'' = -3 sgn x - sgn x': at its end both signs act on x' alone: a singular matrix."""
    twisting = System({x: v, v: -3 * sign(x) - sign(v)})
    run = stepped(twisting, (1, 0), 8, 1e-3, theta=1.0)
    assert run.success
    assert np.max(np.abs(run.x_end)) < 1e-12
    held = dict(zip(twisting.surface_names, run.end_multipliers, strict=True))
    assert abs(3 * held["x"] + held["v"]) < 1e-9


def test_15_3_a_loop_that_switches_a_hundred_thousand_times_a_second() -> None:
    """Lags of 1e-6 in a relay loop: steps of 1e-3 give the motion that the switching goes round."""
    lag, (y, u) = 1e-6, states("y u")
    loop = System({x: y, y: (u - y) / lag, u: (0.5 * sin(2 * t) - sign(x) - u) / lag})
    exact = solve(loop, (0.002, -1, -1), (0, 0.01), save_events="count")
    assert exact.event_counts["x"]["crossing"] > 0.8e5 * 0.008
    run = stepped(loop, (0.002, -1, -1), 0.5, 1e-3, theta=1.0)
    assert run.success
    assert run.modes == ("+", "0")
    assert abs(run.x_end[0]) < 1e-15
    assert run.end_multipliers[0] == pytest.approx(0.5 * np.sin(1.0), abs=1e-6)
    assert run.nfev < 5000


@pytest.mark.parametrize("k", [1, 2, 3, 6])
def test_15_3_the_signs_of_a_step_solve_its_complementarity_problem(k: int) -> None:
    random = np.random.default_rng(k)
    for _ in range(DRAWS):
        g = random.normal(size=(k, k))
        a = -(g @ g.T + 0.1 * np.eye(k))
        q, s = random.normal(size=k) * random.choice([0.1, 1, 10]), np.zeros(k)
        z = random.integers(-1, 2, k) * 1.0
        low, high, small = -np.ones(k), np.ones(k), np.full(k, 1e-13)
        work, places = np.zeros(200 + 3 * k * k), np.zeros(10 * k, dtype=np.int64)
        assert complementarity(q, a.ravel().copy(), low, high, small, s, z, k, work, places) == 0
        w = q + a @ s
        assert np.all(np.abs(s) <= 1 + 1e-9)
        assert np.all(np.abs(w[np.abs(s) < 1 - 1e-9]) < 1e-9)
        assert np.all(w[s > 1 - 1e-9] > -1e-9)
        assert np.all(w[s < -1 + 1e-9] < 1e-9)


def test_15_3_a_state_that_is_driven_away_has_several_ways_to_go() -> None:
    repelled = System({x: sign(x)})
    assert stepped(repelled, (0.3,), 1, 0.1).x_end[0] == pytest.approx(1.3)
    run = stepped(repelled, (0,), 1, 0.1)
    assert run.status is Status.NON_UNIQUE
    assert "several sets of signs" in run.message
    code = complementarity(
        np.zeros(1), np.ones(1), -np.ones(1), np.ones(1), np.full(1, 1e-13), np.zeros(1), np.zeros(1), 1,
        np.zeros(50), np.zeros(10, dtype=np.int64),
    )  # fmt: skip
    assert code == SEVERAL


def test_15_3_python_gives_what_the_compiled_steps_give() -> None:
    for system, start in ((BLOCK, (2, 0)), (BALL, (1, 0))):
        compiled, plain = (stepped(system, start, 2, 0.02, backend=b) for b in ("compiled", "python"))
        np.testing.assert_allclose(plain.y, compiled.y, rtol=1e-13, atol=1e-13)
        assert [str(e) for e in plain.events] == [str(e) for e in compiled.events]


def test_15_3_the_solution_is_one_like_any_other(tmp_path: Path) -> None:
    run = stepped(BLOCK, (2, 0), 12, 0.01, t_eval=[0, 1, 12])
    assert run.t.tolist() == [0, 1, 12]
    assert run.sol(3.0).shape == (2,)
    assert sum(run.dwell_times().values()) == pytest.approx(12)
    assert "known to within a step" in run.events[0].note
    assert "not estimated" in run.message
    loaded = type(run).load(run.save(tmp_path / "run.npz"))
    assert (loaded.options.method, loaded.options.dt) == ("Moreau", 0.01)
    counted = stepped(BLOCK, (2, 0), 12, 0.01, save_events="count")
    assert counted.event_counts == run.event_counts
    assert counted.sol is None
    np.testing.assert_array_equal(counted.x_end, run.x_end)
    short = stepped(BLOCK, (2, 0), 12, 0.01, max_steps=100)
    assert short.status is Status.MAX_STEPS
    assert short.t_end == pytest.approx(1.0)


REFUSED = {
    "needs dt": {},
    "expected a finite number > 0": {"dt": -1.0},
    "expected 0.5": {"dt": 0.1, "theta": 0.2},
    "longer than t_span": {"dt": 100.0},
    "rtol means nothing": {"dt": 0.1, "rtol": 1e-3},
    "nonunique means nothing": {"dt": 0.1, "nonunique": "stick"},
    "events means nothing": {"dt": 0.1, "events": lambda time, y: y[0]},
}


@pytest.mark.parametrize("said", REFUSED)
def test_15_3_options_without_a_meaning_are_refused(said: str) -> None:
    with pytest.raises(UsageError, match=said):
        solve(BLOCK, (2, 0), (0, 12), method="Moreau", **REFUSED[said])


def test_15_3_systems_that_do_not_fit_are_refused_by_name() -> None:
    cases = {
        "affine": System({x: sign(x) * sign(v), v: -sign(v)}),
        "hysteresis": System({x: -sign(x)}, surfaces=[Surface("x", x, width=0.1)]),
        "of expressions": System(
            field=lambda time, y, q, s: [-s[0]], states="x", surfaces=[Surface("x", lambda time, y, q: y[0])]
        ),
        "no impact": System({x: 1 - x, v: 0}, surfaces=[Surface("top", x - 0.5, reset={x: 0}, side="-")]),
        "does more": System({x: v, v: -1}, surfaces=[Surface("floor", x, reset={v: -v / 2, x: x + v**2})]),
    }
    for said, system in cases.items():
        with pytest.raises(UsageError, match=said):
            stepped(system, np.ones(system.dimension), 1, 0.1)
    with pytest.raises(UsageError, match="dt is of method='Moreau'"):
        solve(BLOCK, (2, 0), (0, 1), dt=0.1)
    with pytest.raises(UsageError, match="needs dt"):
        solve_many(BLOCK, [(2, 0)], (0, 1), method="Moreau")


def test_15_3_the_command_steps_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["pendulum", "--x0", "1,0", "--t-span", "0", "3"]
    assert main(["simulate", *common, "--method", "Moreau", "--step", "0.01", "-o", str(tmp_path)]) == 0
    assert "steps of 0.01" in capsys.readouterr().err
    assert main(["compare", *common, "--against", "moreau", "--widths", "0.01,0.001"]) == 0
    assert "moreau: error of the final state goes to 0" in capsys.readouterr().err


