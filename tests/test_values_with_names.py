"""What carries names is read by them, and files, keywords and powers of others are answered."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from filippov import (
    ModelError,
    Problem,
    Sweep,
    System,
    UsageError,
    UserEvent,
    parameters,
    sign,
    solve,
    solve_many,
    states,
)
from filippov.analysis import EventMap, Section, brute_force
from filippov.app import Explorer
from filippov.base import progress

pandas = pytest.importorskip("pandas")
X, V = states("x v")
P = parameters(k=4.0, mu=0.3)
S = System({X: V, V: -P.k * X - P.mu * sign(V)})
SPAN = (0, 3)
SECTION = Section("v", "crossing up", "x", {"x": "-d", "v": "0"})
WANTED = solve(S, (1.0, 0.25), SPAN).x_end


class Swapped(NamedTuple):
    v: float
    x: float


RECORD = np.array([(0.25, 1.0)], dtype=[("v", float), ("x", float)])
TABLE = pandas.DataFrame({"v": [0.25, 0.5], "x": [1.0, 2.0]})


@pytest.mark.parametrize("start", [
    pandas.Series({"v": 0.25, "x": 1.0}), TABLE.iloc[0], Swapped(0.25, 1.0), RECORD[0],
    pandas.Series([1.0, 0.25]), {"v": 0.25, "x": 1.0},
])  # fmt: skip
def test_16_f_a_state_with_names_in_another_order(start: Any) -> None:
    assert np.array_equal(solve(S, start, SPAN).x_end, WANTED)
    assert np.array_equal(Problem(S, start, SPAN).x0, [1.0, 0.25])


@pytest.mark.parametrize("start", [
    TABLE, {"v": [0.25, 0.5], "x": np.array([1.0, 2.0])}, [TABLE.iloc[0], TABLE.iloc[1]],
    [{"v": 0.25, "x": 1.0}, {"x": 2.0, "v": 0.5}],
])  # fmt: skip
def test_16_f_many_states_with_names(start: Any) -> None:
    found = solve_many(S, start, SPAN).x
    assert np.allclose(found, [solve(S, x0, SPAN).x_end for x0 in ((1.0, 0.25), (2.0, 0.5))], atol=1e-9)
    one_column = solve_many(S, {"x": [1.0, 2.0], "v": 0.25}, SPAN).x[0]
    assert np.allclose(one_column, WANTED, atol=1e-9)


@pytest.mark.parametrize(("call", "told"), [
    (lambda: solve(S, pandas.Series({"x": 1.0, "w": 0.0}), SPAN), "unknown state 'w'; known: x, v"),
    (lambda: solve(S, pandas.Series({"x": 1.0}), SPAN), "has no v"),
    (lambda: solve_many(S, TABLE.rename(columns={"v": "w"}), SPAN), "unknown state 'w'"),
    (lambda: solve_many(S, {"x": [1.0, 2.0]}, SPAN), "no value for v"),
    (lambda: solve_many(S, {"x": [1.0, 2.0], "v": [0.0, 0.0, 0.0]}, SPAN), "lengths [2, 3]"),
    (lambda: solve(S, (1, 0), SPAN, mu=0.1), "mu is a parameter of the system: write parameters={'mu': 0.1}"),
    (lambda: solve(S, t_span=SPAN, x=1), "x is a state of the system: write x0={'x': 1, ...}"),
    (lambda: solve(S, (1, 0), StopTime=3), "t_span=(t0, t1)"),
    (lambda: solve(S, (1, 0), SPAN, FixedStep=0.1), "chosen by the tolerances"),
    (lambda: Explorer(S, x0=(1, 0), span=(0, 1)), "unknown option 'span'"),
    (lambda: solve(S, (1, 0), SPAN).to_pandas(10), "t_eval=times"),
    (lambda: solve(S, (1, 0), SPAN).plot("x.png"), "solution.plot().savefig('x.png')"),
    (lambda: UserEvent(lambda t, y: y[0], direction="up"), "direction is 'up', expected a number: 1 where g"),
    (lambda: brute_force(S, SECTION, "mu", [0.1], (1, 0)), "expected the coordinate x of the first return"),
    (lambda: EventMap(S, Section("v", "crossing up", "x", {"x": "d", "w": "0"})), "unknown state 'w'"),
    (lambda: S.with_inputs({"mu": [0, 1]}), "Input('mu', times, values)"),
])  # fmt: skip
def test_16_f_what_is_said(call: Any, told: str) -> None:
    with pytest.raises((UsageError, ModelError)) as caught:
        call()
    assert told in str(caught.value)


@pytest.mark.parametrize("ending", ["csv", "mat", "pkl", "h5", "nc", "parquet", "json", "xlsx"])
def test_16_f_npz_is_written_under_no_other_name(ending: str, tmp_path: Path) -> None:
    run = solve(S, (1, 0), SPAN)
    with pytest.raises(UsageError, match=r"ends in \.npz"):
        run.save(tmp_path / f"run.{ending}")
    assert not list(tmp_path.iterdir())
    assert run.save(tmp_path / "run").is_file()


@pytest.mark.parametrize("made", [lambda: X**1 ^ 2, lambda: (X + 1) ^ 2, lambda: 2 ^ X])
def test_16_f_a_power_of_another_language(made: Any) -> None:
    with pytest.raises(TypeError, match=r"is no power in Python: write .*\*\*"):
        made()


@pytest.mark.parametrize("function", [np.floor, np.ceil, np.rint, lambda x: np.mod(x, 2)])
def test_16_f_steps_without_end(function: Any) -> None:
    with pytest.raises(TypeError, match=r"jumps infinitely often.*Surface\('name', sin\(pi\*u\)\)"):
        function(X)


def test_16_f_a_column_is_varied() -> None:
    rows = Sweep(Problem(S, (1, 0), SPAN), over={"mu": pandas.Series([0.1, 0.3], index=[7, 9])}).run()
    assert rows["mu"].tolist() == [0.1, 0.3]


def test_16_d_a_search_of_unknown_length_tells_no_percentage(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.Progress("identify") as told:
        told("3 evaluations, misfit 0.1")
    with progress.Progress("sweep") as counted:
        counted(1, 4)
    first, second = capsys.readouterr().err.splitlines()
    assert first == "identify: 0 s - 3 evaluations, misfit 0.1"
    assert second.startswith("sweep:  25 %, 0 s")
