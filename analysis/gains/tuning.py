"""Controller gains without cycles: where they are, their margins, and those with the largest margin.

Gains are free of cycles where the event map contracts at every excursion, rho < 1 (see `contraction`), for
every friction law of the band. Distances are taken in the logarithm of the gains: a margin s means that every
gain may be multiplied or divided by any factor up to s, in any combination, without a cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.stats import qmc

from filippov import System, UsageError
from filippov.analysis.gains.contraction import contraction
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array
from filippov.base.given import Amount, Edge, Interval, Natural, row, shown
from filippov.base.keywords import keywords, renamed
from filippov.base.names import unknown
from filippov.base.shown import Told

ROUNDS, BISECTIONS, SHELL = 32, 8, 16
# A box is looked for while it may be larger than the best by this share of its half-width.
GAIN = 0.01
# Boxes without a point that hunts: centers tried at a time, those that are moved on, and how often.
SCATTER, LEADING, NARROWINGS = 1024, 16, 12
FARTHEST = float(np.log(5.0))
STEEP = 10.0
# What hunts is mostly seen by a few excursions that are not small; small ones ask for many decisions.
FEW, NOT_SMALL = 12, 1e-3


@dataclass(frozen=True)
class GainLimit:
    """Lower and upper limit of one gain alone, the others at the best; None where there is none."""

    name: str
    lower: float | None
    upper: float | None


@dataclass(frozen=True)
class Tuning(Told):
    """What `tune` found.

    names      the gains; gains: samples (k, g); ratio: rho of each, the largest over the band
    best       gains with the largest margin found, None where no sample is free of cycles
    margin     factor s <= 5 by which every gain may change within its bounds, in any combination; 1 without
               best
    best_ratio rho at the best gains
    limits     borders of every gain alone within a factor of 5 and its bounds, the others at the best
    share      share of the samples that is free of cycles
    reason     why there is none, "" where there is one
    lost       share of the samples with a solution that did not return within t_max; they count as cycles
    complete   False where the search was interrupted
    parameters the values of all others; ranges: of the gains; band: sets of values that all have to be free
    """

    _untold = ("names", "gains", "ratio")

    names: tuple[str, ...]
    gains: Array
    ratio: Array
    best: dict[str, float] | None
    margin: float
    best_ratio: float
    limits: tuple[GainLimit, ...]
    share: float
    reason: str
    lost: float
    complete: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    band: tuple[Mapping[str, float], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The answer as plain data, without the samples."""
        return super().to_dict() | {"samples": len(self.ratio)}

    def __str__(self) -> str:
        if self.best is None:
            return f"no gains without cycles among {len(self.ratio)} samples: {self.reason}"
        gains = ", ".join(f"{name} = {value:.6g}" for name, value in self.best.items())
        rows = [
            f"{100 * self.share:.3g} % of {len(self.ratio)} samples are free of cycles",
            f"best margin at {gains}: a factor {self.margin:.4g} on every gain, in any combination",
            f"there the excursions shrink at least by the factor {self.best_ratio:.4g} from stick to stick",
        ]
        for limit in self.limits:
            low = "none reached" if limit.lower is None else f"{limit.lower:.6g}"
            high = "none reached" if limit.upper is None else f"{limit.upper:.6g}"
            rows.append(f"{limit.name} alone: border below {low}, above {high}")
        return "\n".join(rows)


