"""h and dh/dt of every surface at a state, each with what rounding makes of it.

Whether a state is on a surface, and whether it rests there, must not depend on where the terms of h are 0:
the scale of h is that of its own terms and of those of its rate over the time by which an instant is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.loop.land import NO_RATE
from filippov.solving.state.run import Run

EPS = float(np.finfo(float).eps)
# What NO_RATE is for formulas, where gradients are differences.
DIFFERENCES = 1e-10


@dataclass(frozen=True)
class Rates:
    """h, dh/dt in the direction of integration, and the sizes below which they are rounding, shape (m,)."""

    h: Array
    rate: Array
    h_noise: Array
    rate_noise: Array

    def on(self, i: int) -> bool:
        """Whether the state is on surface i."""
        return bool(abs(self.h[i]) <= self.h_noise[i])

    def still(self, i: int) -> bool:
        """Whether h_i does not change, to first order."""
        return bool(abs(self.rate[i]) <= self.rate_noise[i])

    def into(self, i: int, side: float) -> bool:
        """Whether the solution on this side of surface i runs onto it, by more than rounding."""
        return bool(self.rate[i] * side < -self.rate_noise[i])


def off_contact(run: Run, mode: Array) -> Array:
    """The mode with every contact open: there the guard is h itself."""
    return np.where(mode == 0.0, [float(c) for c in run.machine.contacts], mode)


def velocity(run: Run, x: Array, mode: Array) -> Array:
    """The field of a mode; where nothing holds it on its sliding surfaces, that of their upper sides."""
    code, field, _, _ = run.machine.probe(run.t, 0.0, x, mode, run.lam)
    if code == 0 and np.all(np.isfinite(field)):
        return field
    return run.machine.rhs(run.t, x, np.where(mode == 0.0, 1.0, mode), mode)


def rates_at(run: Run, x: Array, mode: Array, before: Rates | None = None) -> Rates:
    """The rates at a state; `before`: those of the state from which it came at this instant."""
    machine, t = run.machine, run.t
    open_mode = off_contact(run, mode)
    h = machine.guards(t, x, open_mode)
    g, gt = machine.gradients(t, x, open_mode)
    field = np.where(np.isfinite(field := velocity(run, x, open_mode)), field, 0.0)
    finite = np.where(np.isfinite(g), g, 0.0)
    terms = np.abs(finite) @ np.abs(field) + np.abs(gt)
    elapsed = max(abs(t), abs(t - float(run.clock.t_start)))
    h_noise = 64 * EPS * (np.abs(finite) @ np.abs(x) + np.abs(gt * t) + elapsed * terms)
    rate_noise = NO_RATE * terms
    contacts = [i for i, side in enumerate(machine.contacts) if side]
    if contacts:
        resting = open_mode.copy()
        resting[contacts] = 0.0
        a, at = (np.abs(q) for q in machine.gradients(t, x, resting))
        drift = a @ np.abs(field) + at
        extra = NO_RATE * (a @ np.abs(x)) + 64 * EPS * (at * abs(t) + elapsed * drift)
        rate_noise[contacts] += extra[contacts]
        if machine.system.field is not None:
            rate_noise[contacts] += DIFFERENCES * terms[contacts]
    if before is not None:
        # Of a surface that the jump has clearly led away from the noise of where it was says nothing.
        moved = np.abs(h - before.h)
        left = np.where(moved > h_noise, np.fmin(before.h_noise, 0.5 * moved), before.h_noise)
        h_noise, rate_noise = np.fmax(h_noise, left), np.fmax(rate_noise, before.rate_noise)
    return Rates(h, run.direction * (finite @ field + gt), h_noise, rate_noise)
