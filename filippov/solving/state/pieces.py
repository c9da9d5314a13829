"""The pieces of inputs that a run stands on, each from one knot to the next."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.kernel.codegen.input_slots import EACH, FIRST
from filippov.model.signals.samples import ROOM, Samples


class Pieces:
    """The present piece of each input, written into the context that kernels read.

    A run holds a piece from knot to knot, so that the field is smooth in its steps; where nothing is held,
    the piece is that of the time asked for.
    """

    def __init__(self, inputs: tuple[Samples, ...], context: npt.NDArray[np.int64]) -> None:
        self.inputs, self.context = inputs, context
        self.held = False
        self.now: list[tuple[float, float]] = [(np.nan, np.nan)] * len(inputs)

    def hold(self, bounds: list[tuple[float, float]]) -> None:
        """Stay on the pieces between these knots until told otherwise."""
        self.held = True
        for k, (low, high) in enumerate(bounds):
            self._put(k, low, high)

    def at(self, t: float, side: str = "+") -> None:
        """Take the pieces of a time, unless others are held."""
        if self.held:
            return
        when = t if side == "+" else float(np.nextafter(t, -np.inf))
        for k, samples in enumerate(self.inputs):
            self._put(k, *samples.neighbours(when))

    def like(self, other: Pieces) -> None:
        """Hold what another machine of the run holds."""
        for k, samples in enumerate(self.inputs):
            for q, known in enumerate(other.inputs):
                if known.name == samples.name:
                    self._put(k, *other.now[q])
        self.held = other.held

    def _put(self, k: int, low: float, high: float) -> None:
        if self.now[k] == (low, high):
            return
        self.now[k] = low, high
        begin, coef = self.inputs[k].piece(low, high)
        numbers = np.empty(EACH)
        numbers[0], numbers[1 : 1 + ROOM] = begin, coef
        at = FIRST + EACH * k
        self.context[at : at + EACH] = numbers.view(np.int64)
