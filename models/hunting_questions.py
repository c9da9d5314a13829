"""What the hunting study asks beyond the reference paper: cycles, borders, tuning, data, LuGre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from filippov.models.driven import driven_mass
from filippov.models.hunting_notes import NOTES
from filippov.models.laws import Stribeck
from filippov.models.lugre import hunting_lugre
from filippov.models.questions import Ending, Experiment, Law, Plane, Questions, Relative, Tuned

Array = npt.NDArray[np.float64]


def applied_force(states: Array, values: Mapping[str, float]) -> Array:
    """-u = -P (x + D v + I z) [N] of states (3, k)."""
    x, v, z = states
    return np.asarray(-values["P"] * (x + values["D"] * v + values["I"] * z))


def friction_curve(v: Array, values: Mapping[str, float]) -> Array:
    """F(v) [N] of the Stribeck law off v = 0."""
    known = Stribeck().parameters()
    return Stribeck(**{name: values[name] for name in known if name in values}).curve(v)


QUESTIONS = Questions(
    symmetry="odd",
    ending=Ending("beta", (1.0, 2.0)),
    plane=Plane("I", across=(4.0, 31.0), up=(4.0, 20.0)),
    ranges={"P": (8.0, 40.0), "I": (4.0, 20.0)},
    tuned=(
        Tuned("β = 2", "hunting", {"beta": 2.0}),
        Tuned("β = 1", "hunting", {"beta": 1.0}),
        Tuned("β = 0.5", "hunting", {"beta": 0.5}),
        Tuned("static + Coulomb", "hunting_static"),
    ),
    laws=(
        Law("Stribeck, β = 2", "hunting"),
        Law("Coulomb", "hunting_coulomb", "ratio"),
        Law("static + Coulomb", "hunting_static", "cycles"),
    ),
    experiment=Experiment(
        t_end=5.0, samples=501, noise=1e-5, seed=7, force=applied_force, plant=driven_mass,
        guess={"Fs": 3.4, "Fc": 2.5, "vs": 0.16, "b": 0.5}, fixed={"m": 1.0, "beta": 2.0}, windows=2,
        curve=friction_curve,
    ),
    relative=Relative(
        "LuGre", hunting_lugre, x0=(0.3, 0.0, 0.0, 0.0), transient=100.0, method="Radau",
        beyond=(60.0, (0.05, 0.0, 0.0, 0.0)), small=(1e-4,), settle=200.0, threshold=1e-6,
    ),
    notes=NOTES,
)  # fmt: skip
