"""An event map for many parameter sets and coordinates at once: each return a trajectory of an ensemble."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from filippov import Status, System
from filippov.analysis.maps.first_return import MOST_STEPS, first_returns
from filippov.analysis.maps.map_units import units_at
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array
from filippov.solving.ensemble import Prepared
from filippov.solving.uncut import whole


class MapRows:
    """R(d; p) for rows of parameters.

    order   the map is the order-th iterate; rtol, threads: of `solve_many`. The absolute tolerance of each
            state comes from `suited`

    NaN stands where a solution does not come back within the section's t_max; one that rests on the section
    comes back as 0, because no further event moves it.
    """

    def __init__(
        self, system: System, section: Section, *, order: int = 1, rtol: float = 1e-7,
        threads: int | None = None,
    ) -> None:  # fmt: skip
        self.system, self.section, self.bound = system, section, section.bind(system)
        self.order = order
        self.options: dict[str, Any] = {"rtol": rtol, "atol": 0.0, "threads": threads}
        self._prepared: Prepared | None = None

    def rows(self, values: Mapping[str, Array], parameters: Mapping[str, float] | None) -> Array:
        """Parameter rows (k, P) from arrays (k,) by name and the values that all have in common."""
        count = len(next(iter(values.values())))
        out = np.tile(self.system.parameters.resolve(parameters), (count, 1))
        for name, column in values.items():
            for extreme in (float(np.min(column)), float(np.max(column))):
                self.system.parameters[name].check(extreme, f"parameter {name!r}")
            out[:, self.system.parameters.index(name)] = column
        return out

    def suited(self, rows: Array, reach: float, share: float) -> MapRows:
        """This map, with absolute tolerances for coordinates from `share` of the reach on: of 1e-3 rtol times
        the least size of a state on returns from there, at the first, middle and last row (k, P)."""
        picked = rows[sorted({0, len(rows) // 2, len(rows) - 1})]
        names = self.system.parameters.names
        named = [dict(zip(names, row.tolist(), strict=True)) for row in picked]
        sizes = [units_at(self.bound, p, reach, row).size for p, row in zip(named, picked, strict=True)]
        self.options["atol"] = 1e-3 * self.options["rtol"] * share * np.min(sizes, axis=0)
        self._prepared = None
        return self

    def __call__(self, rows: Array, d: Array) -> Array:
        """Images of coordinates d (k, q) under parameter rows (k, P), shape (k, q)."""
        return self.returned(rows, d, self.order)

    def returned(self, rows: Array, d: Array, count: int) -> Array:
        """Coordinates after so many returns, whatever the order of the map; shapes as for a call."""
        image = d.ravel().copy()
        every = np.repeat(rows, d.shape[1], axis=0)
        for _ in range(count):
            alive = np.nonzero(np.isfinite(image) & (image != 0.0))[0]
            if alive.size:
                image[alive] = self._first_return(every[alive], image[alive])
        return image.reshape(d.shape)

    def _first_return(self, rows: Array, d: Array) -> Array:
        start = self.bound.start(d, rows)
        if self.section.after:
            named = {name: rows[:, k] for k, name in enumerate(self.system.parameters.names)}
            x, ended, resting = first_returns(self.bound, start, named, **self.options)
        else:
            if self._prepared is None:
                span, stop = (0.0, self.section.t_max), self.section.stop
                self._prepared = Prepared(self.system, span, stop=stop, max_steps=MOST_STEPS, **self.options)
            ends = whole(self._prepared.run(start, rows))
            x, ended = ends.x, list(ends.status)
            resting = np.any(ends.mode[:, self.bound.surfaces] == 0, axis=1)
        back = np.array([status is Status.STOPPED for status in ended])
        done = np.array([status is Status.SUCCESS for status in ended])
        return np.asarray(np.where(back, self.bound.read(x), np.where(done & resting, 0.0, np.nan)))
