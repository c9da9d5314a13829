"""Surfaces with a root in them, where that root vanishes: h = y - c |x|**e, steep as can be at x = 0.

Reference: y is a broken line, its roots with the curve isolated by bisection on a grid that is dense around
every start and around x = 0; a terminal sliding mode has a closed form.
"""

import os
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Abs, Max, System, parameters, sign, solve, solve_many, states

DRAWS = {"default": 25, "ci": 60}.get(os.environ.get("FILIPPOV_PROFILE", "default"), 600)
x, y, v = states("x y v")
p = parameters(e=0.5, c=1.0, d=0.0, odd=0.0, k1=1.0, k2=0.5, k3=0.0, speed=1.0)
CURVE = p.c * Abs(x) ** p.e * (1 - p.odd + p.odd * sign(x)) + p.d * x
SYSTEM = System({x: p.speed, y: p.k1 + p.k2 * sign(y - CURVE) + p.k3 * sign(x)}, parameters=p)
END = 3.0


def _draw(random: np.random.Generator) -> tuple[dict[str, float], np.ndarray]:
    values = {
        "e": float(random.choice([0.07, 1 / 3, 0.5, 0.73, random.uniform(0.1, 0.95)])),
        "c": float(random.normal()),
        "d": float(random.normal() * random.integers(2)),
        "odd": float(random.integers(2)),
        "k1": float(random.normal()),
        "k2": float(random.uniform(0.1, 0.5)),
        "k3": float(random.normal() * random.integers(2)),
        "speed": float(random.choice([1.0, 0.7])),
    }
    return values, np.array([-1.0, random.normal()])


def _curve(q: dict[str, float], x: float) -> float:
    return q["c"] * abs(x) ** q["e"] * (np.sign(x) if q["odd"] else 1.0) + q["d"] * x


def _first_root(h: Callable[[float], float], start: float, at_zero: float, s: float) -> float | None:
    """The first time after `start` at which s h stops being positive."""
    fine = np.geomspace(1e-13, END, 400)
    grid = np.concatenate([np.linspace(start, END, 4001), start + fine, at_zero - fine, at_zero + fine])
    last = None
    for t in np.unique(grid[(grid > start + 1e-13) & (grid <= END)]):
        if s * h(t) < 0.0:
            return t if last is None else float(brentq(h, last, t, xtol=1e-15, rtol=1e-15))
        last = t
    return None


def _reference(q: dict[str, float], start: np.ndarray) -> tuple[list[tuple[float, float]], float] | None:
    """Times at which y meets the curve, with y there, and the last y; None next to x = y = 0."""
    at_zero = 1.0 / q["speed"]
    t, level = 0.0, float(start[1])
    events: list[tuple[float, float]] = []
    s = 1.0 if level > _curve(q, -1.0) else -1.0
    while True:
        broken = at_zero if t < at_zero else np.inf
        rate = q["k1"] + q["k2"] * s + q["k3"] * (1.0 if t >= at_zero else -1.0)

        def h(time: float, t: float = t, level: float = level, rate: float = rate) -> float:
            return level + rate * (time - t) - _curve(q, q["speed"] * time - 1.0)

        stop = min(END, broken)
        root = _first_root(h, t, at_zero, s)
        if root is not None and root < stop - 1e-9:
            ahead = s * (h(root + 1e-7) - h(root - 1e-7))
            if not ahead < -1e-9 or len(events) > 20:
                return None
            t, level, s = root, level + rate * (root - t), -s
            events.append((t, level))
            continue
        if root is not None and abs(root - stop) <= 1e-6:
            return None
        if stop == END:
            return events, level + rate * (END - t)
        t, level = stop, level + rate * (stop - t)
        if abs(level) < 1e-3:
            return None


def _shallow(q: dict[str, float], start: np.ndarray) -> bool:
    """Whether the curve nearly touches the line somewhere: of tangencies the reference says nothing."""
    solution = solve(SYSTEM, x0=start, t_span=(0, END), parameters=q, rtol=1e-11, atol=1e-12)
    times = np.linspace(0, solution.t[-1], 6000)
    h = np.array([float(b) - _curve(q, float(a)) for a, b in solution.sol(times).T])
    dips = (np.abs(h[1:-1]) < np.abs(h[:-2])) & (np.abs(h[1:-1]) < np.abs(h[2:])) & (h[:-2] * h[2:] > 0)
    return bool(np.any(np.abs(h[1:-1][dips]) < 1e-3))


