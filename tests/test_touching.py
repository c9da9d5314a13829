"""A multiplier that comes to the end of its set and turns back: sliding goes on, in spite of rounding."""

import itertools
import math

import numpy as np
import pytest
from sympy import Rational, sin

from filippov import Status, System, parameters, sign, solve, states, t

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
