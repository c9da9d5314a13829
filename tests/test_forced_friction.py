"""Dry friction under two harmonics, which hold the block at rest in between: against matrix exponentials.

At rest the field is constant and only the multiplier moves, as fast as the forces do. The oracle gets the
harmonics as states of its own and looks at every hundredth of a second.
"""

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from linear_oracle import Answer, Linear, NotGenericError, solve_linear

from filippov import Surface, System, parameters, solve, states
from filippov.model.symbols import t
from filippov.solving.ensemble import solve_many

METHODS = {"DOP853": 1e-10, "DP5": 1e-9, "Radau": 1e-8}
END = 20.0
x, v = states("x v")
p = parameters(z=0.05, w=1.0, k=3.0, A=1.0, B=0.3, F=0.5)
FORCE = p.A * sp.cos(p.w * t) + p.B * sp.sin(p.k * p.w * t)
SYSTEM = System({x: v, v: -2 * p.z * v - x + FORCE - p.F * sp.sign(v)}, surfaces=[Surface("contact", v)])


def linear(z: float, w: float, k: float, A: float, B: float, F: float) -> Linear:
    """The same with (cos w t, sin w t, cos k w t, sin k w t) as states 2 to 5."""
    rows = np.zeros((6, 6))
    rows[0, 1], rows[1, :2], rows[1, 2], rows[1, 5] = 1.0, (-1.0, -2 * z), A, B
    for first, rate in ((2, w), (4, k * w)):
        rows[first, first + 1], rows[first + 1, first] = -rate, rate
    jump = np.array([[0.0, -F, 0, 0, 0, 0]])
    return Linear(rows, np.zeros(6), jump, np.array([[0.0, 1, 0, 0, 0, 0]]), np.zeros(1))


# Two of three motions come somewhere too close to something for the oracle, which takes its time.
CHOOSY = settings(
    max_examples=max(settings().max_examples // 4, 5), suppress_health_check=[HealthCheck.filter_too_much]
)


@st.composite
def shaken(draw: st.DrawFn) -> tuple[dict[str, float], float, Answer]:
    value = draw(
        st.fixed_dictionaries({
            "z": st.floats(0, 0.2), "w": st.floats(2, 12), "k": st.integers(2, 4), "A": st.floats(0.2, 3),
            "B": st.floats(0, 0.5), "F": st.floats(0.5, 1.5),
        })
    )  # fmt: skip
    start = draw(st.floats(-1, 1))
    try:
        answer = solve_linear(linear(**value), np.array([start, 0.1, 1, 0, 1, 0]), END, most=200)
    except NotGenericError:
        assume(False)
    return value, start, answer


@pytest.mark.parametrize("method", METHODS)
@CHOOSY
@given(case=shaken())
def test_every_stop_and_every_slip(method: str, case: tuple[dict[str, float], float, Answer]) -> None:
    value, start, answer = case
    rtol = METHODS[method]
    got = solve(
        SYSTEM, (start, 0.1), (0, END), parameters=value, method=method, rtol=rtol, atol=1e-2 * rtol
    )
    assert got.success, got.message
    assert [event.after for event in got.events] == [mode for _, _, mode in answer.events]
    scale = 300 * rtol * (1 + np.max(np.abs(got.y)))
    times = np.array([time for time, _, _ in answer.events])
    assert np.all(np.abs(got.events.t - times) <= scale * np.maximum(answer.times, 1.0))
    assert np.all(np.abs(got.x_end - answer.final[:2]) <= scale * answer.state)


@CHOOSY
@given(case=shaken())
def test_every_stop_and_every_slip_in_lanes(case: tuple[dict[str, float], float, Answer]) -> None:
    value, start, answer = case
    x0 = np.tile([start, 0.1], (9, 1))
    ends = solve_many(SYSTEM, x0, (0, END), parameters=value, lanes=8, rtol=1e-10, atol=1e-12)
    assert np.all(ends.counts.sum(axis=(1, 2)) == len(answer.events))
    scale = 300 * 1e-10 * (1 + np.max(np.abs(answer.final)))
    assert np.all(np.abs(ends.x - answer.final[:2]) <= scale * answer.state)
