"""A ball on a table that moves up and down: periodic bounces, cascades and chaos of the same law."""

from __future__ import annotations

from filippov import Parameter, Surface, System, cos, parameters, sin, states, t
from filippov.models.registry import Model, register


def ball_on_table(A: float = 0.11, omega: float = 10.0, e: float = 0.5, g: float = 9.81) -> System:
    """x'' = -g on x > w(t), w = A sin(omega t), v+ = (1 + e) w' - e v- at the table.

    A, omega  amplitude [m] and frequency [rad/s] of the table; e   restitution; g   gravity [m/s^2]

    With T = 2 pi/omega a bounce a period meets the table where w' = g T (1 - e)/(2 (1 + e)).
    """
    p = parameters(
        A=Parameter(A, "m", 0, description="amplitude of the table"),
        omega=Parameter(omega, "rad/s", 0, description="frequency of the table"),
        e=Parameter(e, "", 0, 1, description="restitution"),
        g=Parameter(g, "m/s^2", 0, description="gravity"),
    )
    x, v = states("x v")
    speed = p.A * p.omega * cos(p.omega * t)
    impact = {v: (1 + p.e) * speed - p.e * v}
    return System(
        {x: v, v: -p.g},
        surfaces=[Surface("table", x - p.A * sin(p.omega * t), reset=impact)],
        parameters=p,
        outputs={"table": p.A * sin(p.omega * t)},
        labels={"t": "time [s]", "x": "height [m]", "v": "speed [m/s]", "table": "table [m]"},
    )


MODEL = register(
    Model(
        "ball_on_table",
        ball_on_table,
        (0.3, -2.0),
        (0.0, 15.0),
        "A ball on a shaken table: it settles to one bounce a period.",
        "Guckenheimer, Holmes 1983, section 2.4; numbers chosen here",
    )
)
