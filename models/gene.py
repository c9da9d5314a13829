"""A network of two genes with step regulation: four surfaces, an equilibrium on two of them.

    x1' = -g1 x1 + k1 H(x2 - low2) H(high1 - x1)
    x2' = -g2 x2 + k2 H(x1 - low1) H(high2 - x2)

Source: Acary, de Jong, Brogliato 2014, Physica D 269.
"""

from __future__ import annotations

from filippov import Heaviside, Surface, System, parameters, states
from filippov.models.friction import declare
from filippov.models.registry import Model, register


def two_gene(
    g1: float = 4.5,
    g2: float = 1.5,
    k1: float = 40.0,
    k2: float = 40.0,
    low1: float = 4.0,
    low2: float = 4.0,
    high1: float = 8.0,
    high2: float = 8.0,
) -> System:
    """Return the network; the surfaces are "x1 low", "x1 high", "x2 low", "x2 high".

    g, k        rates of decay and of synthesis
    low, high   thresholds: a gene is made while the other is above its low and it is below its high one
    """
    p = parameters(
        **declare("g1", g1, "1/s", "decay of x1"),
        **declare("g2", g2, "1/s", "decay of x2"),
        **declare("k1", k1, "1/s", "synthesis of x1"),
        **declare("k2", k2, "1/s", "synthesis of x2"),
        **declare("low1", low1, "", "x1 above which x2 is made"),
        **declare("low2", low2, "", "x2 above which x1 is made"),
        **declare("high1", high1, "", "x1 above which x1 is not made"),
        **declare("high2", high2, "", "x2 above which x2 is not made"),
    )
    x1, x2 = states("x1 x2")
    return System(
        {
            x1: -p.g1 * x1 + p.k1 * Heaviside(x2 - p.low2) * Heaviside(p.high1 - x1),
            x2: -p.g2 * x2 + p.k2 * Heaviside(x1 - p.low1) * Heaviside(p.high2 - x2),
        },
        surfaces=[
            Surface("x1 low", x1 - p.low1),
            Surface("x1 high", x1 - p.high1),
            Surface("x2 low", x2 - p.low2),
            Surface("x2 high", x2 - p.high2),
        ],
        parameters=p,
        labels={"t": "time [s]", "x1": "concentration x1", "x2": "concentration x2"},
    )


MODEL = register(
    Model(
        "two_gene",
        two_gene,
        (12.0, 3.0),
        (0.0, 1.0),
        "Two genes with step regulation: captured in finite time on two surfaces.",
        "Acary, de Jong, Brogliato 2014",
    )
)
