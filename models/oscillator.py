"""A dry-friction oscillator, free or with harmonic forcing: m v' in -k x - d v - F(v) + A cos(omega t)."""

from __future__ import annotations

from functools import partial
from typing import Any

from filippov import Parameter, System, cos, parameters, states, t
from filippov.models.friction import AXIS_LABELS, SMALLEST, FrictionLaw, declare
from filippov.models.laws import Coulomb
from filippov.models.registry import Invariant, Model, register

LAW = Coulomb(Fc=0.4)


def oscillator(
    friction: FrictionLaw = LAW,
    m: float = 1.0,
    k: float = 1.0,
    d: float = 0.0,
    A: float = 0.0,
    omega: float = 1.0,
) -> System:
    """Return the oscillator; the surface "velocity" is v = 0.

    friction   Coulomb(Fc=0.4) by default
    m, k, d    mass [kg], stiffness [N/m], damping [N s/m]
    A, omega   amplitude [N] and frequency [rad/s] of the forcing
    """
    p = parameters(
        **declare("m", m, "kg", "mass", SMALLEST),
        **declare("k", k, "N/m", "stiffness"),
        **declare("d", d, "N s/m", "damping"),
        A=Parameter(A, "N", description="amplitude of the forcing"),
        omega=Parameter(omega, "rad/s", description="frequency of the forcing"),
        **friction.parameters(),
    )
    x, v = states("x v")
    drive = p.A * cos(p.omega * t)
    return System(
        {x: v, v: (-p.k * x - p.d * v - friction.force(v, p) + drive) / p.m},
        surfaces=friction.surfaces(v, p),
        parameters=p,
        labels=AXIS_LABELS,
    )


def _position(time: float, x: Any, p: Any) -> float:
    return float(x[0])


def _energy(time: float, x: Any, p: Any, side: int) -> float:
    """Return the energy about the shifted centre -side Fc/k, constant while sliding without damping."""
    return float(0.5 * p.m * x[1] ** 2 + 0.5 * p.k * (x[0] + side * p.Fc / p.k) ** 2)


STICK = Invariant("position in stick", _position, "0")

FREE = register(
    Model(
        "oscillator",
        oscillator,
        (3.0, 0.0),
        (0.0, 20.0),
        "Free oscillator with Coulomb friction: the amplitude falls by 2 Fc/k a half cycle.",
        "Calvo, Montijano, Randez 2016",
        (
            STICK,
            Invariant("energy about -Fc/k", partial(_energy, side=1), "+"),
            Invariant("energy about Fc/k", partial(_energy, side=-1), "-"),
        ),
    )
)
FORCED = register(
    Model(
        "oscillator_forced",
        partial(oscillator, Coulomb(Fc=0.6), A=1.0, omega=0.6),
        (1.0, 0.0),
        (0.0, 60.0),
        "Harmonically forced oscillator with Coulomb friction: two stops a period.",
        "Den Hartog 1931; Shaw 1986; numbers chosen here",
        (STICK,),
    )
)
