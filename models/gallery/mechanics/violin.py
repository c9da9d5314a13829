"""A violin string, one mode of it: the bow carries it along until the string tears itself loose."""

from __future__ import annotations

from filippov import Abs, Parameter, Surface, System, parameters, pi, sign, states
from filippov.models.registry import Model, register


def violin(
    m: float = 1e-3,
    f: float = 440.0,
    zeta: float = 0.01,
    bow: float = 0.1,
    Fs: float = 0.5,
    Fc: float = 0.2,
    scale: float = 0.1,
) -> System:
    """m (x'' + 2 zeta w x' + w^2 x) in -F(x' - bow), F(u) = Sgn(u) (Fc + (Fs - Fc)/(1 + |u|/scale)).

    m, f, zeta   mass [kg], frequency [Hz] and damping ratio of the mode
    bow          speed of the bow [m/s]
    Fs, Fc       friction at rest and in fast slip [N]; scale   slip speed over which it falls [m/s]

    With w = 2 pi f the string tears loose at x = (Fs/m - 2 zeta w bow)/w^2.
    """
    p = parameters(
        m=Parameter(m, "kg", 1e-12, description="mass of the mode"),
        f=Parameter(f, "Hz", 0, description="frequency of the mode"),
        zeta=Parameter(zeta, "", 0, description="damping ratio of the mode"),
        bow=Parameter(bow, "m/s", description="speed of the bow"),
        Fs=Parameter(Fs, "N", 0, description="friction at rest"),
        Fc=Parameter(Fc, "N", 0, description="friction in fast slip"),
        scale=Parameter(scale, "m/s", 1e-12, description="slip speed over which the friction falls"),
    )
    x, v = states("x v")
    slip, w = v - p.bow, 2 * pi * p.f
    friction = sign(slip) * (p.Fc + (p.Fs - p.Fc) / (1 + Abs(slip) / p.scale))
    return System(
        {x: v, v: -2 * p.zeta * w * v - w**2 * x - friction / p.m},
        surfaces=[Surface("bow", slip)],
        parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


MODEL = register(
    Model(
        "violin",
        violin,
        (0.0, 0.1),
        (0.0, 0.02),
        "One mode of a violin string under a moving bow: stick and slip.",
        "Friedlander 1953; numbers chosen here",
    )
)
