"""Every flag of every command, given oddly on the command line and in a file: refused with its name."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from filippov import UsageError
from filippov.app.cli import values
from filippov.app.cli.catalogue import commands
from filippov.app.cli.configuration import Option
from filippov.app.cli.main import main

NUMBERS = [
    "abc", "nan", "inf", "-inf", "1e400", "1+", "[1]", "(", "9**9**9", "1,2", "é", "1;2", "k", "True", "1j",
    "__import__('os')",
]  # fmt: skip
ODD: dict[Any, list[Any]] = {
    values.number: NUMBERS,
    values.whole: [*NUMBERS, "0", "-1", "1.5"],
    values.whole_or_zero: [*NUMBERS, "-1", "1.5"],
    values.any_whole: [*NUMBERS, "1.5"],
    values.numbers: ["abc", "nan", "1,abc", "[1"],
    values.pair: [["0", "abc"], ["0", "nan"], ["1"], ["1", "2", "3"]],
    values.named_numbers: ["k", "k=", "=1", "k=abc", "k=nan", "k=1e400", "k=1,k=2", ["k=1", "k=2"]],
    values.named_ranges: ["k", "k=", "k=1", "k=1:2:3", "k=a:b", "k=2:1", "k=nan:1", "k=0:1,k=1:2"],
    values.sampled_ranges: ["k", "k=1", "k=1:2:3", "k=a:b", "k=2:1", "k=0:1,k=1:2"],
    values.counted_ranges: ["k", "k=1", "k=1:2:0", "k=1:2:1.5", "k=1:2:3:4", "k=a:b", "k=2:1", "k=nan:1:2"],
    values.varied: ["k", "k=", "k=a:b:c", "k=1:2:3:4", "k=1:2:0", "k=1:2:1.5", "k=1:nan", "k=1,k=2"],
    values.tolerance: ["abc", "nan", "1,abc"],
    values.state: ["abc", "1,nan", "x=abc", "x=1,x=2", "x="],
    values.policy: ["zzz", "+,x", "sticks"],
    values.releases: ["abc", "-1", "nan"],
    values.signals: ["k", "=f.csv", "k=missing.csv,kind", "k=f.csv,kinds=hold"],
    values.text: ["", " "],
}
IN_FILES: dict[Any, list[str]] = {
    values.number: ["true", "[1]", "{a = 1}", "1979-05-27", "nan", "inf", "1" + "0" * 400],
    values.whole: ["true", "false", "1.5", "nan", "0", "1" + "0" * 400],
    values.whole_or_zero: ["true", "false", "-1", "1.5"],
    values.any_whole: ["true", "1.5", "[]"],
    values.switch: ["0", "1", '"no"', '"true"', "[]"],
    values.text: ["5", "true", "[]", '""', "{}"],
    values.named_numbers: ["5", "true", "{k = true}", "{k = []}", "{k = nan}"],
    values.pair: ["5", "[1]", "[1, 2, 3]", "[1, true]", "[1, nan]"],
    values.texts: ["5", "[5]", "[[]]", '[""]'],
}


def every_option() -> list[tuple[str, Option]]:
    return [(command.name, option) for command in commands().values() for option in command.settings]


def refused(command: str, option: Option, value: Any) -> str:
    """What is wrong with how a value is taken; "" where it is refused by name."""
    try:
        taken = option.read(value, option.name)
    except UsageError as error:
        fits = option.name in str(error) and len(str(error)) < 1000
        return "" if fits else f"{command} {option.name}: {value!r:.60}: {error!s:.200}"
    except Exception as error:  # noqa: BLE001  # it is told of
        return f"{command} {option.name}: {value!r:.60}: {error!r:.200}"
    return f"{command} {option.name}: {value!r:.60} is taken for {taken!r:.60}"


def test_18_3_odd_values_of_flags_are_refused() -> None:
    wrong = []
    for command, option in every_option():
        words = ODD.get(option.read, [])
        if getattr(option.read, "__qualname__", "").startswith("one_of"):
            words = ["zzz", "", "5"]
        wrong += [refused(command, option, word) for word in words]
    assert len(wrong) > 1000
    assert not [sentence for sentence in wrong if sentence]


def test_18_3_odd_settings_of_a_file_are_refused() -> None:
    """In TOML numbers, flags and texts have kinds of their own."""
    wrong = []
    for command, option in every_option():
        for text in IN_FILES.get(option.read, []):
            value = tomllib.loads(f"value = {text}")["value"]
            wrong.append(refused(command, option, value))
    assert len(wrong) > 300
    assert not [sentence for sentence in wrong if sentence]


def test_18_3_the_side_of_a_saddle_may_be_negative() -> None:
    """As its help says: 1, -1 or 0."""
    (side,) = (q for q in commands()["homoclinic"].settings if q.name == "side")
    assert [side.read(text, "side") for text in ("1", "-1", "0")] == [1, -1, 0]


@pytest.mark.parametrize(
    "words",
    [
        ["simulate", "hunting", "-p", "P=1", "-p", "P=2"],
        ["simulate", "hunting", "--x0", "x=1,x=2"],
        ["attractors", "hunting", "--seed", "-1"],
        ["sweep", "hunting", "--over", "P=1:2:1.5"],
    ],
)
def test_18_3_a_command_ends_before_its_work(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    assert "Error:" not in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("words", "flags"),
    [
        ("event-map hunting --iterates 5", "--iterates"),
        ("bifurcation coupled --x0 0,0 --over k=1:2:2 -j 4 --max-memory 5", "--jobs and --max-memory"),
        ("regions hunting --over P=10:20 --over D=1:2 --transient 7", "--transient"),
        ("compare hunting --against band --x0 .1,0,0 --t-span 0 1 --surface velocity", "--surface"),
        ("graph hunting --x0 .1,0,0 --rtol 1e-3", "--x0 and --rtol"),
        ("graph hunting --kind observed --limit 4", "--limit"),
        ("continue hunting --over P=10:11 --start 0.2523 --x0 0,0,0", "--x0"),
        ("continue hunting --over P=10:11 --surface velocity", "--surface"),
        ("attractors hunting --box x=0:1 --resolution 7", "--resolution"),
        ("manifold hunting --x0 0,0,0 --length 1 --period 3", "--period"),
        ("bank schema --rtol 1e-3", "--rtol"),
    ],
)
def test_a_flag_that_would_do_nothing_is_refused(
    words: str, flags: str, own: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each was taken without a word, and the result was that without it."""
    assert main(words.replace(" coupled ", f" {own} ").split()) == 2
    assert f"filippov: {flags} would do nothing here: " in capsys.readouterr().err


@pytest.fixture
def own(tmp_path: Path) -> str:
    (tmp_path / "own.py").write_text(
        "from filippov import System, parameters, sign, states\n"
        "x, v = states('x v')\np = parameters(k=1.0)\n"
        "system = System({x: v, v: -p.k*x + 0.4*v - v*v*sign(v)})\n"
    )
    return f"{tmp_path / 'own.py'}:system"
