"""Rest on surfaces whose resets lead onto each other, as a rimless wheel comes to stand on two spokes.

Where the impacts on surfaces without a contact accumulate, the limit may be several states at once: each at
rest on its surface (h = dh/dt = 0), run onto by the solution, and led by its reset to the next, the last to
the first. A surface that resets from both sides and lets the solution pass, as the feet of a rocking block
do, leads to its own other side.
The solution stays there if it has no velocity: if 0 is a convex combination of the fields at these states,
each led to the first state by the derivatives of the resets.

Sources: McGeer 1990, section 2 (the rimless wheel); Or & Ames 2011 (what follows a limit of impacts).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import EventKind
from filippov.solving.resets.jumps import runs_onto
from filippov.solving.resets.rest import NEAR_REST, holds_still, rest
from filippov.solving.resets.zeno import WITHIN, Accumulation, bridge
from filippov.solving.state.rates import off_contact, rates_at
from filippov.solving.state.run import Run

LONGEST = 8
# Of the states: where a reset has led back to the first one.
SAME = 1e-9
# Step of differences.
STEP = 1e-6
# How often a state at rest is looked at, by how much of the way the instants are skew, and by how much of
# itself a velocity may change from one to the next.
COUNTS, SKEW, CHANGES = (16, 1024, 4096, 16384), 0.3, 0.5


@dataclass(frozen=True)
class Place:
    """A state of the cycle, the surface on which it is at rest, and the mode there."""

    surface: int
    x: Array
    mode: Array


def rests_in_cycle(run: Run, i: int, limit: Accumulation | None = None) -> bool:
    """Move the run to its end if it rests in a cycle of resets, on surface i or at a limit there; True then.

    The event "sliding entry" on surface i says so.
    """
    kept_t, kept_x = run.t, run.x.copy()
    if limit is not None:
        run.clock.t = limit.t
    cycle = _cycle_at(run, i, limit)
    stays = bool(cycle) and _stays(run, cycle)
    run.clock.t = kept_t
    if not stays:
        return False
    # All of them are the limit: the one next to the last state, so that the dense output has no jump.
    x = min((place.x for place in cycle), key=lambda y: float(np.max(np.abs(y - kept_x))))
    if limit is not None:
        bridge(run, replace(limit, x=x))
    run.x[:] = x
    run.add_event(
        run.t, i, EventKind.ENTRY, run.signs, run.signs, x.copy(), float("nan"), 0.0,
        "rest where resets lead onto each other", False,
    )  # fmt: skip
    rest(run, ())
    return True


def passes_at_rest(run: Run, i: int, limit: Accumulation) -> bool:
    """Whether the resets of surface i alone, which is passed from both sides, leave the limit as it is."""
    kept_t, run.clock.t = run.t, limit.t
    cycle = _cycle_at(run, i, limit)
    run.clock.t = kept_t
    return bool(cycle) and all(
        place.surface == i and np.all(np.abs(place.x - cycle[0].x) <= run.atol) for place in cycle
    )


def _cycle_at(run: Run, i: int, limit: Accumulation | None) -> tuple[Place, ...]:
    """The places of a cycle of resets at rest on surface i, beside the run's state or a limit."""
    given = run.x.copy() if limit is None else limit.x
    x = _at_rest(run, given, i)
    near = run.atol + run.options.rtol * np.abs(run.x) if limit is None else WITHIN * limit.x_error
    return reset_cycle(run, x, i) if np.all(np.abs(x - given) <= near) else ()


def reset_cycle(run: Run, x: Array, first: int) -> tuple[Place, ...]:
    """The places that the resets lead round from a state at rest on a surface; () where they do not."""
    machine, i = run.machine, first
    mode = off_contact(run, run.mode)
    found: list[Place] = []
    while len(found) < LONGEST:
        mode = mode.copy()
        if mode[i] not in machine.resets_from[i]:
            mode[i] = machine.resets_from[i][0]
        rates = rates_at(run, x, mode)
        if machine.contacts[i] or not (rates.on(i) and rates.still(i) and runs_onto(run, x, mode, rates, i)):
            return ()
        found.append(Place(i, x, mode))
        x = machine.reset(i, run.t, x, mode)
        if not np.all(np.isfinite(x)):
            return ()
        if len(machine.resets_from[i]) > 1 and _passes(run, found[-1], x):
            mode = mode.copy()
            mode[i] = -mode[i]
        rates = rates_at(run, x, mode)
        on = [rates.on(j) for j in range(machine.m)]
        sides = np.where(rates.h >= 0.0, 1.0, -1.0)
        mode = np.where(on, mode, np.where(np.array(machine.widths) > 0.0, mode, sides))
        start = found[0].x
        back = bool(np.all(np.abs(x - start) <= SAME * (np.abs(x) + np.abs(start)) + run.atol))
        if back and not (i == found[0].surface and mode[i] == -found[0].mode[i]):
            return tuple(found) if len(found) > 1 else ()
        # The surface that was left may be run onto again: then nothing has been reached.
        ahead = [j for j in range(machine.m) if machine.resets_from[j] and on[j]]
        ahead = [j for j in ahead if runs_onto(run, x, mode, rates, j)]
        if len(ahead) != 1:
            return ()
        i = ahead[0]
    return ()


