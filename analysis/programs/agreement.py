"""Whether the System of a program and the program say the same, at random states off the surfaces."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from scipy.optimize import brentq

from filippov.analysis.programs.translation import Translation
from filippov.model.symbols import t as time
from filippov.model.system import System

Array = npt.NDArray[np.float64]
POINTS, FEWEST = 200, 20
SAME, NEAR = 1e-8, 1e-9
# Lines on which each surface is looked for, and how far beside it the places lie, in parts of such a line.
LINES, BESIDE = 6, 1e-6
_OUTSIDE = (ValueError, ZeroDivisionError, OverflowError, TypeError, FloatingPointError)


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
        return np.array([float(h(t, *x, *self.p)) for h in self._h])

    def h_along(self, t: Array, x: Array, i: int) -> Array:
        """The i-th switching function at times (k,) and states (n, k)."""
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
            except _OUTSIDE:
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


def _spread(y: Array) -> Array:
    spread = np.maximum(np.ptp(y, axis=1), 0.3 * np.max(np.abs(y), axis=1))
    return np.where(spread > 0, spread, 1.0)


def _random(t: Array, y: Array, seed: int) -> Iterator[tuple[float, Array]]:
    """Places on the solution and about it, near and far."""
    rng, spread = np.random.default_rng(seed), _spread(y)
    for k in range(POINTS):
        j = int(rng.integers(len(t)))
        when = float(t[j]) if k % 2 else float(rng.uniform(t[0], t[-1]))
        where = y[:, j] + rng.normal(size=len(y)) * spread * (0.0 if k % 4 == 0 else 1.0)
        yield when, where * rng.choice([1e-3, 10.0]) if k % 8 == 1 else where


def _beside(
    numbers: Numbers, translation: Translation, t: Array, y: Array, seed: int
) -> Iterator[tuple[float, Array]]:
    """Places closely on both sides of each surface: a branch may hold in a narrow part of the states only."""
    rng, spread = np.random.default_rng(seed + 1), _spread(y)
    length = t[-1] - t[0]
    for i in range(len(translation.system.surfaces)):
        for k in range(LINES):
            j = int(rng.integers(len(t)))
            turn = rng.normal(size=len(y)) * spread * (k % 3 > 0)
            start = t[0] if k % 3 == 0 else float(t[j])

            def along(
                s: float, j: int = j, turn: Array = turn, start: float = start, k: int = k
            ) -> tuple[float, Array]:
                return float(start + (s * length if k % 3 == 0 else 0.0)), y[:, j] + s * turn

            def height(s: float, i: int = i, along: Any = along) -> float:
                when, where = along(s)
                return float(numbers.h(when, translation.extended(when, where))[i])

            try:
                ends = np.linspace(0.0, 1.0, 12) if k % 3 == 0 else np.linspace(-2.0, 2.0, 12)
                heights = [height(float(s)) for s in ends]
                turns = [q for q, (a, b) in enumerate(itertools.pairwise(heights)) if a * b < 0]
                if turns:
                    root = brentq(height, float(ends[turns[0]]), float(ends[turns[0] + 1]))
                    yield along(root - BESIDE)
                    yield along(root + BESIDE)
            except _OUTSIDE:
                continue
