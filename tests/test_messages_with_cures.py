"""Messages that told a cause and no cure: each names the place and what to write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from told import told

from filippov import (
    Input,
    ModelError,
    Problem,
    Surface,
    Sweep,
    System,
    Table,
    UsageError,
    parameters,
    sign,
    solve,
    solve_many,
    states,
)
from filippov.analysis import (
    Curve,
    Section,
    basin,
    bifurcation,
    compare,
    continuation,
    describing_function,
    equilibria,
    find_orbit,
    identify_curve,
    lyapunov,
    read_record,
    routh_hurwitz,
    tune,
)
from filippov.app.cli.continuation import _curves
from filippov.app.cli.main import main
from filippov.app.cli.tune import identified
from filippov.model.friction_model import with_friction_model
from filippov.models import get
from filippov.models.driven import driven_mass
from filippov.plot import plot_branches, plot_graph

x, v, z = states("x v z")
MASS = System({x: v, v: -x - 0.2 * sign(v)}, surfaces=[Surface("v", v)])
SMOOTH = System({x: v, v: -x})
RUN = solve(MASS, (1.1, 0), (0, 2))
TREE = solve(MASS, (1.1, 0), (0, 2), nonunique="branch")
PID = get("hunting").build()
SECTION = Section("velocity", "sliding entry", "x", {"x": "d", "v": "0", "z": "0"})
SPEED = np.linspace(0.1, 1.0, 4)


def sweep(**given: Any) -> Sweep:
    return Sweep(Problem(MASS, (1, 0), (0, 1)), **{"over": {"x0.x": [1.0, 2.0]}, **given})


def place(solution: Any) -> dict[str, float]:
    return {"x0.x": 0.0}


def wrong_table() -> object:
    return Table([0.0, 1.0, 2.0], [0.0, np.nan, 1.0])


MISTAKES: dict[str, tuple[Callable[[], object], str, str]] = {
    "a time after the end": (lambda: RUN.sol(3.0), "sol was asked for t = 3.0", "give a longer t_span"),
    "a mode after the end": (lambda: RUN.mode_at(3.0), "mode_at was asked for t = 3.0", "a time within it"),
    "a path after its end": (lambda: TREE.paths()[0].sol(3.0), "for t = 3.0", "give a longer t_span"),
    "a tree after its end": (lambda: TREE.reachable(3.0), "t = 3.0", "take a time between 0 and 2"),
    "a graph without modes": (lambda: plot_graph(nx.MultiDiGraph()), "no modes", "possible_graph(system)"),
    "friction on nothing": (
        lambda: with_friction_model(SMOOTH, "lugre", 1e-3), "no switching surface",
        "Write what jumps with sign",
    ),
    "comparing nothing": (
        lambda: compare(SMOOTH, (1, 0), (0, 1), against=["band"]), "no switching surface", "-x - mu*sign(v)",
    ),
    "friction on a floor": (
        lambda: with_friction_model(
            System({x: v, v: -1 - sign(v)}, surfaces=[Surface("floor", x, reset={v: -v}), Surface("v", v)]),
            "lugre", 1e-3, surface="floor",
        ), "'floor' does not switch the field", "Those that do: v",
    ),
    "a point that was not measured": (wrong_table, "point 1 is (1.0, nan)", "Leave out what was not"),
    "a period of one sample": (
        lambda: Input("r", [0.0, 1.0], [1.0, 1.0], period=1.0), "'r'", "or one with kind='hold'",
    ),
    "an equation too many": (
        lambda: System({x: v, v: -x, z: x}, states="x v"), "for 'z'", "Add it there, or leave states out",
    ),
    "a field given twice": (
        lambda: System.from_modes(h=[x], fields={"+": [1], "-": [-1], "*": [0]}, states=[x]),
        "twice (by '*')", "give it one field",
    ),
    "a reset given twice": (
        lambda: Surface("floor", x, reset={v: -v, "v": -v}), "names the state 'v' twice", "Leave one out",
    ),
    "a surface of numbers": (
        lambda: System({x: v, v: -x}, surfaces=[Surface("s", x - x + 3)]), "surface 's'",
        "Write h in them: v - vb",
    ),
    "a measure given twice": (lambda: sweep(measure=["end", "end"]), "holds 'end' twice", "Leave one out"),
    "too many samples": (
        lambda: sweep(over={"x0.x": (1, 2)}, samples="sobol", n=10**9), "n is 1000000000",
        "make several sweeps",
    ),
    "too few points": (
        lambda: identify_curve(Curve(SPEED, SPEED), driven_mass(), ["Fs", "Fc", "vs", "b"]),
        "4 points", "give 6 or more, or fix some",
    ),
    "free and fixed": (
        lambda: identify_curve(Curve(SPEED, SPEED), driven_mass(), ["Fs"], fixed={"Fs": 1.0}),
        "Fs cannot be both", "Leave it out of one",
    ),
    "a symmetry without a power": (
        lambda: find_orbit(SMOOTH, (1, 0), symmetry=[[2, 0], [0, 2]]), "symmetry", "or symmetry='odd'",
    ),
    "an orbit at rest": (lambda: find_orbit(MASS, (2.0, 0.0)), "comes to rest", "Give another guess"),
    "an orbit of rest": (lambda: find_orbit(SMOOTH, (0, 0), period=6.0), "at rest", "take another"),
    "a transient that ends early": (
        lambda: lyapunov(System({x: x**2, v: -v}), (1.0, 1.0), 5.0, transient=5.0, interval=1.0),
        "the transient did not reach its end", "Take a shorter one, or another x0",
    ),
    "no formula": (lambda: RUN.evaluate("x +", 1.0), "'x +'", "a formula such as 2*sin(x) + v**2"),
    "a scheduler without dask": (
        lambda: sweep().run(executor="processes", scheduler="tcp://here:1"), "scheduler",
        "or leave scheduler out",
    ),
    "a measure with the name of a coordinate": (
        lambda: sweep(measure=[place]), "are named 'x0.x'", "Rename one",
    ),
    "a record that is not there": (
        lambda: read_record("nowhere.csv"), "there is no file 'nowhere.csv'", "path from the present folder",
    ),
    "samples that are not there": (
        lambda: Input.from_csv("r", "nowhere.csv"), "there is no file 'nowhere.csv'",
        "path from the present folder",
    ),
    "the former name of over": (
        lambda: sweep(vary={"mu": [0.1, 0.2], "x0.x": np.arange(99.0)}), "vary is over now",
        "write over={'mu': [0.1, 0.2], 'x0.x': ...}",
    ),
    "the former name of over without values": (
        lambda: sweep(vary="mu"), "vary is over now", "write over={'P': [10, 20]}",
    ),
    "the former name of over in tune": (
        lambda: tune(PID, SECTION, ranges={"P": (1, 2)}, interval=(0.01, 1)), "ranges is over now",
        "write over={'P': (1, 2)}",
    ),
    "one value of a gain": (
        lambda: tune(PID, SECTION, {"P": 1.0}, (0.01, 1)), "over: P is 1.0", "over={'P': (5, 60)}",
    ),
    "one value of a sweep": (lambda: sweep(over={"x0.x": 1.0}), "x0.x is 1.0", "over={'x0.x': [...]}"),
    "a sweep over a state": (lambda: sweep(over={"x": [1.0]}), "'x' is a state", "is 'x0.x'"),
    "workers of a sweep": (lambda: sweep().run(workers=2), "worker processes", "jobs=4"),
    "a measure of nothing": (lambda: sweep(measure="max"), "'max' was given 0", "write 'max(x)'"),
    "a measure of no surface": (
        lambda: sweep(measure="sliding"), "'sliding' was given 0", "write 'sliding(surface)'",
    ),
    "bounds of a search": (lambda: equilibria(MASS, bounds={"x": (0, 1)}), "searched", "box={'x': (-1, 1)}"),
    "a state without an equation": (lambda: System({x: v, v: None}), "equation of 'v'", "write 0"),
    "a surface compared": (lambda: Surface("v", v == 0), "surface 'v'", "write h itself, v - vb"),
    "a direction of a surface": (
        lambda: Surface("v", v, direction=1), "direction is of a UserEvent", "side: '+'",
    ),
    "no sign to describe": (lambda: describing_function(SMOOTH), "no surface", "Write what jumps with sign"),
    "a polynomial of zeros": (lambda: routh_hurwitz([0, 0]), "polynomial is zero", "[1, 2, 1]"),
    "no initial states": (
        lambda: solve_many(MASS, [], (0, 1)), "x0 has shape (0,)", "x0=[(0, 0), ...]",
    ),
    "an axis of a basin without a name": (
        lambda: basin(PID, SECTION, x=(0, 1), y=(0, 1), interval=(0.01, 1)), "x is (0, 1)",
        "x=('P', [10, 20])",
    ),
    "a model for its system": (
        lambda: basin(get("hunting"), SECTION, x=("P", [1]), y=("I", [1]), interval=(0.01, 1)),
        "(Model), expected a System", "Give its .build()",
    ),
    "the section of a model": (
        lambda: basin(PID, get("hunting").section, x=("P", [1]), y=("I", [1]), interval=(0.01, 1)),
        "(SectionData), expected a Section", "Section.from_model(model)",
    ),
    "a curve of two lengths": (
        lambda: Curve(np.zeros(2), np.zeros(1)), "friction has shape (1,)", "Leave out the samples",
    ),
    "a parameter of a model that is built": (
        lambda: get("hunting").build(P=3.0), "model 'hunting'", "parameters={'m': 2.0}",
    ),
    "two second parameters": (
        lambda: _curves(None, {"curve": {"a": (0, 1), "b": (0, 1)}}, None), "given a, b", "leave one of them",
    ),
}  # fmt: skip
COMMANDS = {
    "models describe": "write filippov models describe NAME",
    "diagram hunting --over P=1:2,I=1:2": "leave one. Two: filippov regions",
    "sweep hunting --over P": "Write --over P=LOW:HIGH or P=LOW:HIGH:COUNT",
    "simulate hunting --P 5": "a parameter is set by -p P=VALUE",
    "simulate hunting --plot x": "figures are written with the results: -o DIR",
    "report hunting": "a report is written by filippov study NAME -o DIR",
    "identify hunting d.csv": "takes DATA.csv and options, no more",
    "ensemble hunting --over P=1:2 --n -1": "--n is '-1', expected a whole number of at least 1",
    "simulate hunting --config none.toml": "No such file or directory; give its path from the present folder",
    "bank run none.json": "No such file or directory; give its path from the present folder",
}
FILES: dict[str, tuple[str, str, str]] = {
    "titles alone": ("t,r\n", "it has no rows of numbers", "expected lines such as 0.0,1.5"),
    "another column": ("0,1\n1,2\n", "there is no column 5", "give a number from 0 to 1"),
    "a column of before the first": ("0,1\n1,2\n", "there is no column -1", "give its title, or its number"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_with_place_and_cure(name: str) -> None:
    told(*MISTAKES[name])


@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_tells_the_cure(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line.split()) == 2
    assert COMMANDS[line] in capsys.readouterr().err


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_samples_is_told_with_place_and_cure(name: str, tmp_path: Path) -> None:
    text, place, cure = FILES[name]
    path = tmp_path / "samples.csv"
    path.write_text(text)
    column = {"another column": 5, "a column of before the first": -1}.get(name, 1)
    with pytest.raises(ModelError) as caught:
        Input.from_csv("r", path, value=column)
    assert place in str(caught.value)
    assert cure in str(caught.value)


def test_a_configuration_that_is_no_toml_is_told_with_the_cure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.toml"
    path.write_text("rtol = 1e-6 7\n")
    assert main(["simulate", "hunting", "--config", str(path)]) == 2
    assert "Its lines are such as rtol = 1e-9" in capsys.readouterr().err


def test_an_event_that_is_not_there_is_told_with_their_number() -> None:
    with pytest.raises(IndexError, match=f"no event 100: there are {len(RUN.events)}, numbered from 0"):
        RUN.events[100]


def test_what_a_tree_and_a_continuation_do_not_have_is_told_with_the_cure() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'sol': it holds several .* tree\.paths"):
        TREE.sol  # noqa: B018
    p = parameters(r=1.0)
    run = continuation(System({x: p.r - x}), (1.0,), parameter="r", bounds=(0.5, 2.0), mode="")
    with pytest.raises(AttributeError, match=r"no attribute 'points': run\(\) follows it and returns"):
        run.points  # noqa: B018


def test_a_branch_that_was_not_run_is_told_with_the_cure() -> None:
    p = parameters(r=1.0)
    run = continuation(System({x: p.r - x}), (1.0,), parameter="r", bounds=(0.5, 2.0), mode="")
    with pytest.raises(UsageError, match=r"run the continuation first, continuation\(...\)\.run\(\)"):
        plot_branches([run.branch])
    run.run()
    with pytest.raises(UsageError, match="2 entries for 1 branches: give one for each, or none"):
        plot_branches([run.branch], names=["a", "b"])


def test_a_branch_of_another_continuation_is_told_with_the_cure() -> None:
    p = parameters(r=1.0, q=1.0)
    system = System({x: p.r - p.q * x})

    def follow(parameter: str, resume: Any = None, **values: float) -> Any:
        start = {"parameters": values, "mode": "", "resume": resume}
        return continuation(system, (1.0,), parameter=parameter, bounds=(0.5, 2.0), **start)

    done = follow("r").run()
    with pytest.raises(UsageError, match=r"over 'r', this one .* over 'q'\. Resume with what it was made"):
        follow("q", done)
    with pytest.raises(UsageError, match=r"q = 1\.0, this one 0\.5\. Give it the same values, or"):
        follow("r", done, q=0.5)


@pytest.mark.parametrize(("text", "place", "cure"), [
    ("t,x,x,force\n0,1,1,0\n", "a column is there twice", "Leave one out, or rename it"),
    ("t,x,force\n\xe9", "cannot be read as CSV", "Save it as CSV in UTF-8"),
])  # fmt: skip
def test_a_record_is_told_with_the_cure(text: str, place: str, cure: str, tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(UsageError) as caught:
        read_record(path)
    assert place in str(caught.value)
    assert cure in str(caught.value)


def test_an_estimate_without_covariance_is_told_with_the_cure(tmp_path: Path) -> None:
    path = tmp_path / "identified.json"
    path.write_text('{"fixed": {}, "values": {"P": 1.0}, "covariance": [[null]], "level": 0.95}')
    with pytest.raises(UsageError, match=r"not determine every parameter\. Fix some in `filippov identify`"):
        identified(str(path), ("P",))


def test_a_diagram_without_a_value_names_those_it_has() -> None:
    found = bifurcation(
        get("buck_pwm").build(), None, parameter="Vin", values=[20.0, 21.0], x0=get("buck_pwm").x0
    )
    with pytest.raises(UsageError, match=r"no value 22: take one of its .* values; the nearest is 21"):
        found.cycles(22)
