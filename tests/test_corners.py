"""Corners of several surfaces, decided each by its own rates; large ones; the chain of blocks."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from sympy import Heaviside, Piecewise, Rational, cos, sign

from filippov import Status, Surface, System, parameters, solve, states, t
from filippov.models.belt import belt
from filippov.models.chain import chain, start
from filippov.models.laws import StaticCoulomb

x, y, z, u, v, tau = states("x y z u v tau")
TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}


# -- rows of the adversarial list ------------------------------------------------------------------------


def test_a22_three_surfaces_one_continuation() -> None:
    field = {x: -sign(x) + 0.2 * sign(y), y: -sign(y) + 0.2 * sign(z), z: -sign(z)}
    run = solve(System(field), (0, 0, 0), (0, 1))
    assert run.success
    assert run.end_mode == (0, 0, 0)
    assert np.all(run.x_end == 0)


@pytest.mark.parametrize("k", [3, 4])
def test_a22_several_continuations_are_all_listed(k: int) -> None:
    q = states([f"q{i}" for i in range(k)])
    run = solve(System({s: sign(s) for s in q}), np.zeros(k), (0, 1))
    assert run.status is Status.NON_UNIQUE
    seen: list[int] = []
    solve(System({s: sign(s) for s in q}), np.zeros(k), (0, 1), nonunique=lambda c: seen.append(len(c)))
    assert seen == [3**k]


def press(P: float = 1.8) -> System:
    p = parameters(P=P, F1=1.0, F2=1.5, F12=1.0)
    return System(
        {
            u: p.P * tau - p.F1 * sign(u) - p.F12 * sign(u - v),
            v: -p.F2 * sign(v) + p.F12 * sign(u - v),
            tau: 1 + 0 * tau,
        }
    )


def test_a22_from_every_corner_of_an_inclusion_something_follows() -> None:
    """Filippov 1988: solutions exist, so constant fields of any kind leave at least one mode."""
    names = [f"f{corner}{i}" for corner in range(4) for i in range(2)]
    q = parameters(**dict.fromkeys(names, 1.0))
    fields = {
        key: [getattr(q, f"f{corner}{i}") for i in range(2)]
        for corner, key in enumerate(("++", "+-", "-+", "--"))
    }
    system = System.from_modes([Surface("a", x), Surface("b", y)], fields, (x, y), parameters=q)
    random = np.random.default_rng(22)
    for _ in range(100):
        values = dict(zip(names, random.integers(-3, 4, 8).astype(float).tolist(), strict=True))
        got = solve(system, (0, 0), (0, 0.1), parameters=values)
        assert got.status in (Status.SUCCESS, Status.NON_UNIQUE), (values, got.message)


def test_a24_forces_not_unique_motion_unique() -> None:
    """Three contacts hold two bodies: they stick until the load P tau is F1 + F12, then u' = P tau - 2."""
    run = solve(press(), (0, 0, 0), (0, 2))
    assert run.success
    assert "not unique" in run.events[0].note
    assert all(repr(name) in run.events[0].note for name in ("u", "u - v"))
    off = 2 / 1.8
    assert abs(run.events[-1].t - off) < 1e-12
    assert abs(run.x_end[0] - 0.9 * (2 - off) ** 2) < 1e-9
    assert abs(run.x_end[1]) < 1e-14


def test_a24_motion_not_unique_names_the_contacts() -> None:
    field = {u: -sign(u) - sign(u + v), v: 0 * v, tau: sign(u) - sign(u + v)}
    run = solve(System(field, surfaces=[Surface("a", u), Surface("b", u + v)]), (0.5, 0, 0), (0, 2))
    assert run.status is Status.NON_UNIQUE
    assert "'a', 'b'" in run.message


def test_a25_friction_at_an_imposed_position() -> None:
    run = solve(System({u: 0 * u, tau: 1 - sign(u)}, surfaces=[Surface("contact", u)]), (0, 0), (0, 1))
    assert run.status is Status.NON_UNIQUE
    assert "'contact'" in run.message


