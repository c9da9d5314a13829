"""Laps of a motion that comes back to a surface: whether they pile up, or are too small to be told from none.

A surface on whose rate its own sign does not act (h'' feels it, or a higher derivative) cannot hold the
motion by itself; the motion circles around h = h' = 0, in ever smaller laps where it settles there.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel
from filippov.kernel.loop.land import EPS, guard_scale
from filippov.kernel.loop.model import ROLE, WIDTH
from filippov.kernel.loop.resolve import NO_EFFECT, side_rates
from filippov.kernel.loop.state import Integers, Laps, Scratch
from filippov.kernel.tables.codes import SWITCHING

# Intervals in a row that shrink, for each lag: what a motion that is no accumulation hardly ever does.
ZENO_STREAK = 6
# Depth of a lap, in roundings of h, below which its length soon shows them.
GRAINY = 1e5
# Depth of a lap, in tolerances of h, below which the run does not know it.
FAINT = 10.0
# Length of a lap that is none, in spacings of t and in the accuracy of its ends.
NO_TIME, UNSURE = 1e4, 1e2


@kernel
def zeno_horizon(t: float, start: float, x: Vector, i: int, laps: Laps, w: Scratch) -> float:
    """How near an accumulation has to be: 1e-7 of the time run, or any distance where laps near rounding."""
    if abs(w.end[2 * i + 1] * (t - laps.last)) <= GRAINY * EPS * guard_scale(i, t, x, w):
        return 1e300
    return max(1e-7 * abs(t - start), 1e3 * EPS * abs(t))


@kernel
def zeno_remaining(laps: Laps, t: float, floor: float) -> float:
    """Time left to the accumulation that shrinking intervals of one surface point to, or -1 without one.

    An interval is compared with the one 1, 2 and 3 events before: a lap of the motion may meet the surface
    that often.
    """
    interval = abs(t - laps.last)
    found, total = -1.0, 0.0
    for lag in range(1, 4):
        total += interval if lag == 1 else laps.interval[lag - 2]
        previous = laps.interval[lag - 1]
        streak = laps.streak[lag - 1] + 1.0 if 0.0 < interval < 0.9999 * previous else 0.0
        laps.streak[lag - 1] = streak
        if found < 0.0 and streak >= ZENO_STREAK + 2 * (lag - 1):
            remaining = total * interval / (previous - interval)
            if remaining < floor:
                found = remaining
    laps.last = t
    laps.interval[0], laps.interval[1], laps.interval[2] = interval, laps.interval[0], laps.interval[1]
    return found


@kernel
def faint(
    t: float, x: Vector, p: Vector, m: Vector, i: int, length: float, time: float, w: Scratch, iw: Integers,
    ctx: Indices,
) -> bool:  # fmt: skip
    """Whether a surface whose sign does not act on its rate is crossed with less speed than the run knows.

    What lies beyond it is a lap no deeper than the tolerance, or no longer than its times are known: whether
    the motion goes on circling, or has settled on h = h' = 0, is not for its rates to say.
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
