"""The friction laws of the family: viscous, Coulomb, static + Coulomb, Stribeck, hyperbolic."""

from __future__ import annotations

from dataclasses import dataclass

import sympy
from sympy import Expr, exp

from filippov import ModelError, Parameter
from filippov.model.parameter_symbol import ParameterNamespace
from filippov.models.friction import SMALLEST, FrictionLaw, Level, Sides, declare, sides, viscosity


@dataclass(frozen=True)
class Viscous(FrictionLaw):
    """F = b v: no dry part, so no surface."""

    b: Level = 1.0

    def parameters(self) -> dict[str, Parameter]:
        """Return b."""
        return viscosity(self.b)

    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """g = 0."""
        return sympy.S.Zero, sympy.S.Zero


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """g = Fc, at rest [-Fc, Fc]. Source: Coulomb 1785."""

    Fc: Level = 2.0
    b: Level = 0.0

    def parameters(self) -> dict[str, Parameter]:
        """Return Fc, b."""
        return declare("Fc", self.Fc, "N", "Coulomb friction level") | viscosity(self.b)

    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """g = Fc."""
        return sides(p, "Fc")


@dataclass(frozen=True)
class StaticCoulomb(FrictionLaw):
    """g = Fc, at rest [-Fs, Fs] with Fs >= Fc > 0: wider than the hull, multipliers in [-Fs/Fc, Fs/Fc].

    Raises ModelError for Fs < Fc: the values on the two sides then lie outside the set at rest.
    """

    Fs: Level = 4.0
    Fc: Level = 2.0
    b: Level = 0.0

    def parameters(self) -> dict[str, Parameter]:
        """Return Fs, Fc, b."""
        return (
            declare("Fs", self.Fs, "N", "static friction level (at rest)", SMALLEST)
            | declare("Fc", self.Fc, "N", "Coulomb friction level (sliding)", SMALLEST)
            | viscosity(self.b)
        )

    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """g = Fc."""
        return sides(p, "Fc")

    def static(self, p: ParameterNamespace) -> Sides:
        """Return Fs."""
        return sides(p, "Fs")

    def __post_init__(self) -> None:
        super().__post_init__()
        (low, high), (below, above) = self.levels(), self.limits()
        if high < above or low > below:
            raise ModelError(
                f"Fs is {self.Fs} and Fc is {self.Fc}, expected Fs >= Fc in each direction. "
                "For a curve that rises from a lower level at rest use Stribeck(Fs, Fc, ...)."
            )


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    """g = Fc + (Fs - Fc) exp(-(|v|/vs)^beta), beta > 0; g(0) = Fs, so the set at rest is Filippov's hull.

    The slope of g at 0 is 0 for beta > 1, -(Fs - Fc)/vs for beta = 1 and infinite for beta < 1.
    Source: Hensen & van de Molengraft 2002, equation 3; the curve after Stribeck 1902.
    """

    Fs: Level = 4.0
    Fc: Level = 2.0
    vs: Level = 0.1
    beta: Level = 2.0
    b: Level = 1.0

    def parameters(self) -> dict[str, Parameter]:
        """Return Fs, Fc, vs, beta, b."""
        return (
            declare("Fs", self.Fs, "N", "static friction level")
            | declare("Fc", self.Fc, "N", "Coulomb friction level")
            | declare("vs", self.vs, "m/s", "Stribeck velocity", SMALLEST)
            | declare("beta", self.beta, "", "Stribeck exponent", SMALLEST)
            | viscosity(self.b)
        )

    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """g = Fc + (Fs - Fc) exp(-(|v|/vs)^beta)."""
        levels = zip(sides(p, "Fs"), sides(p, "Fc"), sides(p, "vs"), sides(p, "beta"), strict=True)
        plus, minus = (Fc + (Fs - Fc) * exp(-((speed / vs) ** beta)) for Fs, Fc, vs, beta in levels)
        return plus, minus


@dataclass(frozen=True)
class Hyperbolic(FrictionLaw):
    """g = Fc + (Fs - Fc)/(1 + gamma |v|) + eta v^2; Fc = eta = 0 is the curve Fs/(1 + gamma |v|).

    Sources: Leine, van Campen, de Kraker, van den Steen 1998; Galvanetto & Knudsen 1997.
    """

    Fs: Level = 1.0
    Fc: Level = 0.0
    gamma: Level = 3.0
    eta: Level = 0.0
    b: Level = 0.0

    def parameters(self) -> dict[str, Parameter]:
        """Return Fs, Fc, gamma, eta, b."""
        return (
            declare("Fs", self.Fs, "N", "static friction level")
            | declare("Fc", self.Fc, "N", "level of the falling part at high speed")
            | declare("gamma", self.gamma, "s/m", "steepness of the fall")
            | declare("eta", self.eta, "N s^2/m^2", "quadratic rise")
            | viscosity(self.b)
        )

    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """g = Fc + (Fs - Fc)/(1 + gamma |v|) + eta v^2."""
        names = ("Fs", "Fc", "gamma", "eta")
        levels = zip(*(sides(p, name) for name in names), strict=True)
        plus, minus = (Fc + (Fs - Fc) / (1 + gamma * speed) + eta * speed**2 for Fs, Fc, gamma, eta in levels)
        return plus, minus
