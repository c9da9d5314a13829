"""Every result that tells itself in text is shown by a notebook as that text, escaped."""

import ast
import importlib
from pathlib import Path
from typing import Any

import pytest

from filippov import Surface, System, sign, solve_many, states
from filippov.analysis import EventMap, Section, diagnose, equilibria, find_orbit, regions
from filippov.base.escape import markup
from filippov.models import get
from filippov.solving.ensemble import Ensemble
from filippov.sweep.table import SweepTable

ROOT = Path(__file__).resolve().parent.parent
TOLD = {"__str__", "to_text", "__repr__"}


def classes() -> list[tuple[str, str]]:
    """Module and name of each class of the analysis that says itself how it reads."""
    found = []
    for path in sorted((ROOT / "analysis").rglob("*.py")):
        module = ".".join(("filippov", *path.relative_to(ROOT).with_suffix("").parts))
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            own = {f.name for f in getattr(node, "body", ()) if isinstance(f, ast.FunctionDef)}
            if isinstance(node, ast.ClassDef) and TOLD & own:
                found.append((module, node.name))
    return found


@pytest.mark.parametrize(("module", "name"), classes())
def test_what_reads_as_text_is_shown_as_text(module: str, name: str) -> None:
    made = getattr(importlib.import_module(module), name)
    told = type("Told", (made,), {"__str__": lambda self: "P < 1\nand <b>"})
    assert object.__new__(told)._repr_html_() == "<pre>P &lt; 1\nand &lt;b&gt;</pre>"


def test_there_are_such_classes() -> None:
    names = {name for _, name in classes()}
    assert names >= {"Orbit", "Diagnosis", "Comparison", "SolutionComparison", "StabilityReport", "Regions"}
    assert len(names) >= 25


def slipping(t: float, y: Any) -> list[float]:
    return [y[1], -y[0] - (1 if y[1] > 0 else -1)]


def results() -> dict[str, Any]:
    x, v = states("x v")
    relay = System({x: v, v: -x - v / 2 + sign(v)}, surfaces=[Surface("<b>", v)])
    hunting = get("hunting")
    section = Section.from_model(hunting)
    system = hunting.build()
    point = EventMap(system, section, parameters={"P": 10.0}, order=2).fixed_points(0.1, 0.4, 16)[0]
    axes = [("P", [10.0, 20.0]), ("m", [1.0, 1.1])]
    return {
        "Orbit": find_orbit(relay, (3.0, 0.1)), "Ensemble": solve_many(relay, [(1.0, 0), (2.0, 0)], (0, 1)),
        "Diagnosis": diagnose(slipping, (1.0, 0.0), (0, 1)), "FixedPoint": point,
        "Equilibria": equilibria(relay), "Regions": regions(system, section, *axes, (0.0, 0.5), points=8),
    }  # fmt: skip


def test_results_are_shown() -> None:
    for name, result in results().items():
        assert type(result).__name__ == name
        assert result._repr_html_() == f"<pre>{markup(str(result))}</pre>"
        assert "<b>" not in result._repr_html_()


@pytest.mark.parametrize("kind", [Ensemble, SweepTable])
def test_tables_are_shown(kind: Any) -> None:
    told = type("Told", (kind,), {"__str__": lambda self: "<i>"})
    assert object.__new__(told)._repr_html_() == "<pre>&lt;i&gt;</pre>"
