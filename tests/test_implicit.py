"""method="Radau": stiff fields against closed forms, published solutions, scipy; hints to explicit runs."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import filippov.solving.loop
from filippov import Problem, Surface, System, UsageError, cos, sign, solve, sqrt, states, t
from filippov.kernel.methods import dense_lu
from filippov.kernel.tables import radau_tables
from filippov.models.lugre import hunting_lugre
from filippov.models.mass import hunting
from filippov.models.switch import hunting_switch
from filippov.solving.ensemble import solve_many
from filippov.solving.solution import Solution
from filippov.solving.state.events import Stop

a, b, c = states("a b c")
x, v, u, y = states("x v u y")


def radau(system: System, x0: Any, span: tuple[float, float], **options: Any) -> Solution:
    got = solve(system, x0, span, method="Radau", **options)
    assert got.success, got.message
    return got


# The method's own pieces.


def test_tables_satisfy_the_simplifying_assumptions_of_order_five() -> None:
    """sum_j A_ij c_j^(q-1) = c_i^q / q, q to 3, and the quadrature of the last row to degree 4."""
    matrix = np.linalg.inv(np.array(radau_tables.A_INVERSE).reshape(3, 3))
    nodes = np.array(radau_tables.C)
    for q in (1, 2, 3):
        assert np.allclose(matrix @ nodes ** (q - 1), nodes**q / q, rtol=0, atol=1e-15)
    for q in (1, 2, 3, 4, 5):
        assert abs(matrix[2] @ nodes ** (q - 1) - 1 / q) < 1e-15
    split = np.array(radau_tables.TO_W).reshape(3, 3) @ np.linalg.inv(matrix)
    split = split @ np.array(radau_tables.TO_Z).reshape(3, 3)
    pair, turn = radau_tables.PAIR, radau_tables.SPIN
    wanted = np.array([[radau_tables.REAL, 0, 0], [0, pair, turn], [0, -turn, pair]])
    assert np.allclose(split, wanted, rtol=0, atol=2e-14)


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_lu_factors_solve_real_and_complex_systems(n: int) -> None:
    random = np.random.default_rng(n)
    re, im = random.normal(size=(n, n)), random.normal(size=(n, n))
    re[0, 0] = 0.0
    one, two = random.normal(size=n), random.normal(size=n)
    pivots = np.zeros(n, dtype=np.int64)
    if n > 1:
        factors, solved = re.ravel().copy(), one.copy()
        assert dense_lu.factor(factors, pivots, n)
        dense_lu.substitute(factors, pivots, solved, n)
        assert np.allclose(re @ solved, one, atol=1e-12)
    left, right, real, imaginary = re.ravel().copy(), im.ravel().copy(), one.copy(), two.copy()
    assert dense_lu.factor_complex(left, right, pivots, n)
    dense_lu.substitute_complex(left, right, pivots, real, imaginary, n)
    assert np.allclose((re + 1j * im) @ (real + 1j * imaginary), one + 1j * two, atol=1e-12)
    assert not dense_lu.factor(np.zeros(n * n), pivots, n)
    assert not dense_lu.factor_complex(np.zeros(n * n), np.zeros(n * n), pivots, n)


# Between the steps: a method that looks at their ends only passes a fast decay in one, and draws it wrong.


@pytest.mark.parametrize("seed", range(8))
def test_dense_output_and_events_hold_in_fast_decays(seed: int) -> None:
    """x rises from 0 to 1 and falls back, y follows it at any rate; y has a closed form."""
    rng = np.random.default_rng(seed)
    rate, rtol, level = 10 ** rng.uniform(1, 8), 10 ** rng.uniform(-10, -4), rng.uniform(0.2, 0.8)
    edges = [Surface("top", x - 1, reset={x: 0 * x}, side="-"), Surface("level", y - level, kind="observer")]
    system = System({x: 1 + 0 * x, y: -rate * (y - x)}, surfaces=edges)
    got = radau(system, (0, 0.9), (0, 2.5), rtol=rtol, atol=1e-2 * rtol)

    def wanted(times: Any) -> Any:
        first = np.array(0.9)
        starts = [first := 1 - 1 / rate + (first + 1 / rate) * np.exp(-rate) for _ in range(2)]
        tooth = np.floor(times).astype(int)
        since = times - tooth
        return since - 1 / rate + (np.array([0.9, *starts])[tooth] + 1 / rate) * np.exp(-rate * since)

    decay = np.geomspace(1e-2 / rate, 0.49, 2000)
    times = np.sort(np.concatenate([np.linspace(0.005, 2.495, 500), decay, 1 + decay, 2 + decay]))
    # The rounding of t is one of rate times it in y.
    allowed = 2 * rtol + 8e-16 * rate
    assert np.max(np.abs(got.sol(times)[1] - wanted(times))) < allowed
    found = np.array([event.t for event in got.events if event.surface == "level"])
    signs = np.sign(wanted(times) - level)
    assert len(found) == np.count_nonzero(np.diff(signs))
    assert np.max(np.abs(wanted(found) - level)) < allowed


@pytest.mark.parametrize("rate", [1e1, 1e3, 1e5, 1e8])
@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_dense_output_of_a_fast_variable_is_as_accurate_as_the_tolerance(rate: float, rtol: float) -> None:
    """y' = -rate (y - cos t) - sin t (Prothero & Robinson 1974), where scipy's is off by up to 9e6 rtol."""
    got = radau(System({y: -rate * (y - cos(t)) - sympy.sin(t)}), (1.3,), (0, 5), rtol=rtol, atol=1e-2 * rtol)
    at = np.sort(np.concatenate([np.linspace(0, 5, 2001), np.geomspace(1e-2 / rate, 5, 1000)]))
    assert np.max(np.abs(got.sol(at)[0] - np.cos(at) - 0.3 * np.exp(-rate * at))) < rtol


# Smooth stiff problems: solutions of the Test Set for IVP Solvers (Mazzia & Magherini 2008).


def test_van_der_pol_at_a_million() -> None:
    got = radau(System({x: v, v: ((1 - x**2) * v - x) * 10**6}), (2, 0), (0, 2))
    assert np.allclose(got.x_end, [1.706167732170469, -0.8928097010248125], rtol=1e-9)
    assert got.steps < 6000
    assert got.njev < got.steps / 4


def test_robertson_to_1e11() -> None:
    system = System(
        {a: -0.04 * a + 10**4 * b * c, b: 0.04 * a - 10**4 * b * c - 3 * 10**7 * b**2, c: 3 * 10**7 * b**2}
    )
    got = radau(system, (1, 0, 0), (0, 1e11), rtol=1e-8, atol=1e-18)
    wanted = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050]
    assert np.allclose(got.x_end, wanted, rtol=1e-6, atol=0)
    assert got.steps < 2000


def test_fifty_states_of_a_heated_rod() -> None:
    """x' = A x + e_1, A the second difference: rates from 10 to 10^4, against the exponential of A."""
    n = 50
    matrix = (np.diag(-2.0 * np.ones(n)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)) * n**2

    def field(time: float, z: np.ndarray, p: Any, s: Any) -> np.ndarray:
        out = matrix @ z
        out[0] += n
        return out

    got = radau(System(field=field, surfaces=[], states=[f"z{i}" for i in range(n)]), np.zeros(n), (0, 0.3))
    heat = np.zeros(n)
    heat[0] = n
    wanted = np.linalg.solve(matrix, (expm(0.3 * matrix) - np.eye(n)) @ heat)
    assert np.max(np.abs(got.x_end - wanted)) < 1e-9
    assert got.njev == 1
    assert got.nlu >= 2
    assert got.steps < 500


