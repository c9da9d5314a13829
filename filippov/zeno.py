"""Accumulation of events at a finite time: where it leads, from the geometric law of its intervals (E9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filippov.machine import Array
from filippov.run import Run


@dataclass(frozen=True)
class Limit:
    """Limit of an accumulation: time, state on all surfaces that take part, error estimate of the time."""

    t: float
    x: Array
    surfaces: tuple[int, ...]
    error: float


def accumulation(run: Run) -> Limit:
    """The limit that the last events point to: t + d r / (1 - r) for intervals d shrinking by the ratio r.

    The state is extrapolated with the same law from the events of the same surface and put on the surfaces.
    """
    last = run.events[-1]
    same = [event for event in run.events if event.index == last.index][-4:]
    intervals = np.abs(np.diff([event.t for event in same]))
    ratio = intervals[-1] / intervals[-2]
    before = intervals[-2] / intervals[-3]
    remaining = intervals[-1] * ratio / (1.0 - ratio)
    error = abs(remaining - intervals[-1] * before / (1.0 - before)) + 4 * np.finfo(float).eps * abs(last.t)
    span = max(3 * len({event.index for event in run.events[-12:]}), 6)
    surfaces = tuple(
        sorted({event.index for event in run.events[-span:] if run.machine.roles[event.index] == "switching"})
    )
    x = same[-1].x + (same[-1].x - same[-2].x) * ratio / (1.0 - ratio)
    x = _onto(run, x, surfaces)
    return Limit(float(last.t + run.direction * remaining), x, surfaces, float(error))


def _onto(run: Run, x: Array, surfaces: tuple[int, ...]) -> Array:
    """The nearest point on all the surfaces (Gauss-Newton)."""
    chosen = list(surfaces)
    for _ in range(4):
        h = run.machine.guards(run.t, np.ascontiguousarray(x), run.mode)[chosen]
        g, _ = run.machine.gradients(run.t, np.ascontiguousarray(x), run.mode)
        step, *_ = np.linalg.lstsq(g[chosen], h, rcond=None)
        x = x - step
    return np.ascontiguousarray(x)
