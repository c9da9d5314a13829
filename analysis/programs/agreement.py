"""Whether the System of a program and the program say the same, at random states off the surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from filippov.analysis.programs.translation import Translation
from filippov.model.symbols import t as time
from filippov.model.system import System

Array = npt.NDArray[np.float64]
POINTS, FEWEST = 200, 20
SAME, NEAR = 1e-8, 1e-9


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
    """A sentence where the program and its System differ ("" where they agree), and the number of states compared.

    t, y    times (k,) and states (n, k) about which the random states lie
    """
    numbers = Numbers(translation.system)
    rng = np.random.default_rng(seed)
    spread = np.maximum(np.ptp(y, axis=1), 0.3 * np.max(np.abs(y), axis=1))
    spread = np.where(spread > 0, spread, 1.0)
    compared = 0
    for k in range(POINTS):
        j = int(rng.integers(len(t)))
        when = float(t[j]) if k % 2 else float(rng.uniform(t[0], t[-1]))
        where = y[:, j] + rng.normal(size=len(y)) * spread * (0.0 if k % 4 == 0 else 1.0)
        if k % 8 == 1:
            where = where * rng.choice([1e-3, 10.0])
        full = translation.extended(when, where)
        with np.errstate(all="ignore"):
            try:
                h = numbers.h(when, full)
                own = np.asarray(function(when, where.copy()), dtype=float).ravel()
                theirs = numbers.field(when, full)[: len(where)]
            except (ValueError, ZeroDivisionError, OverflowError, TypeError, FloatingPointError):
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
