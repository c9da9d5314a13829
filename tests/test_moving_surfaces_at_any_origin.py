"""Surfaces that move, far from t = 0 in units of their own motion: no excursion is taken for rounding."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

from filippov import Surface, System, parameters, sign, sin, solve, solve_many, states, t

DRAWS = {"nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 12)
x, y = states("x y")
p = parameters(a=1.0, w=1.0, t0=0.0, k=1.0, v=0.0)
phase = p.w * (t - p.t0)
# y gains 1 a radian above the wave, and loses 1 below it.
WATCHED = System(
    {x: 0 * x, y: p.w * sign(x - p.a * sin(phase))}, surfaces=[Surface("wave", x - p.a * sin(phase))]
)
# x is led onto the wave and follows it, y is the integral of the multiplier.
FOLLOWED = System(
    {x: p.w * (p.v - p.k * sign(x - p.a * sin(phase))), y: p.w * sign(x - p.a * sin(phase))},
    surfaces=[Surface("wave", x - p.a * sin(phase))],
)


def drawn(seed: int) -> tuple[np.random.Generator, dict[str, float], float]:
    """Draws, the parameters of a wave, and the rounding of its phase."""
    rng = np.random.default_rng((13, seed))
    w, radians = 10 ** rng.uniform(-4, 4), 10 ** rng.uniform(6, 8.5)
    given = {"a": float(10 ** rng.uniform(-2, 2)), "w": float(w), "t0": float(radians / w)}
    return rng, given, float(np.spacing(given["t0"]) * w)


@pytest.mark.parametrize("many", [False, True])
def test_no_excursion_across_a_wave_is_lost(many: bool) -> None:
    for seed in range(DRAWS):
        rng, given, rounding = drawn(seed)
        depth = float(10 ** rng.uniform(-3, -0.5))
        start, end = (given["a"] * (1 - depth), 0.0), given["t0"] + 6 * math.pi / given["w"]
        if many:
            rows = solve_many(WATCHED, [start] * 2, (given["t0"], end), parameters=given, lanes=1)
            assert np.all(rows.success), seed
            got = rows.x[0]
        else:
            run = solve(WATCHED, start, (given["t0"], end), parameters=given)
            assert run.success, seed
            assert [str(e.kind) for e in run.events] == ["crossing"] * 6, seed
            got = run.x_end
        below = 2 * math.acos(1 - depth)
        assert got[1] == pytest.approx(3 * (2 * math.pi - 2 * below), abs=1e-6 + 50 * rounding / below), seed


def test_a_wave_is_met_and_followed() -> None:
    for seed in range(DRAWS):
        rng, given, rounding = drawn(seed)
        given["k"] = given["a"] * float(rng.uniform(1.5, 3.0))
        given["v"] = given["a"] * float(rng.uniform(-0.4, 0.4))
        above = float(rng.uniform(0.1, 1.0))
        end = given["t0"] + 5.0 / given["w"]
        run = solve(FOLLOWED, (given["a"] * above, 0), (given["t0"], end), parameters=given, rtol=1e-7)
        assert run.success, seed
        assert [str(e.kind) for e in run.events] == ["sliding entry"], seed
        speed = (given["v"] - given["k"]) / given["a"]
        low, high = 0.0, 5.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if above + speed * middle > math.sin(middle) else (low, middle)
        integral = (given["v"] * (5 - low) - given["a"] * (math.sin(5) - math.sin(low))) / given["k"]
        close = 1e-5 + 100 * rounding
        assert (run.events[0].t - given["t0"]) * given["w"] == pytest.approx(low, abs=close), seed
        assert run.x_end / [given["a"], 1] == pytest.approx([math.sin(5), low + integral], abs=close), seed


@pytest.mark.parametrize("slope", [1e-17, 5e-18, 0.1 + 0.2 - 0.3, 1e-15, 1e-13, 1e-10])
@pytest.mark.parametrize("origin", [0, 0.3, 1, -40])
def test_a_slope_that_is_rounding_moves_no_state(slope: float, origin: float) -> None:
    """h = sin(t - origin), beside which y weighs nothing: y' = -y goes on as it is."""
    timed = System({x: 1 + sign(sin(t - origin) + slope * y), y: -y})
    run = solve(timed, (0.3, 1), (origin - 1, origin + 2))
    assert run.x_end == pytest.approx([0.3 + 2 * 2, math.exp(-3)], abs=1e-9)


def test_what_follows_the_end_of_a_run_is_not_in_it() -> None:
    """A surface that is reached a millisecond after the end of a short run, in seconds since 1970."""
    falling = System({x: -1 + 0 * x, y: sign(x)})
    run = solve(falling, (1.001e-2, 0), (1.7e9, 1.7e9 + 9.8e-3))
    assert len(run.events) == 0
    assert run.end_mode == (1,)
    assert run.x_end[0] == pytest.approx(2.1e-4, abs=1e-6)