# Events.

# y follows cos t in 1e-6; x slides where |y| < 2, its multiplier is y/2.
LAG = System({x: -sign(x) + y / 2, y: -(10**6) * (y - 4 * cos(t))})


def lagging(time: float) -> float:
    """y without the transient: y' = -k (y - 4 cos t)."""
    k = 1e6
    return 4 * k * (k * math.cos(time) + math.sin(time)) / (k * k + 1)


def test_sliding_with_a_stiff_multiplier_enters_and_leaves_where_it_should() -> None:
    y0 = lagging(1.4)
    got = radau(LAG, (0.1, y0), (1.4, 5))
    assert got.modes == ("+", "0", "-", "0")[: len(got.modes)]
    assert got.modes[:3] == ("+", "0", "-")

    def moved(begin: float, end: float) -> float:
        """Integral of y/2."""
        k = 1e6
        return 2 * k * (k * (math.sin(end) - math.sin(begin)) - math.cos(end) + math.cos(begin)) / (k * k + 1)

    entry = brentq(lambda s: 0.1 - (s - 1.4) + moved(1.4, s), 1.4, 1.6, xtol=1e-15)
    leave = brentq(lambda s: lagging(s) + 2, 2, 2.5, xtol=1e-15)
    assert abs(got.events[0].t - entry) < 1e-9
    assert abs(got.events[1].t - leave) < 1e-9
    assert abs(got.sol(3.0)[0] - (3 - leave + moved(leave, 3.0))) < 1e-9
    times = got.t[(got.t > entry) & (got.t < leave)]
    assert np.max(np.abs(got.multiplier("x", times) - [lagging(s) / 2 for s in times])) < 1e-9
    assert got.steps < 700
    assert got.events[0].residual < 1e-14


