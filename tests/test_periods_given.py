"""A period given for an orbit of a forced system: multiples of the forcing's, which follow the parameters.

The steady answer of x'' + c x' + x = a cos(w t) has the amplitude a/sqrt((1 - w^2)^2 + (c w)^2).
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

from filippov import Heaviside, Surface, System, UsageError, cos, parameters, sin, states, t
from filippov.analysis import attractors, continuation, find_orbit
from filippov.analysis.steady.forcing import depends_on_time

x, v = states("x v")


def forced(force: Callable[[Any], Any], c: float, w: float) -> System:
    p = parameters(w=w)
    return System({x: v, v: -x - c * v + force(p.w)}, parameters=p)


def amplitude(c: float, w: float) -> float:
    return 1 / sqrt((1 - w**2) ** 2 + (c * w) ** 2)


@pytest.mark.parametrize("seed", range(2))
def test_a_number_follows_the_frequency(seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, w, count = rng.uniform(0.1, 0.5), rng.uniform(1.5, 3.0), int(rng.integers(1, 4))
    system = forced(lambda w: cos(w * t), c, 1.0)
    orbit = find_orbit(system, (0, 0), parameters={"w": w}, period=count * 2 * pi / w)
    assert abs(orbit.amplitude["x"] - amplitude(c, w)) < 1e-9
    branch = continuation(system, orbit, parameter="w", bounds=(1.3, 3.2)).run()
    assert {branch.values[0], branch.values[-1]} == {1.3, 3.2}
    assert not branch.special
    for point in branch.points:
        assert abs(point.coordinates["amplitude x"] - amplitude(c, point.value)) < 1e-8
        assert abs(max(map(abs, point.multipliers)) - np.exp(-c * point.coordinates["period"] / 2)) < 1e-8


@pytest.mark.parametrize("method", ["DOP853", "collocation"])
def test_the_same_at_other_parameters_and_by_collocation(method: str) -> None:
    system = forced(lambda w: cos(w * t), 0.2, 2.0)
    orbit = find_orbit(system, (0, 0), period=pi, method=method)
    other = find_orbit(system, orbit, parameters={"w": 2.5}, method=method)
    assert abs(other.period - 2 * pi / 2.5) < 1e-12
    assert abs(other.amplitude["x"] - amplitude(0.2, 2.5)) < 1e-6


@pytest.mark.parametrize("period", [3.0, 3.14159, pi / 2, 1.5 * pi, "2*pi/w + 1", "pi/w"])
def test_what_is_no_period_of_the_forcing_is_refused(period: float | str) -> None:
    # x(t + T) = x(t) at one t alone is no periodic solution.
    system = forced(lambda w: cos(w * t), 0.2, 2.0)
    with pytest.raises(UsageError, match=r"the forcing repeats after 3\.14159265359 at these parameters"):
        find_orbit(system, (0, 0), period=period)
    with pytest.raises(UsageError, match="expected a multiple"):
        attractors(system, {"x": (-1, 1), "v": (-1, 1)}, period=period, samples=4)


@pytest.mark.parametrize("force", [
    lambda w: cos(w * t) ** 2, lambda w: abs(sin(w * t)), lambda w: Heaviside(sin(w * t) ** 2 - 0.5),
    lambda w: sin(w * t) * cos(w * t),
])  # fmt: skip
def test_half_of_the_period_that_is_read_off(force: Callable[[Any], Any]) -> None:
    # The equations of these repeat after pi/w; a solution over one period is checked at other times, too.
    system = forced(force, 0.3, 2.0)
    for count in (1, 2, 3):
        orbit = find_orbit(system, (0.1, 0.1), period=count * pi / 2)
        run = orbit.solution(periods=2.5)
        ends = [run.sol(run.t[0] + at) for at in (0.3, 0.3 + pi / 2)]
        assert np.allclose(*ends, rtol=0, atol=1e-8)
    with pytest.raises(UsageError, match="expected a multiple"):
        find_orbit(system, (0.1, 0.1), period=pi / 3)


def test_absolute_values_of_one_side_do_not_repeat_after_half_a_period() -> None:
    system = forced(lambda w: Heaviside(sin(w * t)), 0.3, 2.0)
    with pytest.raises(UsageError, match="expected a multiple"):
        find_orbit(system, (0.1, 0.1), period=pi / 2)
    assert abs(find_orbit(system, (0.1, 0.1), period=pi).period - pi) < 1e-12


def plain(c: float, w: float) -> System:
    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [x[1], -x[0] - c * x[1] + np.cos(p.w * t)]

    return System(field=field, states="x v", parameters={"w": w})


def test_the_period_of_plain_functions_is_compared_with_their_values() -> None:
    system = plain(0.2, 2.0)
    orbit = find_orbit(system, (0, 0), period=pi)
    assert abs(orbit.amplitude["x"] - amplitude(0.2, 2.0)) < 1e-9
    assert abs(find_orbit(system, (0, 0), period=2 * pi).period - pi) < 1e-12
    for period in (3.0, 3.14159, pi / 2):
        with pytest.raises(UsageError, match=r"the equations do not repeat after that time where w = 2\."):
            find_orbit(system, (0, 0), period=period)
    with pytest.raises(UsageError, match=r"period is 3\.14159265359, .* period='2\*pi/omega'"):
        continuation(system, orbit, parameter="w", bounds=(1.5, 3.0)).run()


def test_a_formula_follows_the_frequency_of_plain_functions() -> None:
    system = plain(0.2, 2.0)
    orbit = find_orbit(system, (0, 0), period="2*pi/w")
    branch = continuation(system, orbit, parameter="w", bounds=(1.5, 3)).run()
    assert {branch.values[0], branch.values[-1]} == {1.5, 3.0}
    for point in branch.points:
        assert abs(point.coordinates["amplitude x"] - amplitude(0.2, point.value)) < 1e-8


@pytest.mark.parametrize("unit", [1e-15, 1e-9, 1.0, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_a_period_of_plain_functions_is_compared_in_any_unit(unit: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, w, wrong = rng.uniform(0.1, 0.5), rng.uniform(1.5, 3.0), rng.uniform(0.3, 0.9)

    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [x[1], -x[0] - c * x[1] + unit * np.cos(w * t)]

    system = System(field=field, states="x v")
    assert depends_on_time(system)
    with pytest.raises(UsageError, match="the equations do not repeat after that time"):
        find_orbit(system, (0, 0), period=wrong * 2 * pi / w)
    orbit = find_orbit(system, (0, 0), period=2 * pi / w, atol=1e-13 * unit)
    assert abs(orbit.amplitude["x"] / unit / amplitude(c, w) - 1) < 1e-8


@pytest.mark.parametrize(
    ("field", "depends"),
    [
        (lambda t, x, p, s: [-x[0] + 1e-14 * np.cos(t)], True),
        (lambda t, x, p, s: [-x[0] + (np.cos(t) if x[0] > 0.8 else 0)], True),
        (lambda t, x, p, s: [-x[0] + t * (1 - s[0])], True),
        (lambda t, x, p, s: [-x[0] - s[0]], False),
        (lambda t, x, p, s: [np.log(x[0] - 5)], False),
    ],
)
def test_plain_functions_are_asked_for_t_at_states_of_every_size(field: Any, depends: bool) -> None:
    surface = Surface("a", lambda t, x, p: x[0] - 3)
    assert depends_on_time(System(field=field, states="x", surfaces=[surface])) is depends
