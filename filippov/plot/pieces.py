"""A solution in pieces for pictures: samples of every segment, outputs with gaps where they jump."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.model.signals.samples import Samples
from filippov.solving.reading import values
from filippov.solving.segments import Segment
from filippov.solving.solution import Solution


def pieces_of(solution: Solution, points: int) -> Iterator[tuple[Segment, Array, Array]]:
    """(segment, times, states) along the run, each segment from its first to its last point.

    Where the state jumps within a segment its time stands twice, with the states before and after.
    """
    if points < 2:
        raise UsageError(f"points is {points!r}, expected at least 2.")
    span = abs(solution.t_end - solution.problem.t_span[0]) or 1.0
    jumps = solution.jumps
    for segment in solution.segments:
        if solution.sol is None:
            low, high = sorted((segment.t0, segment.t1))
            inside = (solution.t >= low) & (solution.t <= high)
            yield segment, solution.t[inside], solution.y[:, inside]
            continue
        t = np.linspace(segment.t0, segment.t1, max(8, int(points * segment.dwell / span)))
        low, high = sorted((segment.t0, segment.t1))
        within = jumps[(jumps > low) & (jumps < high)]
        if not within.size:
            yield segment, t, np.column_stack([solution.sol(t[:1], side="+"), solution.sol(t[1:])])
            continue
        t = np.union1d(t, within)[:: 1 if segment.t1 > segment.t0 else -1]
        twice = np.repeat(t, 1 + np.isin(t, within))
        x = solution.sol(twice)
        after = np.append(True, np.diff(twice) == 0)
        x[:, after] = solution.sol(twice[after], side="+")
        yield segment, twice, x


def output_pieces(
    solution: Solution, name: str, pieces: Sequence[tuple[Segment, Array, Array]]
) -> tuple[Array, Array]:
    """Times and values of an output or formula; a gap where it jumps, with a mode or with an input."""
    times: list[Array] = []
    found: list[Array] = []
    for segment, t, x in (part for piece in pieces for part in _parted(solution, *piece)):
        modes = np.tile(np.array(segment.mode, dtype=np.int64), (t.size, 1))
        value = values(solution, name, t, x, modes, "+")
        if solution.system.inputs:
            # A piece may end where a signal jumps, and ends with its value before.
            value[-1:] = values(solution, name, t[-1:], x[:, -1:], modes[-1:], "-")
        if found and value.size and not np.isclose(value[0], found[-1][-1], rtol=1e-6, atol=1e-12):
            times.append(t[:1])
            found.append(np.array([np.nan]))
        times.append(t)
        found.append(value)
    return np.concatenate(times), np.concatenate(found)


def _parted(
    solution: Solution, segment: Segment, t: Array, x: Array
) -> Iterator[tuple[Segment, Array, Array]]:
    """A piece in parts, between the jumps of inputs: one that no surface notices ends no segment."""
    low, high = sorted((segment.t0, segment.t1))
    knots = [_knots(samples, low, high) for samples in solution.system.inputs if samples.kind == "hold"]
    at = np.unique(np.concatenate(knots)) if knots else np.zeros(0)
    at = at[(at > low) & (at < high)][:: 1 if segment.t1 > segment.t0 else -1]
    if not at.size or solution.sol is None:
        yield segment, t, x
        return
    sense = 1.0 if segment.t1 > segment.t0 else -1.0
    for begin, end in pairwise([segment.t0, *at, segment.t1]):
        inside = (sense * (t - begin) > 0) & (sense * (end - t) > 0)
        ends = np.array([begin, end])
        states = np.column_stack([solution.sol(ends[:1], side="+"), x[:, inside], solution.sol(ends[1:])])
        yield segment, np.concatenate([ends[:1], t[inside], ends[1:]]), states


def _knots(samples: Samples, low: float, high: float) -> Array:
    """Where samples that are held change their value, between two times."""
    if samples.period is None:
        return samples.t
    first, last = ((end - samples.t[0]) / samples.period for end in (low, high))
    turns = np.arange(np.floor(first), last + 1)
    return np.asarray(samples.t[None] + samples.period * turns[:, None]).ravel()
