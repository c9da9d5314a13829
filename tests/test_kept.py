"""Problems in the cache: what is loaded is what is built, and runs without sympy."""

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from filippov import ModelError, System, solve, states
from filippov.models import names, problem, registry
from filippov.solving.state.kept import place_of
from filippov.solving.state.problem import Problem

HEAVY = ("surfaces", "symbolic", "time_events", "outputs", "comparator", "exact")


def _untouched(name: str, monkeypatch: pytest.MonkeyPatch) -> Problem:
    """A kept problem, while nothing can be built."""
    problem(name)

    def refuse(*_: object) -> Any:
        raise AssertionError("expressions were asked for")

    monkeypatch.setattr(registry, "get", refuse)
    return problem(name)


@pytest.mark.parametrize("name", ["hunting", "thermostat", "bouncing_ball", "newton_cradle", "pll"])
def test_14_4_a_kept_problem_is_solved_as_the_one_that_is_built(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = registry.get(name)
    built = solve(model.build(), model.x0, model.t_span)
    with monkeypatch.context() as alone:
        loaded = solve(_untouched(name, alone))
    assert str(loaded.message) == str(built.message)
    assert loaded.x_end.tobytes() == built.x_end.tobytes()
    assert list(map(str, loaded.events)) == list(map(str, built.events))
    # Which is made anew where its expressions are asked for.
    assert loaded.mode_graph().number_of_nodes() == built.mode_graph().number_of_nodes()


def test_14_4_every_kept_system_is_the_one_that_is_built() -> None:
    for name in names():
        problem(name)
        loaded, built = problem(name).system, registry.get(name).build()
        assert loaded == built, name
        assert (hash(loaded), loaded.digest) == (hash(built), built.digest)
        assert (loaded.roles, loaded.parameters) == (built.roles, built.parameters)
        # By way of another process, which makes nothing anew.
        for system in (loaded, pickle.loads(pickle.dumps(loaded))):  # noqa: S301
            assert all(getattr(system, part) == getattr(built, part) for part in HEAVY), name


def test_14_4_a_command_runs_a_kept_model_without_sympy() -> None:
    code = (
        "import sys; from filippov.app.cli.main import main; main(['simulate', 'hunting', '--quiet']); "
        "print([name for name in ('sympy', 'scipy', 'numba') if name in sys.modules])"
    )
    problem("hunting")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n", done.stderr


def test_14_4_what_other_files_make_is_another_record(tmp_path: Path) -> None:
    file = tmp_path / "model.py"
    file.write_text("a")
    one, other = place_of("a", [file]), place_of("b", [file])
    file.write_text("b")
    assert len({one, other, place_of("a", [file])}) == 3


def test_14_4_a_model_that_is_built_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = _untouched("pendulum", monkeypatch)
    x = states("x")[0]
    other = registry.Model("other", lambda: System({x: -x}), (), (0, 1), "", "")
    monkeypatch.setattr(registry, "get", lambda name: other)
    with pytest.raises(ModelError, match="files of this model have changed"):
        loaded.system.symbolic  # noqa: B018
