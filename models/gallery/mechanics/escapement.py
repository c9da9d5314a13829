"""A clock: a pendulum with dry friction that is given a kick each time it swings up through the middle."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, sqrt, states
from filippov.models.registry import Model, register


def escapement(omega: float = 1.0, f: float = 0.05, kick: float = 0.4) -> System:
    """x'' in -omega^2 x - f Sgn(x'), and v+ = sqrt(v-^2 + kick) at x = 0 with v > 0.

    omega   frequency of the pendulum [rad/s]; f   dry friction [rad/s^2]
    kick    twice the energy of a kick [rad^2/s^2]

    It settles where a kick makes up for a period's friction, at an amplitude of kick/(8 f) + f/omega^2.
    """
    p = parameters(
        omega=Parameter(omega, "rad/s", 1e-12, description="frequency of the pendulum"),
        f=Parameter(f, "rad/s^2", 0, description="dry friction"),
        kick=Parameter(kick, "rad^2/s^2", 0, description="twice the energy of a kick"),
    )
    x, v = states("x v")
    return System(
        {x: v, v: -(p.omega**2) * x - p.f * sign(v)},
        surfaces=[
            Surface("velocity", v),
            Surface("middle", x, reset={v: sqrt(v**2 + p.kick)}, side="-"),
        ],
        parameters=p,
        labels={"t": "time [s]", "x": "angle [rad]", "v": "angular velocity [rad/s]"},
    )


MODEL = register(
    Model(
        "escapement",
        escapement,
        (-0.5, 0.0),
        (0.0, 60.0),
        "A clock's pendulum with dry friction and an escapement: its amplitude settles at 1.05.",
        "Andronov, Vitt, Khaikin 1966; numbers chosen here",
    )
)
