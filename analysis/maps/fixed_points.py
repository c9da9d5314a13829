"""Fixed points, jumps and basins of an event map on an interval.

Roots of R(d) - d are bracketed on a grid that is dense near 0 as well, and beside an equilibrium set at 0 on
one that is even in log d down to rounding. Several between two points of the grid are separated by the
slopes of R(d) - d there, and each is solved for at a tight tolerance (`filippov.analysis.maps.gap_roots`).
Where the solution of a coordinate rests for ever, R(d) = d is no cycle: such coordinates are sets of rests.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from filippov import Status, UsageError
from filippov.analysis.algebra.growth import ACCURACY, Growth, by_excess, by_multipliers
from filippov.analysis.maps.gap_roots import NOISE, Gap, Samples, brackets, coordinates, roots, split
from filippov.analysis.maps.map_units import finer, map_units
from filippov.analysis.maps.set_slope import equilibrium_slope, near_set
from filippov.analysis.sensitivity.saltation import NotDifferentiableError
from filippov.base.arrays import Array, Whole
from filippov.base.shown import Told

if TYPE_CHECKING:
    from filippov.analysis.maps.scalar_map import ScalarMap

TIGHT, CLOSEST = 1e-12, 1e-5
# Halvings between the coarse grid and the smallest coordinate, a decade in about three.
PER_DECADE = 6
_SAME = 1e-6
# Halvings of what lies between two coordinates that go elsewhere.
_HALVINGS = 45
# Iterates that come nearer to a stable fixed point one after the other, before it counts as reached.
NEARER = 60
# What rounding may leave of R(d) - d, in units of the smallest coordinate that it leaves.
_NOISE = 1e-2
# A map is looked at so far beside an interval of rests, in parts of the larger end or of the interval.
_BESIDE = 1e-8
# A state that changes by less than this part of its size has not moved.
_STILL, _ASIDE = 1e-9, 1e-2
# Jumps below this part of the interval are none.
_LEAST = 1e-9
# Where a map may jump, its slope is so many times the spread of those of so many cells beside it off them.
_BESIDES, _FARTHER = 4, 2.0
# Parts of the width of such a set at which it is seen whether solutions beside it come nearer.
_REACH = 1e-4


@dataclass(frozen=True)
class FixedPoint(Told):
    """A fixed point of a map.

    d         coordinate; residual: |R(d) - d| there
    rests     the ends of the interval of coordinates that a set fills; d is 0 where that lies in it, else the
              end next to 0. None where it is one coordinate, as a cycle is
    kind      "equilibrium set" where the solution rests, else "limit cycle"
    slope     dR/dd (from saltation matrices), NaN where the map has none; at an equilibrium set the limit of
              R(d)/d for d -> 0+, which is infinite where the map jumps at the set; beside an interval of
              rests the part of the distance from it that is left after a return, NaN where none comes back
    verdict   "stable" for |slope| < 1, "unstable" for > 1, "undecided" where it is 1 within its error or
              not known; stable: the verdict is "stable"
    period    time of the returns together, 0 for an equilibrium set
    hidden    of an equilibrium set: a cycle of the other stability lies between it and this coordinate, too
              near to the set for the rounding of its states; 0 where none is known to
    note      what is special
    """

    _also = ("stable",)

    d: float
    kind: str
    slope: float
    verdict: Growth
    residual: float
    period: float
    note: str = ""
    hidden: float = 0.0
    rests: tuple[float, float] | None = field(default=None, repr=False)

    def apart(self, d: float) -> float:
        """How far a coordinate is from it; 0 on an interval of rests."""
        return float(_apart(self, np.array(d)))

    @property
    def stable(self) -> bool:
        """|slope| < 1 by more than the error of the slope."""
        return self.verdict == "stable"


@dataclass(frozen=True)
class Jump:
    """A place where the map is not continuous: limits from below and above."""

    d: float
    below: float
    above: float


@dataclass(frozen=True)
class BasinInterval:
    """Coordinates between lo and hi whose iterates go to the attractor at d (None: to none found).

    Beside a stable set with a hidden cycle (`FixedPoint.hidden`) it is None, too: some go to the set, some
    do not.
    """

    lo: float
    hi: float
    attractor: float | None


def grid(lo: float, hi: float, points: int) -> Array:
    """Coordinates of a search over [lo, hi]. Raises UsageError."""
    if not hi > lo or points < 8:
        raise UsageError(
            f"the interval [{lo}, {hi}] with {points} points; expected lo < hi and at least 8 points."
        )
    return coordinates(lo, hi, points, CLOSEST)


def fixed_points(event_map: ScalarMap, lo: float, hi: float, points: int = 400) -> tuple[FixedPoint, ...]:
    """All fixed points of the map in [lo, hi], in order, the equilibrium set at 0 among them.

    Coordinates from which the solution rests for ever are one "equilibrium set" for each interval.
    """
    d = grid(lo, hi, points)
    fine = finer(event_map, max(lo, hi, key=abs), TIGHT)
    rests = _Rests(fine, lo, hi)
    found, d, gap = rests.on(d, fine(d) - d)
    searches = [(fine, d, gap)]
    known = any(one.apart(0.0) == 0.0 for one in found)
    at_rest = lo <= 0.0 <= hi and not known and event_map(0.0) == 0.0
    if at_rest and not rests(0.0) and (passing := _cycle(fine, 0.0, 0.0)) is not None:
        # A solution that comes back to 0 is a cycle like any other.
        found.append(passing)
    elif at_rest:
        at_set = equilibrium_set(event_map, 1e-3 * max(abs(lo), abs(hi)))
        for first in (d[d > 0][:1], d[d < 0][-1:]):
            if first.size:
                near, rest, gap = _beside_set(event_map, float(first[0]))
                searches.append((near, rest, gap))
                at_set = _told(at_set, rest, gap)
        found.append(at_set)
    noise = _NOISE * near_set(event_map, max(abs(lo), abs(hi)))[1]
    for at, places, values in searches:
        missed = _gap(at)
        samples = split(missed, Samples.of(places, values[None, :]), NOISE * at.rtol)
        between = brackets(missed, samples)
        scale = np.maximum(np.abs(between.low), np.abs(between.high))
        there = roots(missed, between, rtol=1e-15, jump=1e-3, floor=np.maximum(1e-7 * scale, noise))
        for root, left in zip(there.d[there.fixed].tolist(), there.left[there.fixed].tolist(), strict=True):
            if all(other.apart(root) > 1e-9 * max(abs(root), abs(other.d)) for other in found):
                k = int(np.searchsorted(places, root))
                beside = float(places[max(k - 1, 0)]), float(places[min(k + 1, places.size - 1)])
                if rests(root):
                    found.append(rests.around(root, *beside))
                elif (cycle := _cycle(at, root, left)) is not None:
                    found.append(cycle)
    return tuple(sorted(found, key=lambda point: point.d))


def _beside_set(event_map: ScalarMap, first: float) -> tuple[ScalarMap, Array, Array]:
    """From the grid's coordinate next to the set down to what rounding leaves, evenly in log d."""
    near, least = near_set(event_map, first)
    count = max(2, 1 + int(PER_DECADE * np.log10(max(abs(first) / least, 1.0))))
    d = np.sort(first * np.geomspace(1.0, min(least / abs(first), 0.5), count))
    # R(d) = d to so many digits is rounding: the solution came back before it left, which hides one return.
    once, reached, left = near.remake(order=1), d, np.ones(d.shape, dtype=bool)
    for _ in range(near.order):
        before, reached = reached, np.asarray(once(reached))
        left &= np.isfinite(reached) & (np.abs(reached - before) > _SAME * np.abs(before))
    return near, d[left], (reached - d)[left]


