"""Least periods of forced and clocked orbits, against maps iterated by hand and closed forms.

A clock that resets a decaying state makes any map of the line: x' = -b x between ticks of period T, so that
the state after a tick goes to F(x exp(-b T)). What is asked for is a multiple of the least period, the phase
is on or off a tick, and period and multipliers have to be those of the least period.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import Surface, System, TimeEvent, parameters, solve, states, t
from filippov.analysis import Stroboscope, attractors, find_orbit
from filippov.analysis.diagrams.orbit_diagram import orbit_diagram
from filippov.analysis.diagrams.orbit_points import orbit_points
from filippov.analysis.orbits.oddness import repeats

X, Y = states("x y")
# Parameters of r x (1 - x) with an attracting cycle of the period.
CYCLES = {1: (2.7, 1.7), 2: (3.2, 3.37), 3: (3.83, 3.84), 4: (3.5, 3.52), 5: (3.739, 3.7385),
          6: (3.6275, 3.627)}  # fmt: skip


class Draw:
    """Choices with a seed."""

    def __init__(self, seed: int) -> None:
        self.numbers = np.random.default_rng(seed)

    def choice(self, among: list[Any]) -> Any:
        """One of these."""
        return among[int(self.numbers.integers(len(among)))]

    def uniform(self, low: float, high: float) -> float:
        """A number between these."""
        return float(self.numbers.uniform(low, high))


def _cycle(r: float, period: int) -> tuple[list[float], float]:
    """Points of the attracting cycle of r x (1 - x), and its multiplier."""
    x = 0.4
    for _ in range(40_000):
        x = r * x * (1 - x)
    points = [x]
    for _ in range(period - 1):
        points.append(r * points[-1] * (1 - points[-1]))
    assert abs(r * points[-1] * (1 - points[-1]) - x) < 1e-12
    return points, math.prod(r * (1 - 2 * q) for q in points)


def _logistic(r: object, decay: float, tick: float) -> System:
    """A system whose state after a tick goes to r x (1 - x)."""
    grown = math.exp(decay * tick) * X
    q = parameters(r=r)
    clock = TimeEvent("tick", period=tick, reset={"x": q.r * grown * (1 - grown)})
    return System({X: -decay * X}, time_events=[clock], parameters=q)


@pytest.mark.parametrize("seed", range(14))
def test_logistic_cycles(seed: int) -> None:
    draw = Draw(seed)
    period = draw.choice(list(CYCLES))
    r = draw.choice(CYCLES[period])
    # A state that is held between ticks is the case of no decay.
    decay, tick = draw.choice([0.0, 0.3, 1.0, 2.0]), draw.choice([0.5, 1.0, 1.7, math.pi])
    system = _logistic(r, decay, tick)
    points, multiplier = _cycle(r, period)
    phase = draw.choice([0.0, 0.0, 0.5, 0.31])
    multiple = draw.choice([1, 2, 3, 4])
    asked = None if draw.uniform(0, 1) < 0.3 else period * multiple * tick
    begin = points[0] + 1e-7
    run = solve(system, (begin,), (0.0, tick * (200 * period + phase)), dense_output=False)
    orbit = find_orbit(system, run.x_end, t0=run.t_end, period=asked)
    assert orbit.period == pytest.approx(period * tick, rel=1e-9)
    assert orbit.multipliers[0].real == pytest.approx(multiplier, rel=1e-5, abs=1e-6)
    # The state is one of the cycle's.
    late = math.ceil(orbit.t0 / tick) * tick - orbit.t0
    after = float(orbit.x0[0]) * math.exp(-decay * late) * math.exp(decay * tick)
    assert min(abs(r * after * (1 - after) - q) for q in points) < 1e-6
    again = find_orbit(system, orbit)
    assert again.period == pytest.approx(period * tick, rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_linear_maps_under_a_clock(seed: int) -> None:
    draw = np.random.default_rng(seed)
    rates, tick = draw.uniform(-1.0, -0.1, 2), float(draw.choice([0.5, 1.0, 2.0]))
    matrix, shift = draw.uniform(-0.9, 0.9, (2, 2)), draw.uniform(-1, 1, 2)
    rows = matrix @ np.array([X, Y]) + shift
    clock = TimeEvent("tick", period=tick, reset={"x": rows[0], "y": rows[1]})
    system = System({X: float(rates[0]) * X, Y: float(rates[1]) * Y}, time_events=[clock])
    for multiple in (1, 2, 3, 4, 5, 6, 8, 9, 30):
        orbit = find_orbit(
            system, (0.3, -0.2), period=multiple * tick, nodes=int(draw.choice([1, 1, 2, 3])),
            transient=float(draw.choice([0.0, 3.0, 0.37])) * tick,
        )  # fmt: skip
        assert orbit.period == pytest.approx(tick, rel=1e-9), multiple
        values = np.linalg.eigvals(matrix @ np.diag(np.exp(rates * tick)))
        assert sorted(np.abs(orbit.multipliers)) == pytest.approx(sorted(np.abs(values)), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_forcing_of_one_harmonic_only(seed: int) -> None:
    """Products of waves of the least common frequency that hold its k-th harmonic only."""
    draw = Draw(seed)
    rate, w = draw.uniform(0.05, 0.4), draw.choice([1.0, 0.5, 2.0, 3.0])
    c, s = sympy.cos(w * t), sympy.sin(w * t)
    force, k = draw.choice([
        (c**2, 2), (s * c + 1, 2), (sympy.Abs(s), 2), (sympy.Abs(c), 2), (4 * c**3 - 3 * c, 3),
        (8 * c**4 - 8 * c**2, 4), (s**2 * c**2, 4), (c**2 + s / 7, 1), (sympy.Abs(s) + c / 9, 1),
        (c + 0.5 * s**2, 1), (s * sympy.Abs(s), 1), (4 * c**3 - 3 * c + sympy.sin(3 * w * t) ** 2, 3),
    ])  # fmt: skip
    system = System({X: -rate * X + force})
    nominal = 2 * math.pi / w
    least = nominal / k
    multiple = draw.choice([1, 2, 3])
    asked = None if multiple == 1 else multiple * nominal
    orbit = find_orbit(system, (0.5,), period=asked, t0=draw.choice([0.0, 0.7, nominal / 4]))
    assert orbit.period == pytest.approx(least, rel=1e-9), (force, k)
    assert orbit.multipliers[0].real == pytest.approx(math.exp(-rate * least), rel=1e-7)
    # The waves themselves, at many instants.
    f = sympy.lambdify(t, force, "numpy")
    times = np.linspace(0, nominal, 97)
    assert np.allclose(f(times), f(times + least), atol=1e-12)


def test_two_clocks_that_are_one() -> None:
    one, two = (TimeEvent(n, period=2, start=s, reset={"x": X + 1}) for n, s in (("a", 0), ("b", 1)))
    orbit = find_orbit(System({X: -X}, time_events=[one, two]), (0.5,))
    assert orbit.period == pytest.approx(1)
    assert orbit.multipliers[0].real == pytest.approx(math.exp(-1))
    other = TimeEvent("b", period=2, start=1, reset={"x": X + 1.001})
    assert find_orbit(System({X: -X}, time_events=[one, other]), (0.5,)).period == pytest.approx(2)


def test_a_part_of_the_period_at_these_parameters_only() -> None:
    """The orbit is to be followed in the parameter, where its period is the whole one."""
    q = parameters(a=0.0)
    orbit = find_orbit(System({X: -X + q.a * sympy.cos(t) + sympy.cos(2 * t)}, parameters=q), (0.5,))
    assert orbit.period == pytest.approx(2 * math.pi)
    free = parameters(a=0.3, w=2.0)
    system = System({X: -X + free.a * sympy.cos(free.w * t) ** 2}, parameters=free)
    assert find_orbit(system, (0.5,)).period == pytest.approx(math.pi / 2)


def test_a_state_at_rest_under_a_clock() -> None:
    clock = TimeEvent("tick", period=1, reset={"x": 1.5 * X})
    orbit = find_orbit(System({X: -X}, time_events=[clock]), (0.2,), period=6, transient=90)
    assert orbit.period == pytest.approx(1)
    assert orbit.multipliers[0].real == pytest.approx(1.5 * math.exp(-1))


def test_unstable_cycles_beside_the_stable_one() -> None:
    """Newton's method from the fixed point that has lost its stability, asked for twice its period."""
    system = _logistic(3.2, 1.0, 1.0)
    fixed = (1 - 1 / 3.2) * math.exp(-0.5)
    orbit = find_orbit(system, (fixed,), t0=0.5, period=2)
    assert orbit.period == pytest.approx(1)
    assert orbit.multipliers[0].real == pytest.approx(2 - 3.2)
    # Just after the doubling the two points of the cycle are near to each other, and two all the same.
    r = 3.0001
    points = [(r + 1 + sign * math.sqrt((r - 3) * (r + 1))) / (2 * r) for sign in (1, -1)]
    orbit = find_orbit(_logistic(r, 1.0, 1.0), (points[0],), period=2)
    assert orbit.period == pytest.approx(2)
    assert orbit.multipliers[0].real == pytest.approx(4 + 2 * r - r * r, rel=1e-6)


