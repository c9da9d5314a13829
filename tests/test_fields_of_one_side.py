"""Fields that hold on their own side of a surface only: powers of h that are not whole, without |h|.

A block with friction 1 + k |v - w|**e against scipy, whose right-hand side is defined everywhere; a tank that
runs empty against separation of variables.
"""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from filippov import Piecewise, Surface, System, parameters, sign, solve, solve_many, sqrt, states

x, v = states("x v")
p = parameters(k=0.7, e=1.5, w=0.3)


def phase(t: float, z: np.ndarray, s: float, e: float, w: float) -> tuple[float, np.ndarray]:
    """The time and state at which the block that slips with sign s next stops slipping."""
    def rates(_: float, z: np.ndarray) -> list[float]:
        return [z[1], -z[0] - s * (1 + 0.7 * abs(z[1] - w) ** e)]

    def stops(_: float, z: np.ndarray) -> float:
        return float(z[1] - w)

    stops.terminal, stops.direction = True, -s  # type: ignore[attr-defined]
    options: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": 0.05}
    run = solve_ivp(rates, (t, t + 20), z, events=stops, **options)
    assert run.status == 1
    return float(run.t[-1]), np.asarray(run.y[:, -1])


def reference(e: float, w: float) -> list[float]:
    """Times at which the block of x'' = -x - friction stops slipping, until it sticks (|x| < 1)."""
    t, z, s, times = 0.0, np.array([4.0, 0.5]), 1.0, []
    while True:
        t, z = phase(t, z, s, e, w)
        times.append(t)
        if abs(z[0]) < 1:
            return times
        s = -s


def made(form: str) -> System:
    up, down = -x - 1 - p.k * (v - p.w) ** p.e, -x + 1 + p.k * (p.w - v) ** p.e
    if form == "modes":
        return System.from_modes(
            h=[v - p.w], fields={"+": [v, up], "-": [v, down]}, states=[x, v], parameters=p
        )
    if form == "factors":
        down = -x + 1 + ((p.w - v) * p.k ** (1 / p.e)) ** p.e
        return System.from_modes(h=[3 * v - 3 * p.w], fields={"+": [v, up], "-": [v, down]}, states=[x, v])
    if form == "expressions":
        return System({x: v, v: Piecewise((up, v > p.w), (down, True))}, parameters=p)

    def field(t: float, z: Any, q: Any, s: Any) -> list[float]:
        return [z[1], -z[0] - s[0] * (1 + q.k * np.power(s[0] * (z[1] - q.w), q.e))]

    belt = Surface("belt", lambda t, z, q: z[1] - q.w)
    return System(field=field, surfaces=[belt], states="x v", parameters={"k": 0.7, "e": 1.5, "w": 0.3})


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize("form", ["modes", "factors", "expressions", "functions"])
@pytest.mark.parametrize(("e", "w"), [(1.5, 0.3), (0.5, 0.0), (2.0575, 0.3), (0.3, -0.1), (2.5, 0.0)])
def test_e8_friction_of_one_side_is_left_and_entered(form: str, e: float, w: float) -> None:
    times = reference(e, w)
    run = solve(made(form), (4, 0.5), (0, times[-1] + 0.05), parameters={"e": e, "w": w})
    assert run.success, run.message
    assert run.events.t == pytest.approx(times, abs=1e-7)
    assert run.modes[-1] == "0"
    assert np.isfinite(run.y).all()


@pytest.mark.parametrize("options", [{"method": "DP5"}, {"method": "Taylor"}, {"backend": "python"}])
def test_e8_so_with_every_method(options: dict[str, Any]) -> None:
    times = reference(1.5, 0.3)
    run = solve(made("modes"), (4, 0.5), (0, times[-1] + 0.05), **options)
    assert run.events.t == pytest.approx(times, abs=1e-7)


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_e8_so_in_lanes_and_in_machine_code_of_a_function() -> None:
    times = reference(1.5, 0.3)
    many = solve_many(made("modes"), np.tile([4.0, 0.5], (9, 1)), (0, times[-1] + 0.05), lanes=8)
    one = solve(made("functions"), (4, 0.5), (0, times[-1] + 0.05), compile=True)
    assert one.events.t == pytest.approx(times, abs=1e-7)
    assert many.x == pytest.approx(np.tile(one.x_end, (9, 1)), abs=1e-7)


def test_e8_a_field_undefined_on_its_whole_side_stays_so() -> None:
    wrong = System.from_modes(h=[x], fields={"+": [-1 - sqrt(-x)], "-": [1]}, states=[x])
    run = solve(wrong, (1,), (0, 2))
    assert not run.success
    assert "NaN" in run.message


@pytest.mark.parametrize("inflow", [0.25, -0.5])
def test_e8_a_tank_that_runs_empty(inflow: float) -> None:
    """x' = q - sqrt(x) above 0, q below: with u = sqrt(x), t = 2 (u0 - u + q ln((u0 - q)/(u - q)))."""
    run = solve(System({x: Piecewise((inflow - sqrt(x), x > 0), (inflow, True))}), (1,), (0, 1.7))
    if inflow < 0:
        empty = 2 * (1 + inflow * np.log((1 - inflow) / (0 - inflow)))
        assert run.events.t == pytest.approx([empty], abs=1e-9)
        assert run.x_end[0] == pytest.approx(inflow * (1.7 - empty), abs=1e-9)
    else:
        u = np.sqrt(run.x_end[0])
        assert 2 * (1 - u + inflow * np.log((1 - inflow) / (u - inflow))) == pytest.approx(1.7, abs=1e-8)


def test_e8_signs_may_stand_beside_it() -> None:
    held = System({x: v, v: -x - sign(v) - Piecewise((v**1.5, v > 0), (-((-v) ** 1.5), True))})
    plain = System({x: v, v: -x - sign(v) * (1 + abs(v) ** 1.5)})
    ends = [solve(system, (4, 0.5), (0, 9)).x_end for system in (held, plain)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-8)


def test_e12_a_field_undefined_where_it_is_entered_is_named() -> None:
    lost = System.from_modes(h=[v], fields={"+": [v, -x - 1], "-": [v, 1 - sqrt(1 - x**2)]}, states=[x, v])
    run = solve(lost, (3, 0.5), (0, 20))
    assert run.status == "not_finite"
    assert "The field of mode - returned NaN for dy[1] (dv/dt)" in run.message
