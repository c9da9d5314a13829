"""Models in which a layer of some width replaces the sliding mode, and how their stick is read.

In such a model the surface is never reached: there is no sliding entry. What counts as stick is one of

    by modes   the solution is in the mode in which the model says it sticks: signs of its own surfaces, each
               closed ("-" is h <= 0), so that moving along the edge of the layer counts as well
    by layer   from |h| <= reach * width on, for the surface h of the exact system, as long as the exact
               system is attracted to the surface from both sides (dh/dt < 0 at s = +1 and > 0 at s = -1)

Comparators of bounded width are read by modes with that same condition at the entry; without it a solution
that only reverses would stick.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from filippov import Band, Smooth, Solution, System, UsageError
from filippov.base.arrays import Array
from filippov.base.keywords import constructor
from filippov.base.names import unknown
from filippov.solving.state.machine import Machine

# tanh(10) is 1 to 4e-9: beyond this many widths the smooth sign is the sign.
SMOOTH_REACH = 10.0
# Times in one stay in the layer at which it is seen whether the exact system attracts: so many ends of steps,
# and so many of equal intervals, where one part has nearly all of the steps, as under hysteresis.
ENDS, NODES = 2000, 200
_SIGNS = {"-": (-1, 0), "+": (1, 0)}


def _is_stick(given: Any) -> bool:
    """Whether a mode of stick was given, or a list of these."""
    if isinstance(given, Mapping):
        return True
    listed = isinstance(given, Sequence) and not isinstance(given, str)
    return listed and bool(given) and all(isinstance(mode, Mapping) for mode in given)


@constructor()
@dataclass(frozen=True)
class BandModel:
    """A family of systems whose band vanishes with `width`.

    name      as it is to appear in the table
    build     (width, **option) -> System with the states of the exact one, or (System, parameter values),
              which saves making the same system for every width
    stick     mode of stick by its own surfaces: {"band upper": "-", "band lower": "+"}, or several of these,
              in any of which it sticks; None: by layer
    options   further arguments of `build` with the values to try: {"alpha": (10, 100)}, all combinations
    reach     by layer: half-width of the layer over `width`
    attracted with `stick`: whether the exact system must also be attracted to the surface at the entry

    Raises UsageError.
    """

    name: str
    build: Callable[..., System | tuple[System, Mapping[str, float]]]
    stick: Mapping[str, str] | Sequence[Mapping[str, str]] | None = field(default=None, hash=False)
    options: Mapping[str, Sequence[float]] = field(default_factory=dict, hash=False)
    reach: float = 1.0
    attracted: bool = False

    def __post_init__(self) -> None:
        if self.stick is not None and not _is_stick(self.stick):
            raise UsageError(
                f"{self.name}: stick is {self.stick!r}, expected a dict from surface to sign such as "
                "{'band upper': '-', 'band lower': '+'}, or a list of such dicts."
            )
        for surface, sign in (item for mode in self.modes() for item in mode.items()):
            if sign not in _SIGNS:
                raise UsageError(
                    f"{self.name}: stick has {sign!r} for surface {surface!r}, expected '+' or '-'. Leave "
                    "out the surfaces that do not matter."
                )

    def modes(self) -> tuple[Mapping[str, str], ...]:
        """The modes of stick by its own surfaces."""
        if self.stick is None:
            return ()
        return (self.stick,) if isinstance(self.stick, Mapping) else tuple(self.stick)

    def variants(self) -> Iterator[dict[str, float]]:
        """Every combination of the options."""
        for values in itertools.product(*self.options.values()):
            yield dict(zip(self.options, values, strict=True))


def comparator_models(exact: System, surface: str) -> dict[str, BandModel]:
    """The classical regularisations of the same system: Band (saturated line) and Smooth (tanh)."""
    edges = {f"{surface}:upper": "-", f"{surface}:lower": "+"}
    return {
        "band": BandModel("band", lambda width: exact.with_comparator(Band(width)), edges, attracted=True),
        "smooth": BandModel("smooth", lambda width: exact.with_comparator(Smooth(width)), reach=SMOOTH_REACH),
    }


@dataclass(frozen=True)
class Stay:
    """A stay in stick, t0 to t1; x: state at t0. from_start: the run began in it; to_end: ended in it."""

    t0: float
    t1: float
    x: Array
    from_start: bool
    to_end: bool


class Reader:
    """Finds the stays in stick of a model's solutions.

    exact, surface, p   the exact system, its surface and parameter values: what attracts
    """

    def __init__(self, exact: System, surface: str, p: Array) -> None:
        self.machine = Machine(exact, "DOP853", p)
        self.index = exact.surface_index(surface)

    def of_exact(self, solution: Solution) -> list[Stay]:
        """Stays in the sliding mode of the exact system."""
        return by_mode(solution, lambda mode, t, x: mode[self.index] == 0)

    def of_model(self, solution: Solution, model: BandModel, width: float) -> list[Stay]:
        """Stays in stick of a band model."""
        if model.stick is None:
            return self._by_layer(solution, model.reach * width)
        names = [surface.name for surface in solution.problem.system.surfaces]
        for name in (name for mode in model.modes() for name in mode):
            if name not in names:
                raise UsageError(f"{model.name}: {unknown('surface', name, names)}")
        wanted = [
            [(names.index(name), _SIGNS[sign]) for name, sign in mode.items()] for mode in model.modes()
        ]
        last = [False]  # an entry decides for the whole stay in the layer

        def sticks(mode: tuple[int, ...], t: float, x: Array) -> bool:
            inside = any(all(mode[i] in signs for i, signs in one) for one in wanted)
            last[0] = inside and (not model.attracted or last[0] or self.attraction(t, x) > 0)
            return last[0]

        return by_mode(solution, sticks)

    def attraction(self, t: float, x: Array) -> float:
        """min(dh/dt at s = -1, -dh/dt at s = +1), exact system: > 0 where both sides lead to the surface."""
        below, above = self.rates(t, x)
        return min(below, -above)

    def rates(self, t: float, x: Array) -> tuple[float, float]:
        """dh/dt of the exact system at s = -1 and s = +1; states after its own are left out."""
        machine, i = self.machine, self.index
        point = np.ascontiguousarray(x[: machine.n], dtype=float)
        _, signs = machine.signs_at(t, point)
        slope, drift = machine.gradients(t, point, signs)
        mode = signs.copy()
        mode[i] = 0.0
        found = []
        for sign in (-1.0, 1.0):
            signs[i] = sign
            found.append(float(slope[i] @ machine.rhs(t, point, signs, mode) + drift[i]))
        return found[0], found[1]

    def height(self, t: float, x: Array) -> float:
        """h of the surface."""
        machine = self.machine
        point = np.ascontiguousarray(x[: machine.n], dtype=float)
        return float(machine.signs_at(t, point)[0][self.index])

    def _by_layer(self, solution: Solution, half: float) -> list[Stay]:
        """Stays in stick from the dense output: from |h| <= half on, while the exact system attracts.

        What a smooth sign lacks to 1 where stick ends leads beyond any multiple of its width, so a stay goes
        on up to the geometric mean of the layer and the largest |h|.
        """
        sol = solution.sol
        assert sol is not None, "the layer is read from the dense output"
        edge = half * (1.0 + 1e-9)
        t, x = solution.t, solution.y.T
        size = np.array([abs(self.height(a, b)) for a, b in zip(t, x, strict=True)])
        wide = max(edge, float(np.sqrt(edge * np.max(size))))

        def below(limit: float) -> Callable[[float], bool]:
            return lambda time: abs(self.height(time, sol(time))) <= limit

        def held(time: float) -> bool:
            return self.attraction(time, sol(time)) > 0

        out: list[Stay] = []
        for first, last in _runs(size <= wide):
            t0 = float(t[0]) if first == 0 else _border(float(t[first - 1]), float(t[first]), below(wide))
            end = last == len(t) - 1
            t1 = float(t[-1]) if end else _border(float(t[last + 1]), float(t[last]), below(wide))
            nodes = np.unique(np.concatenate([[t0], t[first : last + 1], [t1]]))
            nodes = nodes[np.unique(np.linspace(0, nodes.size - 1, ENDS).astype(int))]
            nodes = np.union1d(nodes, np.linspace(t0, t1, NODES))
            for a, b in _runs(np.array([held(float(time)) for time in nodes])):
                begun = t0 if a == 0 else _border(float(nodes[a - 1]), float(nodes[a]), held)
                over = b == nodes.size - 1
                ended = t1 if over else _border(float(nodes[b + 1]), float(nodes[b]), held)
                if not below(edge)(begun):
                    inner = np.flatnonzero((t > begun) & (t <= ended) & (size <= edge))
                    if not inner.size:
                        continue
                    k = int(inner[0])
                    begun = _border(max(begun, float(t[k - 1])), float(t[k]), below(edge))
                at_start = begun == t[0]
                entry = np.asarray(solution.problem.x0 if at_start else sol(begun))
                out.append(Stay(begun, ended, entry, at_start, end and over))
        return out


def _border(outside: float, inside: float, test: Callable[[float], bool]) -> float:
    """The time nearest to `outside` that passes the test, by halving."""
    while True:
        middle = 0.5 * (outside + inside)
        if middle in (outside, inside):
            return inside
        if test(middle):
            inside = middle
        else:
            outside = middle


def by_mode(solution: Solution, sticks: Callable[[tuple[int, ...], float, Array], bool]) -> list[Stay]:
    """Neighbouring segments in stick, put together. The state at an entry is that of its event."""
    states: dict[float, Array] = {event.t: event.x for event in solution.events}
    start = solution.problem.t_span[0]
    parts: list[tuple[float, float]] = []
    entered: list[Array] = []
    before = False
    for segment in solution.segments:
        x = solution.problem.x0 if segment.t0 == start else states[segment.t0]
        now = sticks(segment.mode, segment.t0, x)
        if now and before:
            parts[-1] = (parts[-1][0], segment.t1)
        elif now:
            parts.append((segment.t0, segment.t1))
            entered.append(x)
        before = now
    return [
        Stay(t0, t1, x, t0 == start, t1 == solution.t_end) for (t0, t1), x in zip(parts, entered, strict=True)
    ]


def _runs(inside: Any) -> Iterator[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
    for first, after in edges.reshape(-1, 2):
        yield int(first), int(after) - 1
