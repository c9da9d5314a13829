"""A slide followed once more without its denominator, to where it leaves its surface or enters a two-fold.

The sliding field (b F+ - a F-) / (b - a) is 0 over 0 at a two-fold, and no step across it is accurate. In a
time tau with dt = (b - a) dtau it is smooth, the two-fold is an equilibrium, and which of a, b vanishes, or
that none does, is found as accurately as any regular solution (Jeffrey & Colombo 2009, section 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.selection.two_fold import side_rates
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point
from filippov.solving.state.run import Run

RTOL = 1e-12
# Of the largest difference of the rates: what is as small has vanished.
VANISHED = 1e-9
# How much longer the slide may last, of the time it has lasted and of what is left to it by one estimate.
LONGER, LONGER_LEFT = 0.1, 3.0
MOST_CALLS = 50_000
LAST = 1e6


@dataclass(frozen=True)
class Way:
    """Where a slide on a surface ends.

    side  +1 or -1 where it leaves the surface, 0 at a two-fold
    near  the rates there over their largest difference in the slide
    """

    surface: int
    side: int
    t: float
    x: Array
    near: float


class _TooLongError(Exception):
    """More calls than the slide is worth."""


def slide_again(run: Run, point: Point, base: Mode, i: int, attracts: float, left: float) -> Way | None:
    """The end of the slide on surface i alone that the run is at the end of; None where it is not found.

    left: time that may be left to it.
    """
    from scipy.integrate import solve_ivp

    t0, x0 = _beginning(run)
    lasted = abs(run.t - t0)
    signs = np.array(base, dtype=float)
    sense, n = point.direction, len(x0)
    first, _ = side_rates(point, t0, x0, base, signs, i)
    begun = attracts * float(first[1] - first[0])
    widest = max(begun, float(run.zeno[i].widest))
    calls = 0
    if not begun > 0.0 or lasted == 0.0:
        return None

    def rates(q: Array) -> tuple[Array, Array]:
        found, fields = side_rates(point, float(q[n]), q[:n], base, signs, i)
        return attracts * found, fields

    def velocity(_: float, q: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > MOST_CALLS:
            raise _TooLongError
        (a, b), (above, below) = rates(q)
        return np.append(b * above - a * below, sense * (b - a)) / begun

    def end(function: Callable[[Array], float], direction: float) -> Any:
        def value(_: float, q: Array) -> float:
            return function(q)

        value.terminal, value.direction = True, direction  # type: ignore[attr-defined]
        return value

    ends = [
        end(lambda q: float(rates(q)[0][0]), 1.0),
        end(lambda q: float(rates(q)[0][1]), -1.0),
        end(lambda q: float(np.max(np.abs(rates(q)[0]))) - VANISHED * widest, -1.0),
        end(lambda q: abs(float(q[n]) - t0) - (1.0 + LONGER) * lasted - LONGER_LEFT * left, 1.0),
    ]
    q0 = np.append(x0, t0)
    atol = 1e-2 * RTOL * float(np.max(np.abs(q0))) + 1e-300
    try:
        # A trial step may go too far.
        with np.errstate(all="ignore"):
            again = solve_ivp(velocity, (0.0, LAST), q0, method="DOP853", rtol=RTOL, atol=atol, events=ends)
    except _TooLongError:
        return None
    found = [k for k in range(4) if len(again.t_events[k])]
    if not found or found[0] == 3 or not np.all(np.isfinite(again.y[:, -1])):
        return None
    q = again.y[:, -1]
    near = float(np.max(np.abs(rates(q)[0]))) / widest
    return Way(i, (1, -1, 0)[found[0]], float(q[n]), np.ascontiguousarray(q[:n]), near)


def _beginning(run: Run) -> tuple[float, Array]:
    """Where the present mode began: at the last event, or where it was taken up."""
    t, x = run.taken
    last = run.last_decided()
    if last is not None and (last.t - t) * run.direction > 0.0:
        return last.t, np.array(last.x if last.x_after is None else last.x_after)
    return t, x
