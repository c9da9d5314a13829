"""Forced orbits whose events pass the phase that their state is taken at, against maps in closed form."""

import math
import os
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import brentq, fsolve

from filippov.analysis.bifurcations.branch import Branch
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.switch import switch
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.models import registry

Array = np.ndarray
ZETA, F, E = 0.05, 1.0, 0.8


def jacobian(step: Callable[[Array], Array], at: Array) -> Array:
    """Derivative by differences of order 4."""
    reach = 1e-4 * np.maximum(np.abs(at), 1e-2)
    rows = []
    for k in range(at.size):
        moved = [step(at + m * reach[k] * np.eye(at.size)[k]) for m in (-2, -1, 1, 2)]
        rows.append((moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * reach[k]))
    return np.array(rows).T


def impact(omega: float, wall: float, at: Array) -> Array:
    """(time, speed after) of an impact -> the next one, less a period in time: sines and exponentials."""
    start, speed = at
    force = F / complex(1 - omega**2, 2 * ZETA * omega)
    rate = complex(-ZETA, math.sqrt(1 - ZETA**2))

    def state(t: float) -> tuple[float, float]:
        wave, first = (force * np.exp(1j * omega * q) for q in (t, start))
        x, v = wall - first.real, speed - (1j * omega * first).real
        b = (v + ZETA * x) / rate.imag
        free = complex(x, -b) * np.exp(rate * (t - start))
        return float((wave + free).real), float((1j * omega * wave + rate * free).real)

    t = start + 0.02
    while state(t + 0.01)[0] < wall:
        t += 0.01
    t = brentq(lambda q: state(q)[0] - wall, t, t + 0.01, xtol=1e-15)
    return np.array([t - 2 * math.pi / omega, -E * state(t)[1]])


def buck(p: dict[str, float], x: Array) -> Array:
    """(v, i) at the start of a ramp -> at the next: off above the ramp, on below it, matrix exponentials."""
    matrix = np.zeros((3, 3))
    matrix[:2, :2] = [[-1 / (p["R"] * p["C"]), 1 / p["C"]], [-1 / p["L"], 0]]
    on = matrix.copy()
    on[1, 2] = p["Vin"] / p["L"]
    y = np.append(x, 1.0)

    def control(t: float) -> float:
        ramp = p["VL"] + (p["VU"] - p["VL"]) * t / p["T"]
        return float(p["a"] * ((scipy.linalg.expm(matrix * t) @ y)[0] - p["Vref"]) - ramp)

    t = brentq(control, 0, p["T"], xtol=1e-18)
    return np.asarray((scipy.linalg.expm(on * (p["T"] - t)) @ scipy.linalg.expm(matrix * t) @ y)[:2])


def doubling(
    step: Callable[[float], Callable[[Array], Array]], guess: Array, low: float, high: float
) -> float:
    """The parameter at which a fixed point of the map has the multiplier -1."""

    def test(value: float) -> float:
        at = fsolve(lambda q: step(value)(q) - q, guess, xtol=1e-12)
        return float(np.linalg.det(jacobian(step(value), at) + np.eye(2)))

    return float(brentq(test, low, high, xtol=1e-9 * high))


def follow(name: str, parameter: str, bounds: tuple[float, float], transient: float) -> Continuation:
    model = registry.get(name)
    orbit = find_orbit(model.build(), model.x0, transient=transient)
    run = continuation(model.build(), orbit, parameter=parameter, bounds=bounds)
    run.run()
    return run


def whole(branch: Branch, bounds: tuple[float, float]) -> bool:
    """Whether the branch goes from bound to bound."""
    return sorted((branch.values[0], branch.values[-1])) == sorted(bounds)


def test_12_8_an_impact_passes_the_phase_of_the_orbit() -> None:
    run = follow("impact_oscillator", "omega", (2.0, 4.0), 200.0)
    (found,) = run.branch.special
    assert found.special == "period doubling"
    assert len({point.phase for point in run.branch.points}) > 1
    assert whole(run.branch, run.bounds)
    expected = doubling(lambda omega: partial(impact, omega, 0.0), np.array([1.11, -0.36]), 2.6, 2.7)
    assert found.value == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize(
    ("parameter", "bounds"), [("T", (3.5e-4, 5e-4)), ("Vin", (19.0, 26.0)), ("VL", (3.5, 5.0))]
)
def test_12_8_a_clock_keeps_its_distance_from_the_phase(parameter: str, bounds: tuple[float, float]) -> None:
    run = follow("buck_pwm", parameter, bounds, 0.1)
    (found,) = run.branch.special
    assert found.special == "period doubling"
    assert whole(run.branch, run.bounds)
    names = registry.get("buck_pwm").build().parameters
    values = dict(zip(names.names, names.resolve(None).tolist(), strict=True))
    low, high = ((a + b) / 2 for a, b in ((found.value, bounds[0]), (found.value, bounds[1])))
    expected = doubling(
        lambda value: partial(buck, {**values, parameter: value}), np.array([12.0, 0.55]), low, high
    )
    assert found.value == pytest.approx(expected, rel=1e-8)


def test_12_8_the_branch_of_the_doubled_orbit_starts_at_the_phase_of_its_point() -> None:
    run = follow("impact_oscillator", "omega", (2.0, 4.0), 200.0)
    (found,) = run.branch.special
    doubled = switch(run, found, bounds=(2.6, 2.72), direction=1, max_points=8).run()
    last = doubled.points[-1]
    assert last.period == pytest.approx(4 * math.pi / last.value, rel=1e-12)
    assert last.coordinates["min x"] < run.at(last.value)[0].coordinates["min x"] - 1e-3
    # Two impacts of different speed: a fixed point of the second iterate, not of the first.
    step = partial(impact, last.value, 0.0)
    model = registry.get("impact_oscillator")
    values = {"omega": last.value}
    again = find_orbit(model.build(), np.array(last.u), parameters=values, t0=last.phase * last.period)
    event = next(e for e in again.events if e.kind == "reset")
    assert event.x_after is not None
    at = np.array([event.t, event.x_after[1]])
    assert step(step(at)) == pytest.approx(at, abs=1e-7)
    assert abs(step(at)[1] - at[1]) > 1e-3


SUPPLIES = np.linspace(26.0, 400.0, 60) if os.environ.get("FILIPPOV_PROFILE") == "nightly" else (100.0, 250.0)


@pytest.mark.parametrize("supply", SUPPLIES)
def test_12_13_an_orbit_that_repels_strongly_is_found_from_the_motion_around_it(supply: float) -> None:
    """Largest multipliers from -1.2 to -35, from a state of the chaotic motion."""
    model = registry.get("buck_pwm")
    system = model.build()
    orbit = find_orbit(system, model.x0, parameters={"Vin": supply}, period="T", transient=0.02)
    names = system.parameters
    values = dict(zip(names.names, names.resolve({"Vin": supply}).tolist(), strict=True))
    step = partial(buck, values)
    clock = next(e for e in orbit.events if e.kind == "time event")
    at = fsolve(lambda q: step(q) - q, clock.x[:2], xtol=1e-13)
    assert clock.x[:2] == pytest.approx(at, rel=1e-8)
    expected = np.linalg.eigvals(jacobian(step, at))
    assert orbit.multipliers[0] == pytest.approx(expected[np.argmax(np.abs(expected))], rel=1e-6)
    assert orbit.period == pytest.approx(values["T"], rel=1e-12)
