"""Accumulation of events at a finite time: where it leads, from the geometric law of its intervals (E9)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from filippov.base.status import EventKind
from filippov.solving.resets.impact_law import hold
from filippov.solving.state.events import Event
from filippov.solving.state.machine import Array
from filippov.solving.state.rates import off_contact, velocity
from filippov.solving.state.run import Run, guard_terms

LARGEST_CORNER = 6
NEAR_REST = 1e-7


# Events of one surface that a lap of the motion may have, laps looked at, how steady their ratio is to be.
LONGEST_LAP, LAPS = 6, 4
STEADY = 0.05
SLOWEST = 0.9999
# Errors of the many steps of a rough field, in tolerances of one.
GLOBAL = 4.0
# The law's answers may move again by as much as they moved in the last laps, and a little more.
MOVES = 2.0
# The least of many estimates of an error is too small by more than one of them is.
CHOSEN = 4.0
NEAR_END = 1e-6
# Depth of a lap, in roundings of h, below which its length soon shows them.
GRAINY = 1e5
# The same in tolerances of h: laps as small as these may shrink by a law of their own.
FAINT = 40.0
# Of a power law: least number of events, and how much shorter each half of them is to be than the one before.
LEAST_EVENTS, HALVES = 512, 0.9
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Accumulation:
    """Limit of events that accumulate (clause E9).

    t, x        time and state of the limit, on all surfaces that take part
    error       estimated error of the time; x_error: of the state (largest component)
    ratio       by which the laps of the motion shrink
    surfaces    numbers of the surfaces that take part
    bend        how far the way there falls from a straight one, where that is known
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
    """The limit that the last events point to: t + d r / (1 - r) for laps d that shrink by the ratio r.

    A lap is 1 to 6 events of the surface met last: the fewest whose laps shrink steadily. State and error:
    from the same law, and from what it said a lap before. None where the laps do not shrink steadily: then
    there is no accumulation. Earlier laps of the same accumulation give the limit where they know it better:
    the last ones are short and their states small beside the absolute tolerance.
    """
    most = (LONGEST_LAP * LAPS + 1) * max(len(run.machine.roles), 1)
    last = run.events[-1].index
    recent = run.events[-most:]
    ends = _steady([e for e in recent if e.index == last and e.kind is not EventKind.GRAZING])
    if ends is None:
        return None
    part = _taking_part(run, recent, ends)
    law, sure = _law(run, ends), 1.0
    earlier = [e for e in run.events[-2 * most :] if e.index == last and e.kind is not EventKind.GRAZING]
    for length in range(len(earlier) - 1, LAPS, -1):
        found = _steady(earlier[:length])
        if found is None:
            continue
        other = _law(run, found)
        error = CHOSEN * other.error
        if error < sure * law.error and abs(other.t - law.t) <= 2.0 * (error + sure * law.error):
            ends, law, sure = found, other, CHOSEN
    best = _limit(run, ends, law, part, sure)
    if all(run.machine.contacts[i] for i in part):
        return _at_rest(run, best)
    return best


def _at_rest(run: Run, limit: Accumulation) -> Accumulation:
    """The limit of impacts on contacts alone: what is left of them acts along the directions of their pushes.

    So it follows from the last state, and keeps what these impacts keep (momentum).
    """
    contacts, mode = list(limit.surfaces), off_contact(run, run.mode)
    mode[contacts] = [float(run.machine.contacts[i]) for i in contacts]
    x, bend = _between_impacts(run, mode, limit.t)
    for _ in range(2):
        h = run.machine.guards(limit.t, x, mode)[contacts]
        g = run.machine.gradients(limit.t, x, mode)[0][contacts]
        step, *_ = np.linalg.lstsq(g, h, rcond=None)
        x = np.ascontiguousarray(x - step)
    now, run.clock.t = run.t, limit.t
    x = hold(run, x, mode, contacts)
    run.clock.t = now
    speed = float(np.max(np.abs(velocity(run, x, mode)), initial=0.0))
    x_error = float(np.max(run.atol + run.options.rtol * np.abs(x)) + speed * limit.error)
    return replace(limit, x=x, x_error=x_error, bend=bend)


def interrupted(run: Run, limit: Accumulation) -> bool:
    """Whether another surface is reached before the limit: then only finitely many of the laps take place.

    Where all that is left of the laps are impacts, the way to the limit begins at the state of the run, whose
    own error moves both alike. The law's error does not excuse what lies on that way: further laps tell.
    """
    mode, x = off_contact(run, run.mode), np.ascontiguousarray(limit.x)
    h = mode * run.machine.guards(limit.t, x, mode) + run.machine.widths
    g, gt = run.machine.gradients(limit.t, x, mode)
    known = np.abs(g).sum(axis=1) * limit.x_error + np.abs(gt) * limit.error
    if all(run.machine.contacts[i] for i in limit.surfaces):
        start = mode * run.machine.guards(run.t, run.x, mode) + run.machine.widths
        length = abs(limit.t - run.t) + EPS * abs(limit.t)
        terms = guard_terms(g, gt, limit.t, x)
        known = np.minimum(known, 16.0 * EPS * (terms + np.abs(h - start) * abs(limit.t) / length))
    others = [i for i in range(run.machine.m) if i not in limit.surfaces and run.mode[i] != 0.0]
    return any(h[i] < -CHOSEN * known[i] for i in others)


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


