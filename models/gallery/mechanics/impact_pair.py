"""An impact pair: a body flies back and forth between the two walls of a shaken box."""

from __future__ import annotations

from filippov import Parameter, Surface, System, cos, parameters, sin, states, t
from filippov.models.registry import Model, register


def impact_pair(gap: float = 2.0, A: float = 1.0, omega: float = 1.0, e: float = 0.6) -> System:
    """x'' = 0 on |x - w(t)| < gap/2, w = A sin(omega t), v+ = (1 + e) w' - e v- at a wall.

    gap        room between the walls [m]
    A, omega   amplitude [m] and frequency [rad/s] of the box
    e          restitution
    """
    p = parameters(
        gap=Parameter(gap, "m", 0, description="room between the walls"),
        A=Parameter(A, "m", 0, description="amplitude of the box"),
        omega=Parameter(omega, "rad/s", 0, description="frequency of the box"),
        e=Parameter(e, "", 0, 1, description="restitution"),
    )
    x, v = states("x v")
    place, speed = p.A * sin(p.omega * t), p.A * p.omega * cos(p.omega * t)
    impact = {v: (1 + p.e) * speed - p.e * v}
    return System(
        {x: v, v: 0 * x},
        surfaces=[
            Surface("right", p.gap / 2 + place - x, reset=impact),
            Surface("left", x + p.gap / 2 - place, reset=impact),
        ],
        parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


MODEL = register(
    Model(
        "impact_pair",
        impact_pair,
        (0.0, 0.5),
        (0.0, 40.0),
        "A body between the walls of a shaken box: two impacts a period.",
        "Bapat, Popplewell, McLachlan 1983; numbers chosen here",
    )
)
