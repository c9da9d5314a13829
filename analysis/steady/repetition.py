"""Whether the equations of a system repeat after a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from filippov import System
from filippov import t as time
from filippov.base.arrays import Array

# At how many states and times of each size they are compared, and the relative error of what they give: a
# small forcing is not seen beside large states, and states are in any unit.
_DRAWS, _SIZES, _SAME = 4, 10.0 ** np.arange(0, -16, -3), 1e-9
_LEAST, _MIDDLE, _MOST = 0.1, 0.55, 1.0
Rows = Callable[[Array, Array], Array]


def repeats(system: System, p: Array, span: float, same: float = _SAME) -> bool:
    """Whether the equations are the same at t and t + span, in states and at times drawn.

    p: the parameters' values; same: the relative error of what an equation gives. Of plain functions these
    are the field and the surfaces; where one is not defined in a state drawn there is nothing to compare.
    """
    heights, others = _equations(system)
    rng, n, m = np.random.default_rng(0), system.dimension, len(system.surfaces)
    draws = rng.uniform(_LEAST, _MOST, (_DRAWS * _SIZES.size, 1 + n + 2 * m))
    draws[:, 0] *= span
    draws[:, [*range(1, 1 + n), *range(1 + n + m, 1 + n + 2 * m)]] *= np.repeat(_SIZES, _DRAWS)[:, None]
    later = draws + np.eye(1, draws.shape[1]) * span
    before, after = heights(draws, p), heights(later, p)
    side = np.where(_turned(system, before, after, same), -1.0, 1.0)
    later[:, 1 + n : 1 + n + m] *= side
    return _close(before, after * side, same) and _close(others(draws, p), others(later, p), same)


def _turned(system: System, before: Array, after: Array, same: float) -> npt.NDArray[np.bool_]:
    """The surfaces whose h changes its sign, as that of |sin(t)|: the same with their sides exchanged."""
    form = system.symbolic
    if form is None:
        return np.zeros(len(system.surfaces), dtype=bool)
    return np.array([
        q.kind in ("switching", "kink") and not q.width and radius == (-1, 1) and _close(u, -v, same)
        for q, radius, u, v in zip(system.surfaces, form.radius, before.T, after.T, strict=True)
    ], dtype=bool)  # fmt: skip


def _close(a: Array, b: Array, same: float) -> bool:
    """Whether columns agree to this part of what they reach at states of one size."""
    a, b = (one.reshape(_SIZES.size, _DRAWS, -1) for one in (a, b))
    size = np.max(np.abs(np.nan_to_num(a)), axis=1, keepdims=True)
    return bool(np.all((np.abs(a - b) <= same * size) | (a == b) | (np.isnan(a) & np.isnan(b))))


@lru_cache(maxsize=128)
def _equations(system: System) -> tuple[Rows, Rows]:
    """The h of the surfaces and the rest, of rows (t, x, signs, sizes) and parameters."""
    form = system.symbolic
    if form is None:
        return _rows(lambda *row: _heights(system, *row)), _rows(lambda *row: _field(system, *row))
    symbols = [time, *form.x, *form.s, *form.a, *form.p]
    rest = [e for e in form.expressions() if e not in form.h]
    heights, others = (sympy.lambdify(symbols, list(e), "numpy") for e in (form.h, rest))
    return _rows(lambda row, p: heights(*row, *p)), _rows(lambda row, p: others(*row, *p))


def _rows(function: Callable[[Array, Array], Any]) -> Rows:
    def at(draws: Array, p: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.array([function(row, p) for row in draws], dtype=float)

    return at


def _heights(system: System, row: Array, p: Array) -> Sequence[float]:
    t, x, record = row[0], row[1 : 1 + system.dimension], system.parameters.record(p)
    return [_or_nan(1, surface.h, t, x, record)[0] for surface in system.surfaces]


def _field(system: System, row: Array, p: Array) -> Sequence[float]:
    n, m = system.dimension, len(system.surfaces)
    signs = np.where(row[1 + n : 1 + n + m] > _MIDDLE, 1.0, -1.0)
    return _or_nan(n, system.field, row[0], row[1 : 1 + n], system.parameters.record(p), signs)


def _or_nan(count: int, function: Any, *arguments: Any) -> Sequence[float]:
    try:
        return [float(value) for value in np.ravel(function(*arguments))]
    except (ArithmeticError, ValueError):
        return [float("nan")] * count
