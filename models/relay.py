"""Relay feedback of a third-order plant: x' = A x - B sgn(x1).

The plant is k (s^2 + 2 sigma rho s + rho^2)/((s^2 + 2 zeta omega s + omega^2)(s + lam)) in observer form:

    x1' = -(2 zeta omega + lam) x1 + x2 - k s
    x2' = -(2 zeta omega lam + omega^2) x1 + x3 - 2 k sigma rho s
    x3' = -lam omega^2 x1 - k rho^2 s,    s in Sgn(x1)

Source: di Bernardo, Johansson, Vasca 2001, International Journal of Bifurcation and Chaos 11.
"""

from __future__ import annotations

from functools import partial

from filippov import Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Model, register


def relay(
    zeta: float = 1.0,
    omega: float = 1.0,
    lam: float = 1.0,
    k: float = 1.0,
    sigma: float = -1.0,
    rho: float = 1.0,
) -> System:
    """Return the relay loop; the surface "output" is x1 = 0.

    zeta, omega   damping ratio and frequency [rad/s] of the complex poles
    lam           real pole at -lam [1/s]
    k             gain; sigma, rho: damping ratio and frequency of the zeros
    """
    p = parameters(
        zeta=Parameter(zeta, "", description="damping ratio of the poles"),
        omega=Parameter(omega, "rad/s", description="frequency of the poles"),
        lam=Parameter(lam, "1/s", description="the real pole is -lam"),
        k=Parameter(k, "", description="gain"),
        sigma=Parameter(sigma, "", description="damping ratio of the zeros"),
        rho=Parameter(rho, "rad/s", description="frequency of the zeros"),
    )
    x1, x2, x3 = states("x1 x2 x3")
    s = sign(x1)
    return System(
        {
            x1: -(2 * p.zeta * p.omega + p.lam) * x1 + x2 - p.k * s,
            x2: -(2 * p.zeta * p.omega * p.lam + p.omega**2) * x1 + x3 - 2 * p.k * p.sigma * p.rho * s,
            x3: -p.lam * p.omega**2 * x1 - p.k * p.rho**2 * s,
        },
        surfaces=[Surface("output", x1)],
        parameters=p,
        labels={"t": "time [s]", "x1": "output x1", "x2": "x2", "x3": "x3"},
    )


SOURCE = "di Bernardo, Johansson, Vasca 2001; Siconos examples"

SINGLE = register(
    Model(
        "relay",
        relay,
        (0.0, 0.5, 0.0),
        (0.0, 30.0),
        "Relay feedback, third order: a symmetric orbit that slides once a half period.",
        SOURCE,
    )
)
APERIODIC = register(
    Model(
        "relay_aperiodic",
        partial(relay, zeta=-0.07, omega=10, lam=0.05),
        (0.0, 0.5, 0.0),
        (0.0, 10.0),
        "Relay feedback of an unstable third-order plant: aperiodic, many slides.",
        SOURCE,
    )
)
TWO_SLIDES = register(
    Model(
        "relay_two_slides",
        partial(relay, zeta=0.05, omega=8),
        (0.0, 0.5, 0.0),
        (0.0, 20.0),
        "Relay feedback, third order: two slides a half period.",
        SOURCE,
    )
)
