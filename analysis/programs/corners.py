"""Which surfaces of a program are corners: across them the field was found continuous, wherever compared.

A field may jump in a narrow part of a surface only, as one that switches where |v| < 0.01 and |u| < 0.3. Such
a part ends where another surface crosses this one, so places beside these lines are compared as well; where
time alone decides, at times between its instants.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from scipy.optimize import brentq

from filippov.analysis.algebra.linalg import lstsq, pinv
from filippov.analysis.programs.agreement import BESIDE, NEAR, OUTSIDE, Numbers, crossed, spread_of
from filippov.analysis.programs.translation import Translation
from filippov.base.arrays import Array
from filippov.solving.solution import Solution

# What a continuous field differs by falls at least so much where the distance falls by 100.
FALLS = 0.1
# Where two surfaces meet: starts for each pair, steps of Newton, and how far from there the places lie.
STARTS, NEWTON, ASIDE = 4, 30, 1e-3
# Times at which instants of surfaces of time are looked for, between how many of these, and lines at each.
GRID, MOST_TIMES, TURNS = 2000, 12, 4
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
    times = _between_instants(numbers, translation, t, y)
    for i in sorted(corners):
        more = itertools.chain(
            _beside_others(numbers, translation, i, t, y), _at_times(numbers, translation, i, times, t, y)
        )
        if any(_falls(numbers, pairs) is False for pairs in more):
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


def _between_instants(numbers: Numbers, translation: Translation, t: Array, y: Array) -> Array:
    """Times, one between each two instants at which surfaces of time alone are passed; empty without such."""
    grid = np.linspace(t[0], t[-1], GRID)
    spread, instants = spread_of(y), [grid[0], grid[-1]]
    with np.errstate(all="ignore"), suppress(*OUTSIDE):
        ends = [
            np.array([numbers.h(float(q), translation.extended(float(q), where)) for q in grid])
            for where in (y[:, 0], y[:, -1] + 0.37 * spread)
        ]
        for one, other in zip(ends[0].T, ends[1].T, strict=True):
            if np.array_equal(one, other):
                turned = np.flatnonzero(np.diff(np.sign(one)))
                instants += [float(grid[k]) for k in turned] + [float(grid[k + 1]) for k in turned]
    if len(instants) == 2:
        return np.zeros(0)
    found = np.unique(instants)
    middles = 0.5 * (found[1:] + found[:-1])
    return np.asarray(middles[np.unique(np.linspace(0, len(middles) - 1, MOST_TIMES).astype(int))])


def _at_times(
    numbers: Numbers, translation: Translation, i: int, times: Array, t: Array, y: Array
) -> Iterator[_Pairs]:
    """Two pairs of places across the i-th surface at each of some times."""
    rng, spread = np.random.default_rng(i + 3), spread_of(y)
    steps = np.linspace(-2.0, 2.0, 24)
    for when in times.tolist():
        start = np.array([np.interp(when, t, row) for row in y])
        for _ in range(TURNS):
            turn = rng.normal(size=len(y)) * spread

            def height(s: float, when: float = when, start: Array = start, turn: Array = turn) -> float:
                return float(numbers.h(when, translation.extended(when, start + s * turn))[i])

            with np.errstate(all="ignore"), suppress(*OUTSIDE):
                heights = [height(float(s)) for s in steps]
                for k in [k for k, (a, b) in enumerate(itertools.pairwise(heights)) if a * b < 0][:1]:
                    root = float(brentq(height, steps[k], steps[k + 1]))
                    yield [
                        [(when, translation.extended(when, start + (root + d) * turn)) for d in (-q, q)]
                        for q in (100 * BESIDE, BESIDE)
                    ]
