"""Which modes can follow at a point on any number of surfaces: the inclusion's own answer (U1, U2).

A candidate gives each surface reached a sign, or 0 for sliding. It is consistent if the solution of that mode
does what the mode says: leaves each surface to the side of its sign (first non-vanishing derivative of h),
and holds each sliding surface with a multiplier inside its set (at an end of the set: one that moves
inwards). All consistent candidates are returned; one means that the solution goes on uniquely. Candidates
are put together from the corners of the point, each decided by its own rates
(`filippov.solving.selection.corner`).

Sources: Filippov 1988, section 10; Dieci & Lopez 2012, section 3; di Bernardo et al. 2008, chapter 5.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import mode_text
from filippov.kernel.loop.coupled_corner import ENUMERATED, WIDER
from filippov.solving.selection.candidate import (
    ROUNDING,
    at_rest,
    inside,
    leaves,
    moving_outwards,
    repelling,
    sliding_solutions,
    unfixed,
)
from filippov.solving.selection.continuous import continuous_mode
from filippov.solving.selection.corner import can_slide, choices, corners, coupling, with_signs
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point

# Combinations of the corners' choices that are all examined; beyond, corner by corner.
COMBINED = 729
SWEEPS = 6
# CLEARED: fields of which one leaves where the multiplier of the other is clear of its end by more than 1e-7.
RANK, SAME, CLEARED = 1e-10, 1e-9, 1e-5


@dataclass(frozen=True)
class Successor:
    """A consistent next mode.

    order         how often each guard reached vanishes along the solution; for sliding 2 where the multiplier
                  starts at an end of its set, 3 at a two-fold, and negative (-1, -2, -3) where it repels;
                  -1 for a kink that is left where the field is not Lipschitz
    multipliers   value of the sign of every sliding surface (0 elsewhere)
    field         the field of the mode at the point
    margin        least rate, on its own scale, by which the mode is consistent; 0 for a tangential one
    undetermined  surfaces whose multiplier is one of many that give this solution
    faint         surfaces that are left by no more than rounding of their rate
    along         surfaces off which the solution does not slide, and on which others hold it; kinks on which
                  the field does
    """

    mode: Mode
    order: tuple[int, ...]
    multipliers: tuple[float, ...]
    field: tuple[float, ...]
    margin: float
    undetermined: tuple[int, ...] = ()
    faint: tuple[int, ...] = ()
    along: tuple[int, ...] = ()

    def __str__(self) -> str:
        sliding = [f"{v:.6g}" for v, m in zip(self.multipliers, self.mode, strict=True) if m == 0]
        leaves = any(m != 0 and k == -1 for m, k in zip(self.mode, self.order, strict=True))
        text = mode_text(self.mode) + (" (leaves)" if leaves else "")
        return text + (f" (multipliers {', '.join(sliding)})" if sliding else "")


def successors(
    point: Point, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None = None
) -> list[Successor]:
    """All consistent next modes at a point on the surfaces `reached`; the others keep their sign in `base`.

    triggered: those of the surfaces reached at which something happens, an end of a multiplier's set
    included; None to reconsider sliding on all of them.

    A mode whose solution leaves a surface and returns within rounding counts only if there is no other and
    nothing slides: this happens where events follow each other into a corner at which a rate vanishes.
    """
    many = len(reached) > ENUMERATED
    found = _where_continuous(point, base, reached) if many else []
    found = found or _consistent(point, base, reached, triggered)
    if not found and triggered and all(base):
        found = _consistent(replace(point, fine=True), base, reached, triggered)
    return found or ([] if many else _where_continuous(point, base, reached))


def _where_continuous(point: Point, base: Mode, reached: Sequence[int]) -> list[Successor]:
    """What follows where no rate decides, at a corner across which the field does not jump."""
    known = continuous_mode(point, base, reached)
    if known is None:
        return []
    mode, order = known
    field = point.rhs(mode, mode)
    signs = tuple(int(sign) for sign in mode)
    return [Successor(signs, tuple(order), (0.0,) * len(signs), tuple(float(v) for v in field), 0.0)]


def leading_off(
    point: Point, base: Mode, reached: Sequence[int], stays: Callable[[Array], bool]
) -> list[Successor]:
    """The modes that can follow and leave surfaces reached, or whose field is none with which one `stays`."""
    found = successors(point, base, reached)
    left = [any(c.mode[i] != 0 != c.order[i] for i in reached) for c in found]
    off = [c for c, leaves_it in zip(found, left, strict=True) if leaves_it or not stays(np.array(c.field))]
    return [c for c in off if _goes_on(point, c, reached)]


def _goes_on(point: Point, found: Successor, reached: Sequence[int]) -> bool:
    """Whether a mode goes on to lead off a moment later, where multipliers that no rate fixed are known."""
    mode = np.array(found.mode, dtype=float)
    slid = [i for i in reached if mode[i] == 0]
    x = point.x + point.step * np.array(found.field)
    for _ in range(4 if slid else 0):
        h = point.machine.guards(point.t + point.step, x, mode)[slid]
        g = point.machine.gradients(point.t + point.step, x, mode)[0][slid]
        if not np.all(np.isfinite(g)) or not np.any(h):
            break
        x = np.ascontiguousarray(x - np.linalg.lstsq(g, h, rcond=None)[0])
    later = replace(point, t=point.t + point.step, x=x, probed={})
    code, velocity, lam, _ = later.probe(0.0, mode, np.array(found.multipliers))
    radii = point.machine.radii(later.t, x)
    if code != 0 or inside(found.mode, lam, radii, slid) is False:
        return False
    g, gt = later.gradients(mode)
    free = [i for i in reached if mode[i] != 0 != found.order[i]]
    rates = [mode[i] * (point.machine.rate(i, g, velocity) + gt[i]) * point.direction for i in free]
    return all(rate > 0.0 for rate in rates)


def _consistent(
    point: Point, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None
) -> list[Successor]:
    """All consistent next modes, excursions counted as the point says."""
    resting = [i for i in reached if point.machine.contacts[i] and (base[i] == 0 or at_rest(point, base, i))]
    back = frozenset(i for i in triggered or () if base[i] != 0)
    point = replace(point, resting=frozenset(resting), reached=frozenset(reached), base=base, back=back)
    point = replace(point, along=_along(point, reached))
    if back:
        # What the loop does not see on the scale of its steps must not send it there again.
        point = replace(point, longest=0.0)
    radii = point.machine.radii(point.t, point.x)
    groups = corners(point, base, reached, triggered, radii)
    options = [list(choices(point, base, group, radii)) for group in groups]
    if not all(options):
        return []
    if math.prod(map(len, options)) > COMBINED:
        options = _swept(point, base, groups, options, radii)
    found: list[Successor] = []
    surfaces = [i for group in groups for i in group]
    for combination in itertools.islice(itertools.product(*options), COMBINED):
        signs = [sign for part in combination for sign in part]
        found += _examined(point, base, with_signs(base, surfaces, signs), surfaces, radii)
    if len(found) < 2:
        return found
    sizes = _projected(point, base, reached)
    left = frozenset(i for i in triggered or () if base[i] == 0)
    found = _without_doubles(found, left, sizes, radii)
    stuck = [i for i in reached if base[i] == 0 and can_slide(point, i) and not point.machine.contacts[i]]
    stuck = [] if triggered is None else [i for i in stuck if i not in triggered]
    return _one_per_solution(_without_released_sticking(found, radii, stuck), sizes)


def _along(point: Point, reached: Sequence[int]) -> frozenset[int]:
    """The surfaces reached on which the solution stayed without sliding, held there by those it slides on.

    Contacts that others hold as well, and kinks that coincide with a surface slid on; that rounding
    triggered one of these says nothing.
    """
    mode = np.array(point.base, dtype=float)
    idle = [i for i in reached if point.machine.roles[i] != "switching"]
    own = [i for i in reached if mode[i] != 0.0 and (i in idle or i not in point.back)]
    if not own or np.all(mode != 0.0):
        return frozenset()
    code, velocity, _, _ = point.probe(0.0, mode, point.guess)
    if code != 0:
        return frozenset()
    g, gt = point.gradients(mode)
    # Multipliers balance the fields: what is left of a velocity is rounding of all that they balance.
    known = {i: max(point.terms(i, mode), point.speed_terms(i, mode)) for i in own}
    rates = {i: point.machine.rate(i, g, velocity) + float(gt[i]) for i in own}
    return frozenset(i for i in own if abs(rates[i]) <= ROUNDING * known[i])


def _swept(
    point: Point, base: Mode, groups: list[list[int]], options: list[list[tuple[int, ...]]], radii: Array
) -> list[list[tuple[int, ...]]]:
    """What is left of each corner's choices beside the first choices of the others, until nothing changes."""
    kept = [list(option) for option in options]
    for _ in range(SWEEPS):
        before = [option[0] for option in kept]
        for q, group in enumerate(groups):
            if len(options[q]) == 1:
                continue
            mode = np.array(base, dtype=float)
            for other, option in zip(groups, kept, strict=True):
                mode[list(other)] = option[0]
            consistent = []
            for signs in options[q]:
                mode[list(group)] = signs
                if _examined(point, base, mode.copy(), group, radii):
                    consistent.append(signs)
            if consistent:
                kept[q] = consistent
        if [option[0] for option in kept] == before:
            break
    return kept


