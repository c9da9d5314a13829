"""Sections without a parametrisation: what recurs along a solution is found, and followed by events."""

import json
import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from test_phase_of_orbits import buck, doubling

from filippov import System, TimeEvent, UsageError, parameters, sign, sin, states, t
from filippov.analysis import EventMap, Section, Stroboscope, bifurcation, brute_force, find_section, returns
from filippov.app.cli.main import main
from filippov.models import get

x, v = states("x v")
p = parameters(mu=0.1, w=1.3, c=0.2, start=0.0)
DRY = System({x: v, v: -x - p.mu * sign(v)}, parameters=p)
DRIVEN = System({x: v, v: -x - p.c * v + sin(p.w * t)}, parameters=p)
DOSE = TimeEvent("dose", period=2.0, start=p.start, reset={x: x + 1})
DOSED = System({x: -p.c * x}, parameters=p, time_events=[DOSE])
OWN = """
from filippov import Problem, System, parameters, sign, states
x, v = states("x v")
p = parameters(vb=0.2, F=0.4)
system = System({x: v, v: -x - p.F*sign(v - p.vb)/(1 + abs(v - p.vb))}, parameters=p)
belt = Problem(system, (1.0, 0.0), (0, 50))
"""


def hunting_start(d: float) -> np.ndarray:
    system = get("hunting").build()
    return (
        Section.from_model(get("hunting"))
        .bind(system)
        .start(np.array([d]), system.parameters.resolve(None))[0]
    )


def test_16_5_the_motion_gives_the_points_of_the_declared_section() -> None:
    """The parametrisation of hunting and the motion are two ways to the same stick positions."""
    model = get("hunting")
    system, declared = model.build(), Section.from_model(model)
    values, keywords = [10.0, 15.0, 20.0], {"transient": 150, "keep": 8, "rtol": 1e-10}
    lifted = brute_force(system, declared, "P", values, 0.2, **keywords)
    plain = Section("velocity", "sliding entry", "x")
    moved = brute_force(system, plain, "P", values, hunting_start(0.2), **keywords)
    assert moved.d == pytest.approx(lifted.d, abs=1e-7)
    assert moved.period.tolist() == [2, 2, 2]
    assert moved.notes == ("", "", "")
    seen = returns(system, plain, hunting_start(0.2), 6)
    assert seen.d == pytest.approx(EventMap(system, declared).iterate(0.2, 6)[1:], abs=1e-8)
    found = find_section(system, model.x0)
    assert isinstance(found, Section)
    assert found.surface == "velocity"
    assert found.coordinate == "x"
    one_way = brute_force(system, None, "P", values, model.x0, **keywords)
    assert np.abs(one_way.d) == pytest.approx(np.abs(lifted.d), abs=1e-7)
    assert one_way.period.tolist() == [1, 1, 1]


def test_16_5_a_section_with_modes_is_taken_along_the_motion() -> None:
    model = get("two_blocks")
    system, declared = model.build(), Section.from_model(model)
    start = declared.bind(system).start(np.array([0.5]), system.parameters.resolve(None))[0]
    plain = Section(
        declared.surface, declared.kind, declared.coordinate, None, declared.t_max, declared.after
    )
    expected = EventMap(system, declared).iterate(0.5, 4)[1:]
    assert returns(system, plain, start, 4).d == pytest.approx(expected, abs=1e-7)


def test_16_5_a_forced_motion_once_a_period_in_closed_form() -> None:
    """x'' + c x' + x = sin(w t): x(k T) is the imaginary part of 1/(1 - w^2 + i c w)."""
    values = [0.4, 0.9, 1.0, 1.7]
    found = brute_force(DRIVEN, None, "w", values, (0.3, 0.0), transient=60, keep=3, rtol=1e-10)
    exact = [(1 / (1 - w * w + 0.2j * w)).imag for w in values]
    for row, value in zip(found.d, exact, strict=True):
        # What is left of the start after 60 periods.
        assert row == pytest.approx(value, abs=1e-7)
    followed = brute_force(
        DRIVEN, None, "w", values, (0.3, 0.0), transient=60, keep=3, rtol=1e-10, follow=True
    )
    assert followed.d == pytest.approx(found.d, abs=1e-6)
    where = find_section(DRIVEN, (0.3, 0.0))
    assert where == Stroboscope("x")
    (orbit,) = bifurcation(DRIVEN, where, parameter="w", values=[1.6, 1.7], x0=(0.3, 0.0)).points[-1]
    assert orbit.d == pytest.approx(exact[-1], abs=1e-8)
    assert abs(orbit.slope) == pytest.approx(math.exp(-0.1 * 2 * math.pi / 1.7), rel=1e-8)


@pytest.mark.parametrize("start", [0.0, 0.6, 2.0, 8.0])
def test_16_5_after_the_ticks_of_a_clock_in_closed_form(start: float) -> None:
    """x decays and is raised by 1 every 2: 1/(1 - exp(-2 c)) after a tick, whenever the first one comes."""
    section = find_section(DOSED, [0.5], parameters={"start": start})
    assert section == Stroboscope("x", clock="dose")
    seen = returns(DOSED, section, [0.5], 40, parameters={"start": start})
    first = start if start > 0 else 2.0
    assert seen.t == pytest.approx(first + 2.0 * np.arange(40), rel=1e-14)
    exact, x = [], 0.5 * math.exp(-0.2 * first) + 1
    for _ in range(40):
        exact.append(x)
        x = x * math.exp(-0.4) + 1
    assert seen.d == pytest.approx(exact, rel=1e-8)
    run = partial(brute_force, DOSED, section, "c", [0.2, 0.4], [0.5], parameters={"start": start}, keep=2)
    if start == 0.6:
        with pytest.raises(UsageError, match="ticks at t = k T"):
            run(follow=True)
    else:
        exact = [1 / (1 - math.exp(-2 * c)) for c in (0.2, 0.4)]
        assert run(follow=True, transient=60).d[:, 0] == pytest.approx(exact, rel=1e-8)


