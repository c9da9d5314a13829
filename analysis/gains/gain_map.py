"""rho over two gains, the others fixed: the picture in which a tuning is judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from filippov import System, UsageError
from filippov.analysis.gains.contraction import contraction
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array
from filippov.base.given import Axis, Edge, Interval
from filippov.base.keywords import keywords
from filippov.plot.style import axis_labels


@dataclass(frozen=True)
class GainMap:
    """rho on a grid: names of the two gains, their values, ratio of shape (len(y), len(x)).

    The value is inf where a solution does not return; rows omitted after an interrupt are NaN. labels: of the
    axes, with units.
    """

    names: tuple[str, str]
    x: Array
    y: Array
    ratio: Array
    complete: bool = True
    labels: Mapping[str, str] = field(default_factory=dict)


@keywords()
def gain_map(
    system: System,
    section: Section,
    x: Axis,
    y: Axis,
    interval: Interval,
    *,
    parameters: Mapping[str, float] | None = None,
    band: Sequence[Mapping[str, float]] = ({},),
    points: Edge = 32,
    progress: Callable[[int, int], None] | None = None,
) -> GainMap:
    """The largest contraction ratio over the band for every pair of two gains.

    x, y   (name, values) of the two gains; other arguments as in `tune`
    Raises UsageError.
    """
    if x[0] == y[0]:
        raise UsageError(f"both axes are {x[0]!r}, expected two gains.")
    across, up = np.asarray(x[1], dtype=float), np.asarray(y[1], dtype=float)
    ratio = np.full((up.size, across.size), np.nan)
    complete = True
    try:
        for row, value in enumerate(up):
            values = {x[0]: across, y[0]: np.full(across.size, value)}
            worst = np.zeros(across.size)
            for item in band:
                fixed = {**(parameters or {}), **item}
                found = contraction(system, section, values, interval, parameters=fixed, points=points)
                worst = np.maximum(worst, np.where(found.lost > 0, np.inf, found.ratio))
            ratio[row] = worst
            if progress is not None:
                progress(row + 1, up.size)
    except KeyboardInterrupt:
        complete = False
    return GainMap((x[0], y[0]), across, up, ratio, complete, axis_labels(system, x[0], y[0]))
