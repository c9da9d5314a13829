"""What one row of many raises is that row's: the others reach their ends, whatever was raised and where.

The oracle is the closed form of x' = -k x, from rows that raise at times drawn at random and from rows that
do not.
"""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweep_case import check, decay, write_case

from filippov import (
    Problem,
    Status,
    Surface,
    Sweep,
    System,
    TimeEvent,
    UsageError,
    parameters,
    solve_many,
    states,
)
from filippov.app.cli.main import main

FIELD, SURFACE, RADIUS, RESET, GRADIENT, CLOCK = "field", "surface", "radius", "reset", "gradient", "clock"
RAISED: dict[str, Callable[[], Any]] = {
    "ValueError": lambda: (_ for _ in ()).throw(ValueError("no such state")),
    "OverflowError": lambda: math.exp(1e6),
    "ZeroDivisionError": lambda: 1 / 0,
    "SystemExit": lambda: sys.exit(0),
    "MemoryError": lambda: bytearray(1 << 62),
    "RecursionError": lambda: (_ for _ in ()).throw(RecursionError("deep")),
}


def harmed(where: str, bad: dict[float, tuple[float, str]]) -> System:
    """x' = -k x by plain functions, of which one raises for some k: {k: (from which time on, what)}."""

    def look(place: str, t: float, p: Any) -> None:
        begin, what = bad.get(float(p.k), (math.inf, ""))
        if place == where and t >= begin:
            RAISED[what]()

    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        look(FIELD, t, p)
        return [-p.k * x[0]]

    def h(t: float, x: Any, p: Any) -> float:
        look(SURFACE, t, p)
        return float(x[0] - math.exp(-0.5 * p.k))

    def radius(t: float, x: Any, p: Any) -> float:
        look(RADIUS, t, p)
        return 1.0

    def gradient(t: float, x: Any, p: Any) -> list[float]:
        look(GRADIENT, t, p)
        return [1.0]

    def reset(t: float, x: Any, p: Any) -> Any:
        look(RESET, t, p)
        return x

    def tick(t: float, x: Any, p: Any) -> Any:
        look(CLOCK, t, p)
        return x

    surface = (
        Surface("half", h, reset=reset) if where == RESET
        else Surface("half", h, radius=radius, gradient=gradient)
    )  # fmt: skip
    clocks = [TimeEvent("tick", period=0.25, reset=tick)] if where == CLOCK else []
    return System(field=field, surfaces=[surface], states="x", parameters={"k": 1.0}, time_events=clocks)


@pytest.mark.parametrize("where", [FIELD, SURFACE, RADIUS, RESET, GRADIENT, CLOCK])
def test_11_20_an_exception_of_one_row_ends_no_other(where: str) -> None:
    generator = np.random.default_rng([*where.encode()])
    for _ in range(20 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 2):
        k = np.round(generator.uniform(0.5, 2, 12), 6)
        begin = 0.0 if where in (RESET, RADIUS) else generator.uniform(0, 0.4)
        chosen = generator.choice(12, 4, replace=False)
        bad = {float(k[q]): (begin, str(generator.choice([*RAISED]))) for q in chosen}
        ends = solve_many(harmed(where, bad), [1.0], (0, 1), parameters={"k": k}, rtol=1e-9)
        assert ends.complete
        for q in range(12):
            if q in chosen:
                assert ends.status[q] is Status.ERROR
                assert bad[float(k[q])][1] in ends.message[q]
                # Where the motion stood when it happened, a state of its own.
                assert 0 <= ends.t[q] <= 1
                assert ends.x[q, 0] == pytest.approx(math.exp(-k[q] * ends.t[q]), rel=1e-7)
            else:
                assert ends.status[q] is Status.SUCCESS
                assert ends.message[q] in ("", Status.SUCCESS.advice)
                assert ends.x[q, 0] == pytest.approx(math.exp(-k[q]), rel=1e-7)
    assert not ends.success.all()


def test_11_20_an_exception_of_the_general_path_is_its_row_s(monkeypatch: pytest.MonkeyPatch) -> None:
    # Rows where two clocks reset at once are solved one by one in Python, where anything may overflow.
    x, y = states("x y")
    p = parameters(k=1.0)
    clocks = [TimeEvent(f"clock of {z}", period=0.3, reset={z: z / 1}) for z in (x, y)]
    system = System({x: -p.k * x, y: 0 * y}, time_events=clocks)
    import filippov.solving.solver

    plain = filippov.solving.solver.solve

    def solve(problem: Problem, **options: Any) -> Any:
        if problem.parameters["k"] == 2.0:
            raise OverflowError("math range error")
        return plain(problem, **options)

    monkeypatch.setattr(filippov.solving.solver, "solve", solve)
    ends = solve_many(system, [1.0, 0.0], (0, 1), parameters={"k": [1.0, 2.0, 3.0]})
    assert [status.value for status in ends.status] == ["success", "error", "success"]
    assert re.fullmatch(r"OverflowError: math range error \(line \d+ of .*\)", ends.message[1])
    assert np.allclose(ends.x[[0, 2], 0], np.exp([-1, -3]), rtol=1e-7)


