"""A pendulum with dry friction in its pivot: q' = w, m l^2 w' in -m g l sin q - F(w)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from filippov import System, parameters, sin, states
from filippov.models.friction import SMALLEST, FrictionLaw, declare
from filippov.models.laws import Coulomb
from filippov.models.registry import Invariant, Model, register

LAW = Coulomb(Fc=0.5)
# Units of a law of forces -> of the same law of moments over an angular velocity.
OF_MOMENTS = {"N": "N m", "N s/m": "N m s", "m/s": "rad/s", "s/m": "s/rad", "N s^2/m^2": "N m s^2"}


def pendulum(friction: FrictionLaw = LAW, m: float = 1.0, l: float = 1.0, g: float = 9.81) -> System:
    """Return the pendulum; the law's forces are moments [N m] here and its velocity is w [rad/s].

    friction   Coulomb(Fc=0.5) by default
    m, l, g    bob [kg], length [m], gravity [m/s^2]
    """
    p = parameters(
        **declare("m", m, "kg", "mass of the bob", SMALLEST),
        **declare("l", l, "m", "length", SMALLEST),
        **declare("g", g, "m/s^2", "gravity"),
        **{
            name: replace(q, unit=OF_MOMENTS.get(q.unit, q.unit)) for name, q in friction.parameters().items()
        },
    )
    q, w = states("q w")
    moment = p.m * p.g * p.l * sin(q) + friction.force(w, p)
    return System(
        {q: w, w: -moment / (p.m * p.l**2)}, surfaces=friction.surfaces(w, p, "pivot"), parameters=p,
        labels={"t": "time [s]", "q": "angle [rad]", "w": "angular velocity [rad/s]"},
    )  # fmt: skip


def _angle(t: float, x: Any, p: Any) -> float:
    return float(x[0])


MODEL = register(
    Model(
        "pendulum",
        pendulum,
        (1.0, 0.0),
        (0.0, 10.0),
        "Pendulum with Coulomb friction in the pivot: stops within the dead band.",
        "textbook, for instance Leine & Nijmeijer 2004; numbers chosen here",
        (Invariant("angle in stick", _angle, "0"),),
    )
)