@keywords(answers={"ranges": renamed("ranges", "over", "{'P': (5, 60)}")})
def tune(
    system: System,
    section: Section,
    over: Mapping[str, tuple[float, float]],
    interval: Interval,
    *,
    parameters: Mapping[str, float] | None = None,
    band: Sequence[Mapping[str, float]] = ({},),
    samples: Amount = 512,
    points: Edge = 40,
    seed: Natural = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Tuning:
    """Search gains for which the event map contracts for every law of a band.

    over       lowest and highest value by name of gain, > 0
    interval   of the section's coordinate, as in `contraction`
    parameters values of the others; band: sets of values by name that all have to be free of cycles
    samples    Sobol samples of these ranges (rounded up to a power of 2); points: excursions per sample
    progress   called with (stages done, stages)

    Ctrl-C returns what has been found. Raises UsageError.
    """
    search = _Search(system, section, over, interval, dict(parameters or {}), list(band), points)
    exponent = max(int(np.ceil(np.log2(samples))), 4)
    u = search.low + (search.high - search.low) * qmc.Sobol(len(over), rng=seed).random_base2(exponent)
    total = 2 + ROUNDS
    complete = True
    search.tell = lambda done: None if progress is None else progress(done, total)
    best, margin = None, 0.0
    try:
        search.ratios(u)
        search.tell(1)
        best, margin = search.best(np.random.default_rng(seed))
        search.tell(total)
    except KeyboardInterrupt:
        complete = False
    known, ratio = search.known()
    sampled = np.isin(np.arange(len(ratio)), np.arange(min(len(u), len(ratio))))
    share = float(np.mean(ratio[sampled] < 1)) if ratio.size else 0.0
    if best is None and ratio.size and np.any(ratio < 1):
        best = known[int(np.argmin(ratio))]
    told = (
        complete, system.parameters.others(parameters, search.names),
        {name: (float(low), float(high)) for name, (low, high) in over.items()}, tuple(map(dict, band)),
    )  # fmt: skip
    if best is None:
        return Tuning(
            search.names, np.exp(known), ratio, None, 1.0, float(np.min(ratio, initial=np.inf)), (), 0.0,
            search.reason(), search.lost, *told,
        )  # fmt: skip
    limits: tuple[GainLimit, ...] = ()
    if complete:
        limits = tuple(search.limit(best, k) for k in range(len(search.names)))
    return Tuning(
        search.names, np.exp(known), ratio,
        dict(zip(search.names, np.exp(best).tolist(), strict=True)), float(np.exp(margin)),
        float(search.ratios(best[None, :])[0]), limits, share, "", search.lost, *told,
    )  # fmt: skip


class _Search:
    """rho of points in the logarithm of the gains, all of them remembered."""

    def __init__(
        self, system: System, section: Section, ranges: Mapping[str, tuple[float, float]],
        interval: tuple[float, float], parameters: dict[str, float], band: list[Mapping[str, float]],
        points: int,
    ) -> None:  # fmt: skip
        self.names = tuple(ranges)
        if not self.names:
            raise UsageError("over is empty, expected (low, high) for at least one gain.")
        for name in (*self.names, *(key for item in band for key in item)):
            if name not in system.parameters:
                raise UsageError(unknown("parameter", name, system.parameters))
        for name in ranges:
            pair: Any = ranges[name]
            if not isinstance(pair, Sequence | np.ndarray) or len(pair) != 2:
                raise UsageError(
                    f"over: {name} is {shown(pair)}, expected its lowest and highest value: "
                    f"over={{{name!r}: (5, 60)}}."
                )
            low, high = row(f"over: {name}", pair, 2)
            if not 0 < low < high < np.inf:
                raise UsageError(f"the range of {name} is ({low}, {high}), expected 0 < low < high.")
            for end in (low, high):
                system.parameters[name].check(end, f"over: {name}")
        if not band:
            raise UsageError("band is empty, expected at least one set of values; {} changes nothing.")
        self.system, self.section, self.interval, self.points = system, section, interval, points
        self.parameters, self.band = parameters, band
        self.low = np.log([pair[0] for pair in ranges.values()])
        self.high = np.log([pair[1] for pair in ranges.values()])
        declared = [system.parameters[name] for name in ranges]
        self.least = np.array([max(gain.lower or 0.0, 0.0) for gain in declared])
        self.most = np.array([np.inf if gain.upper is None else gain.upper for gain in declared])
        self._u: list[Array] = []
        self._ratio: list[Array] = []
        self._nearest: list[Array] = []
        self._lost: list[Array] = []
        self._bad: list[Array] = []
        self.tell: Callable[[int], None] = lambda done: None

    def known(self) -> tuple[Array, Array]:
        """All points so far and their rho."""
        if not self._u:
            return np.zeros((0, len(self.names))), np.zeros(0)
        return np.concatenate(self._u), np.concatenate(self._ratio)

    @property
    def lost(self) -> float:
        """Share of points with a solution that did not come back."""
        return float(np.mean(np.concatenate(self._lost) > 0)) if self._lost else 0.0

    def ratios(self, u: Array) -> Array:
        """rho at points (k, g), the largest over the band; solutions that do not come back count as inf."""
        worst, nearest, lost = np.zeros(len(u)), np.zeros(len(u)), np.zeros(len(u))
        for item in self.band:
            # What hunts under one law of the band need not be asked under the others.
            left = np.nonzero(worst < 1)[0]
            if not left.size:
                break
            gains = np.clip(np.exp(u[left]), self.least, self.most)
            found = contraction(
                self.system, self.section, {n: gains[:, k] for k, n in enumerate(self.names)}, self.interval,
                parameters={**self.parameters, **item}, points=self.points,
            )  # fmt: skip
            worst[left] = np.maximum(worst[left], np.where(found.lost > 0, np.inf, found.ratio))
            nearest[left] = np.maximum(nearest[left], found.nearest)
            lost[left] = np.maximum(lost[left], found.lost)
        self._bad.append(u[worst >= 1])
        for store, value in zip(
            (self._u, self._ratio, self._nearest, self._lost), (u, worst, nearest, lost), strict=True
        ):
            store.append(value)
        return worst

    def hunts(self, u: Array) -> npt.NDArray[np.bool_]:
        """Points (k, g) of which a few excursions already tell that they are not free of cycles."""
        found = np.zeros(len(u), dtype=bool)
        for item in self.band:
            left = np.flatnonzero(~found)
            if not left.size:
                break
            gains = np.clip(np.exp(u[left]), self.least, self.most)
            seen = contraction(
                self.system, self.section, {n: gains[:, k] for k, n in enumerate(self.names)}, self.interval,
                parameters={**self.parameters, **item}, points=FEW, least=NOT_SMALL,
            )  # fmt: skip
            found[left] = (seen.lost > 0) | (seen.ratio >= 1)
        self._bad.append(u[found])
        return found

    def first(self, line: Array) -> int:
        """The first of the points (k, g) on a line that is not free of cycles; k where all are."""
        seen = np.flatnonzero(self.hunts(line))
        end = int(seen[0]) if seen.size else len(line)
        growing = np.flatnonzero(self.ratios(line[:end]) >= 1) if end else seen
        return int(growing[0]) if end and growing.size else end

    def best(self, random: np.random.Generator) -> tuple[Array | None, float]:
        """The point with the largest verified box around it, by outer approximation.

        No box can be larger than the largest one that no point known to hunt lies in. That one is probed: its
        surface is free of cycles, or what hunts there cuts it off; until none is larger than the best so far.
        """
        u, ratio = self.known()
        good = u[ratio < 1][np.argsort(ratio[ratio < 1])]
        if not good.size:
            return None, 0.0
        best, margin = good[0], 0.0
        for stage in range(ROUNDS):
            center, room = self.roomiest(np.vstack((best, good)), random)
            if room <= margin * (1 + GAIN):
                break
            reach = self.margin(center, margin, room, random)
            if reach > margin:
                best, margin = center, reach
            self.tell(2 + stage)
        return best, margin

    def roomiest(self, places: Array, random: np.random.Generator) -> tuple[Array, float]:
        """Center and half-width of the largest box without a point known to hunt, from `places` (k, g)."""
        bad, size = np.concatenate([np.empty((0, len(self.names))), *self._bad]), len(self.names)
        tree = cKDTree(bad) if len(bad) else None

        def room(centers: Array) -> Array:
            near = FARTHEST if tree is None else tree.query(centers, p=np.inf)[0]
            inside = np.min(self.free(centers), axis=(0, 2))
            return np.asarray(np.minimum(np.minimum(near, FARTHEST), inside))

        width = 0.5 * (self.high - self.low)
        centers = np.vstack((places, random.uniform(self.low, self.high, (SCATTER, size))))
        for _ in range(NARROWINGS):
            # Stable: of several that are as good the one that is known longest.
            leading = centers[np.argsort(-room(centers), kind="stable")[:LEADING]]
            moves = width * random.uniform(-1, 1, (SCATTER // LEADING, LEADING, size))
            near = np.clip(leading + moves, self.low, self.high)
            centers = np.vstack((leading, near.reshape(-1, size)))
            width = 0.6 * width
        return leading[0], float(room(leading[:1])[0])

    def free(self, u: Array) -> Array:
        """How far points (k, g) are from the least and from the greatest gains that the model has."""
        with np.errstate(divide="ignore"):
            return np.array([u - np.log(self.least), np.log(self.most) - u])

    def margin(self, center: Array, least: float, most: float, random: np.random.Generator) -> float:
        """Largest half-width <= `most` of a box free of cycles at all probes of its surface; 0 if <= `least`.

        A few excursions tell about how large it is, all of them at every probe whether it is free.
        """
        shell = self._shell(random)
        width, tried = self.reach(center, shell, most, self.hunts), np.inf
        while least < width < tried:
            tried = width
            width = self.reach(center, shell, tried, lambda u: self.ratios(u) >= 1)
        return width if width > least else 0.0

    def reach(
        self, center: Array, rays: Array, most: float, grows: Callable[[Array], npt.NDArray[np.bool_]],
    ) -> float:  # fmt: skip
        """The half-width up to which no ray (k, g) from the center ends in a point that grows."""
        low, high, at = 0.0, most, most
        for _ in range(BISECTIONS):
            found = grows(center + at * rays)
            if np.any(found):
                high, rays = at, rays[found]
            else:
                low = at
            if low == high:
                break
            at = 0.5 * (low + high)
        return low

    def _shell(self, random: np.random.Generator) -> Array:
        """Directions to the corners, the middles of the sides, and other places of a box's surface."""
        size = len(self.names)
        corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * size)).reshape(size, -1).T
        sides = np.concatenate((np.eye(size), -np.eye(size)))
        others = random.uniform(-1, 1, (SHELL, size))
        others /= np.max(np.abs(others), axis=1, keepdims=True)
        return np.concatenate((corners, sides, others)) if size > 1 else sides

    def limit(self, center: Array, k: int) -> GainLimit:
        """Borders of gain k alone, to 1e-6 of it, within a factor of 5 and its own bounds."""
        ends: list[float | None] = []
        for side, free in zip((-1.0, 1.0), self.free(center)[:, k].tolist(), strict=True):
            steps = np.linspace(0.0, min(FARTHEST, free), 41)
            line = np.repeat(center[None, :], steps.size, axis=0)
            line[:, k] += side * steps
            beyond = self.first(line)
            if beyond in (0, steps.size):
                ends.append(None)
                continue
            low, high = steps[beyond - 1], steps[beyond]
            while high - low > 1e-6:
                probes = np.linspace(low, high, 9)
                line = np.repeat(center[None, :], probes.size, axis=0)
                line[:, k] += side * probes
                # The last one is known to lie beyond the border.
                beyond = max(1, min(self.first(line[:-1]), probes.size - 1))
                low, high = probes[beyond - 1], probes[beyond]
            ends.append(float(np.exp(center[k] + side * 0.5 * (low + high))))
        return GainLimit(self.names[k], ends[0], ends[1])

    def reason(self) -> str:
        """Why no gains are free of cycles, from what the small excursions do."""
        if not self._nearest:
            return "the search was interrupted before the first sample was done."
        nearest, ratio = np.concatenate(self._nearest), np.concatenate(self._ratio)
        if np.min(nearest) > STEEP:
            return (
                "however small an excursion, it grows (by a factor of at least "
                f"{np.min(nearest):.3g} from 1e-6 of the interval), so the set of equilibria is unstable for "
                "every controller here. The field jumps or has an infinite slope where slip starts "
                "(friction with a static level above its slip curve is an example): integral action hunts "
                "whatever its gains."
            )
        if np.min(nearest) > 1:
            return (
                "the set of equilibria is unstable for all of them: the smallest excursions grow by a factor "
                f"of at least {np.min(nearest):.4g}. Widen the ranges."
            )
        return (
            f"larger excursions grow for all of them, by a factor of at least {np.min(ratio):.4g}: a limit "
            "cycle surrounds the set of equilibria. Widen the ranges."
        )