def test_16_5_a_motion_that_comes_to_rest_has_its_place() -> None:
    """Turning points of a dry oscillator: each 2 mu nearer, until it rests within mu of 0."""
    turns = Section("v", "crossing up", "x", t_max=10)
    found = brute_force(
        DRY, Section("v", "crossing", "x", t_max=10), "mu", [0.1, 0.15], (1, 0), transient=2, keep=4
    )
    assert found.d[0] == pytest.approx([-0.4, 0.2, 0.0, 0.0], abs=1e-8)
    assert found.d[1] == pytest.approx([-0.1] * 4, abs=1e-8)
    assert all("the solution rests" in note for note in found.notes)
    with pytest.raises(UsageError, match="comes back again and again"):
        find_section(DRY, (1, 0))
    with pytest.raises(UsageError, match="has no parametrisation"):
        EventMap(DRY, turns)(0.5)
    frictionless = returns(
        DRY, Section("v", "crossing up", "x", t_max=1.0), (1, 0), 3, parameters={"mu": 0.0}
    )
    assert frictionless.d.size == 0
    assert "did not come within 1" in frictionless.message


def test_16_5_orbits_of_the_converter_double_where_the_exact_map_does() -> None:
    """Matrix exponentials from switching to switching; 24.5 in di Bernardo, Garofalo, Glielmo, Vasca 1998."""
    model = get("buck_pwm")
    found = bifurcation(model.build(), None, parameter="Vin", values=[24.0, 24.5, 25.0], x0=model.x0)
    (special,) = found.special
    names = model.build().parameters
    values = dict(zip(names.names, names.resolve(None).tolist(), strict=True))
    exact = doubling(lambda q: partial(buck, {**values, "Vin": q}), np.array([12.0, 0.55]), 24.2, 24.8)
    assert special.kind == "period doubling"
    assert special.value == pytest.approx(exact, rel=1e-8)
    assert special.value == pytest.approx(24.5, abs=0.05)
    assert {len(points) for points in found.points} == {1, 2}
    brute = brute_force(model.build(), None, "Vin", [24.0], model.x0, transient=120, keep=1)
    assert found.points[0][0].d == pytest.approx(brute.d[0, 0], rel=1e-6)


def test_16_5_commands_find_the_section(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own.py").write_text(OWN)
    own, out = f"{tmp_path / 'own.py'}:belt", ["-o", str(tmp_path / "out")]
    assert main(["diagram", own, "--over", "vb=0.1:0.2", "--count", "2", "--transient", "40", "--keep", "2",
                 "--json", *out]) == 0  # fmt: skip
    told = capsys.readouterr()
    assert "the same by flags: --surface" in told.err
    assert "--coordinate x" in told.err
    data = json.loads(told.out)
    assert data["period"] == [1, 1]
    assert main(["event-map", own, "--points", "20", "--json", "--quiet", *out]) == 0
    (point,) = json.loads(capsys.readouterr().out)["fixed_points"]
    assert point["stable"]
    assert point["d"] == pytest.approx(data["d"][1][0], abs=1e-6)
    assert main(["bifurcation", own, "--over", "vb=0.19:0.2", "--count", "2", "--json", "--quiet", *out]) == 0
    branch = json.loads(capsys.readouterr().out)
    at_end = next(row for row in branch["values"] if row["value"] == 0.2)
    assert at_end["fixed_points"][0]["d"] == pytest.approx(point["d"], abs=1e-8)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {
        "map.png",
        "diagram.png",
        "bifurcation.png",
    }
    assert main(["regions", own, "--over", "vb=0.1:0.2", "--over", "F=0.3:0.4"]) == 2
    assert "From a short run: --surface" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["diagram", "buck_pwm"], "give --over NAME=LOW:HIGH"),
        (["diagram", "buck_pwm", "--parameter", "Vin"], "over which values of Vin?"),
        (["diagram", "buck_pwm", "--over", "Vim=1:2"], "did you mean 'Vin'"),
        (["diagram", "buck_pwm", "--over", "Vin=1:2", "--over", "R=1:2"], "takes one parameter"),
        (["diagram", "buck_pwm", "--over", "Vin=1:2", "--parameter", "R"], "give one or the other"),
        (["diagram", "buck_pwm", "--over", "Vin=1:2", "--start", "3"], "--coordinate, --parametrisation"),
        (["event-map", "belt", "--x0", "0,0", "--interval", "0", "1"], "leave it out"),
        (["event-map", "belt", "--surface", "belt"], "--surface, --event and --coordinate together"),
        (["event-map", "hunting", "--x0", "0,0,0", "--lift", "x=d"], "give one of them"),
    ],
)  # fmt: skip
def test_16_5_wrong_flags_are_answered(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--quiet"]) == 2
    assert message in capsys.readouterr().err
