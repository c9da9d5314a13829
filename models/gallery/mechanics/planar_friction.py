"""A parcel that slides from one conveyor belt onto another across it: dry friction in the plane."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, sqrt, states
from filippov.models.registry import Model, register


def planar_friction(U: float = 1.5, V: float = 1.0, mu: float = 0.4, g: float = 9.81) -> System:
    """x' = w U/S, y' = V - w V/S, w' in -mu g Sgn(w), S^2 = U^2 + V^2: friction -mu m g u/|u| in the plane.

    U, V    speed of the parcel when it arrives, along x, and of the belt, along y [m/s]
    mu, g   coefficient of friction, gravity [m/s^2]
    w       slip speed |u|, S when the parcel arrives

    Isotropic friction acts against the slip velocity u = (x', y' - V). No other force acts in the plane, so
    the direction of u stays and its size is the one signed speed w; the parcel rides with the belt after
    S/(mu g), x = U S/(2 mu g) further on. A force across u would turn it: then the law is a disk of forces at
    u = 0, which the signs of switching functions do not hold.
    """
    p = parameters(
        U=Parameter(U, "m/s", description="speed of the parcel as it arrives"),
        V=Parameter(V, "m/s", description="speed of the belt"),
        mu=Parameter(mu, "", 0, description="coefficient of friction"),
        g=Parameter(g, "m/s^2", 0, description="gravity"),
    )
    x, y, w = states("x y w")
    S = sqrt(p.U**2 + p.V**2)
    return System(
        {x: w * p.U / S, y: p.V - w * p.V / S, w: -p.mu * p.g * sign(w)},
        surfaces=[Surface("slip", w)],
        parameters=p,
        labels={"t": "time [s]", "x": "position x [m]", "y": "position y [m]", "w": "slip speed [m/s]"},
    )


MODEL = register(
    Model(
        "planar_friction",
        planar_friction,
        (0.0, 0.0, (1.5**2 + 1.0) ** 0.5),
        (0.0, 1.0),
        "A parcel put onto a belt from the side: a parabola, then it rides along.",
        "Goyal, Ruina, Papadopoulos 1991; numbers chosen here",
    )
)