def test_a_run_that_ends_near_such_a_root_ends_at_its_own_time() -> None:
    """x' = speed: a landing that failed left the state elsewhere, with success."""
    random = np.random.default_rng(12)
    for _ in range(DRAWS):
        q, start = _draw(random)
        q["e"] = 0.07
        at_zero = 1.0 / q["speed"]
        for end in at_zero + np.array([-1e-6, -1e-8, 1e-9, 2e-8, 1e-6, 3e-5, 1e-3]):
            run = solve(SYSTEM, start, (0, end), parameters=q, rtol=1e-9)
            assert run.x_end[0] == pytest.approx(q["speed"] * run.t_end - 1.0, abs=1e-9), (q, start, end)
            at = np.array([event.t for event in run.events])
            x_there = np.array([event.x[0] for event in run.events])
            np.testing.assert_allclose(x_there, q["speed"] * at - 1.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("backend", ["compiled", "python"])
def test_curves_with_a_root_are_met_where_they_are(backend: str) -> None:
    random, seen = np.random.default_rng(11), 0
    rows, ends = [], []
    for _ in range(DRAWS if backend == "compiled" else DRAWS // 5):
        q, start = _draw(random)
        found = _reference(q, start)
        if found is None or _shallow(q, start):
            continue
        seen += 1
        events, end = found
        solution = solve(
            SYSTEM, x0=start, t_span=(0, END), parameters=q, rtol=1e-11, atol=1e-12, backend=backend
        )
        assert solution.success, (q, start, solution.message)
        met = np.array([e.t for e in solution.events if e.surface != "x"])
        for time, level in events:
            assert np.min(np.abs(met - time)) < 1e-8, (q, start, time, met)
            assert abs(solution.sol(time)[1] - level) < 1e-8, (q, start, time)
        assert abs(solution.y[1, -1] - end) < 1e-8, (q, start)
        rows.append((q, start))
        ends.append(end)
    assert seen >= len(rows) > 3
    if backend == "compiled":
        given = {name: [q[name] for q, _ in rows] for name in rows[0][0]}
        many = solve_many(SYSTEM, [s for _, s in rows], (0, END), parameters=given, rtol=1e-11, atol=1e-12)
        assert np.allclose(many.x[:, 1], ends, rtol=0, atol=1e-8)


TERMINAL = System({x: v, v: -p.k1 * sign(v + p.c * Abs(x) ** p.e * sign(x))}, parameters=p)


@pytest.mark.parametrize("e", [0.55, 0.6, 2 / 3, 0.75, 0.9])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_terminal_sliding_arrives_in_its_time(e: float, side: float) -> None:
    """Slides along v = -c |x|**e sgn x, where |x|**(1 - e) falls at the rate (1 - e) c, and rests."""
    c, u = 1.2, 3.0
    entry = brentq(lambda t: u * t - c * (1.0 - u * t**2 / 2) ** e, 0.0, np.sqrt(2 / u))
    reached = 1.0 - u * entry**2 / 2
    arrival = entry + reached ** (1 - e) / ((1 - e) * c)
    literal = System({x: v, v: -3 * sign(v + 1.2 * Abs(x) ** e * sign(x))})
    for system, values in ((TERMINAL, {"e": e, "c": c, "k1": u}), (literal, {})):
        solution = solve(
            system, x0=(side, 0), t_span=(0, arrival + 1), parameters=values, rtol=1e-10, atol=1e-13
        )
        assert solution.success, solution.message
        assert abs(solution.events[0].t - entry) < 1e-9
        for t in np.linspace(entry, arrival, 9)[1:-1]:
            there = side * (reached ** (1 - e) - (1 - e) * c * (t - entry)) ** (1 / (1 - e))
            assert abs(solution.sol(t)[0] - there) < 1e-8
        assert np.max(np.abs(solution.x_end)) < 1e-8


@pytest.mark.parametrize("e", [0.5, 0.25, 1.5])
def test_roots_of_what_is_0_on_one_side(e: float) -> None:
    """y' = sgn(max(x, 0)**e - 1/2), x = t - 1: y falls until x**e = 1/2."""
    system = System({x: 1, y: sign(Max(x, 0) ** e - 0.5)})
    solution = solve(system, x0=(-1, 0), t_span=(0, 3))
    turn = 0.5 ** (1 / e)
    assert solution.success
    assert abs(solution.y[1, -1] - (1 - 2 * turn)) < 1e-9


@pytest.mark.parametrize("shift", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("root", [p.e, 0.5])
def test_surfaces_that_vanish_together_with_a_root_in_them_are_crossed(shift: float, root: object) -> None:
    """sgn(w + |w|**e) is sgn w next to w = 0; |w|**e sgn w + w**3 has one zero, w = 0."""
    w = x - shift
    for h in (w + Abs(w) ** root, Abs(w) ** root * sign(w) + w**3, Abs(w) ** root * w):
        system = System({x: 1 + sign(w) / 2, y: sign(h)}, parameters=p)
        solution = solve(system, x0=(shift - 0.5, 0), t_span=(0, 2))
        # x passes the zero at t = 1; x + sqrt |x| is positive before it.
        before = 1.0 if h == w + Abs(w) ** root else -1.0
        assert solution.success, (h, solution.message)
        assert abs(solution.y[1, -1] - (before + 1.0)) < 1e-9
