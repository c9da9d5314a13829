"""A knot of an input: whether the mode goes on beyond it, without a search for what can follow."""

from __future__ import annotations

import numpy as np

from filippov.solving.state.run import Run

EPS = float(np.finfo(float).eps)
# Of the set of a sign: a multiplier nearer to its end is decided by the search.
INSIDE = 1e-6


def goes_on(run: Run, continuous: bool) -> bool:
    """Whether the present mode is the only one that can follow, with the signals after the knot.

    continuous   the signals do not jump, only their slopes: the state stays on what it slides on

    Off its surfaces, and with multipliers inside their sets, a mode goes on: which way the signs act on the
    rates does not depend on the slope of a signal. False where that does not decide it.
    """
    machine, mode = run.machine, run.mode
    if not machine.m:
        return True
    sliding = mode == 0.0
    h = machine.guards(run.t, run.x, mode)
    g, gt = machine.gradients(run.t, run.x, mode)
    if not (np.all(np.isfinite(h)) and np.all(np.isfinite(g))):
        return False
    noise = 64 * EPS * (np.abs(g) @ np.abs(run.x) + np.abs(gt * run.t))
    if np.any((mode * h <= np.array(machine.widths) + noise)[~sliding]):
        return False
    if not np.any(sliding):
        return True
    if not continuous or machine.sliding != "filippov" or (np.sum(sliding) > 1 and not machine.affine):
        return False
    held: object = machine.constants["HELD"]
    special = np.array(machine.contacts) != 0
    if np.any((special | np.array(held, dtype=bool) | (run.order < 0))[sliding]):
        return False
    code, velocity, lam, _ = machine.probe(run.t, 0.0, run.x, mode, run.lam)
    if code != 0 or not np.all(np.isfinite(velocity)):
        return False
    radii = machine.radii(run.t, run.x)
    inside = np.minimum(lam - radii[:, 0], radii[:, 1] - lam) > INSIDE
    if not np.all(inside[sliding]):
        return False
    run.lam[sliding] = lam[sliding]
    return True
