"""Accumulation of events at a finite time: where it leads, from the geometric law of its intervals (E9)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.status import EventKind
from filippov.kernel.loop.event_cycle import CHOSEN, CYCLES, LONGEST_CYCLE, NEAR_END
from filippov.kernel.loop.limit import GLOBAL
from filippov.kernel.loop.segment import IN_TIME
from filippov.kernel.loop.state import Past as PastRecord
from filippov.kernel.tables import codes
from filippov.solving.resets.cycle_powers import of_a_power
from filippov.solving.resets.impact_law import hold
from filippov.solving.state.event_log import Past, looked_at
from filippov.solving.state.rates import off_contact, velocity
from filippov.solving.state.run import Run, guard_terms

LARGEST_CORNER = 6
# Depth of a cycle, in tolerances of h, below which it may shrink by a law of its own.
FAINT = 40.0
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Accumulation:
    """Limit of events that accumulate (clause E9).

    t, x        time and state of the limit, on all surfaces that take part
    error       estimated error of the time; x_error: of the state (largest component)
    ratio       by which the cycles of the solution shrink
    surfaces    numbers of the surfaces that take part
    bend        how far the path to the limit deviates from a straight line, where that is known
    """

    t: float
    x: Array
    error: float
    x_error: float
    ratio: float
    surfaces: tuple[int, ...]
    bend: Array | float = 0.0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Accumulation):
            return NotImplemented
        numbers = [(a.t, a.error, a.x_error, a.ratio, a.surfaces) for a in (self, other)]
        return numbers[0] == numbers[1] and np.array_equal(self.x, other.x)

    __hash__ = None  # type: ignore[assignment]


def accumulation(run: Run) -> Accumulation | None:
    """The limit that the last events point to: t + d r / (1 - r) for cycles d that shrink by the ratio r.

    A cycle is 1 to 6 events of the surface reached last: the fewest whose cycles shrink steadily. State and
    error follow from the same law (`cycle_limit` in `filippov.kernel.loop.event_cycle`) and from its
    prediction one cycle earlier. None where the cycles do not shrink steadily: then there is no accumulation.
    """
    asked = run.events.total, run.t, run.x.tobytes(), run.mode.tobytes(), float(run.clock.relative)
    if run.limit is None or run.limit[0] != asked:
        run.limit = asked, _accumulation(run)
    found: Accumulation | None = run.limit[1]
    return found


def rest_on_contact(run: Run) -> tuple[int, Accumulation | None]:
    """ENTRY where the run has gone to the limit of impacts on one contact, at rest there, with that limit.

    NONE where the last events are no such accumulation, GENERAL where that is to be seen (`rest_in_limit` in
    `filippov.kernel.loop.limit`).
    """
    past = run.events.past(2 * looked_at(len(run.machine.roles)))
    record = cast(type[PastRecord], run.machine.compiled.records["Past"]).new()
    record.refer(
        times=past.t, reached=np.where(past.grazing, -1 - past.surface, past.surface),
        same=np.empty(len(past.t)),
    )  # fmt: skip
    record.count = record.room = len(past.t)
    record.most = looked_at(len(run.machine.roles))
    run.trajectory.refer(past=record)
    before = run.t, run.x.copy()
    code = run.machine.call("rest_in_limit", run=run.trajectory)
    if code != codes.ENTRY:
        return code, None
    i, ratio = int(past.surface[-1]), float(record.law[2])
    limit = Accumulation(
        float(record.t), run.x.copy(), float(record.error), float(record.x_error), ratio, (i,),
        record.bend.copy(),
    )  # fmt: skip
    run.clock.t, run.x[:] = before
    bridge(run, limit)
    run.x[:] = limit.x
    run.taken = run.t, limit.x
    return code, limit


def beyond(run: Run, limit: Accumulation) -> bool:
    """Whether the run is to stop, or something is due, before the limit: by more than that is known to."""
    return (limit.t - float(run.clock.t_end)) * run.direction > limit.error


def sentence(t: float, error: float, x: Array, x_error: float) -> str:
    """What is said of a limit."""
    state = f"state {np.array2string(x, precision=9)} (error about {x_error:.1g})"
    return f"events accumulate at t = {t:.12g} (error about {error:.1g}), {state}."


def lawful(run: Run) -> bool:
    """Whether the last events follow a law that has a limit."""
    return len(run.events) > 0 and _told(run) is not None


class _Told(NamedTuple):
    """The last events, those at the ends of the cycles that tell their law, the surfaces that take part."""

    past: Past
    law: _Law
    ends: npt.NDArray[np.int64]
    part: tuple[int, ...]
    cycle: int


def _told(run: Run) -> _Told | None:
    most = looked_at(len(run.machine.roles))
    past = run.events.past(2 * most)
    same = np.flatnonzero((past.surface == past.surface[-1]) & ~past.grazing)
    times, out = past.t[same], np.zeros(10)
    recent = int(np.count_nonzero(same >= len(past.t) - most))
    steps = GLOBAL if run.clock.relative < 0.0 else 1.0
    found = run.machine.call(
        "cycle_limit", times=times, count=len(same), recent=recent, direction=run.direction,
        start=float(run.clock.t_start), rtol=steps * run.options.rtol, out=out,
    )  # fmt: skip
    if not found:
        return None
    t, error, ratio, last, cycle, sure, latest = out[:7].tolist()
    middle, first = (abs(float(times[-1] - times[-1 - k * int(latest)])) for k in (1, 2))
    part = _taking_part(run, past, most, first, middle)
    ends = same[int(last) :: -int(cycle)][: CYCLES + 1][::-1]
    return _Told(past, _Law(t, error, ratio, sure), ends, part, int(latest))


def _accumulation(run: Run) -> Accumulation | None:
    told = _told(run)
    if told is None or not told.part or of_a_power(run, told.cycle, told.law.ratio):
        return None
    best = _limit(run, told.past.x[told.ends], int(told.past.surface[-1]), told.law, told.part)
    return _at_rest(run, best) if all(run.machine.contacts[i] for i in told.part) else best


def _at_rest(run: Run, limit: Accumulation) -> Accumulation:
    """The limit of impacts on contacts alone: what is left of them acts along the directions of their pushes.

    So it follows from the last state, and keeps what these impacts keep (momentum).
    """
    contacts, mode = list(limit.surfaces), off_contact(run, run.mode)
    mode[contacts] = [float(run.machine.contacts[i]) for i in contacts]
    x, bend = _between_impacts(run, mode, limit.t)
    for _ in range(2):
        h = run.machine.guards(limit.t, x, mode)[contacts]
        if not np.any(h):
            break
        g = run.machine.gradients(limit.t, x, mode)[0][contacts]
        step, *_ = np.linalg.lstsq(g, h, rcond=None)
        x = np.ascontiguousarray(x - step)
    now, run.clock.t = run.t, limit.t
    x = hold(run, x, mode, contacts)
    run.clock.t = now
    speed = float(np.max(np.abs(velocity(run, x, mode)), initial=0.0))
    x_error = float(np.max(run.atol + run.options.rtol * np.abs(x)) + speed * limit.error)
    return replace(limit, x=x, x_error=x_error, bend=bend)


def not_before(run: Run, limit: Accumulation) -> Accumulation:
    """The limit, or the last event where that is later: cycles that only rounding went on with.

    What has moved since then, the surface too, is not where the law puts it: the errors are as large.
    """
    late = (run.t - limit.t) * run.direction
    if late <= limit.error:
        return limit
    x_error = limit.x_error + float(np.max(np.abs(run.x - limit.x)))
    return replace(limit, t=run.t, x=run.x.copy(), error=limit.error + late, x_error=x_error)


def interrupted(run: Run, limit: Accumulation) -> bool:
    """Whether another surface is reached before the limit: then only finitely many of the cycles take place.

    If only impacts remain of the cycles, the path to the limit begins at the state of the run, whose own
    error moves both alike. The error of the law does not excuse a surface on that path: further cycles
    decide.
    """
    impacts = all(run.machine.contacts[i] for i in limit.surfaces)
    others = _others(run, limit)
    return any(h < -CHOSEN * (min(known, rounding) if impacts else known) for _, h, known, rounding in others)


def also_reached(run: Run, limit: Accumulation) -> tuple[int, ...]:
    """Surfaces that take no part in the cycles and on which the limit lies nevertheless, to rounding."""
    others = [other for other in _others(run, limit) if run.machine.widths[other[0]] == 0.0]
    return tuple(i for i, h, _, rounding in others if abs(h) <= CHOSEN * rounding)


def with_approached(run: Run, limit: Accumulation) -> Accumulation:
    """The limit with the contacts beside it that come to rest there too: approached within its error."""
    contacts, found = run.machine.contacts, []
    if not all(contacts[i] for i in limit.surfaces):
        return limit
    for i in also_reached(run, limit):
        if contacts[i]:
            mode, x = off_contact(run, run.mode), np.ascontiguousarray(limit.x)
            mode[i] = 0.0
            rate = contacts[i] * run.direction * float(run.machine.guards(limit.t, x, mode)[i])
            known = float(np.abs(run.machine.gradients(limit.t, x, mode)[0][i]).sum()) * limit.x_error
            found += [i] if -known <= rate < 0.0 else []
    return _at_rest(run, replace(limit, surfaces=(*limit.surfaces, *found))) if found else limit


def _others(run: Run, limit: Accumulation) -> list[tuple[int, float, float, float]]:
    """The surfaces that take no part: guard at the limit, its error, its rounding on the way from the run."""
    mode, x = off_contact(run, run.mode), np.ascontiguousarray(limit.x)
    h = mode * run.machine.guards(limit.t, x, mode) + run.machine.widths
    g, gt = run.machine.gradients(limit.t, x, mode)
    known = np.abs(g).sum(axis=1) * limit.x_error + np.abs(gt) * limit.error
    start = mode * run.machine.guards(run.t, run.x, mode) + run.machine.widths
    length = abs(limit.t - run.t) + EPS * abs(limit.t)
    terms = guard_terms(g, gt, limit.t, x)
    rounding = 16.0 * EPS * (terms + np.abs(h - start) * abs(limit.t) / length)
    others = [i for i in range(run.machine.m) if i not in limit.surfaces and run.mode[i] != 0.0]
    return [(i, float(h[i]), float(known[i]), float(rounding[i])) for i in others]


def _between_impacts(run: Run, mode: Array, t: float) -> tuple[Array, Array]:
    """The state at t if there were no more impacts, and what of it no straight line gives.

    Bodies that come to rest on each other fall all the while: a step of the classical method of order 4.
    """
    now, dt = run.t, t - run.t
    slopes = [velocity(run, run.x, mode)]
    for part in (0.5, 0.5, 1.0):
        run.clock.t = now + part * dt
        slopes.append(velocity(run, np.ascontiguousarray(run.x + part * dt * slopes[-1]), mode))
    run.clock.t = now
    mean = (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3]) / 6.0
    return np.ascontiguousarray(run.x + dt * mean), dt * (mean - slopes[0])


def accumulates(run: Run) -> bool:
    """Whether the last events may be those of an accumulation that the compiled loop did not recognise."""
    back = 2 * LONGEST_CYCLE + 1
    if len(run.events) < back:
        return False
    near = _near_end(run)
    last = run.last_decided()
    if (last is not None and last.kind is EventKind.CROSSING) or _without_contact(run):
        speed, scale, known = _depth(run)
        shallow = run.machine.call("shallow", speed=speed, scale=scale, known=known, length=_interval(run))
        near = np.inf if shallow else near
    if abs(run.t - run.events[-back].t) > near:
        return False
    limit = accumulation(run)
    if limit is None or beyond(run, limit) or abs(limit.t - run.t) > near:
        return False
    return not distant(run, limit) and not interrupted(run, limit)


def bounces_on(run: Run) -> bool:
    """Whether resets without a contact, each onto the surface of the next, have come near their limit.

    The compiled loop counts the cycles of what it decides by itself, not of these.
    """
    return len(run.events) > 0 and _without_contact(run) and accumulates(run)


def _without_contact(run: Run) -> bool:
    """Whether the last event is a reset of a surface on which nothing rests."""
    last, machine = run.last_decided(), run.machine
    if last is None or last.kind is not EventKind.RESET:
        return False
    return last.index < machine.m and not machine.contacts[last.index]


def distant(run: Run, limit: Accumulation) -> bool:
    """Whether the cycles on the way to a limit are large enough to be resolved.

    The intervals of one surface may shrink by chance, when two surfaces are reached in turn. The depth of
    cycles of one event was looked at when they were found to accumulate.
    """
    left = abs(limit.t - run.t)
    cycle = left * (1.0 - limit.ratio) / limit.ratio if 0.0 < limit.ratio < 1.0 else 0.0
    if cycle <= 2.0 * _interval(run):
        return False
    speed, scale, known = _depth(run)
    return bool(
        run.machine.call(
            "distant", t=run.t, start=float(run.clock.t_start), left=left, ratio=limit.ratio, speed=speed,
            scale=scale, known=known,
        )
    )  # fmt: skip


def _interval(run: Run) -> float:
    """The time since the event before of the surface reached last."""
    last = run.events[-1]
    before = next((e for e in reversed(run.events[-4 * LONGEST_CYCLE : -1]) if e.index == last.index), last)
    return abs(last.t - before.t)


def _near_end(run: Run) -> float:
    return max(NEAR_END * abs(run.t - float(run.clock.t_start)), 1e3 * EPS * abs(run.t))


def _depth(run: Run) -> tuple[float, float, float]:
    """Speed of h at the last event, its terms, the depth of a cycle of its own law; (inf, 0, 0) elsewhere."""
    last = run.events[-1]
    # Of impacts at one instant the last may be on a contact that rests, where no cycle is.
    impact = last.kind is EventKind.RESET and last.before[last.index] != 0
    if not (impact or last.kind is EventKind.CROSSING) or last.t != run.t:
        return np.inf, 0.0, 0.0
    mode = np.resize(np.array(last.before, dtype=float), run.machine.m)
    g, gt = run.machine.gradients(run.t, run.x, mode)
    velocity = run.machine.rhs(run.t, run.x, np.where(mode == 0.0, 1.0, mode), mode)
    speed = abs(float(gt[last.index]) + run.machine.rate(last.index, g, velocity))
    scale = float(guard_terms(g, gt, run.t, run.x)[last.index])
    # Of the terms in t what the run has gone through counts, however far the origin of time is.
    gone = min(abs(run.t), abs(run.t - float(run.clock.t_start)))
    known = float(np.abs(g[last.index]) @ (run.options.rtol * np.abs(run.x) + run.atol))
    known += abs(float(gt[last.index])) * (run.options.rtol * gone + IN_TIME * EPS * abs(run.t))
    if run.clock.relative == -float(last.index + 1) or impact:
        known = 0.0
    return speed, scale, FAINT * known


class _Law(NamedTuple):
    """When cycles that shrink by a ratio come to their end, and with which error that is known.

    sure: by how much errors are to be taken for larger
    """

    t: float
    error: float
    ratio: float
    sure: float


def _limit(run: Run, states: Array, last: int, law: _Law, surfaces: tuple[int, ...]) -> Accumulation:
    """The limit of the law with its state, from those at the ends of cycles on the surface reached last."""
    t, error, ratio, sure = law
    x, x_before = (_extrapolated(states[: len(states) - k], ratio) for k in (0, 1))
    on = onto(run, t, x, surfaces)
    known = float(np.max(np.abs(x - x_before) + run.atol + run.options.rtol * np.abs(x)))
    if len(surfaces) > 1 and float(np.max(np.abs(on - x))) > WITHIN * known:
        # Surfaces that do not meet, whose resets lead from one to the other: the limit on the one reached
        # last.
        on = onto(run, t, x, (last,))
    x_error = float(np.max(np.abs(x - x_before) + run.atol + run.options.rtol * np.abs(on)))
    return Accumulation(t, on, sure * error, sure * x_error, ratio, surfaces)


def _taking_part(run: Run, past: Past, most: int, first: float, middle: float) -> tuple[int, ...]:
    """The surfaces reached in both of the last two cycles, which began so long ago.

    What is crossed once on the way has no part in them. most: events that are looked at
    """
    ago = np.abs(past.t[-most:] - past.t[-1]).tolist()
    passed = [(i, d) for i, d in zip(past.surface[-most:].tolist(), ago, strict=True) if run.decides(i)]
    last, before = {i for i, d in passed if d < middle}, {i for i, d in passed if middle <= d < first}
    return tuple(sorted(last & before))


def _extrapolated(states: Array, slowest: float) -> Array:
    """The limit of each component by the ratio of its own last differences (Aitken 1926)."""
    last, earlier = states[-1] - states[-2], states[-2] - states[-3]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.clip(np.nan_to_num(last / earlier, nan=0.0, posinf=0.0, neginf=0.0), -slowest, slowest)
    return np.asarray(states[-1] + last * ratio / (1.0 - ratio))


def onto(run: Run, t: float, x: Array, surfaces: tuple[int, ...]) -> Array:
    """The nearest point on all the surfaces (Gauss-Newton); at rest on those with a contact."""
    chosen = list(surfaces)
    resting = [i for i in surfaces if run.machine.contacts[i]]
    rest_mode = run.mode.copy()
    rest_mode[resting] = 0.0
    for _ in range(4):
        x = np.ascontiguousarray(x)
        h = run.machine.guards(t, x, run.mode)[chosen]
        if resting:
            h = np.append(h, run.machine.guards(t, x, rest_mode)[resting])
        if not np.any(h):
            break
        g = run.machine.gradients(t, x, run.mode)[0][chosen]
        if resting:
            g = np.vstack([g, run.machine.gradients(t, x, rest_mode)[0][resting]])
        # A root that is 0 has no slope; others are known without it.
        step, *_ = np.linalg.lstsq(np.where(np.isfinite(g), g, 0.0), h, rcond=None)
        x = x - step
    return np.ascontiguousarray(x)


def bridge(run: Run, limit: Accumulation) -> None:
    """Go to the limit; the dense output is straight but for its bend, as nothing else is known of it.

    A limit that the law puts before the last event, by less than its error, is that event.
    """
    length = limit.t - run.t
    if length * run.direction > 0.0:
        if run.options.dense_output:
            coef = np.zeros((1, *run.coef.shape[1:]))
            coef[0, 0], coef[0, 1], coef[0, 2] = run.x, limit.x - run.x - limit.bend, limit.bend
            run.steps.append((np.array([[run.t, length]]), coef))
        run.clock.t = limit.t
    run.zeno.array[:] = 0.0


# How far, in errors of the limit's state, the point where the rates vanish may lie from it.
WITHIN = 100.0
NO_INFLUENCE = 1e-9


def second_order(run: Run, limit: Accumulation) -> Array | None:
    """The limit moved to where the rates of its surfaces vanish as well, if no sign acts on these rates.

    Then the solution can stay on a surface only with h = h' = 0 (sliding of second order: super-twisting),
    and the limit is known to its error only. None where a sign acts on a rate, or where the error is too
    small to reach there.
    """
    chosen = [i for i in limit.surfaces if run.machine.roles[i] == "switching"]
    if not 0 < len(chosen) <= LARGEST_CORNER or len(chosen) < len(limit.surfaces):
        return None
    x = limit.x
    for _ in range(4):
        rates, spread = _rates(run, limit.t, x, chosen)
        if spread > NO_INFLUENCE:
            return None
        slopes = []
        for j in range(len(x)):
            moved = x.copy()
            moved[j] += 1e-6 * (1.0 + abs(x[j]))
            slopes.append((_rates(run, limit.t, moved, chosen)[0] - rates) / (moved[j] - x[j]))
        h = run.machine.guards(limit.t, x, _on(run, chosen))[chosen]
        g = run.machine.gradients(limit.t, x, _on(run, chosen))[0][chosen]
        step, *_ = np.linalg.lstsq(np.vstack([g, np.array(slopes).T]), np.append(h, rates), rcond=None)
        x = np.ascontiguousarray(x - step)
    return x if np.max(np.abs(x - limit.x)) <= WITHIN * limit.x_error else None


def _on(run: Run, surfaces: Sequence[int]) -> Array:
    mode = run.mode.copy()
    mode[list(surfaces)] = 0.0
    return mode


def _rates(run: Run, t: float, x: Array, chosen: Sequence[int]) -> tuple[Array, float]:
    """dh/dt of surfaces in the middle of what the signs make of it, and how far the signs move it."""
    mode = _on(run, chosen)
    g, gt = run.machine.gradients(t, x, mode)
    rows, scale = [], 1e-300
    for signs in itertools.product((-1.0, 1.0), repeat=len(chosen)):
        corner = np.where(mode == 0.0, 1.0, mode)
        corner[list(chosen)] = signs
        field = run.machine.rhs(t, x, corner, mode)
        rows.append(g[chosen] @ field + gt[chosen])
        scale = max(scale, float(np.max(np.abs(g[chosen]) @ np.abs(field) + np.abs(gt[chosen]))))
    return np.mean(rows, axis=0), float(np.max(np.ptp(rows, axis=0))) / scale
