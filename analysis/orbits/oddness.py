"""Whether a system is odd: f(t + T/2, -x) = -f(t, x) with mirrored surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.sensitivity.variation import mode_field, signs_at
from filippov.model.system import System

Array = npt.NDArray[np.float64]
_POINTS = 48
_REACH = (0.3, 1.0, 2.0, 4.0)


def is_odd(
    system: System, p: Array, size: Array, t0: float, period: float,
    jacobian: Callable[..., Any] | None = None,
) -> bool:  # fmt: skip
    """Whether the field is odd on points up to four times `size` away (n,), taken with a fixed seed.

    A field that is not defined at such a point is left out there.
    """
    random = np.random.default_rng(20020508)
    scale = np.repeat(_REACH, _POINTS // len(_REACH))[:, None] * np.maximum(size, 1e-12)
    x = random.uniform(-1.0, 1.0, (_POINTS, system.dimension)) * scale
    t = t0 + period * random.uniform(0.0, 1.0, _POINTS)
    here = _field(system, t, x, p, jacobian)
    there = _field(system, t + 0.5 * period, -x, p, jacobian)
    known = np.all(np.isfinite(here), axis=1) & np.all(np.isfinite(there), axis=1)
    gap = np.abs(here + there)[known]
    scales = np.max(np.abs(here[known]), axis=0, initial=0.0)
    return bool(np.any(known) and np.all(gap <= 1e-8 * (scales + 1e-300)))


def _field(
    system: System, t: Array, x: Array, p: Array, jacobian: Callable[..., Any] | None
) -> Array:
    """The field at points off the surfaces, with the signs they have there: (k, n)."""
    _, signs = signs_at(system, t, x, p, jacobian)
    out = np.full(x.shape, np.nan)
    for mode in {tuple(int(v) for v in row) for row in signs}:
        rows = np.all(signs == np.array(mode, dtype=float), axis=1)
        part = mode_field(system, mode, (), jacobian)
        out[rows] = part.part("f", t[rows], x[rows], signs[rows], p)[:, :, 0]
    return out
