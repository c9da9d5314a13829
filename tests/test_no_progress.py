"""Motions that get nowhere end soon, by counting work, with the cause by name, or go on in the limit."""

import os
from functools import cache
from typing import Any

import numpy as np
import pytest

from filippov import Status, System, TimeEvent, parameters, sign, solve, solve_many, sqrt, states

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
DRAWS = {"default": 6, "ci": 20, "nightly": 1000}[PROFILE]
X, Y, Z = states("x y z")


@cache
def ring(follower: bool) -> System:
    """x' = a (H(q - y) - x), y' = b (H(x - p) - y): two genes with thresholds, and a third that follows."""
    names = {"a": 1.0, "b": 1.0, "p": 0.5, "q": 0.4}
    k = parameters(**names, **({"c": 1.0} if follower else {}))
    on, off = (1 + sign(X - k.p)) / 2, (1 + sign(k.q - Y)) / 2
    field = {X: k.a * (off - X), Y: k.b * (on - Y)}
    return System(field | ({Z: k.c * (X - Z)} if follower else {}))


@pytest.mark.parametrize("follower", [False, True])
def test_11_8_slow_spirals_into_a_corner(follower: bool) -> None:
    """Areas shrink at the rate a + b, so the distance falls as exp(-(a + b) t/2), in n cycles as 1/n."""
    rng = np.random.default_rng(8)
    for number in range(DRAWS):
        a, b, c = 10 ** rng.uniform(-0.5, 0.5, 3)
        p, q = rng.uniform(0.2, 0.8, 2)
        values = {"a": a, "b": b, "p": p, "q": q} | ({"c": c} if follower else {})
        given: dict[str, Any] = {"parameters": values, "max_events": 4000}
        x0 = (0.1, 0.2, 0.9) if follower else (0.1, 0.2)
        half = 2 * np.log(2) / (a + b)
        end = solve(ring(follower), x0, (0, 60 / (a + b)), **given)
        where = f"{number}: {values}, {end.message}"
        assert end.status is Status.MAX_EVENTS, where
        assert "n**-1:" in end.message, where
        told = float(end.message.split("halves every ")[1].split()[0])
        assert told == pytest.approx(half, rel=0.03), where
        on = solve(ring(follower), x0, (0, 60 / (a + b)), zeno="continue", **given)
        assert on.success, f"{number}: {values}, {on.message}"
        assert on.end_mode == (0, 0)
        np.testing.assert_allclose(on.x_end[:2], [p, q], atol=1e-12)
        assert "the true one is" in on.message
        # Cycle by cycle until the corner, which is as near as the message says.
        away = float(on.message.split("from which the true one is ")[1].split()[0])
        corner = on.events[-1]
        before = on.sol(corner.t, side="-")[:2]
        assert np.max(np.abs(before - [p, q])) <= 1.1 * away
        if follower:
            # Afterwards z' = c (p - z).
            z0 = corner.x[2]
            late = on.t_end - corner.t
            assert on.x_end[2] == pytest.approx(p + (z0 - p) * np.exp(-c * late), abs=1e-8)


