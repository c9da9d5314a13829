"""Resets that the compiled loop leaves open: several at once, landing on other surfaces, during sliding."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from filippov.machine import Array
from filippov.run import Run

# Resets at one instant, one landing on the surface of the next, before the motion counts as stuck.
LONGEST_CHAIN = 64
SAME = 1e-9
NO_RATE = 1e-12
MOST_TOGETHER = 6


def approach(run: Run, i: int, side: float) -> bool:
    """Whether the motion on this side of surface i runs onto it, clear of rounding."""
    mode = run.mode.copy()
    mode[i] = side
    _, field, _, _ = run.machine.probe(run.t, 0.0, run.x, mode, run.lam)
    g, gt = run.machine.gradients(run.t, run.x, mode)
    terms = np.append(g[i] * field, gt[i]) * run.direction * side
    return bool(np.sum(terms) < -NO_RATE * np.sum(np.abs(terms)))


def pending(run: Run, surfaces: Sequence[int]) -> list[int]:
    """The surfaces that reset the state now: reached from an active side and approached."""
    return [
        i
        for i in surfaces
        if run.mode[i] in run.machine.resets_from[i] and run.mode[i] != 0 and approach(run, i, run.mode[i])
    ]


def starting(run: Run, near: Sequence[int]) -> list[int]:
    """The surfaces that reset an initial state on them: with one active side, from which they are run onto.

    The mode is set to that side.
    """
    found = []
    for i in near:
        if len(run.machine.resets_from[i]) == 1 and approach(run, i, run.machine.resets_from[i][0]):
            run.mode[i] = run.machine.resets_from[i][0]
            found.append(i)
    return found


def composed(run: Run, active: Sequence[int]) -> Array | None:
    """The state after all the resets, None where it depends on their order (E5)."""
    after: Array | None = None
    for order in itertools.permutations(active) if len(active) <= MOST_TOGETHER else (active, active[::-1]):
        x = run.x.copy()
        for i in order:
            x = run.machine.reset(i, run.t, x, run.mode)
        if after is None:
            after = x
        elif np.any(np.abs(x - after) > SAME * (np.abs(x) + np.abs(after) + run.atol)):
            return None
    return after


def look_again(run: Run) -> list[int]:
    """Signs of all surfaces at the state after a jump; returns the surfaces that it lies on."""
    machine, on = run.machine, list[int]()
    sliding = [i for i in range(machine.m) if run.mode[i] == 0]
    for _ in range(2):  # sizes |h| inside other guards follow the signs found first
        on = []
        # In contact the guard is the rate; the place is told by h itself.
        mode = np.where(run.mode == 0, [c or 0 for c in machine.contacts], run.mode).astype(float)
        h = machine.guards(run.t, run.x, mode)
        g, gt = machine.gradients(run.t, run.x, mode)
        scale = np.sum(np.abs(g * run.x), axis=1) + np.abs(gt * run.t)
        for i in range(machine.m):
            if machine.widths[i] > 0.0:
                if run.mode[i] * h[i] < -machine.widths[i]:
                    run.mode[i] = -run.mode[i]
            elif abs(h[i]) <= 64 * np.finfo(float).eps * scale[i]:
                on.append(i)
            else:
                run.mode[i] = 1.0 if h[i] > 0 else -1.0
    return sorted({*on, *(i for i in sliding if run.mode[i] == 0)})