def _told(at_set: FixedPoint, d: Array, gap: Array) -> FixedPoint:
    """The equilibrium set, with a note where its slope and the solutions next to it contradict each other.

    Between two neighbouring fixed points that are both stable, or both not, there is another one.
    """
    if not d.size:
        return at_set
    last = int(np.argmin(np.abs(d)))
    grows = gap[last] * d[last] > 0
    undecided = at_set.verdict == "undecided"
    if undecided or at_set.slope <= 0 or not np.isfinite(gap[last]) or grows != at_set.stable:
        return at_set
    kind = "unstable" if at_set.stable else "stable"
    note = f"{kind} cycle between the set and |d| = {abs(d[last]):.1g} is not resolved"
    hidden = max(at_set.hidden, abs(float(d[last])))
    return replace(at_set, note="; ".join(filter(None, (at_set.note, note))), hidden=hidden)


class _Rests:
    """Coordinates in [lo, hi] from which the solution of a map rests for ever."""

    def __init__(self, event_map: ScalarMap, lo: float, hi: float) -> None:
        self.map, self.lo, self.hi = event_map, lo, hi

    def resting(self, d: Array) -> npt.NDArray[np.bool_]:
        """Whether R(d) = d without a return, at coordinates (k,)."""
        values, ended = self.map.returns(d)
        stays = np.array([status is not Status.STOPPED for status in ended], dtype=bool)
        return np.asarray(stays & (np.abs(values - d) <= 1e-15 * np.abs(d)))

    def __call__(self, d: float) -> bool:
        """Whether one coordinate rests."""
        return bool(self.resting(np.array([d]))[0])

    def on(self, d: Array, gap: Array) -> tuple[list[FixedPoint], Array, Array]:
        """The sets that hold coordinates of a grid, and what is left of it and of R(d) - d beside them."""
        found: list[FixedPoint] = []
        more: list[float] = []
        # A cycle that comes back with all its digits is none of rests.
        still = np.abs(gap) <= 1e-15 * np.abs(d)
        if not still.any():
            return found, d, gap
        still[still] = self.resting(d[still])
        k = np.flatnonzero(still)
        for part in np.split(k, np.flatnonzero(np.diff(k) > 1) + 1) if k.size else ():
            first, last = int(part[0]), int(part[-1])
            low = float(d[first - 1]) if first else self.lo
            high = float(d[last + 1]) if last + 1 < d.size else self.hi
            ends = self.end(float(d[first]), low), self.end(float(d[last]), high)
            found.append(self.of(*ends))
            size = _BESIDE * max(abs(ends[0]), abs(ends[1]), ends[1] - ends[0])
            more += [q for q in (ends[0] - size, ends[1] + size) if low < q < high]
        if not found:
            return found, d, gap
        # What is cut out keeps the coordinates beside it from being neighbours.
        at = np.array(more)
        places = np.concatenate([d, at])
        values = np.concatenate([np.where(still, np.nan, gap), np.asarray(self.map(at)) - at if more else at])
        order = np.argsort(places, kind="stable")
        return found, places[order], values[order]

    def around(self, d: float, low: float, high: float) -> FixedPoint:
        """The set of a coordinate that rests, between two others."""
        return self.of(self.end(d, low), self.end(d, high))

    def end(self, inside: float, outside: float) -> float:
        """The last coordinate that rests, from one that does towards one that may not."""
        if inside == outside or self(outside):
            return outside
        least = 1e-16 * (self.hi - self.lo)
        while abs(outside - inside) > 1e-14 * max(abs(inside), abs(outside)) + least:
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if self(middle) else (inside, middle)
        return inside

    def of(self, low: float, high: float) -> FixedPoint:
        """The set with these ends: stable where what starts beside it comes nearer."""
        reach = _REACH * max(high - low, 1e-3 * (self.hi - self.lo))
        slope, error = 0.0, 0.0
        for end, side in ((low, -1.0), (high, 1.0)):
            if not self.lo <= end + side * reach <= self.hi:
                continue
            d = end + side * reach * np.array([1.0, 0.5])
            image = np.asarray(self.map(d))
            gone = np.maximum(np.maximum(low - image, image - high), 0.0)
            ratios = gone / np.abs(d - end)
            if not np.all(np.isfinite(ratios)):
                slope, error = float("nan"), np.inf
                break
            slope = max(slope, float(ratios[1]))
            error = max(error, 2.0 * abs(float(ratios[1] - ratios[0])) + 1e-6)
        verdict: Growth = "undecided" if np.isnan(slope) else by_excess(slope - 1.0, error)
        d0 = 0.0 if low <= 0.0 <= high else min(low, high, key=abs)
        if low == high:
            return FixedPoint(d0, "equilibrium set", slope, verdict, 0.0, 0.0)
        note = f"every coordinate from {low:.6g} to {high:.6g} is at rest"
        return FixedPoint(d0, "equilibrium set", slope, verdict, 0.0, 0.0, note, rests=(low, high))


