"""numpy's functions in equations in each of their spellings, and quantities where no unit is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pint
import pytest

from filippov import ModelError, System, Table, UsageError, sign, solve, solve_many, states
from filippov import step as step_input
from filippov.analysis import EventMap, Section

CLIPS: dict[str, Callable[[Any, float, float], Any]] = {
    "in order": np.clip,
    "a_min, a_max": lambda u, a, b: np.clip(u, a_min=a, a_max=b),
    "one in order": lambda u, a, b: np.clip(u, a, a_max=b),
    "min, max": lambda u, a, b: np.clip(u, min=a, max=b),
    "a": lambda u, a, b: np.clip(a=u, a_min=a, a_max=b),
    "no out": lambda u, a, b: np.clip(u, a, b, out=None),
}


@pytest.mark.parametrize("name", CLIPS)
@pytest.mark.parametrize("seed", range(4))
def test_16_4_limits_of_clip_in_every_spelling(name: str, seed: int) -> None:
    """x' = -clip(k x, -c, c) from above: a straight line down to c/k, then exp(-k t)."""
    rng = np.random.default_rng(seed)
    k, c = rng.uniform(2, 6), rng.uniform(0.5, 1.5)
    start, (x,) = c / k + rng.uniform(0.2, 1), states("x")
    run = solve(System({x: -CLIPS[name](k * x, -c, c)}), (start,), (0, 3), rtol=1e-11, atol=1e-13)
    straight = (start - c / k) / c
    end = c / k * math.exp(-k * (3 - straight)) if straight < 3 else start - 3 * c
    assert run.x_end[0] == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("call", [
    lambda v: np.clip(v, -1, 1, casting="no"), lambda v: np.maximum(v, 0, where=False),
    lambda v: np.sin(v, dtype=np.float32), lambda v: np.where(v > 0, 1, 2, 3),
])  # fmt: skip
def test_16_4_what_numpy_is_told_besides_is_refused(call: Callable[[Any], Any]) -> None:
    (v,) = states("v")
    with pytest.raises(TypeError, match=r"np\.|where"):
        call(v)


def test_16_4_functions_of_arrays_of_expressions() -> None:
    """np.sin of a list is a list; the motion is that of sin written for each."""
    x, v = states("x v")
    rows = np.sin([x, v]) + np.tanh(np.array([v, x])) + np.exp([-x, -v])
    run, one = (
        solve(System({x: -f, v: -g}), (1, 0.5), (0, 2), rtol=1e-11)
        for f, g in (rows, [np.sin(x) + np.tanh(v) + np.exp(-x), np.sin(v) + np.tanh(x) + np.exp(-v)])
    )
    assert run.x_end.tolist() == one.x_end.tolist()
    with pytest.raises(TypeError, match="one expression at a time"):
        np.sign([x, v])


U: Any = pint.UnitRegistry()
X, V = states("x v")
SWING = System({X: V, V: -X - sign(V)}, labels={"t": "time [s]", "x": "position [m]", "v": "speed [m/s]"})
RUN = solve(SWING, (3, 0), (0, 5))
ASKED: dict[str, Callable[[], Any]] = {
    "dense output": lambda: RUN.sol(3 * U.ms),
    "evaluate": lambda: RUN.evaluate("x", 3 * U.ms),
    "t_eval": lambda: solve(SWING, (1, 0), (0, 5), t_eval=np.array([1, 2]) * U.ms),
    "list of times": lambda: solve(SWING, (1, 0), (0, 5), t_eval=[1 * U.ms]),
    "table": lambda: Table(np.array([0, 100.0]) * U.cm, np.array([0, 1.0]) * U.N),
    "step": lambda: step_input("a", 100 * U.ms, (0, 1)),
    "map": lambda: EventMap(SWING, Section("v", "crossing up", "x", {"x": "-d", "v": "0"}))(10 * U.cm),
    "tolerance": lambda: solve(SWING, (1, 0), (0, 5), atol=1 * U.um),
    "max_step": lambda: solve(SWING, (1, 0), (0, 5), max_step=1 * U.ms),
}


@pytest.mark.parametrize("what", ASKED)
def test_16_9_no_unit_is_dropped_silently(what: str) -> None:
    """3 ms was read as 3 s, 10 cm as 10 m."""
    with pytest.raises((UsageError, ModelError), match=r"quantity|Quantity"):
        ASKED[what]()


def test_16_9_units_of_the_labels_are_converted() -> None:
    """10 cm are 0.1 m in a row of states, as they are in one state."""
    many = solve_many(SWING, [(300 * U.cm, 0), (3, 0)], (0, 5))
    assert many.x[0] == pytest.approx(many.x[1], abs=1e-12)
    assert many.x[0] == pytest.approx(RUN.x_end, abs=1e-6)
