"""Whether a mode is consistent at a point: it leaves what it leaves, and holds what it slides on (U1).

A rate decides where it is clear of zero on its own scale; elsewhere a trial step of the mode is followed, and
the first power of time that does not vanish in the guard or in the distance of the multiplier decides.

Sources: Filippov 1988, section 10; Dieci & Lopez 2012, section 3.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.loop.land import NO_RATE
from filippov.solving.state.events import Mode
from filippov.solving.state.leading import Terms, leading_term
from filippov.solving.state.point import Point

CLEAR = 1e-6
BALANCED = 1e-10
# Of what the signs make of a rate: what is left of one that vanishes where the end of sliding was located.
LOCATED = 1e-7
# The same where it is rounding, of the terms of the rate and of what the signs make of it.
ROUNDING, AT_END = 16 * float(np.finfo(float).eps), 3e-13
OPEN = 1e299
# A rate above this part of what the signs and the field make of it is no rounding, whatever the terms are.
PLAIN = 1e-3
# A trial step is this part of the time in which a field crosses the size of the state.
TRIAL = 1e-2


def multiplier_guesses(point: Point, sliding: Sequence[int]) -> list[Array]:
    """Starting points of Newton's method that find every root of the multi-affine equations in the box."""
    m = point.machine.m
    guesses = [np.array(point.guess)]
    if len(sliding) <= 1 or point.machine.affine:
        return guesses
    levels = (0.0, -0.9, 0.9) if len(sliding) <= 3 else (0.0, 0.9)
    for values in itertools.product(levels, repeat=len(sliding)):
        guess = np.zeros(m)
        guess[list(sliding)] = values
        guesses.append(guess)
    return guesses


def sliding_solutions(point: Point, mode: Array, sliding: Sequence[int]) -> list[tuple[Array, Array]]:
    """All (multipliers, field) of a mode with sliding surfaces."""
    found: list[tuple[Array, Array]] = []
    for guess in multiplier_guesses(point, sliding):
        code, velocity, lam, _ = point.probe(0.0, mode, guess)
        if code != 0 or not np.all(np.isfinite(lam)) or not np.all(np.isfinite(velocity)):
            continue
        if all(np.max(np.abs(lam - known)[list(sliding)]) > 1e-8 for known, _ in found):
            found.append((lam, velocity))
    return found


def nearness(base: Mode, i: int, low: float, high: float) -> float:
    """How close a multiplier at an end of its set stands to it: as an exit is located, or a rounding.

    Not less than a rate beyond that end that counts as 0 (LOCATED, AT_END), 2/(hi - lo) of it in the rate.
    """
    width = high - low if high - low < OPEN else 1.0  # a contact has one end
    return (1e-7 if base[i] == 0 else 2e-13) * (1.0 + width)


def inside(base: Mode, lam: Array, radii: Array, sliding: Sequence[int]) -> bool | None:
    """Whether every multiplier is in its set; None where one is at an end and its solution must decide."""
    undecided = False
    for i in sliding:
        low, high = radii[i]
        near = nearness(base, i, low, high)
        if not low - near <= lam[i] <= high + near:
            return False
        if lam[i] < low + near or lam[i] > high - near:
            undecided = True
    return None if undecided else True


def unfixed(point: Point, mode: Array, alone: Sequence[int]) -> list[int]:
    """Of sliding surfaces to which no other sliding one is coupled: those both rates of which are 0.

    No equation fixes their multipliers here; those of the next moment may lie outside their sets.
    """
    g, gt = point.gradients(mode)
    found = []
    for i in [i for i in alone if not point.machine.contacts[i]]:
        sides = [np.where(np.arange(len(mode)) == i, side, mode) for side in (1.0, -1.0)]
        fields = [point.rhs(np.where(side == 0, 1.0, side), mode) for side in sides]
        rates = [float(gt[i]) + point.machine.rate(i, g, velocity) for velocity in fields]
        if max(map(abs, rates)) <= ROUNDING * max(point.largest_terms(i, side) for side in sides):
            found.append(i)
    return found


