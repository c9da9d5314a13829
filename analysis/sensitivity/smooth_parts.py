"""The parts of a solution in one mode, and what their transition matrices owe to the field at their ends."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from filippov.analysis.sensitivity.variation import ModeField
from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.state.interpolant import Interpolant

# A step of fewer roundings of the time than this is not known to 1e-8 of its length.
SHORT = 1e8


@dataclass(frozen=True)
class Smooth:
    """A part of a segment: starts and steps, where it ends.

    leaving   G_y and y' of the exit that it begins with; arriving: G_y of the surface that it ends on
    """

    mode: Mode
    start: Array
    step: Array
    t: float
    x: Array
    leaving: tuple[Array, Array] | None
    arriving: Array | None

    @property
    def resolved(self) -> bool:
        """Whether the rounding of the time is nothing beside all of its steps."""
        return bool(np.min(np.abs(self.step)) > SHORT * np.spacing(abs(self.t)))


def cut(sol: Interpolant, whole: Smooth, cuts: Array) -> list[Smooth]:
    """The parts of a segment between the times `cuts` that lie in it."""
    sense, edges = sol.direction, np.append(whole.start, whole.t)
    inside = cuts[(sense * cuts > sense * edges[0]) & (sense * cuts < sense * whole.t)]
    if not inside.size:
        return [whole]
    edges = sense * np.unique(sense * np.concatenate((edges, inside)))
    places = [0, *np.searchsorted(sense * edges, sense * inside).tolist(), edges.size - 1]
    return [
        Smooth(
            whole.mode, edges[first:last], np.diff(edges[first : last + 1]), float(edges[last]),
            sol(edges[last], side="+") if last < places[-1] else whole.x, None if first else whole.leaving,
            whole.arriving if last == places[-1] else None,
        )
        for first, last in itertools.pairwise(places)
    ]  # fmt: skip


def along(
    field: ModeField, matrix: Array, part: Smooth, slope: Array, velocity: Array, p: Array
) -> Array:
    """A transition matrix from an exit, made to carry y' at the exit into y' at its end, as the flow does.

    Next to a surface where the field has an infinite slope, the quadrature excites a solution that only a
    displacement across the manifold of exits excites; what moves along y' is known without it.
    """
    return _carrying(matrix, slope, velocity, field.velocity_at(part.t, part.x, p))


def arrived(field: ModeField, matrix: Array, part: Smooth, slope: Array, start: Array, p: Array) -> Array:
    """A transition matrix up to a surface, made to carry y' at its start into y' at its end, as flows do.

    Where the field grows so fast that rounding of the time moves the state (a spike of a neuron: 1e15 mV/s),
    the matrix ends beside the surface: by a part of the flow that acts on G_y dy.
    """
    begin = field.velocity_at(float(part.start[0]), start, p)
    return _carrying(matrix, slope @ matrix, begin, field.velocity_at(part.t, part.x, p))


def _carrying(matrix: Array, slope: Array, begin: Array, end: Array) -> Array:
    """The matrix that takes `begin` to `end`, changed for what moves `slope` alone."""
    return np.asarray(matrix + np.outer(end - matrix @ begin, slope) / (slope @ begin))
