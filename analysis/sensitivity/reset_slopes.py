"""Derivatives of resets and of the instants of time events by y = (x, parameters, t)."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, cast

import numpy as np
import sympy
from sympy import Expr

from filippov import System, UsageError
from filippov import t as time
from filippov.base.arrays import Array
from filippov.model.symbolic import SymbolicForm
from filippov.solving.state.events import Event, Mode


def reset_slopes(
    system: System, event: Event, names: tuple[str, ...], p: Array, at: Array | None = None
) -> Array:
    """dR/dy of the reset y+ = R(y) at an event: (N, N). UsageError for a system of plain functions.

    at: the state where another reset of the instant comes first
    """
    x = event.x if at is None else at
    n, slopes = len(_form(system).x), _slopes(system, event.index, tuple(event.before), names)
    out = np.eye(n + len(names) + 1)
    with np.errstate(all="ignore"):
        out[:n] = np.reshape(slopes(np.float64(event.t), *x, *p), (n, -1))
    return out


@lru_cache(maxsize=128)
def _slopes(system: System, index: int, before: Mode, names: tuple[str, ...]) -> Callable[..., Any]:
    """dR/dy as a function of t, states and parameters that returns the rows of (n, N) behind each other."""
    form, m = _form(system), len(system.surfaces)
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
    form = _form(system)
    if not names:
        return np.array([*[0.0] * len(form.x), 1.0])
    source = system.time_events[event.index - len(system.surfaces)]
    values: dict[Any, Any] = {q: sympy.Float(float(v), 17) for q, v in zip(form.p, p, strict=True)}
    instants = [_expression(q) for q in source.instants]
    numbers = [float(q.xreplace(values)) for q in instants]
    if source.times is None:
        instant = instants[0] + round((event.t - numbers[0]) / numbers[1]) * instants[1]
    else:
        instant = instants[int(np.argmin(np.abs(np.array(numbers) - event.t)))]
    slopes = [-float(instant.diff(q).xreplace(values)) for n in names for q in form.p if q.name == n]
    return np.array([*[0.0] * len(form.x), *slopes, 1.0])


def _expression(value: Any) -> Expr:
    return value if isinstance(value, Expr) else sympy.Float(value, 17)


def _form(system: System) -> SymbolicForm:
    if system.symbolic is None:
        raise UsageError("derivatives of resets need a system written in expressions; this has functions.")
    return system.symbolic
