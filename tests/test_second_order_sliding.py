"""Sliding of second and higher order: arrival at a known time, the multiplier that holds it, its end."""

import math
import os

import mpmath
import numpy as np
import pytest
import sympy

from filippov import Surface, System, parameters, sign, solve, sqrt, states, t
from filippov.base.status import Status
from filippov.model.reduction import _gone, _of_first_order, _reduction, _rows, reduction
from filippov.model.symbolic import convex

X, Y, Z, W = states("x y z w")
P = parameters(k1=1.5, k2=1.1, push=0.0, offset=0.0, ramp=0.0)
E = X - P.offset - P.ramp * t
# Super-twisting around x = offset + ramp t: e' = -k1 |e|^(1/2) sgn e + y - ramp, y' = -k2 sgn e + push.
TWISTING = System(
    {X: -P.k1 * sqrt(abs(E)) * sign(E) + Y, Y: -P.k2 * sign(E) + P.push}, surfaces=[Surface("e", E)]
)
DRAWS = {"nightly": 1000, "ci": 40}.get(os.environ.get("FILIPPOV_PROFILE", ""), 40)


def arrival(e: float, y: float, k1: float, k2: float, push: float) -> float:
    """When super-twisting is at rest. With z = |e|^(1/2), dtau = dt/z it is linear between zeros of e:

    z' = (v - k1 z)/2, v' = -K z, K = k2 - sgn(e) push, v = sgn(e) y, so v falls at the rate K in t.
    """
    total = 0.0
    for _ in range(400):
        side = 1.0 if e > 0 or (e == 0 and y > 0) else -1.0
        z, v, pull = math.sqrt(side * e), side * y, k2 - side * push
        a = k1 / 4
        slope, square = (v - k1 * z) / 2 + a * z, a * a - pull / 2
        if square < 0:
            w = math.sqrt(-square)
            tau = math.atan2(z * w, -slope) / w if z > 0 else math.pi / w
            tau += math.pi / w if tau <= 0 else 0.0
            end = 2 * math.exp(-a * tau) * (slope * math.cos(w * tau) - z * w * math.sin(w * tau))
        else:
            r = math.sqrt(square)
            if not (z > 0 and slope < 0 and -z * r / slope < 1):
                return total + v / pull
            tau = math.atanh(-z * r / slope) / r
            end = 2 * math.exp(-a * tau) * (z * r * math.sinh(r * tau) + slope * math.cosh(r * tau))
        total += (v - end) / pull
        e, y = 0.0, side * end
        if abs(end) < 1e-15:
            break
    return total


def twisting_fault(seed: int) -> str | None:
    """What is wrong with a super-twisting motion: gains over- and underdamped, pushed, moving, off 0."""
    draw = np.random.default_rng(seed)
    k2 = 10 ** draw.uniform(-0.5, 0.8)
    k1 = math.sqrt(8 * k2) * 10 ** draw.uniform(-0.7, 0.7)
    push = draw.choice([0.0, draw.uniform(-0.8, 0.8) * k2])
    offset, ramp = draw.choice([0.0, draw.uniform(-3, 3)]), draw.choice([0.0, draw.uniform(-2, 2)])
    e, y = draw.uniform(-2, 2, 2)
    rtol = draw.choice([1e-6, 1e-8, 1e-10])
    end = arrival(e, y, k1, k2, push)
    values = {"k1": k1, "k2": k2, "push": push, "offset": offset, "ramp": ramp}
    got = solve(
        TWISTING, (e + offset, y + ramp), (0, 2 * end + 1), parameters=values, zeno="continue", rtol=rtol,
        atol=1e-3 * rtol, max_events=400,
    )  # fmt: skip
    where = f"{values}, from {e}, {y}, rtol {rtol}: {got.message}"
    if got.status is not Status.SUCCESS:
        return where
    # What cannot be told from rounding of h (4,000 of its last digit) moves the speed by k1 times its root.
    rounding = 4e3 * 2.2e-16 * (abs(offset) + abs(ramp) * end + 3)
    late = abs(got.events[-1].t - end)
    if late >= 1e3 * rtol * end + 3 * (1 + k1) * math.sqrt(rounding) / (k2 - abs(push)):
        return f"arrival {late:.2g} off: {where}"
    later = np.linspace(end + 1e3 * rtol * end + 3e-5, got.t_end, 9)
    rest = np.array([offset + ramp * later, np.full(9, ramp)])
    away = float(np.max(np.abs(got.sol(later) - rest)))
    held = abs(got.multiplier("e", got.t_end) - push / k2)
    return f"{away:.2g} off, multiplier {held:.2g} off: {where}" if max(away, held) >= 1e-9 else None


def test_7_15_super_twisting_over_the_plane_of_gains() -> None:
    wrong = {seed: fault for seed in range(DRAWS) if (fault := twisting_fault(seed))}
    assert not wrong, wrong


