"""A multiplier that comes to the end of its set and turns back: sliding goes on, in spite of rounding."""

import itertools
import math

import numpy as np
import pytest
from sympy import Rational, sin

from filippov import Status, System, parameters, sign, solve, states, t
from filippov.models import get

x, y, z = states("x y z")
p = parameters(excess=0.0)
FIELDS = {
    # s = (1 + excess) sin t while x = 0: by time, by a state, by an oscillator; to an end that is no float.
    "time": (System({x: (1 + p.excess) * sin(t) - sign(x)}), (0.5,)),
    "state": (System({x: (1 + p.excess) * sin(y) - sign(x), y: 1 + 0 * x}), (0.5, 0)),
    "oscillator": (System({x: (1 + p.excess) * y - sign(x), y: z, z: -y}), (0.5, 0, 1)),
    "tenths": (
        System({x: Rational(13, 10) + (1 + p.excess) * sin(t) / 10 - Rational(7, 5) * sign(x)}), (0.5,)
    ),
}  # fmt: skip


@pytest.mark.parametrize("method", ["DOP853", "DP5", "Radau"])
@pytest.mark.parametrize("name", FIELDS)
def test_a_multiplier_that_touches_its_end_slides_on(name: str, method: str) -> None:
    system, x0 = FIELDS[name]
    run = solve(system, x0, (0, 20), method=method, rtol=1e-12, atol=1e-13)
    assert run.status is Status.SUCCESS, run.message
    assert [event.after[0] for event in run.events] == [0]
    times = np.linspace(8, 20, 25)
    expected = (1.3 + 0.1 * np.sin(times)) / 1.4 if name == "tenths" else np.sin(times)
    np.testing.assert_allclose(run.multiplier("x", times), expected, atol=1e-7)


@pytest.mark.parametrize("power", range(-15, -4))
@pytest.mark.parametrize("method", ["DOP853", "DP5", "Radau"])
def test_a_multiplier_that_goes_beyond_its_end_by_next_to_nothing(method: str, power: int) -> None:
    # Off the surface x rises by at most int (s - 1) dt = O(excess^1.5).
    excess = 10.0**power
    for (system, x0), rtol in itertools.product(FIELDS.values(), (1e-6, 1e-10)):
        run = solve(
            system, x0, (0, 20), parameters={"excess": excess}, method=method, rtol=rtol, atol=1e-2 * rtol
        )
        assert run.status is Status.SUCCESS, run.message
        assert np.max(np.abs(run.sol(np.linspace(8, 20, 25))[0])) < 10 * (excess + rtol) ** 1.5 + rtol


def test_a_start_at_the_end_of_the_set() -> None:
    run = solve(FIELDS["time"][0], (0,), (math.pi / 2, 10))
    assert run.success
    assert not run.events
    assert run.end_mode == (0,)


@pytest.mark.parametrize("beyond", [0.0, 1e-17, -1e-17, 1e-15, -1e-15, 1e-13, -1e-13, 1e-11, -1e-11])
@pytest.mark.parametrize("length", [1e-12, 1e-9, 1e-6])
def test_a_moment_around_break_away_is_only_short(beyond: float, length: float) -> None:
    """Rest with the multiplier within rounding of its end, and an infinite slope beyond it (beta = 1/2)."""
    x = 0.17858969124869198
    short = solve(
        get("hunting").build(), (x, 0, (0.4 - x) / 10 + beyond), (0, length), parameters={"beta": 0.5},
        rtol=1e-11, atol=1e-13, zeno="continue", nonunique="stick",
    )  # fmt: skip
    assert short.success, short.message
    assert short.x_end == pytest.approx([x, 0, (0.4 - x) / 10 + beyond + x * length], rel=0, abs=1e-9)
