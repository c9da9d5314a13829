"""A surface that resets from both sides and lets pass: a rocking block comes to rest between its feet."""

import math
import os
from typing import Any

import numpy as np
import pytest

from filippov import Status, Surface, System, parameters, sign, solve, solve_many, states, t

DRAWS = {"default": 6, "ci": 20, "nightly": 1000}[os.environ.get("FILIPPOV_PROFILE", "default")]
q, w = states("q w")
p = parameters(k=1.0, c=1.0, r=0.9, u=0.0)
foot = Surface("foot", q, reset={w: p.r * w}, side="both")
block = System({q: w, w: p.k * (q - p.c * sign(q)) + p.u * t}, surfaces=[foot])


def rest_time(start: float, k: float, c: float, r: float) -> float:
    """The limit of the impacts of q'' = k (q - c sgn q) from (start, 0)."""
    rate, depth = math.sqrt(k), start / c
    total = math.acosh(1 / (1 - depth))
    speed = math.sqrt(depth * (2 - depth)) * r
    while speed > 1e-17:
        total += 2 * math.atanh(speed)
        speed *= r
    return total / rate


def draw(random: np.random.Generator) -> tuple[float, dict[str, float]]:
    values = {"k": random.uniform(0.3, 9), "c": random.uniform(0.2, 3), "r": random.uniform(0.5, 0.93)}
    return values["c"] * random.uniform(-0.9, 0.9), values


def plain(values: dict[str, float]) -> System:
    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [x[1], p.k * (x[0] - p.c * s[0])]

    foot = Surface("foot", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], p.r * x[1]], side="both")
    return System(field=field, surfaces=[foot], states="q w", parameters=values)


def test_a_rocking_block_rests_at_the_limit_of_its_impacts() -> None:
    random = np.random.default_rng(4)
    for k in range(DRAWS):
        start, values = draw(random)
        ends = rest_time(abs(start), values["k"], values["c"], values["r"])
        span, options = (0, ends + 1), {"parameters": values, "zeno": "continue"}
        runs = [solve(block, (start, 0), span, **options)]
        if k % 3 == 0:
            runs.append(solve(plain(values), (start, 0), span, zeno="continue"))
            runs.append(solve(block, (start, 0), span, backend="python", **options))
        for run in runs:
            assert run.success, run.message
            assert run.zeno.t == pytest.approx(ends, abs=1e-6)
            assert run.x_end.tolist() == pytest.approx([0, 0], abs=1e-12)
            assert run.events[-1].kind == "sliding entry"


def test_batches_rest_too() -> None:
    ends = [rest_time(a, 1, 1, 0.8) for a in (0.1, 0.5)]
    many = solve_many(block, [(0.1, 0), (0.5, 0)], (0, max(ends) + 1), parameters={"r": 0.8}, zeno="continue")
    assert all(status is Status.SUCCESS for status in many.status)
    assert np.abs(many.x).max() < 1e-12


def test_a_block_that_is_tipped_later_is_not_held_for_good() -> None:
    """The push u t exceeds k c at t = 10: from there q = u (sinh(t - 10) - (t - 10))."""
    run = solve(block, (0.1, 0), (0, 12), parameters={"u": 0.1, "r": 0.5}, zeno="continue")
    assert run.success
    assert run.events[-1].kind == "sliding exit"
    assert run.events[-1].t == pytest.approx(10, abs=1e-9)
    assert run.x_end == pytest.approx([0.1 * (math.sinh(2) - 2), 0.1 * (math.cosh(2) - 1)], abs=1e-7)
    held = solve(block, (0.1, 0), (0, 9), parameters={"u": 0.1, "r": 0.5}, zeno="continue")
    assert held.success
    assert held.x_end.tolist() == [0, 0]


def test_plain_functions_that_are_tipped_later_end_at_the_limit() -> None:
    """Sliding of second order takes derivatives of formulas: the run says that it ends there."""
    foot = Surface("foot", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], 0.5 * x[1]], side="both")
    tipped = System(
        field=lambda t, x, p, s: [x[1], x[0] - s[0] + 0.1 * t], surfaces=[foot], states="q w"
    )
    run = solve(tipped, (0.1, 0), (0, 20), zeno="continue")
    assert run.status is Status.ZENO
    assert run.t_end < 10
