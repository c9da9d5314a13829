"""Derivatives of resets and of the instants of time events by y = (x, parameters, t)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, cast

import numpy as np
import sympy
from sympy import Expr

from filippov import System
from filippov import t as time
from filippov.analysis.sensitivity.plain_resets import plain_instant_slopes, plain_reset_slopes
from filippov.base.arrays import Array
from filippov.solving.resets.in_turn import states_in_turn
from filippov.solving.state.events import Event, Mode
from filippov.solving.state.machine import Machine


def reset_slopes(
    system: System,
    event: Event,
    names: tuple[str, ...],
    p: Array,
    at: Array | None = None,
    before: Mode | None = None,
) -> Array:
    """dR/dy of the reset y+ = R(y) at an event: (N, N).

    at, before: the state and its signs where another reset of the instant comes first
    """
    x = event.x if at is None else at
    n = system.dimension
    out = np.eye(n + len(names) + 1)
    if system.symbolic is None:
        by = plain_reset_slopes(system, event.index, event.t, np.asarray(x, dtype=np.float64), p)
        out[:n] = by[:, [*range(n), *(n + system.parameters.index(name) for name in names), -1]]
        return out
    slopes = _slopes(system, event.index, tuple(event.before if before is None else before), names)
    with np.errstate(all="ignore"):
        out[:n] = np.reshape(slopes(np.float64(event.t), *x, *p), (n, -1))
    return out


def slopes_in_turn(
    machine: Machine, events: Sequence[Event], names: tuple[str, ...], p: Array, x: Array, before: Mode
) -> Array:
    """dR/dy of several resets of one instant, one after the other: (N, N)."""
    by, signs = np.eye(len(x) + len(names) + 1), np.array(before, dtype=np.float64)
    turns = states_in_turn(machine, events[0].t, x, signs, [event.index for event in events])
    for event, (_, at, mode, _) in zip(events, turns, strict=True):
        came: Mode = tuple(int(m) for m in mode)
        by = reset_slopes(machine.system, event, names, p, at, came) @ by
    return by


@lru_cache(maxsize=128)
def _slopes(system: System, index: int, before: Mode, names: tuple[str, ...]) -> Callable[..., Any]:
    """dR/dy as a function of t, states and parameters that returns the rows of (n, N) behind each other."""
    form, m = system.symbolic, len(system.surfaces)
    assert form is not None
    after = form.reset[index] if index < m else form.time_reset[index - m]
    assert after is not None
    signs = {s: sympy.Integer(sign) for s, sign in zip(form.s, before, strict=True)}
    sizes = form.sizes_at_mode(before)
    states = sympy.Matrix([e.xreplace(signs).xreplace(sizes) for e in after])
    by = [*form.x, *(next(q for q in form.p if q.name == name) for name in names), time]
    return cast(
        Callable[..., Any],
        sympy.lambdify((time, *form.x, *form.p), list(states.jacobian(by)), "numpy", cse=True),
    )


def instant_slopes(system: System, event: Event, names: tuple[str, ...], p: Array) -> Array:
    """dG/dy of G = t - t_k at a time event: (N,)."""
    still = [0.0] * system.dimension
    if not names:
        return np.array([*still, 1.0])
    source = system.time_events[event.index - len(system.surfaces)]
    numbers = source.numbers(system.parameters.record(p), dict(zip(system.parameters.names, p, strict=True)))
    slopes = [_instant(system, q, p) for q in source.instants]
    if source.times is None:
        slope = slopes[0] + round((event.t - numbers[0]) / numbers[1]) * slopes[1]
    else:
        slope = slopes[int(np.argmin(np.abs(np.array(numbers) - event.t)))]
    return np.array([*still, *(-slope[system.parameters.index(name)] for name in names), 1.0])


def _instant(system: System, value: Any, p: Array) -> Array:
    """dT/dp of a start, a period or a time, which is an expression, a function of p or a number."""
    if isinstance(value, Expr):
        values: dict[Any, Any] = {
            q: sympy.Float(float(p[system.parameters.index(q.name)]), 17) for q in value.free_symbols
        }
        by = {q.name: float(value.diff(q).xreplace(values)) for q in values}
        return np.array([by.get(name, 0.0) for name in system.parameters.names])
    return plain_instant_slopes(system, value, p) if callable(value) else np.zeros(len(p))
