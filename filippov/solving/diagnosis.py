"""What to suspect where a run cannot go on: a surface nearby, a component that is not finite, a jump."""

from __future__ import annotations

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import Status, mode_text
from filippov.solving.selection.modes import Successor
from filippov.solving.state.run import Run

# Closer than this to an end of its set a multiplier is worth a note.
CLOSE = 1e-6
# So many attempts that together take less than this part of what is left: the end is out of reach.
STAGNATION_STEPS, STAGNATION, STANDSTILL = 4_000, 1e-5, 1e-9
# So many such looks in a row that cover less than this: there is no getting going any more.
LOOKS, NO_PROGRESS = 3, 1e-6
# |h|, in the terms of h, of a surface on which the state lies.
ON_SURFACE = 1e-12
TURNS = (
    "a jump without a surface, or a field that turns round a point, such as friction along v/|v| at rest. "
    "Write the jump with sign(...) or declare a Surface; give friction in the plane a small speed below "
    "which it is linear, v/sqrt(|v|**2 + w**2)."
)


def close_call(run: Run, taken: Successor) -> str:
    """What an event says of sliding that begins next to an end of its multiplier's set; "" elsewhere."""
    radii = run.machine.radii(run.t, run.x)
    for i, value in enumerate(taken.mode):
        low, high = radii[i]
        room = min(taken.multipliers[i] - low, high - taken.multipliers[i])
        # At the end itself, to rounding, sliding begins tangentially.
        if value == 0 and 1e-14 < room / (high - low) < CLOSE:
            return f"decided by a margin of {room / (high - low):.2g}"
    return ""


def stagnation(run: Run, part: float) -> str:
    """What holds a run up that has covered only this part of what is left; "" where it may yet get going."""
    mode = run.mode.copy()
    signs = np.where(mode == 0.0, 1.0, mode)
    jump = _jump(run, machine_field(run, signs), signs, mode)
    if not jump and part >= STANDSTILL:
        return ""
    return suspect(run) if jump or _nearest(run, abs(run.t)) else ""


def singular(run: Run) -> str:
    """The component of the field that changes by its own size over next to nothing, and by no more beyond.

    A stiff field changes ten times as much over ten times the way; one that jumps, or turns round a point
    like v/|v|, does not. "" where no component does.
    """
    mode = run.mode.copy()
    signs = np.where(mode == 0.0, 1.0, mode)
    size = np.max(np.abs(run.x), initial=0.0)
    with np.errstate(all="ignore"):
        here = machine_field(run, signs)
        for j, name in enumerate(run.machine.system.states):
            reach = 1e-7 * max(abs(run.x[j]), 1e-3 * size, 1e10 * float(run.atol[j]), 1e-9)
            for side in (1.0, -1.0):
                near, far = (_moved(run, j, side * way, signs, mode) for way in (reach, 10.0 * reach))
                change = np.abs(near - here)
                i = int(np.argmax(change))
                large = change[i] > 0.1 * (np.max(np.abs(here)) + np.max(np.abs(near)))
                if large and abs(far[i] - here[i]) < 3.0 * change[i]:
                    state = run.machine.system.states[i]
                    return (
                        f"d{state}/dt changes from {here[i]:.4g} to {near[i]:.4g} where {name} changes by "
                        f"{reach:.1g}, and by no more beyond: {TURNS}"
                    )
    return ""


def _moved(run: Run, j: int, way: float, signs: Array, mode: Array) -> Array:
    x = run.x.copy()
    x[j] += way
    return run.machine.rhs(run.t, x, signs, mode)


def machine_field(run: Run, signs: Array) -> Array:
    """The vertex field at the present point."""
    return run.machine.rhs(run.t, run.x, signs, run.mode)


def suspect(run: Run, known: str = "") -> str:
    """What is odd about field and guards at the present point and right beside it, after what is known."""
    machine, system = run.machine, run.machine.system
    mode = run.mode.copy()
    signs = np.where(mode == 0.0, run.lam, mode)
    with np.errstate(all="ignore"):
        here = machine.rhs(run.t, run.x, np.where(mode == 0.0, 1.0, signs), mode)
        text = _not_finite(here, system.states, run.signs)
        if text:
            return f"{known} {text}".lstrip()
        # As far ahead as differences of a plain h reach.
        for place in (run.x, run.x + run.direction * 5e-3 * (np.abs(run.x) + 1e-9) * np.sign(here)):
            values = machine.guards(run.t, np.ascontiguousarray(place), mode)
            for i, value in enumerate(values):
                if not np.isfinite(value):
                    return f"Surface {machine.surfaces[i].name!r} has h = {value} next to this point."
        # A surface in t is near where what is left to it is next to nothing for the run.
        nearest = _nearest(run, max(abs(run.clock.t_start), abs(run.clock.t_end)))
        jump = "" if known else _jump(run, here, signs, mode)
    return " ".join(filter(None, (known, nearest, jump)))


