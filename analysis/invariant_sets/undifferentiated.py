"""Orbits along which the flow has no derivative, as where impacts accumulate: seen by their returns alone."""

from __future__ import annotations

import numpy as np

from filippov import SolveError, UsageError
from filippov.analysis.invariant_sets.attractor import Attractor, samples_of
from filippov.analysis.invariant_sets.state_map import StateMap
from filippov.analysis.maps.find_section import find_section
from filippov.analysis.maps.returns import returns
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array
from filippov.solving.uncut import solve

# Returns that are looked at; the longest period; parts of the sizes that repeat; displacement of the states
# that have to come back to half of it.
_LOOK, _LONGEST, _REPEATS, _BESIDE = 100, 48, 1e-6, 1e-3


def undifferentiated(flow: StateMap, y: Array, size: Array, why: str) -> Attractor | None:
    """The orbit on which iterates y (k, n) of the map end, in units of the sizes (n,); why: no derivative.

    Its returns have to repeat, and states beside it to come back. None where they do not.
    """
    start, strobe = flow.t0, flow.kind == "strobe"
    rows, t = y[-_LOOK:], start + flow.duration * np.arange(_LOOK)
    try:
        if not strobe:
            section = find_section(flow.system, y[-1], parameters=flow.parameters)
            seen = returns(flow.system, section, y[-1], _LOOK, parameters=flow.parameters)
            rows, t = seen.x, seen.t
        periods = _period(rows / size)
        if periods is None:
            return None
        start = start if strobe else float(t[-1])
        run = solve(
            flow.system, rows[-1], (start, start + float(t[-1] - t[-1 - periods])),
            parameters=flow.parameters, zeno="continue", nonunique="stick", rtol=flow.options["rtol"],
        )  # fmt: skip
    except (SolveError, UsageError):
        return None
    if not run.success:
        return None
    curve = samples_of(run)
    found = Attractor(
        "periodic", rows[-periods:], periods if flow.kind != "step" else None, run.t_end - start,
        low=curve.min(axis=0), high=curve.max(axis=0), curve=None if strobe else curve,
        note=f"no multipliers, but states beside it come back: {why}",
    )  # fmt: skip
    return found if attracts(flow, found, y[-1], size) else None


def _period(rows: Array) -> int | None:
    """The least number of rows after which all of the last ones repeat."""
    for q in range(1, min(_LONGEST, len(rows) // 2) + 1):
        late = rows[-2 * q - len(rows) // 4 :]
        if np.max(np.abs(late[q:] - late[:-q])) <= _REPEATS:
            return q
    return None


def attracts(flow: StateMap, found: Attractor, x: Array, size: Array) -> bool:
    """Whether states on all sides come back, those behind a stop left out."""
    system, aside = flow.system, _BESIDE * np.diag(size)
    here = np.vstack([x + aside, x - aside])
    signs = np.ones((len(here), len(system.surfaces)))
    h = mode_field(system, (1,) * signs.shape[1]).part("h", np.full(len(here), flow.t0), here, signs, flow.p)
    for i, surface in enumerate(system.surfaces):
        if surface.reset is not None and surface.side != "both":
            inside = h[:, i, 0] >= 0.0 if surface.side == "+" else h[:, i, 0] <= 0.0
            here, h = here[inside], h[inside]
    in_turn = flow.kind == "section"
    for _ in range(_LOOK if in_turn else 1):
        ends = flow(here)[1] if in_turn else flow.over(here, _LOOK * flow.duration)
        here = ends.x
        if not flow.done(ends).all():
            return False
    return len(here) >= len(x) and bool(np.all(found.distance(here, size) <= _BESIDE / 2))
