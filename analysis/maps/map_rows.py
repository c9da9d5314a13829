"""An event map for many parameter sets and coordinates at once: every turn one trajectory of an ensemble."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from filippov.analysis.maps.section import Section
from filippov.analysis.maps.turn import turns
from filippov.base.status import Status
from filippov.model.system import System

Array = npt.NDArray[np.float64]


class MapRows:
    """P(d; p) for rows of parameters.

    order   the map is the order-th iterate; rtol, atol, threads: of `solve_many`

    NaN stands where a motion does not come back within the section's t_max; one that rests on the section
    comes back as 0, because no further event moves it.
    """

    def __init__(
        self, system: System, section: Section, *, order: int = 1, rtol: float = 1e-7, atol: float = 1e-12,
        threads: int | None = None,
    ) -> None:  # fmt: skip
        self.system, self.section, self.bound = system, section, section.bind(system)
        self.order, self.rtol, self.atol, self.threads = order, rtol, atol, threads

    def rows(self, values: Mapping[str, Array], parameters: Mapping[str, float] | None) -> Array:
        """Parameter rows (k, P) from arrays (k,) by name and the values that all have in common."""
        count = len(next(iter(values.values())))
        out = np.tile(self.system.parameters.resolve(parameters), (count, 1))
        for name, column in values.items():
            out[:, self.system.parameters.index(name)] = column
        return out

    def __call__(self, rows: Array, d: Array) -> Array:
        """Images of coordinates d (k, q) under parameter rows (k, P), shape (k, q)."""
        image = d.ravel().copy()
        every = np.repeat(rows, d.shape[1], axis=0)
        for _ in range(self.order):
            alive = np.nonzero(np.isfinite(image) & (image != 0.0))[0]
            if alive.size:
                image[alive] = self._turn(every[alive], image[alive])
        return image.reshape(d.shape)

    def _turn(self, rows: Array, d: Array) -> Array:
        x, ended, resting = turns(
            self.bound, self.bound.start(d, rows),
            {name: rows[:, k] for k, name in enumerate(self.system.parameters.names)},
            rtol=self.rtol, atol=self.atol, threads=self.threads,
        )  # fmt: skip
        back = np.array([status is Status.STOPPED for status in ended])
        done = np.array([status is Status.SUCCESS for status in ended])
        return np.asarray(np.where(back, self.bound.read(x), np.where(done & resting, 0.0, np.nan)))
