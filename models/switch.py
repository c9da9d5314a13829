"""The Switch model of a controlled mass: three ordinary differential equations, chosen by |v| and u.

    slip        |v| > eta                         m v' = -u - F(v)
    stick       |v| <= eta, -Fs+ <= u <= Fs-        v' = -alpha v
    transition  |v| <= eta, u outside             m v' = -u + Fs-  (u > Fs-),  -u - Fs+  (u < -Fs+)

with x' = v, z' = x throughout. With equal levels the transition is (-u + Fs sgn u)/m.
Sources: Karnopp 1985; Leine 2000.
"""

from __future__ import annotations

from dataclasses import dataclass

from sympy import Abs, Piecewise

from filippov.model.surface import Surface
from filippov.model.system import System
from filippov.models.friction import SMALLEST, declare
from filippov.models.mass import REFERENCE, SOURCE, ControlledMass
from filippov.models.registry import Model, register


@dataclass(frozen=True)
class Switch:
    """Band half-width eta [m/s] > 0 and acceleration coefficient alpha [1/s] >= 0.

    Its surfaces are "band upper" (v - eta), "band lower" (v + eta), "effort upper" (u - Fs-) and
    "effort lower" (u + Fs+).
    """

    eta: float = 1e-8
    alpha: float = 100.0

    def system(self, plant: ControlledMass = REFERENCE) -> System:
        """Return the band model of a plant as an ordinary System, with eta and alpha as parameters.

        Raises ModelError for a law without dry friction.
        """
        plant.check_dry("Switch")
        parts = plant.parts(
            **declare("eta", self.eta, "m/s", "half-width of the stick band", SMALLEST),
            **declare("alpha", self.alpha, "1/s", "acceleration coefficient in the stick band"),
        )
        x, v, z, p, tail = parts
        u = plant.controller.effort(x, v, z, p)
        up, down = plant.friction.static(p)
        # |v| measured from the edge of the band: smooth beyond the edge, and no surface at v = 0.
        plus, _ = plant.friction.pieces(v, p.eta + Abs(v - p.eta), p)
        _, minus = plant.friction.pieces(v, p.eta + Abs(v + p.eta), p)
        acceleration = Piecewise(
            ((-u - plus) / p.m, v > p.eta),
            ((-u - minus) / p.m, v < -p.eta),
            ((-u + down) / p.m, u > down),
            ((-u - up) / p.m, u < -up),
            (-p.alpha * v, True),
        )
        return System(
            {x: v, v: acceleration, **tail},
            surfaces=[
                Surface("band upper", v - p.eta),
                Surface("band lower", v + p.eta),
                Surface("effort upper", u - down),
                Surface("effort lower", u + up),
            ],
            parameters=p,
            labels=parts.labels,
        )


def hunting_switch(eta: float = 1e-8, alpha: float = 100.0) -> System:
    """Return the Switch model of the reference system."""
    return Switch(eta, alpha).system()


MODEL = register(
    Model(
        "hunting_switch",
        hunting_switch,
        (0.1, 0.0, 0.0),
        (0.0, 20.0),
        "The reference system as Leine's Switch model: a stick band of half-width eta.",
        f"{SOURCE}, section 2; Leine 2000",
    )
)