def test_11_20_ctrl_c_is_no_row_s_affair() -> None:
    calls = [0]

    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        calls[0] += 1
        if calls[0] == 200:
            raise KeyboardInterrupt
        return [-x[0]]

    system = System(field=field, surfaces=[], states="x")
    ends = solve_many(system, np.ones((50, 1)), (0, 1))
    assert not ends.complete
    assert ends.status[0] is Status.SUCCESS
    assert ends.status[-1] is Status.INTERRUPTED


class LimitError(BaseException):
    """What a time limit raises: no error of what runs under it."""


@pytest.mark.parametrize("general", [True, False])
def test_14_6_a_time_limit_is_no_row_s_affair(monkeypatch: pytest.MonkeyPatch, general: bool) -> None:
    import filippov.solving.solver

    def limit(*_: Any, **__: Any) -> Any:
        raise LimitError

    if general:  # rows of a clock are solved one by one in Python
        monkeypatch.setattr(filippov.solving.solver, "solve", limit)
        system = harmed(CLOCK, {})
    else:
        monkeypatch.setitem(RAISED, "ValueError", limit)
        system = harmed(FIELD, {1.0: (0.5, "ValueError")})
    with pytest.raises(LimitError):
        solve_many(system, [1.0], (0, 1), parameters={"k": [0.5, 1.0]})


LEAVES = """
import sys, os

def leaves(solution):
    k = solution.problem.parameters["k"]
    if k == 3:
        sys.exit(0)
    if k == 5:
        sys.exit("enough")
    if k == 6:
        raise KeyboardInterrupt
    if k == 7:
        os._exit(0)
    return {"twice": 2*k}
"""


def test_11_20_a_measure_that_leaves_the_program_is_a_failed_row(tmp_path: Path) -> None:
    write_case(tmp_path)
    (tmp_path / "leaves.py").write_text(LEAVES)
    sweep = Sweep(decay(), {"k": range(1, 9)}, measure=["end(x)", f"{tmp_path / 'leaves.py'}:leaves"])
    table = sweep.run(tmp_path / "out", jobs=2, chunk=4)
    check(table, bad=(3, 5, 6, 7))
    assert [table.status[k] for k in (2, 4, 5, 6)] == ["error", "error", "error", "quarantined"]
    assert "sys.exit(0)" in table.message[2]
    assert "sys.exit('enough')" in table.message[4]
    assert "KeyboardInterrupt" in table.message[5]
    assert "exit code 0" in table.message[6]


def test_11_20_the_command_says_so_with_its_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_case(tmp_path, "leaves", 6)
    (tmp_path / "harm.py").write_text(LEAVES.replace("raise KeyboardInterrupt", "pass"))
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "--config", "sweep.toml", "-o", "out", "-j", "1"]) == 3
    said = capsys.readouterr().err
    assert "point 2: error: SystemExit: a function of the user's ended the program with sys.exit(0)" in said
    assert (tmp_path / "out/results.csv").read_text().count("success") == 4


def test_11_20_a_model_that_leaves_the_program_is_a_failed_row(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as pool:
        table = Sweep(
            Problem(harmed(FIELD, {2.0: (0.5, "SystemExit")}), (1.0,), (0, 1)), {"k": [1, 2, 3]}
        ).run(executor=pool)
    assert table.status == ["success", "error", "success"]
    assert "sys.exit(0)" in table.message[1]
    assert np.allclose(table["end(x)"][[0, 2]], np.exp([-1, -3]), rtol=1e-6)


class Work:
    """Rows of squares, of which some raise, computed many at a time."""

    fields: dict[str, str] = {}  # noqa: RUF012
    units: dict[str, str] = {}  # noqa: RUF012
    names, columns, unseen = ("q",), ("square",), ()
    first, grain = 16, 1

    def __init__(self, bad: set[int]) -> None:
        self.points, self.bad = np.arange(40.0)[:, None], bad

    def compute(self, index: Any, limits: Any) -> Any:
        from filippov.sweep.rows import Rows

        if self.bad & set(index.tolist()):
            raise OverflowError(f"among {len(index)}")
        return Rows(index, self.points[index] ** 2, ("success",) * len(index))


def test_11_20_a_chunk_that_raises_is_halved_until_the_point_is_found(tmp_path: Path) -> None:
    from filippov.sweep.run import run

    pool: Executor
    with ThreadPoolExecutor(2) as pool:
        table = run(Work({3, 17, 39}), tmp_path, executor=pool, jobs=2)
    assert table.failed.tolist() == [3, 17, 39]
    (said,) = set(table.message.values())
    assert re.fullmatch(r"OverflowError: among 1 \(line \d+ of test_failed_rows.py\)", said)
    good = np.setdiff1d(np.arange(40), [3, 17, 39])
    assert np.array_equal(table["square"][good], good.astype(float) ** 2)
    assert np.all(np.isnan(table["square"][[3, 17, 39]]))


def test_11_20_a_measure_that_leaves_at_the_template_is_an_error_of_the_sweep() -> None:
    for leave in (lambda _: sys.exit(0), lambda _: sys.exit("enough")):
        with pytest.raises(UsageError, match=r"fails for the template itself: SystemExit.*sys\.exit\("):
            Sweep(decay(), {"k": [1, 2]}, measure=leave)
