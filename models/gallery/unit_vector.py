"""Unit-vector control of a point in the plane: a force of one size, against the direction of the error."""

from __future__ import annotations

from filippov import Parameter, Surface, System, cos, parameters, sign, sin, states
from filippov.models.registry import Model, register


def unit_vector(c: float = 1.0, rho: float = 2.0, a: float = 0.5, omega: float = 3.0) -> System:
    """z'' = -c z' - rho s/|s| + (a + omega J) s with s = z' + c z in the plane, J a quarter turn.

    c       rate of the motion on s = 0 [1/s]; rho   size of the force [m/s^2]
    a, omega  of a disturbance that drives s away and turns it [1/s]

    In polar form s = r (cos q, sin q): r' = a r - rho Sgn(r), q' = omega, and z' = -c z + s for z = (x, y).
    For rho > a r s is 0 after log(rho/(rho - a r))/a, and from there on z falls as exp(-c t).
    """
    p = parameters(
        c=Parameter(c, "1/s", 0, description="rate of the motion on s = 0"),
        rho=Parameter(rho, "m/s^2", 0, description="size of the force"),
        a=Parameter(a, "1/s", description="growth of s by the disturbance"),
        omega=Parameter(omega, "1/s", description="turning of s by the disturbance"),
    )
    x, y, r, q = states("x y r q")
    return System(
        {
            x: -p.c * x + r * cos(q),
            y: -p.c * y + r * sin(q),
            r: p.a * r - p.rho * sign(r),
            q: p.omega,
        },
        surfaces=[Surface("error", r)],
        parameters=p,
        labels={"t": "time [s]", "x": "place x [m]", "y": "place y [m]", "r": "size of s [m/s]",
                "q": "direction of s [rad]"},
    )


MODEL = register(
    Model(
        "unit_vector",
        unit_vector,
        (1.0, 0.0, 2.0, 0.5),
        (0.0, 4.0),
        "Unit-vector control in the plane: a curl until s is 0, then straight to the origin.",
        "Gutman, Leitmann 1976; Edwards, Spurgeon 1998; numbers chosen here",
    )
)
