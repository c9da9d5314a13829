"""Basins of attraction in a plane of initial states, through the event map.

Every state is followed to the first event of a section; from there the one-dimensional map decides, and its
basins are intervals between unstable fixed points. So a state costs one return, however long it takes to
approach its attractor. States that do not reach the section within t_max are labelled separately.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import Problem, Status, Sweep, System, UsageError
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.first_return import MOST_STEPS
from filippov.analysis.maps.map_units import map_units
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array
from filippov.base.given import Amount, Axis, Count, Interval, Positive, Values
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.shown import Told
from filippov.plot.style import axis_labels, coordinate_labels
from filippov.solving.uncut import solve_many

CHUNK = 20_000
UNKNOWN, OUTSIDE, LOST = -1, -2, -3


@dataclass(frozen=True)
class Basin(Told):
    """Labels over a plane of initial states, shape (len(y), len(x)).

    names       of the two states; x, y: their values; at: the others
    label       number of the attractor in `attractors`; -1 not computed or to none found, -2 the first event
                lies outside the interval, -3 no event within t_max
    attractors  coordinates on the section, 0 for the set of equilibria; of a cycle with several points the
                largest
    d           coordinate of the first event, NaN without one
    complete    False where the computation was interrupted
    parameters  values by name; labels: of the axes and of d, with units
    """

    _also = ("shares",)
    _untold = ("x", "y", "label", "d")

    names: tuple[str, str]
    x: Array
    y: Array
    at: dict[str, float]
    label: npt.NDArray[np.int64]
    attractors: tuple[float, ...]
    d: Array
    complete: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def shares(self) -> dict[str, float]:
        """Share of the plane that goes to each attractor, by its coordinate as text."""
        names = {UNKNOWN: "unknown", OUTSIDE: "outside the interval", LOST: "no event"}
        out = {}
        for label, count in zip(*np.unique(self.label, return_counts=True), strict=True):
            name = names.get(int(label)) or f"{self.attractors[int(label)]:.9g}"
            out[name] = float(count) / self.label.size
        return out

    def __str__(self) -> str:
        shares = self.shares.items()
        return "\n".join(f"{100 * share:.4g} % of the states go to {name}" for name, share in shares)

    def to_dict(self) -> dict[str, Any]:
        """What it is and the shares, without the arrays."""
        return super().to_dict() | {"shape": list(self.label.shape)}


@keywords()
def basin(
    system: System,
    section: Section,
    x: Axis,
    y: Axis,
    interval: Interval,
    *,
    at: Values | None = None,
    parameters: Mapping[str, float] | None = None,
    order: Count = 2,
    points: Amount = 400,
    rtol: Positive = 1e-8,
    threads: Count | None = None,
    engine: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Basin:
    """Basins over two states; `at` gives the others (default 0).

    x, y      (name, values) of the states
    interval  (lo, hi) of the section's coordinate in which attractors are searched
    order     iterate of the map whose fixed points are the attractors; points: of that search
    engine    keywords of `filippov.sweep.run.run`, such as {"folder": ..., "jobs": 8, "resume": True}: the
              states are followed by worker processes and kept in the folder; None: here, by threads
    progress  called with (states done, states)

    Ctrl-C returns what is done. Raises UsageError.
    """
    others = dict(at or {})
    for name in (x[0], y[0], *others):
        if name not in system.states:
            raise UsageError(unknown("state", name, system.states))
    if x[0] == y[0] or {x[0], y[0]} & others.keys():
        raise UsageError(
            f"the axes are {x[0]!r} and {y[0]!r}, held are {', '.join(others) or 'none'}: expected two "
            "states, and others in `at`."
        )
    event_map = EventMap(system, section, parameters=parameters, order=order)
    # The interval tells the units.
    unit = map_units(event_map, max(*interval, key=abs)).size
    place, surface = event_map.bound.index, event_map.bound.surface
    pieces = event_map.basins(*interval, points)
    found_at = [p.attractor for p in pieces if p.attractor is not None]
    cycle_of = {d: _largest(event_map, d, pieces) for d in found_at}
    attractors = tuple(dict.fromkeys(cycle_of.values()))
    across, up = np.asarray(x[1], dtype=float), np.asarray(y[1], dtype=float)
    states = np.zeros((up.size * across.size, system.dimension))
    for name, value in others.items():
        states[:, system.state_index(name)] = value
    states[:, system.state_index(x[0])] = np.tile(across, up.size)
    states[:, system.state_index(y[0])] = np.repeat(up, across.size)
    d = np.full(len(states), np.nan)
    label = np.full(len(states), UNKNOWN)
    complete = True
    if engine is not None:
        d, rest_at, complete = _by_engine(event_map, states, rtol, unit, engine, progress)
        known = ~np.isnan(rest_at)
        label[known] = _labels(d[known], rest_at[known] == 1, pieces, cycle_of, attractors)
    try:
        for first in range(0, 0 if engine is not None else len(states), CHUNK):
            part = slice(first, first + CHUNK)
            ends = solve_many(
                system, states[part], (0.0, section.t_max), stop=section.stop,
                parameters=event_map.parameters, rtol=rtol, atol=1e-3 * rtol * unit, max_steps=MOST_STEPS,
                threads=threads,
            )  # fmt: skip
            back = np.array([status is Status.STOPPED for status in ends.status])
            done = np.array([status is Status.SUCCESS for status in ends.status])
            rest = done & (ends.mode[:, surface] == 0)
            found = np.where(back | rest, ends.x[:, place], np.nan)
            d[part] = found
            label[part] = _labels(found, rest, pieces, cycle_of, attractors)
            if progress is not None:
                progress(min(first + CHUNK, len(states)), len(states))
    except KeyboardInterrupt:
        complete = False
    shape = (up.size, across.size)
    rest_of = {name: others.get(name, 0.0) for name in system.states if name not in (x[0], y[0])}
    return Basin(
        (x[0], y[0]), across, up, rest_of, label.reshape(shape), attractors, d.reshape(shape), complete,
        system.parameters.others(parameters),
        axis_labels(system, x[0], y[0]) | coordinate_labels(system, section),
    )  # fmt: skip


def _by_engine(
    event_map: EventMap, states: Array, rtol: float, unit: Array, engine: Mapping[str, Any],
    progress: Callable[[int, int], None] | None,
) -> tuple[Array, Array, bool]:
    """Coordinates of first events, whether the solution rests there (NaN: not computed), and completeness."""
    section, system = event_map.section, event_map.system
    problem = Problem(system, states[0], (0.0, section.t_max), event_map.parameters)
    measure = (f"end({section.coordinate})", f"mode({section.surface})")
    sweep = Sweep(
        problem, {f"x0.{name}": states[:, k] for k, name in enumerate(system.states)}, "list",
        measure=measure, stop=section.stop, rtol=rtol, atol=1e-3 * rtol * unit, max_steps=MOST_STEPS,
    )  # fmt: skip
    table = sweep.run(**engine, progress=progress)
    status = np.array(table.status)
    rest = np.where(table.known, (status == Status.SUCCESS) & (table[measure[1]] == 0), np.nan)
    d = np.where((status == Status.STOPPED) | (rest == 1), table[measure[0]], np.nan)
    return d, rest, table.complete


def _largest(event_map: EventMap, d: float, pieces: Sequence[Any]) -> float:
    """The largest coordinate of the cycle that a fixed point of the iterate belongs to, to 9 digits.

    Its other points are fixed points too: those to whose basins its images belong.
    """
    points = [d]
    for image in [] if d == 0.0 else event_map.remake(order=1).iterate(d, event_map.order - 1).tolist()[1:]:
        known = [q.attractor for q in pieces if q.lo <= image <= q.hi and q.attractor is not None]
        points.append(known[0] if known else image)
    return float(f"{max(points):.9g}")


def _labels(
    d: Array, rest: npt.NDArray[np.bool_], pieces: Sequence[Any], cycle_of: Mapping[float, float],
    attractors: tuple[float, ...],
) -> npt.NDArray[np.int64]:  # fmt: skip
    edges = np.array([pieces[0].lo, *(piece.hi for piece in pieces)])
    number = np.searchsorted(edges, np.nan_to_num(d, nan=np.inf), side="right") - 1
    of_piece = [UNKNOWN if p.attractor is None else attractors.index(cycle_of[p.attractor]) for p in pieces]
    table = np.array([OUTSIDE, *of_piece, OUTSIDE])
    label = table[np.clip(number, -1, len(pieces)) + 1]
    # A solution that stays on the section is at rest: with the set of rests that it lies in, known by its end
    # next to 0, else with the set of equilibria at 0, where that is an attractor.
    own = [p.attractor in (p.lo, p.hi) or (p.attractor == 0.0 and p.lo <= 0.0 <= p.hi) for p in pieces]
    among = np.array([False, *own, False])[np.clip(number, -1, len(pieces)) + 1]
    label[rest & ~among] = attractors.index(0.0) if 0.0 in attractors else UNKNOWN
    label[np.isnan(d)] = LOST
    return np.asarray(label, dtype=np.int64)
