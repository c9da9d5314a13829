"""A PI controller with a saturated actuator, its integrator held back while the actuator is at its limit."""

from __future__ import annotations

from filippov import Max, Min, Parameter, System, parameters, states
from filippov.models.registry import Model, register


def anti_windup(
    K: float = 2.0, Ki: float = 4.0, back: float = 2.0, limit: float = 1.2, lag: float = 1.0, r: float = 1.0
) -> System:
    """lag y' = u - y, u = min(max(w, -limit), limit), w = K (r - y) + z, z' = Ki (r - y) + back (u - w).

    K, Ki   gains of the controller, Ki in 1/s; back   rate of the back-calculation [1/s], 0 for windup
    limit   of the actuator; lag   of the plant [s]; r   set point
    """
    p = parameters(
        K=Parameter(K, "", 0, description="proportional gain"),
        Ki=Parameter(Ki, "1/s", 0, description="integral gain"),
        back=Parameter(back, "1/s", 0, description="rate of the back-calculation"),
        limit=Parameter(limit, "", 0, description="limit of the actuator"),
        lag=Parameter(lag, "s", 1e-12, description="lag of the plant"),
        r=Parameter(r, "", description="set point"),
    )
    y, z = states("y z")
    w = p.K * (p.r - y) + z
    u = Min(Max(w, -p.limit), p.limit)
    return System(
        {y: (u - y) / p.lag, z: p.Ki * (p.r - y) + p.back * (u - w)},
        parameters=p,
        labels={"t": "time [s]", "y": "output", "z": "integral part of the effort"},
    )


MODEL = register(
    Model(
        "anti_windup",
        anti_windup,
        (0.0, 0.0),
        (0.0, 8.0),
        "A PI controller with saturation and back-calculation against windup.",
        "Astrom, Hagglund 2006; numbers chosen here",
    )
)
