"""How far an orbit is from another sequence of events: distances from surfaces, speed at events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from filippov import EventKind, Solution
from filippov.analysis.sensitivity.saltation import Together
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array
from filippov.solving.segments import Segment

_PER_STEP = 6
_MET = ("switching", "reset")


@dataclass(frozen=True)
class Margin:
    """Margins of a periodic solution.

    distance        least distance |h|/|grad h| from a surface where the solution turns back without reaching
                    it (inf if it never does); surface: its name; t: when
    sliding         least distance of a sliding multiplier from an end of its set where it turns back from it
                    (inf where it nowhere does); sliding_surface, sliding_t
    transversality  least speed with which a surface is reached or left, relative to |G_y| |v|: 0 at grazing
                    and where a crossing reaches the border of sliding; transversal_t: when
    """

    distance: float = float("inf")
    surface: str = ""
    t: float = float("nan")
    sliding: float = float("inf")
    sliding_surface: str = ""
    sliding_t: float = float("nan")
    transversality: float = float("inf")
    transversal_t: float = float("nan")


def margin(solutions: Sequence[Solution], jacobian: Callable[..., Any] | None = None) -> Margin:
    """The margins along solutions that make up one period."""
    off: list[tuple[float, str, float, float]] = []
    on: list[tuple[float, str, float, float]] = []
    speed: list[tuple[float, float]] = []
    for solution in solutions:
        for segment in solution.segments:
            off += _turns(solution, segment, False, jacobian)
            on += _turns(solution, segment, True, jacobian)
        speed += _speeds(solution, jacobian)
    least = min(off, default=(float("inf"), "", float("nan")))[:3]
    slide = min(on, default=(float("inf"), "", float("nan")))[:3]
    slow = min(speed, default=(float("inf"), float("nan")))
    return Margin(*least, *slide, *slow)


def nearest_pass(
    solutions: Sequence[Solution], jacobian: Callable[..., Any] | None = None
) -> tuple[float, float, str]:
    """(share, distance, surface) of the nearest pass by a surface without reaching it; share inf for none.

    The share is that of the largest distance from the surface in the same segment, whatever the units are.
    """
    passes = [
        (share, distance, surface)
        for solution in solutions
        for segment in solution.segments
        for distance, surface, _, share in _turns(solution, segment, False, jacobian)
    ]
    return min(passes, default=(float("inf"), float("inf"), ""))


def _turns(
    solution: Solution, segment: Segment, sliding: bool, jacobian: Callable[..., Any] | None
) -> list[tuple[float, str, float, float]]:
    """(distance, surface, t, distance over the largest) where a segment is nearest to a surface, or a
    multiplier to an end of its set, and turns back."""
    system, sol = solution.problem.system, solution.sol
    assert sol is not None
    wanted = [
        i for i, surface in enumerate(system.surfaces)
        if surface.kind != "observer" and (segment.mode[i] == 0) == sliding
    ]  # fmt: skip
    inside = sol.start[(sol.start > segment.t0) & (sol.start < segment.t1)]
    knots = np.concatenate(([segment.t0], inside, [segment.t1]))
    if not wanted or segment.dwell == 0:
        return []
    times = np.append(
        (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(_PER_STEP) / _PER_STEP).ravel(), knots[-1]
    )
    # Not the ends themselves: there the dense output may belong to another mode. First steps may be shorter.
    near = 1e-9 * segment.dwell
    times = np.unique(np.clip(times, segment.t0 + near, segment.t1 - near))

    def distances(t: Array) -> Array:
        return _distances(solution, segment.mode, wanted, t, sliding, jacobian)

    values = distances(times)
    out = []
    for column, i in enumerate(wanted):
        row = values[:, column]
        middle = np.flatnonzero((row[1:-1] <= row[:-2]) & (row[1:-1] < row[2:])) + 1
        for k in middle.tolist():
            best = minimize_scalar(
                lambda t, c=column: float(distances(np.array([t]))[0, c]),
                bounds=(float(times[k - 1]), float(times[k + 1])), method="bounded",
                options={"xatol": 1e-10 * segment.dwell},
            )  # fmt: skip
            # A state that jumps on the surface meets it, and stays in its mode.
            events = solution.events.of(system.surfaces[i].name).t
            if not np.any(np.abs(events - best.x) < 1e-6 * segment.dwell):
                least = min(float(best.fun), float(row[k]))
                share = least / (float(np.max(row)) or 1.0)
                out.append((least, system.surfaces[i].name, float(best.x), share))
    return out


def _distances(
    solution: Solution, mode: tuple[int, ...], wanted: list[int], t: Array, sliding: bool,
    jacobian: Callable[..., Any] | None,
) -> Array:  # fmt: skip
    """Distance from each wanted surface, or of its multiplier from the nearer end: (k, wanted)."""
    system, p, sol = solution.problem.system, solution.problem.p, solution.sol
    assert sol is not None
    part = mode_field(system, mode, (), jacobian)
    x = np.ascontiguousarray(np.atleast_2d(sol(t).T))
    s = part.multipliers(t, x, p)
    if sliding:
        radius = part.part("radius", t, x, s, p)[:, wanted]
        value = s[:, wanted]
        return np.asarray(np.minimum(radius[:, :, 1] - value, value - radius[:, :, 0]))
    h = part.part("h", t, x, s, p)[:, wanted, 0]
    slope = part.part("hy", t, x, s, p)[:, wanted, : system.dimension]
    widths = np.array([system.surfaces[i].width * mode[i] for i in wanted])
    return np.asarray(np.abs(h + widths) / np.maximum(np.linalg.norm(slope, axis=2), 1e-300))


def _speeds(solution: Solution, jacobian: Callable[..., Any] | None) -> list[tuple[float, float]]:
    """(relative speed, t) with which each surface is reached, and left where it is left off the surface."""
    out = []
    surfaces = solution.problem.system.surfaces
    groups = [list(group) for _, group in groupby(solution.events, key=lambda event: event.group)]
    for event, together in ((event, group) for group in groups for event in group):
        if event.index >= len(surfaces) or surfaces[event.index].kind not in _MET:
            continue
        if event.kind is EventKind.GRAZING:
            out.append((0.0, event.t))
            continue
        if event.kind is EventKind.EXIT and not Together(solution, together, (), jacobian).leads(event):
            continue
        here = Together(solution, [event], (), jacobian)
        i = event.index
        side = 1 if event.after[i] > 0 else -1
        checks = [(event.before, here.guard(event.before, i, side))]
        if event.kind is EventKind.CROSSING:
            checks.append((event.after, here.guard(event.after, i, side)))
        for mode, slope in checks:
            velocity = here.velocity(mode)
            size = float(np.linalg.norm(slope) * np.linalg.norm(velocity))
            out.append((abs(float(slope @ velocity)) / size if size else 0.0, event.t))
    return out
