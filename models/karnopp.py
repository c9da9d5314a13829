"""Karnopp's model of a controlled mass: inside |v| <= DV the velocity counts as 0.

    w = v for |v| > DV, else 0                    x' = w, z' = x, u = P (x + D w + I z)
    |v| > DV                                      m v' = -u - F(v)
    |v| <= DV, -Fs+ <= u <= Fs-                     v' = -alpha v          stuck: friction cancels u
    |v| <= DV, u outside                          m v' = -u + Fs-  (u > Fs-),  -u - Fs+  (u < -Fs+)

It is the comparator `filippov.Karnopp` of the plant's inclusion. w is the velocity in the rest of the model,
exactly 0 within the band, so x does not drift in stick. The state v is Karnopp's momentum over m. It is
brought to 0 in stick; with alpha = 0, Karnopp's own form, it keeps the value +-DV with which the band was
entered, on the edge of the band, to which the solution stays tangent. After break-away v moves until it
leaves the band, while x stands still: that delay and the jump of w by DV are its errors. Sources: Karnopp
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
class Karnopp:
    """Band half-width DV [m/s] > 0 and rate alpha [1/s] >= 0 at which the state v goes to 0 in stick.

    Its surfaces are "band upper" (v - DV), "band lower" (v + DV), "effort upper" (u0 - Fs-) and "effort
    lower" (u0 + Fs+), u0 = u at w = 0.
    """

    DV: float = 1e-4
    alpha: float = 100.0

    def system(self, plant: ControlledMass = REFERENCE) -> System:
        """Return the band model of a plant as an ordinary System, with DV and alpha as parameters.

        Raises ModelError for a law without dry friction.
        """
        return plant.band_system(
            comparator.Karnopp(self.DV, self.alpha),
            **declare("DV", self.DV, "m/s", "half-width of the zero-velocity band", SMALLEST),
            **declare("alpha", self.alpha, "1/s", "rate of the hidden velocity in stick"),
        )


def hunting_karnopp(DV: float = 1e-4, alpha: float = 100.0) -> System:
    """Return Karnopp's model of the reference system."""
    return Karnopp(DV, alpha).system()


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
