"""Systems with impacts: v+ = -e v- at a wall, e the coefficient of restitution (Newton's law of impact)."""

from __future__ import annotations

from filippov import Parameter, Surface, System, cos, parameters, states, t
from filippov.models.registry import Model, register


def bouncing_ball(g: float = 9.81, e: float = 0.7) -> System:
    """y'' = -g above the floor y = 0, v+ = -e v- at it; at rest on it in the limit of its impacts.

    g   gravity [m/s^2]; e   restitution, 0 (plastic) to 1 (elastic)

    From rest at height h the impacts accumulate at sqrt(2 h/g) (1 + e)/(1 - e).
    """
    p = parameters(
        g=Parameter(g, "m/s^2", 0, description="gravity"),
        e=Parameter(e, "", 0, 1, description="restitution"),
    )
    y, v = states("y v")
    return System(
        {y: v, v: -p.g}, surfaces=[Surface("floor", y, reset={v: -p.e * v})], parameters=p,
        labels={"t": "time [s]", "y": "height [m]", "v": "velocity [m/s]"},
    )  # fmt: skip


def impact_oscillator(
    zeta: float = 0.05, F: float = 1.0, omega: float = 2.6, wall: float = 0.0, e: float = 0.8
) -> System:
    """x'' + 2 zeta x' + x = F cos(omega t) on x < wall, v+ = -e v- at the wall x = wall.

    zeta       damping ratio >= 0; time in units of the natural period / 2 pi
    F, omega   amplitude and frequency of the force
    wall, e    place of the wall, restitution

    Source: Shaw & Holmes 1983, J. Sound Vib. 90, 129, the limit of a rigid stop.
    """
    p = parameters(
        zeta=Parameter(zeta, "", 0, description="damping ratio"),
        F=Parameter(F, "", description="amplitude of the force"),
        omega=Parameter(omega, "", 0, description="frequency of the force"),
        wall=Parameter(wall, "", description="place of the wall"),
        e=Parameter(e, "", 0, 1, description="restitution"),
    )
    x, v = states("x v")
    return System(
        {x: v, v: p.F * cos(p.omega * t) - 2 * p.zeta * v - x},
        surfaces=[Surface("wall", p.wall - x, reset={v: -p.e * v})],
        parameters=p,
        labels={"t": "dimensionless time", "x": "position x", "v": "velocity v"},
    )


BALL = register(
    Model(
        "bouncing_ball",
        bouncing_ball,
        (1.0, 0.0),
        (0.0, 2.5),
        "Ball on a floor; its impacts accumulate at 2.5586, shortly after the default end.",
        "Brogliato 2016, Nonsmooth Mechanics; numbers chosen here",
    )
)
OSCILLATOR = register(
    Model(
        "impact_oscillator",
        impact_oscillator,
        (-0.5, 0.0),
        (0.0, 30.0),
        "Forced linear oscillator that hits a rigid wall.",
        "Shaw & Holmes 1983, J. Sound Vib. 90, 129; numbers chosen here",
    )
)