@pytest.mark.parametrize("method", ["DOP853", "collocation"])
def test_by_either_method(method: str) -> None:
    system = _logistic(3.2, 1.0, 1.0)
    orbit = find_orbit(system, (0.513,), period=4, method=method)
    assert orbit.period == pytest.approx(2)
    assert orbit.multipliers[0].real == pytest.approx(0.16, rel=1e-6)


@pytest.mark.parametrize("decay", [0.0, 1.0])
@pytest.mark.parametrize("r", [2.7, 3.2, 3.5, 3.83])
def test_attractors_of_a_sampled_map(r: float, decay: float) -> None:
    period = {2.7: 1, 3.2: 2, 3.5: 4, 3.83: 3}[r]
    (found,) = attractors(_logistic(r, decay, 1.0), {"x": (0.1, 0.9)}, samples=20).attractors
    points, multiplier = _cycle(r, period)
    # A held state at its fixed point never moves.
    still = period == 1 and decay == 0
    assert (found.kind, found.period) == (("equilibrium", None) if still else ("periodic", period))
    assert found.multipliers[0].real == pytest.approx(multiplier, rel=1e-6)
    assert np.sort(found.states[:, 0]) == pytest.approx(sorted(points), abs=1e-7)


def test_attractor_whose_forcing_has_a_shorter_period() -> None:
    (found,) = attractors(System({X: -0.3 * X + sympy.cos(t) ** 2}), {"x": (-1, 5)}, samples=10).attractors
    assert (found.kind, found.period) == ("periodic", 1)
    assert found.duration == pytest.approx(math.pi)


