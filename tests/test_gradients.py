"""Gradients of functions h: a wrong one is refused by name, a right one is not, at kinks and at any scale."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import Surface, System, solve, solve_many
from filippov.base.errors import ModelError


def friction(gradient=None, h=lambda t, x, p: x[1], **more):
    def field(t, x, p, s):
        return [x[1], -x[0] - 0.3 * s[0]]

    return System(field=field, surfaces=[Surface("slip", h, gradient=gradient, **more)], states="x v")


def test_11_11_the_sign_of_a_gradient_at_the_start():
    """Not NON_UNIQUE, which the turned rates look like: h = v, gradient (0, -1)."""
    wrong = friction(lambda t, x, p: [0, -1])
    text = r"surface 'slip': gradient gives -1 for dh/dv, but h has the slope 1 at t = 0, x = 0.2, v = 0"
    for call in (
        lambda: solve(wrong, (0.2, 0.0), (0, 5)),
        lambda: solve_many(wrong, [(0.2, 0.0)] * 3, (0, 5)),
        lambda: solve(wrong, (0.2, 0.0), (0, 5), nonunique="branch"),
    ):
        with pytest.raises(ModelError, match=text):
            call()


def test_11_11_a_gradient_that_is_wrong_only_where_events_are():
    """h = x**2 + v - 1/2 and 2 x forgotten: right at x = 0, where the run begins."""
    h, gradient = (lambda t, x, p: x[0] ** 2 + x[1] - 0.5), (lambda t, x, p: [0, 1])
    with pytest.raises(ModelError, match="gradient gives 0 for dh/dx, but h has the slope"):
        solve(friction(gradient, h), (0.0, 3.0), (0, 5))
    with pytest.raises(ModelError, match="gradient gives 0 for dh/dx, but h has the slope"):
        solve_many(friction(gradient, h), [(0.0, 3.0)] * 2, (0, 1.3))


def test_11_11_linear_that_is_not():
    """The slopes taken once hold nowhere else."""
    bent = friction(None, lambda t, x, p: x[1] + x[0] ** 2 - 1, linear=True)
    with pytest.raises(ModelError, match=r"linear=True, and dh/dx was .* Leave linear out"):
        solve(bent, (0.0, 3.0), (0, 5))


@pytest.mark.parametrize("slope", [1.0, -1.0, 0.3])
def test_11_11_at_a_kink_of_h_either_slope_is_right(slope):
    """h = v + |x|/2 from x = 0."""
    h = lambda t, x, p: x[1] + 0.5 * abs(x[0])  # noqa: E731
    right = friction(lambda t, x, p: [0.5 * (np.sign(x[0]) or slope), 1], h)
    assert solve(right, (0.0, 1.0), (0, 5)).success


def test_11_11_where_h_ends_nothing_is_said():
    """h = x sqrt(x) - 1/8 from x = 0, with its gradient: differences to one side do not exist."""

    def h(t, x, p):
        if x[0] < 0:
            raise ValueError("outside")
        return x[0] ** 1.5 - 0.125

    surface = Surface("level", h, gradient=lambda t, x, p: [1.5 * x[0] ** 0.5], kind="observer")
    system = System(field=lambda t, x, p, s: [1.0], surfaces=[surface], states="x")
    run = solve(system, (0.0,), (0, 1))
    assert run.events.t == pytest.approx([0.25], abs=1e-9)


SIZE = st.floats(-8, 8).map(lambda q: 10.0**q)
PLACE = st.one_of(st.floats(0.1, 3), st.floats(-3, -0.1))


@given(SIZE, SIZE, st.tuples(*[st.floats(-3, 3)] * 4), st.tuples(PLACE, PLACE), st.integers(0, 1))
def test_11_11_any_smooth_h_at_any_scale(size, length, c, x, entry):
    """h = size (sin(a u) + b w + c u w + d) with u, w in units of `length`: what is wrong alone fails."""

    def h(t, x, p):
        u, w = x[0] / length, x[1] / length
        return size * (np.sin(c[0] * u) + c[1] * w + c[2] * u * w + c[3])

    def slopes(t, x, p):
        u, w = x[0] / length, x[1] / length
        return np.array([c[0] * np.cos(c[0] * u) + c[2] * w, c[1] + c[2] * u]) * (size / length)

    def off(t, x, p):
        g = slopes(t, x, p)
        g[entry] += 1e-3 * max(abs(g).max(), size / length)
        return g

    def run(gradient):
        surface = Surface("s", h, gradient=gradient, kind="observer")
        still = System(field=lambda t, x, p, s: [0.0, 0.0], surfaces=[surface], states="x y")
        return solve(still, (x[0] * length, x[1] * length), (0, 0))

    assert run(slopes).success
    with pytest.raises(ModelError, match="surface 's': gradient gives"):
        run(off)


LOCAL = {
    "step": np.tanh,
    "bell": lambda u: 1 / (1 + u * u),
    "wave": lambda u: np.sin(8 * u) / 8,
}


@pytest.mark.parametrize("far", [100.0, 1e6])
@pytest.mark.parametrize("shape", LOCAL)
@pytest.mark.parametrize("along", ["time", "state", "beside"])
@pytest.mark.parametrize("derivative", ["dual", "difference"])
def test_a_level_that_varies_over_lengths_far_shorter_than_its_argument(derivative, along, shape, far):
    """x' = -2 s, y' = s on h = x - V: s = -V'/2 while it slides, so y ends at -(V(2) - V(-3))/2.

    V moves with the time, with a state z' = 1 that starts far from 0, or with one beside a far larger state.
    """
    level = LOCAL[shape]
    if derivative == "difference":
        level = lambda u: LOCAL[shape](float(u))  # noqa: E731 - a float takes no dual numbers
    h = {
        "time": lambda t, x, p: x[0] - level(t - far),
        "state": lambda t, x, p: x[0] - level(x[2] - far),
        "beside": lambda t, x, p: x[0] - level(x[2]),
    }[along]
    start = {"time": (far - 3, -3.0), "state": (0.0, far - 3), "beside": (0.0, -3.0)}[along]
    system = System(
        field=lambda t, x, p, s: [-2 * s[0], s[0], 1.0, 0.0],
        surfaces=[Surface("h", h)],
        states="x y z w",
    )
    x0 = (level(-3.0), 0.0, start[1], far if along == "beside" else 0.0)
    run = solve(system, x0, (start[0], start[0] + 5), rtol=1e-7)
    assert run.success
    assert run.modes == ("0",)
    # The argument is rounded to far times 1e-16, and slopes to about its square root.
    assert run.x_end[1] == pytest.approx(-(level(2.0) - level(-3.0)) / 2, abs=1e-6)
