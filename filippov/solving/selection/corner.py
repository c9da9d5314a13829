"""Signs for the surfaces of one corner: those that act on each other's rates at a point.

Where surfaces do not act on each other, each corner is decided by itself: 3 choices for every surface of a
corner, not 3 to the power of all surfaces reached. Up to ENUMERATED surfaces every choice is tried; beyond
that the rates, affine in the signs, make a complementarity problem: s in its box, h' = r + C s, zero inside
the box, outwards at an end (Leine & Nijmeijer 2004, chapter 5; Cottle, Pang & Stone 1992).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.kernel.loop.coupled_corner import ENUMERATED, WIDER
from filippov.solving.selection.candidate import (
    OPEN,
    clear_rates,
    inside,
    moving_outwards,
    nearness,
    sliding_solutions,
)
from filippov.solving.selection.complementarity import complementarity
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point

MOST_NONAFFINE = 8
# Singular values, in units of the rows, that are rounding; how many trial steps ahead ends are looked for.
REDUNDANT, AHEAD = 1e-10, (1e-3, 1.0, 1e3)


def corners(
    point: Point, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None, radii: Array
) -> list[list[int]]:
    """The surfaces reached, corner by corner, without those on which the solution goes on sliding as it does.

    Such a corner consists of sliding surfaces alone, none of them triggered and every multiplier clear of the
    ends of its set: what happens elsewhere does not act on its rates. With triggered = None none is left out.
    """
    groups: dict[int, list[int]] = {}
    for i in reached:
        groups.setdefault(point.machine.component[i], []).append(i)
    sliding = [i for i in range(point.machine.m) if base[i] == 0]
    lam: Array | None = None
    if sliding and triggered is not None:
        code, _, found, _ = point.probe(0.0, np.array(base, dtype=float), point.guess)
        lam = found if code == 0 and np.all(np.isfinite(found)) else None
    return [
        group
        for group in groups.values()
        if lam is None
        or triggered is None
        or any(base[i] != 0 or i in triggered for i in group)
        or inside(base, lam, radii, group) is not True
    ]


def choices(point: Point, base: Mode, group: Sequence[int], radii: Array) -> Iterable[tuple[int, ...]]:
    """Signs of a corner's surfaces that the rates do not refuse."""
    each = [_signs(point, base, i) for i in group]
    if len(group) == 1 and point.machine.roles[group[0]] != "switching":
        # Its rate may depend on the signs of all the others, and decides together with them.
        return [(sign,) for sign in each[0]]
    if len(group) <= ENUMERATED or (not point.machine.affine and len(group) <= MOST_NONAFFINE):
        return [signs for signs in itertools.product(*each) if _plausible(point, base, group, signs, radii)]
    if not point.machine.affine:
        names = ", ".join(repr(point.machine.surfaces[i].name) for i in group)
        raise ModelError(
            f"{len(group)} surfaces that act on each other meet ({names}) and the field holds products of "
            f"their signs. Corners of more than {MOST_NONAFFINE} need a field that is a sum of terms in one "
            "sign each."
        )
    return _complementary(point, base, group, radii)


def _signs(point: Point, base: Mode, i: int) -> tuple[int, ...]:
    if i in point.resting:
        return (point.machine.contacts[i], 0)
    if point.machine.resets_from[i] == (base[i],):
        return (base[i],)  # from its active side a surface is passed by its reset only
    return (1, -1, 0) if can_slide(point, i) else (1, -1)


def can_slide(point: Point, i: int) -> bool:
    """Whether a sliding mode exists on surface i."""
    return point.machine.roles[i] == "switching" and point.machine.widths[i] == 0.0


def _plausible(
    point: Point, base: Mode, group: Sequence[int], signs: tuple[int, ...], radii: Array
) -> bool:
    mode = with_signs(base, group, signs)
    sliding = [i for i in range(len(base)) if mode[i] == 0]
    own = [i for i in group if mode[i] == 0]
    free = [i for i in group if mode[i] != 0]
    tangent = [i for i in group if base[i] == 0 or i in point.resting or i in point.along]
    for lam, velocity in sliding_solutions(point, mode, sliding):
        held = inside(base, lam, radii, own) is not False
        if held and clear_rates(point, mode, velocity, free, tangent) is not None:
            return True
    return False


