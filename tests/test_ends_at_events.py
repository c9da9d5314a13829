"""A run that ends within rounding of an event has it, as a longer one has, and is continued the same way."""

import os
from collections.abc import Iterator

import numpy as np
import pytest

from filippov import Surface, System, parameters, sign, sin, solve, solve_many, states, t

DRAWS = {"default": 4, "ci": 6}.get(os.environ.get("FILIPPOV_PROFILE", "default"), 60)
ROUNDINGS = (-64, -3, -1, 0, 1, 3, 64)
x, v = states("x v")
p = parameters(a=1.0, b=1.0, c=1.0)
Case = tuple[System, tuple[float, float], dict[str, float], float, int, str]


def _cases(random: np.random.Generator) -> Iterator[Case]:
    """System, start, parameters, time of an event in closed form, events up to it, its kind."""
    a, b, c = random.uniform(0.5, 2.0, 3)
    values = {"a": a, "b": b, "c": c}
    crossing = System({x: p.a + p.b / 4 * sign(x - p.c), v: sign(x - p.c)}, parameters=p)
    yield crossing, (0, 0), values, c / (a - b / 4), 1, "crossing"
    entry = System({x: -p.a * sign(x) + p.b / 4, v: x}, parameters=p)
    yield entry, (c, 0), values, c / (a - b / 4), 1, "sliding entry"
    leaving = System({x: -sign(x) + p.a * t, v: x}, parameters=p)
    yield leaving, (0, c), values, 1 / a, 1, "sliding exit"
    stick = System({x: v, v: -p.a / 4 * sign(v) + sin(p.b * t)}, parameters=p)
    yield stick, (c, 0), values, np.arcsin(a / 4) / b, 1, "sliding exit"
    ball = System(
        {x: v, v: -9.81 * p.a}, surfaces=[Surface("floor", x, reset={v: -(1 + p.b) / 4 * v})], parameters=p
    )
    first, ratio = np.sqrt(2 * c / (9.81 * a)), (1 + b) / 4
    yield ball, (c, 0), values, first * (1 + 2 * ratio), 2, "reset"
    damped = System({x: v, v: -x - p.a / 4 * sign(v)}, parameters=p)
    yield damped, (c + 3, 0), values, np.pi, 1, "crossing"


@pytest.mark.parametrize("method", ["DOP853", "Taylor"])
def test_an_event_at_the_end_is_an_event(method: str) -> None:
    random = np.random.default_rng(5)
    for _ in range(DRAWS if method == "DOP853" else DRAWS // 2):
        for system, start, values, event, count, kind in _cases(random):
            later = event * 1.1
            whole = solve(system, start, (0, later), parameters=values, rtol=1e-11, method=method)
            assert whole.success
            seen = [e for e in whole.events if e.t < event + 1e-9]
            assert seen[-1].kind.value == kind
            assert seen[-1].t == pytest.approx(event, rel=1e-10)
            for k in ROUNDINGS:
                end = seen[-1].t + k * np.spacing(seen[-1].t)
                run = solve(system, start, (0, end), parameters=values, rtol=1e-11, method=method)
                assert run.success
                assert [(e.kind, e.after) for e in run.events] == [(e.kind, e.after) for e in seen], (kind, k)
                rest = solve(system, run.x_end, (end, later), parameters=values, rtol=1e-11, method=method)
                assert rest.success, (kind, k, rest.message)
                assert rest.x_end == pytest.approx(whole.x_end, rel=1e-8, abs=1e-9), (kind, k)
            assert len(seen) == count


def test_so_it_is_in_batches() -> None:
    random = np.random.default_rng(6)
    for system, start, values, event, _, kind in _cases(random):
        single = solve(system, start, (0, 1.1 * event), parameters=values, rtol=1e-11)
        first = next(e for e in single.events if e.kind.value == kind)
        before = [e for e in single.events if e.t <= first.t]
        for k in ROUNDINGS:
            end = first.t + k * np.spacing(first.t)
            many = solve_many(system, np.tile(start, (20, 1)), (0, end), parameters=values, rtol=1e-11)
            assert np.all(many.counts.sum(axis=(1, 2)) == len(before)), (kind, k)
            assert np.all(many.mode == before[-1].after), (kind, k)
            after = first.x_after if kind == "reset" else first.x
            assert np.allclose(many.x, after, rtol=1e-9, atol=1e-9)