def _steady(same: Sequence[Event]) -> list[Event] | None:
    """The ends of the last laps of these events, where the laps shrink steadily."""
    for lap in range(1, LONGEST_LAP + 1):
        ends = list(same[::-1][::lap][: LAPS + 1][::-1])
        if len(ends) < LAPS:
            return None
        laps = _laps(ends)
        if not min(laps) > 0.0:
            return None
        # Rounding of the times shows in the shortest laps.
        noise = 4 * EPS * abs(ends[-1].t) / min(laps)
        ratios = [after / before for before, after in itertools.pairwise(laps)]
        slowest, spread = max(ratios), max(ratios) - min(ratios)
        steady = spread <= STEADY * (1.0 - slowest) + 4 * noise
        if slowest < SLOWEST and (steady or (lap == 1 and spread <= STEADY)):
            return ends
    return None


def _laps(ends: Sequence[Event]) -> list[float]:
    return [abs(after.t - before.t) for before, after in itertools.pairwise(ends)]


def accumulates(run: Run) -> bool:
    """Whether the last events may be those of an accumulation that the compiled loop did not recognise."""
    back = 2 * LONGEST_LAP + 1
    if len(run.events) < back:
        return False
    elapsed = abs(run.t - float(run.clock.t_start))
    near = np.inf if _grainy(run) else NEAR_END * elapsed
    if abs(run.t - run.events[-back].t) > near:
        return False
    limit = accumulation(run)
    return limit is not None and abs(limit.t - run.t) <= near and not interrupted(run, limit)


def _grainy(run: Run) -> bool:
    """Whether the last lap is so shallow that the next ones show the rounding of h or its tolerance."""
    last = run.events[-1]
    if last.kind is not EventKind.CROSSING or last.t != run.t:
        return False
    before = next((e for e in reversed(run.events[-4 * LONGEST_LAP : -1]) if e.index == last.index), last)
    mode = np.resize(np.array(last.before, dtype=float), run.machine.m)
    g, gt = run.machine.gradients(run.t, run.x, mode)
    velocity = run.machine.rhs(run.t, run.x, np.where(mode == 0.0, 1.0, mode), mode)
    speed = abs(float(gt[last.index]) + run.machine.rate(last.index, g, velocity))
    scale = float(np.sum(np.abs(g[last.index] * run.x)) + abs(gt[last.index] * run.t))
    known = run.options.rtol * scale + float(np.abs(g[last.index]) @ run.atol)
    if run.clock.relative == -float(last.index + 1):
        known = 0.0
    return speed * abs(last.t - before.t) <= max(GRAINY * EPS * scale, FAINT * known)