def _gap(event_map: ScalarMap) -> Gap:
    """R(d) - d of the one map."""

    def gap(d: Array, _: Whole) -> Array:
        return np.asarray(event_map(d) - d)

    return gap


def _cycle(event_map: ScalarMap, d: float, left: float) -> FixedPoint | None:
    """The limit cycle of a fixed point. None where rounding brings each solution back at once."""
    orbit = event_map.orbit(d)
    # Beside d a return takes the states through their usual sizes.
    size = np.maximum(*(map_units(event_map, at).size for at in (d, (1.0 + _ASIDE) * d)))
    if all(np.all(np.ptp(part.y, axis=1) <= _STILL * size) for part in orbit):
        return None
    period = float(sum(each.t_end for each in orbit))
    try:
        slope, note = event_map.derivative(d), ""
    except NotDifferentiableError as error:
        slope, note = float("nan"), f"stability undecided: {error}"
    verdict = by_multipliers(slope, ACCURACY * event_map.rtol)
    return FixedPoint(d, "limit cycle", slope, verdict, left, period, note)


def equilibrium_set(event_map: ScalarMap, reach: float) -> FixedPoint:
    """The fixed point at 0, where the solution rests."""
    slope, error, note, _ = equilibrium_slope(event_map, reach)
    return FixedPoint(0.0, "equilibrium set", slope, by_excess(abs(slope) - 1.0, error), 0.0, 0.0, note)