def _examined(
    point: Point, base: Mode, mode: Array, surfaces: Sequence[int], radii: Array
) -> list[Successor]:
    """The successors with this mode, as judged on some surfaces."""
    m = point.machine.m
    # Sliding is left tangentially: the rate off the surface is rounding there, whatever its size looks like.
    tangent = [i for i in surfaces if base[i] == 0 or i in point.resting or i in point.along]
    sliding = [i for i in range(m) if mode[i] == 0]
    own = [i for i in surfaces if mode[i] == 0]
    free = [i for i in surfaces if mode[i] != 0]
    able = [i for i in free if sliding and (can_slide(point, i) or i in point.resting)]
    found: list[Successor] = []
    component = point.machine.component
    count = np.bincount([component[i] for i in sliding], minlength=m)
    alone = [i for i in sliding if count[component[i]] == 1]
    loose = unfixed(point, mode, [i for i in own if i in alone])
    for lam, velocity in sliding_solutions(point, mode, sliding):
        held = inside(base, lam, radii, own)
        if held is False:
            continue
        left = leaves(point, mode, lam, velocity, free, tangent)
        if left is None:
            continue
        if (held is None or loose) and moving_outwards(point, base, mode, lam, radii, own, loose):
            continue
        orders, margin, faint = left
        # Nothing depends on the sign of a surface on which nothing jumps and along which the solution runs. A
        # wall at which others hold the solution is left so: it carries nothing.
        idle = [i for i in free if point.machine.roles[i] != "switching" and i not in point.resting]
        if any(orders[i] == 0 and mode[i] != base[i] for i in idle):
            continue
        order = [orders.get(i, 0) for i in range(m)]
        for i in own if held is None else ():
            order[i] = 0 if i in loose else 2
        for i in repelling(point, mode, alone):
            order[i] = -max(order[i], 1)
        found.append(
            Successor(
                tuple(int(v) for v in mode),
                tuple(order),
                tuple(float(v) if mode[i] == 0 else 0.0 for i, v in enumerate(lam)),
                tuple(float(v) for v in velocity),
                margin if held else 0.0,
                faint=tuple(faint),
                along=tuple(i for i in able if orders[i] == 0),
            )
        )
    return [kind for candidate in found for kind in _families(point, candidate, own, radii)]


