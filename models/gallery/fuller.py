"""Fuller's problem: a double integrator is led to 0 with the least integral of x^2 by |u| <= 1."""

from __future__ import annotations

import math

from filippov import Abs, Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Model, register


def fuller(c: float = math.sqrt((math.sqrt(33) - 1) / 24)) -> System:
    """x' = v, v' in -Sgn(x + c v |v|): infinitely many switchings in a finite time.

    c   of the switching curve x = -c v |v|; optimal at sqrt((sqrt(33) - 1)/24) = 0.4446236

    From one switching to the next speeds and times shrink by sqrt((1 - 2 c)/(1 + 2 c)) = 1/4.13016.
    From (1, 0) the switchings accumulate at 2/(sqrt(1/2 + c) (1 - 1/4.13016)) = 2.71520.
    """
    p = parameters(c=Parameter(c, "s^2/m", 0, 0.5, description="of the switching curve x = -c v |v|"))
    x, v = states("x v")
    curve = x + p.c * v * Abs(v)
    return System(
        {x: v, v: -sign(curve)}, surfaces=[Surface("curve", curve)], parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


MODEL = register(
    Model(
        "fuller",
        fuller,
        (1.0, 0.0),
        (0.0, 2.7),
        "Fuller's problem: the times between switchings shrink by 4.13016, accumulating at t = 2.7152.",
        "Fuller 1960",
    )
)
