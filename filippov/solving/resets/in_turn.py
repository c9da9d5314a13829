"""Several resets of one instant in turn: each is a map of the state that those before it have made.

Conditions and signs inside a reset are read from the mode. A state that is on a surface keeps the sign with
which it came; of a surface that an earlier reset of the instant has led the state across, the sign is that of
where the state now is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from filippov.base.arrays import Array
from filippov.model.system import System
from filippov.solving.state.machine import Machine

EPS = float(np.finfo(float).eps)


@lru_cache(maxsize=256)
def reads_signs(system: System) -> bool:
    """Whether a reset holds a sign or a condition on the states; plain functions look at the state itself."""
    form = system.symbolic
    if form is None:
        return False
    signs = {*form.s, *form.a}
    rows = [row for row in (*form.reset, *form.time_reset) if row is not None]
    return any(not signs.isdisjoint(e.free_symbols) for row in rows for e in row)


def states_in_turn(
    machine: Machine, t: float, x: Array, mode: Array, order: Sequence[int]
) -> Iterator[tuple[int, Array, Array, Array]]:
    """(number of a reset, state and mode before it, state after it) for each reset of an order."""
    reads = len(order) > 1 and reads_signs(machine.system)
    for i in order:
        after = machine.reset(i, t, x, mode)
        yield i, x, mode, after
        mode, x = (signs_after(machine, t, x, after, mode) if reads else mode), after


def signs_after(machine: Machine, t: float, x: Array, after: Array, mode: Array) -> Array:
    """The signs where a reset has put a state: new of the surfaces that it has clearly been led across."""
    if not np.all(np.isfinite(after)):
        return mode
    off = np.where(mode == 0.0, [float(c) for c in machine.contacts], mode)
    before, signs = machine.guards(t, x, off), mode
    for _ in range(2):  # sizes |h| inside other guards follow the signs found first
        opened = np.where(signs == 0.0, off, signs)
        h = machine.guards(t, after, opened)
        g, gt = machine.gradients(t, after, opened)
        noise = 64.0 * EPS * (np.where(np.isfinite(g), np.abs(g), 0.0) @ np.abs(after) + np.abs(gt * t))
        # What locating a surface has left of h says nothing of a side.
        noise = np.where(mode * before <= 0.0, np.fmax(noise, 2.0 * np.abs(before)), noise)
        noise = np.fmax(noise, np.array(machine.widths))
        beyond = np.where(mode == 0.0, np.abs(h) > noise, mode * h < -noise)
        signs = np.where(beyond, np.sign(h), mode)
    return signs