def jumps(event_map: ScalarMap, lo: float, hi: float, points: int = 400) -> tuple[Jump, ...]:
    """Places where the map jumps: intervals where it changes more than its slopes explain, halved down."""
    d = grid(lo, hi, points)
    value = np.asarray(event_map(d))
    out: list[Jump] = []
    at_set = lo <= 0.0 <= hi and event_map(0.0) == 0.0
    if at_set:
        out += _jumps_at_set(event_map, lo, hi)
    least = _LEAST * max(abs(lo), abs(hi))
    steep, slopes = _steeper(d, value, least)
    for i in np.flatnonzero(steep):
        a, b, left, right = float(d[i]), float(d[i + 1]), float(value[i]), float(value[i + 1])
        if at_set and a < 0.0 < b:
            continue
        slope, heights = float(slopes[i]), [abs(right - left)]
        for _ in range(60):
            middle = 0.5 * (a + b)
            if middle in (a, b):
                break
            at = float(event_map(middle))
            if abs(at - left - slope * (middle - a)) < abs(right - at - slope * (b - middle)):
                a, left = middle, at
            else:
                b, right = middle, at
            heights.append(abs(right - left))
        # A root of d - r has no slope at r either, but falls on as the interval is halved.
        falls = heights[-1] < 0.5 * heights[-10:][0]
        if not falls and heights[-1] > _SAME * (abs(left) + abs(right)) + least:
            out.append(Jump(0.5 * (a + b), left, right))
    return tuple(sorted(out, key=lambda jump: jump.d))


