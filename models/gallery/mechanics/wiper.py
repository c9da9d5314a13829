"""A windscreen wiper: the arm sweeps back and forth, the lip sticks at each turn and judders behind it."""

from __future__ import annotations

from filippov import Abs, Parameter, Surface, System, parameters, sign, sin, states, t
from filippov.models.registry import Model, register


def wiper(
    m: float = 0.1,
    k: float = 500.0,
    c: float = 1.0,
    A: float = 0.3,
    W: float = 4.0,
    Fs: float = 5.0,
    Fc: float = 2.0,
    scale: float = 0.3,
) -> System:
    """m x'' + c (x' - a') + k (x - a) in -Sgn(x') (Fc + (Fs - Fc)/(1 + |x'|/scale)), a = A sin(W t).

    m, k, c   mass of the lip [kg], stiffness [N/m] and damping [N s/m] between arm and lip
    A, W      amplitude [m] and angular frequency [rad/s] of the arm
    Fs, Fc    friction on the glass at rest and in fast slip [N]; scale   slip speed over which it falls [m/s]

    At rest the lip holds until |k (a - x) + c a'| = Fs.
    """
    p = parameters(
        m=Parameter(m, "kg", 1e-12, description="mass of the lip"),
        k=Parameter(k, "N/m", 0, description="stiffness between arm and lip"),
        c=Parameter(c, "N*s/m", 0, description="damping between arm and lip"),
        A=Parameter(A, "m", 0, description="amplitude of the arm"),
        W=Parameter(W, "rad/s", 0, description="angular frequency of the arm"),
        Fs=Parameter(Fs, "N", 0, description="friction at rest"),
        Fc=Parameter(Fc, "N", 0, description="friction in fast slip"),
        scale=Parameter(scale, "m/s", 1e-12, description="slip speed over which the friction falls"),
    )
    x, v = states("x v")
    arm = p.A * sin(p.W * t)
    friction = sign(v) * (p.Fc + (p.Fs - p.Fc) / (1 + Abs(v) / p.scale))
    return System(
        {x: v, v: (p.k * (arm - x) + p.c * (arm.diff(t) - v) - friction) / p.m},
        surfaces=[Surface("glass", v)],
        parameters=p,
        labels={"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"},
    )


MODEL = register(
    Model(
        "wiper",
        wiper,
        (0.0, 0.0),
        (0.0, 2.0),
        "A wiper's lip on the glass, driven by the arm: stick and judder at each turn.",
        "equation and numbers chosen here",
    )
)
