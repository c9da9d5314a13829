"""Whether the System of a program and the program say the same, at random states off the surfaces."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import sympy
from scipy.optimize import brentq

from filippov import System
from filippov import t as time
from filippov.analysis.programs.translation import Translation
from filippov.base.arrays import Array

POINTS, FEWEST = 200, 20
SAME, NEAR = 1e-8, 1e-9
# Lines on which each surface is looked for, and how far beside it the places lie, in parts of such a line.
LINES, BESIDE = 6, 1e-6
OUTSIDE = (ValueError, ZeroDivisionError, OverflowError, TypeError, FloatingPointError)


class Numbers:
    """A system of expressions with its parameters at their defaults, as functions of numbers."""

    def __init__(self, system: System) -> None:
        form = system.symbolic
        assert form is not None
        self.form, self.p = form, system.parameters.resolve({}).tolist()
        arguments = (time, *form.x, *form.p)
        self._h = [sympy.lambdify(arguments, h, "numpy") for h in form.plain_h()]
        self._field = sympy.lambdify((*arguments, *form.s, *form.a), list(form.field), "math")

    def h(self, t: float, x: Any) -> Array:
        """The switching functions (m,)."""
        with np.errstate(all="ignore"):
            return np.array([float(h(t, *x, *self.p)) for h in self._h])

    def h_along(self, t: Array, x: Array, i: int) -> Array:
        """The i-th switching function at times (k,) and states (n, k)."""
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(self._h[i](t, *x, *self.p), dtype=float), t.shape)

    def field(self, t: float, x: Any, signs: Any = None) -> Array:
        """The field, with the signs of the switching functions where none are given."""
        h = self.h(t, x)
        s = np.sign(h) if signs is None else np.asarray(signs, dtype=float)
        return np.array(self._field(t, *x, *self.p, *s, *np.abs(h)), dtype=float)


def disagreement(
    function: Callable[[float, Array], Any], translation: Translation, t: Array, y: Array, seed: int = 0
) -> tuple[str, int]:
    """A sentence where program and System differ ("" where they agree), and the number of states compared.

    t, y    times (k,) and states (n, k) about which the random states lie
    """
    numbers = Numbers(translation.system)
    compared = 0
    for when, where in (*_random(t, y, seed), *_beside(numbers, translation, t, y, seed)):
        full = translation.extended(when, where)
        with np.errstate(all="ignore"):
            try:
                h = numbers.h(when, full)
                own = np.asarray(function(when, where.copy()), dtype=float).ravel()
                theirs = numbers.field(when, full)[: len(where)]
            except OUTSIDE:
                continue
        near = NEAR * (1.0 + np.max(np.abs(full)))
        if np.any(np.abs(h) < near) or not (np.all(np.isfinite(own)) and np.all(np.isfinite(theirs))):
            continue
        compared += 1
        scale = 1.0 + np.max(np.abs(own))
        if np.max(np.abs(own - theirs)) > SAME * scale:
            at = ", ".join(f"{v:.6g}" for v in where)
            return (
                f"f({when:.6g}, [{at}]) is {np.array2string(own, precision=6)} and the System gives "
                f"{np.array2string(theirs, precision=6)}: the translation is not what the program does"
            ), compared
    return "", compared


def spread_of(y: Array) -> Array:
    """How far each state goes, or 0.3 of its size; 1 where it is 0."""
    spread = np.maximum(np.ptp(y, axis=1), 0.3 * np.max(np.abs(y), axis=1))
    return np.where(spread > 0, spread, 1.0)


def _random(t: Array, y: Array, seed: int) -> Iterator[tuple[float, Array]]:
    """Places on the solution and about it, near and far."""
    rng, spread = np.random.default_rng(seed), spread_of(y)
    for k in range(POINTS):
        j = int(rng.integers(len(t)))
        when = float(t[j]) if k % 2 else float(rng.uniform(t[0], t[-1]))
        where = y[:, j] + rng.normal(size=len(y)) * spread * (0.0 if k % 4 == 0 else 1.0)
        yield when, where * rng.choice([1e-3, 10.0]) if k % 8 == 1 else where


def _beside(
    numbers: Numbers, translation: Translation, t: Array, y: Array, seed: int
) -> Iterator[tuple[float, Array]]:
    """Places closely on both sides of each surface: a branch may hold in a narrow part of the states only."""
    for _, along, root in crossed(numbers, translation, t, y, seed):
        yield along(root - BESIDE)
        yield along(root + BESIDE)


def crossed(
    numbers: Numbers, translation: Translation, t: Array, y: Array, seed: int
) -> Iterator[tuple[int, Callable[[float], tuple[float, Array]], float]]:
    """Surfaces with lines (time, state) of s that cross them, and the s where they do.

    Lines in time, at random through the places of the run, and between neighbours of these: what lies within
    a narrow band of the states is met by the run alone.
    """
    rng, spread = np.random.default_rng(seed + 1), spread_of(y)
    length, own = t[-1] - t[0], _heights(numbers, translation, t, y)
    for i in range(len(translation.system.surfaces)):
        lines: list[tuple[float, float, Array, Array, Array]] = []
        for k in range(LINES):
            j = int(rng.integers(len(t)))
            turn = rng.normal(size=len(y)) * spread * (k % 3 > 0)
            start, runs = (t[0], length) if k % 3 == 0 else (float(t[j]), 0.0)
            ends = np.linspace(0.0, 1.0, 12) if k % 3 == 0 else np.linspace(-2.0, 2.0, 12)
            lines.append((start, runs, y[:, j], turn, ends))
        lines += [
            (t[j], t[j + 1] - t[j], y[:, j], y[:, j + 1] - y[:, j], np.array([0.0, 1.0]))
            for j in np.flatnonzero(own[i, :-1] * own[i, 1:] < 0)[:LINES]
        ]
        for line in lines:

            def along(s: float, line: Any = line) -> tuple[float, Array]:
                start, runs, place, turn, _ = line
                return float(start + s * runs), place + s * turn

            def height(s: float, i: int = i, along: Any = along) -> float:
                when, where = along(s)
                return float(numbers.h(when, translation.extended(when, where))[i])

            try:
                heights = [height(float(s)) for s in line[-1]]
                turns = [q for q, (a, b) in enumerate(itertools.pairwise(heights)) if a * b < 0]
                if turns:
                    root = brentq(height, float(line[-1][turns[0]]), float(line[-1][turns[0] + 1]))
                    yield i, along, float(root)
            except OUTSIDE:
                continue


def _heights(numbers: Numbers, translation: Translation, t: Array, y: Array) -> Array:
    """The switching functions (m, k) at the places of a run; NaN where they have no value."""
    out = np.full((len(translation.system.surfaces), len(t)), np.nan)
    for j, when in enumerate(t):
        with np.errstate(all="ignore"), suppress(*OUTSIDE):
            out[:, j] = numbers.h(float(when), translation.extended(float(when), y[:, j]))
    return out
