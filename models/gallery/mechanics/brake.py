"""A vehicle on a slope is braked to rest; the brake is then let go slowly."""

from __future__ import annotations

from filippov import Max, Parameter, Surface, System, parameters, sign, states, t
from filippov.models.registry import Model, register


def brake(m: float = 1000.0, pull: float = 1500.0, force: float = 6000.0, release: float = 500.0) -> System:
    """x' = v, m v' in pull - max(force - release t, 0) Sgn(v).

    m         mass [kg]; pull   of the slope [N]
    force     of the brake at first [N]; release   rate at which it is let go [N/s]

    The vehicle rests until (force - pull)/release, when the brake no longer holds it.
    """
    p = parameters(
        m=Parameter(m, "kg", 1e-12, description="mass"),
        pull=Parameter(pull, "N", 0, description="pull of the slope"),
        force=Parameter(force, "N", 0, description="brake force at first"),
        release=Parameter(release, "N/s", 0, description="rate at which the brake is let go"),
    )
    x, v = states("x v")
    hold = Max(p.force - p.release * t, 0)
    return System(
        {x: v, v: (p.pull - hold * sign(v)) / p.m},
        surfaces=[Surface("wheels", v)],
        parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


MODEL = register(
    Model(
        "brake",
        brake,
        (0.0, 15.0),
        (0.0, 14.0),
        "A vehicle braked to rest on a slope rolls on at t = 9 s, when the brake is let go.",
        "textbook mechanics; numbers chosen here",
    )
)
