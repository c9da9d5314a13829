"""Runs that start, or arrive, where the rates on both sides of a surface vanish while another one is crossed.

A diode in series with an inductor, i' = d for i > 0 and max(d, 0) at i = 0, is at such a point at the
beginning of most simulations: nothing flows, and the source passes through 0. Reference: scipy from phase to
phase; the diode begins to conduct where d rises through 0, and blocks where i falls to 0.
"""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import (
    Abs,
    Heaviside,
    Max,
    Min,
    Piecewise,
    Status,
    System,
    TimeEvent,
    cos,
    parameters,
    sin,
    solve,
    states,
)
from filippov.model.symbols import t

i, j, u, w, q = states("i j u w q")
p = parameters(A=2.0, omega=3.0, phase=0.0, R=0.2, K=1.0, leak=0.0)
source = p.A * sin(p.omega * t + p.phase)
DRIVE = source - p.K * u - p.R * i
RECTIFIER = System({i: Piecewise((DRIVE, i > 0), (Max(DRIVE, 0), True)), u: i - p.leak * u}, parameters=p)


def phases(q: dict[str, float], z: np.ndarray, span: tuple[float, float]) -> tuple[list[float], np.ndarray]:
    """Times at which the diode begins to conduct or blocks, and the state at the end."""
    def drive(s: float, z: np.ndarray) -> float:
        return float(q["A"] * math.sin(q["omega"] * s + q["phase"]) - q["K"] * z[1] - q["R"] * z[0])

    def conducts(s: float, z: np.ndarray) -> list[float]:
        return [drive(s, z), z[0] - q["leak"] * z[1]]

    def stops(s: float, z: np.ndarray) -> float:
        return float(z[0])

    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    time, times = span[0], []
    while True:
        grid = np.linspace(time, span[1], 4001)
        blocked = np.array([[0.0, z[1] * math.exp(-q["leak"] * (s - time))] for s in grid])
        drives = np.array([drive(s, y) for s, y in zip(grid, blocked, strict=True)])
        drives[np.abs(drives) < 1e-13] = 0.0
        if not (drives[0] > 0 or (drives[0] == 0 and drives[1] > 0)):
            later = np.flatnonzero((drives[:-1] <= 0) & (drives[1:] > 0))
            if not len(later):
                return times, blocked[-1]
            k, decay, level, begin = int(later[0]), q["leak"], float(z[1]), time
            time = brentq(
                lambda s: drive(s, np.array([0.0, level * math.exp(-decay * (s - begin))])),  # noqa: B023
                grid[k] if drives[k] < 0 else grid[k] + 1e-9, grid[k + 1], xtol=1e-15,
            )  # fmt: skip
            z = np.array([0.0, level * math.exp(-decay * (time - begin))])
            times.append(time)
        # The first moment by itself: i is 0 at its beginning too.
        fine: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-16}
        short = solve_ivp(conducts, (time, min(time + 1e-5, span[1])), z, **fine)
        begin, z = short.t[-1], short.y[:, -1]
        run = solve_ivp(conducts, (begin, span[1]), z, events=stops, max_step=0.05, **fine)
        time, z = float(run.t[-1]), np.asarray(run.y[:, -1])
        if run.status == 0:
            return times, z
        times.append(time)
        z[0] = 0.0


@pytest.mark.parametrize("seed", range(24))
def test_e4_a_rectifier_starts_where_its_source_is_0(seed: int) -> None:
    random = np.random.default_rng(seed)
    values = {
        "A": float(random.uniform(0.5, 3)), "omega": float(random.uniform(0.5, 4)),
        "phase": 0.0, "R": float(random.choice([0.1, 0.3])), "K": float(random.choice([0.0, 1.0, 2.0])),
        "leak": float(random.choice([0.0, 0.4])),
    }  # fmt: skip
    begin = float(random.integers(3)) * math.pi / values["omega"]
    span = begin, begin + 12.0
    times, end = phases(values, np.zeros(2), span)
    run = solve(RECTIFIER, (0, 0), span, parameters=values)
    assert run.status is Status.SUCCESS, run.message
    assert run.x_end == pytest.approx(end, abs=1e-7)
    # At a source of 1e-16 in place of 0 the run may conduct for a moment.
    changes = [e.t for e in run.events if e.surface == "i" and e.t > begin + 1e-9]
    assert changes == pytest.approx([s for s in times if s > begin + 1e-9], abs=1e-6)


