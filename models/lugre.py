"""The LuGre model of a controlled mass: the deflection w of bristles in place of the set at rest.

    w' = v - sigma0 |v| w/g(v)
    m v' = -u - sigma0 w - sigma1 w' - b v,   x' = v, z' = x

g is the slip curve of the same friction law, so that sliding steadily the force is g sgn(v) + b v.
Source: Canudas de Wit, Olsson, Astrom, Lischinsky 1995.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sympy import Abs, sign

from filippov import System, states
from filippov.models.friction import declare
from filippov.models.mass import REFERENCE, SOURCE, ControlledMass
from filippov.models.registry import Model, register


@dataclass(frozen=True)
class LuGre:
    """Bristle stiffness sigma0 [N/m] and damping sigma1 [N s/m]; the default values are the published ones.

    At these the equations are stiff: rates up to sigma0 |v|/g.
    """

    sigma0: float = 1e5
    sigma1: float = math.sqrt(1e5)

    def system(self, plant: ControlledMass = REFERENCE) -> System:
        """Return the model of a plant, states x, v, (z,) w; ModelError for a law without dry friction."""
        plant.check_dry("LuGre")
        parts = plant.parts(
            **declare("sigma0", self.sigma0, "N/m", "bristle stiffness"),
            **declare("sigma1", self.sigma1, "N s/m", "bristle damping"),
        )
        x, v, z, p, tail = parts
        (w,) = states("w")
        plus, minus = plant.friction.slip(Abs(v), p)
        g = plus if plus == minus else ((1 + sign(v)) * plus + (1 - sign(v)) * minus) / 2
        rate = v - p.sigma0 * Abs(v) * w / g
        u = plant.controller.effort(x, v, z, p)
        force = p.sigma0 * w + p.sigma1 * rate + plant.friction.viscous(v, p)
        labels = {**parts.labels, "w": "deflection of the bristles [m]"}
        return System({x: v, v: (-u - force) / p.m, **tail, w: rate}, parameters=p, labels=labels)


def hunting_lugre(sigma0: float = 1e5, sigma1: float = math.sqrt(1e5)) -> System:
    """Return the LuGre model of the reference system."""
    return LuGre(sigma0, sigma1).system()


MODEL = register(
    Model(
        "hunting_lugre",
        hunting_lugre,
        (0.1, 0.0, 0.0, 0.0),
        (0.0, 2.0),
        "The reference system with LuGre friction: bristles in place of the set at rest.",
        f"{SOURCE}; Canudas de Wit, Olsson, Astrom, Lischinsky 1995",
    )
)
