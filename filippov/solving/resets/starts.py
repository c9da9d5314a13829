"""Initial states on surfaces with resets: which are reset, which rest, and which come from a reset."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filippov.kernel.tables import codes
from filippov.solving.resets.jumps import on_active_side, pending, resting_on
from filippov.solving.resets.zeno import onto
from filippov.solving.state.rates import off_contact, rates_at
from filippov.solving.state.run import Run

# A state after a reset, as printed with few digits, is off the states that the reset leads to by so much.
AS_PRINTED = 1e-3
# In tolerances: so far off a contact is a state of the dense output of a solution that rests on it.
CLOSE = 10.0


def begin(run: Run) -> int:
    """Find the initial mode as far as compiled code can.

    A state on a contact to the tolerances, behind it or without speed, is put on it: it would fall through,
    or bounce too fast to be followed.
    """
    code, machine = run.begin(), run.machine
    if code == codes.USER_ERROR or run.direction < 0 or not any(machine.contacts):
        return code
    side, held = np.array(machine.contacts, dtype=float), 0.0 in run.mode.tolist()
    mode = off_contact(run, run.mode) if held else run.mode
    known = CLOSE * (run.atol + run.options.rtol * np.abs(run.x))

    h = machine.guards(run.t, run.x, mode) if held else run.guards()
    g = machine.gradients(run.t, run.x, mode)[0]
    near = (side != 0.0) & (np.abs(h) <= np.abs(g) @ known)
    if True not in near.tolist():  # mostly; without a contact nearby, nothing else needs to be known
        return code
    resting = np.where(side == 0.0, mode, 0.0)
    rate, slope = machine.guards(run.t, run.x, resting), machine.gradients(run.t, run.x, resting)[0]
    slow, behind = near & (np.abs(rate) <= np.abs(slope) @ known), near & (side * h < 0.0)
    if not np.any(slow | behind):
        return code
    run.mode[slow | behind] = side[slow | behind]
    x = on_active_side(run, run.x, run.mode)
    run.x[:] = onto(run, run.t, x, tuple(int(i) for i in np.flatnonzero(slow)))
    return run.begin()


def starting(run: Run, near: Sequence[int]) -> tuple[list[int], list[int]]:
    """Of surfaces that an initial state is on, those that reset it, and contacts that it rests on.

    The first have one active side, from which they are run onto; the mode is set to that side. A state after
    a reset that leads across its surface runs onto it from there as well: it is not reset again.
    """
    found = []
    for i in near:
        if len(run.machine.resets_from[i]) == 1:
            given = run.mode[i]
            run.mode[i] = run.machine.resets_from[i][0]
            if not pending(run, [i]):
                run.mode[i] = given
            elif _is_after(run, i):
                run.mode[i] = -run.mode[i]
            else:
                found.append(i)
    return found, [] if found else resting_on(run, near)


def _is_after(run: Run, i: int) -> bool:
    """Whether the present state is one after the reset of surface i, which leads across it here too."""
    from scipy.optimize import least_squares  # takes longer to import than all else

    machine, x, mode = run.machine, run.x.copy(), off_contact(run, run.mode)
    after = machine.reset(i, run.t, x, mode)
    rates = rates_at(run, after, run.mode)
    if not rates.on(i) or rates.still(i) or not rates.into(i, mode[i]):
        return False
    size = np.abs(x) + np.abs(after) + run.atol
    origins = (least_squares(lambda y: (machine.reset(i, run.t, y, mode) - x) / size, y) for y in (after, x))
    return any(bool(np.max(np.abs(origin.fun)) <= AS_PRINTED) for origin in origins)
