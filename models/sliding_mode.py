"""Discontinuous control of a double integrator: x' = v, v' = u + disturbance."""

from __future__ import annotations

import math
from typing import Any

from filippov import Parameter, Surface, System, parameters, sign, sin, states, t
from filippov.models.registry import Invariant, Model, register


def sliding_mode(K: float = 2.0, c: float = 1.0, A: float = 0.5, omega: float = 2.0) -> System:
    """Return v' in -K Sgn(c x + v) + A sin(omega t); the surface "manifold" is c x + v = 0.

    On it x' = -c x whatever the disturbance, and it is held while |c v + A sin(omega t)| <= K.
    Source: Utkin 1992.
    """
    p = parameters(
        K=Parameter(K, "m/s^2", 0, description="control level"),
        c=Parameter(c, "1/s", description="slope of the sliding manifold"),
        A=Parameter(A, "m/s^2", description="amplitude of the disturbance"),
        omega=Parameter(omega, "rad/s", description="frequency of the disturbance"),
    )
    x, v = states("x v")
    manifold = p.c * x + v
    return System(
        {x: v, v: -p.K * sign(manifold) + p.A * sin(p.omega * t)},
        surfaces=[Surface("manifold", manifold)],
        parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


def twisting(G: float = 10.0, ratio: float = 0.3) -> System:
    """Return v' in -G (Sgn(x) + ratio Sgn(v)); the surfaces are "position" and "velocity".

    The origin is reached in finite time through infinitely many switchings (0 < ratio < 1).
    Source: Levant 1993.
    """
    p = parameters(
        G=Parameter(G, "m/s^2", 0, description="control level on the position"),
        ratio=Parameter(ratio, "", 0, description="level on the velocity relative to G"),
    )
    x, v = states("x v")
    return System(
        {x: v, v: -p.G * sign(x) - p.G * p.ratio * sign(v)},
        surfaces=[Surface("position", x), Surface("velocity", v)],
        parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


def _decay(time: float, x: Any, p: Any) -> float:
    """Return x exp(c t): on the manifold x' = -c x."""
    return float(x[0] * math.exp(p.c * time))


MODEL = register(
    Model(
        "sliding_mode",
        sliding_mode,
        (1.0, 0.0),
        (0.0, 5.0),
        "Sliding-mode control of a disturbed double integrator.",
        "Utkin 1992; numbers chosen here",
        (Invariant("x exp(c t) on the manifold", _decay, "0"),),
    )
)
TWISTING = register(
    Model(
        "twisting",
        twisting,
        (10.0, 10.0),
        (0.0, 12.2),
        "Twisting control of a double integrator: switchings accumulate at t = 12.264.",
        "Levant 1993; Siconos examples",
    )
)
