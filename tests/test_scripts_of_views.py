"""view.py, "the Python that makes the files": it runs by itself, or it is refused by name."""

import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filippov import Surface, System, UsageError
from filippov.app import Explorer
from filippov.app.cli.main import main
from filippov.app.explorer.export import script

ROOT = Path(__file__).resolve().parent.parent
OWN = """
from filippov import Problem, Surface, System, states

def slow(t, x, p, s):
    return [x[1], -x[0] - p["k"]*s[0]]

def made():
    speed = Surface("v", lambda t, x, p: x[1])
    return System(field=slow, surfaces=[speed], states="x v", parameters={"k": 0.3})

plain = made()
ready = Problem(made(), (1, 0), (0, 4))
x, v = states("x v")
written = System({x: v, v: -x})
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (tmp_path / "model_of_functions.py").write_text(OWN)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "model_of_functions", raising=False)
    return importlib.import_module("model_of_functions")


def run(folder: Path) -> None:
    """Run view.py in its folder; it writes solution.csv again."""
    (folder / "solution.csv").rename(folder / "old.csv")
    code = "import sys; sys.path.insert(0, sys.argv[1]); import runpy; runpy.run_path('view.py')"
    done = subprocess.run(
        [sys.executable, "-c", code, str(ROOT)], cwd=folder, capture_output=True, text=True, timeout=120,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    old, new = (np.genfromtxt(folder / n, delimiter=",", names=True) for n in ("old.csv", "solution.csv"))
    assert np.array_equal(old, new)


@pytest.mark.parametrize("name", ["plain", "ready", "made", "written"])
def test_the_script_of_the_command_runs(name: str, own: Any, tmp_path: Path) -> None:
    words = ["explore", f"{tmp_path / 'model_of_functions.py'}:{name}", "--quiet"]
    assert main([*words, "-o", str(tmp_path / "out")]) == 0
    run(tmp_path / "out")


@pytest.mark.parametrize("name", ["plain", "ready", "written"])
def test_the_script_of_a_system_with_a_name_in_a_module_runs(name: str, own: Any, tmp_path: Path) -> None:
    Explorer(getattr(own, name), (1, 0), (0, 4)).export(tmp_path / "out")
    run(tmp_path / "out")


def test_without_a_name_there_is_no_script(own: Any, tmp_path: Path) -> None:
    local = System(
        field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("x", lambda t, x, p: x[0])], states="x",
    )  # fmt: skip
    for system, start in ((local, (1,)), (own.made(), (1, 0))):
        explorer = Explorer(system, start, (0, 4))
        names = {path.name for path in explorer.export(tmp_path / "out")}
        assert "view.py" not in names
        assert "solution.npz" in names
        with pytest.raises(UsageError, match=r"no view\.py: the system is made of plain functions"):
            script(explorer.solutions, explorer.start)
