"""Resting contact on surfaces given by functions: their twins of expressions, closed forms."""

import math
import os
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from filippov import ModelError, Status, Surface, System, cos, parameters, sin, solve, states, t

DRAWS = {"default": 4, "ci": 12, "nightly": 300}[os.environ.get("FILIPPOV_PROFILE", "default")]
G = 9.81


@cache
def ball() -> tuple[System, System]:
    """A ball over a floor."""
    y, v = states("y v")
    p = parameters(e=0.5)
    floor = Surface("floor", y, reset={v: -p.e * v})
    plain = Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], -p.e * x[1]], contact=True)
    return (
        System({y: v, v: -G + 0 * y}, surfaces=[floor]),
        System(field=lambda t, x, p, s: [x[1], -G], surfaces=[plain], states="y v", parameters={"e": 0.5}),
    )


@cache
def table() -> tuple[System, System]:
    """A ball on a table at A sin(w t)."""
    y, v = states("y v")
    p = parameters(e=0.5, A=0.5, w=2.0)
    speed = p.A * p.w * cos(p.w * t)
    top = Surface("table", y - p.A * sin(p.w * t), reset={v: speed - p.e * (v - speed)})

    def after(t, x, p):
        u = p.A * p.w * math.cos(p.w * t)
        return [x[0], u - p.e * (x[1] - u)]

    plain = Surface("table", lambda t, x, p: x[0] - p.A * math.sin(p.w * t), reset=after, contact=True)
    values = {"e": 0.5, "A": 0.5, "w": 2.0}
    return (
        System({y: v, v: -G + 0 * y}, surfaces=[top]),
        System(field=lambda t, x, p, s: [x[1], -G], surfaces=[plain], states="y v", parameters=values),
    )


@cache
def pair() -> tuple[System, System]:
    """Two equal balls, one over the other, over a floor."""
    a, b, u, w = states("a b u w")
    p = parameters(e=0.5, k=0.5)
    mean, part = (u + w) / 2, p.k * (u - w) / 2
    surfaces = [
        Surface("floor", a, reset={u: -p.e * u}),
        Surface("contact", b - a, reset={u: mean - part, w: mean + part}),
    ]

    def struck(t, x, p):
        mean, part = (x[2] + x[3]) / 2, p.k * (x[2] - x[3]) / 2
        return [x[0], x[1], mean - part, mean + part]

    plain = [
        Surface(
            "floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], x[1], -p.e * x[2], x[3]],
            contact=True, linear=True,
        ),
        Surface("contact", lambda t, x, p: x[1] - x[0], reset=struck, contact=True, linear=True),
    ]  # fmt: skip
    return (
        System({a: u, b: w, u: -G + 0 * a, w: -G + 0 * a}, surfaces=surfaces),
        System(
            field=lambda t, x, p, s: [x[2], x[3], -G, -G], surfaces=plain, states="a b u w",
            parameters={"e": 0.5, "k": 0.5},
        ),
    )  # fmt: skip


def drawn(random: np.random.Generator, kind: str) -> tuple[list[float], dict[str, float]]:
    """A start and parameters."""
    values = {"e": float(random.choice([0.0, random.uniform(0.1, 0.7)]))}
    if kind == "pair":
        values["k"] = float(random.choice([0.0, random.uniform(0.1, 0.5)]))
        low = random.choice([0.0, random.uniform(0, 0.4)])
        return [low, low + random.uniform(0.1, 0.5), 0.0, 0.0], values
    if kind == "table":
        values |= {"A": random.uniform(0.2, 1), "w": random.uniform(1, 4)}
    return [random.uniform(0.05, 0.5), random.uniform(-1, 1)], values


@pytest.mark.parametrize("kind", [ball, table, pair])
def test_11_5_plain_functions_rest_like_their_twins(
    kind: Callable[[], tuple[System, System]],
) -> None:
    random = np.random.default_rng(5)
    twin, plain = kind()
    for k in range(DRAWS):
        start, values = drawn(random, kind.__name__)
        one, two = (solve(q, start, (0, 1.5), parameters=values, zeno="continue") for q in (twin, plain))
        assert two.status is one.status, (k, two.message)
        assert two.end_mode == one.end_mode, (k, start, values)
        assert two.x_end == pytest.approx(one.x_end, abs=1e-7), (k, start, values)
        if one.zeno is not None:
            assert two.zeno is not None
            assert two.zeno.t == pytest.approx(one.zeno.t, abs=1e-7)


def test_11_5_a_plain_ball_rests_at_the_time_of_its_limit() -> None:
    run = solve(ball()[1], (1, 0), (0, 3), zeno="continue")
    fallen = math.sqrt(2 / G)
    assert run.success
    assert run.zeno.t == pytest.approx(3 * fallen, abs=1e-9)
    assert run.x_end == pytest.approx([0, 0], abs=1e-12)
    # The multiplier is that of the twin: (1 - s)/2 is the acceleration by which the floor pushes.
    assert (1 - run.multiplier("floor", 2.9)) / 2 == pytest.approx(G, rel=1e-8)


def test_11_5_a_moving_plain_surface_is_followed_late_in_time_as_early() -> None:
    """Differences in time are no longer than the motion of the surface, however large the time is."""
    late = 400.0
    values = {"e": 0.0, "A": 0.4, "w": 3.0}
    start = (0.4 * math.sin(3 * late), 1.2 * math.cos(3 * late))
    for span in (0.2, 0.5):
        run = solve(table()[1], start, (late, late + span), parameters=values)
        assert run.success
        at = 3 * (late + span)
        assert run.x_end == pytest.approx([0.4 * math.sin(at), 1.2 * math.cos(at)], abs=1e-8)


@pytest.mark.parametrize(
    ("reset", "why"),
    [
        (lambda t, x, p: [x[0], 0.5 - x[1]], "changes h or dh/dt"),
        (lambda t, x, p: [x[0] + 1, -x[1]], "changes h or dh/dt"),
        (lambda t, x, p: [x[0], x[1]], "does not act on dh/dt"),
    ],
)
def test_11_5_a_reset_that_is_no_impact_has_no_contact(reset, why) -> None:
    floor = Surface("floor", lambda t, x, p: x[0], reset=reset, contact=True)
    system = System(field=lambda t, x, p, s: [x[1], -G], surfaces=[floor], states="y v")
    with pytest.raises(ModelError, match=why):
        solve(system, (0, 0), (0, 1), zeno="continue")


def test_11_5_without_contact_a_plain_surface_ends_the_run_by_name() -> None:
    floor = Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], -0.5 * x[1]])
    system = System(field=lambda t, x, p, s: [x[1], -G], surfaces=[floor], states="y v")
    run = solve(system, (1, 0), (0, 3), zeno="continue")
    assert run.status is Status.ZENO
    assert "contact=True" in run.message
