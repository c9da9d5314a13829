"""Periods over two parameters from one state, and what is one where a coordinate hardly varies."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from filippov import (
    Max,
    Min,
    Problem,
    Surface,
    System,
    TimeEvent,
    UsageError,
    cos,
    exp,
    parameters,
    sign,
    states,
    t,
)
from filippov.analysis import Section, Stroboscope, brute_force, period_map
from filippov.app import Explorer
from filippov.app.cli.main import main
from filippov.plot.style import where_read

X, V = states("x v")
P = parameters(F=1.0, w=1.4, c=0.05, mu=0.3)
FORCED = System({X: V, V: -X - P.c * V - P.mu * sign(V) + P.F * cos(P.w * t)})
B = parameters(vb=0.2, k=1.0, Fs=0.5, Fc=0.3)
REL = V - B.vb
BELT = System(
    {X: V, V: -B.k * X - (B.Fc + (B.Fs - B.Fc) * exp(-abs(REL) / 0.1)) * sign(REL)},
    surfaces=[Surface("belt", REL)],
)
# y decays to y exp(-h) between the ticks of a clock, each of which adds 1 to it where it is below r.
Y, N = states("y n")
C = parameters(h=math.log(2), r=0.6)
DOSED = System(
    {Y: -Y + 0 * N, N: 0},
    time_events=[TimeEvent("tick", period=C.h, reset={Y: Y + (1 - sign(Y - C.r)) / 2, N: N + 1})],
)
PROBLEM = Problem(DOSED, (0.1, 0.0), (0, 10))


def test_16_a_a_coordinate_that_is_the_same_at_every_event() -> None:
    """The block breaks away at x = Fs/k whatever the speed of the belt: one cycle, period 1."""
    exits = Section("belt", "sliding exit down", "x", None, 1000.0)
    found = brute_force(BELT, exits, "vb", [0.1, 0.2, 0.3], (0, 0), transient=30, keep=16)
    assert np.allclose(found.d, 0.5, atol=1e-6)
    assert found.period.tolist() == [1, 1, 1]


def test_16_a_a_coordinate_that_is_small_on_the_section() -> None:
    """At resonance x is 30 times v there; an oscillator with dry friction has one attractor (period 1)."""
    found = period_map(FORCED, Stroboscope("v"), ("F", [0.5, 1.25, 2.0]), ("w", [1.0, 1.5]), (0, 0))
    assert found.period.tolist() == [[1, 1, 1], [1, 1, 1]]


def doses(h: float, r: float, count: int = 64) -> list[float]:
    y, out = 0.1, []
    for k in range(400 + count):
        y *= math.exp(-h)
        y += y < r
        out += [y] if k >= 400 else []
    return out


def test_16_a_periods_of_a_clocked_system() -> None:
    h, r = [0.3, math.log(2), 1.1], [0.6, 0.8, 1.3]
    found = period_map(DOSED, Stroboscope("y", clock="tick"), ("h", h), ("r", r), (0.1, 0.0), transient=400)
    for j, b in enumerate(r):
        for i, a in enumerate(h):
            row = np.array(doses(a, b))
            fits = [p for p in range(1, 33) if np.allclose(row[p:], row[:-p], atol=1e-6)]
            assert found.period[j, i] == (fits or [0])[0]
    assert len(np.unique(found.period)) > 2


def test_16_a_regions_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["regions", f"{__file__}:PROBLEM", "--over", "h=0.3:1.1", "--over", "r=0.6:1.3", "--cells", "3",
             "--coordinate", "y"]  # fmt: skip
    assert main([*words, "--json", "-o", str(tmp_path)]) == 0
    told = capsys.readouterr()
    # What it says is used can be given.
    assert "the same by flags: --coordinate y --clock tick --x0=0.1,0" in told.err
    again = [*words, "--clock", "tick", "--x0=0.1,0", "--json", "--quiet"]
    assert main(again) == 0
    assert capsys.readouterr().out == told.out
    data = json.loads(told.out)
    axes = [(name, np.linspace(*ends, 3).tolist()) for name, ends in (("h", (0.3, 1.1)), ("r", (0.6, 1.3)))]
    same = period_map(DOSED, Stroboscope("y", clock="tick"), *axes, (0.1, 0.0)).to_dict()
    assert {key: data[key] for key in same} == same
    assert {path.name for path in tmp_path.iterdir()} == {"regions.json", "regions.csv", "regions.png"}


@pytest.mark.parametrize(("words", "told"), [
    (["diagram", "FORCED", "--over", "F=1:2", "--x0", "0,0", "--clock", "tock"], "unknown time event 'tock'"),
    (["diagram", "FORCED", "--over", "F=1:2", "--x0", "0,0", "--period", "3", "--surface", "v"], "one or"),
    (["tune", "PROBLEM", "--over", "h=0.5:1"], "`filippov regions --x0` periods over two parameters"),
    (["regions", "FORCED", "--over", "F=1:2,w=1:2", "--x0", "0,0", "--borders", "exact"], "--borders"),
])  # fmt: skip
def test_16_a_what_is_said(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    command, model, *rest = words
    assert main([command, f"{__file__}:{model}", *rest]) == 2
    assert told in capsys.readouterr().err


def test_16_a_the_period_can_be_given(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["diagram", f"{__file__}:FORCED", "--over", "F=1:2", "--count", "2", "--x0", "0,0", "--keep", "8"]
    found = []
    for more in ([], ["--period", "2*pi/w"], ["--period", "4*pi/w"]):
        assert main([*words, "--coordinate", "x", *more, "--json", "--quiet"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert np.allclose(found[0]["d"], found[1]["d"], rtol=1e-12)
    assert np.allclose(found[0]["d"], found[2]["d"], rtol=1e-6)
    assert [q["section"]["period"] for q in found] == [None, "2*pi/w", "4*pi/w"]


def test_16_a_axes_are_checked() -> None:
    with pytest.raises(UsageError, match="did you mean"):
        period_map(FORCED, None, ("Fx", [1, 2]), ("w", [1, 2]), (0, 0))
    with pytest.raises(UsageError, match="expected two parameters"):
        period_map(FORCED, None, ("F", [1, 2]), ("F", [1, 2]), (0, 0))


def test_16_a_axes_say_where_a_coordinate_is_read() -> None:
    """Once a period for a strobe, at the event for a section: in the explorer and of the command."""
    page = Explorer(FORCED, x0=(0.5, 0), t_span=(0, 20))
    assert page.figures()["map"]["layout"]["xaxis"]["title"]["text"] == "d: x once a period"
    belt = Explorer(BELT, x0=(0, 0), t_span=(0, 20))
    assert belt.figures()["map"]["layout"]["xaxis"]["title"]["text"] == "d: x at the event"
    assert where_read(Stroboscope("y", clock="tick"), 2) == ("once a period, after 'tick'", "2 periods later")
    assert where_read(Section("v", "reset", "x"), 2) == ("after the reset", "after reset 2 from it")
    assert where_read(Section("v", "crossing up", "x")) == ("at the event", "at event 1 after it")


@pytest.mark.parametrize("p", [2, 3, 7])
def test_what_settles_near_a_root_of_one_has_no_period_of_its_own(p: int) -> None:
    """x'' + 2 c x' + (c^2 + w^2) x = cos t has the multipliers exp(-2 pi c +- 2 pi i/p): period 1 for any c,
    from |x - x_p| = 1 on known after 200 periods where exp(-400 pi c) is small."""
    c = parameters(c=0.01)
    system = System({X: V, V: cos(t) - 2 * c.c * V - (c.c**2 + (1 + 1 / p) ** 2) * X})
    values = np.linspace(0.004, 0.02, 33)
    strobe, x0 = Stroboscope("x", 2 * math.pi), (1.0, 0.0)
    noisy = brute_force(system, strobe, "c", values, x0, transient=200, keep=40)
    assert set(noisy.period.tolist()) <= {0, 1}  # the errors of rtol = 1e-8 are of the size of the limit
    found = brute_force(system, strobe, "c", values, x0, transient=200, keep=40, rtol=1e-11)
    assert set(found.period.tolist()) == {0, 1}
    assert np.all(found.period[np.exp(-400 * math.pi * values) < 1e-8] == 1)
    longer = brute_force(system, strobe, "c", [0.01, 0.02], x0, transient=800, keep=40, rtol=1e-11)
    assert longer.period.tolist() == [1, 1]


def test_what_escapes_has_no_part_in_the_periods_of_others() -> None:
    """x+ = c x - 3/2 clip(x) has a cycle at +-3/2/(1 + c); from 8 it escapes where 6.5 c > 1.5 + 6.5."""
    (x, z), p = states("x z"), parameters(c=0.2, a=1.5)
    tick = Surface("tick", z - 1, reset={x: p.c * x - p.a * Max(-1, Min(1, x)), z: 0 * z}, side="-")
    system = System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)
    section = Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5)
    got = brute_force(system, section, "c", [0.0, 0.2, 1.3], 8.0)
    assert np.abs(got.d[:2, -1]) == pytest.approx([1.5, 1.25], abs=1e-8)
    assert abs(got.d[2, -1]) > 1e20
    assert got.period.tolist() == [2, 2, 0]
    over = period_map(system, section, ("c", [0.0, 0.2, 1.3]), ("a", [1.5, 1.2]), (8.0, 0.0))
    assert over.period.tolist() == [[2, 2, 0]] * 2
