"""The reference loop written out for other solvers: what a careful user of each would do."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

M, P, D, I, FS, FC, VS, B = 1.0, 10.0, 1.0, 10.0, 4.0, 2.0, 0.1, 1.0


def slip(sign: float) -> Any:
    """The slip field on one side of v = 0 (beta = 2)."""

    def field(t: float, x: Any) -> tuple[float, float, float]:
        v = x[1]
        g = FC + (FS - FC) * exp(-((v / VS) ** 2))
        return v, (-P * (x[0] + D * v + I * x[2]) - sign * g - B * v) / M, x[0]

    return field


def stick(t: float, x: Any) -> tuple[float, float, float]:
    """The stick field."""
    return 0.0, 0.0, x[0]


def stopping(sign: float) -> Any:
    def event(t: float, x: Any) -> float:
        return float(x[1])

    event.terminal, event.direction = True, -sign
    return event


def breaking(t: float, x: Any) -> float:
    return abs(P * (x[0] + I * x[2])) - FS


breaking.terminal, breaking.direction = True, 1


def scipy_map(d: np.ndarray, rtol: float, method: str = "DOP853") -> np.ndarray:
    """P(d) for d > 0, started at break-away: the first return of v to 0 from below."""
    out = np.empty_like(d)
    for i, value in enumerate(d):
        x0 = (value, -1e-300, (FS / P - value) / I)
        run = solve_ivp(
            slip(-1.0), (0, 100), x0, method=method, rtol=rtol, atol=rtol * 1e-2, events=stopping(-1.0)
        )
        out[i] = run.y[0, -1]
    return out


def scipy_response(t_end: float, rtol: float, method: str = "DOP853") -> np.ndarray:
    """The response from (0.1, 0, 0), stick and slip phases one after the other."""
    t, x = 0.0, np.array([0.1, 0.0, 0.0])
    options = {"method": method, "rtol": rtol, "atol": rtol * 1e-2}
    while t < t_end:
        run = solve_ivp(stick, (t, t_end), x, events=breaking, **options)
        t, x = float(run.t[-1]), run.y[:, -1].copy()
        if t >= t_end:
            break
        sign = -float(np.sign(x[0] + I * x[2]))
        x[1] = sign * 1e-300
        run = solve_ivp(slip(sign), (t, t_end), x, events=stopping(sign), **options)
        t, x = float(run.t[-1]), run.y[:, -1].copy()
        if t < t_end:
            x[1] = 0.0
    return x


@dataclass
class HeyokaMap:
    """heyoka's scalar Taylor integrator on the slip phase, its step capped from outside."""

    cap: float

    def __post_init__(self) -> None:
        import heyoka as hy

        x, v, z = hy.make_vars("x", "v", "z")
        g = FC + (FS - FC) * hy.exp(-((v / VS) ** 2))
        system = [(x, v), (v, (-P * (x + D * v + I * z) + g - B * v) / M), (z, x)]
        event = hy.t_event(v, direction=hy.event_direction.positive)
        self.integrator = hy.taylor_adaptive(system, [0.0, 0.0, 0.0], tol=1e-10, t_events=[event])

    def __call__(self, d: np.ndarray) -> np.ndarray:
        ta, out = self.integrator, np.empty_like(d)
        for i, value in enumerate(d):
            ta.time = 0.0
            # A rounding past break-away: exactly on it, 16 of the 500 fire their event at the start.
            ta.state[:] = (value, 0.0, (FS / P - value) / I + 3e-17)
            ta.reset_cooldowns()
            ta.propagate_until(100.0, max_delta_t=self.cap)
            out[i] = ta.state[0]
        return out