def test_15_overdamped_arrival_is_no_accumulation() -> None:
    values = {"k1": 4.0, "k2": 1.1}
    got = solve(TWISTING, (1, 0.5), (0, 10), parameters=values, rtol=1e-8)
    assert got.success
    assert len(got.events) < 5
    assert abs(got.events[-1].t - arrival(1, 0.5, 4.0, 1.1, 0.0)) < 1e-6
    np.testing.assert_allclose(got.x_end, 0, atol=1e-12)


def test_7_differentiator_follows_any_signal() -> None:
    # Levant 1998: x0 -> f, x1 -> f', with the multiplier -f''/l2.
    signal = sympy.sin(t) + 0.3 * sympy.cos(2 * t)
    e = X - signal
    system = System(
        {X: -2.5 * sqrt(abs(e)) * sign(e) + Y, Y: -4 * sign(e)}, surfaces=[Surface("e", e)]
    )
    got = solve(system, (0.5, 0), (0, 12), zeno="continue")
    assert got.success
    times = np.linspace(got.events[-1].t + 0.1, 12, 30)
    f, df, ddf = (sympy.lambdify(t, signal.diff(t, k), "numpy")(times) for k in range(3))
    np.testing.assert_allclose(got.sol(times), [f, df], atol=1e-11)
    np.testing.assert_allclose(got.multiplier("e", times), -ddf / 4, atol=1e-9)


def test_7_observer_of_a_plant_with_a_disturbance_in_a_state() -> None:
    # Plant z' = w, w' = -z; the observer sees z only. What it does must not act on the plant.
    e = X - Z
    system = System({X: -1.5 * sqrt(abs(e)) * sign(e) + Y, Y: -3 * sign(e), Z: W, W: -Z})
    got = solve(system, (0.5, 0, 0, 1), (0, 20), zeno="continue")
    assert got.success
    np.testing.assert_allclose(got.x_end, [math.sin(20), math.cos(20)] * 2, atol=1e-8)


@pytest.mark.parametrize("offset", [0, 100, 1e4, 1e6])
def test_F12_twisting_away_from_the_origin(offset: float) -> None:
    """Twisting 2 and 1 from (1, 0): |v| is sqrt(2) 3**(-k/2) at the k-th crossing, falls by 3, grows by 1."""
    p = parameters(offset=0.0, ramp=0.0)
    system = System({X: W, W: -2 * sign(X - p.offset - p.ramp * t) - sign(W - p.ramp)})
    v, q = math.sqrt(2), 1 / math.sqrt(3)
    limit = v + (v / 3 + v * q) / (1 - q)
    for ramp in (0.0, 3.0):
        values = {"offset": offset, "ramp": ramp}
        run = solve(system, (1 + offset, ramp), (0, 10), parameters=values, max_events=500)
        assert run.status is Status.ZENO
        assert run.zeno is not None
        assert abs(run.zeno.t - limit) <= 10 * run.zeno.error <= 1e-5
        on = solve(system, (1 + offset, ramp), (0, 10), parameters=values, zeno="continue", max_events=500)
        assert on.success, on.message
        assert on.end_mode == (0, 0)
        np.testing.assert_allclose(on.x_end, [offset + 10 * ramp, ramp], rtol=1e-12)


def test_7_two_signs_on_one_rate_hold_what_they_can_together() -> None:
    # v' = -2 s1 - 1.5 s2 + t/2 is held at 0 until t = 7, and then v = (t - 7)**2/4.
    system = System({X: W, W: -2 * sign(X) - 1.5 * sign(W) + Z, Z: 0.5})
    start = solve(system, (0, 0, 0), (0, 9), zeno="continue")
    assert start.success, start.message
    assert [e.t for e in start.events if e.after == (1, 1)] == pytest.approx([7.0, 7.0], abs=1e-9)
    np.testing.assert_allclose(start.x_end, [2**3 / 12, 2**2 / 4, 4.5], rtol=1e-9)


def test_7_third_order_chain() -> None:
    # The sign holds a = a' = a'' = 0 against a push on the third derivative.
    a, b, c = states("a b c")
    system = System({a: b, b: c, c: -4 * sign(a) + 2 * sympy.sin(t)})
    got = solve(system, (0, 0, 0), (0, 10))
    assert got.success, got.message
    np.testing.assert_allclose(got.x_end, 0, atol=1e-12)
    assert got.multiplier("a", 1.0) == pytest.approx(math.sin(1.0) / 2, abs=1e-12)


def test_7_what_cannot_be_formed_is_named() -> None:
    # A plain function has no derivatives; the limit moves, so that it is no place to rest in either.
    def field(u: float, x: np.ndarray, p: object, s: np.ndarray) -> list[float]:
        return [-1.5 * math.sqrt(abs(x[0])) * s[0] + x[1] + 0.3 * math.sin(u), -1.1 * s[0]]

    system = System(field=field, surfaces=[Surface("x", lambda u, x, p: x[0])], states="x y")
    got = solve(system, (1, 0), (0, 20), zeno="continue", max_events=2000)
    assert not got.success
    assert got.t_end < 3


