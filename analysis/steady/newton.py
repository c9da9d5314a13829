"""A zero of several equations by Newton's method, with the distance within which it is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.base.arrays import Array

# What is left of the equations at a zero, and near one.
RESIDUAL, ROUGH = 1e-9, 1e-6
# Equations that are reduced by this factor while steps get no shorter only fade.
FADED = 1e-6
# Steps after the search; a zero of multiplicity m is approached by the factor 1 - 1/m a step.
STEPS = 60
# Relative length of the last step towards a zero.
CLOSE = 1e-5
# Slopes below this part of the largest are none. Along a degenerate direction they are 0 at the zero alone;
# along a set of zeros they are rounding, and a step that they tell is none.
RANKS = (1e-13, 1e-7)
# What a step has to reduce the next one by, to count; the parts of it that are tried.
FALLS, PARTS = 0.99, (1.0, 0.5, 0.25)
# Differences of arguments, and the factor by which steps to a simple zero get shorter at least.
DIFFERENCE, SLOW = 1e-6, 0.3


class _Near(Exception):  # noqa: N818 - no error: the search has come near a zero
    """Where the equations are small enough for Newton's method."""

    def __init__(self, place: Array) -> None:
        super().__init__()
        self.place = np.array(place)


def zero(f: Callable[[Array], Array], start: Array) -> tuple[Array, float] | None:
    """A zero of f reached from a start, and the length of Newton's last step there; None where none is.

    f is of order 1 where its arguments are. What only fades, as exp(-x) does, has no zero: Newton's steps go
    on for ever. At a multiple zero f is 0 to rounding in a neighbourhood; the last step tells its size.
    """
    from scipy.optimize import least_squares

    def searched(place: Array) -> Array:
        values = f(place)
        if np.max(np.abs(values), initial=0.0) <= ROUGH:
            raise _Near(place)
        return values

    def defined(place: Array) -> Array:
        try:
            return f(place)
        except (ValueError, ArithmeticError):
            return np.full(len(start), np.nan)

    try:
        # What follows is quicker near a zero, and knows multiple ones.
        with np.errstate(all="ignore"):
            result = least_squares(searched, start, xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=200)
        y = np.asarray(result.x)
        if not np.max(np.abs(result.fun)) <= ROUGH * (1.0 + np.max(np.abs(result.jac))):
            return None
    except _Near as near:
        y = near.place
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return None
    left = defined(y)
    return _approached(defined, y, left) if np.all(np.isfinite(y)) else None


def _approached(f: Callable[[Array], Array], y: Array, left: Array) -> tuple[Array, float] | None:
    """The zero near y, where f is `left`, and the length of the last step."""
    length, first = np.inf, float(np.max(np.abs(left)))
    for _ in range(STEPS):
        slopes = differences(f, y)
        # At the edge of where f is defined there are no slopes.
        if not np.any(left) or not np.all(np.isfinite(slopes)):
            length = 0.0
            break
        size, before = 1.0 + float(np.max(np.abs(y))), length
        for rank in RANKS:
            step = linalg.lstsq(slopes, left, rcond=rank)[0]
            length = float(np.max(np.abs(step)))
            # Nearer to a multiple zero differences tell no slope.
            close = length <= 1e-15 * size or SLOW * before < length <= DIFFERENCE * size
            next_y = y if close else _step(f, y, step, slopes, rank)
            if next_y is not None:
                break
        if close or next_y is None:
            break
        y = next_y
        left = f(y)
    known, size = np.all(np.isfinite(slopes)), 1.0 + float(np.max(np.abs(y)))
    now = float(np.max(np.abs(left)))
    fades = length > CLOSE * size and now < FADED * first
    rates = np.max(np.abs(slopes), axis=1) if known else 0.0
    if fades or not np.all(np.abs(left) <= RESIDUAL * (1.0 + rates)):
        return None
    return y, max(length, DIFFERENCE * size) if known and len(null_space(slopes)) else length


def null_space(slopes: Array) -> Array:
    """The directions, one a row, along which no equation has a slope; each may be large in its own way."""
    rows = np.maximum(1.0, np.max(np.abs(slopes), axis=1))
    _, values, vt = linalg.svd(slopes / rows[:, None])
    return np.asarray(vt[int(np.sum(values > RANKS[-1])) :])


def _step(f: Callable[[Array], Array], y: Array, step: Array, slopes: Array, rank: float) -> Array | None:
    """Where the step, or a part of it, leads; None where the next step would not be shorter.

    The next one with the same slopes (Deuflhard 2011, section 3.3): equations may hold less well beside a
    curve along which the zero is approached.
    """
    length = np.max(np.abs(step))
    for part in PARTS:
        there = y - part * step
        now = f(there)
        if np.all(np.isfinite(now)) and (
            np.max(np.abs(linalg.lstsq(slopes, now, rcond=rank)[0])) < FALLS * length
        ):
            return there
    return None


def differences(f: Callable[[Array], Array], y: Array) -> Array:
    """The slopes of f at y, a column for each argument, from central differences."""
    columns = []
    for k in range(len(y)):
        step = np.zeros(len(y))
        step[k] = DIFFERENCE * max(1.0, abs(y[k]))
        columns.append((f(y + step) - f(y - step)) / (2 * step[k]))
    return np.array(columns).T
