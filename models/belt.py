"""A block on a moving belt, held by a spring: x' = v, m v' in -k x - d v - F(v - vb)."""

from __future__ import annotations

from functools import partial
from typing import Any

from filippov import Parameter, System, parameters, states
from filippov.models.friction import AXIS_LABELS, SMALLEST, FrictionLaw, declare
from filippov.models.laws import Hyperbolic, StaticCoulomb, Stribeck
from filippov.models.registry import Invariant, Model, SectionData, register

LAW = Hyperbolic(Fs=1, gamma=3)


def belt(
    friction: FrictionLaw = LAW, m: float = 1.0, k: float = 1.0, d: float = 0.0, vb: float = 0.2
) -> System:
    """Return the block on a belt; the surface "belt" is v = vb.

    friction    a law of the velocity relative to the belt, 1/(1 + 3 |v - vb|) by default
    m, k, d     mass [kg], stiffness [N/m], damping of the mounting [N s/m]
    vb          speed of the belt [m/s], either sign
    """
    p = parameters(
        **declare("m", m, "kg", "mass", SMALLEST),
        **declare("k", k, "N/m", "stiffness of the spring"),
        **declare("d", d, "N s/m", "damping beside the spring"),
        vb=Parameter(vb, "m/s", description="speed of the belt"),
        **friction.parameters(),
    )
    x, v = states("x v")
    slip = v - p.vb
    return System(
        {x: v, v: (-p.k * x - p.d * v - friction.force(slip, p)) / p.m},
        surfaces=friction.surfaces(slip, p, "belt"),
        parameters=p,
        labels=AXIS_LABELS,
    )


def _ride(t: float, x: Any, p: Any) -> float:
    """Return the place on the belt, x - vb t."""
    return float(x[0] - p.vb * t)


RIDE = Invariant("place on the belt in stick", _ride, "0")

ALTERNATE = register(
    Model(
        "belt",
        belt,
        (0.0, 0.0),
        (0.0, 40.0),
        "Block on a moving belt, friction 1/(1 + 3 |v|): stick-slip.",
        "Leine, van Campen, de Kraker, van den Steen 1998",
        (RIDE,),
    )
)
STATIC = register(
    Model(
        "belt_static",
        partial(belt, StaticCoulomb(Fs=1, Fc=0.5)),
        (0.0, 0.0),
        (0.0, 40.0),
        "Block on a moving belt, static friction above Coulomb: stick-slip of period 8.9026.",
        "Karnopp 1985; Leine & Nijmeijer 2004; numbers chosen here",
        (RIDE,),
    )
)
STRIBECK = register(
    Model(
        "belt_stribeck",
        partial(belt, Stribeck(Fs=1, Fc=0.5, vs=0.1, beta=1, b=0.05)),
        (0.0, 0.0),
        (0.0, 40.0),
        "Block on a moving belt, Stribeck friction: stick-slip.",
        "Armstrong-Helouvry, Dupont, Canudas de Wit 1994; numbers chosen here",
        (RIDE,),
        SectionData("belt", "sliding entry", "x", {"x": "d", "v": "vb"}, (-0.9, 0.9)),
    )
)
