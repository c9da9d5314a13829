"""A buck converter, its switch controlled in three ways: C y' = i - y/R, L i' = E u - y, u in {0, 1}.

The switch is on below the line h = c (y - Vref) + y' = 0. Sliding on it, (y - Vref)' = -c (y - Vref).
Source: Utkin, Guldner, Shi 1999; Tan, Lai, Tse 2012.
"""

from __future__ import annotations

import math
from typing import Any

from filippov import Heaviside, Hysteresis, Parameter, Surface, System, TimeEvent, parameters, states
from filippov.models.registry import Invariant, Model, register


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
        c=Parameter(c, "1/s", 0, description="rate of the sliding solution"),
    )
    y, i = states("y i")
    slope = (i - y / p.R) / p.C
    line = p.c * (y - p.Vref) + slope
    return System(
        {y: slope, i: (p.E * Heaviside(-line) - y) / p.L},
        surfaces=[Surface("line", line)],
        parameters=p,
        labels={"t": "time [s]", "y": "voltage [V]", "i": "current [A]"},
    )


def buck_hysteresis(width: float = 500.0) -> System:
    """Return the converter of `buck()` whose switch keeps its state until |h| = width [V/s]."""
    return buck().with_comparator(Hysteresis(width))


def buck_pwm(
    Vin: float = 20.0,
    L: float = 20e-3,
    C: float = 47e-6,
    R: float = 22.0,
    a: float = 8.4,
    Vref: float = 11.3,
    VL: float = 3.8,
    VU: float = 8.2,
    T: float = 400e-6,
) -> System:
    """Return the converter under naturally sampled pulse-width modulation, its ramp a clock's.

    The switch is on while a (v - Vref) lies below a ramp that rises from VL to VU in a period T, and that the
    time event "clock" sets back at T, 2 T, ...

    Vin, Vref   supply and reference voltage [V]; a   gain
    L, C, R     inductance [H], capacitance [F], load [ohm], all > 0
    VL, VU, T   ramp [V] and its period [s]

    Source: di Bernardo, Garofalo, Glielmo, Vasca 1998, IEEE Trans. Circuits Syst. I 45, 133: period
    doubling at Vin = 24.5, chaos from 32.3.
    """
    p = parameters(
        Vin=Parameter(Vin, "V", 0, description="supply voltage"),
        L=Parameter(L, "H", 1e-12, description="inductance"),
        C=Parameter(C, "F", 1e-12, description="capacitance"),
        R=Parameter(R, "ohm", 1e-12, description="load"),
        a=Parameter(a, "", 0, description="gain"),
        Vref=Parameter(Vref, "V", description="reference voltage"),
        VL=Parameter(VL, "V", description="lower end of the ramp"),
        VU=Parameter(VU, "V", description="upper end of the ramp"),
        T=Parameter(T, "s", 1e-12, description="period of the ramp"),
    )
    v, i, ramp = states("v i ramp")
    control = p.a * (v - p.Vref) - ramp
    return System(
        {
            v: (i - v / p.R) / p.C,
            i: (p.Vin * Heaviside(-control) - v) / p.L,
            ramp: (p.VU - p.VL) / p.T,
        },
        surfaces=[Surface("comparator", control)],
        parameters=p,
        time_events=[TimeEvent("clock", period=p.T, start=p.T, reset={ramp: p.VL})],
        labels={"t": "time [s]", "v": "voltage [V]", "i": "current [A]", "ramp": "ramp [V]"},
    )


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
PWM = register(
    Model(
        "buck_pwm",
        buck_pwm,
        (12.0, 0.55, 3.8),
        (0.0, 8e-3),
        "Buck converter under pulse-width modulation with a clock.",
        "di Bernardo, Garofalo, Glielmo, Vasca 1998, IEEE Trans. Circuits Syst. I 45, 133",
    )
)
