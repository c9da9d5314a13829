"""Every capability in three ways: a function, a command, and a page that runs the one and shows the other."""

from __future__ import annotations

import importlib
import re
import shlex
from pathlib import Path

import pytest
from stubs import STUBS, stub
from test_docs import CELL, ROOT, TEXTS

from filippov.app.cli.catalogue import commands
from filippov.app.cli.main import build_parser

LINES = re.compile(r"^    (filippov (?:.*\\\n)*.*)$", re.MULTILINE)
INLINE = re.compile(r"`(filippov [^`]+)`")
# What a command line ends at, for the shell or for the reader.
ENDS = re.compile(r" # | > |; ")

# Command: the function or class it stands for, and the page.
WAYS = {
    "simulate": ("filippov.solve", "start"),
    "sweep": ("filippov.Sweep", "sweeps"),
    "ensemble": ("filippov.solve_many", "ensembles"),
    "event-map": ("filippov.analysis.EventMap", "maps"),
    "bifurcation": ("filippov.analysis.bifurcation", "maps"),
    "orbit": ("filippov.analysis.find_orbit", "orbits"),
    "homoclinic": ("filippov.analysis.find_homoclinic", "orbits"),
    "continue": ("filippov.analysis.continuation", "continuation"),
    "stability": ("filippov.analysis.stability_report", "stability"),
    "describing-function": ("filippov.analysis.describing_function", "describing-function"),
    "regions": ("filippov.analysis.regions", "regions"),
    "basin": ("filippov.analysis.basin", "regions"),
    "attractors": ("filippov.analysis.attractors", "attractors"),
    "manifold": ("filippov.analysis.manifold", "attractors"),
    "lyapunov": ("filippov.analysis.lyapunov", "lyapunov"),
    "diagram": ("filippov.analysis.brute_force", "lyapunov"),
    "tune": ("filippov.analysis.tune", "tuning"),
    "identify": ("filippov.analysis.identify", "identification"),
    "compare": ("filippov.analysis.compare", "comparison"),
    "diagnose": ("filippov.analysis.diagnose", "diagnose"),
    "graph": ("filippov.graphs.possible_graph", "graph"),
    "export": ("filippov.export_system", "export"),
    "explore": ("filippov.app.Explorer", "explorer"),
    "models": ("filippov.models.get", "gallery"),
}
# These are for the command alone: files of cases, a report, and the state of the installation.
ALONE = {"bank": "bank", "study": "studies", "doctor": "compiled"}


def shown(text: Path) -> list[list[str]]:
    """The words of every command line in a text, after `filippov`."""
    source = text.read_text(encoding="utf-8")
    lines = [*LINES.findall(source), *INLINE.findall(source)]
    return [shlex.split(ENDS.split(line.replace("\\\n", " "))[0])[1:] for line in lines]


def test_every_command_has_its_ways() -> None:
    assert set(commands()) == {*WAYS, *ALONE}


@pytest.mark.parametrize("command", WAYS)
def test_a_command_has_its_function_and_its_page(command: str) -> None:
    path, page = WAYS[command]
    place, _, name = path.rpartition(".")
    assert callable(getattr(importlib.import_module(place), name))
    text = ROOT / "docs" / f"{page}.md"
    cells = "\n".join(CELL.findall(text.read_text(encoding="utf-8")))
    assert re.search(rf"\b{name}\(", cells), f"{text.name} runs no {name}"
    assert command in {words[0] for words in shown(text) if words}, f"{text.name} shows no filippov {command}"


@pytest.mark.parametrize("command", ALONE)
def test_a_command_without_a_function_has_its_page(command: str) -> None:
    text = ROOT / "docs" / f"{ALONE[command]}.md"
    assert f"filippov {command}" in text.read_text(encoding="utf-8")


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.stem)
def test_commands_in_texts_are_understood(text: Path) -> None:
    """Every flag that a page shows exists, with as many values."""
    parser = build_parser(commands())
    for words in shown(text):
        if "COMMAND" not in words and "--help" not in words:
            parser.parse_args(words)


# The earlier name of `compare_solutions`.
EARLIER = {"compare_motions"}


@pytest.mark.parametrize("room", ["filippov", "filippov.analysis", "filippov.graphs"])
def test_every_public_name_is_used_on_a_page(room: str) -> None:
    """In running code or in a sentence, beside the API pages."""
    pages = [text for text in TEXTS if text.stem != "api"]
    words = set(re.findall(r"\w+", "\n".join(text.read_text(encoding="utf-8") for text in pages)))
    assert not set(importlib.import_module(room).__all__) - words - EARLIER


@pytest.mark.parametrize("package", STUBS)
def test_16_1_type_checkers_and_editors_see_every_name(package: str) -> None:
    """The stub of a package is as `python tests/stubs.py` writes it."""
    assert (ROOT / STUBS[package]).read_text(encoding="utf-8") == stub(package)
