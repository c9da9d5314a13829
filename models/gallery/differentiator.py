"""Levant's differentiator: it finds the slope of a signal exactly, in a finite time."""

from __future__ import annotations

from filippov import Abs, Parameter, Surface, System, parameters, sign, sqrt, states, t
from filippov.models.registry import Model, register


def differentiator(
    c1: float = 1.0, c0: float = 1.1, slope: float = 1.0, bend: float = 0.2, L: float = 1.0
) -> System:
    """z0' in z1 - c1 sqrt(L |e|) Sgn(e), z1' in -c0 L Sgn(e), e = z0 - slope t - bend t^2/2.

    c1, c0        gains; L   bound of the second derivative of the signal, above |bend|
    slope, bend   of the signal slope t + bend t^2/2

    z1 tends to slope + bend t. Its error turns its sign from one zero of e to the next and shrinks by
    exp(-g pi/sqrt(8 a - g^2)), g = c1 sqrt(L), a = c0 L +- bend.
    """
    p = parameters(
        c1=Parameter(c1, "", 0, description="gain of the root"),
        c0=Parameter(c0, "", 0, description="gain of the integrator"),
        slope=Parameter(slope, "1/s", description="slope of the signal"),
        bend=Parameter(bend, "1/s^2", description="second derivative of the signal"),
        L=Parameter(L, "1/s^2", 0, description="bound of the second derivative"),
    )
    z0, z1 = states("z0 z1")
    e = z0 - p.slope * t - p.bend * t**2 / 2
    return System(
        {z0: z1 - p.c1 * sqrt(p.L * Abs(e)) * sign(e), z1: -p.c0 * p.L * sign(e)},
        surfaces=[Surface("error", e)],
        parameters=p,
        labels={"t": "time [s]", "z0": "estimate z0", "z1": "slope z1 [1/s]"},
    )


MODEL = register(
    Model(
        "differentiator",
        differentiator,
        (0.0, 0.0),
        (0.0, 1.9),
        "Levant's exact differentiator: the slope of a signal in a finite time.",
        "Levant 1998; numbers chosen here",
    )
)