def test_b19_a_relay_with_hysteresis_and_a_fast_actuator() -> None:
    """x' = u, eps u' = -u - r, r = +-1 turned at x = -+0.2: exponentials in each piece, roots in between."""
    eps, width = 1e-6, 0.2
    system = System({x: u, u: (-u - sign(x)) / eps}, surfaces=[Surface("x", x, width=width)])
    got = radau(system, (0.1, 0.5), (0, 3))
    now, position, actuator, relay = 0.0, 0.1, 0.5, 1.0
    times = []

    def place(after: float) -> float:
        return position - relay * after + eps * (actuator + relay) * -math.expm1(-after / eps)

    def ahead(after: float) -> float:
        return relay * place(after) + width

    while True:
        wait = brentq(ahead, 10 * eps, 2.0, xtol=1e-16, rtol=1e-15)
        if now + wait > 3:
            break
        now, position = now + wait, -relay * width
        actuator = -relay + (actuator + relay) * math.exp(-wait / eps)
        relay = -relay
        times.append(now)
    assert np.allclose([event.t for event in got.events], times, rtol=0, atol=1e-9)
    assert abs(got.x_end[0] - place(3 - now)) < 1e-9
    assert abs(got.x_end[1] + relay) < 1e-9
    assert got.steps < 400 * (len(times) + 1)


def test_b19_a_relay_slides_on_its_fast_actuator() -> None:
    """On x + u = 0 the motion is x' = -x, whatever eps."""
    got = radau(System({x: u, u: -(10**6) * (u + sign(x + u))}), (3, -1), (0, 5))
    assert got.modes == ("+", "0")
    # x' = -1 until x = 1 - eps, where the relay no longer holds it.
    entry = got.events[0].t
    assert abs(entry - 2) < 1e-5
    assert abs(got.x_end[0] - got.events[0].x[0] * math.exp(entry - 5)) < 1e-9
    assert abs(got.x_end.sum()) < 1e-15
    assert got.steps < 1000


def lugre_by_scipy(sigma0: float, end: float) -> np.ndarray:
    """The equations of models/lugre.py by LSODA at rtol 1e-11, from the symbolic form."""
    system = hunting_lugre(sigma0, math.sqrt(sigma0))
    form = system.symbolic
    assert form is not None
    p = Problem(system, (0.1, 0, 0, 0), (0, end)).p
    flat = sympy.lambdify([t, form.x, form.p, form.s, form.a], form.field, "math")

    def field(time: float, z: np.ndarray) -> list[float]:
        return list(flat(time, z, p, [1.0 if z[1] >= 0 else -1.0], [abs(z[1])]))

    run = solve_ivp(field, (0, end), [0.1, 0, 0, 0], "LSODA", rtol=1e-11, atol=1e-16)
    assert run.success
    return np.asarray(run.y[:, -1])


