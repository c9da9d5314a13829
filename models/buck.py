"""A buck converter under sliding-mode or hysteresis control: C y' = i - y/R, L i' = E u - y, u in {0, 1}.

The switch is on below the line h = c (y - Vref) + y' = 0. Sliding on it, (y - Vref)' = -c (y - Vref).
Source: Utkin, Guldner, Shi 1999, chapter 12; Tan, Lai, Tse 2012.
"""

from __future__ import annotations

import math
from typing import Any

from filippov.comparator import Hysteresis
from filippov.models.registry import Invariant, Model, register
from filippov.parameter import Parameter, parameters
from filippov.surface import Surface
from filippov.symbols import Heaviside, states
from filippov.system import System


def buck(
    E: float = 20.0,
    L: float = 1e-3,
    C: float = 1e-4,
    R: float = 10.0,
    Vref: float = 8.0,
    c: float = 2000.0,
) -> System:
    """Return the converter; the surface "line" is c (y - Vref) + (i - y/R)/C = 0.

    E, Vref   supply and wanted voltage [V]
    L, C, R   inductance [H], capacitance [F], load [ohm], all > 0
    c         rate of the sliding motion [1/s]
    """
    p = parameters(
        E=Parameter(E, "V", 0, description="supply voltage"),
        L=Parameter(L, "H", 1e-12, description="inductance"),
        C=Parameter(C, "F", 1e-12, description="capacitance"),
        R=Parameter(R, "ohm", 1e-12, description="load"),
        Vref=Parameter(Vref, "V", 0, description="wanted voltage"),
        c=Parameter(c, "1/s", 0, description="rate of the sliding motion"),
    )
    y, i = states("y i")
    slope = (i - y / p.R) / p.C
    line = p.c * (y - p.Vref) + slope
    return System(
        {y: slope, i: (p.E * Heaviside(-line) - y) / p.L},
        surfaces=[Surface("line", line)],
        parameters=p,
    )


def buck_hysteresis(width: float = 500.0) -> System:
    """Return the converter of `buck()` whose switch keeps its state until |h| = width [V/s]."""
    return buck().with_comparator(Hysteresis(width))


def _decay(t: float, x: Any, p: Any) -> float:
    """Return (y - Vref) exp(c t): on the line (y - Vref)' = -c (y - Vref)."""
    return float((x[0] - p.Vref) * math.exp(p.c * t))


MODEL = register(
    Model(
        "buck",
        buck,
        (0.0, 0.0),
        (0.0, 2e-3),
        "Buck converter under sliding-mode control.",
        "Utkin, Guldner, Shi 1999; numbers chosen here",
        (Invariant("(y - Vref) exp(c t) on the line", _decay, "0"),),
    )
)
HYSTERESIS = register(
    Model(
        "buck_hysteresis",
        buck_hysteresis,
        (0.0, 0.0),
        (0.0, 2e-3),
        "Buck converter, its switch a relay with hysteresis.",
        "Tan, Lai, Tse 2012; numbers chosen here",
    )
)
