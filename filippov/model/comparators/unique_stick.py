"""Whether the stick of several is unique in every state: that all principal minors of -A are positive.

    det(-A[k, k]) > 0 for all sets k of surfaces: -A is a P-matrix, the stick of all has one solution

Where the states stand in sines and cosines only, as the places of joints do in a mass matrix, boxes of these
angles are divided until interval arithmetic shows the sign of every minor (Moore, Kearfott & Cloud 2009,
chapters 2 and 5). A symmetric positive definite matrix with a positive column scaling, as friction through a
mass matrix has it, is one of these. Parameters have the values that are given.
Source: Cottle, Pang & Stone 1992, theorem 3.3.7, for the P-matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Symbol

from filippov.base.arrays import Array

Interval = tuple[Array, Array]
MOST_BOXES, MOST_ANGLES = 100_000, 4
ROUNDED = 1e-12  # of what was added: less is rounding of the arithmetic of intervals


@dataclass(frozen=True)
class Unique:
    """Whether a P-matrix was proved, and where not the state in which it is none, if one is known."""

    proved: bool
    at: Mapping[Symbol, float] | None = None


class _UnknownError(Exception):
    """The range of an expression is not known."""


def unique(matrix: sympy.Matrix, sets: Sequence[Sequence[int]]) -> Unique:
    """Whether the minors of all sets are positive for all values of the symbols. No set is empty."""
    angles = _angles(matrix)
    if angles is None:
        return Unique(proved=False)
    corner = np.full((1, len(angles)), np.pi)
    low, high = -corner, corner
    plain = all(angle.is_Symbol for angle in angles)
    while low.shape[0]:
        try:
            decided = _positive(matrix, sets, angles, low, high)
            middle = 0.5 * (low + high)
            wrong = _negative(matrix, sets, angles, middle)
        except _UnknownError:
            return Unique(proved=False)
        if np.any(wrong):
            values = middle[int(np.flatnonzero(wrong)[0])].tolist()
            return Unique(proved=False, at=dict(zip(angles, values, strict=True)) if plain else None)
        low, high = low[~decided], high[~decided]
        if low.shape[0] * 2 ** len(angles) > MOST_BOXES or not angles:
            return Unique(proved=low.shape[0] == 0)
        for j in range(len(angles)):
            middle = 0.5 * (low[:, j] + high[:, j])
            left, right = high.copy(), low.copy()
            left[:, j] = right[:, j] = middle
            low, high = np.concatenate([low, right]), np.concatenate([left, high])
    return Unique(proved=True)


def _angles(matrix: sympy.Matrix) -> list[Expr] | None:
    """What sines and cosines are of; None where symbols stand elsewhere, or there are many."""
    waves = matrix.atoms(sympy.sin, sympy.cos)
    angles = sorted({wave.args[0] for wave in waves}, key=str)
    free = matrix.xreplace(dict.fromkeys(waves, sympy.S.One)).free_symbols
    return None if free or len(angles) > MOST_ANGLES else angles


def _positive(
    matrix: sympy.Matrix, sets: Sequence[Sequence[int]], angles: list[Expr], low: Array, high: Array
) -> npt.NDArray[np.bool_]:
    """The boxes on which all minors are positive for sure."""
    above = [minor[0] > 0 for minor in _minors(matrix, sets, angles, low, high)]
    return np.asarray(np.all(above, axis=0), dtype=np.bool_)


def _negative(
    matrix: sympy.Matrix, sets: Sequence[Sequence[int]], angles: list[Expr], at: Array
) -> npt.NDArray[np.bool_]:
    """The points at which a minor is negative for sure."""
    below = [minor[1] < 0 for minor in _minors(matrix, sets, angles, at, at)]
    return np.asarray(np.any(below, axis=0), dtype=np.bool_)


def _minors(
    matrix: sympy.Matrix, sets: Sequence[Sequence[int]], angles: list[Expr], low: Array, high: Array
) -> list[Interval]:
    known: dict[Expr, Interval] = {q: (low[:, j], high[:, j]) for j, q in enumerate(angles)}
    many = low.shape[0]
    with np.errstate(all="ignore"):
        entries = {
            (i, j): _range(matrix[i, j], known, many) for i in range(matrix.rows) for j in range(matrix.cols)
        }
        return [_determinant(entries, tuple(k), tuple(k)) for k in sets]


def _determinant(
    entries: Mapping[tuple[int, int], Interval], rows: tuple[int, ...], columns: tuple[int, ...]
) -> Interval:
    """By the first row."""
    if len(rows) == 1:
        return entries[rows[0], columns[0]]
    total: Interval | None = None
    for place, column in enumerate(columns):
        left = tuple(q for q in columns if q != column)
        term = _times(entries[rows[0], column], _determinant(entries, rows[1:], left))
        term = term if place % 2 == 0 else (-term[1], -term[0])
        total = term if total is None else _plus(total, term)
    assert total is not None
    return total


def _range(e: Expr, known: dict[Expr, Interval], many: int) -> Interval:
    """The range of an expression on boxes; every part of it is looked at once."""
    if e in known:
        return known[e]
    if e.is_number:
        value = float(sympy.N(e))
        out = (np.full(many, value), np.full(many, value))
    elif e.is_Add or e.is_Mul:
        parts = [_range(q, known, many) for q in e.args]
        out = parts[0]
        for part in parts[1:]:
            out = _plus(out, part) if e.is_Add else _times(out, part)
    elif e.is_Pow and e.exp.is_Integer:
        out = _power(_range(e.base, known, many), int(e.exp))
    elif e.func in (sympy.cos, sympy.sin):
        angle = known[e.args[0]]
        back = 0.5 * np.pi if e.func == sympy.sin else 0.0
        out = _cosine((angle[0] - back, angle[1] - back))
    else:
        raise _UnknownError
    known[e] = out
    return out


def _wider(low: Array, high: Array, size: Array) -> Interval:
    return low - ROUNDED * size, high + ROUNDED * size


def _plus(a: Interval, b: Interval) -> Interval:
    size = np.maximum(np.abs(a[0]), np.abs(a[1])) + np.maximum(np.abs(b[0]), np.abs(b[1]))
    return _wider(a[0] + b[0], a[1] + b[1], size)


def _times(a: Interval, b: Interval) -> Interval:
    products = np.stack([p * q for p in a for q in b])
    low, high = products.min(axis=0), products.max(axis=0)
    return _wider(low, high, np.maximum(np.abs(low), np.abs(high)))


def _power(a: Interval, exponent: int) -> Interval:
    low, high = a
    if exponent < 0:
        across = (low <= 0) & (high >= 0)
        low, high = np.where(across, -np.inf, 1 / high), np.where(across, np.inf, 1 / low)
    ends = low ** abs(exponent), high ** abs(exponent)
    least, most = np.minimum(*ends), np.maximum(*ends)
    if exponent % 2 == 0:
        least = np.where((low < 0) & (high > 0), 0.0, least)
    size = np.where(np.isfinite(most), np.maximum(np.abs(least), np.abs(most)), 0.0)
    return _wider(least, most, size)


def _cosine(angle: Interval) -> Interval:
    """It is largest at even and least at odd multiples of pi."""
    low, high = angle
    ends = np.cos(low), np.cos(high)
    turn = 2.0 * np.pi
    top = np.floor(high / turn) >= np.ceil(low / turn)
    bottom = np.floor((high - np.pi) / turn) >= np.ceil((low - np.pi) / turn)
    least = np.where(bottom, -1.0, np.minimum(*ends))
    most = np.where(top, 1.0, np.maximum(*ends))
    return _wider(least, most, np.ones_like(least))
