"""The first return of many solutions to a section: from their starts to its next event."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import Solution, Status, UsageError, solve, solve_many
from filippov.analysis.maps.section import BoundSection
from filippov.analysis.steady.forcing import depends_on_time
from filippov.base.arrays import Array
from filippov.solving.uncut import whole as uncut

# A return takes tens of steps; a solution that takes this many does not come back.
MOST_STEPS = 200_000
# Events of the section's kind that may pass before one leads into the mode that is wanted.
MOST_EVENTS = 200


def first_returns(
    bound: BoundSection, x0: Array, parameters: Mapping[str, Any], **options: Any
) -> tuple[Array, list[Status], npt.NDArray[np.bool_]]:
    """State (k, n) at each solution's next event of the section, how it ended, whether it rests there.

    parameters: numbers or rows (k,) by name. STOPPED: the event came; SUCCESS: not within t_max.
    """
    section, system = bound.section, bound.system
    run = {"stop": section.stop, "max_steps": MOST_STEPS, **options}
    if not section.after:
        ends = uncut(solve_many(system, x0, (0.0, section.t_max), parameters=parameters, **run))
        return ends.x, list(ends.status), np.any(ends.mode[:, bound.surfaces] == 0, axis=1)
    _autonomous(bound)
    x, status = x0.copy(), [Status.SUCCESS] * len(x0)
    resting = np.zeros(len(x0), dtype=bool)
    spent = np.zeros(len(x0))
    # A start that is none (NaN) goes nowhere.
    open_rows = np.flatnonzero(np.all(np.isfinite(x0), axis=1))
    for _ in range(MOST_EVENTS):
        if not open_rows.size:
            break
        rows = {name: v[open_rows] if np.ndim(v) else v for name, v in parameters.items()}
        ends = uncut(solve_many(system, x[open_rows], (0.0, section.t_max), parameters=rows, **run))
        x[open_rows] = ends.x
        spent[open_rows] += ends.t
        goes_on = np.zeros(open_rows.size, dtype=bool)
        for place, (k, ended) in enumerate(zip(open_rows.tolist(), ends.status, strict=True)):
            resting[k] = bool(np.any(ends.mode[place, bound.surfaces] == 0))
            back = ended is Status.STOPPED and bound.wanted(ends.mode[place])
            goes_on[place] = ended is Status.STOPPED and not back and spent[k] < section.t_max
            status[k] = Status.SUCCESS if ended is Status.STOPPED and not back else ended
        open_rows = open_rows[goes_on]
    return x, status, resting


def first_return(bound: BoundSection, x0: Array, parameters: Mapping[str, float], **options: Any) -> Solution:
    """The solution up to its return; its last event is the section's where its status is STOPPED."""
    section, system = bound.section, bound.system
    run: dict[str, Any] = {"parameters": parameters, "max_steps": MOST_STEPS, **options}

    def whole(**end: Any) -> Solution:
        ended: Solution = uncut(solve(system, x0, (0.0, section.t_max), **{**run, **end}))
        return ended

    if not section.after:
        return whole(stop=section.stop)
    _autonomous(bound)
    counts = dict.fromkeys(section.surfaces, 0)
    x, left = x0, section.t_max
    for _ in range(MOST_EVENTS):
        part = uncut(solve(system, x, (0.0, left), stop=section.stop, **run))
        x, left = part.x_end, left - part.t_end
        if part.status is not Status.STOPPED:
            break
        for event in part.events:
            if event.surface in counts and section.kind.startswith(str(event.kind)):
                counts[event.surface] += 1
        if bound.wanted(part.end_mode):
            last = bound.ending(part.events).surface
            stop = section.stops[section.surfaces.index(last)].counted(counts[last])
            return whole(stop=stop)
        if left <= 0:
            break
    return whole()


def _autonomous(bound: BoundSection) -> None:
    if depends_on_time(bound.system):
        raise UsageError(
            f"the section asks for mode {bound.section.after!r} after its event; that is for systems that do "
            "not depend on time."
        )
