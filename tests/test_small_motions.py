"""Motions of any size: the absolute tolerance knows the scale, or the message says that it decides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import Surface, System, parameters, sign, sin, solve, solve_many, states, t

x, v = states("x v")
p = parameters(F=0.1)
BLOCK = System({x: v, v: -x - p.F * sign(v)})
PLAIN = System(
    field=lambda t, x, p, s: [x[1], -x[0] - p.F * s[0]],
    surfaces=[Surface("v", lambda t, x, p: x[1])], states="x v", parameters={"F": 0.1},
)  # fmt: skip


def ends(amplitude, friction):
    """Where x'' = -x - F sgn(x') from rest at x = 1 rests: |x| falls by 2 F in every half turn of pi."""
    place, turns = amplitude, 0
    while abs(place) > friction:
        place, turns = -np.sign(place) * (abs(place) - 2 * friction), turns + 1
    return place, np.pi * turns


@pytest.mark.parametrize("system", [BLOCK, PLAIN])
@given(st.integers(0, 15), st.floats(0.06, 0.3), st.sampled_from([1e-7, 1e-9, 1e-11]))
def test_11_12_everything_scaled_has_the_same_relative_accuracy(system, decade, friction, rtol):
    """Dry friction is homogeneous: a start of 1e-15 as one of 1."""
    place, rest = ends(1.0, friction)
    if abs(abs(place) - friction) < 1e-3:
        return
    size = 10.0**-decade
    run = solve(system, (size, 0), (0, rest + 1), parameters={"F": friction * size}, rtol=rtol)
    assert run.success
    assert run.modes[-1] == "0"
    assert run.x_end[0] / size == pytest.approx(place, abs=300 * rtol)
    assert run.events[-1].t == pytest.approx(rest, abs=300 * rtol)
    assert "Near to 0" not in run.message


@pytest.mark.parametrize("lanes", [1, 8])
def test_11_12_lanes_of_mixed_sizes(lanes):
    """Each trajectory with its own tolerance; the order, counts and measures are those of the rows."""
    size = np.tile(10.0 ** -np.arange(0.0, 16.0), 5)
    place, rest = ends(1.0, 0.15)
    many = solve_many(
        BLOCK, np.stack([size, 0 * size], 1), (0, rest + 1), parameters={"F": 0.15 * size}, lanes=lanes,
        measure=lambda part: part.x,
    )  # fmt: skip
    assert np.all(many.success)
    assert np.allclose(many.x[:, 0] / size, place, atol=1e-7)
    assert np.array_equal(many.measured, many.x)
    assert np.all(many.events("v", "sliding entry") == 1)
    assert not any(many.message)


def test_11_12_a_given_tolerance_that_decides_is_said():
    """The amplitude of 1e-10 under atol = 1e-12, in a run and in an ensemble; not the one of 1."""
    run = solve(BLOCK, (1e-10, 0), (0, 12), parameters={"F": 1e-11}, atol=1e-12)
    assert "Near to 0 throughout: x (at most 1e-10, atol 1e-12), v" in run.message
    assert "give a smaller atol" in run.message
    many = solve_many(BLOCK, [(1e-10, 0), (1, 0)], (0, 12), parameters={"F": [1e-11, 0.1]}, atol=1e-12)
    assert "Near to 0 throughout" in many.message[0]
    assert many.message[1] == ""
    fine = solve(BLOCK, (1e-10, 0), (0, 12), parameters={"F": 1e-11}, atol=1e-20)
    assert "Near" not in fine.message


def test_11_12_one_small_component_among_others_is_said():
    """x of 1e-11 beside v of 1: not lowered for, but named."""
    system = System({x: 1e-11 * v - x, v: 1 - v})
    run = solve(system, (0, 0), (0, 3))
    assert run.options.atol == 1e-12
    assert "Near to 0 throughout: x (at most" in run.message
    assert "v (at most" not in run.message


def test_11_12_a_start_at_zero_takes_its_scale_from_the_force():
    """x'' = a cos t or a sin t from rest; with x = 1 + O(1) forces nothing changes."""
    for a in (1.0, 1e-6, 1e-12):
        run = solve(System({x: v, v: a * sin(t)}), (0, 0), (0, 3), rtol=1e-9)
        assert run.x_end[0] == pytest.approx(a * (3 - np.sin(3)), rel=1e-7)
        assert "Near" not in run.message
    assert solve(BLOCK, (1e-9, 0), (0, 12)).options.atol == 1e-12
    assert solve(BLOCK, (0.1, 0), (0, 12)).options.atol == 1e-12
    assert solve(System({x: 0 * x}), (0,), (0, 1)).options.atol == 1e-12


def test_11_12_a_motion_that_rests_is_not_called_small():
    """v is 0 while it sticks, and rounding is not a scale."""
    run = solve(BLOCK, (0.05, 0.0), (0, 5))
    assert run.modes == ("0",)
    assert "Near" not in run.message