def _steeper(d: Array, value: Array, least: float) -> tuple[npt.NDArray[np.bool_], Array]:
    """Cells of a grid in which a map changes more than its slopes there or in the cells beside them explain,
    (k - 1,), and the slopes beside each, 0 where they are not known."""
    width, rise = np.diff(d), np.diff(value)
    slope = rise / width
    size, known = slope.size, np.isfinite(slope)
    usual = 20.0 * float(np.median(np.abs(slope[known]))) if known.any() else 0.0
    steep = np.abs(rise) > usual * width + least
    if size < _BESIDES + 1:
        return steep, np.zeros(size)
    # Of the cells next to each, those with the outermost slopes may hold jumps themselves.
    first = np.clip(np.arange(size) - _BESIDES // 2, 0, size - _BESIDES - 1)
    near = first[:, None] + np.arange(_BESIDES + 1)
    others = near[near != np.arange(size)[:, None]].reshape(size, _BESIDES)
    beside = np.sort(slope[others], axis=1)[:, 1:-1]
    middle, spread = beside.mean(axis=1), beside[:, -1] - beside[:, 0]
    steep |= np.abs(slope - middle) * width > _FARTHER * spread * width + least
    return steep, np.where(np.isfinite(middle), middle, 0.0)


def _jumps_at_set(event_map: ScalarMap, lo: float, hi: float) -> list[Jump]:
    """The jump at an equilibrium set at 0, by the limits on the sides that [lo, hi] holds; 0 on another."""

    def limit(end: float, side: float) -> float:
        jumps_there = end != 0.0 and equilibrium_slope(event_map, 1e-3 * abs(end), side).jumps
        return float(event_map(1e-9 * end)) if jumps_there else 0.0

    below, above = limit(lo, -1.0), limit(hi, 1.0)
    return [Jump(0.0, below, above)] if below or above else []


def basins(event_map: ScalarMap, lo: float, hi: float, points: int = 400) -> tuple[BasinInterval, ...]:
    """Intervals of [lo, hi] that go to the same attractor: between repelling points, and between what the map
    takes across them.

    Where the map increases between two repelling points the middle decides, else every coordinate of the
    search, and where two neighbours go elsewhere what lies between is halved. An interval that holds none of
    them is missed.
    """
    known = fixed_points(event_map, lo, hi, points)
    sets = [point for point in known if point.rests is not None]
    hidden = max((point.hidden for point in known if point.stable), default=0.0)
    edges = {-hidden, hidden} if hidden else set()
    edges |= {point.d for point in known if not point.stable and point not in sets}
    edges |= {end for point in sets for end in point.rests or ()}
    borders = np.array([lo, *sorted(edge for edge in edges if lo < edge < hi), hi])
    middle = 0.5 * (borders[:-1] + borders[1:])
    d = np.union1d(grid(lo, hi, points), middle)
    d = d[~np.isin(d, borders)]
    piece, image = np.searchsorted(borders, d) - 1, np.asarray(event_map(d))
    folds = ~(np.diff(image) > 0.0) & (np.diff(piece) == 0)
    asked = np.isin(piece, piece[:-1][folds]) | np.isin(d, middle)
    asked &= np.maximum(np.abs(borders[piece]), np.abs(borders[piece + 1])) > hidden
    d, piece = d[asked], piece[asked]
    target = _goes(event_map, d, known, max(abs(lo), abs(hi)))
    # NaN is a target as well: none that was found.
    other = (target[1:] != target[:-1]) & ~(np.isnan(target[1:]) & np.isnan(target[:-1]))
    k = np.flatnonzero(other & (np.diff(piece) == 0))
    low, high, left = d[k], d[k + 1], target[k]
    for _ in range(_HALVINGS if k.size else 0):
        half = 0.5 * (low + high)
        to = _goes(event_map, half, known, max(abs(lo), abs(hi)))
        same = (to == left) | (np.isnan(to) & np.isnan(left))
        low, high = np.where(same, half, low), np.where(same, high, half)
    cut = np.union1d(borders, 0.5 * (low + high))
    at = np.clip(np.searchsorted(d, cut[:-1]), 0, max(d.size - 1, 0))
    out = []
    for a, b, q in zip(cut[:-1].tolist(), cut[1:].tolist(), at.tolist(), strict=True):
        told = d.size > 0 and a < d[q] < b and np.isfinite(target[q])
        out.append(BasinInterval(a, b, float(target[q]) if told else None))
    return tuple(out)


def _goes(event_map: ScalarMap, d: Array, known: tuple[FixedPoint, ...], size: float) -> Array:
    """The attractor, or set of rests, that iterates of coordinates (k,) come to; NaN where none is found."""
    sets = [point for point in known if point.rests is not None]
    attractors = [point for point in known if point.stable]
    out, nearer, d = np.full(d.size, np.nan), np.zeros(d.size, dtype=np.int64), d.copy()
    left = np.arange(d.size if attractors or sets else 0)
    to = np.array([point.d for point in attractors])
    # However slowly: it comes nearer, and no other fixed point lies on its way.
    ways = [[q for point in known if (q := one.apart(point.d)) > 0.0] for one in attractors]
    clear = np.array([min(way, default=np.inf) for way in ways])
    for _ in range(2000):
        if not left.size:
            break
        before, d[left] = d[left], np.asarray(event_map(d[left]))
        now = d[left]
        going = np.isfinite(now)
        for point in sets:
            # What has come into a set of rests is at rest, whether it attracts or not.
            rests = going & (_apart(point, now) == 0.0)
            out[left[rests]] = point.d
            going &= ~rests
        if attractors:
            apart = np.array([_apart(point, now) for point in attractors])
            k = np.argmin(apart, axis=0)
            apart = apart[k, np.arange(now.size)]
            last = np.array([_apart(point, before) for point in attractors])[k, np.arange(now.size)]
            nearer[left] = np.where((apart < clear[k]) & (apart < last), nearer[left] + 1, 0)
            reached = going & ((apart <= 1e-6 * size) | (nearer[left] >= NEARER))
            out[left[reached]] = to[k[reached]]
            going &= ~reached
        left = left[going]
    return out


def _apart(point: FixedPoint, d: Array) -> Array:
    """How far coordinates of any shape are from it; 0 on an interval of rests."""
    low, high = point.rests or (point.d, point.d)
    return np.maximum(np.maximum(low - d, d - high), 0.0)
