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
    """R(d) for d > 0, started at break-away: the first return of v to 0 from below."""
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


def scipy_trajectory(x0: np.ndarray, t_end: float, rtol: float, method: str = "DOP853") -> np.ndarray:
    """The end of a motion that starts slipping, phase by phase."""
    t, x, sign = 0.0, np.array(x0), float(np.sign(x0[1]))
    options = {"method": method, "rtol": rtol, "atol": rtol * 1e-2}
    while t < t_end:
        run = solve_ivp(slip(sign), (t, t_end), x, events=stopping(sign), **options)
        t, x = float(run.t[-1]), run.y[:, -1].copy()
        if t >= t_end:
            break
        x[1] = 0.0
        force = P * (x[0] + I * x[2])
        if abs(force) < FS:
            run = solve_ivp(stick, (t, t_end), x, events=breaking, **options)
            t, x = float(run.t[-1]), run.y[:, -1].copy()
            force = P * (x[0] + I * x[2])
        sign = -float(np.sign(force))
        if t < t_end:
            x[1] = sign * 1e-300
    return x


class DiffraxMap:
    """diffrax's Dopri8 on the slip phase, all points at once under vmap and jit."""

    def __init__(self, rtol: float) -> None:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp
        import optimistix

        def field(t: Any, x: Any, args: Any) -> Any:
            g = FC + (FS - FC) * jnp.exp(-((x[1] / VS) ** 2))
            return jnp.stack([x[1], (-P * (x[0] + D * x[1] + I * x[2]) + g - B * x[1]) / M, x[0]])

        event = diffrax.Event(
            lambda t, y, args, **_: y[1], optimistix.Newton(1e-13, 1e-13, optimistix.rms_norm), direction=True
        )

        def turn(x0: Any) -> Any:
            return diffrax.diffeqsolve(
                diffrax.ODETerm(field), diffrax.Dopri8(), 0.0, 100.0, None, x0, event=event, max_steps=4096,
                stepsize_controller=diffrax.PIDController(rtol=rtol, atol=rtol * 1e-2), throw=False,
            ).ys[-1, 0]  # fmt: skip

        self.run = jax.jit(jax.vmap(turn))

    def __call__(self, d: np.ndarray) -> np.ndarray:
        x0 = np.column_stack([d, np.full_like(d, -1e-300), (FS / P - d) / I])
        return np.asarray(self.run(x0))


@dataclass
class HeyokaBatch:
    """heyoka's batch integrator, 8 lanes, on the slip phase, its step capped from outside."""

    cap: float
    lanes: int = 8

    def __post_init__(self) -> None:
        import heyoka as hy

        x, v, z = hy.make_vars("x", "v", "z")
        g = FC + (FS - FC) * hy.exp(-((v / VS) ** 2))
        system = [(x, v), (v, (-P * (x + D * v + I * z) + g - B * v) / M), (z, x)]
        event = hy.t_event_batch(v, direction=hy.event_direction.positive)
        self.integrator = hy.taylor_adaptive_batch(
            system, np.zeros((3, self.lanes)), tol=1e-10, t_events=[event]
        )

    def __call__(self, d: np.ndarray) -> np.ndarray:
        ta, out, caps = self.integrator, np.empty_like(d), [self.cap] * self.lanes
        for first in range(0, d.size, self.lanes):
            value = np.resize(d[first : first + self.lanes], self.lanes)
            ta.set_time(0.0)
            ta.state[:] = (value, np.zeros(self.lanes), (FS / P - value) / I + 3e-17)
            ta.reset_cooldowns()
            target, left = np.full(self.lanes, 100.0), self.lanes
            while left:
                # The first event of any lane ends the call; that lane then waits where it is.
                ta.propagate_until(target, max_delta_t=caps)
                for lane, result in enumerate(ta.propagate_res):
                    if int(result[0]) == -1 and target[lane] == 100.0:
                        if first + lane < d.size:
                            out[first + lane] = ta.state[0, lane]
                        target[lane] = ta.time[lane]
                        left -= 1
        return out


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
