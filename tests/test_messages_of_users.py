"""Mistakes of people who come from scipy, MATLAB or sympy: each message names the place and the cure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from filippov import (
    EventKind,
    ModelError,
    Problem,
    Status,
    Stop,
    Sweep,
    System,
    UsageError,
    sign,
    solve,
    states,
)
from filippov.analysis import EventMap, Section, compare, tune
from filippov.app.cli.main import main
from filippov.graphs import load_graph

x, v = states("x v")
MASS = System({x: v, v: -x - 0.2 * sign(v)})
RUN = solve(MASS, (1.1, 0), (0, 12))
SECTION = Section("v", "crossing up", "x", {"x": "-d", "v": "0"})
TIMES = np.linspace(0, 5, 200)

MISTAKES: dict[str, tuple[Callable[[], object], str, str]] = {
    "a grid for the span": (lambda: solve(MASS, (1, 0), TIMES), "t_span is", "t_eval=...: t_span=(0.0, 5.0)"),
    "three times": (lambda: solve(MASS, (1, 0), (0, 1, 2)), "(0, 1, 2)", "t_span=(0, 2)"),
    "stop at a stick": (lambda: Stop("v", "stick"), "'stick'", "Write 'sliding entry'"),
    "stop at a slip": (lambda: Stop("v", "slip"), "'slip'", "Write 'sliding exit'"),
    "stop at an impact": (lambda: Stop("floor", "impact"), "'impact'", "Write 'reset'"),
    "events of a bounce": (lambda: RUN.events.of(kind="bounce"), "'bounce'", "Write 'reset'"),
    "section at a stick": (lambda: Section("v", "sticking", "x"), "'sticking'", "Write 'sliding entry'"),
    "stop as a flag": (
        lambda: solve(MASS, (1, 0), (0, 1), stop=True), "stop holds True", "stop=Stop('v', 'crossing')",
    ),
    "one width": (
        lambda: compare(MASS, x0=(1, 0), t_span=(0, 1), against=["tanh"], widths=1e-3), "widths is 0.001",
        "widths=(0.001,)",
    ),
    "states as sympy's": (lambda: states("x", "v"), "states was given several", "x, v = states('x v')"),
    "what is varied": (
        lambda: Sweep(Problem(MASS, (1, 0), (0, 1)), vary={"x0.x": [1]}), "vary is over now", "write over={",
    ),
    "ranges of gains": (
        lambda: tune(MASS, SECTION, ranges={"P": (1, 2)}, interval=(0, 1)), "ranges is over now",
        "write over={",
    ),
    "a kind of event": (lambda: EventKind("stick"), "unknown kind of event 'stick'", "Write 'sliding entry'"),
    "a misspelt kind": (lambda: EventKind("crosing"), "unknown kind of event 'crosing'", "mean 'crossing'"),
    "a status": (lambda: Status("sucess"), "unknown status 'sucess'", "did you mean 'success'"),
    "a graph that is not there": (
        lambda: load_graph("nowhere.json"), "'nowhere.json' cannot be read (No such file", "give its path",
    ),
    "a folder for a graph": (lambda: load_graph("."), "'.' cannot be read (Is a directory", "as save_graph("),
    "section by its name": (lambda: EventMap(MASS, "v"), "section is 'v'", "find_section(system, x0)"),
}  # fmt: skip
COMMANDS: dict[str, tuple[str, str, str]] = {
    "two counts": ("diagram hunting --over P=10:20:7 --count 8", "has 7 values", "give one or the other"),
    "two numbers of cells": ("regions hunting --over P=1:2:7,I=1:2 --cells 8", "--cells is 8", "give one or"),
    "one axis": ("regions hunting --over P=10:20", "given P", "--over NAME=LOW:HIGH for each of the two"),
    "samples of a gain": ("tune hunting --over P=10:20:7", "'10:20:7'", "write P=10:20 --samples 7"),
    "points of a branch": ("continue hunting --over P=10:31:22", "'10:31:22'", "write P=10:31."),
    "what is varied": ("sweep hunting --vary P=10:20:7", "'--vary'", "is now written --over P=10:20:7"),
    "the axes": (
        "regions hunting --x P=10:20 --y=I=1:2", "'--x'",
        "--x and --y are now written --over P=10:20 --over I=1:2",
    ),
    "ranges of gains": ("tune hunting --ranges P=10:20", "'--ranges'", "is now written --over P=10:20"),
    "MATLAB's method": ("simulate hunting --method ode45", "--method is 'ode45'", "use --method 'DP5'"),
    "kind of a stop": ("simulate hunting --stop velocity:stick", "'stick'", "Write 'sliding entry'"),
}

FILES: dict[str, tuple[str, str]] = {
    "sweep": ("[sweep.vary]\nP = '10:20:3'", "[sweep]: 'vary' is now written 'over'"),
    "regions": ("x = 'P=10:20'", "'x' is now written 'over'"),
    "tune": ("[tune]\nranges = {P = '10:20'}", "[tune]: 'ranges' is now written 'over'"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_with_place_and_cure(name: str) -> None:
    call, place, cure = MISTAKES[name]
    with pytest.raises((ModelError, UsageError)) as caught:
        call()
    assert place in str(caught.value)
    assert cure in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_tells_place_and_cure(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, place, cure = COMMANDS[name]
    assert main(words.split()) == 2
    message = capsys.readouterr().err
    assert place in message
    assert cure in message


@pytest.mark.parametrize("name", FILES)
def test_a_file_with_a_name_of_before_is_told_the_one_of_now(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, cure = FILES[name]
    (tmp_path / "settings.toml").write_text(text)
    assert main([name, "hunting", "--config", str(tmp_path / "settings.toml")]) == 2
    assert cure in capsys.readouterr().err


def test_the_command_takes_the_method_that_solve_takes(tmp_path) -> None:
    assert main(["simulate", "pendulum", "--method", "RK45", "--t-span", "0", "1", "--quiet"]) == 0
