"""A boost converter whose switch is closed for a fixed share of each period."""

from __future__ import annotations

from filippov import Heaviside, Parameter, Surface, System, TimeEvent, parameters, states
from filippov.models.registry import Model, register


def boost_pwm(
    Vin: float = 5.0, L: float = 1e-3, C: float = 5e-5, R: float = 20.0, duty: float = 0.5, T: float = 1e-4
) -> System:
    """L i' = Vin - (1 - u) v, C v' = (1 - u) i - v/R, u = H(duty - ramp), ramp' = 1/T, 0 at each clock.

    Vin       supply voltage [V]; duty   share of the period in which the switch is closed
    L, C, R   inductance [H], capacitance [F], load [ohm]; T   period [s]

    The mean output tends to about Vin/(1 - duty) (continuous conduction).
    """
    p = parameters(
        Vin=Parameter(Vin, "V", 0, description="supply voltage"),
        L=Parameter(L, "H", 1e-12, description="inductance"),
        C=Parameter(C, "F", 1e-12, description="capacitance"),
        R=Parameter(R, "ohm", 1e-12, description="load"),
        duty=Parameter(duty, "", 0, 1, description="share of the period with the switch closed"),
        T=Parameter(T, "s", 1e-12, description="period"),
    )
    i, v, ramp = states("i v ramp")
    wait = p.duty - ramp
    out = 1 - Heaviside(wait)
    return System(
        {i: (p.Vin - out * v) / p.L, v: (out * i - v / p.R) / p.C, ramp: 1 / p.T},
        surfaces=[Surface("switch", wait)],
        parameters=p,
        time_events=[TimeEvent("clock", period=p.T, start=p.T, reset={ramp: 0})],
        labels={"t": "time [s]", "i": "current [A]", "v": "voltage [V]", "ramp": "ramp / period"},
    )


MODEL = register(
    Model(
        "boost_pwm",
        boost_pwm,
        (1.0, 5.0, 0.0),
        (0.0, 5e-3),
        "Boost converter under pulse-width modulation at a fixed duty.",
        "Erickson, Maksimovic 2001; numbers chosen here",
    )
)


def boost_sliding(
    Vin: float = 5.0, L: float = 1e-3, C: float = 5e-5, R: float = 20.0, iref: float = 1.0
) -> System:
    """L i' = Vin - (1 - u) v, C v' = (1 - u) i - v/R, u = H(iref - i): the switch holds the current.

    Vin       supply voltage [V]; iref   wanted current [A]; L, C, R   as above

    While it slides 1 - u = Vin/v, so that v^2 tends to Vin iref R as exp(-2 t/(R C)).
    """
    p = parameters(
        Vin=Parameter(Vin, "V", 0, description="supply voltage"),
        L=Parameter(L, "H", 1e-12, description="inductance"),
        C=Parameter(C, "F", 1e-12, description="capacitance"),
        R=Parameter(R, "ohm", 1e-12, description="load"),
        iref=Parameter(iref, "A", 0, description="wanted current"),
    )
    i, v = states("i v")
    out = 1 - Heaviside(p.iref - i)
    return System(
        {i: (p.Vin - out * v) / p.L, v: (out * i - v / p.R) / p.C},
        surfaces=[Surface("current", p.iref - i)],
        parameters=p,
        labels={"t": "time [s]", "i": "current [A]", "v": "voltage [V]"},
    )


SLIDING = register(
    Model(
        "boost_sliding",
        boost_sliding,
        (0.2, 8.0),
        (0.0, 4e-3),
        "Boost converter in sliding mode: the switch holds the current, the voltage settles.",
        "Sira-Ramirez 1987; numbers chosen here",
    )
)