def moving_outwards(
    point: Point, base: Mode, mode: Array, lam: Array, radii: Array, sliding: Sequence[int],
    free: Sequence[int] = (),
) -> list[int]:  # fmt: skip
    """The sliding surfaces whose multiplier stands at an end of its set and leaves it along a trial step.

    free: those whose multiplier no rate fixes: it may stand at either end
    """
    leaving = []
    point = _on_own_scale(point, mode, lam)
    code, _, _, rows = point.probe(point.step, mode, lam)

    def sign_along(i: int, side: int) -> float | None:
        """The sign of the distance to an end along the trial step, by its leading term."""
        def size(rows: Array) -> float:
            return float(np.max(np.abs(rows[:, side, i] if i in free else rows[:, :, i])))

        terms = Terms(0.0, 0.0, grain=point.grain)
        term = leading_term(point, mode, lam, partial(_row, side, i), terms, size)
        return None if code != 0 or term is None else term[1]

    for i in sliding:
        if i in free:
            up, down = sign_along(i, 0), sign_along(i, 1)
            if up is None or down is None or up * down < 0:
                leaving.append(i)
            continue
        low, high = radii[i]
        near = nearness(base, i, low, high)
        for side, at_end in ((0, lam[i] > high - near), (1, lam[i] < low + near)):
            # Rows are written for sliding that attracts; one that repels has both of them negative.
            if at_end and ((on := sign_along(i, side)) is None or on * _attraction(point, rows, i) < 0):
                leaving.append(i)
                break
    return leaving


def _on_own_scale(point: Point, mode: Array, lam: Array) -> Point:
    """The point with a trial step on the scale of a mode: where the field jumps with time, another one."""
    _, field, _, _ = point.probe(0.0, mode, lam)
    size = float(np.max(np.abs(point.x), initial=0.0)) + 1e-3
    most = TRIAL * size / (float(np.max(np.abs(field), initial=0.0)) + 1e-300)
    if not most < abs(point.step):
        return point
    return replace(point, step=point.direction * most, probed={})


def _row(side: int, i: int, rows: Array) -> Array:
    return np.asarray(rows[:, side, i])


def _attraction(point: Point, rows: Array, i: int) -> float:
    # A contact only pushes: there is no other end, and what stands for it is no rate.
    return 1.0 if point.machine.contacts[i] or rows[-1, 0, i] + rows[-1, 1, i] >= 0 else -1.0


def repelling(point: Point, mode: Array, alone: Sequence[int]) -> list[int]:
    """Of sliding surfaces to which no other sliding one is coupled: those left at the slightest push."""
    if not alone:
        return []
    g, gt = point.gradients(mode)
    rates = []
    for sign in (1.0, -1.0):
        velocity = point.rhs(np.where(mode == 0, sign, mode), mode)
        rates.append([gt[i] + point.machine.rate(i, g, velocity) for i in alone])
    return [i for i, up, down in zip(alone, *rates, strict=True) if point.direction * (up - down) > 0]


def clear_rates(
    point: Point, mode: Array, velocity: Array, free: Sequence[int], tangent: Sequence[int]
) -> tuple[float, list[int]] | None:
    """(least rate on its scale, surfaces whose rate is not clear of zero); None where one goes the wrong way.

    The rate off a surface of `tangent` is rounding, whatever its size looks like.
    """
    g, gt = point.gradients(mode)
    margin, unclear = np.inf, []
    for i in free:
        with np.errstate(invalid="ignore"):
            terms = np.append(g[i] * np.where(g[i] == 0.0, 0.0, velocity), gt[i])
            scale = float(np.sum(np.abs(terms)))
            rate = float(np.sum(terms)) * mode[i] * point.direction
        # A guard with a root in it has no rate where the root vanishes.
        unbounded = not np.isfinite(rate)
        near = unbounded or i in tangent or abs(rate) <= CLEAR * scale or _drowned(point, i, g, gt, rate)
        if near or _balanced(point, i, mode, rate, scale):
            unclear.append(i)
        elif rate < 0:
            return None
        else:
            margin = min(margin, rate / scale)
    return margin, unclear


def _size(point: Point, i: int, g: Array, gt: Array) -> float:
    """Of the terms of a guard, by its gradient."""
    with np.errstate(invalid="ignore"):
        sizes = np.abs(np.append(g[i] * point.x, gt[i] * point.t))
    return float(np.sum(sizes[np.isfinite(sizes)]))


