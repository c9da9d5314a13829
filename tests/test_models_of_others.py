"""Entry points of other packages: a Model, a System, a Problem, and functions that return one of them."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from filippov import ModelError, models, solve
from filippov.app.cli.main import main
from filippov.models import registry

OTHERS = '''
"""A package of others."""
from filippov import Problem, System, parameters, sign, states
from filippov.models import Model

(x,) = states("x")
p = parameters(g=2.0, h=1.0)
relay = System({x: -p.g*sign(x)})
start = Problem(relay, (3.0,), (0.0, 5.0), {"g": 4.0})
back = Problem(relay, (3.0,), (5.0, 0.0), backward=True)
model = Model("other", lambda: relay, (1.0,), (0.0, 2.0), "A relay.", "here")

def makes_system(gain=2.0):
    """A relay of a gain.

    More of it."""
    return System({x: -gain*sign(x)})

def makes_problem():
    "A run of it."
    return start

def makes_model():
    return model

def fails(needed):
    return relay

def makes_text():
    return "relay"

number = 3
kind = System
'''
GOOD = ("relay_of_others", "start", "back", "model", "makes_system", "makes_problem", "makes_model")
BAD = ("fails", "makes_text", "number", "kind")


@pytest.fixture
def others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "package_of_others.py").write_text(OTHERS, encoding="utf-8")
    info = tmp_path / "others-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: others\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"{name} = package_of_others:{name.removesuffix('_of_others')}" for name in (*GOOD, *BAD)]
    (info / "entry_points.txt").write_text("\n".join(["[filippov.models]", *lines]), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    registry._plug_ins.cache_clear()
    known, broken = dict(registry._models), dict(registry._broken)
    yield
    registry._plug_ins.cache_clear()
    for store, before in ((registry._models, known), (registry._broken, broken)):
        store.clear()
        store.update(before)
    sys.modules.pop("package_of_others", None)


@pytest.mark.usefixtures("others")
@pytest.mark.parametrize("name", GOOD)
def test_each_kind_of_entry_point_is_a_model_and_a_problem(name: str) -> None:
    model = models.get(name)
    assert model.name == name
    system = model.build()
    assert system.states == ("x",)
    assert model.build().digest == system.digest
    problem = models.problem(name)
    expected = {
        "start": ([3.0], (0.0, 5.0), 4.0), "makes_problem": ([3.0], (0.0, 5.0), 4.0),
        "back": ([3.0], (5.0, 0.0), 2.0),
        "model": ([1.0], (0.0, 2.0), 2.0), "makes_model": ([1.0], (0.0, 2.0), 2.0),
    }.get(name, ([0.0], (0.0, 10.0), 2.0))  # fmt: skip
    assert (problem.x0.tolist(), problem.t_span) == expected[:2]
    assert problem.parameters.get("g", 2.0) == expected[2]
    assert model.parameters == ({"g": 4.0} if expected[2] == 4.0 else {})
    # x' = -g until |x| is 0; backwards |x| grows.
    (x0,), (t0, t1), g = expected
    assert solve(problem).x_end[0] == pytest.approx(max(x0 - g * (t1 - t0), 0.0), abs=1e-9)


@pytest.mark.usefixtures("others")
def test_keywords_and_descriptions_go_through() -> None:
    assert models.get("makes_system").build(gain=7.0).digest != models.get("makes_system").build().digest
    assert models.get("makes_system").description == "A relay of a gain."
    assert models.get("makes_problem").description == "A run of it."
    assert models.get("start").description == "the plug-in start"
    assert models.get("start").source == "package_of_others:start"
    with pytest.raises(ModelError, match="takes no keywords"):
        models.get("start").build(gain=7.0)


@pytest.mark.usefixtures("others")
@pytest.mark.parametrize("name", BAD)
def test_what_is_no_model_says_what_it_may_be(name: str) -> None:
    with pytest.raises(ModelError) as caught:
        models.get(name)
    if name not in ("fails", "kind"):  # these have their own cause
        assert "expected a Model, a System, a Problem, or a function that returns one" in str(caught.value)
    assert name in models.broken()


@pytest.mark.usefixtures("others")
@pytest.mark.parametrize("name", ["start", "makes_problem"])
def test_the_command_runs_them_with_their_values(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", name, "--json"]) == 0
    said = capsys.readouterr().out
    assert '"g": 4' in said
