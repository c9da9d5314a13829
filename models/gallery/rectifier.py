"""A half-wave rectifier: an ideal diode from an alternating source to R and C in parallel."""

from __future__ import annotations

from filippov import Heaviside, Parameter, Surface, System, parameters, sin, states, t
from filippov.models.registry import Model, register


def rectifier(
    E: float = 10.0, omega: float = 314.0, R: float = 100.0, C: float = 1e-4, limit: float = 2.0
) -> System:
    """C u' in limit H(e - u) - u/R, e = E sin(omega t): the diode conducts while sliding on u = e.

    E, omega   amplitude [V] and frequency [rad/s] of the source
    R, C       load [ohm] and capacitance [F]
    limit      largest current of the source [A]; while it is not reached the diode is ideal

    Conduction ends at tan(omega t) = -omega R C, where the diode's current is 0; then u decays with R C.
    """
    p = parameters(
        E=Parameter(E, "V", 0, description="amplitude of the source"),
        omega=Parameter(omega, "rad/s", 0, description="frequency of the source"),
        R=Parameter(R, "ohm", 1e-12, description="load"),
        C=Parameter(C, "F", 1e-12, description="capacitance"),
        limit=Parameter(limit, "A", 0, description="largest current of the source"),
    )
    (u,) = states("u")
    forward = p.E * sin(p.omega * t) - u
    return System(
        {u: (p.limit * Heaviside(forward) - u / p.R) / p.C},
        surfaces=[Surface("diode", forward)],
        parameters=p,
        labels={"t": "time [s]", "u": "voltage [V]"},
    )


MODEL = register(
    Model(
        "rectifier",
        rectifier,
        (0.0,),
        (0.0, 0.06),
        "Half-wave rectifier with an ideal diode: conduction is sliding, its end in closed form.",
        "Acary, Brogliato 2008; numbers chosen here",
    )
)
