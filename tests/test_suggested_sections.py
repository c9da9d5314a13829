"""The section that a command suggests for a model of one's own, pasted back: the command runs with it."""

import re
import shlex
from pathlib import Path

import pytest

from filippov.app.cli.main import main

# The sections are read at negative coordinates (the event the other way at positive ones), at positive
# ones, at both signs, and at the ceiling at negative ones only.
OWN = """
from filippov import Problem, Surface, System, parameters, sign, states

x, v, z = states("x v z")
k, mu = parameters(k=1.0, mu=0.1)
pol = System({x: v, v: -k*x - mu*sign(v) + 0.3*(1 - x**2)*v})
negative = Problem(pol, x0=(1.0, 0.5), t_span=(0, 20))
wide = System({x: v, v: -k*x - mu*sign(v) + 0.3*(1 - x**2)*v, z: v - z})
three = Problem(wide, x0=(1.0, 0.5, 0.0), t_span=(0, 20))
relay = Problem(System({x: v, v: z, z: -z - (2 + mu)*v - k*sign(x)}), x0=(1.0, 0.5, 0.0), t_span=(0, 20))


def belt(way):
    law = (0.2 + mu)*sign(v - way*0.2)*(1 - 0.4*sign((v - way*0.2)**2 - 0.01))
    return Problem(System({x: v, v: -k*x - law}), x0=(0, 0), t_span=(0, 100))


right, left = belt(1), belt(-1)
wall = Surface("wall", -x, reset={v: -v/2 - 0.3})
ceiling = Problem(System({x: v, v: k + mu}, surfaces=[wall]), x0=(-1, 0), t_span=(0, 9))
"""
COMMANDS = {
    "regions": "--over k=0.9:1.1 --over mu=0.05:0.1 --cells 2 --points 8",
    "tune": "--over k=0.9:1.1 --samples 2 --grid 2",
    "basin": "--over x=0:1 --over v=0:1 --cells 2",
    "event-map": "--start 0.1 --iterates 2 --points 8",
    "diagram": "--start 0.1 --over k=0.9:1.1 --count 2 --transient 4 --keep 2",
    "bifurcation": "--interval 0 1 --over k=0.9:1.1 --count 2 --points 8",
}


@pytest.mark.parametrize("model", ["negative", "three", "relay", "right", "left", "ceiling"])
@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_suggested_runs(
    name: str, model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text(OWN)
    words = [name, f"{tmp_path / 'own.py'}:{model}", *shlex.split(COMMANDS[name]), "--quiet"]
    assert main(words) == 2
    said = capsys.readouterr().err
    (suggested,) = re.findall(r"From a short run: (--surface .*?)(?: \(it holds.*)?$", said.strip())
    pasted = shlex.split(suggested)
    if "--interval" in words:
        del pasted[pasted.index("--interval") : pasted.index("--interval") + 3]
    assert main([*words, *pasted, "-o", str(tmp_path / "out")]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("name", COMMANDS)
def test_without_an_initial_state_it_says_what_to_name(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text(OWN)
    assert main([name, f"{tmp_path / 'own.py'}:pol", *shlex.split(COMMANDS[name])]) == 2
    said = capsys.readouterr().err
    assert "From a short run" not in said
    assert "Name a Problem, with an initial state, and a section is looked for along its solution." in said
