"""The resets of one instant, carried on until no other is due: chains, impacts that are passed on, landings.

A surface resets the state where the state has reached it from an active side and runs onto it, and where
another reset has put the state beyond it. After each reset every surface is decided again by h and dh/dt: a
body that rests (mode 0) and is struck leaves, or strikes in turn what it rests on. Resets that are due
together are one where their maps commute; else every order is followed, each to its end, and what they all
end in is the answer (E5). Where they do not agree, `simultaneous` says what holds:

    "sequential"          one after the other, the largest -dh/dt (over |grad h|) first
    "generalised Newton"  L+ >= -e L- with L = dh/dt, impulses >= 0, all contacts at once (`impact_law`)

Sources: Brogliato 2016, sections 5.4 and 6.2 (multiple impacts); Glocker 2001, chapter 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import Status
from filippov.kernel.loop.limit import KEPT
from filippov.solving.resets.commuting import SAME, composed
from filippov.solving.resets.impact_law import generalised_newton, hold, too_close, unresolved
from filippov.solving.selection.ambiguity import guard_rows_of, point_of
from filippov.solving.state.leading import Terms, leading_term
from filippov.solving.state.point import Point
from filippov.solving.state.rates import Rates, off_contact, rates_at, velocity
from filippov.solving.state.run import Run

# Resets at one instant, one after the other, and states that different orders lead to, before they are
# called endless; so many of them at rest mean that the state cannot leave.
LONGEST_CHAIN, MOST_STATES, MOST_AT_REST = 4096, 500, 8
# A chain that fades comes to an end: so many impacts at most, where speeds are so much smaller.
LATEST, FADED = 4 * LONGEST_CHAIN, 1e-3
ACCUMULATES = "accumulation"
LATER = 8
# Steps towards the sides of several surfaces at once: one may lead behind another.
PUSHES = 8


@dataclass(frozen=True)
class Settled:
    """What the resets of an instant came to.

    surfaces   numbers of those that reset the state, time events after the surfaces
    reached    surfaces that the state is on in the end; left: contacts that it leaves
    status     None, or how the run ends here; detail: why
    """

    surfaces: tuple[int, ...] = ()
    reached: tuple[int, ...] = ()
    left: tuple[int, ...] = ()
    status: Status | None = None
    detail: str = ""


@dataclass(frozen=True)
class _State:
    """A state within the instant: signs of all surfaces, their rates, the resets due, those that happened."""

    x: Array
    mode: Array
    rates: Rates
    size: Array
    due: tuple[int, ...]
    done: tuple[int, ...] = ()
    depth: int = 0
    at_rest: int = 0


def source_name(run: Run, i: int) -> str:
    """Name of a surface, of a time event (they follow the surfaces), or of an input, which follow these."""
    names: list[str] = [*run.names, *(q.name for q in run.machine.system.inputs)]
    return names[i]


def state_text(run: Run) -> str:
    """The present state, by name."""
    return ", ".join(f"{name} = {v:.9g}" for name, v in zip(run.machine.system.states, run.x, strict=True))


def stuck(run: Run, surfaces: Sequence[int]) -> str:
    """What is said where events do not leave a state. Raises ModelError where a function h jumps there."""
    for i in surfaces:
        run.check_root(run.t, i, run.x.copy(), abs(float(run.guards()[i])), run.signs)
    return f"events do not leave the state {state_text(run)}."


def pending(run: Run, surfaces: Sequence[int]) -> list[int]:
    """Of surfaces that the state has reached, those that reset it: reached from an active side, run onto."""
    mode = off_contact(run, run.mode)
    active = [i for i in surfaces if mode[i] in run.machine.resets_from[i] and mode[i] != 0]
    if not active:
        return []
    rates = rates_at(run, run.x, run.mode)
    return [i for i in active if runs_onto(run, run.x, mode, rates, i)]


def reset_surfaces_at(run: Run) -> list[int]:
    """Surfaces with a reset that the present state is on."""
    rates = rates_at(run, run.x, run.mode)
    return [i for i in range(run.machine.m) if run.machine.resets_from[i] and rates.on(i)]


def bouncing(run: Run, surfaces: Sequence[int]) -> bool:
    """Whether one of these contacts is reached, or left again at once, too slowly to be told from rest."""
    if resting_on(run, surfaces):
        return True
    slow = unresolved(run, run.x, off_contact(run, run.mode), rates_at(run, run.x, run.mode))
    return any(i in surfaces for i in slow)


def resting_on(run: Run, surfaces: Sequence[int]) -> list[int]:
    """Of surfaces that the state is on, the contacts onto which its speed is no more than rounding."""
    open_to = [i for i in surfaces if run.machine.contacts[i] == run.mode[i] != 0]
    rates = rates_at(run, run.x, run.mode) if open_to else None
    return [i for i in open_to if rates is not None and rates.still(i)]


def settle(
    run: Run, due: Sequence[int], simultaneous: str = "raise", reached: Sequence[int] = ()
) -> Settled:
    """Apply the resets that are due and all that follow from them; moves state and mode of the run.

    reached: surfaces that the state is on, whatever locating it has left of h.
    """
    mode = off_contact(run, run.mode)
    run.x[:] = on_active_side(run, run.x, mode)
    rates = rates_at(run, run.x, run.mode)
    resting = [i for i in range(run.machine.m) if run.machine.contacts[i] and run.mode[i] == 0.0]
    for i in (*reached, *resting):
        rates.h_noise[i] = max(rates.h_noise[i], 2.0 * abs(rates.h[i]))
    first = _State(run.x.copy(), mode, rates, np.abs(run.x), tuple(due))
    waiting = [first]
    seen: list[_State] = []
    ends: list[_State] = []
    while waiting:
        state = waiting.pop()
        if not state.due:
            if ends and not _same(run, state, ends[0]):
                return _ambiguous(run, due, ends[0].done)
            ends.append(state)
            continue
        names = _names(run, state.due)
        if state.at_rest > MOST_AT_REST:
            return _stop(run, state, Status.ZENO, _no_rest(run, state.due))
        fading = state.depth >= LONGEST_CHAIN and _fading(run, first, state)
        if state.depth >= (LATEST if fading else LONGEST_CHAIN):
            return _stop(run, state, Status.NO_CONTINUATION, f"the resets of {names} follow each other.")
        following = _following(run, state, simultaneous)
        if following == ACCUMULATES:
            return _stop(run, state, Status.ZENO, _too_short(names))
        if isinstance(following, str):
            detail = f"the resets of {names} happen at once. {following}"
            return Settled(status=Status.NON_UNIQUE, detail=detail)
        if following is None:
            return _ambiguous(run, state.due, ())
        for other in following:
            if not np.all(np.isfinite(other.x)):
                return _stop(run, other, Status.NOT_FINITE, f"the reset of {names} gives it.")
            if len(following) == 1 and not waiting and not ends:
                waiting.append(other)
            elif not any(_same(run, other, known) and other.due == known.due for known in seen):
                waiting.append(other)
                seen.append(other)
        if len(seen) > MOST_STATES:
            return _ambiguous(run, due, ())
    return _put(run, ends[0])


def on_active_side(run: Run, x: Array, mode: Array) -> Array:
    """The state moved onto the surfaces with resets that it lies behind, seen from their active sides.

    Which of several surfaces is reached first is located to rounding of the dense output. What a state lies
    behind a surface when another one is reached first has no part in its solution; carried on, it would
    become a root of h on the way back, and hide every other one before it.
    """
    machine = run.machine
    sides = np.array([m if m in r else 0.0 for m, r in zip(mode, machine.resets_from, strict=True)])
    moved, held = x, np.zeros(machine.m, dtype=bool)
    for _ in range(PUSHES):
        depth = np.where(sides == 0.0, 0.0, sides * machine.guards(run.t, moved, mode))
        if not np.any(depth < 0.0):
            break
        held |= depth < 0.0
        g, _ = machine.gradients(run.t, moved, mode)
        step, *_ = np.linalg.lstsq((sides[:, None] * g)[held], -np.minimum(depth, 0.0)[held], rcond=None)
        moved = np.ascontiguousarray(moved + step)
    return moved


def _put(run: Run, end: _State) -> Settled:
    """The run takes up the state in which the resets ended; contacts that it rests on have the mode 0."""
    x, mode, rates = end.x, end.mode.copy(), end.rates
    tiny = unresolved(run, x, mode, rates)
    if tiny and run.options.zeno == "stop":
        return _stop(run, end, Status.ZENO, _too_short(_names(run, tiny)))
    if tiny and (detail := endless(run, x, mode, tiny)):
        return _stop(run, end, Status.ZENO, f"{_too_short(_names(run, tiny))} {detail}")
    if tiny:
        closed = [i for i in range(run.machine.m) if run.machine.contacts[i] == mode[i] != 0 and rates.on(i)]
        x = hold(run, x, mode, [i for i in closed if i in tiny or rates.still(i)])
        rates = rates_at(run, x, mode, rates)
    reached = [i for i in range(run.machine.m) if run.machine.widths[i] == 0.0 and rates.on(i)]
    for i in reached:
        if run.machine.contacts[i] == mode[i] and (i in tiny or rates.still(i)):
            mode[i] = 0.0
        elif mode[i] == 0.0 and not run.machine.contacts[i]:
            # Sliding is decided anew: that it lasted until now is no proof that it can go on.
            mode[i] = 1.0 if rates.h[i] >= 0.0 else -1.0
    run.x[:], run.mode[:] = x, mode
    # The rate of a contact depends on no sign: where it is clear of rounding the contact is left.
    left = tuple(i for i in reached if run.machine.contacts[i] == mode[i] != 0 and not rates.still(i))
    return Settled(end.done, tuple(i for i in reached if i not in left), left)


def _stop(run: Run, state: _State, status: Status, detail: str) -> Settled:
    run.x[:] = state.x
    return Settled(status=status, detail=detail)


def _too_short(names: str) -> str:
    return f"the impacts on {names} have become too short to be told apart: they accumulate here."


def _names(run: Run, numbers: Sequence[int]) -> str:
    return ", ".join(repr(source_name(run, i)) for i in numbers)


def _ambiguous(run: Run, due: Sequence[int], done: Sequence[int]) -> Settled:
    names = _names(run, sorted({*due, *done}))
    how = "simultaneous='sequential' or 'generalised Newton'"
    if any(i >= run.machine.m for i in due):
        how = "a time event a little earlier or later"
    return Settled(
        status=Status.NON_UNIQUE,
        detail=f"the resets of {names} happen at once, and the state after them depends on their order; "
        f"{how} decides it.",
    )


def endless(run: Run, x: Array, mode: Array, contacts: Sequence[int]) -> str:
    """Which states the resets of these contacts go on changing at rest: they have no limit. "" for none."""
    changed: set[str] = set()
    held = hold(run, x, mode, contacts) if contacts else x
    for i in contacts:
        after = run.machine.reset(i, run.t, held, mode)
        moved = np.abs(after - held) > KEPT * (np.abs(held) + np.abs(after)) + run.atol
        changed |= {name for name, c in zip(run.machine.system.states, moved, strict=True) if c}
    if not changed:
        return ""
    names = ", ".join(repr(name) for name in sorted(changed))
    return f"Every impact changes {names}, which has no limit there; a plastic impact changes it once."


def _no_rest(run: Run, due: Sequence[int]) -> str:
    return (
        f"the state rests on {_names(run, due)}, where resets follow each other without end. There is no "
        f"resting contact to go on with: {'; '.join(filter(None, (_reason(run, i) for i in due)))}."
    )


def _reason(run: Run, i: int) -> str:
    """Why a surface has no resting contact."""
    form, surface = run.machine.system.symbolic, run.machine.surfaces[i]
    if form is None:
        return "functions have one with contact=True only"
    from filippov.model.contact import found_contact

    found = found_contact(form, surface, i)
    return found if isinstance(found, str) else "it is switched off by contact=False"


def _same(run: Run, a: _State, b: _State) -> bool:
    scale = np.fmax(a.size, b.size) + run.atol
    return bool(np.all(np.abs(a.x - b.x) <= SAME * scale) and np.all(a.mode == b.mode))


def _following(run: Run, state: _State, simultaneous: str) -> list[_State] | str | None:
    """The states after what is due: one where its order does not matter; None where it is not followed.

    A sentence where the generalised Newton law does not fit.
    """
    clocks = [i for i in state.due if i >= run.machine.m]
    if simultaneous == "generalised Newton" and not clocks:
        law = generalised_newton(run, state.x, state.mode, state.rates, state.due)
        if law is not None:
            return law if isinstance(law, str) else [_next(run, state, law, state.due)]
    together = composed(run, state.x, state.size, state.mode, state.due)
    if together is not None:
        return [_next(run, state, together, state.due)]
    if close := too_close(run, state.x, state.mode, state.rates, state.due):
        if run.options.zeno == "stop":
            return ACCUMULATES
        return [_next(run, state, hold(run, state.x, state.mode, close), state.due)]
    if simultaneous != "sequential" or clocks:
        return None
    first = _fastest(run, state)
    together = composed(run, state.x, state.size, state.mode, first)
    if together is not None:
        return [_next(run, state, together, first)]
    return [_next(run, state, run.machine.reset(i, run.t, state.x, state.mode), [i]) for i in first]


def _speeds(run: Run, state: _State) -> dict[int, float]:
    """|dh/dt| over |grad h| of the surfaces that are due."""
    g, _ = run.machine.gradients(run.t, state.x, state.mode)
    speeds = np.abs(state.rates.rate) / (np.sqrt(np.sum(g**2, axis=1)) + 1e-300)
    return {i: float(speeds[i]) for i in state.due if i < run.machine.m}


def _fading(run: Run, first: _State, now: _State) -> bool:
    """Whether a chain runs onto its surfaces by far more slowly than where it began."""
    before, after = (max(_speeds(run, state).values(), default=0.0) for state in (first, now))
    return after <= FADED * before


def _fastest(run: Run, state: _State) -> list[int]:
    """The surfaces due that are run onto fastest; several where they are equally fast."""
    speeds = _speeds(run, state)
    most = max(speeds.values())
    return [i for i in state.due if speeds[i] >= most * (1.0 - SAME)]


def _next(run: Run, state: _State, x: Array, applied: Sequence[int]) -> _State:
    """The state after some resets: signs of all surfaces, and which resets are due then."""
    machine = run.machine
    if not np.all(np.isfinite(x)):
        return replace(state, x=x, due=())
    mode, over = state.mode.copy(), set[int]()
    for _ in range(2):  # sizes |h| inside other guards follow the signs found first
        rates, given = rates_at(run, x, mode, state.rates), mode.copy()
        for i in range(machine.m):
            if machine.widths[i] > 0.0:
                if mode[i] * rates.h[i] < -machine.widths[i]:
                    mode[i] = -mode[i]
            elif not rates.on(i):
                side = 1.0 if rates.h[i] > 0 else -1.0
                if state.mode[i] == -side and state.mode[i] in machine.resets_from[i] and i not in applied:
                    over.add(i)
                mode[i] = side
            elif i in applied and rates.into(i, mode[i]) and not _turns(run, state, i, applied):
                mode[i] = -state.mode[i]
        if np.array_equal(mode, given):
            break
    due = sorted(over | {i for i in state.due if i >= machine.m and i not in applied})
    for i in range(machine.m):
        active = i not in due and mode[i] in machine.resets_from[i] and rates.on(i)
        if not active or not runs_onto(run, x, mode, rates, i):
            continue
        if i in applied and rates.still(i) and not _holds_back(run, x, mode, i):
            mode[i] = -mode[i]
        else:
            due.append(i)
    still = bool(due) and all(i < machine.m and i not in over and rates.still(i) for i in due)
    return _State(
        x, mode, rates, np.fmax(state.size, np.abs(x)), tuple(due),
        tuple(dict.fromkeys((*state.done, *applied))), state.depth + 1, state.at_rest + 1 if still else 0,
    )  # fmt: skip


def _turns(run: Run, state: _State, i: int, applied: Sequence[int]) -> bool:
    """Whether the reset of a surface alone turns the solution off it; what does not is led through it."""
    if len(applied) == 1:
        return False
    x = run.machine.reset(i, run.t, state.x, state.mode)
    return not rates_at(run, x, state.mode, state.rates).into(i, state.mode[i])


def runs_onto(run: Run, x: Array, mode: Array, rates: Rates, i: int) -> bool:
    """Whether the solution on its side of surface i runs onto it, by the first derivative that is not 0."""
    if not rates.still(i):
        return rates.into(i, mode[i])
    if run.machine.contacts[i]:
        return False  # it rests, or leaves: that is decided with all other contacts
    point = _point(run, x, mode)
    g, gt = point.gradients(mode)
    size = float(np.sum(np.abs(g[i] * x)) + abs(gt[i] * run.t))
    term = leading_term(point, mode, np.array(run.lam), partial(guard_rows_of, i), Terms(size, 0.0))
    return term is not None and term[1] < 0


def _point(run: Run, x: Array, mode: Array) -> Point:
    kept = run.x.copy(), run.mode.copy()
    run.x[:], run.mode[:] = x, mode
    point = replace(point_of(run), resting=frozenset(), reached=frozenset())
    run.x[:], run.mode[:] = kept
    return point


def _holds_back(run: Run, x: Array, mode: Array, i: int) -> bool:
    """Whether the reset turns a solution round that runs onto surface i from rest; else it is led through.

    The state a little later, when it runs onto the surface, and its reset tell.
    """
    step = 1e-3 * _point(run, x, mode).step / LATER
    y = x.copy()
    for _ in range(LATER):
        y = y + step * velocity(run, y, mode)
    before = rates_at(run, y, mode).rate[i] * mode[i]
    after = rates_at(run, run.machine.reset(i, run.t, y, mode), mode).rate[i] * mode[i]
    return bool(before < 0.0 and after > 0.5 * before)
