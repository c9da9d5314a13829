"""The width of a relay as an expression of parameters: the same as the number that it stands for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import Band, Solution, Surface, System, parameters, sign, solve, solve_many, states, t
from filippov.base.errors import ModelError

x, y = states("x y")
p = parameters(w=0.5, k=2, r=1)


def thermostat(width):
    """x falls at speed k above r and rises below it."""
    return System({x: -p.k * sign(x - p.r)}, surfaces=[Surface("relay", x - p.r, width=width)])


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_11_14_the_period_is_four_times_the_width_over_the_speed(method):
    """x runs between r - w and r + w at speed k: the period is 4 w/k, with w = 2 w0 k."""
    system = thermostat(2 * p.w * p.k)
    for w, k in ((0.5, 2), (0.1, 3), (1e-6, 1)):
        period = 4 * (2 * w * k) / k
        run = solve(system, (1.0,), (0, 4 * period), parameters={"w": w, "k": k}, method=method)
        up = run.events.of("relay", "crossing", 1).t
        assert len(up) == 4
        assert np.allclose(np.diff(up), period, rtol=1e-9)
        assert np.allclose(run.events.of("relay", "crossing", 1).x[:, 0], 1 + 2 * w * k, rtol=1e-12)


def test_11_14_lanes_have_their_own_widths():
    """Ends against the triangle wave of each."""
    w = np.linspace(0.05, 1.2, 64)
    for lanes in (1, 8):
        many = solve_many(thermostat(p.w), [(1.0,)] * 64, (0, 3.3), parameters={"w": w}, lanes=lanes)
        # From x = r downwards to r - w, up to r + w, ...: r - w tri(k t/w).
        phase = (2 * 3.3 / w + 1) % 4
        assert np.allclose(many.x[:, 0], 1 - w * (1 - np.abs(phase - 2)), atol=1e-10)


def oscillator(width):
    return System(
        {x: y, y: -x - p.k * sign(x - p.r) - abs(x - p.r) * y / 9},
        surfaces=[Surface("relay", x - p.r, width=width)],
    )


PAIR = oscillator(p.w**2 + p.k / 10), oscillator(0.26)
BANDS = tuple(system.with_comparator(Band(0.2)) for system in PAIR)


@given(st.floats(0.1, 2.5), st.floats(-3, 3), st.floats(-3, 3), st.sampled_from([PAIR, BANDS]))
def test_11_14_an_expression_is_the_number_that_it_stands_for(k, x0, y0, pair):
    """Also beside |h|, and in a comparator with a width of its own."""
    values = {"w": (0.26 - k / 10) ** 0.5, "k": k}, {"k": k}
    runs = [solve(system, (x0, y0), (0, 6.0), parameters=q) for system, q in zip(pair, values, strict=True)]
    assert runs[0].modes == runs[1].modes
    assert np.allclose(runs[0].events.t, runs[1].events.t, atol=1e-7)
    assert np.allclose(runs[0].x_end, runs[1].x_end, atol=1e-7)


def test_11_14_widths_are_checked(tmp_path):
    """Positive at the defaults and with the values of a run, free of states; refused by name."""
    for width, text in (
        (p.w - 1, "is -0.5.* at the default parameters, expected a number > 0"),
        (x, "is x, expected a number or an expression of parameters"),
        (p.w * t, "expression of parameters"),
        (-0.1, "expected a number >= 0"),
        (float("inf"), "expected a finite number"),
    ):
        with pytest.raises(ModelError, match=f"surface 'relay': width.*{text}"):
            thermostat(width)
    system = thermostat(p.w)
    with pytest.raises(ModelError, match="width = w is -1 with these parameters, expected a number > 0"):
        solve(system, (1.0,), (0, 1), parameters={"w": -1})
    with pytest.raises(ModelError, match="width = w is 0 with these parameters"):
        solve_many(system, [(1.0,)] * 3, (0, 1), parameters={"w": 0})
    some = solve_many(system, [(1.0,)] * 3, (0, 1), parameters={"w": [1, 0, 1]})
    assert some.success.tolist() == [True, False, True]
    assert "width = w is 0 with these parameters" in some.message[1]
    plain = Surface("r", lambda t, x, p: x[0], width=p.w)
    with pytest.raises(ModelError, match="h, radius or width is an expression"):
        System(field=lambda t, x, p, s: -s, surfaces=[plain], states="x")
    run = solve(system, (1.0,), (0, 2))
    read = Solution.load(run.save(tmp_path / "a.npz"))
    assert read.system == system
    with pytest.raises(ModelError, match="width = w is -1"):
        solve(read.system, (1.0,), (0, 1), parameters={"w": -1})


def test_a_surface_is_named_by_its_h_whatever_its_width():
    for width in (p.w, 0.5):
        system = thermostat(width)
        assert system.surface_place("x - r") == (0, 1)
        assert system.surface_place("r - x") == (0, -1)
