"""Plain functions of user events that are compiled as expressions: which are, with the same events."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from filippov import Solution, System, UserEvent, parameters, solve
from filippov.model.symbols import Expr, sign, sin, states, t
from filippov.solving.traced import as_expressions

x, v = states("x v")
p = parameters(belt=0.25, mu=0.3)
SYSTEM = System({x: v, v: -x - p.mu * sign(v - p.belt) + sin(0.7 * t)}, parameters=p)
VALUES = np.array([0.25, 0.3])
level, calls = 0.25, []


def written(time: float, state: np.ndarray) -> float:
    calls.append(time)
    return float(state[1]) - 0.25


def branching(time: float, state: np.ndarray) -> float:
    return state[1] - 0.25 if state[0] > 0 else state[1] - 0.5


def unpacked(time: float, state: np.ndarray) -> float:
    _, speed = state
    return speed - level


@pytest.mark.parametrize(
    ("function", "expression"),
    [
        (lambda t, y: y[1] - 0.25, v - p.belt),
        (lambda t, y: 4 * y[1] - 1.0, v - p.belt),
        (lambda t, y: 0.5 - 2 * y[-1], p.belt - v),
        (unpacked, v - p.belt),
        (lambda t, y, k=1, at=0.25: y[k] - at, v - p.belt),
        (lambda t, y: y[0], x),
        (lambda t, y: -y[0] * y[1], -x * v),
        (lambda t, y: t - y[0], t - x),
    ],
)
def test_arithmetic_of_states_becomes_an_expression(function: Callable[..., float], expression: Expr) -> None:
    (event,) = as_expressions(SYSTEM, VALUES, (UserEvent(function, terminal=2, direction=-1, name="mine"),))
    assert event.g == expression
    assert (event.terminal, event.direction, event.name) == (2, -1, "mine")


@pytest.mark.parametrize(
    "function",
    [
        written,
        branching,
        lambda t, y: y[1] - 0.3,
        lambda t, y: abs(y[1] - 0.25),
        lambda t, y: math.sin(y[0]),
        lambda t, y: np.sin(y[0]),
        lambda t, y: max(y[0], y[1]),
        lambda t, y: (y[1] - 0.25) // 1.0,
        lambda t, y: y[1] > 0.25,
        lambda t, y: 0.0 if y[1] == 0.25 else y[1] - 0.25,
        lambda t, y: sum([y[1], -0.25]),
        lambda t, *y: y[0][1] - 0.25,
        lambda t, y, c=calls: y[1] - 0.25,
        lambda t, y: 1.5,
        lambda t, y: calls[0] + y[0],
    ],
)
def test_all_else_stays_a_function(function: Callable[..., float]) -> None:
    event = UserEvent(function)
    assert as_expressions(SYSTEM, VALUES, (event,)) == (event,)


def test_a_surface_is_compared_with_the_parameters_of_the_run() -> None:
    event = UserEvent(lambda t, y: y[1] - 0.25)
    assert as_expressions(SYSTEM, np.array([0.5, 0.3]), (event,)) == (event,)


def times(run: Solution) -> list[list[float]]:
    return [list(found) for found in run.t_events[len(run.system.surfaces) :]]


@pytest.mark.parametrize("belt", [0.25, 0.1])
def test_the_events_are_those_of_the_function_called(belt: float) -> None:
    """A call hides the arithmetic: the same function, as it is called in Python."""
    plain = [lambda t, y: y[1] - 0.25, lambda t, y: y[0], lambda t, y: y[0] * y[1]]
    hidden = [lambda t, y, g=g: float(g(t, y)) for g in plain]
    found, expected = (
        solve(SYSTEM, [1.0, 0.0], (0, 30), parameters={"belt": belt}, events=events, rtol=1e-10)
        for events in (plain, hidden)
    )
    for one, other in zip(times(found), times(expected), strict=True):
        assert one == pytest.approx(other, abs=1e-7)
    assert found.x_end == pytest.approx(expected.x_end, abs=1e-8)
