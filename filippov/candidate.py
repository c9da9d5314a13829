"""Whether a mode is consistent at a point: it leaves what it leaves, and holds what it slides on (U1).

A rate decides where it is clear of zero on its own scale; elsewhere a trial step of the mode is followed, and
the first power of time that does not vanish in the guard or in the distance of the multiplier decides.

Sources: Filippov 1988, section 10; Dieci & Lopez 2012, section 3.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from filippov._kernels.tables import NODES, POSITION
from filippov.events import Mode
from filippov.machine import Array, Machine

CLEAR = 1e-6
BALANCED = 1e-10
VANISHING = 1e-9
# Excursions that are rounding, of the size of the terms of a guard.
SHALLOW = 1e-12
# Of what the signs make of a rate: what is left of one that vanishes where the end of sliding was located.
LOCATED = 1e-7
TRIALS, SHORTER = 12, 4.0
OPEN = 1e299
NO_RATE = 1e-12
_MONOMIAL = np.linalg.inv(np.vander(np.array(POSITION), NODES, increasing=True))

Probe = tuple[int, Array, Array, Array]


@dataclass(frozen=True)
class Point:
    """Where modes are asked for: machine, time and state, direction of time, a trial step.

    guess    the last multipliers
    resting  surfaces with a contact on which the state may rest
    met      surfaces that the point lies on
    """

    machine: Machine
    t: float
    x: Array
    direction: float
    step: float
    guess: Array
    resting: frozenset[int] = frozenset()
    met: frozenset[int] = frozenset()
    reached: dict[int, float] = field(default_factory=dict, compare=False, repr=False)
    probed: dict[tuple[float, bytes, bytes], Probe] = field(default_factory=dict, compare=False, repr=False)

    def gradients(self, mode: Array) -> tuple[Array, Array]:
        """dh/dx and dh/dt with the sizes of a mode."""
        return self.machine.gradients(self.t, self.x, mode)

    def rhs(self, signs: Array, mode: Array) -> Array:
        """The vertex field at signs +-1."""
        return self.machine.rhs(self.t, self.x, signs, mode)

    def reach(self, i: int, mode: Array) -> float:
        """By how much the signs of the surfaces met move the rate of surface i: where they balance, by 0.

        What is left of forces in balance is rounding of these, however small the sum itself is.
        """
        if i not in self.reached:
            component = self.machine.component
            group = [j for j in self.met if component[j] == component[i]]
            g, _ = self.gradients(mode)
            signs = np.where(mode == 0.0, 1.0, mode)
            effects = []
            for j in group:
                signs[j] = -signs[j]
                effects.append(self.rhs(signs, mode))
                signs[j] = -signs[j]
            base = self.rhs(signs, mode)
            for k in {i, *group}:
                change = [abs(self.machine.rate(k, g, effect - base)) for effect in effects]
                self.reached[k] = float(np.nansum(change))
        return self.reached[i]

    def probe(self, step: float, mode: Array, lam: Array) -> Probe:
        """`Machine.probe` at this point; many surfaces ask for the same one."""
        key = (step, mode.tobytes(), lam.tobytes())
        if key not in self.probed:
            code, velocity, multipliers, rows = self.machine.probe(self.t, step, self.x, mode, lam)
            self.probed[key] = code, velocity.copy(), multipliers, rows
        return self.probed[key]


def first_derivative(values: Array, scale: float, located: bool = False) -> tuple[int, float]:
    """Order and coefficient of the first power of theta in the guard: (0, 0.0) if it is zero throughout.

    located: the rate vanishes at the point, up to the error of locating it; scale is that of the rate.
    """
    powers = _MONOMIAL @ values
    first = 1
    if located:
        powers, first = powers * np.arange(NODES), 2
    largest = float(np.max(np.abs(powers[first:] if located else values[1:])))
    noise = 64 * np.finfo(float).eps * scale
    if not np.isfinite(largest) or largest <= noise:
        return 0, 0.0
    least = max(VANISHING * largest, noise)
    for order in range(first, NODES - 1):
        if abs(powers[order]) > least:
            # Where the point was located next to an extremum, what is left of the slope turns round at once.
            now, then = float(powers[order]), float(powers[order + 1])
            turns = order == first and now * then < 0 and abs(then) > least
            if turns and now**2 <= 4.0 * SHALLOW * scale * abs(then):
                continue
            return order, now
    return 0, 0.0


def leading_term(
    point: Point, mode: Array, lam: Array, pick: Callable[[Array], Array], scale: float, spread: float = 0.0
) -> tuple[int, float] | None:
    """Order and sign of the first power of time in a guard along a mode; None where it cannot be followed.

    pick: the guard out of the rows of `Machine.probe`. spread: where its rate vanishes, by how much the signs
    move that rate; else 0. The trial step is shortened until two lengths agree on
    the term, so that what a polynomial on a long step makes up is not taken for a derivative.
    """
    step, last = point.step, (-1, 0.0)
    for _ in range(TRIALS):
        code, _, _, rows = point.probe(step, mode, lam)
        if code != 0:
            return None
        values = pick(rows)
        # The point may lie by a rounding on the side on which the mode's guard has no value.
        start = values[0] if np.isfinite(values[0]) else 0.0
        if not np.all(np.isfinite(values[1:])):
            step /= SHORTER
            continue
        located = spread > 0.0
        order, size = first_derivative(values - start, spread * abs(step) if located else scale, located)
        if order == last[0] and (order == 0 or 0.8 < size * SHORTER**order / last[1] < 1.25):
            return order, float(np.sign(size))
        last, step = (order, size), step / SHORTER
    return (last[0], float(np.sign(last[1]))) if last[0] >= 0 else None


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
    """How close a multiplier at an end of its set stands to it: as an exit is located, or a rounding."""
    width = high - low if high - low < OPEN else 1.0  # a contact has one end
    return (1e-7 if base[i] == 0 else 1e-13) * (1.0 + width)


def inside(base: Mode, lam: Array, radii: Array, sliding: Sequence[int]) -> bool | None:
    """Whether every multiplier is in its set; None where one stands at an end and its motion must decide."""
    undecided = False
    for i in sliding:
        low, high = radii[i]
        near = nearness(base, i, low, high)
        if not low - near <= lam[i] <= high + near:
            return False
        if lam[i] < low + near or lam[i] > high - near:
            undecided = True
    return None if undecided else True


def moving_outwards(
    point: Point, base: Mode, mode: Array, lam: Array, radii: Array, sliding: Sequence[int]
) -> list[int]:
    """The sliding surfaces whose multiplier stands at an end of its set and leaves it along a trial step."""
    leaving = []
    for i in sliding:
        low, high = radii[i]
        near = nearness(base, i, low, high)
        for side, at_end in ((0, lam[i] > high - near), (1, lam[i] < low + near)):
            if at_end:
                code, _, _, rows = point.probe(point.step, mode, lam)
                # Rows are written for sliding that attracts; one that repels has both of them negative.
                scale = float(np.max(np.abs(rows[:, :, i])))
                term = leading_term(point, mode, lam, partial(_row, side, i), scale)
                if code != 0 or term is None or term[1] * _attraction(rows, i) < 0:
                    leaving.append(i)
                    break
    return leaving


def _row(side: int, i: int, rows: Array) -> Array:
    return np.asarray(rows[:, side, i])


def _attraction(rows: Array, i: int) -> float:
    return 1.0 if rows[-1, 0, i] + rows[-1, 1, i] >= 0 else -1.0


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
        terms = np.append(g[i] * np.where(g[i] == 0.0, 0.0, velocity), gt[i])
        scale = float(np.sum(np.abs(terms)))
        rate = float(np.sum(terms)) * mode[i] * point.direction
        # A guard with a root in it has no rate where the root vanishes.
        rough = not np.isfinite(rate)
        if rough or i in tangent or abs(rate) <= max(CLEAR * scale, BALANCED * point.reach(i, mode)):
            unclear.append(i)
        elif rate < 0:
            return None
        else:
            margin = min(margin, rate / scale)
    return margin, unclear


def leaves(
    point: Point, mode: Array, lam: Array, velocity: Array, free: Sequence[int], tangent: Sequence[int]
) -> tuple[dict[int, int], float] | None:
    """Orders with which a mode leaves the surfaces it runs off, None where one is not left to its side."""
    clear = clear_rates(point, mode, velocity, free, tangent)
    if clear is None:
        return None
    margin, unclear = clear
    orders = dict.fromkeys(free, 1)
    g, gt = point.gradients(mode)
    for i in unclear:
        with np.errstate(invalid="ignore"):
            sizes = np.abs(np.append(g[i] * point.x, gt[i] * point.t))
        size = float(np.sum(sizes[np.isfinite(sizes)]))
        rate, spread = abs(point.machine.rate(i, g, velocity) + float(gt[i])), 0.0
        if i in tangent and i not in point.resting and rate <= LOCATED * point.reach(i, mode):
            spread = point.reach(i, mode)
        term = leading_term(point, mode, lam, partial(_row, 0, i), size, spread)
        if term is None or term[1] < 0:
            return None
        orders[i] = term[0]
        margin = 0.0
    return orders, float(margin)


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
