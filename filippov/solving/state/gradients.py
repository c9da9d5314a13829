"""Gradients that a user gives, compared with differences of h."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.solving.state.machine import Machine

# Of |x|, and at least of LEAST of the largest state: h is to be straight over it, and more than rounding.
# Both have to contradict, as the length over which h bends is not known.
REACHES, LEAST = (1e-6, 1e-9), 1e-3
# Agreement asked for, of the largest slope.
AGREEMENT = 1e-5
ROUNDING = 64 * float(np.finfo(float).eps)


def check_gradients(machine: Machine, t: float, x: Array, places: Iterable[int] | None = None) -> None:
    """Refuse a gradient or a `linear` of a function h that its differences at (t, x) contradict.

    places      numbers of the surfaces; None: all

    A slope has to lie between the differences to both sides: where h has a kink, either is right. Where h is
    not defined or not finite on a side, nothing is said. Raises ModelError.
    """
    callbacks = machine.callbacks
    if callbacks is None or machine.system.field is None:
        return
    wanted = range(len(machine.system.surfaces)) if places is None else places
    told = [i for i in wanted if i < len(machine.system.surfaces) and _told(machine, i)]
    if not told:
        return
    given, by_time = machine.gradients(t, x, np.ones(machine.m))
    for i in told:
        wrong, found = np.ones(x.size, dtype=bool), np.zeros(x.size)
        for size in REACHES:
            sides = _sides(machine, i, t, x, size)
            if sides is None:
                break
            below, above, reach, level = sides
            found = found if size != REACHES[0] else 0.5 * (below + above)
            scale = float(np.max(np.abs([below, above, given[i]])))
            terms = float(np.sum(np.maximum(np.abs(below), np.abs(given[i])) * np.abs(x)))
            noise = ROUNDING * (terms + abs(float(by_time[i]) * t) + abs(level)) / reach
            room = AGREEMENT * scale + noise
            low, high = np.minimum(below, above) - room, np.maximum(below, above) + room
            wrong &= (given[i] < low) | (given[i] > high)
        else:
            if np.any(wrong):
                _refuse(machine, i, int(np.argmax(wrong)), t, x, given[i], found)


def scatter(machine: Machine, t: float, x: Array, mode: Array, i: int) -> float:
    """How far values of h_i lie off a line through neighbours a few roundings apart: its own rounding."""
    apart = 4 * np.finfo(float).eps * max(float(np.max(np.abs(x), initial=0.0)), abs(t))
    h = np.array([machine.guards(t + k * apart, x + k * apart, mode)[i] for k in range(-3, 4)])
    off = float(np.max(np.abs(np.diff(h, 2))))
    return off if np.isfinite(off) else np.inf


def _told(machine: Machine, i: int) -> bool:
    surface = machine.system.surfaces[i]
    return surface.gradient is not None or surface.linear


def _sides(
    machine: Machine, i: int, t: float, x: Array, size: float
) -> tuple[Array, Array, Array, float] | None:
    """Slopes of h_i by each state from below and from above, the distances, and h_i; None where h fails."""
    assert machine.callbacks is not None
    h, p = machine.system.surfaces[i].h, machine.callbacks.p
    largest = float(np.max(np.abs(x), initial=0.0))
    reach = size * np.maximum(np.abs(x), LEAST * largest if largest > 0 else 1.0)
    values = np.empty((2, x.size))
    try:
        middle = float(h(t, x.copy(), p))
        for k, sign in enumerate((-1.0, 1.0)):
            for j in range(x.size):
                y = x.copy()
                y[j] += sign * reach[j]
                values[k, j] = sign * (float(h(t, y, p)) - middle) / abs(y[j] - x[j])
    except Exception:  # noqa: BLE001  # a function of the user's beyond its domain: nothing to compare
        return None
    if not np.all(np.isfinite(values)):
        return None
    return values[0], values[1], reach, middle


def _refuse(machine: Machine, i: int, j: int, t: float, x: Array, given: Array, found: Array) -> None:
    surface, state = machine.system.surfaces[i], machine.system.states[j]
    at = ", ".join(f"{n} = {v:.6g}" for n, v in zip(machine.system.states, x, strict=True))
    what, cure = f"gradient gives {given[j]:.6g} for dh/d{state}", "Correct it, or leave gradient out"
    if surface.gradient is None:
        what = f"linear=True, and dh/d{state} was {given[j]:.6g} where it was first needed"
        cure = "Leave linear out"
    raise ModelError(
        f"surface {surface.name!r}: {what}, but h has the slope {found[j]:.6g} at t = {t:.9g}, {at}. "
        f"{cure}: h is then differenced."
    )
