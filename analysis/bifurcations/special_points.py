"""Names of special points, by a test function's change of sign or by a change of the word.

Changes of the sequence of modes of an orbit are named by the short segment that appears or vanishes between
its neighbours a -> z -> b on a surface (di Bernardo et al. 2008):

    + 0 +   grazing-sliding: a solution off the surface touches it where it attracts
    + 0 -   crossing-sliding: a crossing reaches the border of sliding
    + - 0   switching-sliding: the entry into sliding crosses its border, and the solution crosses first
    0 + 0   adding-sliding: sliding touches the border of sliding
    + - +   C-bifurcation: grazing of a surface that is crossed (also of one where the field is continuous)
            or where the state jumps
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.orbits.orbit import Orbit
from filippov.solving.state.events import Mode

_MOST_REMOVED = 6


def segments_of(orbit: Orbit) -> list[tuple[Mode, float]]:
    """(mode, duration) over one period, equal neighbours joined, the last with the first."""
    out: list[tuple[Mode, float]] = []
    for solution in orbit.solutions or (orbit.solution(),):
        for segment in solution.segments:
            if out and out[-1][0] == segment.mode:
                out[-1] = (segment.mode, out[-1][1] + segment.dwell)
            else:
                out.append((segment.mode, segment.dwell))
    if len(out) > 1 and out[0][0] == out[-1][0]:
        out[0] = (out[0][0], out[0][1] + out.pop()[1])
    return out


def name_of_change(before: Orbit, after: Orbit) -> tuple[str, str, str]:
    """(name, surface, note) of the change of the mode word between two orbits close to it."""
    jumps = [[s for s, kind, _, _ in orbit.signature if kind == "reset"] for orbit in (before, after)]
    if len(jumps[0]) != len(jumps[1]):
        surface = (jumps[0] or jumps[1])[0]
        return "C-bifurcation", surface, f"{len(jumps[0])} -> {len(jumps[1])} resets"
    long, short = sorted((segments_of(before), segments_of(after)), key=len, reverse=True)
    names = [surface.name for surface in before.system.surfaces]
    goal = [mode for mode, _ in short]
    rest, first = list(long), None
    for _ in range(_MOST_REMOVED):
        if _same_cycle([mode for mode, _ in rest], goal) or len(rest) < 2:
            break
        k = int(np.argmin([duration for _, duration in rest]))
        triple = rest[k - 1][0], rest[k][0], rest[(k + 1) % len(rest)][0]
        first = first or triple
        rest = _without(rest, k)
    if first is None or not _same_cycle([mode for mode, _ in rest], goal):
        return "change of the mode word", "", f"{before.word} -> {after.word}"
    a, z, b = first
    i = next(j for j in range(len(names)) if z[j] != a[j] or z[j] != b[j])
    return _named(a[i], z[i], b[i]), names[i], f"{before.word} -> {after.word}"


def _named(a: int, z: int, b: int) -> str:
    if z == 0:
        return "grazing-sliding" if a == b else "crossing-sliding"
    if a == 0 and b == 0:
        return "adding-sliding"
    if 0 in (a, b):
        return "switching-sliding"
    return "C-bifurcation"


def _without(items: list[tuple[Mode, float]], k: int) -> list[tuple[Mode, float]]:
    """The cycle without its k-th segment, neighbours that are then equal joined."""
    rest = [*items[k + 1 :], *items[:k]]
    if len(rest) > 1 and rest[0][0] == rest[-1][0]:
        rest[0] = (rest[0][0], rest[0][1] + rest.pop()[1])
    return rest


def _same_cycle(a: Sequence[Any], b: Sequence[Any]) -> bool:
    items = list(b)
    return len(a) == len(b) and any(list(a) == items[k:] + items[:k] for k in range(max(len(b), 1)))


# A change of sign counts only where the multipliers at the point found confirm it.
def confirmed(name: str, point: BranchPoint, kind: str) -> bool:
    """Whether the point has the property of its name: a pair on the unit circle, a multiplier at -1, ...

    kind  of the branch: the equations of an orbit also turn back where its cycle leaves the plane of the
          phase condition, and no multiplier is 1 there
    """
    values = np.array(point.multipliers, dtype=complex)
    if name == "fold" and kind == "orbit" and values.size:
        return bool(np.any(np.abs(values - 1.0) < 1e-2))
    if name == "Neimark-Sacker":
        return bool(np.any((np.abs(np.abs(values) - 1.0) < 1e-4) & (np.abs(values.imag) > 1e-6)))
    if name == "period doubling":
        return bool(np.any(np.abs(values + 1.0) < 1e-3))
    if name == "Hopf":
        # Fast eigenvalues beside the pair leave it their rounding.
        rounding = 1e-12 * np.max(np.abs(values), initial=0.0)
        size = np.abs(values.imag)
        return bool(np.any((np.abs(values.real) < 1e-4 * size + rounding) & (size > 1e4 * rounding)))
    return True