def test_e4_two_diodes_of_opposite_phase_start_together() -> None:
    """The centre-tapped rectifier: until the source changes its sign the second diode blocks."""
    up, down = sin(t) - u, -sin(t) - u
    both = System({
        i: Piecewise((up, i > 0), (Max(up, 0), True)),
        j: Piecewise((down, j > 0), (Max(down, 0), True)),
        u: i + j - u / 3,
    })  # fmt: skip
    run = solve(both, (0, 0, 0), (0, 2.0))
    assert run.success, run.message
    values = {"A": 1.0, "omega": 1.0, "phase": 0.0, "R": 0.0, "K": 1.0, "leak": 1 / 3}
    _, end = phases(values, np.zeros(2), (0.0, 2.0))
    assert run.x_end == pytest.approx([end[0], 0, end[1]], abs=1e-8)




@pytest.mark.parametrize("weights", [(1, 1), (1, 2), (3, 1)])
@pytest.mark.parametrize("crossed", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_u1_what_both_sides_push_upwards_goes_up(weights: tuple[int, int], crossed: bool, order: int) -> None:
    """x' = a t^n above, b t^n below: no slide, whatever a and b; a kink in t beside it changes nothing."""
    above, below = weights
    fields = {"+": [above * t**order], "-": [below * t**order]}
    h = [i, t] if crossed else [i]
    table = {key + "*" * crossed: row for key, row in fields.items()}
    run = solve(System.from_modes(h=h, fields=table, states=[i]), (0,), (0, 1))
    assert run.success, run.message
    assert run.x_end[0] == pytest.approx(above / (order + 1), abs=1e-9)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("crossed", [False, True])
def test_u1_what_both_sides_push_together_is_held(crossed: bool, order: int) -> None:
    """x' = -t^n above, 2 t^n below is held with the multiplier 1/3; pushed apart it is not unique."""
    tail = "*" * crossed
    h = [i, t] if crossed else [i]
    held = System.from_modes(h=h, fields={"+" + tail: [-(t**order)], "-" + tail: [2 * t**order]}, states=[i])
    run = solve(held, (0,), (0, 1))
    assert run.success, run.message
    assert run.x_end[0] == 0
    assert run.multiplier("i", 0.5) == pytest.approx(1 / 3, abs=1e-9)
    apart = System.from_modes(h=h, fields={"+" + tail: [t**order], "-" + tail: [-2 * t**order]}, states=[i])
    assert solve(apart, (0,), (0, 1)).status is Status.NON_UNIQUE


@pytest.mark.parametrize("begin", [0.0, 1e-9, 0.5, -0.5])
def test_u1_a_surface_along_which_a_field_runs_is_held_from_either_side(begin: float) -> None:
    """x' = max(sin t, 0) below 0 and min(sin t, 0) above: x stays 0, and both fields hold it in turn."""
    held = System({i: Heaviside(-i) * Max(sin(t), 0) + Heaviside(i) * Min(sin(t), 0)})
    run = solve(held, (0,), (begin, begin + 8))
    assert run.success, run.message
    assert np.max(np.abs(run.y)) == 0


def test_u1_a_clock_at_a_two_fold() -> None:
    """A source q (cos t - 1) behind a diode is switched on at t = 0, where it is 0: nothing ever flows."""
    drive = q * (cos(t) - 1)
    system = System(
        {i: Piecewise((drive, i > 0), (Max(drive, 0), True)), q: 0 * q, w: Abs(drive)},
        time_events=[TimeEvent("on", times=[0.0, 2 * math.pi], reset={q: 1 + 0 * q})],
    )
    run = solve(system, (0, 0, 0), (-1, 7))
    assert run.success, run.message
    assert run.x_end[0] == 0
    assert run.x_end[2] == pytest.approx(7 - math.sin(7), abs=1e-8)