def _families(point: Point, found: Successor, own: Sequence[int], radii: Array) -> list[Successor]:
    """The candidate itself, marked where other multipliers give the same solution; two where they do not."""
    groups: dict[int, list[int]] = {}
    for i in own:
        groups.setdefault(point.machine.component[i], []).append(i)
    marked: list[int] = []
    for group in groups.values():
        if len(group) == 1 or not point.machine.affine:
            continue
        mode = np.array(found.mode, dtype=float)
        _, C, effects = coupling(point, mode, group)
        size = np.max(np.abs(C), axis=1, keepdims=True)
        _, values, rows = np.linalg.svd(C / np.where(size > 0.0, size, 1.0))
        idle = rows[values <= RANK * max(float(values[0]), 1e-300)]
        marked += [i for q, i in enumerate(group) if np.any(np.abs(idle[:, q]) > 1e-6)]
        acting = idle @ effects
        scale = float(np.max(np.abs(effects)))
        for direction, change in zip(idle, acting, strict=True):
            if np.max(np.abs(change)) > 1e-8 * scale:
                return _ends(found, group, direction, effects, radii)
    return [replace(found, undetermined=tuple(sorted(marked)))]


def _ends(
    found: Successor, group: Sequence[int], direction: Array, effects: Array, radii: Array
) -> list[Successor]:
    """Two solutions of a family: multipliers moved both ways along a direction that no rate resists."""
    chosen = list(group)
    ends = []
    for sign in (1.0, -1.0):
        lam = np.array(found.multipliers)
        low, high = radii[chosen].T
        towards = np.where(sign * direction > 0, high - lam[chosen], low - lam[chosen])
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(np.abs(direction) > 1e-12, towards / (sign * direction), np.inf)
        change = sign * max(float(np.min(reach)), 0.0) * direction
        lam[chosen] += change
        velocity = np.array(found.field) + change @ effects
        ends.append(
            replace(
                found, multipliers=tuple(lam), field=tuple(velocity), undetermined=tuple(sorted(chosen))
            )
        )
    return ends


