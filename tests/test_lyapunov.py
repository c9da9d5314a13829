"""Exponents against closed forms and Floquet multipliers; brute-force diagrams against known cycles."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from bank import case

from filippov import Surface, System, UsageError, solve, states
from filippov.analysis.diagrams.brute_force import brute_force
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.sensitivity.lyapunov import lyapunov
from filippov.app.cli.main import main
from filippov.model.symbols import sign
from filippov.models import get


def test_smooth_linear_system() -> None:
    x, y = states("x y")
    got = lyapunov(System({x: -0.3 * x + y, y: -2 * y}), (1, 1), 60, interval=1.0)
    assert got.exponents == pytest.approx([-0.3, -2.0], abs=0.02)


def test_baker_map_by_resets() -> None:
    """z' = 1 with z -> z - 1 at 1, where x -> 2 x: a factor of 2 per unit of time, exponent log 2."""
    x, z = states("x z")
    tick = Surface("tick", 1 - z, reset={z: z - 1, x: 2 * x})
    got = lyapunov(System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick]), (1e-15, 0.25), 100, interval=1.0)
    assert got.exponents[0] == pytest.approx(math.log(2), abs=1e-6)
    assert got.exponents[1] == pytest.approx(0.0, abs=1e-6)


def test_relay_cycle_has_the_logarithms_of_its_multipliers() -> None:
    system = case("R05_relay_oscillator_no_sliding").system
    start = solve(system, (0, 0.3, 0.15), (0, 60), rtol=1e-10).x_end
    orbit = find_orbit(system, start)
    got = lyapunov(system, orbit.x0, 60 * orbit.period, interval=orbit.period)
    wanted = np.sort(np.log(np.abs([orbit.trivial, *orbit.multipliers])) / orbit.period)[::-1]
    assert got.exponents[:2] == pytest.approx(wanted[:2], abs=2e-3)


def test_sliding_loses_an_exponent() -> None:
    x, y = states("x y")
    got = lyapunov(System({x: -sign(x) + 0.1 * y, y: -y}), (0.5, 0.2), 30, interval=3.0, transient=5.0)
    assert got.exponents[0] == pytest.approx(-1.0, abs=0.02)
    assert got.exponents[1] == -math.inf


def test_brute_force_finds_the_stable_cycle_and_then_none() -> None:
    model = get("hunting")
    section = Section.from_model(model)
    got = brute_force(model.build(), section, "P", [10.0, 20.0, 22.0], 0.2, transient=150, keep=8)
    assert np.abs(got.d[0]) == pytest.approx(np.full(8, 0.252304806412), abs=1e-7)
    assert got.d[0, 0] == pytest.approx(-got.d[0, 1], abs=1e-7)
    assert got.period.tolist()[:2] == [2, 2]
    assert np.max(np.abs(got.d[2])) < 1e-6
    followed = brute_force(
        model.build(), section, "P", [10.0, 12.0], 0.2, transient=120, keep=4, follow=True
    )
    assert np.abs(followed.d[0]) == pytest.approx(np.full(4, 0.252304806412), abs=1e-7)


def test_bad_requests_are_named() -> None:
    x, y = states("x y")
    system = System({x: y, y: -x - sign(y)})
    with pytest.raises(UsageError, match="0 < interval <= duration"):
        lyapunov(system, (1, 0), 1.0, interval=2.0)
    with pytest.raises(UsageError, match="number is 3"):
        lyapunov(system, (1, 0), 2.0, interval=1.0, number=3)
    model = get("hunting")
    with pytest.raises(UsageError, match="did you mean 'P'"):
        brute_force(model.build(), Section.from_model(model), "p", [1.0], 0.1)


def test_pulse_width_modulation_from_period_one_to_chaos() -> None:
    # Both smooth modes contract areas by exp(-t/(R C)), and the comparator only switches the supply.
    model = get("buck_pwm")
    system, period = model.build(), 400e-6
    for supply, chaotic in ((20.0, False), (33.0, True)):
        got = lyapunov(
            system, model.x0, 100 * period, interval=period, transient=50 * period, parameters={"Vin": supply}
        )
        assert got.exponents[:2].sum() == pytest.approx(-1 / (22 * 47e-6), rel=1e-6)
        assert bool(got.exponents[0] > 100) is chaotic
        assert got.exponents[2] == -math.inf


def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--json", "--quiet", "-o", str(tmp_path)]
    run = ["lyapunov", "buck_pwm", "-p", "Vin=20", "--duration", "8e-3", "--interval", "4e-4"]
    assert main([*run, "--number", "2", *out]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["exponents"]) == 2
    run = ["diagram", "hunting", "--parameter", "P", "--values", "10", "22", "--count", "3", "--start", "0.2"]
    assert main([*run, "--transient", "150", "--keep", "4", *out]) == 0
    assert json.loads(capsys.readouterr().out)["period"][0] == 2
    names = {f"{name}.{end}" for name in ("exponents", "diagram") for end in ("json", "csv", "png")}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert main(["lyapunov", "buck_pwm", "--duration", "1"]) == 2
    assert main(["diagram", "hunting"]) == 2


@pytest.mark.parametrize("interval", [0.5, 1.0, 2.0])
def test_intervals_that_graze_count_in_neither_growth_nor_time(interval: float) -> None:
    """x' = -0.3 x beside an oscillator that touches a surface in every period: the sum is -0.3."""
    x, u, v = states("x u v")
    system = System({x: -0.3 * x, u: v, v: 0.2 * (1 + sign(u - 1)) - u}, surfaces=[Surface("wall", u - 1)])
    found = lyapunov(system, (1, 1, 0), 100, interval=interval)
    assert found.skipped >= 3
    assert "graze a surface and are left out" in found.message
    assert np.sum(found.exponents) == pytest.approx(-0.3, abs=1e-8)