@pytest.mark.parametrize(("sigma0", "end"), [(1e5, 2.0), (1e8, 0.5)])
def test_b19_lugre_by_the_implicit_method(sigma0: float, end: float) -> None:
    got = radau(hunting_lugre(sigma0, math.sqrt(sigma0)), (0.1, 0, 0, 0), (0, end))
    wanted = lugre_by_scipy(sigma0, end)
    assert np.max(np.abs(got.x_end - wanted)[:3]) < 1e-8
    assert abs(got.x_end[3] - wanted[3]) < 1e-7 * abs(wanted[3])
    assert got.steps < 2500


def test_b19_the_switch_model_at_a_million_follows_the_inclusion() -> None:
    """Its band is 1e-8 wide and its stick decays in 1e-6 s: it differs from the inclusion by the band."""
    got = radau(hunting_switch(1e-8, 1e6), (0.1, 0, 0), (0, 5))
    exact = solve(hunting(), (0.1, 0, 0), (0, 5))
    assert np.max(np.abs(got.x_end - exact.x_end)) < 1e-6
    assert got.steps < 4000


def test_b19_a_saturated_line_of_width_1e_9() -> None:
    """A relay as a steep line, x' = 1/2 cos t - clip(x/eps): the line is followed, x = eps cos(t)/2 there."""
    from filippov import Band

    eps = 1e-9
    steep = System({x: cos(t) / 2 - sign(x)}).with_comparator(Band(eps))
    got = radau(steep, (1,), (0, 10), atol=1e-14)
    assert abs(got.x_end[0] - eps * math.cos(10) / 2) < 1e-13
    assert got.steps < 1000


@pytest.mark.parametrize("method", ["DOP853", "DP5"])
@pytest.mark.parametrize("sigma0", [1e5, 1e8])
def test_b19_an_explicit_method_that_crawls_says_so(method: str, sigma0: float) -> None:
    got = solve(hunting_lugre(sigma0), (0.1, 0, 0, 0), (0, 20), method=method, max_steps=30_000)
    assert got.status == "max_steps"
    assert "field is stiff here" in got.message
    assert "method='Radau'" in got.message


def test_b19_a_long_run_that_succeeds_says_so_too() -> None:
    stiff = System({x: v, v: -(10**4) * (v + x)})
    slow, fast = solve(stiff, (1, 0), (0, 30)), radau(stiff, (1, 0), (0, 30))
    assert slow.success
    assert "method='Radau'" in slow.message
    rate = 5e3 - math.sqrt(5e3**2 - 1e4)
    wanted = (1e4 - rate) / (1e4 - 2 * rate) * math.exp(-30 * rate)
    assert abs(slow.x_end[0] - wanted) < 1e-12
    assert abs(fast.x_end[0] - wanted) < 1e-12
    assert fast.steps < slow.steps / 50
    assert "stiff" not in fast.message


def test_fast_oscillations_are_not_called_stiff() -> None:
    got = solve(System({x: v, v: -(10**4) * x}), (1, 0), (0, 100))
    assert got.steps > 20_000
    assert "stiff" not in got.message


# The contract of the loop.


def test_sqrt_of_a_guard_is_never_asked_below_zero() -> None:
    """E8: x' = -sqrt(x) - 1 above 0, 3 below; x reaches 0 where sqrt(x) = s, t = 2 s - 2 log(1 + s)."""
    system = System.from_modes([Surface("x", x)], {"+": [-sqrt(x) - 1], "-": [x * 0 + 3]}, [x])
    got = radau(system, (1,), (0, 1))
    assert got.modes == ("+", "0")
    assert abs(got.events[0].t - (2 - 2 * math.log(2))) < 1e-8
    assert got.x_end[0] == 0


def test_a_motion_that_ends_in_finite_time_is_stopped_there() -> None:
    got = solve(System({x: x**2}), (1,), (0, 3), method="Radau", max_steps=20_000)
    assert got.status in ("min_step", "not_finite")
    assert abs(got.t_end - 1) < 1e-9


def test_steps_do_not_depend_on_how_a_run_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = radau(LAG, (0.1, 3.0), (0, 4))
    for chunk in (1, 7):
        monkeypatch.setattr(filippov.solving.loop, "_CHUNK", chunk)
        monkeypatch.setattr(filippov.solving.loop, "_LONGEST_CHUNK", chunk)
        cut = radau(LAG, (0.1, 3.0), (0, 4))
        assert np.array_equal(cut.x_end, whole.x_end)
        assert cut.steps == whole.steps