def test_11_8_a_sign_written_as_an_if_is_named() -> None:
    rng = np.random.default_rng(9)
    for _ in range(DRAWS // 5 + 1):
        k, push, start = rng.uniform(0.5, 3), rng.uniform(-0.4, 0.4), rng.uniform(0.1, 2)

        def field(time: float, x: Any, p: Any, s: Any, k: float = k, push: float = push) -> list[float]:
            return [push - (k if x[0] > 0 else -k)]

        system = System(field=field, surfaces=[], states=["x"])
        run = solve(system, (start,), (0, 50))
        assert not run.success
        # It chatters along for a little while before that is certain.
        assert 0 <= run.t_end - start / (k - push) < 5e-3
        assert run.steps + run.rejected < 20_000
        assert "discontinuous where no surface is declared" in run.message
        assert "Radau" not in run.message


def test_11_8_friction_without_a_direction_ends_where_the_body_rests() -> None:
    """v' = -mu v/|v|: at rest after |v0|/mu, and nothing is known there."""
    rng = np.random.default_rng(10)
    speed = sqrt(X**2 + Y**2)
    for _ in range(DRAWS // 5 + 1):
        mu, v0 = rng.uniform(0.3, 3), rng.normal(size=2)
        run = solve(System({X: -mu * X / speed, Y: -mu * Y / speed}), v0, (0, 50))
        assert not run.success
        # It chatters along for a little while before that is certain.
        assert 0 <= run.t_end - float(np.hypot(*v0)) / mu < 5e-3
        assert run.steps + run.rejected < 20_000
        assert "Radau" not in run.message


@cache
def motor() -> System:
    """A relay on the position of a damped motor, b x'' = -c x' - k sgn x: its sign acts on x'' alone."""
    k = parameters(b=1.0, c=3.0, k=1.0)
    return System({X: Y, Y: -(k.c * Y + k.k * sign(X)) / k.b})


@cache
def ocean() -> System:
    """Mixing where salty water lies on fresh: two invisible folds meet on the line y = a x (Welander)."""
    k = parameters(a=0.8, b=0.5, k1=1.0)
    mixing = k.k1 * (1 + sign(Y - k.a * X)) / 2
    return System({X: 1 - X - mixing * X, Y: k.b - k.b * Y - mixing * Y})


def test_slow_spirals_that_begin_near_the_corner() -> None:
    """A run may begin anywhere in the law, as those of a map do; rows end as alone. Rates by closed forms."""
    rng = np.random.default_rng(9)
    for number in range(DRAWS):
        a, b, c = 10 ** rng.uniform(-0.5, 0.5, 3)
        p, q = rng.uniform(0.2, 0.8, 2)
        size = 10 ** rng.uniform(-3.3, -2.0)
        genes = ring(False), (p + size, q), {"a": a, "b": b, "p": p, "q": q}, (p, q), (a + b) / 2
        # x'' = -a sgn x - c x': a cycle of speed v loses 4 c v^2/(3 a) of it in 4 v/(2 a).
        relay = System({X: Y, Y: -a * sign(X) - c * Y}), (0.0, size), {}, (0.0, 0.0), c / 3
        for system, x0, values, corner, rate in (genes, relay):
            span, given = (0.0, 1e3 / rate), {"parameters": values, "max_events": 20_000}
            where = f"{number}: {values}, {a}, {c}, {size}"
            end = solve(system, x0, span, **given)
            assert "n**-1:" in end.message, f"{where}, {end.message}"
            told = float(end.message.split("halves every ")[1].split()[0])
            assert told == pytest.approx(np.log(2) / rate, rel=0.03), where
            rows = solve_many(system, [x0] * 2, span, zeno="continue", **given)
            assert rows.status == (Status.SUCCESS,) * 2, where
            np.testing.assert_allclose(rows.x, [corner] * 2, atol=1e-12)


def test_11_8_slow_spirals_around_two_folds() -> None:
    """v falls as exp(-c t/(3 b)), for ever: of shallow cycles a finite end was told."""
    rng = np.random.default_rng(11)
    for number in range(DRAWS):
        b, c, k = 10 ** rng.uniform(-0.5, 0.5, 3)
        values = {"b": b, "c": c, "k": k}
        given: dict[str, Any] = {"parameters": values, "max_events": 4000, "rtol": 1e-6, "atol": 1e-8 * k / c}
        start, span = (k * b / c**2, 0), (0, 90 * b / c)
        end = solve(motor(), start, span, **given)
        where = f"{number}: {values}, {end.message}"
        assert end.status is Status.MAX_EVENTS, where
        assert not end.accumulations, where
        told = float(end.message.split("halves every ")[1].split()[0])
        assert told == pytest.approx(3 * b * np.log(2) / c, rel=0.03), where
        on = solve(motor(), start, span, zeno="continue", **given)
        assert on.success, f"{number}: {values}, {on.message}"
        assert "the true one is" in on.message
        np.testing.assert_allclose(on.x_end, 0, atol=1e-12)
    for rtol in (1e-6, 1e-9):
        end = solve(ocean(), (0.9, 0.5), (0, 40), rtol=rtol, atol=0.01 * rtol, max_events=4000)
        assert end.status is Status.MAX_EVENTS
        assert "n**-1:" in end.message
        on = solve(ocean(), (0.9, 0.5), (0, 40), rtol=rtol, max_events=4000, zeno="continue")
        assert on.success
        np.testing.assert_allclose(on.x_end, [0.75, 0.6], atol=1e-12)


def test_11_8_what_is_watched_and_clocks_have_no_part_in_a_slow_spiral() -> None:
    """x'' = -c x' - sgn x: v falls as exp(-c t/3), with events of the user or ticks that move nothing too."""
    c = 0.2
    half, field = 3 * np.log(2) / c, {X: Y, Y: -c * Y - sign(X)}
    system, ticking = System(field), System(field, time_events=[TimeEvent("tick", period=0.05)])
    for whole, events, most in (
        (system, [Y], 4000), (system, [X, X + Y, lambda t, x: x[1] - x[0]], 8000), (ticking, [Y], 8000),
    ):  # fmt: skip
        end = solve(whole, (1, 0.3), (0, 1e5), events=events, max_events=most)
        assert end.status is Status.MAX_EVENTS
        told = float(end.message.split("halves every ")[1].split()[0])
        assert told == pytest.approx(half, rel=0.03)
        on = solve(whole, (1, 0.3), (0, 200), events=events, max_events=most, zeno="continue")
        assert on.success, on.message
        np.testing.assert_allclose(on.x_end, 0, atol=1e-12)
