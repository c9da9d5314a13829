"""What a study asks beyond its cases, as plain data: each part is None or empty where it is not asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.model.system import System

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Ending:
    """The curve of the main case's fold over a second parameter, to an end of `bounds`."""

    parameter: str
    bounds: tuple[float, float]


@dataclass(frozen=True)
class Plane:
    """Cells over the study's parameter (`across`) and another one (`up`), with the exact borders between."""

    parameter: str
    across: tuple[float, float]
    up: tuple[float, float]


@dataclass(frozen=True)
class Tuned:
    """A law for which controller settings without cycles are sought: a registered model, parameter values."""

    label: str
    model: str
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Law:
    """A law that is put to harmonic balance and to the algebra of its slip, a registered model.

    algebra   "" for none; "ratio" of successive stick positions, "cycles" where the force jumps; both for a
              slip that is linear (see `filippov.analysis.harmonic.static_cycle`, whose keywords the model's
              parameters are)
    """

    label: str
    model: str
    algebra: str = ""


@dataclass(frozen=True)
class Experiment:
    """A record made by the exact model with noise, and what is estimated from it.

    t_end, samples   evenly from 0; noise: standard deviation of the first state; seed: of the noise
    force            states (n, k) and parameter values -> the force applied to the plant
    plant            builds the driven plant; guess: starts of the free parameters; fixed: others; windows
    curve            (x, values) -> the constitutive curve, for the figure
    """

    t_end: float
    samples: int
    noise: float
    seed: int
    force: Callable[[Array, Mapping[str, float]], Array]
    plant: Callable[[], System]
    guess: Mapping[str, float]
    fixed: Mapping[str, float]
    windows: int
    curve: Callable[[Array, Mapping[str, float]], Array]


@dataclass(frozen=True)
class Relative:
    """A smoother model of the same system, whose cycles are followed beside the exact ones.

    build      the system; x0: a start that goes to its cycle; transient: time until it is near; method
    beyond     (value, x0) from which a case without a fold in the study's range is followed on
    small      starts (first state) near rest that are followed for `settle` time: does rest attract?
    threshold  largest |second state| of what counts as at rest
    """

    name: str
    build: Callable[[], System]
    x0: Sequence[float]
    transient: float
    method: str
    beyond: tuple[float, Sequence[float]]
    small: tuple[float, ...]
    settle: float
    threshold: float


@dataclass(frozen=True)
class Questions:
    """All of them.

    ranges   of the settings that are tuned, by name; tuned: for which laws, the first one is drawn
    symmetry of the cycles, as in `find_orbit`
    notes    paragraphs by section, with facts in braces
    """

    symmetry: Any = None
    ending: Ending | None = None
    plane: Plane | None = None
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tuned: tuple[Tuned, ...] = ()
    laws: tuple[Law, ...] = ()
    experiment: Experiment | None = None
    relative: Relative | None = None
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
