"""Programs whose conditions are on what counts (floor, int, // of time), and tables in every form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filippov.analysis import diagnose

END = 4.7
LIST_X, LIST_Y = [0.0, 1.0, 2.0], [0.0, 1.0, 0.5]
TUPLE_X, TUPLE_Y = (0.0, 1.0, 2.0), (0, 1, 0.5)
ARRAY_X, ARRAY_Y = np.array(LIST_X), np.array(LIST_Y)

# The value that x' = value - x has at time t; each changes at multiples of 0.25 only.
LEVELS: dict[str, Callable[[float], float]] = {
    "above": lambda t: 1.0 if np.floor(t) > 1 else 0.0,
    "whole": lambda t: 1.0 if int(t) >= 2 else 0.0,
    "divided": lambda t: 1.0 if math.floor(t / 1.5) <= 1 else 0.0,
    "below": lambda t: 1.0 if t // 0.5 < 5 else 0.0,
    "sign": lambda t: np.sign(np.floor(t) - 1),
    "truncated": lambda t: np.sign(np.trunc(t / 2) - 1),
    "equal": lambda t: 1.0 if int(t) == 2 else 0.0,
    "unequal": lambda t: 1.0 if int(t) != 2 else 0.0,
    "heaviside": lambda t: np.heaviside(np.floor(t) - 2, 0.25),
    "between": lambda t: 1.0 if 2 * np.floor(t) - 3 > 0 else 0.0,
    "two counts": lambda t: 1.0 if np.floor(t) < np.floor(2 * t) - 2 else 0.0,
    "falling": lambda t: 1.0 if 3 - np.floor(t) > 0 else 0.0,
    "where": lambda t: float(np.where(np.floor(t) <= 2, 0.5, -0.5)),
}


@pytest.mark.parametrize("name", LEVELS)
def test_15_5_a_limit_that_a_count_stays_at(name: str) -> None:
    """The exact solution from interval to interval; the System ended `non_unique` at t = 1."""
    level = LEVELS[name]

    def f(t: float, y: Any) -> list[Any]:
        return [level(t) - y[0]]

    found = diagnose(f, (0.3,), (0, END))
    x, edges = 0.3, np.append(np.arange(0, END, 0.25), END)
    for begin, end in itertools.pairwise(edges):
        held = float(level(0.5 * (begin + end)))
        x = held + (x - held) * math.exp(begin - end)
    assert found.solution is not None
    assert found.solution.success
    assert found.solution.x_end[0] == pytest.approx(x, abs=1e-8)
    assert not found.of("differs")


@pytest.mark.parametrize("kind", ["list", "tuple", "array"])
def test_15_5_tables_of_the_module_in_every_form(kind: str) -> None:
    programs = {
        "list": lambda t, y: [1 - np.interp(y[0], LIST_X, LIST_Y)],
        "tuple": lambda t, y: [1 - np.interp(y[0], TUPLE_X, TUPLE_Y)],
        "array": lambda t, y: [1 - np.interp(y[0], ARRAY_X, ARRAY_Y)],
    }
    found = diagnose(programs[kind], (0.0,), (0, 5))
    # Below 1 the table is y, so x = 1 - exp(-t) stays there.
    assert found.solution is not None
    assert found.solution.x_end[0] == pytest.approx(1 - math.exp(-5), abs=1e-8)


calls = 0
largest = 0.0
on = False


def test_15_5_a_number_of_calls_is_no_memory() -> None:
    """Counted for the user's own use: f does not depend on it. What switches the field with it is refused."""

    def f(t: float, y: Any) -> list[Any]:
        global calls, largest  # noqa: PLW0603
        calls += 1
        if y[0] > largest:
            largest = y[0]
        return [-np.sign(y[0] - 0.5)]

    found = diagnose(f, (1.0,), (0, 2))
    assert found.solution is not None
    assert found.solution.x_end[0] == pytest.approx(0.5, abs=1e-9)
    assert found.system is not None
    assert len(found.system.states) == 1
    assert calls == 0
    assert largest == 0.0


def test_15_5_a_memory_that_the_field_reads_stays_one() -> None:
    def f(t: float, y: Any) -> list[Any]:
        global calls, on  # noqa: PLW0603
        calls += 1
        if y[0] > 1:
            on = True
        elif y[0] < 0:
            on = False
        return [-1.0 if on else 1.0]

    found = diagnose(f, (0.5,), (0, 3))
    assert found.system is not None
    assert len(found.system.states) == 2
    assert found.solution is not None
    assert found.solution.x_end[0] == pytest.approx(0.5, abs=1e-9)  # up to 1, down to 0, and up again
