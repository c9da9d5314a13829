"""Which modes can follow at a point on any number of surfaces: the inclusion's own answer (U1, U2).

A candidate gives each surface met a sign, or 0 for sliding. It is consistent if the motion of that mode does
what the mode says: leaves each surface to the side of its sign (first non-vanishing derivative of h), and
holds each sliding surface with a multiplier inside its set (at an end of the set: one that moves inwards).
All consistent candidates are returned; one means that the solution goes on uniquely.

Sources: Filippov 1988, section 10; Dieci & Lopez 2012, section 3; di Bernardo et al. 2008, chapter 5.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from filippov._kernels.tables import NODES, POSITION
from filippov.events import Mode
from filippov.machine import Array, Machine
from filippov.status import mode_text

CLEAR = 1e-6
VANISHING = 1e-9
TRIALS, SHORTER = 12, 4.0
OPEN = 1e299
NO_RATE = 1e-12
_MONOMIAL = np.linalg.inv(np.vander(np.array(POSITION), NODES, increasing=True))


@dataclass(frozen=True)
class Successor:
    """A consistent next mode.

    order        how often each guard met vanishes along the motion; for sliding 2 where the multiplier starts
                 at an end of its set, 3 at a two-fold, and negative (-1, -2, -3) where it repels
    multipliers  value of the sign of every sliding surface (0 elsewhere)
    field        the field of the mode at the point
    margin       least rate, on its own scale, by which the mode is consistent; 0 for a tangential one
    """

    mode: Mode
    order: tuple[int, ...]
    multipliers: tuple[float, ...]
    field: tuple[float, ...]
    margin: float

    def __str__(self) -> str:
        sliding = [f"{v:.6g}" for v, m in zip(self.multipliers, self.mode, strict=True) if m == 0]
        return mode_text(self.mode) + (f" (multipliers {', '.join(sliding)})" if sliding else "")


@dataclass(frozen=True)
class Point:
    """Where modes are asked for: machine, time and state, direction of time, a trial step, the last mode."""

    machine: Machine
    t: float
    x: Array
    direction: float
    step: float
    guess: Array

    def gradients(self, mode: Array) -> tuple[Array, Array]:
        """dh/dx and dh/dt with the sizes of a mode."""
        return self.machine.gradients(self.t, self.x, mode)


def first_derivative(values: Array, scale: float) -> tuple[int, float]:
    """Order and coefficient of the first power of theta in the guard: (0, 0.0) if it is zero throughout."""
    largest = float(np.max(np.abs(values[1:])))
    noise = 64 * np.finfo(float).eps * scale
    if not np.isfinite(largest) or largest <= noise:
        return 0, 0.0
    powers = _MONOMIAL @ values
    for order in range(1, NODES - 1):
        if abs(powers[order]) > max(VANISHING * largest, noise):
            return order, float(powers[order])
    return 0, 0.0


def leading_term(
    point: Point, mode: Array, lam: Array, pick: Callable[[Array], Array], scale: float
) -> tuple[int, float] | None:
    """Order and sign of the first power of time in a guard along a mode; None where it cannot be followed.

    pick: the guard out of the rows of `Machine.probe`. The trial step is shortened until two lengths agree on
    the term, so that what a polynomial on a long step makes up is not taken for a derivative.
    """
    step, last = point.step, (-1, 0.0)
    for _ in range(TRIALS):
        code, _, _, rows = point.machine.probe(point.t, step, point.x, mode, lam)
        if code != 0:
            return None
        values = pick(rows)
        order, size = first_derivative(values - values[0], scale)
        if order == last[0] and (order == 0 or 0.8 < size * SHORTER**order / last[1] < 1.25):
            return order, float(np.sign(size))
        last, step = (order, size), step / SHORTER
    return last[0], float(np.sign(last[1]))


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


def _sliding_solutions(point: Point, mode: Array, sliding: Sequence[int]) -> list[tuple[Array, Array]]:
    """All (multipliers, field) of a mode with sliding surfaces."""
    found: list[tuple[Array, Array]] = []
    for guess in multiplier_guesses(point, sliding):
        code, field, lam, _ = point.machine.probe(point.t, 0.0, point.x, mode, guess)
        if code != 0 or not np.all(np.isfinite(lam)) or not np.all(np.isfinite(field)):
            continue
        if all(np.max(np.abs(lam - known)[list(sliding)]) > 1e-8 for known, _ in found):
            found.append((lam, field.copy()))
    return found


def _inside(base: Mode, lam: Array, radii: Array, sliding: Sequence[int]) -> bool | None:
    """Whether every multiplier is in its set; None where one stands at an end and its motion must decide."""
    undecided = False
    for i in sliding:
        low, high = radii[i]
        near = _nearness(base, i, low, high)
        if not low - near <= lam[i] <= high + near:
            return False
        if lam[i] < low + near or lam[i] > high - near:
            undecided = True
    return None if undecided else True


def _nearness(base: Mode, i: int, low: float, high: float) -> float:
    """How close a multiplier at an end of its set stands to it: as an exit is located, or a rounding."""
    width = high - low if high - low < OPEN else 1.0  # a contact has one end
    return (1e-7 if base[i] == 0 else 1e-13) * (1.0 + width)


def _moves_inwards(
    point: Point, base: Mode, mode: Array, lam: Array, radii: Array, sliding: Sequence[int]
) -> bool:
    """Follow a trial step of the sliding mode: multipliers at an end of their set must not leave it."""
    for i in sliding:
        low, high = radii[i]
        near = _nearness(base, i, low, high)
        for side, at_end in ((0, lam[i] > high - near), (1, lam[i] < low + near)):
            if at_end:
                code, _, _, rows = point.machine.probe(point.t, point.step, point.x, mode, lam)
                # Rows are written for sliding that attracts; one that repels has both of them negative.
                scale = float(np.max(np.abs(rows[:, :, i])))
                term = leading_term(point, mode, lam, partial(_row, side, i), scale)
                if code != 0 or term is None or term[1] * _attraction(rows, i) < 0:
                    return False
    return True


def _row(side: int, i: int, rows: Array) -> Array:
    return np.asarray(rows[:, side, i])


def _attraction(rows: Array, i: int) -> float:
    return 1.0 if rows[-1, 0, i] + rows[-1, 1, i] >= 0 else -1.0


def _repels(point: Point, mode: Array, i: int) -> bool:
    """Whether sliding on surface i alone is left at the slightest push, in the direction of integration."""
    g, gt = point.gradients(mode)
    rates = []
    for sign in (1.0, -1.0):
        signs = np.where(mode == 0, sign, mode)
        rates.append(gt[i] + g[i] @ point.machine.rhs(point.t, point.x, signs, mode))
    return bool(point.direction * (rates[0] - rates[1]) > 0)


def _leaves(
    point: Point, mode: Array, lam: Array, field: Array, free: Sequence[int], tangent: Sequence[int]
) -> tuple[dict[int, int], float] | None:
    """Orders with which a mode leaves the surfaces it runs off, None where one is not left to its side."""
    g, gt = point.gradients(mode)
    orders: dict[int, int] = {}
    margin = np.inf
    unclear = []
    for i in free:
        terms = np.append(g[i] * field, gt[i])
        scale = float(np.sum(np.abs(terms)))
        rate = float(np.sum(terms)) * mode[i] * point.direction
        if i in tangent or abs(rate) <= CLEAR * scale:
            unclear.append(i)
        elif rate < 0:
            return None
        else:
            orders[i] = 1
            margin = min(margin, rate / scale)
    for i in unclear:
        size = float(np.sum(np.abs(g[i] * point.x)) + abs(gt[i] * point.t))
        term = leading_term(point, mode, lam, partial(_row, 0, i), size)
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
    field = point.machine.rhs(point.t, point.x, np.where(mode == 0, 1.0, mode), mode)
    scale += float(np.sum(np.abs(g[i] * field)) + abs(gt[i])) - rate
    return rate <= NO_RATE * scale


def successors(point: Point, base: Mode, met: Sequence[int]) -> list[Successor]:
    """All consistent next modes at a point on the surfaces `met`; the others keep their sign in `base`."""
    # Sliding is left tangentially: the rate off the surface is rounding there, whatever its size looks like.
    resting = [i for i in met if point.machine.contacts[i] and (base[i] == 0 or at_rest(point, base, i))]
    tangent = [i for i in met if base[i] == 0 or i in resting]
    choices: list[tuple[int, ...]] = []
    for i in met:
        slides = point.machine.roles[i] == "switching" and point.machine.widths[i] == 0.0
        choices.append((1, -1, 0) if slides else (1, -1))
        if i in resting:
            choices[-1] = (point.machine.contacts[i], 0)
    radii, roles = point.machine.radii(point.t, point.x), point.machine.roles
    found: list[Successor] = []
    for signs in itertools.product(*choices):
        mode = np.array(base, dtype=float)
        mode[list(met)] = signs
        sliding = [i for i in range(point.machine.m) if mode[i] == 0]
        free = [i for i in met if mode[i] != 0]
        for lam, field in _sliding_solutions(point, mode, sliding):
            inside = _inside(base, lam, radii, sliding)
            if inside is False:
                continue
            left = _leaves(point, mode, lam, field, free, tangent)
            if left is None or (
                inside is None and not _moves_inwards(point, base, mode, lam, radii, sliding)
            ):
                continue
            orders, margin = left
            # Nothing depends on the sign of a surface on which nothing jumps and along which the motion runs.
            if any(roles[i] != "switching" and orders[i] == 0 and mode[i] != base[i] for i in free):
                continue
            order = [orders.get(i, 0) for i in range(point.machine.m)]
            for i in sliding if inside is None else ():
                order[i] = 2
            if len(sliding) == 1 and _repels(point, mode, sliding[0]):
                order[sliding[0]] = -max(order[sliding[0]], 1)
            found.append(
                Successor(
                    tuple(int(v) for v in mode),
                    tuple(order),
                    tuple(float(v) if mode[i] == 0 else 0.0 for i, v in enumerate(lam)),
                    tuple(float(v) for v in field),
                    margin if inside else 0.0,
                )
            )
    return _without_released_sticking(_without_doubles(found), radii)


def _without_doubles(found: list[Successor]) -> list[Successor]:
    """Sliding goes before a motion along the surface that is the same: a multiplier at the end of its set."""
    kept = []
    for a in found:
        double = any(
            b.mode != a.mode
            and all(v == u or (v == 0 and k == 0) for u, v, k in zip(a.mode, b.mode, a.order, strict=True))
            and np.allclose(a.field, b.field, rtol=1e-9, atol=1e-9 * max(map(abs, a.field)))
            for b in found
        )
        if not double:
            kept.append(a)
    return kept


def _without_released_sticking(found: list[Successor], radii: Array) -> list[Successor]:
    """U4: where the set at h = 0 is wider than [-1, 1], sticking goes before a slip as consistent."""
    kept = []
    for candidate in found:
        beaten = any(
            other.mode != candidate.mode
            and all(
                b == a or (b == 0 and max(-radii[i, 0], radii[i, 1]) > 1 + 1e-12)
                for i, (a, b) in enumerate(zip(candidate.mode, other.mode, strict=True))
            )
            for other in found
        )
        if not beaten:
            kept.append(candidate)
    return kept
