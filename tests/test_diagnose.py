"""The doctor for programs f(t, y): what it finds in them, and the motions that it gives in their place."""

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import issue_programs as issues
import naive_programs as programs
import numpy as np
import pytest
import refused_programs as refused
from program_draws import Draw
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import models, solve
from filippov.analysis import diagnose
from filippov.analysis.programs.agreement import disagreement
from filippov.analysis.programs.notes import ReadingError
from filippov.analysis.programs.reader import read_program
from filippov.analysis.programs.translation import number, translate
from filippov.app.cli.main import main
from filippov.base.errors import ModelError, UsageError
from filippov.base.user_file import load_file

LINES = Path(programs.__file__).read_text(encoding="utf-8").splitlines()


def lines(*marks: int) -> set[int]:
    """The lines of the programs that bear these marks."""
    found = {i for i, line in enumerate(LINES, 1) for mark in marks if f"# <{mark}>" in line}
    assert found
    return found


@dataclass(frozen=True)
class Case:
    """surfaces: kind and marks of lines by name; found: kinds of finding; t, x: a point of the motion."""

    x0: tuple[float, ...]
    t_span: tuple[float, float]
    surfaces: dict[str, tuple[str, tuple[int, ...]]]
    found: tuple[str, ...]
    t: float
    x: tuple[float | None, ...]
    options: dict[str, Any] | None = None
    near: float = 1e-7


def model_at(name: str, t: float, x0: Any, **values: float) -> tuple[float, ...]:
    """The state of a registered model at a time."""
    return tuple(solve(models.get(name).build(), x0, (0, t), parameters=values).x_end.tolist())


def room(t: float) -> float:
    """The room under its thermostat: up from 15 towards 38 until 23.5, down towards 18 until 22, up again."""
    at, T, heats = 0.0, 15.0, True
    while True:
        goal, end = (38.0, 23.5) if heats else (18.0, 22.0)
        lasts = 10 * math.log((goal - T) / (goal - end))
        if at + lasts > t:
            return goal + (T - goal) * math.exp(-0.1 * (t - at))
        at, T, heats = at + lasts, end, not heats


def saw(t: float) -> float:
    """y' = +-1 back and forth between -0.3 and 0.3, from 0 upwards."""
    s = (t - 0.3) % 1.2
    return 0.3 - s if s < 0.6 else s - 0.9


def creeping(t: float) -> float:
    """x'' = -x from (1.1, 0) until v = -1e-3, then x'' = -x + 0.2."""
    at = math.asin(1e-3 / 1.1)
    return 0.2 + (1.1 * math.cos(at) - 0.2) * math.cos(t - at) - 1e-3 * math.sin(t - at)


def fires(t: float) -> tuple[float, ...]:
    """The linear neuron below its threshold v = 0.25, then above it, by matrix exponentials."""
    A = np.array([[-1, -1], [0.5, -0.25]])

    def flow(current: float, s: float, x: Any) -> Any:
        rest = -np.linalg.solve(A, [current, 0])
        return rest + expm(A * s) @ (x - rest)

    at = brentq(lambda s: flow(0.4, s, np.zeros(2))[0] - 0.25, 0.1, 2)
    return tuple(flow(1.4, t - at, flow(0.4, at, np.zeros(2))).tolist())


def ripple(n: int) -> float:
    """The current of the inductor after n periods: up for 3 ms towards 5, down for 7 ms."""
    i = 0.0
    for _ in range(n):
        i = 5.0 + (i - 5.0) * math.exp(-20 * 0.003)
        i *= math.exp(-20 * 0.007)
    return i


def stairs(n: int) -> float:
    """y' = k - y over n steps of half a second each."""
    y = 0.0
    for k in range(n):
        y = k + (y - k) * math.exp(-0.5)
    return y


