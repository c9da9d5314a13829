"""Chua's circuit: three linear pieces, and the double scroll."""

from __future__ import annotations

from filippov import Abs, Parameter, System, parameters, states
from filippov.models.registry import Model, register


def chua(a: float = 15.6, b: float = 28.0, m0: float = -8 / 7, m1: float = -5 / 7) -> System:
    """x' = a (y - x - f(x)), y' = x - y + z, z' = -b y, f = m1 x + (m0 - m1) (|x + 1| - |x - 1|)/2.

    a, b     ratios of the circuit; m0, m1   slopes of the resistor inside and outside |x| = 1

    All in units of the circuit. The outer equilibria are x = -z = +-(m1 - m0)/(1 + m1), y = 0.
    """
    p = parameters(
        a=Parameter(a, "", 0, description="ratio of the capacitors"),
        b=Parameter(b, "", 0, description="ratio of capacitor and inductor"),
        m0=Parameter(m0, "", description="inner slope of the resistor"),
        m1=Parameter(m1, "", description="outer slope of the resistor"),
    )
    x, y, z = states("x y z")
    f = p.m1 * x + (p.m0 - p.m1) * (Abs(x + 1) - Abs(x - 1)) / 2
    return System(
        {x: p.a * (y - x - f), y: x - y + z, z: -p.b * y}, parameters=p,
        labels={"t": "dimensionless time", "x": "voltage x", "y": "voltage y", "z": "current z"},
    )


MODEL = register(
    Model(
        "chua",
        chua,
        (0.7, 0.0, 0.0),
        (0.0, 10.0),
        "Chua's circuit, piecewise linear: the double scroll.",
        "Matsumoto 1984; Chua, Komuro, Matsumoto 1986",
    )
)
