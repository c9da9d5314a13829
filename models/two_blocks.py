"""Two coupled blocks on a moving belt: stick-slip with two surfaces.

    x1' = v1, m1 v1' in -k1 x1 - kc (x1 - x2) - F(v1 - vb)
    x2' = v2, m2 v2' in -k2 x2 - kc (x2 - x1) - ratio F(v2 - vb)

Source: Galvanetto & Knudsen 1997, Nonlinear Dynamics 13.
"""

from __future__ import annotations

from filippov.models.friction import SMALLEST, FrictionLaw, declare
from filippov.models.laws import Hyperbolic
from filippov.models.registry import Model, register
from filippov.parameter import Parameter, parameters
from filippov.symbols import states
from filippov.system import System

LAW = Hyperbolic(Fs=1, gamma=3)


def two_blocks(
    friction: FrictionLaw = LAW,
    m1: float = 1.0,
    m2: float = 1.0,
    k1: float = 1.0,
    k2: float = 1.0,
    kc: float = 1.2,
    ratio: float = 1.3,
    vb: float = 0.2,
) -> System:
    """Return the two blocks; the surfaces "block 1" and "block 2" are v1 = vb and v2 = vb.

    friction   the law under block 1, 1/(1 + 3 |v|) by default; under block 2 it is `ratio` times that
    """
    p = parameters(
        **declare("m1", m1, "kg", "mass of block 1", SMALLEST),
        **declare("m2", m2, "kg", "mass of block 2", SMALLEST),
        **declare("k1", k1, "N/m", "spring of block 1"),
        **declare("k2", k2, "N/m", "spring of block 2"),
        **declare("kc", kc, "N/m", "coupling spring"),
        **declare("ratio", ratio, "", "friction under block 2 relative to block 1"),
        vb=Parameter(vb, "m/s", description="speed of the belt"),
        **friction.parameters(),
    )
    x1, v1, x2, v2 = states("x1 v1 x2 v2")
    slip1, slip2 = v1 - p.vb, v2 - p.vb
    return System(
        {
            x1: v1,
            v1: (-p.k1 * x1 - p.kc * (x1 - x2) - friction.force(slip1, p)) / p.m1,
            x2: v2,
            v2: (-p.k2 * x2 - p.kc * (x2 - x1) - p.ratio * friction.force(slip2, p)) / p.m2,
        },
        surfaces=[*friction.surfaces(slip1, p, "block 1"), *friction.surfaces(slip2, p, "block 2")],
        parameters=p,
    )


MODEL = register(
    Model(
        "two_blocks",
        two_blocks,
        (0.0, 0.0, 0.5, 0.0),
        (0.0, 40.0),
        "Two coupled blocks on a moving belt: stick-slip of one or both.",
        "Galvanetto & Knudsen 1997; numbers chosen here",
    )
)
