"""The measure `period` against closed forms, and what `models describe` says of a system."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import Problem, Surface, Sweep, System, parameters, sign, solve, states
from filippov.app.cli.main import main
from filippov.sweep.period import period_of

x, v = states("x v")
p = parameters(omega=1, level=0)
WAVE = System({x: v, v: -(p.omega**2) * x}, surfaces=[Surface("level", x - p.level, kind="observer")])


def measured(problem, *texts, **options):
    table = Sweep(problem, {"x0.x": [problem.x0[0]]}, measure=texts, rtol=1e-11, **options).run()
    return [float(table[text][0]) for text in texts]


@given(st.floats(0.5, 3), st.floats(-0.95, 0.95), st.floats(0, 2 * math.pi))
def test_11_13_the_period_of_a_wave_through_a_level(omega, level, phase):
    """x = cos(w t + phase) is above the level for another time than below it; the period is 2 pi/w."""
    start = (math.cos(phase), -omega * math.sin(phase))
    values = {"omega": omega, "level": level}
    run = solve(WAVE, start, (0, 24 * math.pi / omega), parameters=values, rtol=1e-11)
    for events in (run.events.of("level"), run.events.of("level", "crossing")):
        assert period_of(events, 0.0, run.t_end) == pytest.approx(2 * math.pi / omega, rel=1e-8)


def test_11_13_a_relay_with_hysteresis():
    """x goes up and down between -w and w at speed 2: the period is 4 w/2."""
    relay = System({x: -2 * sign(x)}, surfaces=[Surface("relay", x, width=0.3)])
    texts = ("period(relay)", "period(relay, crossing)", "period(relay, crossing up)")
    found = measured(Problem(relay, (0.1,), (0, 20)), *texts)
    assert found == pytest.approx([0.6] * 3, rel=1e-9)


def test_11_13_stick_and_slip_on_a_belt():
    """Entries and exits alternate; the period is the one between two exits."""
    belt = System({x: v, v: -x - sign(v - 1) * (1 + 2 / (1 + abs(v - 1)))}, surfaces=[Surface("belt", v - 1)])
    problem = Problem(belt, (3.0, 1.0), (0, 200))
    run = solve(problem, rtol=1e-11)
    exits = run.events.of("belt", "sliding exit").t
    texts = "period(belt)", "period(belt, sliding entry)", "period(belt, sliding exit)"
    assert measured(problem, *texts) == pytest.approx([exits[-1] - exits[-2]] * 3, rel=1e-7)


def test_11_13_no_period_where_the_events_end():
    """A motion that comes to rest, and one with a single event."""
    block = System({x: v, v: -x - 0.02 * sign(v)}, surfaces=[Surface("slip", v)])
    assert np.isnan(measured(Problem(block, (1.0, 0.0), (0, 900)), "period(slip)", tail=1.0)[0])
    assert np.isnan(measured(Problem(block, (0.1, 0.0), (0, 3)), "period(slip)", tail=1.0)[0])


OWN = """
from filippov import Surface, System, TimeEvent, parameters, sign, states

x, v = states("x v")
p = parameters(w=0.2, T=3)
s = System(
    {x: -sign(x - 1), v: 1 + 0*v},
    surfaces=[Surface("relay", x - 1, width=2*p.w)],
    time_events=[TimeEvent("clock", period=p.T, start=1, reset={v: 0}), TimeEvent("bell", times=(2, 5))],
)
plain = System(
    field=lambda t, x, p, s: [-s[0]],
    states="x",
    surfaces=[
        Surface("hit", lambda t, x, p: x[0], width=0.5),
        Surface("wall", lambda t, x, p: x[0] - 9, radius=(-2, 3), reset=lambda t, x, p: -x),
    ],
)
"""


def described(capsys, name):
    assert main(["models", "describe", name, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert main(["models", "describe", name]) == 0
    return data, capsys.readouterr().err


def test_11_13_describe_says_resets_clocks_widths_and_radii(capsys, tmp_path):
    """As data and as text."""
    data, text = described(capsys, "impact_oscillator")
    (wall,) = data["surfaces"]
    assert (wall["reset"], wall["side"], wall["contact"]) == ({"v": "-e*v"}, "+", True)
    assert "reset from the side +, may come to rest on it: v+ = -e*v" in text
    data, text = described(capsys, "belt_static")
    assert data["surfaces"][0]["radius"] == ["-Fs/Fc", "Fs/Fc"]
    assert "set at h = 0: [-Fs/Fc, Fs/Fc]" in text
    own = tmp_path / "own.py"
    own.write_text(OWN)
    data, text = described(capsys, f"{own}:s")
    assert (data["surfaces"][0]["h"], data["surfaces"][0]["width"]) == ("x - 1", "2*w")
    assert data["time_events"] == [
        {"name": "clock", "start": 1.0, "period": "T", "reset": {"v": "0"}},
        {"name": "bell", "times": [2.0, 5.0], "reset": None},
    ]
    assert "hysteresis: the sign s is left at h = -s width, width = 2*w" in text
    assert "time event clock every T from t = 1: v+ = 0" in text
    assert "time event bell at t = 2, 5\n" in text
    data, text = described(capsys, f"{own}:plain")
    assert [s["width"] for s in data["surfaces"]] == [0.5, 0.0]
    assert data["surfaces"][1]["radius"] == [-2.0, 3.0]
    assert data["surfaces"][1]["reset"] == "a function"
    assert "reset from the side +: x+ = a function" in text