def filled(t: float) -> float:
    """y' = 1 - y/2 in [0, 2) and [4, 6), y' = -y/2 between."""
    y = 0.0
    for k in range(4):
        s = min(2, t - 2 * k)
        goal = 2.0 if k % 2 == 0 else 0.0
        y = goal + (y - goal) * math.exp(-0.5 * s)
    return y


STOP = 0.3 * 9.81
CASES = {
    "oscillator": Case((1.1, 0), (0, 12), {"v": ("jump", (1,))}, ("hang",), 12, (0.1, 0)),
    "brake": Case((0, 3), (0, 3), {"y1": ("jump", (2,))}, ("hang",), 3, (9 / (2 * STOP), 0)),
    "relay_loop": Case((1,), (0, 6), {"y0": ("jump", (3,))}, ("hang",), 6, (0,)),
    "bang_bang_heater": Case(
        (15,), (0, 20), {"setpoint - T": ("jump", (4,))}, ("hang",), 20, (22.75,), near=1e-10
    ),
    "thermostat": Case(
        (15,), (0, 20), {"heating on": ("memory", (5,)), "heating off": ("memory", (6,))},
        ("memory", "wrong curve"), 19, (room(19), None),
    ),
    "relay_with_memory.rhs": Case(
        (0,), (0, 6), {"up off": ("memory", (7,)), "up on": ("memory", (8,))}, ("memory",), 6,
        (saw(6), None),
    ),
    "relaxation": Case(
        (1.5,), (0, 5), {"charging off": ("memory", (9,)), "charging on": ("memory", (10,))}, ("memory",),
        math.log(1.5) + math.log(2), (2, None),
    ),
    "harvest": Case(
        (1, 0.5), (0, 60), {"C - threshold": ("jump", (11,))}, (), 60,
        model_at("threshold_harvest", 60, (1, 0.5)), near=1e-6,
    ),
    "two_prey": Case(
        (1, 1, 1), (0, 10), {"0.2*R1 - 0.1*R2": ("jump", (12,))}, ("hang",), 10,
        model_at("switching_predator", 10, (1, 1, 1)), near=1e-6,
    ),
    "pwm": Case(
        (0,), (0, 0.2), {"phase - duty*period": ("time", (13,))}, ("clock", "missed", "wrong curve"), 0.2,
        (ripple(20), None),
    ),
    "sliding_mode": Case(
        (1, 0), (0, 5), {"c*x + v": ("jump", (14,))}, ("hang",), 5, model_at("sliding_mode", 5, (1, 0)),
        {"method": "LSODA"},
    ),
    "belt": Case((0.2, 0.4), (0, 2), {"u - belt": ("jump", (15,))}, ("hang",), 2, (1.0, 0.4)),
    "pulse": Case(
        (0,), (0, 100), {"t - 50": ("time", (16,)), "t - 50.001": ("time", (16,))}, ("missed",), 50.5,
        (1000 * (1 - math.exp(-1e-3)) * math.exp(-0.499),), near=1e-8,
    ),
    "neuron": Case((0, 0), (0, 12), {"v - a": ("jump", (17,))}, (), 12, fires(12)),
    "dead_band": Case(
        (1.1, 0), (0, 9), {"v": ("kink", (18, 19)), "Abs(v) - 0.001": ("jump", (18,))}, ("dead band",), 2,
        (creeping(2), None),
    ),
    "stuck_by_equality": Case((1.1, 0), (0, 12), {"v": ("jump", (21,))}, ("equality", "hang"), 12, (0.1, 0)),
    "unstable_relay": Case((0,), (0, 3), {"y0": ("jump", (22,))}, ("false rest",), 0, (0,)),
    "chain": Case(
        (1, -1, 0, 0), (0, 12), {"v1": ("jump", (23,)), "v2": ("jump", (23,))}, (), math.pi / math.sqrt(3),
        (-0.8, 0.8, 0, 0),
    ),
    "lifted": Case((2.2, 0), (0, 9), {"y1": ("jump", (24,))}, ("hang",), 9, (0.2, 0)),
    "twisting": Case(
        (10, 10), (0, 12), {"x": ("jump", (25,)), "v": ("jump", (25,))}, (), 12,
        model_at("twisting", 12, (10, 10)), near=1e-6,
    ),
    "saturated": Case(
        (0.3, 0), (0, 5), {"10*x + 2*v + 1": ("kink", (26,)), "10*x + 2*v - 1": ("kink", (26,))}, (), 0.1,
        (0.295, -0.1),
    ),
    "tank": Case(
        (0,), (0, 7), {"phase - 2": ("time", (28,))}, ("clock",), 7, (filled(7), None, None), near=1e-7
    ),
    "staircase": Case((0,), (0, 4), {}, ("clock",), 4, (stairs(8), None)),
}  # fmt: skip
SMOOTH = {
    "van_der_pol": (2, 0), "lorenz": (1, 1, 1), "pendulum": (1, 0), "lotka": (10, 5),
    "epidemic": (0.9, 0.1, 0),
    "linear": (1, 0), "soft_friction": (1, 0), "chosen_once": (1, 0), "phases": (0, 1, 2),
    "duffing": (0.5, 0),
}  # fmt: skip
assert len(CASES) + len(SMOOTH) >= 30


