"""Taylor's method where a part of the field is flat at first, with a peak or a step ahead: closed forms.

x' = v and y' = a f((x - c)/w), so that y is a w (F(end) - F(start))/v with F the integral of f.
"""

import math
import os
from collections.abc import Callable

import numpy as np
import pytest
from sympy import Expr, atan

from filippov import System, exp, parameters, sign, sin, solve, sqrt, states, tanh

x, y = states("x y")
p = parameters(a=1.0, c=0.0, w=1.0, v=1.0)
u = (x - p.c) / p.w
DRAWS = {"nightly": 1000}.get(os.environ.get("FILIPPOV_PROFILE", ""), 150)
# Half of the parts are flat from afar in all terms of their series but not in the ratios of these.
PARTS: dict[str, tuple[Expr, Callable[[float], float]]] = {
    "peak of a power": ((1 + u**2) ** -1.5, lambda u: u / math.hypot(1, u)),
    "peak of a quotient": (1 / (1 + u**2), math.atan),
    "root": (u / sqrt(1 + u**2), lambda u: math.hypot(1, u)),
    "tanh": (tanh(u), lambda u: abs(u) + math.log1p(math.exp(-2 * abs(u)))),
    "logistic": (1 / (1 + exp(-u)), lambda u: max(u, 0) + math.log1p(math.exp(-abs(u)))),
    "atan": (atan(u), lambda u: u * math.atan(u) - 0.5 * math.log1p(u * u)),
    "bell": (exp(-(u**2)), lambda u: 0.5 * math.sqrt(math.pi) * math.erf(u)),
    "wave": (sin(u), lambda u: -math.cos(u)),
}


@pytest.mark.parametrize("name", PARTS)
def test_what_is_ahead_is_not_stepped_over(name: str) -> None:
    part, whole = PARTS[name]
    system, draw = System({x: p.v + 0 * x, y: p.a * part}), np.random.default_rng(len(name))
    for _ in range(DRAWS):
        given = {
            "a": 10 ** draw.uniform(-2, 2), "c": draw.uniform(-8, 8),
            "w": 10 ** draw.uniform(-2 if name == "wave" else -3.5, 0.7),
            "v": 10 ** draw.uniform(-1, 1),
        }  # fmt: skip
        rtol = 10 ** draw.uniform(-13, -4)
        run = solve(
            system, (-10, 0), (0, 20 / given["v"]), parameters=given, method="Taylor", rtol=rtol,
            atol=1e-3 * rtol, dense_output=False,
        )  # fmt: skip
        ends = [whole((at - given["c"]) / given["w"]) for at in (-10, 10)]
        share = given["a"] * given["w"] / given["v"]
        error = abs(float(run.x_end[1]) - share * (ends[1] - ends[0]))
        assert error < 1e4 * rtol * share * (1 + sum(map(abs, ends))), (given, rtol)


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_terms_that_are_rounding_show_no_singularity(seed: int) -> None:
    """In sliding friction with sign(w) w for |w| the series of its decay are rounding, whose growth says
    nothing: steps fell below the spacing of t. The same with abs(w) by DOP853.
    """
    x, v, y, w = states("x v y w")
    low = (0.5, 0.2, 5, 0.01, 1, 0.5, 0.5, 0.3)
    high = (2, 1, 40, 0.3, 3, 1.5, 3, 2)
    top, bit, k, c, more, least, b, speed = np.random.default_rng(seed).uniform(low, high).tolist()

    def drill(size: Expr) -> System:
        twist = k * (x - y) + c * (v - w)
        torque = sign(w) * (least + more * exp(-b * size))
        return System({x: v, v: (3 * (speed - v) - twist) / top, y: w, w: (twist - torque) / bit})

    start, span = (0.3, speed, 0, 0.5 * speed), (0, 15)
    run = solve(drill(sign(w) * w), start, span, method="Taylor", rtol=1e-9, atol=1e-11)
    assert run.success
    known = solve(drill(abs(w)), start, span, rtol=1e-11, atol=1e-13)
    assert run.x_end == pytest.approx(known.x_end, abs=1e-6)
    assert run.steps < known.steps
