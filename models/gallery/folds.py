"""Two-folds: both fields are tangent to the surface x = 0 along lines that cross at the origin.

    (x, y, z)' = (-y, a1, b1) for x > 0,   (z, b2, a2) for x < 0

The fold of the upper field is visible for a1 < 0, that of the lower field for a2 < 0. The surface attracts
where y > 0 and z > 0; in a time with dt = (y + z) dtau sliding is (y, z)' = (b2 y + a1 z, a2 y + b1 z).
"""

from __future__ import annotations

from functools import partial
from typing import Any

from filippov import Heaviside, Parameter, Surface, System, parameters, states
from filippov.models.registry import Invariant, Model, register


def folds(a1: float = -1.0, b1: float = 0.0, a2: float = 1.0, b2: float = 0.0) -> System:
    """Return the normal form; the surface "plane" is x = 0.

    a1, a2   rates of y above and of z below the plane, +1 (invisible fold) or -1 (visible)
    b1, b2   rates of z above and of y below the plane
    """
    p = parameters(
        a1=Parameter(a1, "", description="rate of y for x > 0"),
        b1=Parameter(b1, "", description="rate of z for x > 0"),
        a2=Parameter(a2, "", description="rate of z for x < 0"),
        b2=Parameter(b2, "", description="rate of y for x < 0"),
    )
    x, y, z = states("x y z")
    up = Heaviside(x)
    down = 1 - up
    return System(
        {x: -y * up + z * down, y: p.a1 * up + p.b2 * down, z: p.b1 * up + p.a2 * down},
        surfaces=[Surface("plane", x)],
        parameters=p,
        labels={"t": "dimensionless time", "x": "x", "y": "y", "z": "z"},
    )


def _radius(t: float, x: Any, p: Any) -> float:
    """Return y^2 + z^2, constant while sliding for a1 = -1, a2 = 1, b1 = b2 = 0."""
    return float(x[1] ** 2 + x[2] ** 2)


VISIBLE = register(
    Model(
        "visible_fold",
        folds,
        (0.0, 1.0, 0.2),
        (0.0, 3.0),
        "A visible-invisible two-fold: sliding turns about it and leaves at the visible fold.",
        "Jeffrey & Colombo 2009; numbers chosen here",
        (Invariant("y^2 + z^2 while sliding", _radius, "0"),),
    )
)
TEIXEIRA = register(
    Model(
        "teixeira",
        partial(folds, a1=1.0, b1=-0.98, a2=1.0, b2=-0.98),
        (0.0, -0.1, 0.001),
        (0.0, 12.0),
        "Teixeira's invisible two-fold: the solution winds about it through the plane, then slides.",
        "Teixeira 1990; Jeffrey & Colombo 2009; numbers chosen here",
    )
)
