"""Mistakes of people who come from scipy, MATLAB or sympy: each message names the place and the cure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from told import told

from filippov import (
    EventKind,
    Max,
    Problem,
    Solution,
    Status,
    Stop,
    Surface,
    System,
    cos,
    models,
    parameters,
    plot,
    sign,
    solve,
    solve_many,
    sqrt,
    states,
    t,
)
from filippov.analysis import (
    EventMap,
    Orbit,
    Section,
    Stroboscope,
    bifurcation,
    brute_force,
    compare,
    find_orbit,
    find_section,
)
from filippov.app.cli.main import main
from filippov.graphs import load_graph

x, v = states("x v")
p = parameters(mu=0.2, A=1.0)
MASS = System({x: v, v: -x - p.mu * sign(v)})
RUN = solve(MASS, (1.1, 0), (0, 12))
SECTION = Section("v", "crossing up", "x", {"x": "-d", "v": "0"})
TIMES = np.linspace(0, 5, 200)
PROBLEM = Problem(MASS, (1, 0), (0, 1))
ENDS = solve_many(MASS, [(1, 0), (2, 0), (3, 0)], (0, 12))
TREE = solve(MASS, (1, 0), (0, 1), nonunique="branch")
FORCED = System({x: v, v: -2 * x - 0.3 * v + p.A * cos(t)})
WATCHED = System({x: v, v: -x}, surfaces=[Surface("half", x - 0.5, kind="observer")])
ORBIT = find_orbit(FORCED, (0, 0))
RELAY = System({x: v, v: p.A * (1 - x**2) * v - x})


class Labelled:
    """What a Series of pandas looks like."""

    def __init__(self, values: dict[str, float]) -> None:
        self.keys, self.items = values.keys, values.items


def strobed(system: System, period: float) -> object:
    strobe = Stroboscope("x", period=period)
    return bifurcation(system, strobe, parameter="A", values=[1.0, 1.2], x0=(1, 0))



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
    "a kind of event": (lambda: EventKind("stick"), "unknown kind of event 'stick'", "Write 'sliding entry'"),
    "a misspelt kind": (lambda: EventKind("crosing"), "unknown kind of event 'crosing'", "mean 'crossing'"),
    "a status": (lambda: Status("sucess"), "unknown status 'sucess'", "did you mean 'success'"),
    "a graph that is not there": (
        lambda: load_graph("nowhere.json"), "'nowhere.json' cannot be read (No such file", "give its path",
    ),
    "a folder for a graph": (lambda: load_graph("."), "'.' cannot be read (Is a directory", "as save_graph("),
    "a package called": (lambda: plot(RUN), "filippov.plot is a package", "solution.plot() draws"),
    "another package called": (lambda: models("hunting"), "filippov.models is a package", "models.get("),
    "a run of an ensemble by a state": (lambda: ENDS["x"], "ensemble['x']", "ensemble.x[:, 0]"),
    "a run after the last": (lambda: ENDS[3], "no trajectory 3", "there are 3, numbered from 0"),
    "the length of a solution": (lambda: len(RUN), "no length", "len(solution.t)"),
    "a problem with another state": (
        lambda: PROBLEM.with_x0((2, 0)), "a Problem has no attribute 'with_x0'", "problem.remake(x0=",
    ),
    "a problem that solves itself": (lambda: PROBLEM.solve, "no attribute 'solve'", "solve(problem)"),
    "a tree of another state": (lambda: TREE.plot("w"), "unknown state 'w'", "known: x, v"),
    "no values of a diagram": (
        lambda: bifurcation(MASS, SECTION, parameter="mu", values=[], interval=(0.1, 1)), "values is []",
        "one number or more",
    ),
    "no values of a diagram by iteration": (
        lambda: brute_force(MASS, None, "mu", [], (1, 0)), "values is []", "one number or more",
    ),
    "a section of nothing": (
        lambda: find_section(System({x: v, v: -x}), (1, 0)), "there is none in the system",
        "Section('half', 'crossing up', 'v')",
    ),
    "strobes that fit no forcing": (
        lambda: strobed(FORCED, 1.0), "every 1, at which it is never back", "Leave period out",
    ),
    "strobes of a system of its own": (lambda: strobed(RELAY, 1.0), "every 1, at", "or take a Section"),
    "an observer's section": (lambda: find_section(WATCHED, (1, 0)), "there is none", "kind='observer'"),
    "stamps for the span": (
        lambda: solve(MASS, (1, 0), (np.datetime64(0, "s"), np.datetime64(9, "s"))), "t_span: t0 is",
        "Give seconds",
    ),
    "a table of parameters": (
        lambda: solve(MASS, (1, 0), (0, 1), parameters=Labelled({"mu": 0.1})), "(Labelled)",
        "parameters=dict(",
    ),
    "a complex state": (lambda: solve(MASS, (1 + 0j, 0), (0, 1)), "type complex128", "Take .real"),
    "a symbol for a state": (lambda: solve(MASS, (p.mu, 0), (0, 1)), "x0 is (mu, 0)", "in place of symbols"),
    "worker processes of an ensemble": (
        lambda: solve_many(MASS, [(1, 0)], (0, 1), jobs=4), "solve_many runs in this process", ".run(jobs=4)",
    ),
    "a folder for a file": (lambda: RUN.save("."), "is a folder", "the name of a file in it"),
    "a solution that is not there": (lambda: Solution.load("no.npz"), "'no.npz'", "from the present folder"),
    "an orbit that is not there": (lambda: Orbit.load("no.json"), "'no.json'", "from the present folder"),
    "parameters declared twice": (
        lambda: System({x: -p.mu * sign(x) - parameters(mu=0.3).mu}), "with the defaults 0.",
        "and write p.mu",
    ),
    "an event as text": (lambda: solve(MASS, (1, 0), (0, 1), events="x - 1"), "'x - 1'", "without quotes"),
    "a parameter of a problem": (
        lambda: PROBLEM.remake(mu=0.3), "mu is a parameter", "parameters={'mu': 0.3}",
    ),
    "the states of an orbit by order": (lambda: ORBIT.plot("x"), "2 values in order", "states=..."),
    "the period of an orbit": (lambda: ORBIT.T, "no attribute 'T'", "period is period"),
    "a solution between its times": (lambda: RUN.interpolate(1.0), "'interpolate'", "solution.sol(t)"),
    "ends of an ensemble": (lambda: ENDS.t_end, "no attribute 't_end'", "t and x"),
    "an ensemble for what is measured": (
        lambda: solve_many(MASS, [(1, 0)], (0, 1), measure=lambda ends: ends), "measure returned Ensemble",
        "a row for each",
    ),
    "a solution for a state": (lambda: solve(MASS, RUN, (0, 1)), "x0 is Solution", "Give its .x_end"),
    "the end of one of many for a state": (lambda: solve(MASS, ENDS[0], (0, 1)), "x0 is End", "Give its .x."),
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
    told(*MISTAKES[name])


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


def test_an_ensemble_gives_its_trajectories_one_by_one() -> None:
    assert len(ENDS) == len(list(ENDS)) == 3
    assert ENDS[-1].x.tolist() == ENDS.x[2].tolist()
    assert ENDS[0][0] == 12.0
    assert ENDS[0].status is Status.SUCCESS
    assert len(TREE) == len(TREE.paths()) == 1
    assert TREE[0].x_end.tolist() == TREE.paths()[0].x_end.tolist()
    assert RUN


@pytest.mark.parametrize("gains", [(1.5, 1.1), (5.0, 1.1)])
def test_super_twisting_by_plain_functions_is_told_to_be_written_as_expressions(gains: Any) -> None:
    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [x[1] - gains[0] * abs(x[0]) ** 0.5 * s[0], -gains[1] * s[0]]

    plain = System(field=field, surfaces=[Surface("s", lambda t, x, p: x[0])], states="x y")
    run = solve(plain, (1, 0), (0, 20), zeno="continue")
    if run.success:
        assert np.max(np.abs(run.x_end)) < 1e-9
    else:
        assert "super-twisting control" in run.message
        assert "Write it as expressions: System({x: y - k1*sqrt(abs(x))*sign(x)" in run.message
        assert "zeno=" not in run.message
    assert gains[0] > 2 or not run.success
    written = System({x: v - gains[0] * sqrt(abs(x)) * sign(x), v: -gains[1] * sign(x)})
    done = solve(written, (1, 0), (0, 20), zeno="continue")
    assert done.success
    assert np.max(np.abs(done.x_end)) < 1e-9


h, g = states("h g")
q = parameters(k=0.3)
EDGES: dict[str, tuple[Any, str]] = {
    "a tank that empties": (-q.k * sqrt(h), "write sqrt(Max(h, 0))"),
    "a tank down to its outlet": (-q.k * sqrt(h - 0.2) - 0.1, "comes to 0 here, below which it has no value"),
    "a power": (-(h**1.5) - 0.2, "write Max(h, 0)**1.5"),
    "a division": (-1 / (h + 1) ** 3 - 1 / h, "dh/dt is divided by h"),
    "a root of time": (sqrt(1 - t), "sqrt(1 - t)"),
    "a root of what is below 0": (sqrt(-h), "sqrt(-h), which has no value here, where -h is -1"),
    "one that moves": (1 / (g - h) - 1, "dh/dt is divided by g - h"),
}


@pytest.mark.parametrize("name", EDGES)
def test_what_has_no_value_beyond_the_end_of_a_run_is_named(name: str) -> None:
    rate, cure = EDGES[name]
    run = solve(System({h: rate, g: -0.5 + 0 * g}), (1, 1.5 if "moves" in name else 0.2), (0, 10))
    assert not run.success
    assert cure in run.message
    assert "surface not declared" not in run.message


@pytest.mark.parametrize("k", [0.3, 1e-4, 50.0])
def test_a_tank_that_empties_stays_empty_with_the_root_that_is_told(k: float) -> None:
    """h' = -k sqrt(h): sqrt(h) = 1 - k t/2 until t = 2/k."""
    run = solve(System({h: -q.k * sqrt(Max(h, 0))}), (1,), (0, 4 / k), parameters={"k": k})
    assert run.success
    assert run.x_end[0] == 0.0
    assert abs(run.sol(1 / k)[0] - 0.25) < 1e-7
