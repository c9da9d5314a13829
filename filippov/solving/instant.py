"""What happens within one instant: a solution that reaches a surface in less time than t can tell apart.

The upstroke of an exponential neuron grows as exp(V/D) and comes to its threshold within 1e-16 s. There t
stays what it is, and the field is followed by the way that it leads instead of by time.
"""

from __future__ import annotations

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.tables import codes
from filippov.solving.state.run import Run

# Spacings of t that count as one instant; the field calls that it may take.
SPACINGS, CALLS = 64.0, 20_000
# The way after which no surface is looked for any more, in sizes of the state.
FARTHEST = 1e6


def reached_at_once(run: Run) -> bool:
    """Whether a surface is reached within the spacing of t, on which the run is then put, as triggered."""
    machine, mode, t = run.machine, run.mode.copy(), run.t
    if machine.m == 0:
        return False
    begin = mode * machine.guards(t, run.x, mode)
    if np.any(mode == 0.0) or t == 0.0 or any(machine.widths) or not np.all(begin > 0.0):
        return False
    x = _followed(run, mode)
    if x is None:
        return False
    i = int(np.argmin(mode * machine.guards(t, x, mode)))
    g, _ = machine.gradients(t, x, mode)
    square = float(g[i] @ g[i])
    if not 0.0 < square < np.inf:
        return False
    run.x[:] = x - float(machine.guards(t, x, mode)[i]) * g[i] / square
    run.trigger[:] = 0
    run.trigger[i] = codes.ROOT
    run.clock.step = 0.0
    return True


def _followed(run: Run, mode: Array) -> Array | None:
    """The state where the field of a mode comes to a surface, by the way that it leads; None without one."""
    from scipy.integrate import solve_ivp

    machine, t = run.machine, run.t
    span, calls = SPACINGS * float(np.spacing(abs(t))), 0

    def field(way: float, z: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > CALLS:
            raise _TooLongError
        velocity = run.direction * machine.rhs(t, np.ascontiguousarray(z[:-1]), mode, mode)
        speed = float(np.linalg.norm(velocity))
        return np.append(velocity, 1.0) / speed if 0.0 < speed < np.inf else np.full(len(z), np.nan)

    def guard(way: float, z: Array) -> float:
        return float(np.min(mode * machine.guards(t, np.ascontiguousarray(z[:-1]), mode)))

    def later(way: float, z: Array) -> float:
        return span - float(z[-1])

    for event in (guard, later):
        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    farthest = FARTHEST * (1.0 + float(np.max(np.abs(run.x), initial=0.0)))
    rtol, atol = max(run.options.rtol, 1e-12), np.append(run.atol, span)
    try:
        with np.errstate(all="ignore"):
            found = solve_ivp(
                field, (0.0, farthest), np.append(run.x, 0.0), "DOP853", events=(guard, later), rtol=rtol,
                atol=atol,
            )  # fmt: skip
    except _TooLongError:
        return None
    if found.status != 1 or not len(found.y_events[0]):
        return None
    x = np.ascontiguousarray(found.y_events[0][-1][:-1])
    return x if np.all(np.isfinite(x)) else None


class _TooLongError(Exception):
    """No surface within the calls that an instant may take."""
