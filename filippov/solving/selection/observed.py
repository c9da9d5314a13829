"""Observers and user events: they change nothing, and so are no part of what modes can follow."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.tables import codes
from filippov.kernel.tables.root_tables import DEGREE
from filippov.solving.selection.ambiguity import point_of
from filippov.solving.state.events import Mode
from filippov.solving.state.leading import SHALLOW, SHORTER, TRIALS
from filippov.solving.state.point import Point
from filippov.solving.state.run import Run

# By how much a guard has to grow from one trial step to the next, SHORTER times as long, to be on its way.
GROWS = 1.5


def watched(run: Run, surfaces: Sequence[int]) -> list[int]:
    """Those of some surfaces that observers and user events stand for."""
    roles = run.machine.roles
    return [i for i in surfaces if roles[i] == "observer"]


def observe(run: Run, surfaces: Sequence[int], since: Mode | None = None) -> list[int]:
    """Give observers that the state is on the sign that h takes along the mode that the run is in.

    h = c tau**k from here on, of the shortest two trial steps over which it stands out of rounding and grows.
    One that does not leave 0 keeps its sign. After the mode `since` it has the other one where it has just
    arrived, and those are returned that are reached: not one that was on 0 before, and stays there.
    """
    if not surfaces:
        return []
    point, reached = point_of(run), []
    for i in surfaces:
        sign, order = _side(point, run.mode.copy(), i)
        stayed = since is not None and sign == 0 and _side(point, np.array(since, float), i)[0] == 0
        arrived = since is not None and sign == 0 and not stayed and run.trigger[i] == codes.ROOT
        run.mode[i], run.order[i] = sign or (-run.mode[i] if arrived else run.mode[i]), order
        if not stayed:
            reached.append(i)
    return reached


def _side(point: Point, mode: Array, i: int) -> tuple[int, int]:
    """(sign of h_i right after the point, how often it vanishes there); (0, 0) where it stays 0."""
    g, gt = point.gradients(mode)
    size = float(abs(g[i]) @ abs(point.x) + abs(gt[i] * point.t))
    way, before = point.terms(i, mode), 0.0
    for q in range(-TRIALS, TRIALS):
        step = point.step * SHORTER**q
        if abs(step) > max(point.longest, abs(point.step)):
            break
        code, _, _, rows = point.probe(step, mode, point.guess)
        h = float(mode[i] * rows[-1, 0, i]) if code == 0 else math.nan
        if not math.isfinite(h):
            break
        if h * before > 0.0 and abs(h) >= GROWS * abs(before):
            return (1 if h > 0.0 else -1), min(max(round(math.log(h / before, SHORTER)), 1), DEGREE - 2)
        before = h if abs(h) > SHALLOW * (size + way * abs(step)) else 0.0
    return 0, 0