def with_signs(base: Mode, group: Sequence[int], signs: Sequence[int]) -> Array:
    """A mode with other signs on some surfaces."""
    mode = np.array(base, dtype=float)
    mode[list(group)] = signs
    return mode


def coupling(point: Point, mode: Array, group: Sequence[int]) -> tuple[Array, Array, Array]:
    """r and C of d/dt h = r + C s on a group, and the derivatives of the field by its signs, one per row.

    Signs outside the group do not act on these rates; a sliding one stands at +1.
    """
    chosen = list(group)
    sizes = mode.copy()
    sizes[chosen] = 0.0
    signs = np.where(mode == 0.0, 1.0, mode)
    signs[chosen] = -1.0
    g, gt = point.gradients(sizes)
    base = point.rhs(signs, sizes)
    effects = []
    for i in chosen:
        signs[i] = 1.0
        effects.append(0.5 * (point.rhs(signs, sizes) - base))
        signs[i] = -1.0
    rate = point.machine.rate
    C = np.array([[rate(i, g, effect) for effect in effects] for i in chosen])
    r = np.array([gt[i] + rate(i, g, base) for i in chosen]) + C.sum(axis=1)
    return r, C, np.array(effects)


def _complementary(
    point: Point, base: Mode, group: Sequence[int], radii: Array
) -> list[tuple[int, ...]]:
    """Signs from the complementarity problem of a large corner, for every sign of those that cannot slide.

    A contact at rest takes part with its force; it is left where that is 0.
    """
    fixed = [i for i in group if not can_slide(point, i) and i not in point.resting]
    if len(fixed) > ENUMERATED:
        names = ", ".join(repr(point.machine.surfaces[i].name) for i in fixed)
        raise ModelError(
            f"{len(fixed)} kinks, observers or relays with hysteresis meet at one corner ({names}), expected "
            f"at most {ENUMERATED}."
        )
    moving = [i for i in group if i not in fixed]
    found: list[tuple[int, ...]] = []
    for signs in itertools.product((1, -1), repeat=len(fixed)):
        mode = with_signs(base, fixed, signs)
        for z in (*_solutions(point, mode, moving, radii), *_settled(point, mode, moving, radii)):
            mode[moving] = z
            _release(point, base, mode, moving, radii)
            picked = tuple(int(mode[i]) for i in group)
            if picked not in found:
                found.append(picked)
    return found


def _settled(point: Point, mode: Array, moving: Sequence[int], radii: Array) -> list[Array]:
    """Where contacts share a load in many ways: signs that carry it a moment later, some at their ends.

    A contact that is at the end of its set and yet does not slip has that end as its sign, as h stays 0. One
    that begins to slip at this very instant, where the last share of the load is used up, has its side.
    """
    r, C, effects = coupling(point, mode, moving)
    size = np.max(np.abs(C), axis=1, keepdims=True)
    values = np.linalg.svd(C / np.where(size > 0.0, size, 1.0), compute_uv=False)
    if values[-1] > REDUNDANT * values[0]:
        return []
    found: list[Array] = []
    rests = np.array([point.machine.contacts[i] != 0 for i in moving])
    shares = _held(point, r, C, moving, radii, np.zeros(len(moving)))
    for (_, z, signs), steps in itertools.product(shares, AHEAD):
        velocity = _field_at(point, mode, moving, z, effects)
        ahead = point.direction * min(steps * abs(point.step), max(point.longest, AHEAD[0] * abs(point.step)))
        later = replace(
            point, t=point.t + ahead, x=point.x + ahead * velocity, summed={}, reaches={}, probed={}
        )
        r2, C2, _ = coupling(later, mode, moving)
        for _, z2, signs2 in _held(later, r2, C2, moving, radii, np.zeros(len(moving))):
            if np.array_equal(signs2[signs != 0.0], signs[signs != 0.0]):
                low, high = radii[list(moving)].T
                ends = np.where((z2 >= high) & (high <= WIDER), 1.0, 0.0)
                ends -= np.where((z2 <= low) & (low >= -WIDER), 1.0, 0.0)
                # A wall at which others hold the solution may carry some of the load, or none.
                held = [np.where(rests, 0.0, ends), ends] if np.any(rests) else [ends]
                found.extend(np.where(signs2 != 0.0, signs2, z) for z in held)
    return found


