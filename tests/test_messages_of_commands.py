"""Messages on commands, sections, parameters and inputs: what was given, what is there, what to write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from filippov import Input, Parameter, Surface, System, sign, solve, states
from filippov.analysis import EventMap, Section, returns
from filippov.app.cli.main import main
from filippov.base.errors import ModelError, UsageError
from filippov.plot import plot_solution

x, v = states("x v")
BLOCK = System({x: v, v: -x - sign(v - 0.5)}, surfaces=[Surface("belt", v - 0.5, radius=1.5)])
RELAY = System({x: v, v: -x - 0.4 * v - sign(x)}, surfaces=[Surface("relay", x, width=0.1)])
TEXT = """from filippov import System, parameters, sign, states
x, v = states("x v")
p = parameters(M=1.0)
block = System({x: v, v: -x - p.M*sign(v)})
"""


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    code = main(list(words))
    return code, capsys.readouterr().err


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.py").write_text(TEXT, encoding="utf-8")
    return tmp_path


def test_words_of_a_flag_end_at_the_next_one(folder, capsys) -> None:
    code, text = said(capsys, "simulate", "model.py:block", "--t-span", "0", "10", "-p", "M", "0.2")
    assert code == 2
    assert "one word goes with -p: -p M=0.2" in text
    _, text = said(capsys, "simulate", "model.py:block", "--x0", "1", "-2", "--t-span", "0", "10")
    assert "one word goes with --x0: --x0 1,-2" in text


def test_the_end_of_a_run_is_its_span(folder, capsys) -> None:
    for flag in ("--tend", "--t-end", "--tmax", "--duration"):
        code, text = said(capsys, "simulate", "model.py:block", flag, "5")
        assert code == 2
        assert "--t-span T0 T1" in text
        assert "did you mean" not in text


def test_a_file_that_is_not_there(folder, capsys) -> None:
    (folder / "f_pi.py").touch()
    code, text = said(capsys, "simulate", "nofile.py:block")
    assert code == 2
    assert "there is no file 'nofile.py'" in text
    assert "did you mean" not in text
    _, text = said(capsys, "simulate", "modell.py:block")
    assert "there is no file 'modell.py'; did you mean 'model.py'?" in text


def test_a_range_without_its_count_says_how_many_values_it_is(folder, capsys) -> None:
    words = "model.py:block", "--measure", "max(x)", "--t-span", "0", "5", "--x0", "2,0"
    code, text = said(capsys, "sweep", *words, "--over", "M=0.1:0.5")
    assert code == 0
    assert "M: 2 values, 0.1 and 0.5; M=0.1:0.5:COUNT takes more" in text
    _, text = said(capsys, "sweep", *words, "--over", "M=0.1:0.5:3")
    assert "COUNT" not in text


def test_no_solution_slides_on_a_hysteresis() -> None:
    """Its runs have crossings only: the sign is left at h = -s width."""
    run = solve(RELAY, (0, 1), (0, 30))
    assert {str(e.kind) for e in run.events} == {"crossing"}
    for kind in ("sliding entry", "sliding exit", "sliding exit up"):
        with pytest.raises(UsageError, match=r"'relay' has a hysteresis.*'crossing up'"):
            EventMap(RELAY, Section("relay", kind, "v", {"x": "0", "v": "d"}))
        with pytest.raises(UsageError, match="'relay' has a hysteresis"):
            returns(RELAY, Section("relay", kind, "v"), (0, 1), 3)


def test_events_that_did_not_come_and_those_that_did() -> None:
    """A block that is carried and slips: entries and exits, and no crossing after the start."""
    run = solve(BLOCK, (0, 0.5), (0, 20))
    kinds = [str(e.kind) for e in run.events]
    assert set(kinds) == {"sliding entry", "sliding exit"}
    found = returns(BLOCK, Section("belt", "crossing up", "x", t_max=20.0), (0, 0.5), 1)
    assert "no 'crossing up' came on 'belt' until t = 20; what came there:" in found.message
    assert f"{kinds.count('sliding entry')} x 'sliding entry'" in found.message
    assert f"{kinds.count('sliding exit')} x 'sliding exit'" in found.message
    turn = EventMap(BLOCK, Section("belt", "crossing up", "x", {"x": "d", "v": "0.5"}, t_max=20.0))
    assert np.isnan(turn(0.0))
    assert f"{kinds.count('sliding exit')} x 'sliding exit'" in turn.why(0.0)
    assert EventMap(BLOCK, Section("belt", "sliding exit", "x", {"x": "d", "v": "0.5"})).why(0.0) == ""


def test_what_a_parameter_is_given_by() -> None:
    with pytest.raises(ModelError, match=r"given as 'kg', 1; the number goes first: Parameter\(1, 'kg'\)"):
        Parameter("kg", 1)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="expected text: Parameter"):
        Parameter(1, 2)  # type: ignore[arg-type]
    cures = {"min": "lower=", "max": "upper=", "bounds": "lower= and upper=", "units": "unit="}
    for word, cure in cures.items():
        with pytest.raises(ModelError, match=cure):
            Parameter(1, **{word: 0})  # type: ignore[arg-type]


def test_an_input_has_a_label() -> None:
    r = Input("r", [0.0, 1.0], [0.0, 1.0], outside="hold")
    system = System({x: v, v: r - x - sign(v)}, labels={"r": "reference [m]"})
    figure = plot_solution(solve(system, (0, 0), (0, 2)), ["x", "r"])
    assert [ax.get_ylabel() for ax in figure.axes] == ["x", "reference [m]"]
    other = system.with_inputs({"r": Input("r", [0.0, 2.0], [0.0, 3.0], outside="hold")})
    assert other.labels == {"r": "reference [m]"}
    with pytest.raises(ModelError, match=r"unknown label 'q'.*known: t, x, v, r"):
        System({x: v, v: r - x - sign(v)}, labels={"q": "reference [m]"})
