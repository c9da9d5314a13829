"""A thermostat: T' = -K (T - outside) + heat while on, the relay with hysteresis about the setpoint."""

from __future__ import annotations

from filippov import Heaviside, Hysteresis, Parameter, Surface, System, parameters, states
from filippov.models.registry import Model, register


def thermostat(
    K: float = 0.1, outside: float = 18.0, heat: float = 2.0, setpoint: float = 22.75, width: float = 0.75
) -> System:
    """Return the room; heating goes off at setpoint + width and on at setpoint - width.

    K         loss [1/h]; outside, setpoint, width [degC]; heat [degC/h]
    width     half-width of the hysteresis > 0, a property of the comparator, no parameter

    Source: Calvo, Montijano, Randez 2016.
    """
    p = parameters(
        K=Parameter(K, "1/h", 0, description="loss"),
        outside=Parameter(outside, "degC", description="temperature outside"),
        heat=Parameter(heat, "degC/h", description="heating rate"),
        setpoint=Parameter(setpoint, "degC", description="middle of the hysteresis"),
    )
    (T,) = states("T")
    system = System(
        {T: -p.K * (T - p.outside) + p.heat * Heaviside(p.setpoint - T)},
        surfaces=[Surface("setpoint", T - p.setpoint)],
        parameters=p,
        labels={"t": "time [h]", "T": "temperature [degC]"},
    )
    return system.with_comparator(Hysteresis(width))


MODEL = register(
    Model(
        "thermostat",
        thermostat,
        (15.0,),
        (0.0, 20.0),
        "Thermostat with hysteresis: a periodic solution of period 4.1689.",
        "Calvo, Montijano, Randez 2016",
    )
)
