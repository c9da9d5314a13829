"""Welander's oscillator: the surface layer of an ocean that mixes with the deep while it is denser."""

from __future__ import annotations

from filippov import Heaviside, Parameter, Surface, System, parameters, states
from filippov.models.registry import Model, register


def welander(
    beta: float = 0.5, alpha: float = 0.8, start: float = -0.01, mixing: float = 5.0, calm: float = 0.0
) -> System:
    """T' = 1 - T - k T, S' = beta (1 - S) - k S, k = mixing while S - alpha T > start, else calm.

    beta           rate of the salt against that of the heat
    alpha          expansion by heat against contraction by salt
    start          density difference at which mixing begins
    mixing, calm   rates of exchange with the deep layer

    Temperature T, salinity S and time in units of the forcing.
    """
    p = parameters(
        beta=Parameter(beta, "", 0, description="rate of the salt"),
        alpha=Parameter(alpha, "", 0, description="expansion by heat"),
        start=Parameter(start, "", description="density difference at which mixing begins"),
        mixing=Parameter(mixing, "", 0, description="rate of exchange while mixing"),
        calm=Parameter(calm, "", 0, description="rate of exchange otherwise"),
    )
    T, S = states("T S")
    dense = S - p.alpha * T - p.start
    k = p.calm + (p.mixing - p.calm) * Heaviside(dense)
    return System(
        {T: 1 - T - k * T, S: p.beta * (1 - S) - k * S},
        surfaces=[Surface("density", dense)],
        parameters=p,
        labels={"t": "dimensionless time", "T": "temperature", "S": "salinity"},
    )


MODEL = register(
    Model(
        "welander",
        welander,
        (0.5, 0.2),
        (0.0, 10.0),
        "Welander's heat and salt oscillator of a mixed ocean layer.",
        "Welander 1982; numbers chosen here",
    )
)
