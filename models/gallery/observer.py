"""A sliding-mode observer: from the measured place of an oscillator it finds the speed."""

from __future__ import annotations

import math
from typing import Any

from filippov import Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Invariant, Model, register


def observer(omega: float = 1.0, l1: float = 3.0, l2: float = 6.0) -> System:
    """x' = v, v' = -omega^2 x; y' in w + l1 Sgn(x - y), w' in -omega^2 x + l2 Sgn(x - y).

    omega    frequency of the observed oscillator [rad/s]
    l1, l2   gains of the observer, l1 above |v - w|

    x - y reaches 0 in a finite time; then v - w = l1 s decays as exp(-l2/l1 t).
    """
    p = parameters(
        omega=Parameter(omega, "rad/s", 0, description="frequency of the oscillator"),
        l1=Parameter(l1, "m/s", 1e-12, description="gain on the place"),
        l2=Parameter(l2, "m/s^2", 0, description="gain on the speed"),
    )
    x, v, y, w = states("x v y w")
    s = sign(x - y)
    pull = -(p.omega**2) * x
    return System(
        {x: v, v: pull, y: w + p.l1 * s, w: pull + p.l2 * s},
        surfaces=[Surface("error", x - y)],
        parameters=p,
        labels={
            "t": "time [s]", "x": "position [m]", "v": "velocity [m/s]", "y": "estimate of x [m]",
            "w": "estimate of v [m/s]",
        },
    )


def _decay(time: float, x: Any, p: Any) -> float:
    """Return (v - w) exp(l2/l1 t), constant while sliding."""
    return float((x[1] - x[3]) * math.exp(p.l2 / p.l1 * time))


MODEL = register(
    Model(
        "sliding_observer",
        observer,
        (1.0, 0.0, 0.0, 0.0),
        (0.0, 6.0),
        "A sliding-mode observer of an oscillator's speed.",
        "Utkin 1992; numbers chosen here",
        (Invariant("(v - w) exp(l2/l1 t) while sliding", _decay, "0"),),
    )
)
