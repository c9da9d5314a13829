"""Backwards in time a relay with hysteresis does not switch: the sign that it had before is not determined.

x' = -a x + b - c s and y' = s with the relay s of x, width w. Every run backwards either ends by name at the
edge of the band, or is a solution: forwards from its end comes the state that it began with.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

from filippov import Status, Surface, System, parameters, sign, solve, solve_many, states

x, y = states("x y")
p = parameters(a=1.0, b=0.0, c=2.0, w=0.5)
FIXED = System({x: -p.a * x + p.b - p.c * sign(x), y: sign(x)}, surfaces=[Surface("relay", x, width=0.5)])
FREE = System({x: -p.a * x + p.b - p.c * sign(x), y: sign(x)}, surfaces=[Surface("relay", x, width=p.w)])
PLAIN = System(
    field=lambda t, x, p, s: [-p["a"] * x[0] + p["b"] - p["c"] * s[0], s[0]], states="x y", parameters=p,
    surfaces=[Surface("relay", lambda t, x, p: x[0], width=0.5)],
)  # fmt: skip
DRAWS = range({"nightly": 400}.get(os.environ.get("FILIPPOV_PROFILE", ""), 25))


def member(seed: int) -> tuple[dict[str, float], float, float]:
    rng = np.random.default_rng([41, seed])
    values = {"a": rng.uniform(-0.5, 1), "b": rng.uniform(-1, 1), "c": rng.uniform(-3, 3)}
    return values, rng.uniform(-1.5, 1.5), rng.uniform(0.1, 3)


@pytest.mark.parametrize("system", [FIXED, FREE, PLAIN], ids=["fixed", "parameter", "functions"])
def test_a_run_backwards_is_a_solution_or_ends_at_the_edge(system: System) -> None:
    ended = 0
    for seed in DRAWS:
        values, start, span = member(seed)
        given: dict[str, Any] = {"parameters": values, "rtol": 1e-10, "atol": 1e-12}
        back = solve(system, (start, 0), (span, 0), backward=True, **given)
        assert not back.events.of("relay").t.size, (seed, back.message)
        if back.success:
            forth = solve(system, back.x_end, (0, span), **given)
            if forth.modes[0] != back.modes[-1]:  # within the band a state does not tell the sign
                assert abs(back.x_end[0]) <= 0.5
                continue
            np.testing.assert_allclose(forth.x_end, [start, 0], atol=1e-6, err_msg=str(seed))
            continue
        ended += 1
        assert back.status is Status.NON_UNIQUE
        assert "'relay' is reached, where a relay at the edge of its band" in back.message
        assert abs(abs(back.x_end[0]) - 0.5) < 1e-9
        assert back.ambiguity.name == "before a relay"
    assert 2 <= ended <= len(DRAWS) - 2


def test_many_at_once_say_the_same() -> None:
    values, starts, span = member(3)[0], np.array([[x0, 0] for x0 in np.linspace(-1.5, 1.5, 13)]), (1.0, 0.0)
    single = [solve(FIXED, x0, span, backward=True, parameters=values) for x0 in starts]
    for lanes in (1, 8):
        many = solve_many(FIXED, starts, span, backward=True, parameters=values, lanes=lanes)
        assert list(many.status) == [run.status for run in single]
        np.testing.assert_allclose(many.x, [run.x_end for run in single], atol=1e-7)
