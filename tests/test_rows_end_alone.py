"""`solve_many`: a row that cannot be run ends alone, with what `solve` says of it; the others do not notice.

Widths of hysteresis and instants of time events that parameters make impossible, as expressions and
functions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from filippov import Surface, System, TimeEvent, parameters, sign, solve, solve_many, sqrt, states
from filippov.base.errors import ModelError
from filippov.base.status import Status

x, v = states("x v")


def _relay(width: Any, p: Any) -> System:
    relay = Surface("relay", x, width=width)
    return System({x: v, v: -2 * sign(x) - 0.1 * v}, surfaces=[relay], parameters=p)


def _clock(p: Any, **instants: Any) -> System:
    return System({x: -x}, time_events=[TimeEvent("tick", reset={x: x + 1}, **instants)], parameters=p)


def _plain(p: Any) -> System:
    tick = TimeEvent("tick", period=lambda p: p.a, reset=lambda t, x, p: [x[0] + 1])
    return System(field=lambda t, x, p, s: [-x[0]], states="x", time_events=[tick], parameters=p)


p = parameters(a=0.5)
KINDS = {
    "width": (_relay(p.a, p), (1.0, 0.0)),
    "root of a width": (_relay(sqrt(p.a), p), (1.0, 0.0)),
    "inverse of a width": (_relay(1 / p.a, p), (1.0, 0.0)),
    "period": (_clock(p, period=p.a), (1.0,)),
    "root of a period": (_clock(p, period=sqrt(p.a)), (1.0,)),
    "inverse of a period": (_clock(p, period=1 / p.a), (1.0,)),
    "times": (_clock(p, times=[0.1, p.a]), (1.0,)),
    "function": (_plain(p), (1.0,)),
}


@pytest.mark.parametrize("bad", [-0.5, 0.0])
@pytest.mark.parametrize("kind", KINDS)
def test_a_row_ends_alone(kind: str, bad: float) -> None:
    system, start = KINDS[kind]
    values = np.array([0.5, bad, 0.7, bad, 0.9])
    found = solve_many(system, [start] * 5, (0, 3), parameters={"a": values}, rtol=1e-10, atol=1e-12)
    with pytest.raises(ModelError) as told:
        solve(system, start, (0, 3), parameters={"a": bad})
    for k, a in enumerate(values):
        if a == bad:
            assert found.status[k] is Status.ERROR
            assert str(told.value) in found.message[k]
            continue
        one = solve(system, start, (0, 3), parameters={"a": a}, rtol=1e-10, atol=1e-12)
        assert found.success[k]
        assert one.success
        np.testing.assert_allclose(found.x[k], one.x_end, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_where_no_row_can_be_run_it_is_refused(kind: str) -> None:
    system, start = KINDS[kind]
    with pytest.raises(ModelError, match=r"tick|relay"):
        solve_many(system, [start] * 2, (0, 3), parameters={"a": [-0.5, 0.0]})


def test_a_function_that_raises_ends_its_row() -> None:
    p = parameters(a=0.5)
    tick = TimeEvent("tick", period=lambda p: 1 / p.a)
    system = System(field=lambda t, x, p, s: [-x[0]], states="x", time_events=[tick], parameters=p)
    values = {"a": [1.0, 0.0, 2.0]}
    found = solve_many(system, [(1.0,)] * 3, (0, 1), parameters=values, rtol=1e-10, atol=1e-12)
    assert found.success.tolist() == [True, False, True]
    assert "ZeroDivisionError" in found.message[1]
    np.testing.assert_allclose(found.x[[0, 2], 0], np.exp(-1), rtol=1e-8)
