"""Which surfaces of a program are corners: across them the field was found continuous, wherever compared.

A field may jump in a narrow part of a surface only, as one that switches where |v| < 0.01 and |u| < 0.3. Such
a part ends where another surface crosses this one, so places beside these lines are compared as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from filippov.analysis.algebra.linalg import lstsq, pinv
from filippov.analysis.programs.agreement import BESIDE, NEAR, OUTSIDE, Numbers, crossed, spread_of
from filippov.analysis.programs.translation import Translation
from filippov.solving.solution import Solution

Array = npt.NDArray[np.float64]
# What a continuous field differs by falls at least so much where the distance falls by 100.
FALLS = 0.1
# Where two surfaces meet: starts for each pair, steps of Newton, and how far from there the places lie.
STARTS, NEWTON, ASIDE = 4, 30, 1e-3
# A difference of the two sides on a surface itself, over the size of the field.
DIFFERS = 1e-9


def continuous(translation: Translation, t: Array, y: Array) -> set[int]:
    """Surfaces across which the field was found continuous, at all places where it was compared.

    Across a corner what it differs by between two places falls with their distance, across a jump it stays.
    """
    numbers = Numbers(translation.system)
    found: dict[int, bool] = {}
    for i, along, root in crossed(numbers, translation, t, y, 0):
        pairs = [
            [(when, translation.extended(when, where)) for when, where in (along(root - d), along(root + d))]
            for d in (100 * BESIDE, BESIDE)
        ]
        falls = _falls(numbers, pairs)
        if falls is not None:
            found[i] = found.get(i, True) and falls
    corners = {i for i, always in found.items() if always}
    for i in sorted(corners):
        if any(_falls(numbers, pairs) is False for pairs in _beside_others(numbers, translation, i, t, y)):
            corners.discard(i)
    return corners


def jumped(translation: Translation, solution: Solution) -> set[int]:
    """Surfaces at which the solution has seen the field jump: by its modes around an event, or sliding."""
    numbers = Numbers(translation.system)
    surfaces = translation.system.surfaces
    seen: list[tuple[int, float, Array, Array, Array]] = []
    for e in solution.events:
        before, after = (np.array(mode, dtype=float) for mode in (e.before, e.after))
        changed = np.flatnonzero(before != after)
        if len(changed) == 1 and before[changed[0]] * after[changed[0]] < 0:
            seen.append((int(changed[0]), e.t, np.asarray(e.x), before, after))
    for segment in solution.segments:
        middle = 0.5 * (segment.t0 + segment.t1)
        for i in np.flatnonzero(np.array(segment.mode) == 0).tolist():
            if segment.t1 > segment.t0 and solution.sol is not None:
                one, other = (np.array(segment.mode, dtype=float) for _ in range(2))
                one[i], other[i] = 1.0, -1.0
                seen.append((i, middle, np.asarray(solution.sol(middle)), one, other))
    out = set()
    for i, t, x, one, other in seen:
        if i in out or surfaces[i].kind == "kink":
            continue
        with np.errstate(all="ignore"), suppress(*OUTSIDE):
            a, b = numbers.field(t, x, one), numbers.field(t, x, other)
            if np.max(np.abs(a - b)) > DIFFERS * (1.0 + np.max(np.abs(a))):
                out.add(i)
    return out


_Pairs = list[list[tuple[float, Array]]]


def _falls(numbers: Numbers, pairs: _Pairs) -> bool | None:
    """Whether what the field differs by between two places falls with their distance; None without values."""
    gaps = []
    with np.errstate(all="ignore"):
        for one, other in pairs:
            try:
                a, b = numbers.field(*one), numbers.field(*other)
            except OUTSIDE:
                return None
            gaps.append(float(np.max(np.abs(b - a)) / (1.0 + np.max(np.abs(a)))))
    if not np.all(np.isfinite(gaps)):
        return None
    return gaps[1] < FALLS * gaps[0] or gaps[1] < NEAR


def _beside_others(
    numbers: Numbers, translation: Translation, i: int, t: Array, y: Array
) -> Iterator[_Pairs]:
    """Two pairs of places across the i-th surface, on each side of the others where they cross it."""
    rng, spread = np.random.default_rng(i + 2), spread_of(y)

    def heights(when: float, where: Array, j: int) -> Array:
        h = numbers.h(when, translation.extended(when, where))
        return h[[i, j]]

    def slopes(when: float, where: Array, j: int) -> Array:
        """d(h_i, h_j) by the states, in units of their spread."""
        steps = 1e-7 * np.diag(spread)
        ends = [(heights(when, where + q, j) - heights(when, where - q, j)) / 2e-7 for q in steps]
        return np.array(ends).T

    others = [j for j, q in enumerate(translation.system.surfaces) if j != i and q.kind != "kink"]
    for j in others:
        for _ in range(STARTS):
            k = int(rng.integers(len(t)))
            when, where = float(t[k]), y[:, k] + rng.normal(size=len(y)) * spread
            with np.errstate(all="ignore"), suppress(*OUTSIDE, np.linalg.LinAlgError):
                met = False
                for _ in range(NEWTON):
                    h, rows = heights(when, where, j), slopes(when, where, j)
                    if not np.all(np.isfinite(rows)):
                        break
                    met = bool(np.all(np.abs(h) <= 1e-9 * (1e-300 + np.linalg.norm(rows, axis=1))))
                    if met or np.linalg.matrix_rank(rows, 1e-6 * np.max(np.abs(rows))) < 2:
                        break
                    where = where - lstsq(rows, h, rcond=1e-9)[0] * spread
                if not met:
                    continue
                across, along = pinv(rows).T
                across, along = across / np.linalg.norm(across), along / np.linalg.norm(along)
                for side in (1.0, -1.0):
                    place = where + side * ASIDE * along * spread
                    # Back onto the i-th surface.
                    for _ in range(3):
                        h, rows = heights(when, place, j), slopes(when, place, j)
                        place = place - h[0] / float(rows[0] @ across) * across * spread
                    yield [
                        [(when, translation.extended(when, place + d * across * spread)) for d in (-q, q)]
                        for q in (1e-2 * ASIDE, 1e-4 * ASIDE)
                    ]