# -- the chain -------------------------------------------------------------------------------------------


@cache
def response(n: int) -> Any:
    return solve(chain(n), start(n), (0, 20), rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("friction", [None, StaticCoulomb(Fs=1, Fc=0.5)])
def test_uncoupled_blocks_move_as_single_ones(friction: Any) -> None:
    law = {} if friction is None else {"friction": friction}
    n = 6
    run = solve(chain(n, **law), start(n), (0, 30), parameters={"kc": 0.0, "dc": 0.0}, **TIGHT)
    for i in range(n):
        alone = solve(belt(**law), start(n)[2 * i : 2 * i + 2], (0, 30), **TIGHT)
        mine = [event for event in run.events if event.index == i]
        assert [(e.kind, e.direction) for e in mine] == [(e.kind, e.direction) for e in alone.events]
        assert np.allclose([e.t for e in mine], alone.events.t, rtol=0, atol=1e-8)
        assert np.allclose(run.x_end[2 * i : 2 * i + 2], alone.x_end, rtol=0, atol=1e-7)


def test_mirror_image() -> None:
    n = 7
    x0 = np.array(start(n)).reshape(n, 2)
    run = solve(chain(n), x0.ravel(), (0, 20), **TIGHT)
    image = solve(chain(n), x0[::-1].ravel(), (0, 20), **TIGHT)
    assert len(run.events) == len(image.events)
    assert np.allclose(run.x_end.reshape(n, 2), image.x_end.reshape(n, 2)[::-1], rtol=0, atol=1e-7)


@pytest.mark.parametrize("n", [1, 12])
def test_equal_blocks_stay_together(n: int) -> None:
    """Events of all blocks are one set (E5), and the motion is that of one block."""
    run = solve(chain(n), np.zeros(2 * n), (0, 30), **TIGHT)
    alone = solve(belt(), (0, 0), (0, 30), **TIGHT)
    assert run.success
    assert len({event.group for event in run.events}) == len(alone.events)
    assert len(run.events) == n * len(alone.events)
    assert np.allclose(run.x_end.reshape(n, 2), alone.x_end, rtol=0, atol=1e-7)


@pytest.mark.parametrize("n", [5, 40])
def test_sticking_blocks_ride_on_the_belt(n: int) -> None:
    run = response(n)
    assert run.success
    for segment in run.segments:
        at = run.sol(0.5 * (segment.t0 + segment.t1)).reshape(n, 2)
        for i, mode in enumerate(segment.mode):
            if mode == 0:
                assert abs(at[i, 1] - 0.2) < 1e-14
            else:
                assert (at[i, 1] - 0.2) * mode > -1e-9


def test_energy_balance() -> None:
    """What springs and blocks gain is what friction does on the blocks, less the dampers' share."""
    n, run = 5, response(5)
    places, weights = np.polynomial.legendre.leggauss(12)

    def energy(s: np.ndarray) -> float:
        X, V = s.reshape(n, 2).T
        return float(0.5 * (V @ V + X @ X + 1.2 * np.sum(np.diff(X) ** 2)))

    work = 0.0
    for a, b in zip(run.t[:-1], run.t[1:], strict=True):
        for place, weight in zip(places, weights, strict=True):
            time = 0.5 * (a + b) + 0.5 * (b - a) * place
            V = run.sol(time).reshape(n, 2)[:, 1]
            mode = next(q.mode for q in run.segments if q.t0 <= time <= q.t1)
            slip = V - 0.2
            s = np.array(
                [m or float(run.multiplier(f"block {i + 1}", time)) for i, m in enumerate(mode)], dtype=float
            )
            force = -s / (1 + 3 * np.abs(slip))
            work += 0.5 * (b - a) * weight * float(force @ V - 0.1 * np.sum(np.diff(V) ** 2))
    assert abs(energy(run.x_end) - energy(np.array(start(n))) - work) < 1e-6


# -- large corners ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [6, 7, 30])
def test_a_tower_of_blocks_leaves_from_rest(k: int) -> None:
    """Blocks in a row rub on each other and on the ground; the pull on the first one decides who moves.

    v_i' = P_i - s_i - (t_i - t_{i-1}) with t_i = sign(v_i - v_{i+1}); pulled at P_1 = 5 the first block slips
    on ground and neighbour, and the neighbour's share of 1 is just what the ground under it can hold.
    """
    half = k // 2
    q = states([f"v{i}" for i in range(half)])
    field: dict[Any, Any] = {}
    for i in range(half):
        pull = -1.5 * sign(q[i]) + (5 if i == 0 else 0)
        if i + 1 < half:
            pull -= sign(q[i] - q[i + 1])
        if i > 0:
            pull += sign(q[i - 1] - q[i])
        field[q[i]] = pull
    run = solve(System(field), np.zeros(half), (0, 1))
    assert run.success
    expected = np.zeros(half)
    expected[0] = 5 - 1.5 - (1 if half > 1 else 0)
    assert np.allclose(run.x_end, expected, rtol=0, atol=1e-12)


def test_multipliers_with_a_pole_ahead_leave_their_set_before_it() -> None:
    """s1 = 7 / (96 - 112 cos 2t) in the corner (-7/40, 0), until s1 = 1 at cos 2t = 89/112."""
    a, b = states("a b")
    h = [b, a + 2 * b / 5 + Rational(7, 40)]
    s0, s1 = sign(h[0]), sign(h[1])
    field = {
        a: Rational(7, 5) * s1 * cos(2 * t) - Rational(6, 5) * s1 - a / 2 - Rational(4, 5) * b,
        b: s0 * s1 / 10 - Rational(6, 5) * s0 - Rational(12, 25) * s1 + Rational(9, 20) * a * b - b / 2
        + Rational(1, 10),
    }  # fmt: skip
    system = System(field, surfaces=[Surface("h0", h[0]), Surface("h1", h[1])])
    run = solve(system, (-1.62, -0.85), (0, 2.9), rtol=1e-10, atol=1e-12)
    assert run.success, run.message
    times = np.linspace(1.2, 2.8, 9)
    np.testing.assert_allclose(run.multiplier("h1", times), 7 / (96 - 112 * np.cos(2 * times)), rtol=1e-9)
    leaving = [e for e in run.events if e.before == (0, 0)]
    assert leaving[0].t == pytest.approx(math.pi - math.acos(89 / 112) / 2, abs=1e-9)


@pytest.mark.parametrize("stiffness", [1000, 160000])
def test_rest_that_a_step_ends_where_two_surfaces_meet(stiffness: float) -> None:
    """A quarter car with a switched damper rests until a kerb at t = 1. Its wheel is fast against what came
    before: followed over the time of the rest, the trial step found that v = 0 may go on."""
    m, wheel, spring = 300, 40, 16000
    damper = Piecewise((3000, v * (v - u) > 0), (300, True)) * (v - u)
    lift = 0.05 * stiffness / wheel
    system = System({
        x: v, v: (-spring * (x - y) - damper) / m,
        y: u, u: (spring * (x - y) + damper - stiffness * y) / wheel + lift * Heaviside(t - 1),
    })  # fmt: skip
    run = solve(system, (0, 0, 0, 0), (0, 2), **TIGHT)
    assert run.status is Status.SUCCESS

    place, speed, low, sinks, step = 0.0, 0.0, 0.0, 0.0, 1e-5
    for _ in range(100_000):  # Euler's method, which slides by short steps back and forth
        c = 3000 if speed * (speed - sinks) > 0 else 300
        force = spring * (place - low) + c * (speed - sinks)
        rise = (force - stiffness * low) / wheel + lift
        place, speed, low, sinks = (
            place + step * speed,
            speed - step * force / m,
            low + step * sinks,
            sinks + step * rise,
        )
    assert run.x_end == pytest.approx([place, speed, low, sinks], abs=3e-5)
