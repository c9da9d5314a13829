"""The Switch model of a controlled mass: three ordinary differential equations, chosen by |v| and u.

    slip        |v| > eta                         m v' = -u - F(v)
    stick       |v| <= eta, -Fs+ <= u <= Fs-        v' = -alpha v
    transition  |v| <= eta, u outside             m v' = -u + Fs-  (u > Fs-),  -u - Fs+  (u < -Fs+)

with x' = v, z' = x throughout: the comparator `filippov.Switch` of the plant's inclusion with its balance in
motion, because u contains v as well. With equal levels the transition is (-u + Fs sgn u)/m. Sources: Karnopp
1985; Leine 2000.
"""

from __future__ import annotations

from dataclasses import dataclass

from filippov.model import comparator
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
        return plant.band_system(
            comparator.Switch(self.eta, self.alpha, "in motion"),
            **declare("eta", self.eta, "m/s", "half-width of the stick band", SMALLEST),
            **declare("alpha", self.alpha, "1/s", "acceleration coefficient in the stick band"),
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