def _projected(point: Point, base: Mode, reached: Sequence[int]) -> Array:
    """Sizes of the terms of the field; of each state too what rounding of the rates of surfaces puts into it.

    A field that slides is put onto its surfaces, in all states that these depend on.
    """
    sizes = point.field_terms(base)
    g, gt = point.gradients(np.array(base, dtype=float))
    rows = np.where(np.isfinite(g), np.abs(g), 0.0)[list(reached)]
    rates = rows @ sizes + np.abs(gt[list(reached)])
    norms = np.sum(rows * rows, axis=1)
    parts = np.divide(rates, norms, out=np.zeros_like(rates), where=norms > 0.0)
    return np.asarray(sizes + ROUNDING / SAME * (parts @ rows))


def _same_field(a: Successor, b: Successor, sizes: Array) -> bool:
    """Whether two fields are one on the scale of their terms: where these balance, the sum is rounding."""
    return bool(np.all(np.abs(np.subtract(a.field, b.field)) <= SAME * sizes))


def _without_doubles(
    found: list[Successor], left: frozenset[int], sizes: Array, radii: Array
) -> list[Successor]:
    """Sliding precedes an equal solution along the surface: a multiplier at the end of its set.

    A slide at the end of its set can go on only where the solution beside it with the same field comes back:
    that both follow is rounding, as where the surface is a solution of that field. What has just been `left`
    stays left there. A slide whose multiplier is clear of an end of its set by little precedes leaving along
    a rate that counts as 0: it is that by which the multiplier is clear.
    """

    def near(b: Successor, i: int) -> bool:
        return bool(np.min(np.abs(radii[i] - b.multipliers[i])) <= CLEARED * np.max(np.abs(radii[i])))

    def beaten(a: Successor, b: Successor) -> bool:
        if a.mode == b.mode or not _same_field(a, b, CLEARED / SAME * sizes):
            return False
        orders = [0 if i in a.faint else k for i, k in enumerate(a.order)]
        where = [(i, orders[i], b.order[i]) for i in range(len(a.mode)) if a.mode[i] != b.mode[i]]
        if not _same_field(a, b, sizes):
            clear = [b.mode[i] == 0 and q == 0 and k > 1 and near(b, i) for i, k, q in where]
            gone = [i in left and b.mode[i] != 0 for i, _, _ in where]
            return any(clear) and all(c or d for c, d in zip(clear, gone, strict=True))
        if all(b.mode[i] == 0 and (k == 0 or (q == 2 and i not in left)) for i, k, q in where):
            return True
        return all(a.mode[i] == 0 and k == 2 and q > 0 and i in left for i, k, q in where)

    return [a for a in found if not any(beaten(a, b) for b in found)]


def _without_released_sticking(
    found: list[Successor], radii: Array, stuck: Sequence[int]
) -> list[Successor]:
    """U4: where the set at h = 0 is wider than [-1, 1], sticking precedes a slip that is as consistent.

    stuck: surfaces that the solution sticks to, and at which nothing happens: the candidates that release
    fewer of these precede, though one at which something happens could stick on beside others that slip.
    """

    def wide(i: int) -> bool:
        return bool(max(-radii[i, 0], radii[i, 1]) > WIDER)

    def precedes(b: Successor, a: Successor) -> bool:
        mine, other = ({i for i in stuck if wide(i) and c.mode[i] != 0} for c in (b, a))
        sticks = all(
            v == u or (v == 0 and wide(i)) for i, (u, v) in enumerate(zip(a.mode, b.mode, strict=True))
        )
        return b.mode != a.mode and (sticks or mine < other)

    return [a for a in found if not any(precedes(b, a) for b in found)]


def _one_per_solution(found: list[Successor], sizes: Array) -> list[Successor]:
    """One candidate per solution: of those that stay on the same surfaces with the same field the first.

    Such candidates share the load among contacts in different ways; the multipliers are not unique, the
    solution is.
    """
    kept: list[Successor] = []
    for a in sorted(found, key=lambda c: (-sum(v == 0 for v in c.mode), [-abs(v) for v in c.mode])):
        for q, b in enumerate(kept):
            differ = [i for i, (u, v) in enumerate(zip(a.mode, b.mode, strict=True)) if u != v]
            stays = all(c.mode[i] == 0 or c.order[i] == 0 for c in (a, b) for i in differ)
            if differ and stays and _same_field(a, b, sizes):
                kept[q] = replace(b, undetermined=tuple(sorted({*b.undetermined, *differ})))
                break
        else:
            kept.append(a)
    place = {(a.mode, a.multipliers): q for q, a in enumerate(found)}
    return sorted(kept, key=lambda c: place[c.mode, c.multipliers])