@pytest.mark.parametrize("plain", [False, True])
def test_shifts_of_a_system(plain: bool) -> None:
    """A small part of another period is seen; so is one that acts where the orbit is not."""
    one, size = np.array([]), np.array([1.0, 0.0])
    period = 2 * math.pi

    def system(x: object, y: object) -> System:
        if not plain:
            return System({X: x, Y: y})
        row = sympy.lambdify((t, X, Y), [x, y], "math")
        return System(field=lambda at, z, p, s: row(at, *z), states="x y")

    c = sympy.cos(t)
    for x, y, same in (
        (c**2 - X, -Y, True),
        (c**2 - X, -Y + c * Y, False),
        (c**2 - X + c * Y**2, -Y, False),
        (c**2 + 1e-9 * c - X, -Y, False),
        (c**2 - X**3, Y * sympy.sin(2 * t), True),
    ):
        assert repeats(system(x, y), one, size, 0.3, period, period / 2) is same
        assert repeats(system(x, y), one, size, 0.3, period, period)


@pytest.mark.parametrize("seed", range(6))
def test_resets_that_repel(seed: int) -> None:
    """x runs from 0 to 1 and is reset; y goes to q + m (y - q) in a round. Starts are off the orbit y = q."""
    draw = Draw(seed)
    high, m, q = draw.uniform(1.5, 2.7), draw.choice([-1, 1]) * draw.uniform(1.2, 1.6), draw.uniform(-2, 2)
    period = math.log(high / (high - 1))
    # Between resets y - q falls to (1 - 1/high) of what it is.
    back = Surface("s", X - 1, side="-", reset={X: 0 * X, Y: q + m * high / (high - 1) * (Y - q)})
    system = System({X: high - X, Y: -(Y - q)}, surfaces=[back])
    for away in (1e-4, 0.01, -0.05, 0.1):
        orbit = find_orbit(system, (0.0, q + away))
        assert orbit.period == pytest.approx(period, rel=1e-8)
        assert orbit.multipliers[0].real == pytest.approx(m, rel=1e-6)
    for count in (1, 2, 4):
        asked = find_orbit(system, (0.0, q + 1e-4), period=count * period)
        assert asked.period == pytest.approx(period, rel=1e-8)


@pytest.mark.parametrize(("power", "whole"), [(2, 1), (4, 1), (2, 3)])
def test_strobes_longer_than_the_least_period(power: int, whole: int) -> None:
    """x' = -a x + cos(t)**2 or cos(t)**4 is back after pi, looked at once in 2 pi or three times in it."""
    q = parameters(a=0.5)
    system = System({X: -q.a * X + sympy.cos(t) ** power}, parameters=q)
    mean, second, fourth = {2: (0.5, 0.5, 0.0), 4: (0.375, 0.5, 0.125)}[power]

    def exact(a: float, at: float) -> float:
        return mean / a + sum(
            size * (a * math.cos(k * at) + k * math.sin(k * at)) / (a * a + k * k)
            for k, size in ((2, second), (4, fourth))
        )

    strobe = Stroboscope("x", period=2 * math.pi / whole)
    orbit = find_orbit(system, (1.0,))
    assert orbit.period == pytest.approx(math.pi, rel=1e-9)
    points = orbit_points(strobe, orbit)
    # Back at a strobe after 2 pi / 1 or 3 * 2 pi / 3, two turns each.
    assert [point.period for point in points] == pytest.approx([2 * math.pi] * whole)
    assert [point.slope for point in points] == pytest.approx([math.exp(-math.pi)] * whole, rel=1e-6)
    places = {round(exact(0.5, 2 * math.pi * k / whole), 7) for k in range(whole)}
    assert {round(point.d, 7) for point in points} == places
    diagram = orbit_diagram(system, strobe, "a", (0.4, 0.5, 0.6), (1.0,), transient=3)
    for a, found in zip(diagram.values, diagram.points, strict=True):
        wanted = [exact(a, 2 * math.pi * k / whole) for k in range(whole)]
        assert sorted(point.d for point in found) == pytest.approx(sorted(wanted), rel=1e-6)
