"""Populations that switch: a predator that chooses its prey, and harvest above a threshold."""

from __future__ import annotations

import math
from typing import Any

from filippov import Heaviside, Parameter, Surface, System, parameters, states
from filippov.models.registry import Invariant, Model, register


def switching_predator(
    r1: float = 1.5,
    r2: float = 0.5,
    l1: float = 1.0,
    l2: float = 1.0,
    e1: float = 0.2,
    e2: float = 0.1,
    m: float = 0.1,
) -> System:
    """Return two prey R1, R2 and a predator C that hunts the more profitable one, e1 l1 R1 against e2 l2 R2.

        R1' = r1 R1 - u l1 R1 C,  R2' = r2 R2 - (1 - u) l2 R2 C
        C'  = C (u e1 l1 R1 + (1 - u) e2 l2 R2 - m),   u = H(e1 l1 R1 - e2 l2 R2)

    On the surface "profit" the sliding field is a Lotka-Volterra centre with a first integral.
    Sources: Boukal & Krivan 1999; Krivan & Vrkoc 2007.
    """
    p = parameters(
        r1=Parameter(r1, "1/s", 0, description="growth of prey 1"),
        r2=Parameter(r2, "1/s", 0, description="growth of prey 2"),
        l1=Parameter(l1, "1/s", 0, description="search rate for prey 1"),
        l2=Parameter(l2, "1/s", 0, description="search rate for prey 2"),
        e1=Parameter(e1, "", 0, description="benefit of prey 1"),
        e2=Parameter(e2, "", 0, description="benefit of prey 2"),
        m=Parameter(m, "1/s", 0, description="mortality of the predator"),
    )
    R1, R2, C = states("R1 R2 C")
    profit = p.e1 * p.l1 * R1 - p.e2 * p.l2 * R2
    u = Heaviside(profit)
    return System(
        {
            R1: p.r1 * R1 - u * p.l1 * R1 * C,
            R2: p.r2 * R2 - (1 - u) * p.l2 * R2 * C,
            C: C * (u * p.e1 * p.l1 * R1 + (1 - u) * p.e2 * p.l2 * R2 - p.m),
        },
        surfaces=[Surface("profit", profit)],
        parameters=p,
        labels={"t": "time [s]", "R1": "prey 1", "R2": "prey 2", "C": "predator"},
    )


def threshold_harvest(
    r: float = 1.0,
    a: float = 1.0,
    e: float = 0.5,
    m: float = 0.5,
    K: float = 4.0,
    q1: float = 0.3,
    q2: float = 0.3,
    threshold: float = 0.8,
) -> System:
    """Return prey R and predator C, both harvested only while the predator is above a threshold.

        R' = r R (1 - R/K) - a R C - q1 R H(C - threshold)
        C' = e a R C - m C - q2 C H(C - threshold)

    Source: Meza, Bhaya, Kaszkurewicz, da Silveira Costa 2005, threshold policies.
    """
    p = parameters(
        r=Parameter(r, "1/s", 0, description="growth of the prey"),
        a=Parameter(a, "1/s", 0, description="attack rate"),
        e=Parameter(e, "", 0, description="benefit of the prey"),
        m=Parameter(m, "1/s", 0, description="mortality of the predator"),
        K=Parameter(K, "", 1e-12, description="capacity for the prey"),
        q1=Parameter(q1, "1/s", 0, description="harvest of the prey above the threshold"),
        q2=Parameter(q2, "1/s", 0, description="harvest of the predator above the threshold"),
        threshold=Parameter(threshold, "", 0, description="threshold of the predator"),
    )
    R, C = states("R C")
    u = Heaviside(C - p.threshold)
    return System(
        {
            R: p.r * R * (1 - R / p.K) - p.a * R * C - p.q1 * R * u,
            C: p.e * p.a * R * C - p.m * C - p.q2 * C * u,
        },
        surfaces=[Surface("threshold", C - p.threshold)],
        parameters=p,
        labels={"t": "time [s]", "R": "prey", "C": "predator"},
    )


def _first_integral(t: float, x: Any, p: Any) -> float:
    """Return e1 l1 R1 - m ln R1 + l1 l2/(l1 + l2) C - (r1 l2 + r2 l1)/(l1 + l2) ln C."""
    R1, _, C = (float(q) for q in x)
    both = p.l1 + p.l2
    growth = (p.r1 * p.l2 + p.r2 * p.l1) / both
    prey = p.e1 * p.l1 * R1 - p.m * math.log(R1)
    return float(prey + p.l1 * p.l2 / both * C - growth * math.log(C))


PREDATOR = register(
    Model(
        "switching_predator",
        switching_predator,
        (1.0, 1.0, 1.0),
        (0.0, 60.0),
        "A predator that switches between two prey: a sliding Lotka-Volterra centre.",
        "Boukal & Krivan 1999; Krivan & Vrkoc 2007; numbers chosen here",
        (Invariant("first integral", _first_integral, "0"),),
    )
)
HARVEST = register(
    Model(
        "threshold_harvest",
        threshold_harvest,
        (1.0, 0.5),
        (0.0, 60.0),
        "Predator and prey, harvested while the predator is above a threshold.",
        "Meza, Bhaya, Kaszkurewicz, da Silveira Costa 2005; numbers chosen here",
    )
)
