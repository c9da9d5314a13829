"""The effort of a study."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from filippov.base.errors import UsageError

# What a resolution changes, with the least of it.
LEAST = {"points": 100, "samples": 50, "cells": (4, 4), "tune": (16, 12), "grid": 4, "follow": 2}


@dataclass(frozen=True)
class Effort:
    """Numbers of points.

    cells      of the region map; tune: samples and excursions; grid: of the ratio map
    follow     points of a branch of the smoother model after its fold; relatives: cases it is computed for
    """

    points: int = 400
    samples: int = 500
    stride: int = 1
    stages: tuple[int, int] = (160, 200)
    tolerances: tuple[float, float] = (1e-10, 1e-13)
    shooting: float = 1e-12
    iterates: int = 30
    widths: int = 1
    cells: tuple[int, int] = (28, 17)
    tune: tuple[int, int] = (32, 16)
    grid: int = 20
    follow: int = 12
    relatives: int | None = None

    @classmethod
    def quick(cls) -> Effort:
        """Coarser, for a trial run."""
        return cls(
            200, 160, 3, (100, 160), shooting=1e-9, widths=3, cells=(10, 7), tune=(16, 12), grid=8, follow=4,
            relatives=1,
        )  # fmt: skip

    def finer(self, resolution: float) -> Effort:
        """The number of points in maps and searches times a factor. Raises UsageError outside 0.1 ... 20."""
        if not 0.1 <= resolution <= 20:
            raise UsageError(f"resolution is {resolution:g}, expected a factor of 0.1 to 20.")

        def times(count: Any, least: Any) -> Any:
            if isinstance(count, tuple):
                return tuple(map(times, count, least))
            return max(least, round(resolution * count))

        return replace(self, **{name: times(getattr(self, name), least) for name, least in LEAST.items()})
