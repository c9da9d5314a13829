"""A synchronous buck converter with dead time: for a moment both switches are open and the diodes conduct."""

from __future__ import annotations

from filippov import Parameter, Surface, System, TimeEvent, parameters, sign, states
from filippov.models.registry import Model, register


def dead_time(
    Vin: float = 12.0, Vd: float = 0.7, L: float = 1e-5, C: float = 1e-4, R: float = 5.0,
    duty: float = 0.5, dead: float = 8e-7, T: float = 1e-5,
) -> System:  # fmt: skip
    """L i' in u - v, C v' = i - v/R, u = Vin, 0 (leg = 1, -1), Vin/2 - (Vin/2 + Vd) Sgn(i) (leg = 0).

    Vin, Vd   supply and forward voltage of the diodes [V]
    L, C, R   inductance [H], capacitance [F], load [ohm]
    duty      share of the period after which the upper switch opens; T   period [s]
    dead      time between the opening of one switch and the closing of the other [s]

    With i > 0 throughout the mean output is duty Vin - (Vin + 2 Vd) dead/T. Where the current comes to 0 in
    the dead time no diode conducts until the next switch closes: sliding on i = 0.
    """
    p = parameters(
        Vin=Parameter(Vin, "V", 0, description="supply voltage"),
        Vd=Parameter(Vd, "V", 0, description="forward voltage of a diode"),
        L=Parameter(L, "H", 1e-12, description="inductance"),
        C=Parameter(C, "F", 1e-12, description="capacitance"),
        R=Parameter(R, "ohm", 1e-12, description="load"),
        duty=Parameter(duty, "", 0, 1, description="share of the period after which the upper switch opens"),
        dead=Parameter(dead, "s", 1e-12, description="dead time"),
        T=Parameter(T, "s", 1e-12, description="period"),
    )
    i, v, leg = states("i v leg")
    diodes = p.Vin / 2 - (p.Vin / 2 + p.Vd) * sign(i)
    u = (1 - leg**2) * diodes + leg**2 * p.Vin * (1 + leg) / 2
    return System(
        {i: (u - v) / p.L, v: (i - v / p.R) / p.C, leg: 0 * leg},
        surfaces=[Surface("current", i)],
        parameters=p,
        time_events=[
            TimeEvent("upper closes", period=p.T, start=p.dead, reset={leg: 1}),
            TimeEvent("upper opens", period=p.T, start=p.duty * p.T, reset={leg: 0}),
            TimeEvent("lower closes", period=p.T, start=p.duty * p.T + p.dead, reset={leg: -1}),
            TimeEvent("lower opens", period=p.T, start=p.T, reset={leg: 0}),
        ],
        outputs={"u": u},
        labels={"t": "time [s]", "i": "current [A]", "v": "voltage [V]", "leg": "switches",
                "u": "voltage of the leg [V]"},
    )


MODEL = register(
    Model(
        "buck_dead_time",
        dead_time,
        (-0.3, 5.8, 0.0),
        (0.0, 4e-5),
        "Buck converter with two switches: the current waits at 0 in the dead time.",
        "Jeong, Park 1991, IEEE Trans. Ind. Electron. 38, 108; numbers chosen here",
    )
)
