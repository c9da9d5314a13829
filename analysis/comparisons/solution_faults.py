"""What is wrong in kind with an approximation of a solution, one sentence each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from filippov.analysis.comparisons.band_model import Stay
from filippov.analysis.comparisons.solution_ending import CHANGES, RESTS, Ending
from filippov.analysis.comparisons.solution_events import Read
from filippov.base.arrays import Array

# Kinds differ where their measures do, by this factor, not where both are beside a limit.
CLEARLY = 2.0
# Of the extents: what ends further away ends elsewhere; what is everywhere nearer has the cycle of the other.
ELSEWHERE, SAME = 0.1, 0.02
# Sticks that follow each other evenly, less than this factor oftener, are those of another period.
OFTENER = 1.25
# Of the longer one: stays this near to each other are one, where all together last longer than that.
BESIDE = 0.5


class Seen(NamedTuple):
    """A run: its row, how it ends, what was read of it on each surface, and its last time."""

    row: Mapping[str, Any]
    ending: Ending
    reads: Sequence[Read]
    t_end: float


def faults(runs: Sequence[Seen], exact: Seen, states: Sequence[str], extent: Array) -> list[str]:
    """What is wrong in kind of a model, at the narrowest of the widths at which it is wrong so.

    runs    those of the model that came to the end, from the widest on
    """
    out: dict[str, str] = {}
    for k, run in enumerate(reversed(runs)):
        for kind, said in _of_run(run, exact, states, extent):
            where = f"{run.row['model']} at width {run.row['width']:.3g}"
            out.setdefault(kind, f"{where} {said}{' At narrower ones it does not.' if k else ''}")
    return list(out.values())


def _of_run(run: Seen, exact: Seen, states: Sequence[str], extent: Array) -> list[tuple[str, str]]:
    """(kind, sentence) of one run."""
    out = []
    sticks = None not in run.row["entries"]  # bristles have none
    for mine, theirs in zip(exact.reads, run.reads, strict=True):
        want, have = (len(_entries(read)) for read in (mine, theirs))
        least = max(mine.least, theirs.least)
        told = {sum(stay.t1 - stay.t0 > least or stay.to_end for stay in read.stays if not stay.from_start)
                for read in (mine, theirs)}  # fmt: skip
        if not sticks or have == want or len(told) == 1 or _alike(mine, theirs, run, exact):
            continue
        what = "loses" if have < want else "invents"
        counts = f"{have} entries into it, where the exact solution has {want}"
        said = f"{what} stick on {mine.surface!r}: {counts}."
        out.append((f"{what} {mine.surface}", said))
    near = run.row["error_state"] <= SAME
    said = _other_kind(run.ending, exact.ending, states, near)
    said = said or ("" if near else _elsewhere(run.ending, exact.ending, states, extent))
    return [*out, *([("ending", said)] if said else [])]


def _entries(read: Read) -> list[float]:
    return [stay.t0 for stay in read.stays if not stay.from_start]


def _alike(mine: Read, theirs: Read, run: Seen, exact: Seen) -> bool:
    """Whether the same sticks are counted otherwise: cut or joined, or in cycles of another period."""
    pairs = ((mine.stays, theirs.stays), (theirs.stays, mine.stays))
    as_long = min(mine.time, theirs.time) > BESIDE * max(mine.time, theirs.time)
    if as_long and all(any(_beside(a, b) for b in others) for these, others in pairs for a in these):
        return True
    gaps = [np.diff(_entries(read)[-3:]) for read in (mine, theirs)]
    steady = all(gap.size == 2 and np.ptp(gap) <= CHANGES * np.max(gap) for gap in gaps)
    if steady and abs(np.log(np.mean(gaps[0]) / np.mean(gaps[1]))) < np.log(OFTENER):
        return True
    cycles = [(read, seen) for read, seen in ((mine, exact), (theirs, run)) if seen.ending.period]
    if len(cycles) < len(pairs):
        return False
    first, second = (_each_period(read, seen) for read, seen in cycles)
    return first == second


def _beside(a: Stay, b: Stay) -> bool:
    apart = max(a.t0, b.t0) - min(a.t1, b.t1)
    return apart <= BESIDE * max(a.t1 - a.t0, b.t1 - b.t0)


def _each_period(read: Read, seen: Seen) -> float:
    """Entries in a period of the cycle at the end: the median over eight places of the period."""
    period = seen.ending.period
    assert period is not None
    times = np.array(_entries(read))
    ends = seen.t_end - period * np.arange(8) / 8
    return float(np.median([np.count_nonzero((times > end - period) & (times <= end)) for end in ends]))


def _other_kind(now: Ending, was: Ending, states: Sequence[str], near: bool) -> str:
    """Empty for one kind, where both lie beside the limit of two, or where the other comes to rest too.

    near    whether the states are the same but for SAME: then a cycle is neither lost nor invented
    """
    if now.kind == was.kind or ("rest" in (was.kind, now.kind) and (was.decays or now.decays)):
        return ""
    if was.kind == "rest" and now.moved > CLEARLY * max(was.moved, RESTS):
        name = states[now.state]
        return f"loses the rest state: where the exact solution rests, {name} " + (
            f"goes on in a cycle of amplitude {now.amplitude:.3g}." if now.kind == "cycle"
            else f"goes back and forth within {now.chatter:.2g} of its extent." if now.chatter
            else f"creeps on at {now.speed:.2g} of its extent in a unit of time."
        )  # fmt: skip
    if now.kind == "rest" and was.moved > CLEARLY * max(now.moved, RESTS):
        return "invents a state of rest: the exact solution goes on."
    if near:
        return ""
    if was.kind == "cycle" and now.change > CLEARLY * CHANGES:
        return f"loses the cycle of amplitude {was.amplitude:.4g}."
    if now.kind == "cycle" and was.change > CLEARLY * CHANGES:
        return f"invents a cycle of amplitude {now.amplitude:.4g}: the exact solution has none."
    return ""


def _elsewhere(now: Ending, was: Ending, states: Sequence[str], extent: Array) -> str:
    """Another state of rest, or another cycle: the start lies in another basin."""
    if was.kind == "motion":
        return ""
    gaps = np.maximum(abs(now.low - was.low), abs(now.high - was.high)) / extent
    k = int(np.argmax(gaps))
    if gaps[k] <= ELSEWHERE:
        return ""
    name = states[k]
    if was.kind == "rest":
        return (
            f"goes to another state of rest: {name} = {now.high[k]:.4g}, where the exact solution rests at "
            f"{was.high[k]:.4g}."
        )
    return (
        f"goes into another cycle: {name} from {now.low[k]:.4g} to {now.high[k]:.4g}, where the exact "
        f"solution goes from {was.low[k]:.4g} to {was.high[k]:.4g}."
    )
