"""Karnopp's model of a controlled mass: inside |v| <= DV the velocity counts as 0.

    w = v for |v| > DV, else 0                    x' = w, z' = x, u = P (x + D w + I z)
    |v| > DV                                      m v' = -u - F(v)
    |v| <= DV, -Fs+ <= u <= Fs-                      v' = 0               friction cancels u
    |v| <= DV, u outside                          m v' = -u + Fs-  (u > Fs-),  -u - Fs+  (u < -Fs+)

Karnopp's state is the momentum m v: within the band it keeps the value with which the band was entered, and
the velocity w that the rest of the model sees is 0. After break-away it moves until it leaves the band,
during which x stands still. That delay and the jump of w by DV are the errors of the model.
Sources: Karnopp 1985; Leine 2000, section 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy
from sympy import Abs, Piecewise

from filippov.models.friction import SMALLEST, declare
from filippov.models.mass import REFERENCE, SOURCE, ControlledMass
from filippov.models.registry import Model, register
from filippov.surface import Surface
from filippov.system import System


@dataclass(frozen=True)
class Karnopp:
    """Band half-width DV [m/s] > 0.

    Its surfaces are "band upper" (v - DV), "band lower" (v + DV), "effort upper" (u0 - Fs-) and "effort
    lower" (u0 + Fs+), u0 = u at w = 0.
    """

    DV: float = 1e-4

    def system(self, plant: ControlledMass = REFERENCE) -> System:
        """Return the band model of a plant as an ordinary System, with DV as a parameter."""
        x, v, z, p, tail = plant.parts(
            **declare("DV", self.DV, "m/s", "half-width of the zero-velocity band", SMALLEST)
        )
        u = plant.controller.effort(x, v, z, p)
        rest = plant.controller.effort(x, sympy.S.Zero, z, p)
        up, down = plant.friction.static(p)
        plus, _ = plant.friction.pieces(v, p.DV + Abs(v - p.DV), p)
        _, minus = plant.friction.pieces(v, p.DV + Abs(v + p.DV), p)
        acceleration = Piecewise(
            ((-u - plus) / p.m, v > p.DV),
            ((-u - minus) / p.m, v < -p.DV),
            ((-rest + down) / p.m, rest > down),
            ((-rest - up) / p.m, rest < -up),
            (0, True),
        )
        return System(
            {x: Piecewise((v, v > p.DV), (v, v < -p.DV), (0, True)), v: acceleration, **tail},
            surfaces=[
                Surface("band upper", v - p.DV),
                Surface("band lower", v + p.DV),
                Surface("effort upper", rest - down),
                Surface("effort lower", rest + up),
            ],
            parameters=p,
        )


def hunting_karnopp(DV: float = 1e-4) -> System:
    """Return Karnopp's model of the reference system."""
    return Karnopp(DV).system()


MODEL = register(
    Model(
        "hunting_karnopp",
        hunting_karnopp,
        (0.1, 0.0, 0.0),
        (0.0, 20.0),
        "The reference system as Karnopp's model: velocity 0 within |v| <= DV.",
        f"{SOURCE}; Karnopp 1985",
    )
)
