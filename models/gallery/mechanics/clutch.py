"""A clutch: an engine and a load whose plates slip on each other until they lock."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, sign, states
from filippov.models.registry import Model, register


def clutch(
    J1: float = 0.2, J2: float = 1.0, drive: float = 50.0, load: float = 20.0, grip: float = 120.0
) -> System:
    """J1 w1' in drive - grip Sgn(w1 - w2), J2 w2' in grip Sgn(w1 - w2) - load.

    J1, J2        inertias of engine and load [kg m^2]
    drive, load   torques on them [N m]
    grip          friction torque of the plates [N m]

    They lock at (w1 - w2)/((grip - drive)/J1 + (grip - load)/J2) and turn on with (drive - load)/(J1 + J2).
    """
    p = parameters(
        J1=Parameter(J1, "kg m^2", 1e-12, description="inertia of the engine"),
        J2=Parameter(J2, "kg m^2", 1e-12, description="inertia of the load"),
        drive=Parameter(drive, "N m", description="torque of the engine"),
        load=Parameter(load, "N m", description="torque of the load"),
        grip=Parameter(grip, "N m", 0, description="friction torque of the plates"),
    )
    w1, w2 = states("w1 w2")
    torque = p.grip * sign(w1 - w2)
    return System(
        {w1: (p.drive - torque) / p.J1, w2: (torque - p.load) / p.J2},
        surfaces=[Surface("plates", w1 - w2)],
        parameters=p,
        labels={"t": "time [s]", "w1": "speed w1 [rad/s]", "w2": "speed w2 [rad/s]"},
    )


MODEL = register(
    Model(
        "clutch",
        clutch,
        (200.0, 0.0),
        (0.0, 1.0),
        "A clutch with two inertias: it locks at t = 4/9 s.",
        "Karnopp 1985; numbers chosen here",
    )
)