def program(name: str) -> Any:
    value: Any = programs
    for part in name.split("."):
        value = getattr(value, part)
    return value


@pytest.mark.parametrize("name", CASES)
def test_15_5_what_switches_is_found_with_its_line_and_the_motion_is_the_known_one(name: str) -> None:
    case = CASES[name]
    found = diagnose(program(name), case.x0, case.t_span, max_calls=4000, **(case.options or {}))
    assert found.system is not None, str(found)
    assert found.solution is not None
    assert not found.smooth
    surfaces = {switch.surface: switch for switch in found.switches}
    for surface, (kind, marks) in case.surfaces.items():
        switch = found.switches[found.system.surface_place(surface)[0]]
        assert switch.kind == kind
        assert set(switch.lines) == lines(*marks)
    kinds = {finding.kind for finding in found.findings}
    # Whether a run that chatters comes to its end depends on the budget.
    kinds |= {"hang"} if "chattering" in kinds else set()
    assert set(case.found) <= kinds, str(found)
    assert not kinds & {"differs", "not translated", "exception"}, str(found)
    for finding in found.of("hang") + found.of("chattering"):
        assert finding.surface in surfaces
        assert set(finding.lines) <= {line for switch in surfaces.values() for line in switch.lines}
    x = found.solution.sol(case.t) if found.solution.success else found.solution.x_end
    for value, known in zip(x, case.x, strict=True):
        assert known is None or abs(value - known) < case.near * (1 + abs(known))
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("name", SMOOTH)
def test_15_5_smooth_programs_are_left_alone(name: str) -> None:
    rates = (0.4, 0.1) if name == "epidemic" else ()
    found = diagnose(program(name), SMOOTH[name], (0, 2), args=rates)
    assert found.smooth
    assert not found.findings
    assert found.solution is None
    assert found.compared > 100
    assert "nothing switches here" in str(found)


# -- programs after public issue threads --------------------------------------------------------------------

SOURCES = Path(issues.__file__).read_text(encoding="utf-8").splitlines()


def marked(*marks: int) -> set[int]:
    return {i for i, line in enumerate(SOURCES, 1) for mark in marks if f"# <{mark}>" in line}


def after_pulse(t: float, on: float, off: float, height: float, rate: float) -> float:
    """x' = -rate x + height within (on, off), from 0, for t > off."""
    return height / rate * (1 - math.exp(-rate * (off - on))) * math.exp(-rate * (t - off))


def forced(t: float) -> tuple[float, ...]:
    """x'' = -4 x - 0.4 x' (+ 1 after 7.5) from (0.5, 0), by matrix exponentials."""
    A = np.array([[0, 1], [-4, -0.4]])
    at = expm(A * 7.5) @ [0.5, 0]
    return tuple((np.array([0.25, 0]) + expm(A * (t - 7.5)) @ (at - [0.25, 0])).tolist())


