"""Event cycles, from a surface back to it: whether they accumulate, or are too small to be resolved.

A surface on whose rate its own sign does not act (h'' feels it, or a higher derivative) cannot hold the
solution by itself, which circles around h = h' = 0, in ever smaller cycles where it settles there.
"""

from filippov.kernel.language.primitives import Indices, Vector, entry, kernel, seldom, shift
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import G_COLUMN, G_FIRST, NON_LIPSCHITZ, ROLE, WIDTH, N
from filippov.kernel.loop.resolve import NO_EFFECT, side_rates
from filippov.kernel.loop.state import EventCycles, Integers, Scratch, Trajectory
from filippov.kernel.tables.codes import KINK, SWITCHING
from filippov.kernel.tables.layout import EPS

# Shrinking intervals in a row, for each lag: a solution without accumulation hardly ever has as many.
ZENO_STREAK = 6
# A limit that is farther, as a part of the time run, leaves out cycles that are large enough to be resolved.
NEAR_END = 1e-6
# Depth of a cycle, in roundings of h, below which its length soon shows them.
GRAINY = 1e5
# Depth of a cycle, in tolerances of h, below which the run does not resolve it.
FAINT = 10.0
# Length of a cycle that is none, in spacings of t and in the accuracy of its ends.
NO_TIME, UNSURE = 1e4, 1e2
# Events of one surface that a cycle may have, cycles looked at, how steady their ratio is to be.
LONGEST_CYCLE, CYCLES = 6, 4
STEADY, SHRINKING = 0.05, 0.9999
# The limit by the law may change again by as much as it changed in the last cycles, and a little more.
MOVES = 2.0
# The smallest of many estimates of an error is too small by more than a single one is.
CHOSEN = 4.0


@entry
@kernel
def shallow(speed: float, scale: float, known: float, length: float) -> int:
    """Whether a cycle of this length is so shallow that the next ones show rounding of h or its accuracy.

    speed: of h at the event; scale: the terms of h; known: a depth that cannot be distinguished from 0
    """
    return 1 if speed * length <= max(GRAINY * EPS * scale, known) else 0


@kernel
def zeno_horizon(t: float, start: float, x: Vector, i: int, cycles: EventCycles, w: Scratch) -> float:
    """The largest distance of an accumulation: 1e-7 of the time run, any where cycles come near rounding."""
    if shallow(abs(w.end[2 * i + 1]), guard_scale(i, t, x, w), 0.0, abs(t - cycles.last)) != 0:
        return 1e300
    return max(1e-7 * abs(t - start), 1e3 * EPS * abs(t))


@seldom
@entry
@kernel
def distant(
    t: float, start: float, left: float, ratio: float, speed: float, scale: float, known: float
) -> int:  # fmt: skip
    """Whether the cycles on the way to a limit, in the time that is left, are large enough to be resolved.

    The intervals of one surface may shrink by chance, when two surfaces are reached in turn.
    start: of the run; speed, scale, known: as in `shallow`
    """
    cycle = left * (1.0 - ratio) / ratio if 0.0 < ratio < 1.0 else 0.0
    if shallow(speed, scale, known, cycle) != 0:
        return 0
    return 1 if left > CHOSEN * max(NEAR_END * abs(t - start), 1e3 * EPS * abs(t)) else 0


@kernel
def zeno_remaining(cycles: EventCycles, t: float, floor: float) -> float:
    """Time left to the accumulation that shrinking intervals of one surface point to, or -1 without one.

    An interval is compared with the one 1, 2 and 3 events before: a cycle of the solution may reach the
    surface that often.
    """
    interval = abs(t - cycles.last)
    found, total = -1.0, 0.0
    for lag in range(1, 4):
        total += interval if lag == 1 else cycles.interval[lag - 2]
        previous = cycles.interval[lag - 1]
        streak = cycles.streak[lag - 1] + 1.0 if 0.0 < interval < 0.9999 * previous else 0.0
        cycles.streak[lag - 1] = streak
        if found < 0.0 and streak >= ZENO_STREAK + 2 * (lag - 1):
            remaining = total * interval / (previous - interval)
            if remaining < floor:
                found = remaining
    cycles.last = t
    before = cycles.interval
    before[0], before[1], before[2] = interval, before[0], before[1]
    return found


@kernel
def faint(
    t: float, x: Vector, p: Vector, m: Vector, i: int, length: float, time: float, w: Scratch, iw: Integers,
    ctx: Indices,
) -> bool:  # fmt: skip
    """Whether a surface whose sign does not act on its rate is crossed with less speed than the run knows.

    Beyond it lies a cycle that is no deeper than the tolerance, or no longer than the accuracy of its times:
    its rates cannot decide whether the solution goes on circling or has settled on h = h' = 0.
    """
    if ROLE[i] != SWITCHING or WIDTH[i] > 0.0 or m[i] == 0.0:
        return False
    rate = w.end[2 * i + 1]
    if length != 0.0:
        turn = (rate - w.start[2 * i + 1]) / length
        short = abs(rate) <= max(NO_TIME * EPS * abs(t), UNSURE * time) * abs(turn)
        if abs(rate) * abs(rate) > 2.0 * FAINT * w.touch[i] * abs(turn) and not short:
            return False
    code, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
    return code == 0 and abs(plus - minus) <= NO_EFFECT * scale


