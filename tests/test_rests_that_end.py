"""Rest that a force in time ends: a block that rocks, stands and lifts again; a wheel that is pushed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import Status, Surface, System, cos, exp, parameters, sign, sin, solve, states
from filippov import t as time

Q, W = states("q w")
VALUES = {"al": 0.2, "p": 2.0, "e": 0.5, "w0": 5.0, "a0": 0.2, "a1": 0.01}
P = parameters(**VALUES)
PUSH = (P.a0 + P.a1 * time) * cos(P.w0 * time + 1.7)
EDGE = Surface("edge", Q, reset={W: P.e * W}, side="both")
BLOCKS = {
    # Not affine in the sign, as in Housner 1963 before he linearised it.
    True: System(
        {Q: W, W: -(P.p**2) * (sin(P.al * sign(Q) - Q) + PUSH * cos(P.al * sign(Q) - Q))}, surfaces=[EDGE]
    ),
    False: System({Q: W, W: -(P.p**2) * (P.al * sign(Q) - Q + PUSH)}, surfaces=[EDGE]),
}


class Block:
    """Flights of the block by scipy between impacts, with its times of lifting by brentq."""

    def __init__(self, seed: int) -> None:
        r = np.random.default_rng([31, seed])
        self.al, self.p, self.e, self.w0 = (r.uniform(*q) for q in ((0.1, 0.4), (1, 4), (0.3, 0.8), (3, 12)))
        self.full = bool(r.integers(2))
        self.level = math.tan(self.al) if self.full else self.al
        self.a0, self.a1 = r.uniform(0.8, 1.02) * self.level, r.uniform(0.0, 0.03) * self.level
        self.rests, self.lifts = 0, 0

    def push(self, t: Any) -> Any:
        return (self.a0 + self.a1 * t) * np.cos(self.w0 * t + 1.7)

    def fly(self, side: int, t: float, t_end: float, y: Any, stop: bool) -> Any:
        def field(t: float, y: Any) -> list[float]:
            lean = self.al * side - y[0]
            torque = math.sin(lean) + self.push(t) * math.cos(lean) if self.full else lean + self.push(t)
            return [y[1], -(self.p**2) * torque]

        def down(_: float, y: Any) -> float:
            return float(y[0] * side)

        down.terminal, down.direction = stop, -1  # type: ignore[attr-defined]
        options = {"rtol": 1e-12, "atol": 1e-20, "method": "DOP853", "max_step": 0.06 / self.w0}
        return solve_ivp(field, (t, t_end), y, events=[down] if stop else None, **options)

    def lifting(self, t: float, t_end: float) -> float | None:
        grid = np.linspace(t + 1e-9, t_end, 100_001)
        over = np.nonzero(np.abs(self.push(grid)) > self.level)[0]
        if not len(over):
            return None
        assert over[0] > 0
        ends = grid[over[0] - 1], grid[over[0]]
        return float(brentq(lambda q: abs(self.push(q)) - self.level, *ends, xtol=1e-15))

    def end(self, t_end: float) -> Any:
        t, resting, side, y = 0.0, True, 1, np.zeros(2)
        while t < t_end:
            if resting:
                lifts = self.lifting(t, t_end)
                if lifts is None:
                    return np.zeros(2)
                t, side, resting = lifts, -1 if self.push(lifts) > 0 else 1, False
                self.lifts += 1
                ahead = 1e-4
            else:
                flight = self.fly(side, t, t_end, y, stop=True)
                t, y = flight.t[-1], flight.y[:, -1]
                if flight.status != 1:
                    return y
                side, y = -side, np.array([0.0, self.e * y[1]])
                if abs(y[1]) < 1e-6:
                    # Flights of 2 w/a, each e times as long as the one before.
                    free = self.p**2 * (self.level - abs(self.push(t)))
                    t, y, resting = t + 2 * abs(y[1]) / free / (1 - self.e), np.zeros(2), True
                    self.rests += 1
                    continue
                ahead = min(1e-3 * abs(y[1]), 1e-5)
            y, t = self.fly(side, t, t + ahead, y, stop=False).y[:, -1], t + ahead
        return y


@pytest.mark.parametrize("seed", [0, 1, 2, 12, 17])
def test_a_block_lifts_again_from_the_rest_that_it_has_rocked_to(seed: int) -> None:
    block = Block(seed)
    want = block.end(8.0)
    values = {name: getattr(block, name) for name in VALUES}
    run = solve(BLOCKS[block.full], (0, 0), (0, 8), parameters=values, zeno="continue", rtol=1e-10)
    assert run.success, run.message
    assert run.x_end == pytest.approx(want, abs=1e-5)
    kinds = [str(event.kind) for event in run.events]
    assert (kinds.count("sliding entry"), kinds.count("sliding exit")) == (block.rests, block.lifts)


def test_a_block_stands_until_the_ground_accelerates_enough() -> None:
    """At rest from the start, on a field that is not affine in the sign: a(t) = tan al."""
    values = {"al": 0.25, "p": 2.0, "e": 0.85, "w0": 5.0, "a0": 0.25, "a1": 0.02}
    run = solve(BLOCKS[True], (0, 0), (0, 3), parameters=values, zeno="continue")

    def over(t: float) -> float:
        return (0.25 + 0.02 * t) * abs(math.cos(5 * t + 1.7)) - math.tan(0.25)

    grid = np.linspace(0, 3, 10_001)
    k = int(np.argmax([over(t) > 0 for t in grid]))
    assert run.success
    assert run.events[0].t == pytest.approx(brentq(over, grid[k - 1], grid[k]), abs=1e-10)
    assert run.events[0].kind == "sliding exit"


PUSHES = [(3, 0.1, True), (3.8, 0.5, True), (6, 1, False), (6, 0.03, False)]


@pytest.mark.parametrize(("push", "width", "stands"), PUSHES)
def test_a_wheel_on_two_spokes_is_pushed_on(push: float, width: float, stands: bool) -> None:
    """It stands while the push is below k al = 3.92; a short one was not seen."""
    p, al, k = parameters(A=push, width=width), 0.4, 9.81
    turn = math.cos(2 * al) * W
    surfaces = [
        Surface("front", al - Q, reset={Q: -al, W: turn}),
        Surface("back", Q + al, reset={Q: al, W: turn}),
    ]
    wheel = System({Q: W, W: k * Q + p.A * exp(-(((time - 5.1) / p.width) ** 2))}, surfaces=surfaces)
    run = solve(wheel, (-al, 1), (0, 10), zeno="continue")
    assert run.status is (Status.SUCCESS if stands else Status.ZENO)


def test_twisting_of_plain_functions_does_not_rest_through_what_exceeds_it() -> None:
    """x'' = -2 sgn x - sgn x' + d(t): at rest while |d| < 3, and not where d has a peak of 4 at t = 20.3."""

    def twisted(height: float) -> System:
        surfaces = [Surface("x", lambda t, x, p: x[0]), Surface("v", lambda t, x, p: x[1])]

        def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
            return [x[1], -2 * s[0] - s[1] + height * math.exp(-(((t - 20.3) / 0.1) ** 2))]

        return System(field=field, surfaces=surfaces, states="x v")

    assert solve(twisted(2.5), (1, 0), (0, 30), zeno="continue").success
    run = solve(twisted(4.0), (1, 0), (0, 30), zeno="continue")
    assert not run.success
    assert run.t_end < 20.3