ISSUES = {
    "openmodelica_9711": Case((0,), (0, 1), {"y0 - 0.5": ("jump", (1,))}, ("hang",), 1, (0.5,)),
    "scipy_18039": Case(
        (0,), (0, 100), {"t - 60": ("time", (2,))}, ("missed",), 61,
        (after_pulse(61, 60, 60.5, 1, 0.05) + after_pulse(61, 1, 1.5, 1, 0.05),), near=1e-8,
    ),
    "differential_equations_167": Case(
        (0, 1), (0, math.pi), {"sin(40*t)": ("time", (3,))}, ("wrong curve",), math.pi / 40 * 3,
        (math.pi / 40, math.exp(-math.pi / 40 * 3)),
    ),
    "chebfun_1512": Case(
        (0,), (0, 20), {"t - 10": ("time", (4,)), "t - 1": ("kink", (5,))}, ("missed",), 11,
        (after_pulse(11, 10, 10.05, 20, 1),), near=1e-8,
    ),
    "diffrax_58": Case((0.5, 0), (0, 15), {"t - 7.5": ("time", (6,))}, (), 15, forced(15)),
    "opty_476": Case((0, 1), (0, 5), {"v": ("jump", (7,))}, ("hang",), 5, (None, 0)),
    "scipy_9228": Case(
        (-120, 0), (-8, 4), {"q": ("jump", (8,))}, ("wrong curve",), 4, (120, 6), {"rtol": 1e-4}
    ),
    "diffrax_507": Case(
        (0, 0), (0, 10), {"x - 2.5": ("jump", (9,)), "x - 2.51": ("jump", (9,))}, ("missed",), 10, (10, 1)
    ),
    "cyrk_98": Case((1, 0), (0, 3), {"x + 0.999": ("jump", (10,))}, (), 3, (math.cos(3), -math.sin(3))),
    "diffeqbase_634": Case(
        (0, 0), (0, 4), {"t": ("time", (11,)), "v": ("jump", (12,))}, ("hang",), math.asin(1 / 3) / 6, (0, 0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ISSUES)
def test_15_5_programs_after_public_issues(name: str) -> None:
    case = ISSUES[name]
    found = diagnose(getattr(issues, name), case.x0, case.t_span, max_calls=4000, **(case.options or {}))
    assert found.system is not None, str(found)
    assert found.solution is not None
    for surface, (kind, marks) in case.surfaces.items():
        switch = found.switches[found.system.surface_place(surface)[0]]
        assert (switch.kind, set(switch.lines)) == (kind, marked(*marks))
    kinds = {finding.kind for finding in found.findings}
    kinds |= {"hang"} if "chattering" in kinds else set()
    assert set(case.found) <= kinds, str(found)
    assert not kinds & {"differs", "not translated", "exception"}, str(found)
    for value, known in zip(found.solution.sol(case.t), case.x, strict=True):
        assert known is None or abs(value - known) < case.near * (1 + abs(known))


# -- what the reader follows, and what it refuses by line ---------------------------------------------------

REFUSED = {
    int(mark): (i, line)
    for i, line in enumerate(Path(refused.__file__).read_text(encoding="utf-8").splitlines(), 1)
    for mark in re.findall(r"# <(\d+)>", line)
}


@pytest.mark.parametrize(
    ("mark", "name", "said"),
    [
        (1, "quantised", "steps without end"), (2, "wrapped", "steps without end"),
        (3, "noisy", "another value"),
        (4, "looping", "a loop that the state or the time ends"),
        (5, "looked_up", "an index that depends on the state"),
        (6, "counting", "it remembers calls"), (7, "named_mode", "it remembers mode, str"),
        (8, "silent", "it returns nothing"), (9, "tried", "try is not followed"),
        (10, "too_few", "1 rates for 2 states"), (11, "unset", "'force' is not set on every path"),
        (12, "sorted_state", "not followed with these arguments"),
        (13, "lagging", "in which it keeps a record"),
        (14, "counted", "arithmetic with two conditions"),
        (15, "tabled", "np.interp(u, x, y) is followed"), (16, "scheduled", "in tables of rising numbers"),
        (17, "pieces", "3 functions for 1 condition, expected as many or one more"),
        (18, "largest", "write its cases with if"),
        (19, "matched", "case True asks for Python's own True"),
        (20, "masked", "a part of an array whose length depends"),
    ],
)  # fmt: skip
def test_15_5_what_cannot_be_translated_is_refused_by_line(mark: int, name: str, said: str) -> None:
    n = 2 if name in {"too_few", "unset", "sorted_state"} else 1
    with pytest.raises(ReadingError, match=re.escape(said)) as caught:
        translate(read_program(getattr(refused, name), n), (0.5,) * n, (0.0, 1.0))
    assert caught.value.line == REFUSED[mark][0]
    assert f"line {REFUSED[mark][0]}" in str(caught.value)


def test_15_5_a_refusal_is_a_finding_and_the_run_is_shown() -> None:
    found = diagnose(refused.looping, (3.5,), (0, 1))
    assert found.system is None
    assert found.run.nfev > 0
    assert [finding.kind for finding in found.findings] == ["not translated"]
    assert found.findings[0].lines == (REFUSED[4][0],)
    refused.calls = 0
    assert diagnose(refused.counting, (1.0,), (0, 1)).of("not translated")


@pytest.mark.parametrize("seed", [0, 2, 4, 5, 6, 8])
def test_15_5_random_programs_have_the_field_of_their_system(seed: int, tmp_path: Path) -> None:
    path = tmp_path / f"drawn_{seed}.py"
    path.write_text(Draw(seed).text(), encoding="utf-8")
    f = load_file(path).f
    translation = translate(read_program(f, 3), (0.1, 0.2, 0.3), (0.0, 5.0))
    states = np.random.default_rng(seed).normal(size=(3, 50))
    said, compared = disagreement(f, translation, np.linspace(0, 5, 50), states)
    assert not said, path.read_text(encoding="utf-8")
    assert compared > 100


def test_15_5_equalities_of_steps_are_decided() -> None:
    translation = translate(read_program(programs.compared_steps, 2), (1.0, 0.0), (0.0, 5.0))
    states = np.random.default_rng(0).normal(size=(2, 50))
    said, compared = disagreement(programs.compared_steps, translation, np.linspace(0, 5, 50), states)
    assert not said
    assert compared > 200


def test_15_5_a_wrong_translation_is_noticed() -> None:
    translation = translate(read_program(programs.oscillator, 2), (1.0, 0.0), (0.0, 5.0))
    states = np.random.default_rng(0).normal(size=(2, 50))

    def narrow(t: float, y: Any) -> Any:
        return np.add(programs.oscillator(t, y), [0.0, 1.0 if abs(y[1]) < 1e-4 else 0.0])

    assert not disagreement(programs.oscillator, translation, np.linspace(0, 5, 50), states)[0]
    said, _ = disagreement(narrow, translation, np.linspace(0, 5, 50), states)
    assert "is not what the program does" in said


@pytest.mark.parametrize("name", ["oscillator", "belt", "pwm", "thermostat", "stuck_by_equality"])
def test_15_5_the_printed_system_is_the_one_that_was_solved(name: str) -> None:
    case = CASES[name]
    translation = translate(read_program(program(name), len(case.x0)), case.x0, case.t_span)
    made: dict[str, Any] = {}
    exec(translation.code, made)  # noqa: S102  (the text that the doctor printed itself)
    theirs, ours = made["solution"], solve(translation.system, translation.x0, case.t_span)
    assert [str(e.kind) for e in theirs.events] == [str(e.kind) for e in ours.events]
    assert np.allclose(theirs.events.t, ours.events.t, atol=1e-9)
    assert np.allclose(theirs.x_end, ours.x_end, atol=1e-9)


def test_15_5_what_a_program_remembers_is_put_back() -> None:
    programs.heating = True
    diagnose(programs.thermostat, (15,), (0, 5))
    assert programs.heating is True
    relay = programs.Relay(0.1)
    diagnose(relay.rhs, (0,), (0, 1))
    assert relay.up is True


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"x0": "a"}, "x0"), ({"t_span": (1, 0)}, "t_span"), ({"method": "RK4"}, "did you mean 'RK45'?"),
        ({"max_calls": 0}, "max_calls"), ({"x0": [float("nan")]}, "finite"),
    ],
)  # fmt: skip
def test_15_5_arguments_are_checked(given: dict[str, Any], said: str) -> None:
    values: dict[str, Any] = {"x0": (1.0,), "t_span": (0, 1), **given}
    x0, t_span = values.pop("x0"), values.pop("t_span")
    with pytest.raises(UsageError, match=re.escape(said)):
        diagnose(programs.relay_loop, x0, t_span, **values)
    with pytest.raises(ModelError, match="has no source"):
        diagnose(math.sin, (1.0,), (0, 1))


