"""A mass under a measured force, one sampling interval at a time: what identification runs on.

    x' = T v,   m v' in T (u(tau) - F(v)),   u = force + change tau + bend tau^2 + twist tau^3

tau in [0, 1] is time in units of the interval T [s]; u is the applied force as a cubic in it.
"""

from __future__ import annotations

from filippov import Parameter, System, parameters, states, t
from filippov.models.friction import SMALLEST, FrictionLaw, declare
from filippov.models.mass import REFERENCE_LAW


def driven_mass(friction: FrictionLaw = REFERENCE_LAW, m: float = 1.0) -> System:
    """Return the mass; parameters m, those of the law, and force, change, bend, twist [N], interval [s]."""
    p = parameters(
        **declare("m", m, "kg", "mass", SMALLEST),
        **friction.parameters(),
        force=Parameter(0.0, "N", description="applied force at the start of the interval"),
        change=Parameter(0.0, "N", description="linear term of the applied force"),
        bend=Parameter(0.0, "N", description="quadratic term of the applied force"),
        twist=Parameter(0.0, "N", description="cubic term of the applied force"),
        interval=Parameter(1.0, "s", SMALLEST, description="length of the interval"),
    )
    x, v = states("x v")
    force = p.force + t * (p.change + t * (p.bend + t * p.twist)) - friction.force(v, p)
    return System(
        {x: p.interval * v, v: p.interval * force / p.m},
        surfaces=friction.surfaces(v, p),
        parameters=p,
        labels={"x": "position [m]", "v": "velocity [m/s]"},
    )