def test_14_1_answers_are_given_again_only_for_what_they_were_made_with() -> None:
    """Against ones made anew, for values that come back: gains of both signs, powers without a value."""
    q = parameters(g=1.0, ratio=0.3, power=0.5, pull=1.0)
    twisting = System({X: Y, Y: -q.g * sign(X) - q.g * q.ratio * sign(Y)}, parameters=q)
    field = {X: -q.g * abs(X) ** q.power * sign(X) + Y, Y: -q.pull * sign(X) + q.ratio * Z, Z: -Y * Z}
    root = System(field, parameters=q)
    rng, kinds = np.random.default_rng(14), set()
    for system, zero in ((twisting, (0, 1)), (twisting, (0,)), (root, (0,))):
        form = system.symbolic
        for _ in range(40):
            at = {symbol: float(rng.choice([0.0, 0.5])) for symbol in (t, *form.x, *form.a, *form.s)}
            choices = {"g": (1.0, -2.0), "ratio": (0.3, -0.3), "power": (0.5, -0.5, 1.0), "pull": (1.0, 0.0)}
            at |= {symbol: float(rng.choice(choices[str(symbol)])) for symbol in form.p}
            here, anew = reduction(system, zero, (), at), _reduction(system, form, zero, (), at)
            kinds.add(here if isinstance(here, str) else here.order)
            assert here == anew
            if not isinstance(here, str):
                x = rng.uniform(-1, 1, len(form.x))
                assert np.array_equal(here.projected(0.0, x, at), anew.projected(0.0, x, at))
                assert np.max(np.abs(here.projected(0.0, x, at)[:2])) < 1e-15
    assert len(kinds) > 2


@pytest.mark.parametrize("seed", range(6))
def test_14_5_surfaces_of_first_order_are_told_from_their_own_states(seed: int) -> None:
    """Against the derivatives of all: signs that act on their own rate, on another's, or on none."""
    rng, kinds = np.random.default_rng(seed), set()
    names = states(" ".join(f"x{k}" for k in range(6)))
    for _ in range(6):
        a = rng.integers(-1, 2, (6, 6)) * (rng.uniform(size=(6, 6)) < 0.4)
        b = rng.integers(-1, 2, (6, 3)) * (rng.uniform(size=(6, 3)) < 0.3)
        h = [names[k] + int(rng.integers(0, 2)) * names[k + 1] ** 2 for k in range(3)]
        rows = [a[i] @ np.array(names) + b[i] @ np.array([sign(g) for g in h]) for i in range(6)]
        rows[5] += 3 * sum(sign(g) for g in h)
        surfaces = [Surface(f"h{k}", g) for k, g in enumerate(h)]
        system = System(dict(zip(names, rows, strict=True)), surfaces=surfaces)
        form = system.symbolic
        at = dict.fromkeys((t, *form.x, *form.a, *form.s), 0.0)
        for zero in ((0,), (1,), (0, 1), (0, 1, 2)):
            signs, gone = tuple(form.s[i] for i in zero), _gone(form, zero, (), ())
            field = [convex(f, set(signs)).xreplace(gone) for f in form.field]
            found = _rows(system, form, zero, signs, field, gone, at)
            first = not isinstance(found, str) and max(found[2].values()) == 1
            first = first and all(any(e[k] != 0 for _, e in found[0].values()) for k in range(len(zero)))
            kinds.add(first)
            assert _of_first_order(form, zero, signs, gone, at) == first
    assert kinds == {True, False}


def speed_after(cycles: int, v: float, a: float, c: float) -> float:
    """|v| where x'' = -a sgn x - c x', which leaves x = 0 with speed v, has passed it so many times again.

    Off x = 0: c x = (v + a/c)(1 - exp(-c t)) - a t.
    """
    with mpmath.workdps(40):
        v, a, c = mpmath.mpf(v), mpmath.mpf(a), mpmath.mpf(c)
        for _ in range(cycles):
            over = v + a / c
            # The root of 1 - exp(-s) = s a/(c v + a) other than 0, s = c t.
            s = mpmath.findroot(lambda s, over=over: -mpmath.expm1(-s) - s * (a / c) / over, 2 * c * v / a)
            v = a / c - over * mpmath.exp(-s)
        return float(v)


@pytest.mark.parametrize("seed", range(DRAWS // 10))
def test_7_cycles_within_the_tolerance_of_h_are_followed_as_others_are(seed: int) -> None:
    """x is below atol throughout, v is not: the speeds are those of the closed form."""
    draw = np.random.default_rng(seed)
    a, c, v = draw.uniform(1, 4), draw.uniform(0.2, 1.0), 10 ** draw.uniform(-6, -4.7)
    system = System({X: Y, Y: -float(a) * sign(X) - float(c) * Y})
    run = solve(system, (0, v), (0, 1), rtol=1e-9, atol=1e-10, events=[], max_events=600, dense_output=False)
    assert run.status is Status.MAX_EVENTS
    assert len(run.events) == 600
    known = speed_after(600, v, a, c)
    assert abs(run.x_end[1]) == pytest.approx(known, rel=1e-7)
    assert abs(known - v) > 1e-5 * v