def test_trajectories_of_an_ensemble_do_not_know_each_other() -> None:
    starts = np.array([[0.1, 3.0], [-0.4, -1.0], [1.0, 0.0], [0.1, 3.0]])
    many = solve_many(LAG, starts, (0, 4), method="Radau")
    assert many.success.all()
    assert np.array_equal(many.x[0], many.x[3])
    for start, end in zip(starts, many.x, strict=True):
        assert np.allclose(radau(LAG, start, (0, 4)).x_end, end, rtol=0, atol=1e-13)


def test_plain_functions_and_formulas_agree() -> None:
    def field(time: float, z: np.ndarray, p: Any, s: np.ndarray) -> list[float]:
        return [-s[0] + z[1] / 2, -1e6 * (z[1] - 4 * math.cos(time))]

    plain = System(field=field, surfaces=[Surface("x", lambda t, z, p: z[0])], states=["x", "y"])
    one, two = radau(plain, (0.1, 3.0), (0, 4)), radau(LAG, (0.1, 3.0), (0, 4))
    assert one.modes == two.modes
    assert np.allclose(one.x_end, two.x_end, rtol=0, atol=1e-10)


def test_backwards_and_forwards_are_the_same_motion() -> None:
    system = System({x: v, v: -x - x**3 - sign(v + 3)})
    there = radau(system, (1, 0.5), (0, 3), rtol=1e-10)
    back = radau(system, there.x_end, (3, 0), rtol=1e-10, backward=True)
    assert np.allclose(back.x_end, [1, 0.5], rtol=0, atol=1e-9)


def test_two_surfaces_and_a_terminal_event() -> None:
    """Both slide at once from a corner met after a stiff approach; x stays, y stays."""
    z = states("z")[0]
    system = System(
        {x: -sign(x) - sign(y) / 2 + 0.3 * z, y: -2 * sign(y) + sign(x) / 2, z: -(10**5) * (z - cos(t))}
    )
    got = radau(system, (0.3, 0.4, 0.0), (0, 3), stop=Stop("y", "sliding entry"))
    assert got.status == "stopped"
    assert abs(got.x_end[1]) < 1e-15
    reference = solve(system, (0.3, 0.4, 0.0), (0, 3))
    full = radau(system, (0.3, 0.4, 0.0), (0, 3))
    assert full.modes == reference.modes
    assert full.modes[-1] == "00"
    times = [[event.t for event in run.events] for run in (full, reference)]
    assert np.allclose(*times, rtol=0, atol=1e-9)
    assert np.allclose(full.x_end, reference.x_end, rtol=0, atol=1e-8)


def test_jacobians_and_factorisations_are_counted() -> None:
    linear = System({x: -1000 * x + y, y: -y})
    got = radau(linear, (1, 1), (0, 2))
    assert got.njev == 1
    assert got.nlu >= 2 * 2
    assert solve(linear, (1, 1), (0, 0.1)).njev == solve(linear, (1, 1), (0, 0.1)).nlu == 0


def test_dense_output_is_as_accurate_as_the_tolerance() -> None:
    got = radau(System({x: v, v: -x}), (1, 0), (0, 10), rtol=1e-8, atol=1e-8)
    times = np.linspace(0, 10, 1001)
    assert np.max(np.abs(got.sol(times)[0] - np.cos(times))) < 1e-7
    assert got.sol.coef.shape[1] == 4


def test_the_name_of_a_method_is_checked() -> None:
    with pytest.raises(UsageError, match="did you mean 'Radau'"):
        solve(LAG, (0, 0), (0, 1), method="radau5")


def test_orders_of_the_extremes_agree_with_an_explicit_run() -> None:
    """The hunting system, not stiff: both methods find the same events."""
    runs = [solve(hunting(), (0.1, 0, 0), (0, 10), method=m) for m in ("DOP853", "Radau")]
    assert runs[0].modes == runs[1].modes
    for one, two in itertools.pairwise(runs):
        times = [[event.t for event in run.events] for run in (one, two)]
        assert np.allclose(*times, rtol=0, atol=1e-7)