def test_15_5_the_command_says_whose_code_it_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(programs.__file__)
    words = ["diagnose", f"{path}:oscillator", "--x0", "1.1,0", "--t-span", "0", "12", "--max-calls", "2000"]
    assert main([*words, "-o", str(tmp_path), "--json"]) == 0
    out, err = capsys.readouterr()
    data = json.loads(out)
    assert err.index("runs ") < err.index("surface v = 0")
    assert "naive_programs.py to import it" in err
    assert data["switches"][0]["sites"][0]["line"] in lines(1)
    assert data["motion"]["largest_difference"] < 1e-3
    assert {p.name for p in tmp_path.iterdir()} == {
        "diagnosis.json", "diagnosis.txt", "diagnosis.png", "system.py",
    }  # fmt: skip
    assert "sign(v)" in (tmp_path / "system.py").read_text(encoding="utf-8")
    assert main(["diagnose", f"{path}:oscilator", "--x0", "1", "--t-span", "0", "1"]) == 2
    assert "did you mean 'oscillator'?" in capsys.readouterr().err
    assert main(["diagnose", f"{path}:oscillator", "--t-span", "0", "1"]) == 2
    assert "--x0 is missing" in capsys.readouterr().err


def test_15_5_a_backlash_is_a_corner_and_no_dead_band_written_by_hand(tmp_path: Path) -> None:
    """k (d -+ gap) beyond a gap of the shaft, 0 inside it: the field is continuous at both ends."""
    source = tmp_path / "shaft.py"
    source.write_text(
        "def shaft(t, s):\n    a, w = s\n"
        "    if abs(a) <= 0.02: T = 0\n"
        "    elif a > 0: T = 100*(a - 0.02)\n"
        "    else: T = 100*(a + 0.02)\n"
        "    return [w, 1 - T - 0.5*w]\n"
    )
    found = diagnose(load_file(source).shaft, (0, 0), (0, 20))
    assert {switch.kind for switch in found.switches} == {"kink"}
    assert not found.of("dead band")
    assert found.solution is not None
    assert found.solution.x_end == pytest.approx([0.03, 0], abs=0.01)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.1 + 0.05, "0.15"), (0.1 * 3, "0.3"), (1 / 3, "0.3333333333333333"), (math.pi, "3.141592653589793"),
     (-0.7 * 0.1, "-0.07"), (2.0, "2"), (1e-3 + 2e-19, "0.001"), (0.1234567890123457, "0.1234567890123457")],
)  # fmt: skip
def test_12_7_numbers_are_printed_without_the_rounding_of_what_made_them(value: float, text: str) -> None:
    assert number(value) == text
    assert float(text) == pytest.approx(value, rel=1e-15)
