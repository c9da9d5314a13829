"""Whether a surface with a reset was passed without it: what no run may report as success."""

from __future__ import annotations

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.state.rates import off_contact
from filippov.solving.state.run import Run, guard_terms

# Of the terms of h: deeper than that behind its surface a state has not got by rounding.
DEPTH = 1e-7
# Nearer than that a side of a surface is no choice of the solution.
NEXT = 1e-6


def passed(run: Run) -> str:
    """A sentence on a surface behind which the state lies though the mode names its active side, or ""."""
    machine, mode = run.machine, run.mode.tolist()
    active = [i for i, sides in enumerate(machine.resets_from) if mode[i] in sides and mode[i] != 0.0]
    if not active or run.direction < 0:
        return ""
    # Mostly the state is on the active side of all, and nothing else needs to be known.
    resting = any(side and sign == 0.0 for side, sign in zip(machine.contacts, mode, strict=True))
    h = machine.guards(run.t, run.x, off_contact(run, run.mode)) if resting else run.guards()
    if not any(mode[i] * h[i] < 0.0 for i in active):
        return ""
    h, terms, g = _places(run)
    known = run.options.rtol * np.abs(run.x) + run.atol
    for i in active:
        if mode[i] * h[i] < -max(DEPTH * terms[i], 1e2 * float(np.abs(g[i]) @ known)):
            last = run.events[-1].t if len(run.events) else float(run.t)
            return (
                f"surface {machine.surfaces[i].name!r} was passed without its reset, h = {h[i]:.3g}; what "
                f"follows the event at t = {last:.9g} or one shortly before it is not to be trusted."
            )
    return ""


def _places(run: Run) -> tuple[Array, Array, Array]:
    """h of every surface, contacts open, the size of its terms, and its gradient."""
    mode = off_contact(run, run.mode)
    g, gt = run.machine.gradients(run.t, run.x, mode)
    return run.machine.guards(run.t, run.x, mode), guard_terms(g, gt, run.t, run.x), g


def slipped(run: Run, before: Mode) -> str:
    """A sentence on an obstacle, a surface with a contact, on whose far side resets at an instant led, or "".

    Its h is next to 0 there: whether the state is behind it, rounding has decided.
    """
    machine = run.machine
    sides = enumerate(machine.contacts)
    behind = [i for i, side in sides if side and run.mode[i] == -side and before[i] != -side]
    if not behind:
        return ""
    h, terms, _ = _places(run)
    for i in behind:
        if abs(h[i]) <= NEXT * max(terms[i], float(np.max(np.abs(run.x), initial=0.0))):
            return (
                f"resets at one instant leave surface {machine.surfaces[i].name!r} at h = {h[i]:.3g}, on the "
                "side from which it does not reset the state."
            )
    return ""
