"""One attractor: what it is, where it lies, and how far a state is from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from filippov import Solution, System, UsageError
from filippov.analysis.orbits.orbit import Orbit
from filippov.base.arrays import Array
from filippov.base.shown import Told

AttractorKind = Literal["equilibrium", "equilibrium set", "periodic", "chaotic", "aperiodic"]
# Points of a period between which an autonomous orbit is taken for straight.
POINTS = 2000
_STABLE = 1e-6


@dataclass(frozen=True, eq=False)
class Attractor(Told):
    """A set that attracts solutions.

    kind         "equilibrium"; "equilibrium set": connected, such as the states in which friction holds;
                 "periodic"; "chaotic": the largest Lyapunov exponent is positive beyond its error;
                 "aperiodic":
                 recurrent, but neither was shown (quasiperiodic, or a period beyond the search)
    states       states on it, (k, n): the point; rests that were found in the set; the strobes of a period in
                 order; the events of an autonomous orbit or its states at equal times; samples otherwise
    period       number of strobes or section events after which it repeats; None where there are none
    duration     period in time, None where there is none
    multipliers  of a periodic orbit (Floquet, the trivial one taken out); of an equilibrium those of the
                 flow over one strobe or step, `duration` of the search, 0 for directions that a slide loses
    exponent     largest Lyapunov exponent with its error, (nan, nan) where it was not computed
    stable       True or False by the multipliers; None where they do not decide, and where there are none;
                 True for a periodic orbit without them, to which states beside it came back
    drawn        True for an equilibrium without them, to which states beside it came back
    low, high    extent by state, (n,)
    orbit        the periodic orbit; None where the flow has no derivative along it, as the note says
    note         further remarks
    """

    _also = ("stable",)
    _untold = ("curve", "cells")

    kind: AttractorKind
    states: Array
    period: int | None = None
    duration: float | None = None
    multipliers: npt.NDArray[np.complex128] = field(default_factory=lambda: np.zeros(0, dtype=complex))
    exponent: tuple[float, float] = (float("nan"), float("nan"))
    low: Array = field(default_factory=lambda: np.zeros(0))
    high: Array = field(default_factory=lambda: np.zeros(0))
    orbit: Orbit | None = None
    note: str = ""
    drawn: bool = False
    curve: Array | None = field(default=None, repr=False)
    cells: npt.NDArray[np.uint64] | None = field(default=None, repr=False)

    @property
    def stable(self) -> bool | None:
        """Whether the multipliers say that it attracts all states near it."""
        sizes = np.abs(self.multipliers)
        if self.drawn and not sizes.size:
            return True
        if self.kind in ("chaotic", "aperiodic") or (self.kind != "periodic" and not sizes.size):
            return None
        if np.any(sizes > 1 + _STABLE):
            return False
        return True if np.all(sizes < 1 - _STABLE) else None

    def __str__(self) -> str:
        text: str = self.kind
        if self.kind == "periodic":
            turns = f" ({self.period} periods of the map)" if self.period is not None else ""
            text = f"periodic, T = {self.duration:.9g}{turns}"
        elif self.kind in ("chaotic", "aperiodic") and np.isfinite(self.exponent[0]):
            text = f"{self.kind}, largest exponent {self.exponent[0]:.4g} +- {self.exponent[1]:.2g}"
        where = ", ".join(f"{v:.6g}" for v in self.states[0])
        if self.kind == "equilibrium set":
            lows = ", ".join(f"{a:.6g} ... {b:.6g}" for a, b in zip(self.low, self.high, strict=True))
            return f"{text}, rests found in ({lows})"
        return f"{text}, at ({where})"

    def distance(self, x: Array, size: Array) -> Array:
        """Distance of states (k, n) in units of the sizes (n,): (k,); NaN for one known by its cells only."""
        if self.cells is not None:
            return np.full(len(x), np.nan)
        y = x / size
        if self.curve is None:
            points = self.states / size
            return np.asarray(np.min(np.linalg.norm(y[:, None, :] - points[None], axis=2), axis=1))
        from scipy.spatial import cKDTree

        line = self.curve / size
        near = cKDTree(line).query(y)[1]
        out = np.full(len(x), np.inf)
        for step in (-1, 0):  # the two chords beside the nearest point of the closed curve
            a = line[(near + step) % len(line)]
            b = line[(near + step + 1) % len(line)]
            along = b - a
            square = np.maximum(np.sum(along**2, axis=1), 1e-300)
            share = np.clip(np.sum((y - a) * along, axis=1) / square, 0.0, 1.0)
            out = np.minimum(out, np.linalg.norm(y - a - share[:, None] * along, axis=1))
        return out

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], system: System) -> Attractor:
        """The attractor that `to_dict` described. Raises UsageError for data that do not describe one."""
        try:
            orbit = None if data["orbit"] is None else Orbit.from_dict(data["orbit"], system)
            values = np.array([complex(*pair) for pair in data["multipliers"]], dtype=complex)
            points = np.array(data["states"], dtype=float)
            if points.ndim != 2 or not len(points) or points.shape[1] != system.dimension:
                raise ValueError(f"states have shape {points.shape}, expected (k, {system.dimension})")
            return cls(
                data["kind"], points, data["period"], data["duration"], values,
                (float(data["exponent"][0]), float(data["exponent"][1])), np.array(data["low"], dtype=float),
                np.array(data["high"], dtype=float), orbit, str(data["note"]), bool(data.get("drawn", False)),
            )  # fmt: skip
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise UsageError(f"these data describe no attractor ({type(error).__name__}: {error}).") from None


def curve_of(orbit: Orbit) -> Array:
    """States of one period at equal times, and at both sides of its events: (k, n)."""
    return samples_of(orbit.solution())


def samples_of(solution: Solution) -> Array:
    """States of a solution at equal times, and at both sides of its events: (k, n)."""
    assert solution.sol is not None
    t = np.unique(np.concatenate([
        np.linspace(solution.problem.t_span[0], solution.t_end, POINTS),
        np.array([e.t for e in solution.events], dtype=float),
    ]))  # fmt: skip
    return np.asarray(solution.sol(t).T)
