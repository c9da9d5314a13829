"""Corners that are slid on and stop being the only motion; spirals out of a corner; roots of multipliers."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from filippov import Status, Surface, System, parameters, sign, sin, solve, states, t

x, y, z = states("x y z")
p = parameters(a=1.0, b=1.0, T=1.0)
# s1' = -s1 + a (t/T)^b s2 and the same with 1 and 2 exchanged: an only motion while a (t/T)^b < 1.
GROWING = System({x: -sign(x) + (t / p.T) * sign(y), y: -sign(y) + (t / p.T) * sign(x)})


@pytest.mark.parametrize("plain", [False, True])
def test_F2_a_corner_that_stops_attracting_is_named_then(plain: bool) -> None:
    """From t = 1 on ++ and -- lead away as well; a start at t = 2 says the same."""
    field: Any = {x: -sign(x) + t * sign(y), y: -sign(y) + t * sign(x)}
    system = System(field)
    if plain:

        def f(time: float, q: Any, r: Any, s: Any) -> list[float]:
            return [-s[0] + time * s[1], -s[1] + time * s[0]]

        surfaces = [Surface("x", lambda time, q, r: q[0]), Surface("y", lambda time, q, r: q[1])]
        system = System(field=f, surfaces=surfaces, states=["x", "y"])
    run = solve(system, (0.1, 0.2), (0, 3))
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == pytest.approx(1, abs=1e-8)
    assert run.ambiguity is not None
    assert run.ambiguity.name == "ambiguous corner"
    late = solve(system, (0, 0), (2, 3))
    assert {c.mode for c in run.candidates} == {c.mode for c in late.candidates} == {(0, 0), (1, 1), (-1, -1)}


def test_F2_the_tree_has_the_motions_that_leave() -> None:
    """x = y = (t - 1)^2 / 2 after t = 1, the same with a minus, and rest; `stick` goes on."""
    system = System({x: -sign(x) + t * sign(y), y: -sign(y) + t * sign(x)})
    tree = solve(system, (0.1, 0.2), (0, 3), nonunique="branch")
    ends = sorted(leaf.solution.x_end[0] for leaf in tree.leaves())
    np.testing.assert_allclose(ends, [-2, 0, 2], atol=1e-7)
    rest = solve(system, (0.1, 0.2), (0, 3), nonunique="stick")
    assert rest.success
    assert np.all(rest.x_end == 0)


@given(st.floats(0.3, 2.5), st.booleans())
def test_F2_the_moment_is_that_of_the_rates(T: float, late: bool) -> None:
    """The rates of ++ turn outwards at t = T."""
    end = 1.2 * T if late else 0.95 * T
    run = solve(GROWING, (0, 0), (0, end), parameters={"T": T})
    assert run.status is (Status.NON_UNIQUE if late else Status.SUCCESS)
    assert run.t_end == pytest.approx(T if late else end, rel=1e-8)


SPIRAL = System(
    {x: p.a * sign(x - 1) - 2 * sign(y - 2), y: 2 * sign(x - 1) + p.b * sign(y - 2)},
    surfaces=[Surface("x", x - 1), Surface("y", y - 2)],
)


A, B, Q = sign(x), sign(y), parameters(r=0.5, c=0.2)
ENTERING = System({x: B - A, y: A * B - (1 + Q.r) * A + Q.r - 0.05 + Q.c * t})


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_F15_a_spiral_out_of_a_corner_is_named(a: float, b: float) -> None:
    """A cycle takes d to rho d, rho = ((2 + a)(2 + b) / ((2 - a)(2 - b)))^2: outwards where a + b > 0."""
    assume(abs(a + b) > 0.01)
    run = solve(SPIRAL, (1, 2), (0, 1), parameters={"a": a, "b": b})
    if a + b > 0:
        assert run.status is Status.NON_UNIQUE
        assert run.ambiguity is not None
        assert run.ambiguity.name == "spiral out of a corner"
    else:
        assert run.success
        assert run.modes == ("00",)


def test_F2_a_spiral_that_turns_from_in_to_out() -> None:
    system = System(
        {x: (t - 1) * sign(x) - 2 * sign(y), y: 2 * sign(x) + (t - 1) * sign(y)},
        surfaces=[Surface("x", x), Surface("y", y)],
    )
    run = solve(system, (0, 0), (0, 2))
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == pytest.approx(1, abs=1e-8)


def test_F8_a_spiral_backwards_from_rest() -> None:
    """Every cycle that runs into the corner ends there, so that from rest any of them can lead backwards."""
    start = solve(SPIRAL, (1.3, 2.2), (0, 3), parameters={"a": -1.0, "b": -1.0}, zeno="continue")
    assert start.success
    assert start.modes[-1] == "00"
    for x0, time in (((1, 2), 0.0), (start.x_end, 3.0)):
        run = solve(SPIRAL, x0, (time, time - 3), parameters={"a": -1.0, "b": -1.0}, backward=True)
        assert run.status is Status.NON_UNIQUE
        assert run.ambiguity is not None
        assert "spiral out of a corner" in run.ambiguity.name
        assert run.t_end == time


@settings(max_examples=max(settings().max_examples // 4, 5))
@given(st.floats(0.2, 0.6), st.floats(0.1, 0.5))
def test_F9_a_second_root_that_enters_the_box_is_named(total: float, speed: float) -> None:
    """a = b and b^2 - (1 + r) b + r - 0.05 + c t = 0: the larger root comes in at 1 as t = 0.05/c.

    The ends of the box are known to some 1e-7 of its width, and so is the time of entry.
    """
    run = solve(ENTERING, (0, 0), (0, 0.1 / speed), parameters={"r": total, "c": speed})
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == pytest.approx(0.05 / speed, abs=1e-6 * (1 - total) / speed)
    # The sign of x: its multiplier, or the mode where it does not slide.
    found = sorted(float(c.multipliers[0] if c.mode[0] == 0 else c.mode[0]) for c in run.candidates)
    np.testing.assert_allclose(found, [total, 1], atol=2e-6)


def test_F9_the_multiplier_is_the_root_that_the_run_followed() -> None:
    a, b = sign(x), sign(y)
    system = System(
        {
            x: -1.1 - 1.9 * a + 0.4 * b - 0.8 * a * b + 0.1 * sin(t),
            y: -0.8 - 1.2 * a + 0.7 * b + 1.4 * a * b - 0.8 * sin(t),
        }
    )
    run = solve(system, (0.3, 0.2), (0, 1.49))
    assert run.modes[-1] == "00"
    s = np.array([float(run.multiplier(name, 1.49)) for name in "xy"])
    ends = dict(zip(system.surface_names, run.end_multipliers, strict=True))
    np.testing.assert_allclose(s, [ends["x"], ends["y"]], atol=1e-9)
    assert s[1] == pytest.approx(-0.702, abs=5e-4)
    rate = [
        -1.1 - 1.9 * s[0] + 0.4 * s[1] - 0.8 * s[0] * s[1] + 0.1 * np.sin(1.49),
        -0.8 - 1.2 * s[0] + 0.7 * s[1] + 1.4 * s[0] * s[1] - 0.8 * np.sin(1.49),
    ]
    np.testing.assert_allclose(rate, 0, atol=1e-9)