@kernel
def settling(run: Trajectory, is_faint: bool) -> bool:
    """Whether it is to be asked if the solution has settled: a cycle is faint, and none that is followed.

    Where many faint ones have led on, it is asked at a part of them (`selection.faint_cycles`).
    """
    cycles = run.zeno[run.now.surface]
    if not is_faint or cycles.slow != 0.0:
        cycles.faint, cycles.ask = 0.0, 0.0
        return False
    cycles.faint += 1.0
    return cycles.faint >= cycles.ask


@kernel
def fading(run: Trajectory) -> bool:
    """Whether a kink of a field that is not Lipschitz is reached no faster than the tolerance lets it turn.

    The solution may have come, in finite time, to an equilibrium on the kink, around which rounding circles.
    """
    now, w, i = run.now, run.w, run.now.surface
    if not NON_LIPSCHITZ or ROLE[i] != KINK or now.t_end == now.t:
        return False
    known = run.clock.rtol * guard_scale(i, now.t_end, w.xe, w)
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        known += run.atol[G_COLUMN[a]] * abs(w.g[i * N + G_COLUMN[a]])
    rate = w.end[2 * i + 1]
    turn = (rate - w.start[2 * i + 1]) / (now.t_end - now.t)
    return not (abs(rate) * abs(rate) > 2.0 * FAINT * known * abs(turn))


@seldom
@kernel
def steady_cycle(times: Vector, first: int, last: int) -> int:
    """How many events make a cycle such that the cycles up to event `last` shrink steadily; 0 for none.

    Events are looked at from the first one on.
    """
    for cycle in range(1, LONGEST_CYCLE + 1):
        cycles = min(CYCLES, (last - first) // cycle)
        if cycles < CYCLES - 1:
            return 0
        shortest, slowest, fastest, before = 1e300, -1e300, 1e300, 0.0
        for q in range(cycles):
            end = last - (cycles - 1 - q) * cycle
            length = abs(times[end] - times[end - cycle])
            shortest = min(shortest, length)
            if q > 0:
                ratio = length / before if before > 0.0 else 1e300
                slowest, fastest = max(slowest, ratio), min(fastest, ratio)
            before = length
        if not shortest > 0.0:
            return 0
        # Rounding of the times is visible in the shortest cycles.
        noise, spread = 4.0 * EPS * abs(times[last]) / shortest, slowest - fastest
        steady = spread <= STEADY * (1.0 - slowest) + 4.0 * noise
        if slowest < SHRINKING and (steady or (cycle == 1 and spread <= STEADY)):
            return cycle
    return 0


@seldom
@kernel
def cycle_law(
    times: Vector, first: int, last: int, cycle: int, direction: float, slack: float, out: Vector
) -> None:  # fmt: skip
    """Time of the limit of cycles up to event `last`, its error and the ratio of the cycles, into out.

    The error: the change of the limit over the last cycles, which may agree by chance; rounding of the times,
    which 1 - ratio enlarges; the slack, which is the tolerance of the run.
    """
    cycles = min(CYCLES, (last - first) // cycle)
    ran, before, limit, ratio, moved, earlier = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for q in range(cycles):
        end = last - (cycles - 1 - q) * cycle
        length = abs(times[end] - times[end - cycle])
        ran += length
        if q > 0:
            ratio = length / before
            now = ran + length * ratio / (1.0 - ratio)
            if q > 1:
                earlier, moved = moved, abs(now - limit)
            limit = now
        before = length
    error = MOVES * max(moved, earlier * ratio)
    error += 8.0 * EPS * abs(times[last]) / ((1.0 - ratio) * (1.0 - ratio)) + slack
    out[0] = times[last] + direction * (before * ratio / (1.0 - ratio))
    out[1], out[2] = error, ratio


@seldom
@entry
@kernel
def cycle_limit(
    times: Vector, count: int, recent: int, direction: float, start: float, rtol: float, out: Vector
) -> int:  # fmt: skip
    """The law of the events of one surface (E9), into out; 0 where their cycles do not shrink steadily.

    times  `count` events from the latter half of a history, the last `recent` of them from its latest part
    rtol   the error of a run over its time, `start`: where that began
    out    time of the limit, its error, the ratio; the last event of the cycles that determine it, events per
           cycle; the factor by which errors are increased; events per cycle of the latest ones; and scratch

    Earlier cycles of the same accumulation give the limit where they determine it more accurately: the last
    ones are short and their states small beside the absolute tolerance.
    """
    cycle = steady_cycle(times, count - recent, count - 1)
    if cycle == 0:
        return 0
    other = shift(out, 7)
    cycle_law(times, count - recent, count - 1, cycle, direction, rtol * abs(times[count - 1] - start), out)
    out[3], out[4], out[5], out[6] = float(count - 1), float(cycle), 1.0, float(cycle)
    for last in range(count - 2, CYCLES - 1, -1):
        cycle = steady_cycle(times, 0, last)
        if cycle == 0:
            continue
        cycle_law(times, 0, last, cycle, direction, rtol * abs(times[last] - start), other)
        error, known = CHOSEN * other[1], out[5] * out[1]
        if error < known and abs(other[0] - out[0]) <= 2.0 * (error + known):
            out[0], out[1], out[2] = other[0], other[1], other[2]
            out[3], out[4], out[5] = float(last), float(cycle), CHOSEN
    return 1
