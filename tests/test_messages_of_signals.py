"""Samples in other forms, and files with other marks, are refused with what to write; none is misread."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from filippov import Input, ModelError, System, chirp, solve, states
from filippov.app.cli.main import main

X = states("x")
GOOD = "0,1\n1,-2\n2,3\n5,3\n"  # held: 1 - 2 + 3*3 = 8


def end(path: Path, text: str) -> float:
    path.write_bytes(text.encode())
    run = solve(System({X: Input.from_csv("u", path, kind="hold")}), (0.0,), (0, 5))
    return float(run.x_end[0])


@pytest.mark.parametrize("text", [
    GOOD, "t,u\n" + GOOD, "\ufefft,u\n" + GOOD, "t,u\r\n" + GOOD.replace("\n", "\r\n"),
    "# by hand\n\nt,u\n" + GOOD, "t , u\n" + GOOD.replace(",", " , "),
    "t,u,\n" + GOOD.replace("\n", ",\n"), "t,u\n" + GOOD.replace("\n", ",\n"),
    "t,w,u\n" + GOOD.replace(",", ",9,"), '"t","u"\n' + GOOD,
])  # fmt: skip
def test_16_h_files_that_are_read(text: str, tmp_path: Path) -> None:
    assert end(tmp_path / "u.csv", text) == 8


@pytest.mark.parametrize(("text", "told"), [
    ("t;u\n" + GOOD.replace(",", ";"), "separated by semicolons"),
    ("t;u\n" + "0,0;1,5\n1,0;2,5\n", "sep=';', decimal=','"),
    ("t\tu\n" + GOOD.replace(",", "\t"), "separated by tabs"),
    ("t,u\n0,0,1,5\n1,0,-2,5\n", "4 fields, expected 2"),
    ("# by hand\n\nt,u\n0,1\n1,abc\n", "line 5: '1,abc' has no numbers"),
    ("t,u\n0,1\n1\n", "line 3: '1' has no numbers"),
    ("t,u\n0,1\n1,nan\n", "not finite"),
])  # fmt: skip
def test_16_h_files_that_are_refused(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"u\.csv|input 'u'") as caught:
        end(tmp_path / "u.csv", text)
    assert told in str(caught.value)


class Frame:
    """What a table of pandas looks like."""

    columns = ("t", "force")

    def to_numpy(self) -> np.ndarray:
        return np.zeros((2, 2))


STAMPS = np.array(["2020-01-01T00:00:00", "2020-01-01T00:00:01"], dtype="datetime64[s]")


@pytest.mark.parametrize(("t", "values", "options", "told"), [
    (STAMPS, [0, 1], {}, "(stamps - stamps[0]) / np.timedelta64(1, 's')"),
    (STAMPS - STAMPS[0], [0, 1], {}, "durations / np.timedelta64(1, 's')"),
    (["0", "1"], [0, 1], {}, "np.asarray(given, dtype=float)"),
    (Frame(), None, {}, "Input('u', table['t'], table['force'])"),
    ([0, 1], Frame(), {}, "values is a table with the columns t, force"),
    (np.sin, None, {}, "Input('u', times, f(times))"),
    ("u.csv", None, {}, "Input.from_csv('u', 'u.csv')"),
    ([0, 1], [0, 1], {"kind": "zoh"}, "Write kind='hold'"),
    ([0, 1], [0, 1], {"kind": "spline"}, "Write kind='cubic'"),
])  # fmt: skip
def test_16_h_samples_in_other_forms(t: object, values: object, options: dict[str, str], told: str) -> None:
    with pytest.raises(ModelError) as caught:
        Input("u", t, values, **options)
    assert told in str(caught.value)


@pytest.mark.parametrize("option", ["sep", "delimiter", "decimal"])
def test_16_h_options_of_pandas(option: str, tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text(GOOD)
    with pytest.raises(ModelError, match=rf"pandas.read_csv\(path, {option}="):
        Input.from_csv("u", tmp_path / "u.csv", **{option: ";"})


@pytest.mark.parametrize("duration", [0, -3, np.inf])
def test_16_h_a_chirp_takes_time(duration: float) -> None:
    with pytest.raises(ModelError, match=r"duration is .*expected a number > 0"):
        chirp(1, 2, duration)


@pytest.mark.parametrize(("words", "told"), [
    (["identify", "{file}"], "semicolons, expected commas"),
    (["simulate", "{model}", "--input", "F={file}"], "pandas.read_csv('u.csv', sep=';', decimal=',')"),
    (["simulate", "{model}", "-p", "F=1,5"], "'F=1,5', in which '5' has no name"),
    (["sweep", "{model}", "--over", "F=0,1,2"], "values of a sweep are LOW:HIGH:COUNT"),
    (["orbit", "{model}", "--x0", "0", "--period", "abc"], "period is 'abc'"),
    (["simulate", "{many}", "--t-span", "0", "1"], "a1=...,... (a value for each of the 20"),
])  # fmt: skip
def test_16_f_commands(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "u.csv").write_text("t;F\n0,0;1,5\n1,0;2,5\n")
    (tmp_path / "own.py").write_text(
        "from filippov import System, cos, parameters, states, t\n"
        "x = states('x')\np = parameters(F=1)\nsystem = System({x: -x + p.F*cos(t)})\n"
        "many = System({a: -a for a in states(' '.join(f'a{k}' for k in range(20)))})\n"
    )
    own = f"{tmp_path}/own.py"
    names = {"file": tmp_path / "u.csv", "model": f"{own}:system", "many": f"{own}:many"}
    assert main([word.format(**names) for word in words]) in (1, 2)
    assert told in capsys.readouterr().err
