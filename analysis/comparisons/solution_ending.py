"""How a solution ends, and what is wrong in kind where an approximation of it ends otherwise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from filippov.solving.solution import Solution

Array = npt.NDArray[np.float64]
SAMPLES = 4001
# Of the extents: what rests moves by no more in the last twentieth of the span; a cycle by more in the last
# quarter, and as much as in the one before but for a share CHANGES of it.
RESTS, SMALLEST, CHANGES = 1e-9, 1e-6, 0.05
# Kinds differ where their measures do, by this factor, not where both are beside a limit.
CLEARLY = 2.0
# The way of what goes back and forth over the width that it takes.
TO_AND_FRO = 1.5
# Of the extents: what ends further away ends elsewhere.
ELSEWHERE = 0.1


@dataclass(frozen=True)
class Ending:
    """How a solution ends.

    kind               "rest", "cycle" or "motion"
    amplitude, period  of a cycle, else None
    state              the place of the state that moves most
    moved, speed       over the last twentieth of the span, over the extents: largest way, net speed
    chatter            half of `moved` where it is back and forth, else None
    decays             whether the second half of that time has less than half of the way of the first
    change             of the amplitude from the last but one quarter to the last, over the larger; inf of
                       what does not go up and down; NaN where a quarter is shorter than a period
    low, high          each state's least and largest value in the last quarter
    """

    kind: str
    amplitude: float | None
    period: float | None
    state: int
    moved: float
    speed: float
    chatter: float | None
    decays: bool
    change: float
    low: Array
    high: Array


def ending(solution: Solution, count: int, extent: Array) -> Ending:
    """How a solution ends; count, extent: states of the exact system and how far each moves.

    A cycle: over each of the last two quarters of the span the state that moves most has the same amplitude
    (to 5 %) and goes up through its middle twice at least, a period within a quarter of the span. Rest: the
    last twentieth moves by no more than 1e-9 of `extent`.
    """
    sol, (t0, t1) = solution.sol, (solution.problem.t_span[0], solution.t_end)
    assert sol is not None
    t = np.linspace(t0, t1, SAMPLES)
    x = sol(t)[:count]
    parts = x[:, -200:], x[:, -1000:], x[:, -2000:-1000]
    last, now, before = (np.ptp(part, axis=1) / extent for part in parts)
    moved, state = float(np.max(last)), int(np.argmax(last))
    net = abs(float(x[state, -1] - x[state, -200])) / float(extent[state])
    path = float(np.sum(np.abs(np.diff(x[state, -200:])))) / float(extent[state])
    first, second = (float(np.max(np.ptp(part, axis=1) / extent)) for part in (x[:, -200:-100], x[:, -100:]))
    k = int(np.argmax(now))
    size, earlier = float(now[k]), float(before[k])
    tail = x[k, -2000:]
    middle = 0.5 * (float(np.max(tail)) + float(np.min(tail)))
    above = tail > middle
    ups = np.flatnonzero(~above[:-1] & above[1:])
    cyclic = ups.size >= 2 and size >= SMALLEST
    change = abs(size - earlier) / max(size, earlier) if cyclic else np.inf
    downs = np.count_nonzero(above[:-1] & ~above[1:])
    short = ups[-1] - ups[0] > 1000 * (ups.size - 1) if cyclic else ups.size == 1 and downs > 0
    change = np.nan if short else change
    kind = "rest" if moved <= RESTS else "cycle" if change <= CHANGES else "motion"
    amplitude = period = None
    if kind == "cycle":
        begun, final = (
            float(brentq(lambda q: float(sol(q)[k]) - middle, t[i - 2000], t[i - 1999], xtol=1e-14))
            for i in (ups[0], ups[-1])
        )
        amplitude, period = 0.5 * size * float(extent[k]), (final - begun) / (ups.size - 1)
    return Ending(
        kind, amplitude, period, k if kind == "cycle" else state, moved, net / (0.05 * abs(t1 - t0)),
        0.5 * moved if path > TO_AND_FRO * moved else None, second < 0.5 * first, change,
        np.min(x[:, -1000:], axis=1), np.max(x[:, -1000:], axis=1),
    )  # fmt: skip


def faults(
    row: Mapping[str, Any], now: Ending | None, exact: Mapping[str, Any], was: Ending,
    surfaces: Sequence[str], states: Sequence[str], extent: Array,
) -> list[str]:  # fmt: skip
    """What is wrong in kind of the narrowest run of a model, one sentence each.

    row, now    the run of the model and how it ends; exact, was: the same of the exact solution
    """
    where = f"{row['model']} at width {row['width']:.3g}"
    if now is None:
        return [f"{where}: {row['note']}."]
    out = []
    for surface, have, want in zip(surfaces, row["entries"], exact["entries"], strict=True):
        if have is not None and have != want:
            what = "loses" if have < want else "invents"
            out.append(
                f"{where} {what} stick on {surface!r}: {have} entries into it, where the exact solution has "
                f"{want}."
            )
    said = _other_kind(now, was, states) or _elsewhere(now, was, states, extent)
    return out + ([f"{where} {said}"] if said else [])


def _other_kind(now: Ending, was: Ending, states: Sequence[str]) -> str:
    """Empty for one kind, where both lie beside the limit of two, or where the other comes to rest too."""
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