def _field_at(point: Point, mode: Array, moving: Sequence[int], z: Array, effects: Array) -> Array:
    """The field with these multipliers on the surfaces of a group."""
    sizes = mode.copy()
    sizes[list(moving)] = 0.0
    signs = np.where(mode == 0.0, 1.0, mode)
    signs[list(moving)] = -1.0
    return np.asarray(point.rhs(signs, sizes) + (z + 1.0) @ effects)


def _held(
    point: Point, r: Array, C: Array, moving: Sequence[int], radii: Array, released: Array
) -> list[tuple[npt.NDArray[np.int64], Array, Array]]:
    """Solutions on the surfaces not released, each as (their places, z, signs of all)."""
    low, high = radii[list(moving)].T
    held = np.flatnonzero(released == 0.0)
    right, inner = (r + C @ released)[held], C[np.ix_(held, held)]
    # Each rate in its own unit: h may be scaled by anything.
    unit = np.max(np.abs(inner), axis=1, initial=0.0) + np.abs(right) + 1e-300
    right, inner = right / unit, inner / unit[:, None]
    turn, found = point.direction, []
    # A set that is open downwards is turned over: the problem asks for a lower bound.
    over = np.where(low[held] < -OPEN, -1.0, 1.0)
    bounds = np.sort([over * low[held], over * high[held]], axis=0)
    bounds = np.where(bounds > OPEN, np.inf, bounds)
    # h may leave its surface upwards at the upper end: w of the problem is minus the rate.
    problem = -turn * inner * np.outer(over, over), -turn * over * right
    for turned in complementarity(*problem, *bounds).solutions:
        z = over * turned
        w = turn * (right + inner @ z)
        clear = 1e-9 * (np.abs(right) + np.abs(inner) @ np.abs(z) + 1e-300)
        sides = np.where((z >= high[held]) & (w > clear), 1.0, 0.0)
        sides -= np.where((z <= low[held]) & (w < -clear), 1.0, 0.0)
        signs = released.copy()
        signs[held] = sides
        found.append((held, z, signs))
    return found


def _solutions(point: Point, mode: Array, moving: Sequence[int], radii: Array) -> list[Array]:
    """Signs of a corner's switching surfaces; sets wider than [-1, 1] are released one round at a time.

    At an end beyond +-1 with the rate outwards the surface is left, and its sign falls back to +-1.
    """
    r, C, _ = coupling(point, mode, moving)
    low, high = radii[list(moving)].T
    waiting: list[tuple[Array, int]] = [(np.zeros(len(moving)), 0)]
    found: list[Array] = []
    while waiting:
        released, rounds = waiting.pop()
        for held, _, signs in _held(point, r, C, moving, radii, released):
            sides = signs[held]
            wide = np.any((sides > 0) & (high[held] > WIDER) | (sides < 0) & (low[held] < -WIDER))
            if wide and rounds <= len(moving):
                waiting.append((signs, rounds + 1))
            else:
                found.append(signs)
    return found


def _release(point: Point, base: Mode, mode: Array, moving: Sequence[int], radii: Array) -> None:
    """Of surfaces that stand at an end of their sets, free those whose multiplier moves on outwards."""
    for _ in moving:
        sliding = [i for i in range(len(base)) if mode[i] == 0]
        solutions = sliding_solutions(point, mode, sliding)
        if not solutions:
            return
        lam = solutions[0][0]
        leaving = moving_outwards(point, base, mode, lam, radii, [i for i in moving if mode[i] == 0])
        if not leaving:
            return
        for i in leaving:
            low, high = radii[i]
            near = nearness(base, i, low, high)
            mode[i] = 1.0 if lam[i] > high - near else -1.0
