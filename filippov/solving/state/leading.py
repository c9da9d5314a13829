"""The first power of time that does not vanish in a guard along the solution of a mode.

What exceeds rounding is decided by the terms that a guard and its rate are sums of, never by the size of the
state: a surface that is reached where the states in it are 0 is as any other.

Source: Filippov 1988, section 10 (the first non-vanishing derivative decides).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.tables.root_tables import NODES, POSITION
from filippov.kernel.tables.tableaus import DOP853
from filippov.solving.state.point import Point

VANISHING = 1e-9
# Excursions that are rounding, of the size of the terms of a guard.
SHALLOW = 1e-12
TRIALS, SHORTER = 12, 4.0
# A trial step of a stiff mode as long as the rest before it may go anywhere: nothing can be read off it.
EXPLODED = 1e100
EPS = float(np.finfo(float).eps)
_MONOMIAL = np.linalg.inv(np.vander(np.array(POSITION), NODES, increasing=True))
# What rounding of the values, of their terms and of differences in them, becomes in each coefficient.
_ROUNDING = 16 * EPS * np.sum(np.abs(_MONOMIAL), axis=1)
# The same of the way along the step: dense output is a sum of stages with weights far above 1.
_WEIGHTS = np.sum(np.abs(DOP853.dense), axis=0)
_CARRIED = EPS * np.abs(_MONOMIAL) @ np.vander(POSITION, len(_WEIGHTS), increasing=True) @ _WEIGHTS


@dataclass(frozen=True)
class Terms:
    """What a guard and its rate at the point are measured by.

    size     of the terms of the guard
    speed    of the terms of its rate
    force    of those of its second derivative, where the rate is none: that of a contact that rests
    rate     the rate itself where it is known, else None
    tangent  whether the rate is 0 but for rounding, or for the error of locating the point
    grain    rounding of the samples, of that of formulas: more where gradients are differences
    fine     whether excursions that are rounding count
    """

    size: float
    speed: float
    rate: float | None = None
    tangent: bool = False
    grain: float = 1.0
    fine: bool = False
    force: float = 0.0


def first_derivative(values: Array, terms: Terms, step: float) -> tuple[int, float]:
    """Order and coefficient of the first power of theta in the guard: (0, 0.0) if it is zero throughout."""
    powers, first = _MONOMIAL @ values, 1
    shallow = 0.0 if terms.fine else SHALLOW
    way, excursion = (terms.speed + terms.force * abs(step)) * abs(step), shallow * terms.size
    scale, largest = terms.size + way, float(np.max(np.abs(values[1:])))
    rounding = terms.grain * _ROUNDING * scale + _CARRIED * way
    if terms.tangent:
        # Of the rate: what is left of it at the point is no part of the guard.
        powers, rounding, first = powers * np.arange(NODES), rounding * np.arange(NODES), 2
        largest, excursion = float(np.max(np.abs(powers[2:]))), shallow * way
    elif terms.rate is not None:
        powers[1] = terms.rate * step
        largest = max(largest, abs(powers[1]))
    if not np.isfinite(largest) or (terms.rate in (None, 0.0) and largest <= 64 * EPS * scale):
        return 0, 0.0
    for order in range(first, NODES - 1):
        least = max(VANISHING * largest, float(rounding[order]))
        known = order == 1 and terms.rate is not None
        if abs(powers[order]) > (0.0 if known else least):
            # Where the point was located next to an extremum, what is left of the slope turns round at once.
            now, then = float(powers[order]), float(powers[order + 1])
            turns = order == first and now * then < 0 and abs(then) > max(
                VANISHING * largest, float(rounding[order + 1])
            )
            if turns and abs(now) <= 4.0 * excursion * abs(then / now):
                continue
            return order, now
    return 0, 0.0


def leading_term(
    point: Point, mode: Array, lam: Array, pick: Callable[[Array], Array], terms: Terms,
    size: Callable[[Array], float] | None = None,
) -> tuple[int, float] | None:  # fmt: skip
    """Order and sign of the first power of time in a guard along a mode; None where it cannot be followed.

    pick: the guard out of the rows of `Machine.probe`; size: that of its terms on the step that these are of,
    where it is not that at the point. The trial step is shortened until two lengths agree on
    the term, so that what a polynomial on a long step makes up is not taken for a derivative, and lengthened
    where it is too short for the term to stand out of rounding. Where none agree, as of powers that are not
    whole, the side of the guard on the shortest step decides, and how it grows.
    """
    ends: list[float] = []
    failed: list[Exception] = []

    def follow(step: float) -> tuple[int, float] | None:
        try:
            # No solution comes as far as a long trial step: a function of the user may have no value there.
            with np.errstate(all="ignore"):
                code, _, _, rows = point.probe(step, mode, lam)
        except (ArithmeticError, ValueError) as error:
            failed.append(error)
            return -1, 0.0
        if code != 0:
            return None
        values = pick(rows)
        # The point may lie by a rounding on the side on which the mode's guard has no value.
        start = values[0] if np.isfinite(values[0]) else 0.0
        if not np.all(np.abs(values[1:]) < EXPLODED):
            return -1, 0.0
        ends.append(_one_sided(values - start, terms, step))
        own = terms if size is None else replace(terms, size=size(rows))
        return first_derivative(values - start, own, step)

    found: list[tuple[int, float]] = []
    term: tuple[int, float] | None = (0, 0.0)
    for q in range(TRIALS):
        term = follow(point.step / SHORTER**q)
        if term is None:
            return None
        if term[0] == 0:
            break
        if found and _agree(term, found[-1]):
            return term[0], float(np.sign(term[1]))
        if term[0] > 0:
            found.append(term)
    else:
        if len(ends) > 1 and ends[-1] * ends[-2] > 0.0:
            order = round(float(np.log(ends[-2] / ends[-1]) / np.log(SHORTER)))
            return min(max(order, 1), NODES - 2), float(np.sign(ends[-1]))
        if failed and not found:
            raise failed[-1]
        return (found[-1][0], float(np.sign(found[-1][1]))) if found else None
    last = found[0] if found else term
    for q in range(1, TRIALS):
        step = point.step * SHORTER**q
        term = follow(step) if abs(step) <= point.longest else None
        if term is None or term[0] < 0:
            break
        if _agree(last, term):
            return last[0], float(np.sign(last[1]))
        last = term
    return 0, 0.0


def _one_sided(values: Array, terms: Terms, step: float) -> float:
    """The guard at the end of a step, without a rate that is none; 0 where it changes its side in between."""
    rate = terms.rate if terms.tangent else None
    rest = values[1:] - (rate or 0.0) * step * np.array(POSITION[1:])
    return float(rest[-1]) if np.all(rest * rest[-1] > 0.0) else 0.0


def _agree(short: tuple[int, float], long: tuple[int, float]) -> bool:
    """Whether terms of steps of lengths 1 and SHORTER are those of one power of time."""
    return short[0] == long[0] > 0 and 0.8 < short[1] * SHORTER ** short[0] / long[1] < 1.25
