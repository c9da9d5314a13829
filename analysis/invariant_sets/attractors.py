"""All attractors in a box of state space, by recurrences, with the shares of states that go to each.

Solutions from many states are followed by a map (`filippov.analysis.invariant_sets.state_map`); one that for
many iterates visits only cells of a grid that it has visited before is examined: the equilibrium or periodic
orbit there is solved for, and chaos is recognised by the largest Lyapunov exponent. The others are then
assigned by their distance from these attractors, not by cells. An attractor whose share of the box is q is
missed by N states with probability (1 - q)^N. Source: Datseris & Wagemakers 2022, Chaos 32, 023104; Nusse &
Yorke 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import System, UsageError
from filippov.analysis.invariant_sets.attractor import Attractor
from filippov.analysis.invariant_sets.attractor_search import (
    ESCAPED,
    FAILED,
    LOST,
    UNIDENTIFIED,
    UNSTABLE,
    Search,
)
from filippov.analysis.invariant_sets.search_file import SearchFile
from filippov.analysis.invariant_sets.state_map import StateMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit import stored_system
from filippov.analysis.orbits.orbit_file import read_json, write_json
from filippov.base.arrays import Array
from filippov.base.given import AmountOrZero, Count, Edge, Natural, Positive, Values
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.read_whole import content_of
from filippov.base.shown import Told
from filippov.io.stored_system import system_data

FORMAT, VERSION = "filippov attractors", 1
SPECIAL = {
    LOST: "undecided", ESCAPED: "escapes", FAILED: "failed", UNSTABLE: "does not move on to an attractor",
    UNIDENTIFIED: "not identified",
}  # fmt: skip
PILOTS = 64
# Every state has a companion so many tolerances away, which tells whether its label is sure.
SHIFT = 10.0


@dataclass(frozen=True, eq=False)
class Attractors(Told):
    """What was found in a box.

    attractors  largest share first; unstable: equilibria and orbits on which some states stay, but which do
                not attract
    box         (least, greatest) by state
    states      states drawn from the box at random, (k, n), and where each goes: label (k,), the number of an
                attractor, -1 undecided after all iterates, -2 escapes, -3 the solver failed, -4 stays on
                something that does not attract, -5 recurrent on something that could not be identified
    moved       share of these states that go elsewhere when they start 10 tolerances of the box away: they
                are so close to a border of basins, or to a long chaotic transient, that their label is
                uncertain; NaN without states
    names, x, y   of a plane: its two states (None without a plane) and their values; picture: the label of
                every pair, (len(y), len(x)); at: the other states there
    kind, duration   of the map: "strobe", "step" or "section", its period, step or longest return
    iterates    of the map that were done; failures: solutions that failed by status
    complete    False where it was interrupted
    """

    _untold = ("system",)

    system: System
    parameters: Mapping[str, float]
    attractors: tuple[Attractor, ...]
    unstable: tuple[Attractor, ...]
    box: Mapping[str, tuple[float, float]]
    states: Array
    label: npt.NDArray[np.int64]
    moved: float
    names: tuple[str, str] | None
    x: Array
    y: Array
    picture: npt.NDArray[np.int64]
    at: Mapping[str, float]
    kind: str
    duration: float
    iterates: int
    failures: Mapping[str, int] = field(default_factory=dict)
    complete: bool = True

    @property
    def shares(self) -> dict[int, tuple[float, float]]:
        """Share of the box that goes to each label with its standard error.

        sqrt(q (1 - q)/N) with q = (k + 1)/(N + 2) for k of N states. Without drawn states the share of the
        plane, whose error is not known: NaN.
        """
        drawn = len(self.label) > 0
        labels = self.label if drawn else self.picture.ravel()
        total = max(len(labels), 1)
        out = {}
        for label in (*range(len(self.attractors)), *SPECIAL):
            count = int(np.sum(labels == label))
            if label >= 0 or count:
                q = (count + 1) / (total + 2)
                error = float(np.sqrt(q * (1 - q) / total)) if drawn else float("nan")
                out[label] = (count / total, error)
        return out

    def lines(self) -> list[str]:
        """What was found, in words: one line per attractor, then the outcome of the other states."""
        out = [f"{len(self.attractors)} attractor{'s' * (len(self.attractors) != 1)}"]
        if not self.complete:
            out[0] += " (interrupted)"
        for label, (share, error) in self.shares.items():
            what = str(self.attractors[label]) if label >= 0 else SPECIAL[label]
            if label == LOST:
                what += f" after {self.iterates} iterates"
            if label == FAILED:
                what += ": " + ", ".join(f"{n} {name}" for name, n in sorted(self.failures.items()))
            sure = f" +- {100 * error:.2g}" if np.isfinite(error) else ""
            out.append(f"{100 * share:.4g}{sure} %: {what}")
        if self.moved > 0:
            out.append(
                f"{100 * self.moved:.4g} % of the states go elsewhere from a start a few tolerances away"
            )
        out += [f"does not attract: {one}" for one in self.unstable]
        return out

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def plot(self, *given: Any, **options: Any) -> Any:
        """Basins in the plane with the attractors (see `filippov.plot.attractors`)."""
        from filippov.plot.attractors import plot_attractors

        return plot_attractors(self, *given, **options)

    def to_dict(self) -> dict[str, Any]:
        """Plain data: numbers, text, lists and dicts."""
        shares = [{"label": k, "share": part, "error": error} for k, (part, error) in self.shares.items()]
        return super().to_dict() | {"shares": shares}

    def save(self, path: str | Path) -> Path:
        """Write it as JSON, with the system where that is symbolic."""
        data = {"format": FORMAT, "version": VERSION, "system": system_data(self.system)}
        return write_json(path, data | {"attractors": self.to_dict()})

    @classmethod
    def load(cls, path: str | Path, system: System | None = None) -> Attractors:
        """Read what `save` wrote; a system of plain functions has to be given. Raises UsageError."""
        data = read_json(path, FORMAT, VERSION)
        with content_of(path):
            made, d = stored_system(data, system, path), data["attractors"]
            return cls(
                made, dict(d["parameters"]), tuple(Attractor.from_dict(q, made) for q in d["attractors"]),
                tuple(Attractor.from_dict(q, made) for q in d["unstable"]),
                {k: (float(v[0]), float(v[1])) for k, v in d["box"].items()},
                np.array(d["states"], dtype=float).reshape(-1, made.dimension),
                np.array(d["label"], dtype=np.int64), float(d["moved"]), None if d["names"] is None else
                (d["names"][0], d["names"][1]), np.array(d["x"], dtype=float), np.array(d["y"], dtype=float),
                np.array(d["picture"], dtype=np.int64), dict(d["at"]), str(d["kind"]), float(d["duration"]),
                int(d["iterates"]), dict(d["failures"]), bool(d["complete"]),
            )  # fmt: skip


@keywords()
def attractors(
    system: System,
    box: Mapping[Any, Sequence[float]],
    *,
    parameters: Mapping[str, float] | None = None,
    section: Section | None = None,
    period: Any = None,
    step: Positive | None = None,
    t0: float = 0.0,
    samples: AmountOrZero = 400,
    seed: Natural = 0,
    plane: tuple[str, str] | None = None,
    resolution: Edge = 40,
    at: Values | None = None,
    cells: Count = 60,
    recurrences: Count = 40,
    most: Count = 2000,
    reach: Positive = 1e-3,
    escape: Positive = 100.0,
    rtol: Positive = 1e-8,
    threads: Count | None = None,
    progress: Callable[[int, int], None] | None = None,
    store: str | Path | None = None,
) -> Attractors:
    """The attractors to which states of a box go, and the share that goes to each.

    box          (least, greatest) for every state; attractors outside of it are found as well
    section      of an autonomous system: follow it from event to event instead of in equal steps
    period       of a forced system: a number or a formula such as "2*pi/omega"; default: read off it
    step         of an autonomous system without a section; default: about a twentieth of the box per step
    samples      states drawn uniformly from the box, by a generator with this seed
    plane        two states over which a picture of resolution x resolution initial states is made; `at`: the
                 others there (default: the middle of the box)
    cells        along each edge of the box; recurrences: iterates in a row on cells visited before, after
                 which a solution is examined; most: iterates, after which the rest is undecided
    reach        distance from an attractor, in parts of the box, within which a solution has to stay
    escape       distance from the middle of the box, in parts of it, beyond which a solution has escaped
    progress     called with (solutions decided, all)
    store        a file that stores the search (npz): an interrupted search of the same system and settings
                 continues from it with the same results; `most` may differ

    Two attractors closer than `reach`, or a basin that is narrower, are not distinguished. Angles are not
    taken modulo 2 pi: a state that rotates forever escapes. Ctrl-C returns what is done. Raises UsageError.
    """
    box = {getattr(state, "name", state): ends for state, ends in box.items()}
    low, size = _box(system, box)
    for name, value in (
        ("cells", cells),
        ("recurrences", recurrences),
        ("most", most),
        ("resolution", resolution),
    ):
        if value != int(value) or value < 2:
            raise UsageError(f"{name} is {value!r}, expected a whole number of at least 2.")
    if samples < 0 or (samples == 0 and plane is None):
        raise UsageError(f"samples is {samples}, expected a whole number > 0, or a plane.")
    if not 0 < reach < 0.1 or not escape > 1:
        raise UsageError(f"reach {reach}, escape {escape}: expected 0 < reach < 0.1 and escape > 1.")
    rng = np.random.default_rng(seed)
    drawn = low + size * rng.random((samples, system.dimension))
    beside = drawn + SHIFT * rtol * size * rng.choice([-1.0, 1.0], (samples, system.dimension))
    x, y, held, shown = _plane(system, plane, resolution, at, low, size)
    flow = StateMap(
        system, parameters=parameters, section=section, period=period, step=step, t0=t0, rtol=rtol,
        threads=threads,
    )  # fmt: skip
    starts = np.vstack([drawn, beside, shown])
    if flow.kind == "step" and step is None:
        flow = flow.at_pace(starts[: min(PILOTS, len(starts))], size)
    cut = flow.section
    settings = {
        "parameters": flow.parameters, "map": [flow.kind, flow.duration, flow.t0],
        "section": None if cut is None else [cut.surface, cut.kind, cut.t_max, cut.after],
        "box": [low.tolist(), size.tolist()], "samples": [samples, seed], "plane": [plane, len(x), held],
        "cells": cells, "recurrences": recurrences, "reach": reach, "escape": escape, "rtol": rtol,
    }  # fmt: skip
    file = None if store is None else SearchFile(store, {"system": _identity(system)} | settings)
    search = Search(
        flow, starts, low, size, cells=cells, recurrences=recurrences, most=most, reach=reach, escape=escape,
        progress=progress, file=file,
    )  # fmt: skip
    search.run()
    counts = [int(np.sum(search.label == k)) for k in range(len(search.attractors))]
    order = sorted(range(len(counts)), key=lambda k: -counts[k])
    rank = {old: new for new, old in enumerate(order)}
    label = np.array([rank.get(int(v), int(v)) for v in search.label], dtype=np.int64)
    moved = float(np.mean(label[:samples] != label[samples : 2 * samples])) if samples else float("nan")
    return Attractors(
        system, flow.parameters, tuple(search.attractors[k] for k in order), tuple(search.unstable),
        {name: (float(a), float(a + b)) for name, a, b in zip(system.states, low, size, strict=True)}, drawn,
        label[:samples], moved, plane, x, y, label[2 * samples :].reshape(len(y), len(x)), held, flow.kind,
        flow.duration,
        search.iterates, search.failures, search.complete,
    )  # fmt: skip


def _identity(system: System) -> dict[str, Any]:
    """What tells a system from another one on file."""
    data = system_data(system)
    if data is None:
        raise UsageError("store needs a system of expressions: functions cannot be told from others on file.")
    return data


def _box(system: System, box: Mapping[str, Sequence[float]]) -> tuple[Array, Array]:
    for name in box:
        if name not in system.states:
            raise UsageError(unknown("state", name, system.states))
    missing = [name for name in system.states if name not in box]
    if missing:
        raise UsageError(f"the box has no range for state {', '.join(missing)}; give (least, greatest).")
    ends = np.array([[float(v) for v in box[name]] for name in system.states])
    if ends.shape[1:] != (2,) or not np.all(np.isfinite(ends)) or not np.all(ends[:, 0] < ends[:, 1]):
        raise UsageError(f"the box is {dict(box)!r}, expected (least, greatest) for every state.")
    return ends[:, 0], ends[:, 1] - ends[:, 0]


def _plane(
    system: System, plane: tuple[str, str] | None, resolution: int, at: Mapping[str, float] | None, low:
    Array, size: Array,
) -> tuple[Array, Array, dict[str, float], Array]:  # fmt: skip
    """Values of the two states, the others, and all initial states of the plane."""
    given = dict(at or {})
    for name in (*(plane or ()), *given):
        if name not in system.states:
            raise UsageError(unknown("state", name, system.states))
    if plane is None:
        if given:
            raise UsageError(f"at gives {', '.join(given)}, but there is no plane. Give plane=(name, name).")
        return np.zeros(0), np.zeros(0), {}, np.zeros((0, system.dimension))
    if plane[0] == plane[1] or set(plane) & given.keys():
        raise UsageError(
            f"plane is {plane!r}, at has {', '.join(given) or 'nothing'}: expected two states, others in at."
        )
    i, j = (system.state_index(name) for name in plane)
    # Middles of cells: the faces of the box are where symmetric systems have their special states.
    share = (np.arange(resolution) + 0.5) / resolution
    x, y = low[i] + size[i] * share, low[j] + size[j] * share
    middle = low + 0.5 * size
    for name, value in given.items():
        middle[system.state_index(name)] = float(value)
    states = np.tile(middle, (resolution**2, 1))
    states[:, i], states[:, j] = np.tile(x, resolution), np.repeat(y, resolution)
    held = {n: float(middle[k]) for k, n in enumerate(system.states) if n not in plane}
    return x, y, held, states
