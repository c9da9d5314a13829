"""PI control of a lag through a quantiser: the controller sees the error in whole steps only."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Model, register


def quantised(step: float = 0.4, K: float = 2.0, Ki: float = 1.0, lag: float = 1.0, r: float = 1.0) -> System:
    """lag y' = K q + Ki z - y, z' = q: q is the error r - y rounded to 0, +-step or +-2 step.

    step     of the quantiser
    K, Ki    gains, Ki in 1/s; lag   of the plant [s]; r   set point

    Held on an edge of the quantiser, q = (y - Ki z)/K between two steps, and y - Ki z falls as exp(-Ki/K t).
    """
    p = parameters(
        step=Parameter(step, "", 1e-12, description="step of the quantiser"),
        K=Parameter(K, "", 1e-12, description="proportional gain"),
        Ki=Parameter(Ki, "1/s", 0, description="integral gain"),
        lag=Parameter(lag, "s", 1e-12, description="lag of the plant"),
        r=Parameter(r, "", description="set point"),
    )
    y, z = states("y z")
    edges = {"-3/2": -1.5, "-1/2": -0.5, "1/2": 0.5, "3/2": 1.5}
    beyond = {name: p.r - y - edge * p.step for name, edge in edges.items()}
    q = p.step / 2 * sum(sign(h) for h in beyond.values())
    return System(
        {y: (p.K * q + p.Ki * z - y) / p.lag, z: q},
        surfaces=[Surface(f"edge {name}", h) for name, h in beyond.items()],
        parameters=p,
        labels={"t": "time [s]", "y": "output", "z": "integral [s]"},
    )


MODEL = register(
    Model(
        "quantised_pi",
        quantised,
        (0.0, 0.0),
        (0.0, 8.0),
        "PI control through a quantiser of five levels: it settles half a step off the set point.",
        "Delchamps 1990; numbers chosen here",
    )
)
