"""Hybrid runs phase by phase: what a careful user of heyoka, scipy and CVODE writes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

Numbers = Any


class Guard(NamedTuple):
    """An end of a phase: h(t, x) vanishes in a direction; `then` changes x in place and names the next."""

    h: Callable[[Any, Any], Any]
    direction: int
    then: Callable[[float, np.ndarray], str]


class Phase(NamedTuple):
    """A smooth field(t, x, f) of a phase, f a module with sin, cos, exp ... of its numbers; what ends it."""

    field: Callable[[Any, Any, Any], Any]
    guards: tuple[Guard, ...] = ()


class Run(NamedTuple):
    """Phases by name, the first one and its state, until the end; the longest step that heyoka may take."""

    phases: Mapping[str, Phase]
    first: str
    x0: tuple[float, ...]
    end: float
    cap: float = math.inf


def by_scipy(run: Run, rtol: float, method: str = "DOP853") -> tuple[np.ndarray, list[float]]:
    """State at the end and times of the events."""
    t, x, name, times = 0.0, np.array(run.x0), run.first, []
    while t < run.end:
        phase, events = run.phases[name], []
        for guard in phase.guards:
            # An event at the start of a phase is the one that has ended the phase before.
            def event(t: float, x: Any, h: Any = guard.h) -> float:
                return float(h(t, x))

            event.terminal, event.direction = True, guard.direction  # type: ignore[attr-defined]
            events.append(event)
        out = solve_ivp(
            lambda t, x, field=phase.field: field(t, x, math), (t, run.end), x, method=method, rtol=rtol,
            atol=rtol / 100, events=events or None,
        )  # fmt: skip
        t, x = float(out.t[-1]), out.y[:, -1].copy()
        if out.status != 1:
            break
        met = next(k for k, found in enumerate(out.t_events) if found.size)
        times.append(t)
        name = phase.guards[met].then(t, x)
    return x, times


def by_cvode(run: Run, rtol: float) -> tuple[np.ndarray, list[float]]:
    """The same by SUNDIALS' CVODE (Adams), through scikit-sundae."""
    from sksundae.cvode import CVODE

    t, x, name, times = 0.0, np.array(run.x0), run.first, []
    while t < run.end:
        guards = run.phases[name].guards
        options: dict[str, Any] = {"method": "Adams", "rtol": rtol, "atol": rtol / 100}
        options["max_num_steps"] = 10**7
        if guards:
            options |= {"eventsfn": _cvode_guards(guards), "num_events": len(guards)}
        out = CVODE(_cvode_field(run.phases[name]), **options).solve(np.array([t, run.end]), x)
        t, x = float(out.t[-1]), np.array(out.y[-1])
        if out.status != 2:
            break
        met = int(np.flatnonzero(np.asarray(out.i_events)[-1])[0])
        times.append(t)
        name = guards[met].then(t, x)
    return x, times


def _cvode_field(phase: Phase) -> Callable[[float, Any, Any], None]:
    def field(t: float, x: Any, dx: Any) -> None:
        dx[:] = phase.field(t, x, math)

    return field


def _cvode_guards(guards: tuple[Guard, ...]) -> Callable[[float, Any, Any], None]:
    def events(t: float, x: Any, found: Any) -> None:
        found[:] = [guard.h(t, x) for guard in guards]

    events.terminal = [True] * len(guards)  # type: ignore[attr-defined]
    events.direction = [guard.direction for guard in guards]  # type: ignore[attr-defined]
    return events


class ByHeyoka:
    """The same by heyoka: an integrator for every phase, made once; a single phase goes on from callbacks."""

    def __init__(self, run: Run, rtol: float) -> None:
        import heyoka as hy

        self.run, self.made, self.times = run, {}, []
        states = hy.make_vars(*[f"q{i}" for i in range(len(run.x0))])
        signs = {1: hy.event_direction.positive, -1: hy.event_direction.negative}
        for name, phase in run.phases.items():
            of = phase.field(hy.time, states, hy)
            fields = [hy.expression(f) if isinstance(f, float) else f for f in of]
            events = []
            for guard in phase.guards:
                options = {"callback": self.going_on(guard)} if len(run.phases) == 1 else {}
                h = guard.h(hy.time, states)
                events.append(hy.t_event(h, direction=signs[guard.direction], **options))
            self.made[name] = hy.taylor_adaptive(
                list(zip(states, fields, strict=True)), list(run.x0), tol=rtol, t_events=events
            )

    def going_on(self, guard: Guard) -> Callable[[Any, int], bool]:
        def callback(ta: Any, _: int) -> bool:
            self.times.append(ta.time)
            guard.then(ta.time, ta.state)
            return True

        return callback

    def __call__(self) -> tuple[np.ndarray, list[float]]:
        run, t, x, name, self.times = self.run, 0.0, np.array(self.run.x0), self.run.first, []
        while True:
            ta, guards = self.made[name], run.phases[name].guards
            ta.time, ta.state[:] = t, x
            if guards:
                ta.reset_cooldowns()
            outcome = int(ta.propagate_until(run.end, max_delta_t=run.cap)[0])
            t, x = ta.time, ta.state.copy()
            if not -len(guards) <= outcome < 0:
                return x, self.times
            self.times.append(t)
            name = guards[-1 - outcome].then(t, x)


class ByDiffrax:
    """A run of one phase without events by diffrax's Dopri8, compiled once."""

    def __init__(self, run: Run, rtol: float) -> None:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp

        (phase,) = run.phases.values()
        term = diffrax.ODETerm(lambda t, x, args: jnp.stack([jnp.asarray(f) for f in phase.field(t, x, jnp)]))
        control = diffrax.PIDController(rtol=rtol, atol=rtol / 100)
        self.solve = jax.jit(
            lambda x: diffrax.diffeqsolve(
                term, diffrax.Dopri8(), 0.0, run.end, None, x, stepsize_controller=control, max_steps=10**7
            ).ys[-1]
        )
        self.x0 = np.array(run.x0)

    def __call__(self) -> tuple[np.ndarray, list[float]]:
        return np.asarray(self.solve(self.x0)), []