def no_mode(run: Run, where: str) -> tuple[Status, str]:
    """Why no mode can follow: the field has no value here, or nothing that is known; and the sentence."""
    states = run.machine.system.states
    with np.errstate(all="ignore"):
        sizes, scale = run.scales()
        for i in [None, *np.flatnonzero(sizes <= ON_SURFACE * scale)]:
            signs = np.where(run.mode == 0.0, 1.0, run.mode)
            if i is not None:
                signs[i] *= -1.0
            field = run.machine.rhs(run.t, run.x, signs, run.mode)
            text = _not_finite(field, states, tuple(signs.astype(int)))
            if text:
                return Status.NOT_FINITE, f"{where}. {text}"
    return Status.NO_CONTINUATION, f"{where}. {suspect(run)}".rstrip()


def _not_finite(field: Array, states: tuple[str, ...], signs: tuple[int, ...]) -> str:
    bad = np.flatnonzero(~np.isfinite(field))
    if not len(bad):
        return ""
    i = int(bad[0])
    value = "NaN" if np.isnan(field[i]) else str(field[i])
    return f"The field of mode {mode_text(signs)} returned {value} for dy[{i}] (d{states[i]}/dt)."


def _nearest(run: Run, longest: float) -> str:
    """The surface nearest to the point, for times of this size."""
    sizes, scale = run.scales()
    with np.errstate(all="ignore"):
        _, slope = run.machine.gradients(run.t, run.x, run.mode)
        distance = sizes / (np.maximum(scale, np.abs(slope) * longest) + 1e-300)
    if not len(distance) or not np.any(np.isfinite(distance)):
        return ""
    i = int(np.nanargmin(distance))
    name = run.machine.surfaces[i].name
    if not np.isfinite(sizes[i]) or distance[i] > 1e-3:
        return ""
    return f"The surface nearest to it is {name!r} (|h| = {sizes[i]:.3g})."


def _jump(run: Run, here: Array, signs: Array, mode: Array) -> str:
    """The component of the field that changes most over a distance at which a smooth one does not change."""
    machine, largest, text = run.machine, 1e-3, ""
    signs = np.where(mode == 0.0, 1.0, signs)
    size = np.max(np.abs(run.x), initial=0.0)
    for j, name in enumerate(machine.system.states):
        for side in (1.0, -1.0):
            x = run.x.copy()
            x[j] += side * 1e-7 * max(abs(x[j]), 1e-3 * size, 1e10 * float(run.atol[j]), 1e-9)
            field = machine.rhs(run.t, x, signs, mode)
            change = np.abs(field - here) / (np.max(np.abs(here)) + np.max(np.abs(field)) + 1e-300)
            i = int(np.argmax(change))
            if np.isfinite(change[i]) and change[i] > largest and _stays(run, j, x[j], i, signs, mode):
                largest = float(change[i])
                text = (
                    f"d{machine.system.states[i]}/dt jumps from {here[i]:.4g} to {field[i]:.4g} where {name} "
                    "changes by next to nothing: is a surface not declared there?"
                )
    return text


def _stays(run: Run, j: int, end: float, i: int, signs: Array, mode: Array) -> bool:
    """Whether component i of the field changes as much over ever smaller parts of the way of x_j to `end`."""

    def value(at: float) -> float:
        x = run.x.copy()
        x[j] = at
        return float(run.machine.rhs(run.t, x, signs, mode)[i])

    a, b = float(run.x[j]), float(end)
    at_a, at_b = value(a), value(b)
    whole = abs(at_b - at_a)
    for _ in range(20):
        middle = 0.5 * (a + b)
        if middle in (a, b):
            break
        at_middle = value(middle)
        if abs(at_middle - at_a) > abs(at_b - at_middle):
            b, at_b = middle, at_middle
        else:
            a, at_a = middle, at_middle
    return abs(at_b - at_a) > 0.5 * whole
