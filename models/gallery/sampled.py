"""A mass with dry friction under PID control by a computer: sampled at a clock, held in between."""

from __future__ import annotations

from filippov import Parameter, Surface, System, TimeEvent, parameters, sign, states
from filippov.models.registry import Model, register


def sampled(K: float = 4.0, D: float = 2.5, I: float = 2.0, T: float = 0.1, Fc: float = 0.2) -> System:
    """x' = v, v' in u - Fc Sgn(v); at k T: u = -K x - D (x - last)/T - I T sum, sum = sum + x, last = x.

    K, D, I   gains [1/s^2], [1/s], [1/s^3]; T   sampling time [s]
    Fc        dry friction over the mass [m/s^2]
    """
    p = parameters(
        K=Parameter(K, "1/s^2", 0, description="gain on the place"),
        D=Parameter(D, "1/s", 0, description="gain on the difference"),
        I=Parameter(I, "1/s^3", 0, description="gain on the sum"),
        T=Parameter(T, "s", 1e-12, description="sampling time"),
        Fc=Parameter(Fc, "m/s^2", 0, description="dry friction over the mass"),
    )
    x, v, u, last, total = states("x v u last total")
    effort = -p.K * x - p.D * (x - last) / p.T - p.I * p.T * total
    return System(
        {x: v, v: u - p.Fc * sign(v), u: 0 * u, last: 0 * u, total: 0 * u},
        surfaces=[Surface("velocity", v)],
        parameters=p,
        time_events=[TimeEvent("sample", period=p.T, reset={u: effort, last: x, total: total + x})],
        labels={
            "t": "time [s]", "x": "position [m]", "v": "velocity [m/s]", "u": "effort [m/s^2]",
            "last": "last sample [m]", "total": "sum of samples [m]",
        },
    )


MODEL = register(
    Model(
        "sampled_pid",
        sampled,
        (1.0, 0.0, 0.0, 1.0, 0.0),
        (0.0, 10.0),
        "PID control of a mass with dry friction by a computer with a zero-order hold.",
        "Astrom, Wittenmark 1997; numbers chosen here",
    )
)
