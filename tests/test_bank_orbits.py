"""Multipliers of every orbit of the banks against central differences of the map over one period."""

import json
import re
from typing import Any

import numpy as np
import pytest
from bank import CASES, FILE

from filippov import System, solve, states
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.sensitivity.saltation import flow_derivative
from filippov.app.bank.build import Built, build
from filippov.app.bank.migrate.case import system
from filippov.model.symbols import Abs, exp

MORE = json.loads(FILE.with_name("more_cases.json").read_text(encoding="utf-8"))["cases"]
ALL = CASES | {case["id"]: case for case in MORE}
# An expectation of one of these names is one of a periodic motion.
ORBIT = re.compile(r"(?:limit_cycle_)?period|(?:\w+_)?multipliers?|floquet_\w+|poincare_\w+|a_grazing")
OTHER = {"sliding_multipliers", "moments_multipliers"}
OPTIONS: dict[str, dict[str, Any]] = {
    "R03_relay_single_sliding": {"symmetry": "odd"},
    "M04_pwm_low_pass": {"period": "1"},
    "M07_cycle_that_repels": {"period": 2 * np.pi},
}
PERIODIC = sorted(
    name for name, case in ALL.items()
    if any(ORBIT.fullmatch(entry["name"]) and entry["name"] not in OTHER for entry in case["expected"])
)  # fmt: skip
STIFF = "P03_lugre_stick_slip"


def problem(name: str) -> Built:
    return build(system(ALL[name]))


def differences(orbit: Orbit, steps: Any = 1e-4, **options: Any) -> Any:
    """Fourth order, of x after one period of the motion from x0."""

    def end(x: Any) -> Any:
        run = solve(
            orbit.system, x, (orbit.t0, orbit.t0 + orbit.period), zeno="continue", nonunique="stick",
            dense_output=False, parameters=orbit.parameters, **({"rtol": 1e-13, "atol": 1e-15} | options),
        )  # fmt: skip
        assert run.success
        return run.x_end

    weights = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
    sizes = np.broadcast_to(steps, orbit.x0.shape)
    columns = [
        sum(w * end(orbit.x0 + k * size * unit) for k, w in weights) / size
        for size, unit in zip(sizes, np.eye(len(sizes)), strict=True)
    ]
    return np.array(columns).T


def test_period_is_the_least_one() -> None:
    """The thermostat with a reset is seen to return after 16 turns."""
    item = problem("A04b_thermostat_automaton")
    period = 10 * np.log(11 / 8) + 10 * np.log(32 / 29)
    assert abs(find_orbit(item.system, item.x0).period - period) < 1e-10


def test_the_orbits_are_those_of_the_banks() -> None:
    known = "A04 B02 B05 F05 F06 F10 F13 M02 M04 M06 M07 P03 R03 R04 R05"
    assert sorted({name[:3] for name in PERIODIC}) == known.split()


@pytest.mark.parametrize("name", [name for name in PERIODIC if name != STIFF])
def test_multipliers_agree_with_central_differences(name: str) -> None:
    item = problem(name)
    orbit = find_orbit(item.system, item.x0, **OPTIONS.get(name, {}))
    numeric = differences(orbit)
    exact = flow_derivative(orbit.solution())
    assert exact.shape == numeric.shape
    assert np.max(np.abs(exact - numeric)) < 1e-6 * max(1.0, np.max(np.abs(exact)))
    values = list(orbit.multipliers) + ([] if orbit.trivial is None else [orbit.trivial])
    # Coefficients, not roots: a double multiplier in a Jordan block moves by the root of a rounding.
    assert np.max(np.abs(np.poly(np.array(values)) - np.poly(numeric))) < 1e-6


def test_multipliers_of_the_stiff_orbit_agree_with_central_differences() -> None:
    # LuGre's stick-slip in the extension y = x - t/10 of the spring, in which it is periodic.
    y, v, z = states("y v z")
    s0, g = 1e5, 1 + 0.5 * exp(-((v / 0.001) ** 2))
    rate = v - z * Abs(v) * s0 / g
    system = System({y: v - 0.1, v: -2 * y - (s0 * z + s0**0.5 * rate + 0.4 * v), z: rate})
    start = solve(system, (0, 0, 0), (0, 12), method="Radau", rtol=1e-10, atol=1e-12)
    orbit = find_orbit(system, start.x_end, method="Radau", rtol=1e-10, atol=1e-13)
    (wanted,) = [e["value"] for e in ALL[STIFF]["expected"] if e["name"] == "period"]
    assert abs(orbit.period - float(wanted)) < 1e-6
    numeric = differences(orbit, (1e-4, 3e-5, 1e-9), rtol=1e-10, atol=1e-13, method="Radau")
    values = np.append(orbit.multipliers, orbit.trivial)
    assert np.max(np.abs(np.poly(values) - np.poly(numeric))) < 1e-6
    assert np.max(np.abs(orbit.multipliers)) < 1e-12