def _passes(run: Run, place: Place, led: Array) -> bool:
    """Whether the reset of a surface lets through what runs slowly onto it, as a foot of a rocking block."""
    machine, i, mode = run.machine, place.surface, place.mode
    velocity = machine.rhs(run.t, place.x, np.where(mode == 0.0, 1.0, mode), mode)
    step = STEP * (1.0 + float(np.max(np.abs(place.x)))) / (1e-300 + float(np.max(np.abs(velocity))))
    moved = np.ascontiguousarray(place.x + step * velocity)
    after, other = machine.reset(i, run.t, moved, mode), mode.copy()
    other[i] = -mode[i]
    before = rates_at(run, moved, mode).rate[i] - rates_at(run, place.x, mode).rate[i]
    behind = rates_at(run, after, other).rate[i] - rates_at(run, led, other).rate[i]
    return bool(before * behind > 0.0)


def _at_rest(run: Run, x: Array, i: int) -> Array:
    """The state moved to h = dh/dt = 0 of surface i (Gauss-Newton)."""
    mode = off_contact(run, run.mode)
    for _ in range(4):
        rates = rates_at(run, x, mode)
        slopes = []
        for j in range(len(x)):
            moved = x.copy()
            moved[j] += STEP * (1.0 + abs(x[j]))
            slopes.append((rates_at(run, moved, mode).rate[i] - rates.rate[i]) / (moved[j] - x[j]))
        rows = np.vstack([run.machine.gradients(run.t, x, mode)[0][i], slopes])
        step, *_ = np.linalg.lstsq(rows, np.array([rates.h[i], rates.rate[i]]), rcond=None)
        x = np.ascontiguousarray(x - step)
    return x


def _stays(run: Run, cycle: tuple[Place, ...]) -> bool:
    """Whether the cycle's states do not move, now and until the run's end or the next time event.

    Asked so often that no velocity can have passed 0 in between: it changes by less than it is.
    """
    start, end = run.t, float(run.clock.t_end)
    from filippov.model.symbols import t as time  # takes longer to import than all else

    form = run.machine.system.symbolic
    steady = form is not None and not any(time in e.free_symbols for e in form.expressions())
    for count in COUNTS[:1] if steady else COUNTS[1:]:
        found = []
        # Not at equal distances, which may be the period of what acts.
        for part in np.linspace(0.0, 1.0, count):
            led = _led(run, cycle, start + (end - start) * (part + SKEW * part * (1.0 - part)))
            if led is None or not holds_still(led):
                return False
            found.append(led)
        velocities = np.array(found)
        speeds = np.linalg.norm(velocities, axis=2)
        changes = np.linalg.norm(np.diff(velocities, axis=0), axis=2)
        if steady or np.all(changes <= CHANGES * np.minimum(speeds[1:], speeds[:-1])):
            return True
    return False


def _led(run: Run, cycle: tuple[Place, ...], t: float) -> Array | None:
    """The velocities at the cycle's states, each led to the first; None where one is off its surface."""
    machine, led = run.machine, []
    for k, place in enumerate(cycle):
        mode = place.mode
        h = abs(float(machine.guards(t, place.x, mode)[place.surface]))
        if h > NEAR_REST * (1.0 + float(np.max(np.abs(place.x)))):
            return None
        velocity = machine.rhs(t, place.x, np.where(mode == 0.0, 1.0, mode), mode)
        step = STEP * (1.0 + float(np.max(np.abs(place.x)))) / (1e-300 + float(np.max(np.abs(velocity))))
        here, moved = place.x, np.ascontiguousarray(place.x + step * velocity)
        for other in cycle[k:] if k else ():
            here = machine.reset(other.surface, t, here, other.mode)
            moved = machine.reset(other.surface, t, moved, other.mode)
        led.append((moved - here) / step)
    return np.array(led)
