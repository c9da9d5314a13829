"""Whether a system is odd, f(t + T/2, -x) = -f(t, x) with mirrored surfaces, or the same after a shift in
time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from filippov import System
from filippov import t as time
from filippov.analysis.sensitivity.variation import mode_field, signs_at
from filippov.base.arrays import Array
from filippov.solving.state.machine import Machine

_POINTS = 48
_REACH = (0.3, 1.0, 2.0, 4.0)
# A shift is looked at on so many points; what rounding may leave of a difference, in parts of the values.
_MANY, _ROUNDING = 256, 1e-12
# Ticks of clocks agree to this part of the period; of more than so many ticks in it each clock stands alone.
_AGREE, _TICKS = 1e-9, 2048
# States at which resets are compared; from where a surface is reached whose h has the opposite sign.
_RESETS = 6
_MIRRORED = {"+": "-", "-": "+", "both": "both"}


def is_odd(
    system: System, p: Array, size: Array, t0: float, period: float,
    jacobian: Callable[..., Any] | None = None,
) -> bool:  # fmt: skip
    """Whether the field and the resets are odd on points up to four times `size` away (n,), taken with a
    fixed seed: each reset needs one that does the same on the other side, such as a stop at -1 to one at 1.

    A field that is not defined at such a point is left out there.
    """
    random = np.random.default_rng(20020508)
    scale = np.repeat(_REACH, _POINTS // len(_REACH))[:, None] * np.maximum(size, 1e-12)
    x = random.uniform(-1.0, 1.0, (_POINTS, system.dimension)) * scale
    t = t0 + period * random.uniform(0.0, 1.0, _POINTS)
    here = _field(system, t, x, p, jacobian)
    there = _field(system, t + 0.5 * period, -x, p, jacobian)
    known = np.all(np.isfinite(here), axis=1) & np.all(np.isfinite(there), axis=1)
    gap = np.abs(here + there)[known]
    scales = np.max(np.abs(here[known]), axis=0, initial=0.0)
    if not np.any(known) or not np.all(gap <= 1e-8 * (scales + 1e-300)):
        return False
    return _odd_resets(system, p, t, x, 0.5 * period, jacobian)


def _odd_resets(
    system: System, p: Array, t: Array, x: Array, shift: float, jacobian: Callable[..., Any] | None
) -> bool:
    """Whether each reset, of a surface or of a clock, has an opposite at -x after the shift."""
    m = len(system.surfaces)
    surfaces = [i for i, surface in enumerate(system.surfaces) if surface.reset is not None]
    clocks = [m + k for k, event in enumerate(system.time_events) if event.reset is not None]
    if not surfaces and not clocks:
        return True
    machine = Machine(system, "DOP853", p)
    (h, signs), (opposite, turned) = (signs_at(system, *at, p, jacobian) for at in ((t, x), (t + shift, -x)))

    def mirrored(i: int, j: int) -> bool:
        if i < m:
            same = _alike(h[:, [i]], opposite[:, [j]])
            if not same and not _alike(h[:, [i]], -opposite[:, [j]]):
                return False
            side = system.surfaces[i].side
            if system.surfaces[j].side != (side if same else _MIRRORED[side]):
                return False
        some = slice(None, None, len(t) // _RESETS)
        here = _reset_to(machine, i, t[some], x[some], signs[some])
        return _alike(here, -_reset_to(machine, j, t[some] + shift, -x[some], turned[some]))

    return all(any(mirrored(i, j) for j in group) for group in (surfaces, clocks) for i in group)


def _field(
    system: System, t: Array, x: Array, p: Array, jacobian: Callable[..., Any] | None
) -> Array:
    """The field at points off the surfaces, with the signs they have there: (k, n)."""
    _, signs = signs_at(system, t, x, p, jacobian)
    out = np.full(x.shape, np.nan)
    for mode in {tuple(int(v) for v in row) for row in signs}:
        rows = np.all(signs == np.array(mode, dtype=float), axis=1)
        part = mode_field(system, mode, (), jacobian)
        out[rows] = part.part("f", t[rows], x[rows], signs[rows], p)[:, :, 0]
    return out


def repeats(
    system: System, p: Array, size: Array, t0: float, period: float, shift: float, *, method: str = "DOP853",
    jacobian: Callable[..., Any] | None = None, mirrored: bool = True,
) -> bool:  # fmt: skip
    """Whether a system of the given period is the same after a time `shift`, a part of it, to rounding.

    Looked at on points up to four times `size` away (n,), over the whole period, with a fixed seed; once as
    far in every state as in the largest. mirrored: a switching function may turn to its opposite
    """
    random = np.random.default_rng(20020508)
    t = t0 % period + period * (np.arange(_MANY) + random.uniform(0.0, 1.0, _MANY)) / _MANY
    machine = Machine(system, method, p)
    for floor in (1e-12, float(np.max(size)) or 1.0):
        reach = np.repeat(random.permutation(_REACH), _MANY // len(_REACH))[random.permutation(_MANY), None]
        x = random.uniform(-1.0, 1.0, (_MANY, system.dimension)) * reach * np.maximum(size, floor)
        if not _same_field(system, t, x, p, shift, jacobian, mirrored):
            return False
        x = x[:_RESETS]
        if not _same_resets(system, machine, t, x, p, shift, jacobian):
            return False
        if not _same_ticks(system, machine, x, p, t0, period, shift, jacobian):
            return False
    return True


def _alike(here: Array, there: Array) -> bool:
    """Whether values (k, ...) agree to rounding where both are defined."""
    here, there = here.reshape(len(here), -1), there.reshape(len(there), -1)
    known = np.all(np.isfinite(here), axis=1) & np.all(np.isfinite(there), axis=1)
    scale = np.max(np.abs(here[known]), axis=0, initial=0.0)
    return bool(np.any(known) and np.all(np.abs(here - there)[known] <= _ROUNDING * scale))


def _same_field(
    system: System, t: Array, x: Array, p: Array, shift: float, jacobian: Callable[..., Any] | None,
    mirrored: bool,
) -> bool:  # fmt: skip
    """Whether the field, the surfaces and the sets of the multipliers are the same at both times."""
    if not _alike(_field(system, t, x, p, jacobian), _field(system, t + shift, x, p, jacobian)):
        return False
    if not system.surfaces:
        return True
    (h, signs), (later, turned) = (signs_at(system, q, x, p, jacobian) for q in (t, t + shift))
    radii = [_radii(system, q, x, s, p, jacobian) for q, s in ((t, signs), (t + shift, turned))]
    for i, surface in enumerate(system.surfaces):
        before, after = radii[0][:, 2 * i : 2 * i + 2], radii[1][:, 2 * i : 2 * i + 2]
        if _alike(h[:, [i]], later[:, [i]]):
            if not _alike(before, after):
                return False
        elif not (
            mirrored and surface.kind in ("switching", "kink") and surface.width == 0
            and _alike(h[:, [i]], -later[:, [i]]) and _alike(before, -after[:, ::-1])
        ):  # fmt: skip
            return False
    return True


def _radii(
    system: System, t: Array, x: Array, signs: Array, p: Array, jacobian: Callable[..., Any] | None
) -> Array:
    """The ends of the sets of the multipliers at points off the surfaces: (k, 2 m)."""
    out = np.full((t.size, 2 * len(system.surfaces)), np.nan)
    for mode in {tuple(int(v) for v in row) for row in signs}:
        rows = np.all(signs == np.array(mode, dtype=float), axis=1)
        part = mode_field(system, mode, (), jacobian).part("radius", t[rows], x[rows], signs[rows], p)
        out[rows] = part.reshape(int(np.sum(rows)), -1)
    return out


def _timed(system: System, index: int) -> bool:
    """Whether the reset of a surface, or of a time event after them, depends on time; functions may."""
    form, m = system.symbolic, len(system.surfaces)
    if form is None:
        return index < m or system.time_events[index - m].reset is not None
    row = form.reset[index] if index < m else form.time_reset[index - m]
    return row is not None and any(time in e.free_symbols for e in row)


def _reset_to(machine: Machine, index: int, t: Array, x: Array, signs: Array) -> Array:
    """States after a reset from states (k, n) at times (k,)."""
    rows = zip(t.tolist(), x, signs, strict=True)
    return np.array([machine.reset(index, at, row.copy(), mode.copy()) for at, row, mode in rows])


def _same_resets(
    system: System, machine: Machine, t: Array, x: Array, p: Array, shift: float,
    jacobian: Callable[..., Any] | None,
) -> bool:  # fmt: skip
    """Whether the surfaces reset the state alike at both times."""
    for i, surface in enumerate(system.surfaces):
        if surface.reset is None or not _timed(system, i):
            continue
        for begin in range(0, t.size, t.size // 16):
            at = t[begin : begin + len(x)]
            signs = signs_at(system, at, x[: at.size], p, jacobian)[1]
            here, there = (_reset_to(machine, i, q, x[: at.size], signs) for q in (at, at + shift))
            if not _alike(here, there):
                return False
    return True


def _same_ticks(
    system: System, machine: Machine, x: Array, p: Array, t0: float, period: float, shift: float,
    jacobian: Callable[..., Any] | None,
) -> bool:  # fmt: skip
    """Whether the clocks tick alike after the shift; one may take the place of another."""
    record = None if system.symbolic is not None else system.parameters.record(p)
    named = dict(zip(system.parameters.names, p.tolist(), strict=True))
    near, ticks = _AGREE * period, list[tuple[float, int]]()
    for k, event in enumerate(system.time_events):
        if event.period is None:
            continue
        start, own = event.numbers(record, named)
        turns = round(period / own)
        if turns < 1 or abs(turns * own - period) > near:
            return False
        if turns > _TICKS:
            if abs(round(shift / own) * own - shift) > near or _timed(system, len(system.surfaces) + k):
                return False
            continue
        ticks += [((start - t0 + n * own + near) % period - near, k) for n in range(turns)]
    instants: list[tuple[float, list[int]]] = []
    for at, k in sorted(ticks):
        if instants and at - instants[-1][0] <= 2 * near:
            instants[-1][1].append(k)
        else:
            instants.append((at, [k]))
    step = round(len(instants) * shift / period)
    known: dict[tuple[int, int], bool] = {}
    for number, (at, group) in enumerate(instants):
        turns, place = divmod(number + step, len(instants))
        later, other = instants[place]
        if abs(later + turns * period - at - shift) > 4 * near or len(group) != len(other):
            return False
        for pair in zip(sorted(group), sorted(other), strict=True):
            if not known.get(pair, False):
                known[pair] = False
                if not _same_reset(system, machine, pair, t0 + at, x, p, shift, jacobian):
                    return False
                known[pair] = not any(_timed(system, len(system.surfaces) + k) for k in pair)
    return True


def _same_reset(
    system: System, machine: Machine, pair: tuple[int, int], t: float, x: Array, p: Array, shift: float,
    jacobian: Callable[..., Any] | None,
) -> bool:  # fmt: skip
    """Whether one clock at t does what the other does after the shift."""
    m = len(system.surfaces)
    if pair[0] == pair[1] and not _timed(system, m + pair[0]):
        return True
    given = [system.time_events[k].reset is not None for k in pair]
    if not all(given):
        return not any(given)
    times = np.full(len(x), t)
    signs = signs_at(system, times, x, p, jacobian)[1]
    return _alike(
        _reset_to(machine, m + pair[0], times, x, signs),
        _reset_to(machine, m + pair[1], times + shift, x, signs),
    )
