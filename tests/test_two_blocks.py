"""Two blocks on a belt: the event map of the stick of both, against phases put together with scipy."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import summary
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import UsageError, solve
from filippov.analysis.diagrams.basin import basin
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.models import get
from filippov.models.two_blocks import both_stick, stick_map, two_blocks

SYSTEM = two_blocks()
LEVEL = np.array([1.0, 1.3])
VB = 0.2


def springs(y: Any) -> Any:
    x1, _, x2, _ = y
    return np.array([-x1 - 1.2 * (x1 - x2), -x2 - 1.2 * (x2 - x1)])


def rates(y: Any, side: Any) -> Any:
    """side: of each block, 0 for stick, else the sign of its velocity relative to the belt."""
    slip = np.array([y[1], y[3]]) - VB
    force = springs(y) - side * LEVEL / (1 + 3 * np.abs(slip))
    a = np.where(side == 0, 0.0, force)
    return [y[1], a[0], y[3], a[1]]


def turn(d: float) -> tuple[float, float]:
    """(R(d), time) from the end of a stick of both, one block's event after the other."""
    x1 = min(1.0 - 1.2 * d, d + 1.3 + 1.2 * d)
    y = np.array([x1, VB, x1 - d, VB])
    side, spent = np.zeros(2), 0.0
    side[int(np.argmax(np.abs(springs(y)) / LEVEL))] = -1.0
    for _ in range(20):
        events = []
        for i in (0, 1):
            if side[i] == 0:
                events.append(lambda t, y, _, i=i: LEVEL[i] - abs(springs(y)[i]))
                events[-1].direction = -1
            else:
                events.append(lambda t, y, _, i=i: y[1 + 2 * i] - VB)
                events[-1].direction = -side[i]
            events[-1].terminal = True
        out = solve_ivp(
            lambda t, y, side: rates(y, side), (0, 40), y, method="DOP853", events=events,
            args=(side.copy(),), rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        i = 0 if len(out.t_events[0]) else 1
        y, spent = out.y[:, -1].copy(), spent + out.t[-1]
        force = springs(y)[i]
        if side[i] == 0:
            side[i] = np.sign(force)
        else:
            y[1 + 2 * i] = VB
            side[i] = 0.0 if abs(force) <= LEVEL[i] else np.sign(force)
        if not side.any():
            return float(y[0] - y[2]), spent
    raise AssertionError("no stick of both blocks")


SECTION = Section.from_model(get("two_blocks"))


@pytest.mark.parametrize("d", [-0.6, -0.35, -0.1, 0.05, 0.3, 0.47, 0.6])
def test_event_map_of_the_model_agrees_with_phases_of_scipy(d: float) -> None:
    turns = EventMap(SYSTEM, SECTION)
    assert turns(d) == pytest.approx(turn(d)[0], abs=1e-9)
    h = 1e-4
    slope = (8 * (turn(d + h)[0] - turn(d - h)[0]) - turn(d + 2 * h)[0] + turn(d - 2 * h)[0]) / (12 * h)
    assert turns.derivative(d) == pytest.approx(slope, abs=1e-6)
    assert turns.orbit(d)[-1].end_mode == (0, 0)


def test_derivative_by_the_speed_of_the_belt() -> None:
    turns, h = EventMap(SYSTEM, SECTION, rtol=1e-12, atol=1e-14), 1e-4
    at = [turns.remake(parameters={"vb": VB + k * h})(0.3) for k in (-2, -1, 1, 2)]
    slope = (8 * (at[2] - at[1]) - at[3] + at[0]) / (12 * h)
    assert turns.jet(0.3, ("vb",))[2] == pytest.approx(slope, abs=1e-7)


def test_sections_that_do_not_fit_are_named() -> None:
    parts = (SECTION.kind, SECTION.coordinate, SECTION.parametrisation)
    with pytest.raises(UsageError, match="expected 2 signs, for block 1, block 2"):
        Section("block 1", *parts, after="0").bind(SYSTEM)
    with pytest.raises(UsageError, match="expected signs"):
        Section("block 1", *parts, after="stick")
    with pytest.raises(UsageError, match="block 3"):
        Section("block 1, block 3", *parts).bind(SYSTEM)
    with pytest.raises(UsageError, match="a state or a formula in states"):
        Section("block 1", SECTION.kind, "x1 - y", SECTION.parametrisation).bind(SYSTEM)
    with pytest.raises(UsageError, match="expected one state"):
        basin(SYSTEM, SECTION, ("x1", [0.0, 1.0]), ("x2", [0.0, 1.0]), (-0.6, 0.6))


def test_commands_take_the_section(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["event-map", "two_blocks", "-p", "vb=0.1", "--points", "30"]
    data = summary(capsys, *words, "-o", str(tmp_path))
    slopes = {round(point["d"], 4): point["slope"] for point in data["fixed_points"]}
    assert slopes[-0.3888] == pytest.approx(-2.56335283, abs=1e-6)
    assert (tmp_path / "map.png").is_file()
    parts = ["--surface", "block 1, block 2", "--event", "sliding entry", "--coordinate", "x1 - x2"]
    again = summary(capsys, *words, *parts, "--after", "00")
    assert again["fixed_points"] == data["fixed_points"]
    other = summary(capsys, *words, *parts)
    assert other["fixed_points"] != data["fixed_points"]


@pytest.mark.parametrize("d", [-0.6, -0.35, -0.1, 0.05, 0.3, 0.47, 0.6])
def test_turn_agrees_with_phases_of_scipy(d: float) -> None:
    assert stick_map(SYSTEM, d)[0] == pytest.approx(turn(d)[0], abs=1e-9)


def test_stable_cycle_of_two_turns() -> None:
    d = np.array([0.1])
    for _ in range(40):
        d = stick_map(SYSTEM, d)
    exact = brentq(lambda q: turn(turn(q)[0])[0] - q, d[0] - 1e-4, d[0] + 1e-4, xtol=1e-13)
    assert d[0] == pytest.approx(exact, abs=1e-9)
    orbit = find_orbit(SYSTEM, both_stick(SYSTEM, exact)[0])
    ride = [abs(_end(q) - _first(q)) / VB for q in (exact, turn(exact)[0])]
    slips = turn(exact)[1] + turn(turn(exact)[0])[1]
    assert orbit.period == pytest.approx(sum(ride) + slips, abs=1e-8)
    h = 1e-4
    slope = (turn(turn(exact + h)[0])[0] - turn(turn(exact - h)[0])[0]) / (2 * h)
    assert orbit.multipliers[0].real == pytest.approx(slope, abs=1e-5)
    assert np.all(orbit.multipliers[1:] == 0)


def _end(d: float) -> float:
    return float(min(1.0 - 1.2 * d, d + 1.3 + 1.2 * d))


def _first(d: float) -> float:
    """x1 where the stick of both with this d begins, at the end of the turn from the other d of the cycle."""
    run = solve(SYSTEM, both_stick(SYSTEM, turn(d)[0])[0], (0, 40), rtol=1e-12, atol=1e-14)
    return float(next(e for e in run.events if e.after == (0, 0)).x[0])


def test_states_in_stick_of_both_and_where_there_are_none() -> None:
    d = np.linspace(-0.676, 0.676, 21)
    y = both_stick(SYSTEM, d)
    assert np.all(np.abs([springs(row) for row in y]) <= LEVEL + 1e-12)
    assert np.allclose(y[:, 0] - y[:, 2], d, atol=1e-15)
    # |x1 + 1.2 d| <= 1, |x1 - d - 1.2 d| <= 1.3: |3.4 d| <= 2.3.
    assert np.all(np.isnan(stick_map(SYSTEM, [2.3 / 3.4 + 1e-9, -2.3 / 3.4 - 1e-9])))
    assert np.all(np.isfinite(both_stick(SYSTEM, [2.3 / 3.4 - 1e-9, -2.3 / 3.4 + 1e-9])))


def test_rows_of_parameters_side_by_side() -> None:
    speeds = np.array([0.1, 0.2, 0.3])
    together = stick_map(SYSTEM, np.full(3, 0.1), {"vb": speeds})
    single = [stick_map(SYSTEM, 0.1, {"vb": float(vb)})[0] for vb in speeds]
    assert np.allclose(together, single, atol=1e-9)
