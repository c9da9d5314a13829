"""Stable and unstable manifolds that are curves: of saddles and pseudo-saddles, and of orbits of saddle type.

For an equilibrium the curve is a solution (forwards for the unstable one, backwards for the stable one),
through events and sliding. For an orbit it is a curve of the return map, grown by arclength
(`filippov.analysis.invariant_sets.manifold_of_map`). Backwards in time a solution that reaches attracting
sliding could have come from anywhere: the curve ends there, and says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from filippov import Solution, System, UsageError
from filippov.analysis.invariant_sets.manifold_of_map import Growth, grow
from filippov.analysis.invariant_sets.return_map import ReturnMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_file import write_json
from filippov.analysis.orbits.saddle import Saddle, Side, saddle
from filippov.base.arrays import Array
from filippov.base.given import Count, Positive
from filippov.base.keywords import keywords
from filippov.base.shown import Told
from filippov.base.status import Status, mode_text
from filippov.solving.uncut import solve

OFFSET = 1e-6
INSIDE, CHUNKS, DOUBLED = 8, 400, 6


@dataclass(frozen=True, eq=False)
class ManifoldBranch:
    """One side of a manifold, from its saddle on.

    x       points in order, (k, n); a row of NaN where the curve is broken by a jump of the map
    length  arclength; ended: why it goes no further, "" if the requested length is reached
    """

    x: Array
    length: float
    ended: str = ""


@dataclass(frozen=True, eq=False)
class Manifold(Told):
    """A stable or unstable manifold.

    side      "stable" or "unstable"; of: "saddle", "pseudo-saddle" or "orbit"
    x         the saddle, or the point of the orbit at the strobe or section
    value     the eigenvalue (1/time) or multiplier that belongs to it; NaN for solutions that come to a
              pseudo-saddle, or leave it, across its surface in finite time
    branches  its sides
    """

    _untold = ("system",)

    system: System
    parameters: Mapping[str, float]
    side: Side
    of: str
    x: Array
    value: float
    branches: tuple[ManifoldBranch, ...] = field(default=())

    def lines(self) -> list[str]:
        """What it is, in words."""
        at = ", ".join(f"{n} = {v:.9g}" for n, v in zip(self.system.states, self.x, strict=True))
        number = f"{self.value:.9g}" if np.isfinite(self.value) else "reached in finite time"
        what = "multiplier" if self.of == "orbit" else "eigenvalue"
        out = [f"{self.side} manifold of the {self.of} at {at}; {what} {number}"]
        for number_of, one in enumerate(self.branches, 1):
            pieces = int(np.sum(np.isnan(one.x[:, 0]))) + 1
            text = f"branch {number_of}: length {one.length:.6g}, {len(one.x)} points"
            text += f" in {pieces} pieces" if pieces > 1 else ""
            out.append(text + (f"; {one.ended}" if one.ended else ""))
        return out

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def to_dict(self) -> dict[str, Any]:
        """Plain data: numbers, text, lists and dicts."""
        return super().to_dict() | {"states": list(self.system.states)}

    def save(self, path: str | Path) -> Path:
        """Write it as JSON."""
        return write_json(path, {"format": "filippov manifold", "version": 1, "manifold": self.to_dict()})


@keywords()
def manifold(
    system: System,
    at: Any,
    side: Side = "unstable",
    *,
    length: Positive,
    parameters: Mapping[str, float] | None = None,
    mode: str | None = None,
    section: Section | None = None,
    spacing: Positive | None = None,
    offset: Positive = OFFSET,
    t_max: Positive = 1000.0,
    rtol: Positive = 1e-10,
    most: Count = 20_000,
) -> Manifold:
    """The stable or unstable manifold of a saddle or of an orbit of saddle type, to an arclength.

    at        a state near a saddle or pseudo-saddle (in order or by name), a Saddle, or an Orbit
    length    arclength of every branch, in the units of the states
    mode      of the equilibrium, such as "0" for a pseudo-saddle; default: read off the state
    section   of an orbit of an autonomous system: the events on which the curve lies; orbits of forced
              systems are cut by their period
    spacing   largest distance of neighbouring points; default: length/400
    offset    distance from the saddle where the curve begins, in parts of the length: the eigenvector
              replaces the curve there, with an error of the order of offset**2
    t_max     longest time of a branch of an equilibrium; most: points of a branch of an orbit

    Only manifolds of dimension 1 are computed; others are refused with their dimension. Raises UsageError,
    SolveError.
    """
    if side not in ("stable", "unstable"):
        raise UsageError(f"side is {side!r}, expected 'stable' or 'unstable'.")
    for name, value in (("length", length), ("offset", offset), ("t_max", t_max)):
        if not (0 < value < np.inf):
            raise UsageError(f"{name} is {value!r}, expected a number > 0.")
    gap = length / 400 if spacing is None else float(spacing)
    if not 0 < gap <= length:
        raise UsageError(f"spacing is {spacing!r}, expected a number > 0 and at most the length {length:g}.")
    if isinstance(at, Orbit):
        if parameters:
            raise UsageError(
                "an orbit has its own parameters; drop parameters=, or find the orbit with them."
            )
        returns = ReturnMap(at, section, rtol=rtol)
        value, branches = _of_map(returns, side, length, gap, offset, most)
        return Manifold(system, returns.parameters, side, "orbit", returns.x, value, branches)
    if section is not None:
        raise UsageError("a section is for orbits; the manifold of an equilibrium is a solution.")
    point = at if isinstance(at, Saddle) else saddle(system, at, parameters=parameters, mode=mode)
    size = point.dimension(side)
    if size != 1:
        raise UsageError(
            f"the {side} manifold of the {point.kind} has dimension {size}; only curves are drawn. Its "
            f"{'unstable' if side == 'stable' else 'stable'} one has dimension "
            f"{point.dimension('unstable' if side == 'stable' else 'stable')}."
        )
    direction = point.direction(side)
    if direction is None:
        value = float("nan")
        starts = [(point.x, _beside(point, s)) for s in (1, -1)]
    else:
        sign = 1 if side == "unstable" else -1
        value = float(point.eigenvalues.real[sign * point.eigenvalues.real > 0][0])
        starts = [(point.x + s * offset * length * direction, mode_text(point.mode)) for s in (1, -1)]
    out = tuple(_solution(point, side, x, m, length, gap, t_max, rtol) for x, m in starts)
    return Manifold(system, point.parameters, side, point.kind, point.x, value, out)


def _beside(point: Saddle, side: int) -> str:
    return mode_text(tuple(s or side for s in point.mode))


def _solution(
    point: Saddle, side: Side, x0: Array, mode: str, length: float, gap: float, t_max: float, rtol: float
) -> ManifoldBranch:  # fmt: skip
    """The solution from x0, which begins in this mode, as far as the length goes."""
    back, span = (
        side == "stable",
        0.1 / max(float(np.max(np.abs(point.eigenvalues.real), initial=0.0)), 1e-3 / t_max),
    )
    parts: list[Array] = [point.x[None, :]]
    x, spent, total, ended, first = x0, 0.0, 0.0, "", True
    quiet = 0
    for _ in range(CHUNKS):
        span = min(span, t_max - spent)
        options: dict[str, Any] = {"nonunique": [mode]} if first and mode != "." else {}
        run = solve(
            point.system, x, (0.0, -span) if back else (0.0, span), parameters=point.parameters, rtol=rtol,
            atol=1e-3 * rtol * min(1.0, length), backward=back, zeno="continue", **options,
        )  # fmt: skip
        times, more = _points(run, gap)
        steps = np.linalg.norm(np.diff(np.vstack([parts[-1][-1:], more]), axis=0), axis=1)
        reached = total + np.cumsum(steps)
        over = np.flatnonzero(reached >= length)
        if over.size:
            k = int(over[0])
            share = (length - (reached[k] - steps[k])) / steps[k]
            begin = float(times[k - 1]) if k else run.problem.t_span[0]
            cut = begin + share * (float(times[k]) - begin) if share < 1 else float(times[k])
            assert run.sol is not None
            parts.append(np.vstack([more[:k], run.sol(cut)]))
            return ManifoldBranch(np.vstack(parts), length)
        parts.append(more)
        gained = float(np.sum(steps))
        total, spent, x, first = total + gained, spent + abs(run.t_end), run.x_end, False
        if not run.success:
            ended = _why(run, back)
            break
        quiet = quiet + 1 if gained <= 1e-9 * length and total > 1e-3 * length else 0
        if quiet >= 2:
            ended = "it comes to rest"
            break
        if spent >= t_max:
            ended = f"t_max = {t_max:g} is used up"
            break
        if gained < 0.02 * length:
            span *= 2.0
    else:
        ended = "the budget of segments is used up"
    return ManifoldBranch(np.vstack(parts), total, ended)


def _why(run: Solution, back: bool) -> str:
    at = ", ".join(f"{v:.6g}" for v in run.x_end)
    if back and run.status is Status.NON_UNIQUE:
        return f"backwards in time the solution is not unique from ({at}) on, where it meets sliding"
    return f"the solution ends at ({at}): {run.message}"


def _points(run: Solution, gap: float) -> tuple[Array, Array]:
    """Times and states along a solution, closer than `gap`: on the steps, at the events and between."""
    assert run.sol is not None
    edges = np.append(run.sol.start, run.t_end)
    count = INSIDE
    for _ in range(DOUBLED):
        share = np.arange(1, count + 1) / count
        t = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
        t = np.clip(t, np.min(edges), np.max(edges))
        if not t.size:
            return np.array([run.t_end]), run.x_end[None, :]
        x = np.asarray(run.sol(t).T)
        if len(x) < 2 or np.max(np.linalg.norm(np.diff(x, axis=0), axis=1)) <= gap:
            break
        count *= 2
    keep = [0]
    for k in range(1, len(x) - 1):
        # Dense where it bends, as many as asked for elsewhere.
        if np.linalg.norm(x[k + 1] - x[keep[-1]]) > 0.5 * gap:
            keep.append(k)
    keep.append(len(x) - 1)
    return t[keep], x[keep]


def _of_map(
    returns: ReturnMap, side: Side, length: float, gap: float, offset: float, most: int
) -> tuple[float, tuple[ManifoldBranch, ...]]:  # fmt: skip
    value, vector = returns.direction(side)
    branches = []
    for sign in (1, -1):
        found: Growth = grow(
            returns, side, returns.x, sign * vector, value, length=length, spacing=gap,
            offset=offset * length,            most=most,
        )  # fmt: skip
        branches.append(ManifoldBranch(found.x, found.length, found.ended))
    return value, tuple(branches)
