"""Impacts on several contacts at once: the generalised Newton law, and contacts held at dh/dt = 0.

With L = dh/dt towards its own side, D_i the direction of the push of contact i (`filippov.model.contact`) and
A_ij = grad L_i . D_j, impulses l >= 0 change the state by sum D_i l_i and the rates by A l:

    0 <= l,   L+ + e L- >= 0,   l (L+ + e L-) = 0,   L- = 0 where a contact is at rest

a linear complementarity problem. A contact at rest that is struck through others may stay or open.
Sources: Glocker 2001, section 8.4; Brogliato 2016, section 5.4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.selection.complementarity import complementarity
from filippov.solving.state.rates import Rates, velocity
from filippov.solving.state.run import Run

FITS = 1e-9
# Impacts that rounding cannot put in order have flights of up to so many times its size.
CLOSE = 100.0


def directions(run: Run, x: Array, mode: Array, contacts: Sequence[int]) -> tuple[Array, Array, Array]:
    """D, shape (k, n), A, shape (k, k), and dL/dt in free motion, all towards the contacts' own sides."""
    machine, t = run.machine, run.t
    signs, pushes, rows, free = np.where(mode == 0.0, 1.0, mode), [], [], []
    field = velocity(run, x, mode)
    for i in contacts:
        side = float(machine.contacts[i])
        resting, pushed = mode.copy(), signs.copy()
        resting[i] = 0.0
        pushed[i] = side
        without = machine.rhs(t, x, pushed, resting)
        pushed[i] = -side
        pushes.append(machine.rhs(t, x, pushed, resting) - without)
        g, gt = machine.gradients(t, x, resting)
        rows.append(side * g[i])
        free.append(side * (float(g[i] @ field) + gt[i]))
    D = np.array(pushes)
    return D, np.array(rows) @ D.T, np.array(free)


def generalised_newton(
    run: Run, x: Array, mode: Array, rates: Rates, due: Sequence[int]
) -> Array | str | None:
    """The state after all impacts at once; None where one is alone, a sentence where the law does not fit."""
    machine = run.machine
    side = np.array(machine.contacts, dtype=float)
    closed = [i for i in range(machine.m) if side[i] and side[i] == mode[i] and rates.on(i)]
    contacts = [*due, *(i for i in closed if rates.still(i) and i not in due)]
    if len(contacts) == 1:
        return None
    for i in due:
        if side[i] == 0.0:
            name = machine.surfaces[i].name
            return f"The generalised Newton law needs resting contacts, {name!r} has none."
    D, A, _ = directions(run, x, mode, contacts)
    L, bounce = side * rates.rate, np.zeros(len(contacts))
    for k, i in enumerate(due):
        after = machine.reset(i, run.t, x, mode)
        impulse = float((after - x) @ D[k]) / float(D[k] @ D[k])
        if np.any(np.abs(x + impulse * D[k] - after) > FITS * (np.abs(x) + np.abs(after) + run.atol)):
            return (
                f"The generalised Newton law needs resets that act along one direction, that of "
                f"{machine.surfaces[i].name!r} changes more."
            )
        bounce[k] = impulse * A[k, k] + L[i]  # = -e L
    q = np.array([L[i] for i in due] + [0.0] * (len(contacts) - len(due))) - bounce
    # In the unit of the impact: slow ones are solved to the same relative accuracy.
    unit = float(np.max(np.abs(q))) or 1.0
    answer = complementarity(A, q / unit, np.zeros(len(q)), np.full(len(q), np.inf))
    states = [x + unit * (z @ D) for z in answer.solutions]
    if not states:
        return "The generalised Newton law has no solution here."
    scale = np.abs(x) + np.max(np.abs(D)) * np.max(np.abs(L)) + run.atol
    if any(np.any(np.abs(q - states[0]) > FITS * scale) for q in states[1:]):
        return "The generalised Newton law has several solutions here."
    return states[0]


def too_close(run: Run, x: Array, mode: Array, rates: Rates, due: Sequence[int]) -> list[int]:
    """The contacts that come to rest together where impacts are so slow that rounding hides their order.

    Of the contacts that are closed, all those of which each one, the others held, is pressed back within a
    flight of that size: they end an accumulation of impacts. None where not all of the impacts due are such.
    """
    machine = run.machine
    if not all(i < machine.m and machine.contacts[i] == mode[i] != 0 for i in due):
        return []
    closed = [
        i for i in range(machine.m) if machine.contacts[i] == mode[i] != 0 and (rates.on(i) or i in due)
    ]
    while True:
        slow = [i for i in closed if _pressed_back(run, x, mode, rates, i, [j for j in closed if j != i])]
        if not set(due) <= set(slow):
            return []
        if slow == closed:
            return slow
        closed = slow


def _pressed_back(
    run: Run, x: Array, mode: Array, rates: Rates, i: int, others: Sequence[int]
) -> bool:
    """Whether contact i, others held, has a flight no larger than CLOSE times the rounding of h."""
    held = mode.copy()
    held[list(others)] = 0.0
    _, _, (pull,) = directions(run, x, held, [i])
    return bool(pull < 0 and rates.rate[i] ** 2 <= -2.0 * pull * CLOSE * rates.h_noise[i])


def unresolved(run: Run, x: Array, mode: Array, rates: Rates) -> list[int]:
    """Contacts that are left so slowly that the flight to the next impact stays within rounding of h.

    What presses on them is the free motion with all contacts held that do not move, and those found so far.
    """
    machine = run.machine
    closed = [i for i in range(machine.m) if machine.contacts[i] == mode[i] != 0 and rates.on(i)]
    leaving = [i for i in closed if rates.rate[i] * mode[i] > 0 and not rates.still(i)]
    held = mode.copy()
    held[[i for i in closed if rates.still(i)]] = 0.0
    slow: list[int] = []
    while leaving:
        _, _, free = directions(run, x, held, leaving)
        found = [
            i
            for i, pull in zip(leaving, free, strict=True)
            if pull < 0 and rates.rate[i] ** 2 <= -2.0 * pull * rates.h_noise[i]
        ]
        if not found:
            break
        slow += found
        held[found] = 0.0
        leaving = [i for i in leaving if i not in found]
    return slow


def hold(run: Run, x: Array, mode: Array, contacts: Sequence[int]) -> Array:
    """The state with dh/dt = 0 on these contacts, moved along the directions in which they push."""
    D, A, _ = directions(run, x, mode, contacts)
    resting = mode.copy()
    resting[list(contacts)] = 0.0
    side = np.array([float(run.machine.contacts[i]) for i in contacts])
    L = side * run.machine.guards(run.t, x, resting)[list(contacts)]
    impulse, *_ = np.linalg.lstsq(A, -L, rcond=None)
    return np.asarray(x + impulse @ D)
