"""Roots that the dense output has and the solution has not: steps that are long beside a layer."""

import numpy as np

from filippov import Parameter, Surface, System, cos, parameters, sign, solve, states, t

x, v, y = states("x v y")
p = parameters(L=Parameter(100.0, lower=1e-9), w=Parameter(1e-6, lower=1e-12), a=1.0, b=1.0)


def test_15_1_a_layer_that_is_never_left_has_no_event_and_is_not_moved_onto_its_edge() -> None:
    """y - v = h0 exp(-L t) stays within |y - v| < w, however long the steps are that x and v allow.

    An explicit step of L dt = 15 may end near 0 and be 1e8 times as far from it in between.
    """
    force = -x + p.a * cos(p.b * t)
    upper, lower = y - v - p.w, y - v + p.w
    beyond = 2 * (sign(upper) + 1) - 2 * (1 - sign(lower))
    system = System(
        {x: v, v: force, y: force - p.L * (y - v) - beyond},
        surfaces=[Surface("upper", upper), Surface("lower", lower)],
    )
    for seed in range(300):
        rng = np.random.default_rng(seed)
        rtol = 10 ** rng.uniform(-11, -7)
        w, L = rtol * 10 ** rng.uniform(2, 4), 10 ** rng.uniform(1, 3)
        h0, start = w * rng.uniform(-0.9, 0.9), rng.uniform(-1, 1)
        given = {"L": L, "w": w, "a": rng.uniform(0.5, 2), "b": rng.uniform(0.3, 0.9)}
        run = solve(
            system, (rng.uniform(-1, 1), start, start + h0), (0, 5), parameters=given, rtol=rtol,
            atol=1e-3 * rtol, max_steps=3000,
        )  # fmt: skip
        assert run.success, (seed, run.message)
        assert not run.events, (seed, run.events[0])
        assert abs(run.x_end[2] - run.x_end[1]) < w
