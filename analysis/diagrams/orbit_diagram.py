"""Bifurcation diagram of a section without a parametrisation: periodic orbits followed over a parameter.

The orbit that the solution from one state goes to is followed by pseudo-arclength continuation, and so is
each branch that leaves it at a period doubling, a branch point or a symmetry breaking; all on full states.
The section tells what is read off an orbit: the coordinate at each of its events in a period.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov import ModelError, SolveError, System, UsageError
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.switch import SWITCHES, switch
from filippov.analysis.diagrams.diagram import Diagram, DiagramBranch, Special, diagram_labels
from filippov.analysis.diagrams.orbit_points import largest, read, section_period
from filippov.analysis.maps.find_section import find_section
from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.analysis.maps.returns import returns
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit

# Most points of one branch for each value that is asked for.
_POINTS_EACH = 20


@dataclass(frozen=True)
class OrbitDiagram(Diagram):
    """A bifurcation diagram of orbits; `values` are those of the points that the continuation took.

    messages  how each branch ended, and what else was found
    """

    messages: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data, without the branches."""
        return super().to_dict() | {"messages": list(self.messages)}

    def _told(self) -> list[str]:
        return [*super()._told(), *self.messages]


def orbit_diagram(
    system: System, section: Section | Stroboscope | None, parameter: str, values: Sequence[float], x0: Any,
    *, parameters: Mapping[str, float] | None = None, transient: int = 200, rtol: float = 1e-10,
    progress: Callable[[int, int], None] | None = None,
) -> OrbitDiagram:  # fmt: skip
    """The orbit that attracts the solution from x0, and those that branch off it, over the range of `values`.

    section    None: found (`filippov.analysis.maps.find_section`)
    values     the orbit is looked for at the first, the last and the one in the middle, in this order; their
               number sets how far apart the points of a branch are at most
    transient  events of the section before the orbit is looked for

    Raises UsageError where there is no section or no orbit at any of the three, ModelError.
    """
    ordered = [float(v) for v in values]
    if len(set(ordered)) < 2:
        raise UsageError(f"values are {ordered}, expected two or more that differ.")
    section, orbit = _first_orbit(
        system, section, parameter, ordered, x0, dict(parameters or {}), transient, rtol
    )
    low, high = min(ordered), max(ordered)
    step = 1.0 / (len(ordered) - 1)
    options: dict[str, Any] = {
        "step": min(0.02, step), "max_step": min(0.1, step), "max_points": _POINTS_EACH * len(ordered)
    }
    run = continuation(system, orbit, parameter=parameter, bounds=(low, high), **options)
    messages = [f"from {parameter} = {orbit.parameters[parameter]:g}: {_followed(run, progress)}"]
    runs = [run]
    for point in [point for point in run.branch.special if point.special in SWITCHES]:
        try:
            # Both halves of what leaves at a period doubling are the same orbits.
            other = switch(run, point, direction=int(point.special == "period doubling"), **options)
            messages.append(f"{point.special} at {point.value:.9g}: {_followed(other, progress)}")
            runs.append(other)
        except (SolveError, ModelError, UsageError, ArithmeticError) as error:
            messages.append(f"{point.special} at {point.value:.9g}: no branch was followed, {error}")
    return _diagram(system, section, parameter, runs, messages)


def _followed(run: Continuation, progress: Callable[[int, int], None] | None) -> str:
    def told(done: float, every: float, _: str) -> None:
        if progress is not None:
            progress(int(done), int(every))

    run.run(told)
    if run.branch.interrupted:
        raise KeyboardInterrupt
    return run.branch.message


def _first_orbit(
    system: System, section: Section | Stroboscope | None, parameter: str, values: Sequence[float], x0: Any,
    parameters: dict[str, float], transient: int, rtol: float,
) -> tuple[Section | Stroboscope, Orbit]:  # fmt: skip
    said = []
    for value in (values[0], values[-1], values[len(values) // 2]):
        here = {**parameters, parameter: value}
        try:
            found = section or find_section(system, x0, parameters=here)
            led = returns(system, found, x0, transient, parameters=here, rtol=rtol)
            if led.message:
                said.append(f"{parameter} = {value:g}: {led.message}")
                continue
            orbit = find_orbit(system, led.x[-1], parameters=here, t0=float(led.t[-1]))
        except (UsageError, ModelError, SolveError, ArithmeticError) as error:
            said.append(f"{parameter} = {value:g}: {error}")
            continue
        return found, orbit
    raise UsageError(
        f"no orbit was found to follow over {parameter}. " + " ".join(said) + " Start from another state, or "
        "choose values at which the solution returns."
    )


def _diagram(
    system: System, section: Section | Stroboscope, parameter: str, runs: Sequence[Continuation],
    messages: Sequence[str],
) -> OrbitDiagram:  # fmt: skip
    values: list[float] = []
    points: list[tuple[FixedPoint, ...]] = []
    branches: list[DiagramBranch] = []
    special: list[Special] = []
    for run in runs:
        part: list[tuple[float, tuple[FixedPoint, ...]]] = []
        for point in run.branch.points:
            read = tuple(sorted(_read(system, section, run, point), key=lambda q: q.d))
            part.append((point.value, read))
            known = any(s.kind == point.special and _near(s.value, point.value) for s in special)
            if point.special and not (known and run is not runs[0]):
                d = read[-1].d if read else float("nan")
                left = _defect(point)
                special.append(Special(point.special, point.value, d, left, point.note or point.predicts))
        branches += _lines(part)
        values += [value for value, _ in part]
        points += [read for _, read in part]
    return OrbitDiagram(
        parameter, tuple(values), tuple(points), tuple(branches), tuple(special),
        {k: v for k, v in runs[0].branch.parameters.items() if k != parameter}, None, section,
        diagram_labels(system, section, parameter), tuple(messages),
    )


def _read(
    system: System, section: Section | Stroboscope, run: Continuation, point: BranchPoint
) -> list[FixedPoint]:
    """The orbit as the fixed points of the map, one for each event of the section in its period."""
    x0 = np.array(point.u)[: system.dimension]
    values = {**run.branch.parameters, run.branch.parameter: point.value}
    length, turns = section_period(system, section, point.period, values)
    found = read(system, section, x0, point.phase * point.period, length, values)
    slope = largest(point.multipliers, turns)
    return [
        FixedPoint(d, "limit cycle", slope, point.verdict, point.residual, length, point.note)
        for d in found.tolist()
    ]


def _near(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-7 * max(abs(one), abs(other))


def _defect(point: BranchPoint) -> float:
    """How far a multiplier is off what the special point asks for, or the residual of the equations."""
    wanted = {"period doubling": -1.0, "fold": 1.0}.get(point.special)
    if wanted is None or not point.multipliers:
        return point.residual
    return max(point.residual, min(abs(m - wanted) for m in point.multipliers))


def _lines(part: Sequence[tuple[float, tuple[FixedPoint, ...]]]) -> list[DiagramBranch]:
    """One line for each event in the period, as long as their number stays."""
    out: list[DiagramBranch] = []
    begin = 0
    for k in range(1, len(part) + 1):
        if k == len(part) or len(part[k][1]) != len(part[begin][1]):
            piece = part[begin:k]
            out += [
                DiagramBranch(tuple(v for v, _ in piece), tuple(read[i] for _, read in piece))
                for i in range(len(piece[0][1]))
            ]
            begin = k
    return out
