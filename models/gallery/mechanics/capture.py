"""The first example of a differential equation with a discontinuous right-hand side: x' in 1 - 2 Sgn(x)."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Model, register


def capture(drift: float = 1.0, jump: float = 2.0) -> System:
    """x' in drift - jump Sgn(x): x = 0 is reached from both sides and held by s = drift/jump.

    drift   [1/s]; jump   [1/s], above |drift| for the capture
    """
    p = parameters(
        drift=Parameter(drift, "1/s", description="rate without the switching term"),
        jump=Parameter(jump, "1/s", 0, description="size of the switching term"),
    )
    (x,) = states("x")
    return System(
        {x: p.drift - p.jump * sign(x)}, surfaces=[Surface("zero", x)], parameters=p,
        labels={"t": "time [s]", "x": "state"},
    )


MODEL = register(
    Model(
        "capture",
        capture,
        (2.0,),
        (0.0, 4.0),
        "Filippov's first example: x = 0 is reached at t = 2 and held with s = 1/2.",
        "Filippov 1988",
    )
)