def _drowned(point: Point, i: int, g: Array, gt: Array, rate: float) -> bool:
    """Whether a rate moves its guard by less than rounding of it in all the time there is."""
    return point.longest > 0.0 and abs(rate) * point.longest <= ROUNDING * _size(point, i, g, gt)


def _balanced(point: Point, i: int, mode: Array, rate: float, scale: float) -> bool:
    """Whether a rate may be what is left of larger terms that cancel, those that multipliers balance too."""
    part = abs(rate) / (scale + point.reach(i, mode))
    small = part <= PLAIN or abs(rate) <= PLAIN * BALANCED * point.largest_terms(i, mode)
    if part <= BALANCED or (small and abs(rate) <= BALANCED * point.terms(i, mode)):
        return True
    return bool(np.any(mode == 0.0)) and abs(rate) <= ROUNDING * point.speed_terms(i, mode)


def leaves(
    point: Point, mode: Array, lam: Array, velocity: Array, free: Sequence[int], tangent: Sequence[int]
) -> tuple[dict[int, int], float, list[int]] | None:
    """Orders with which a mode leaves the surfaces it runs off, None where one is not left to its side.

    With the least clear rate, and the surfaces that are left by rounding of a rate.
    """
    clear = clear_rates(point, mode, velocity, free, tangent)
    if clear is None:
        return None
    margin, unclear = clear
    orders, faint = dict.fromkeys(free, 1), []
    g, gt = point.gradients(mode)
    if unclear:
        # Where all stood still before, the steps of the run are as long as the run.
        point = _on_own_scale(point, mode, lam)
    for i in unclear:
        size = _size(point, i, g, gt)
        raw = point.machine.rate(i, g, velocity) + float(gt[i])
        rate = raw if np.isfinite(raw) else None
        speed, moved = point.terms(i, mode), point.reach(i, mode)
        # A multiplier that stands at its end, as `nearness` says, and the rate of the mode beyond it are one.
        located = LOCATED if i in tangent and i not in point.resting else AT_END
        level = rate is not None and abs(rate) <= max(located * moved, ROUNDING * speed)
        # Where the solution of this very mode came back to its surface, rounding has decided; backwards the
        # run is put on the place where the rate vanishes.
        same = i in point.back and i not in point.along and np.array_equal(point.base, mode)
        came_back = level and same and point.direction > 0
        force, own = 0.0, None if rate is None else rate * mode[i]
        if i in point.resting:
            # What is left of the rate of a contact that rests is rounding of speeds long gone.
            level, force = True, point.terms(i, np.where(np.arange(len(mode)) == i, 0.0, mode))
            came_back = False
        drowned = rate is not None and not level and _drowned(point, i, g, gt, rate)
        terms = Terms(size, speed, own, level or drowned, point.grain, point.fine, force)
        term = leading_term(point, mode, lam, partial(_row, 0, i), terms)
        if drowned and term == (0, 0.0):
            # Nothing else moves it.
            term = leading_term(point, mode, lam, partial(_row, 0, i), replace(terms, tangent=False))
        if came_back and (term is None or term[1] <= 0):
            # The rate, however little it is, says where the solution goes first.
            terms = replace(terms, tangent=False)
            term = leading_term(point, mode, lam, partial(_row, 0, i), terms)
            faint.append(i)
        if term is None or term[1] < 0:
            return None
        orders[i] = term[0]
        margin = 0.0
    return orders, float(margin), faint


def at_rest(point: Point, base: Mode, i: int) -> bool:
    """Whether the rate of a surface with a contact is 0 to rounding, so that the state may rest on it."""
    mode = np.array(base, dtype=float)
    mode[i] = 0.0
    rate = abs(float(point.machine.guards(point.t, point.x, mode)[i]))
    g, gt = point.gradients(mode)
    scale = float(np.sum(np.abs(g[i] * point.x)) + abs(gt[i] * point.t))
    mode[i] = point.machine.contacts[i]
    g, gt = point.gradients(mode)
    field = point.rhs(np.where(mode == 0, 1.0, mode), mode)
    scale += abs(point.machine.rate(i, np.abs(g), np.abs(field))) + abs(float(gt[i])) - rate
    return rate <= NO_RATE * scale
