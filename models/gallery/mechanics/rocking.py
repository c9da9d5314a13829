"""A slender block that rocks on its two lower edges and loses speed at each change of edge."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, sin, states
from filippov.models.registry import Model, register


def rocking(rate: float = 2.0, alpha: float = 0.2) -> System:
    """q'' = rate^2 (q - alpha sign(q)), w+ = (1 - 3/2 sin(alpha)^2) w- at q = 0.

    rate    sqrt(3 g/(4 R)) [1/s], R half the diagonal of the block
    alpha   slenderness: angle at which it falls over [rad]

    From rest at q0 the edge changes first after acosh(1/(1 - q0/alpha))/rate; then the changes accumulate.
    """
    p = parameters(
        rate=Parameter(rate, "1/s", 0, description="rate of the block"),
        alpha=Parameter(alpha, "rad", 1e-12, description="angle at which it falls over"),
    )
    q, w = states("q w")
    kept = 1 - 1.5 * sin(p.alpha) ** 2
    return System(
        {q: w, w: p.rate**2 * (q - p.alpha * sign(q))},
        surfaces=[Surface("flat", q, reset={w: kept * w}, side="both")],
        parameters=p,
        labels={"t": "time [s]", "q": "angle [rad]", "w": "angular velocity [rad/s]"},
    )


MODEL = register(
    Model(
        "rocking_block",
        rocking,
        (0.15, 0.0),
        (0.0, 8.0),
        "Housner's rocking block: the swings get shorter at each change of edge.",
        "Housner 1963, Bull. Seismol. Soc. Am. 53, 403; numbers chosen here",
    )
)
