"""A drill string: the top is turned, the bit sticks to the rock and slips, with a spring between them."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Model, register


def drill_string(
    J1: float = 2000.0,
    J2: float = 370.0,
    k: float = 470.0,
    d: float = 20.0,
    c: float = 2000.0,
    speed: float = 2.0,
    Ts: float = 2000.0,
    Tc: float = 1000.0,
) -> System:
    """twist' = w1 - w2, J1 w1' = c (speed - w1) - q, J2 w2' in q - T(w2), q = k twist + d (w1 - w2).

    J1, J2      inertias of the top and of the bit [kg m^2]
    k, d        stiffness [N m/rad] and damping [N m s/rad] of the string
    c, speed    gain of the speed control [N m s/rad] and its set point [rad/s]
    Ts, Tc      torque on the bit at rest, at most, and in slip [N m]
    """
    p = parameters(
        J1=Parameter(J1, "kg m^2", 1e-12, description="inertia of the top"),
        J2=Parameter(J2, "kg m^2", 1e-12, description="inertia of the bit"),
        k=Parameter(k, "N m/rad", 0, description="stiffness of the string"),
        d=Parameter(d, "N m s/rad", 0, description="damping of the string"),
        c=Parameter(c, "N m s/rad", 0, description="gain of the speed control"),
        speed=Parameter(speed, "rad/s", description="set point of the speed"),
        Ts=Parameter(Ts, "N m", 0, description="largest torque on the bit at rest"),
        Tc=Parameter(Tc, "N m", 1e-12, description="torque on the bit in slip"),
    )
    twist, w1, w2 = states("twist w1 w2")
    q = p.k * twist + p.d * (w1 - w2)
    return System(
        {
            twist: w1 - w2,
            w1: (p.c * (p.speed - w1) - q) / p.J1,
            w2: (q - p.Tc * sign(w2)) / p.J2,
        },
        surfaces=[Surface("bit", w2, radius=p.Ts / p.Tc)],
        parameters=p,
        labels={
            "t": "time [s]", "twist": "twist [rad]", "w1": "speed of the top [rad/s]",
            "w2": "speed of the bit [rad/s]",
        },
    )


MODEL = register(
    Model(
        "drill_string",
        drill_string,
        (0.0, 2.0, 0.0),
        (0.0, 60.0),
        "A drill string with two inertias: the bit sticks and slips.",
        "Jansen, van den Steen 1995; numbers chosen here",
    )
)
