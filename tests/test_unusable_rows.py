"""Rows of solve_many that are not finite: they end by name, and the others are as without them."""

import math
from typing import Any

import numpy as np
import pytest

from filippov import (
    ModelError,
    Smooth,
    Status,
    Surface,
    System,
    UsageError,
    parameters,
    sign,
    solve_many,
    states,
)  # fmt: skip

x, v = states("x v")
p = parameters(k=1.0, mu=0.1)
WRITTEN = System({x: v, v: -p.k * x - p.mu * sign(v)}, parameters=p)
FUNCTIONS = System(
    field=lambda t, x, p, s: [x[1], -x[0] - 0.1 * s[0]], surfaces=[Surface("v", lambda t, x, p: x[1])],
    states="x v", parameters={"k": 1.0, "mu": 0.1},
)  # fmt: skip
SYSTEMS = {"written": WRITTEN, "functions": FUNCTIONS, "smooth": WRITTEN.with_comparator(Smooth(1e-2))}


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("rows", [(0,), (1, 3), (4,), (0, 1, 2, 3)])
def test_the_others_run(name: str, bad: float, rows: tuple[int, ...]) -> None:
    start = np.array([(1.0, 0.0), (0.0, 1.0), (2.0, -1.0), (0.5, 0.5), (1e-9, 0.0)])
    good = [q for q in range(len(start)) if q not in rows]
    alone = solve_many(SYSTEMS[name], start[good], (0, 3))
    start[list(rows), 1] = bad
    seen: list[int] = []
    found = solve_many(SYSTEMS[name], start, (0, 3), progress=lambda done, count: seen.append(done))
    assert found.complete
    assert max(seen, default=len(start)) == len(start)
    assert [found.status[q] for q in good] == list(alone.status)
    assert np.array_equal(found.x[good], alone.x)
    assert np.array_equal(found.counts[good], alone.counts)
    for q in rows:
        assert found.status[q] is Status.ERROR
        assert found.message[q] == f"x0[{q}]: state 'v' is {bad}, expected a finite number."
        assert found.t[q] == 0
        assert found.nfev[q] == 0
    assert f"{len(rows)} error" in str(found)


def test_parameters_and_many_rows() -> None:
    mu = np.full(200, 0.1)
    mu[7] = math.nan
    found = solve_many(WRITTEN, (1.0, 0.0), (0, 3), parameters={"mu": mu})
    assert [q for q, status in enumerate(found.status) if not status.ok] == [7]
    assert found.message[7] == "row 7: parameter 'mu' is nan, expected a finite number."
    assert np.isfinite(np.delete(found.x, 7, axis=0)).all()


@pytest.mark.parametrize("x0", [(math.nan, 0), [(math.nan, 0), (0, math.inf)]])
def test_where_no_row_can_be_run_the_call_is_refused(x0: Any) -> None:
    with pytest.raises(UsageError, match=r"x0\[0\]: state 'x' is nan"):
        solve_many(WRITTEN, x0, (0, 1))


def test_a_parameter_for_all_is_refused() -> None:
    with pytest.raises((UsageError, ModelError), match="mu"):
        solve_many(WRITTEN, [(1, 0), (2, 0)], (0, 1), parameters={"mu": math.nan})
    with pytest.raises(UsageError, match="parameter 'mu'"):
        solve_many(WRITTEN, [(1, 0), (2, 0)], (0, 1), parameters={"mu": [math.nan, math.nan]})