def power_law(run: Run) -> Accumulation | None:
    """The limit of events whose intervals shrink by a power of their number, as between closing walls.

    Then t_n = t - c n**-k: the last half of the events took 2**-k of the time that the half before took.
    None where three such halvings do not agree.
    """
    times, _ = run.events.table()
    n = len(times)
    if n < LEAST_EVENTS or n < run.events.total:
        return None
    spans = np.abs(np.diff(times[[n // 16, n // 8, n // 4, n // 2, n - 1]]))
    if not np.all(spans > 0):
        return None
    ratios = spans[1:] / spans[:-1]
    if np.max(ratios) >= HALVES or np.ptp(ratios) > STEADY:
        return None
    rest = spans[1:] * ratios / (1.0 - ratios)
    limits = np.cumsum(spans)[1:] + rest
    error = float(abs(limits[-1] - limits[-2]))
    t = float(times[-1] + run.direction * rest[-1])
    part = tuple(sorted({event.index for event in run.events[-64:]}))
    return Accumulation(t, run.x.copy(), error, float(np.max(np.abs(run.x), initial=0.0)), 1.0, part)


class _Law(NamedTuple):
    """When laps that shrink by a ratio come to their end, and with which error that is known."""

    t: float
    error: float
    ratio: float


def _law(run: Run, ends: Sequence[Event]) -> _Law:
    laps, last = _laps(ends), ends[-1].t
    ratios = [after / before for before, after in itertools.pairwise(laps)]
    ratio = ratios[-1]
    ran = list(itertools.accumulate(laps))[1:]
    limits = [s + d * r / (1.0 - r) for s, d, r in zip(ran, laps[1:], ratios, strict=True)]
    moves = [abs(after - before) for before, after in itertools.pairwise(limits)]
    # By how much the law's answer moved in the last lap, which may agree by chance; rounding of the times,
    # which 1 - r enlarges; the tolerance of the run.
    error = MOVES * max(move * ratio**k for k, move in enumerate(reversed(moves)))
    error += 8 * EPS * abs(last) / (1.0 - ratio) ** 2
    steps = GLOBAL if run.clock.relative < 0.0 else 1.0
    error += steps * run.options.rtol * abs(last - float(run.clock.t_start))
    return _Law(last + run.direction * (laps[-1] * ratio / (1.0 - ratio)), error, ratio)


def _limit(
    run: Run, ends: Sequence[Event], law: _Law, surfaces: tuple[int, ...], sure: float
) -> Accumulation:
    """The limit of the law with its state; `sure`: by how much its errors are to be taken for larger."""
    states, (t, error, ratio) = [event.x for event in ends], law
    x, x_before = (_extrapolated(states[: len(states) - k], ratio) for k in (0, 1))
    on = onto(run, t, x, surfaces)
    known = float(np.max(np.abs(x - x_before) + run.atol + run.options.rtol * np.abs(x)))
    if len(surfaces) > 1 and float(np.max(np.abs(on - x))) > WITHIN * known:
        # Surfaces that do not meet, whose resets lead from one to the other: the limit on the one met last.
        on = onto(run, t, x, (ends[-1].index,))
    x_error = float(np.max(np.abs(x - x_before) + run.atol + run.options.rtol * np.abs(on)))
    return Accumulation(t, on, sure * error, sure * x_error, ratio, surfaces)


def _taking_part(run: Run, recent: Sequence[Event], ends: Sequence[Event]) -> tuple[int, ...]:
    """The surfaces met in both of the last two laps: what is crossed once on the way has no part in them."""
    first, middle = (abs(ends[-1].t - ends[k].t) for k in (-3, -2))
    ago = [(e.index, abs(e.t - ends[-1].t)) for e in recent if run.machine.roles[e.index] != "observer"]
    last, before = {i for i, d in ago if d < middle}, {i for i, d in ago if middle <= d < first}
    return tuple(sorted(last & before))


def _extrapolated(states: list[Array], slowest: float) -> Array:
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
        g, _ = run.machine.gradients(t, x, run.mode)
        if resting:
            h = np.append(h, run.machine.guards(t, x, rest_mode)[resting])
            g = np.vstack([g[chosen], run.machine.gradients(t, x, rest_mode)[0][resting]])
        else:
            g = g[chosen]
        step, *_ = np.linalg.lstsq(g, h, rcond=None)
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


SAMPLES = 16
# How far, in errors of the limit's state, the point where the rates vanish may lie from it.
WITHIN = 100.0
NO_INFLUENCE = 1e-9


def second_order(run: Run, limit: Accumulation) -> Array | None:
    """The limit moved to where the rates of its surfaces vanish as well, if no sign acts on these rates.

    Then the motion can stay on a surface only with h = h' = 0 (sliding of second order: super-twisting), and
    the limit is known to its error only. None where a sign acts on a rate, or where the error is too small to
    reach there.
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


def holds_still(velocities: Array) -> bool:
    """Whether 0 is a convex combination of velocities, one a row."""
    from scipy.optimize import nnls

    if not np.all(np.isfinite(velocities)):
        return False
    size = float(np.max(np.abs(velocities))) + 1e-300
    combination = np.vstack([velocities.T / size, np.ones(len(velocities))])
    _, gap = nnls(combination, np.append(np.zeros(velocities.shape[1]), 1.0))
    return bool(gap <= NEAR_REST)


def rests(run: Run, surfaces: Sequence[int]) -> bool:
    """Whether 0 is among the velocities of the inclusion at this point, now and until the end of the run.

    Where the signs do not act on the surfaces to first order (twisting, Fuller's problem) no multipliers
    follow from staying on them; a state at which 0 is a convex combination of the vertex fields is a
    solution all the same.
    """
    switching = [i for i in surfaces if run.machine.roles[i] == "switching"]
    if not 0 < len(switching) <= LARGEST_CORNER:
        return False
    mode = run.mode.copy()
    mode[list(surfaces)] = 0.0
    for t in np.linspace(run.t, float(run.clock.t_end), SAMPLES):
        h = np.abs(run.machine.guards(float(t), run.x, mode))[switching]
        fields = []
        for signs in itertools.product((-1.0, 1.0), repeat=len(switching)):
            corner = np.where(mode == 0.0, 1.0, mode)
            corner[switching] = signs
            fields.append(run.machine.rhs(float(t), run.x, corner, mode))
        if not holds_still(np.array(fields)) or np.any(h > NEAR_REST * (1.0 + np.max(np.abs(run.x)))):
            return False
    return True


def rest(run: Run, surfaces: Sequence[int]) -> None:
    """Stay where the run is until its end: every switching surface of the limit is slid on, nothing moves."""
    before = run.signs
    for i in surfaces:
        if run.machine.roles[i] == "switching":
            run.mode[i] = 0.0
    after, together = run.signs, False
    for i in surfaces:
        if before[i] != after[i]:
            x, note = run.x.copy(), "rest in the limit"
            run.add_event(run.t, i, EventKind.ENTRY, before, after, x, float("nan"), 0.0, note, together)
            together = True
    end = float(run.clock.t_end)
    if run.options.dense_output:
        coef = np.zeros((1, *run.coef.shape[1:]))
        coef[0, 0] = run.x
        run.steps.append((np.array([[run.t, end - run.t]]), coef))
    run.clock.t = end
