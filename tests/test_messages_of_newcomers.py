"""Forty typical mistakes more: each message names the place and the cure."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from told import told

from filippov import (
    Input,
    Piecewise,
    Surface,
    System,
    Table,
    TimeEvent,
    parameters,
    prbs,
    sign,
    solve,
    states,
)
from filippov.analysis import (
    EventMap,
    Section,
    bifurcation,
    compare,
    continuation,
    equilibria,
    find_orbit,
    linearise,
)
from filippov.app.cli.main import main
from filippov.models import get

x, v = states("x v")
p = parameters(k=1, mu=0.2)
S = System({x: v, v: -p.k * x - p.mu * sign(v)}, surfaces=[Surface("v", v)])
RUN = solve(S, (1, 0), (0, 10))
HUNTING = get("hunting")
LOOP, SECTION = HUNTING.build(), Section.from_model(HUNTING)
EQUATIONS = {x: v, v: -x - sign(v)}

# What is written, and words of the answer: where it is, and what to write.
MISTAKES: dict[str, tuple[Callable[[], Any], str, str]] = {
    "surfaces='v'": (lambda: System(EQUATIONS, surfaces="v"), "surfaces is 'v'", "[Surface('v', h)]"),
    "Surface('fr', 'v')": (lambda: Surface("fr", "v"), "surface 'fr'", "without quotes"),
    "Surface(v, 'fr')": (lambda: Surface(v, "fr"), "has the name v", "Surface('v', v)"),
    "Surface('fr')": (lambda: Surface("fr"), "needs h", "Surface(name, h)"),
    "TimeEvent(1.0)": (lambda: TimeEvent(1.0), "the name 1.0", "TimeEvent('tick', period=0.1)"),
    "Table(x, xs, ys)": (lambda: Table(x, [0, 1], [0, 1]), "a Table", "Table(x, y)(u)"),
    "Input of unequal lengths": (lambda: Input("r", [0, 1, 2], [0, 1]), "'r'", "as many of each"),
    "Input, times not in order": (lambda: Input("r", [0, 2, 1], [0, 1, 2]), "t[1] = 2", "increasing times"),
    "Input(kind='spline')": (lambda: Input("r", [0, 1], [0, 1], kind="spline"), "'spline'", "'cubic'"),
    "prbs()": (prbs, "prbs needs", "prbs(name, clock)"),
    "a set of equations as a list": (lambda: System([v, -x - sign(v)]), "equations are", "{x: dx/dt"),
    "equations as text": (lambda: System({"x": "v", "v": "-x"}), "given for 'x'", "states('x v')"),
    "a state without equation": (lambda: System({x: v}), "'v'", "add its equation"),
    "Piecewise with ==": (
        lambda: Piecewise((0, v == 0), (1, v > 0), (-1, True)), "condition 1 of 3 is False", "== and !="),
    "Piecewise with !=": (
        lambda: Piecewise((1, v != 0), (0, True)), "condition 1 of 2 is True", "(a, x > 0), (b, True)"),
    "a Piecewise without an end": (
        lambda: System({x: v, v: Piecewise((1, x > 0))}), "the equation of 'v'", "(expression, True)"),
    "0 < x < 1": (lambda: System({x: v, v: Piecewise((1, 0 < x < 1), (0, True))}), "Relational", "& and |"),
    "a parameter in quotes": (lambda: parameters(k="1"), "parameter 'k'", "to a float"),
    "outputs=[v]": (lambda: System(EQUATIONS, outputs=[v]), "outputs is", "a dict"),
    "width=-0.1": (lambda: System(EQUATIONS, surfaces=[Surface("v", v, width=-0.1)]), "surface 'v'", ">= 0"),
    "kind='reset' without one": (
        lambda: System({x: v, v: -1}, surfaces=[Surface("floor", x, kind="reset")]), "'floor'", "reset={v:"),
    "t_span=10": (lambda: solve(S, (1, 0), 10), "t_span is 10", "t_span=(0, 10)"),
    "t_span=linspace": (lambda: solve(S, (1, 0), np.linspace(0, 10, 50)), "t_span is", "t_eval=..."),
    "x0 of one state": (lambda: solve(S, {"x": 1}, (0, 1)), "no value for v", "one for each of"),
    "max_step in quotes": (lambda: solve(S, (1, 0), (0, 1), max_step="0.1"), "max_step", "without quotes"),
    "dt=0.01": (lambda: solve(S, (1, 0), (0, 1), dt=0.01), "dt", "max_step"),
    "solve(System, ...)": (lambda: solve(System, (1, 0), (0, 1)), "the class System", "System({"),
    "run[0]": (lambda: RUN[0], "by name, not by 0", "solution['x']"),
    "x^2": (lambda: RUN.evaluate("x^2", 1.0), "'x^2'", "**"),
    "a folder that is not there": (lambda: RUN.save("/no/such/run.npz"), "/no/such/run.npz", "make it first"),
    "EventMap of a solution": (lambda: EventMap(RUN, SECTION), "system is Solution", "Give its .system"),
    "an interval of one number": (
        lambda: bifurcation(LOOP, SECTION, parameter="P", values=[10, 20], interval=0.5),
        "interval is 0.5", "interval=(low, high)"),
    "a branch from a state": (
        lambda: continuation(LOOP, (0.1, 0, 0), parameter="P", bounds=(9, 20)), "the start",
        "find_orbit(system, x0)"),
    "an orbit of nothing": (lambda: find_orbit(S), "find_orbit", "a state on or near the orbit"),
    "linearise at numbers": (lambda: linearise(S, (0, 0)), "an EquilibriumPoint", "equilibria(system)"),
    "equilibria of a state": (lambda: equilibria(S, "x"), "parameters is 'x'", "{name: value}"),
    "compare of nothing": (lambda: compare(S), "compare needs", "compare(system, x0, t_span)"),
}  # fmt: skip

COMMANDS = {
    "simulte hunting": "unknown command 'simulte'; did you mean 'simulate'?",
    "plot hunting": "filippov simulate MODEL -o DIR",
    "describe hunting": "filippov models describe NAME",
    "simulate hunting --t-span 10": "--t-span T0 T1",
    "simulate hunting --params P=10": "-p NAME=VALUE",
    "simulate hunting --x0 0.1": "--x0 gives 1 number, expected 3 numbers (states: x, v, z): --x0 x=...",
    "identify no_such.csv": "there is no file 'no_such.csv'",
}


@pytest.mark.parametrize("name", MISTAKES)
def test_16_4_the_answer_names_the_place_and_the_cure(name: str) -> None:
    told(*MISTAKES[name])


@pytest.mark.parametrize("line", COMMANDS)
def test_16_4_commands_are_answered(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line.split()) == 2
    assert COMMANDS[line] in capsys.readouterr().err
