"""Programs whose events accumulate: twisting and super-twisting, run on at rest, as the exact motion is."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filippov.analysis import diagnose
from filippov.base.status import Status


def by_signs(a: float, b: float, c: float) -> Callable[..., Any]:
    def program(t, y):  # type: ignore[no-untyped-def]
        x, v = y
        return [v, -a * np.sign(x) - b * np.sign(v)]

    return program


def by_branches(a: float, b: float, c: float) -> Callable[..., Any]:
    def program(t, y):  # type: ignore[no-untyped-def]
        x, v = y
        u = -a if x > 0 else a
        if v > 0:
            u -= b
        elif v < 0:
            u += b
        return [v, u]

    return program


def shaken(a: float, b: float, c: float) -> Callable[..., Any]:
    def program(t, y):  # type: ignore[no-untyped-def]
        x, v = y
        return [v, -a * np.sign(x) - b * np.sign(v) + c * math.sin(3 * t)]

    return program


def super_twisting(a: float, b: float, c: float) -> Callable[..., Any]:
    def program(t, y):  # type: ignore[no-untyped-def]
        s, z = y
        return [-a * np.sqrt(abs(s)) * np.sign(s) + z, -b * np.sign(s) + c * np.cos(t)]

    return program


def integrated(a: float, b: float, c: float) -> Callable[..., Any]:
    """A third state goes on behind the limit."""
    def program(t, y):  # type: ignore[no-untyped-def]
        x, v, _ = y
        return [v, -a * np.sign(x) - b * np.sign(v), x + c]

    return program


@pytest.mark.parametrize("make", [by_signs, by_branches, shaken, super_twisting, integrated])
@pytest.mark.parametrize("seed", range(4))
def test_16_1_a_program_that_rests_in_finite_time_is_followed_to_its_end(make: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    b = rng.uniform(0.5, 1.5)
    a, c = b + rng.uniform(0.5, 1.5), 0.4 * b * rng.uniform(0, 1)
    start = rng.uniform(-1, 1, 3 if make is integrated else 2).tolist()
    found = diagnose(make(a, b, c), start, (0, 60))
    assert found.solution is not None
    assert found.solution.status is Status.SUCCESS
    assert found.solution.t_end == 60
    assert found.solution.x_end[:2] == pytest.approx([0, 0], abs=1e-12)
    assert found.code.count("zeno='continue'") == len(found.solution.accumulations[:1])
    known: dict[str, Any] = {}
    exec(found.code, known)  # noqa: S102  the text that the report gives
    assert known["solution"].x_end == pytest.approx(found.solution.x_end, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_16_1_the_time_of_the_rest_is_the_sum_of_the_swings(seed: int) -> None:
    """From (x, 0): a fall by a - b, a stop by a + b, and so on with (a - b)/(a + b) of the way."""
    rng = np.random.default_rng(seed)
    b = rng.uniform(0.5, 1.5)
    a, x = b + rng.uniform(0.5, 1.5), rng.uniform(0.3, 2)
    speed = math.sqrt(2 * x * (a - b))
    swing = speed / (a - b) + speed / (a + b)
    found = diagnose(by_signs(a, b, 0), [x, 0], (0, 60))
    assert found.solution is not None
    (limit,) = found.solution.accumulations
    assert limit.t == pytest.approx(swing / (1 - math.sqrt((a - b) / (a + b))), rel=1e-6)
