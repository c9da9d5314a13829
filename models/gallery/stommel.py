"""Stommel's box model: heat and salt are carried between two basins by a flow of their density difference."""

from __future__ import annotations

from filippov import Abs, Parameter, System, parameters, states
from filippov.models.registry import Model, register


def stommel(heat: float = 3.0, salt: float = 1.0, ratio: float = 0.3) -> System:
    """T' = heat - T (1 + |T - S|), S' = salt - S (ratio + |T - S|).

    heat, salt   forcing of the differences of temperature and salinity
    ratio        relaxation of the salt against that of the heat

    The flow T - S has steady values q with q = heat/(1 + |q|) - salt/(ratio + |q|): up to three.
    """
    p = parameters(
        heat=Parameter(heat, "", 0, description="forcing of the temperature"),
        salt=Parameter(salt, "", 0, description="forcing of the salinity"),
        ratio=Parameter(ratio, "", 0, description="relaxation of the salt"),
    )
    T, S = states("T S")
    flow = Abs(T - S)
    return System(
        {T: p.heat - T * (1 + flow), S: p.salt - S * (p.ratio + flow)}, parameters=p,
        labels={"t": "dimensionless time", "T": "temperature difference", "S": "salinity difference"},
    )


MODEL = register(
    Model(
        "stommel",
        stommel,
        (0.5, 2.0),
        (0.0, 40.0),
        "Stommel's two-box ocean: the flow turns round at a kink and takes one of its steady states.",
        "Stommel 1961; numbers chosen here",
    )
)
