"""A wheel of spokes without a rim rolls down a slope, from one spoke onto the next."""

from __future__ import annotations

from filippov import Parameter, Surface, System, cos, parameters, sin, states
from filippov.models.registry import Model, register


def rimless(alpha: float = 0.3, slope: float = 0.1, rate: float = 1.0) -> System:
    """q'' = rate^2 sin(q), q -> q - 2 alpha and w+ = cos(2 alpha) w- at q = slope + alpha.

    q       angle of the standing spoke from the upright [rad], positive downhill
    alpha   half the angle between spokes [rad]; slope   of the ground [rad]; rate   sqrt(g/l) [1/s]

    The steady gait has w+^2 = 4 rate^2 sin(slope) sin(alpha)/tan(2 alpha)^2.
    """
    p = parameters(
        alpha=Parameter(alpha, "rad", 0, description="half the angle between spokes"),
        slope=Parameter(slope, "rad", description="slope of the ground"),
        rate=Parameter(rate, "1/s", 0, description="sqrt(g/l)"),
    )
    q, w = states("q w")
    step = {q: q - 2 * p.alpha, w: cos(2 * p.alpha) * w}
    return System(
        {q: w, w: p.rate**2 * sin(q)},
        surfaces=[Surface("next spoke", p.slope + p.alpha - q, reset=step)],
        parameters=p,
        labels={"t": "time [s]", "q": "angle [rad]", "w": "angular velocity [rad/s]"},
    )


MODEL = register(
    Model(
        "rimless_wheel",
        rimless,
        (-0.2, 0.8),
        (0.0, 30.0),
        "A rimless wheel on a slope: its gait tends to the closed-form fixed point.",
        "McGeer 1990; numbers chosen here",
    )
)
