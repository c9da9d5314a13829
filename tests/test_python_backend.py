"""The event loop run by Python from its sources: numbers of compiled code, lines that a debugger sees."""

import os
import subprocess
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

from filippov import (
    ModelError,
    Solution,
    Status,
    Surface,
    System,
    UsageError,
    sign,
    solve,
    solve_many,
    states,
    t,
)
from filippov.app.bank import read_bank
from filippov.app.bank.build import build
from filippov.app.bank.case import Case
from filippov.app.bank.migrate.case import system
from filippov.models import get, names

ROOT = Path(__file__).resolve().parent.parent
BANK = read_bank(ROOT / "tests" / "data" / "cases.json")
X, Y = states("x y")
# An implicit method whose Newton matrices are near to singular settles on steps that rounding decides.
STIFF = ("hunting_lugre",)


def alike(*arguments: Any, **options: Any) -> Solution:
    """The run by both backends, compared: events within 1e-12 of compiled ones, in the scale of the run."""
    one = solve(*arguments, **options)
    other = solve(*arguments, backend="python", **options)
    assert other.status is one.status, other.message
    assert [(e.surface, e.kind, e.after) for e in other.events] == [
        (e.surface, e.kind, e.after) for e in one.events
    ]
    span = abs(one.t_end - one.t[0])
    np.testing.assert_allclose(
        [e.t for e in other.events], [e.t for e in one.events], rtol=0, atol=1e-12 * (1 + span)
    )
    np.testing.assert_allclose(other.x_end, one.x_end, rtol=1e-9, atol=1e-9)
    return other


@pytest.mark.parametrize("name", sorted(set(names()) - set(STIFF)))
def test_13_2_every_model_runs_in_python_as_compiled(name: str) -> None:
    model = get(name)
    start, end = model.t_span
    alike(model.build(), model.x0, (start, min(end, start + 1.5)), zeno="continue", max_events=50)


@pytest.mark.parametrize("case", BANK, ids=[case.id for case in BANK])
def test_13_2_the_short_cases_of_the_bank(case: Case) -> None:
    """A case that is no problem, or takes more than 150 steps, has nothing to compare."""
    try:
        built = build(system(case.raw))
    except ModelError:
        return
    options = {"zeno": "continue", "max_steps": 150}
    if solve(built.system, built.x0, built.t_span, **options).status is not Status.MAX_STEPS:
        alike(built.system, built.x0, built.t_span, **options)


@pytest.mark.parametrize("method", ["DP5", "Radau"])
def test_13_2_other_methods(method: str) -> None:
    model = get("hunting")
    alike(model.build(), model.x0, (0, 0.5), method=method, rtol=1e-6)


def test_13_2_fields_that_are_functions() -> None:
    system = System(
        field=lambda t, x, p, s: [x[1], -x[0] - 0.3 * s[0] + np.cos(t)],
        surfaces=[Surface("v", lambda t, x, p: x[1])],
        states=["x", "v"],
    )
    alike(system, (1.0, 0.2), (0, 3))


def test_13_2_corners_and_events_of_the_user() -> None:
    system = System({X: -sign(X) + 0.3 * sign(Y), Y: -2 * sign(Y) + 0.2 * sign(X) + 0.1 * t})
    run = alike(system, (0.5, 0.4), (0, 2), events=lambda t, y: y[1] - 0.1)
    assert run.modes[-1] == "00"


def test_13_2_a_debugger_sees_the_lines_of_the_kernels() -> None:
    seen: set[tuple[str, str]] = set()

    def trace(frame: FrameType, event: str, argument: Any) -> None:
        seen.add((Path(frame.f_code.co_filename).name, frame.f_code.co_name))

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        solve(System({X: -sign(X)}), (1.0,), (0, 2), backend="python")
    finally:
        sys.settrace(before)
    assert {("advance.py", "advance"), ("land.py", "land"), ("locate.py", "locate")} <= seen


def test_13_2_a_whole_process_by_its_environment() -> None:
    code = (
        "import numpy as np\n"
        "from filippov import solve_many\n"
        "from filippov.models import get\n"
        "print(repr(solve_many(get('relay').build(), np.array(ROWS), (0, 1)).x.tolist()))\n"
    )
    rows = [list(get("relay").x0), [0.3] * len(get("relay").x0)]
    environment = os.environ | {"FILIPPOV_PYTHON": "1", "PYTHONPATH": str(ROOT)}
    out = subprocess.run(
        [sys.executable, "-c", code.replace("ROWS", repr(rows))],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    told = np.array(
        [float(v) for v in out.stdout.replace("[", " ").replace("]", " ").replace(",", " ").split()]
    )
    np.testing.assert_allclose(
        told, solve_many(get("relay").build(), np.array(rows), (0, 1)).x.ravel(), rtol=1e-9
    )


def test_13_2_an_unknown_backend_is_refused() -> None:
    with pytest.raises(UsageError, match="backend"):
        solve(System({X: -sign(X)}), (1.0,), (0, 1), backend="pyhton")
