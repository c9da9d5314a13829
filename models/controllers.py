"""Controllers of a position error x1 to 0: u = P (x1 + D x2 + I x3), x2 = x1', x3' = x1.

The form is that of Hensen & van de Molengraft 2002: D [s] and I [1/s] are times and rates, not gains; all of
u is proportional to P. With P = 0 or I = 0 the loop is degenerate: see `filippov.models.mass.degeneracies`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from sympy import Expr

from filippov.model.parameter import Parameter
from filippov.model.parameter_symbol import ParameterNamespace
from filippov.models.friction import declare


@dataclass(frozen=True)
class Controller(ABC):
    """What every controller gives."""

    # Whether the loop has the state x3, the integral of x1.
    integral: ClassVar[bool] = False

    @abstractmethod
    def parameters(self) -> dict[str, Parameter]:
        """Return the parameters that the controller owns, in order."""

    @abstractmethod
    def effort(self, x: Expr, v: Expr, z: Expr, p: ParameterNamespace) -> Expr:
        """Return u; z is not used where `integral` is False."""

    def __post_init__(self) -> None:
        self.parameters()


@dataclass(frozen=True)
class P(Controller):
    """u = P x1."""

    P: float = 10.0

    def parameters(self) -> dict[str, Parameter]:
        """Return P."""
        return declare("P", self.P, "N/m", "proportional gain")

    def effort(self, x: Expr, v: Expr, z: Expr, p: ParameterNamespace) -> Expr:
        """u = P x1."""
        return p.P * x


@dataclass(frozen=True)
class PD(Controller):
    """u = P (x1 + D x2)."""

    P: float = 10.0
    D: float = 1.0

    def parameters(self) -> dict[str, Parameter]:
        """Return P, D."""
        return declare("P", self.P, "N/m", "proportional gain") | declare(
            "D", self.D, "s", "derivative time: u holds P D v"
        )

    def effort(self, x: Expr, v: Expr, z: Expr, p: ParameterNamespace) -> Expr:
        """u = P (x1 + D x2)."""
        return p.P * (x + p.D * v)


@dataclass(frozen=True)
class PID(Controller):
    """u = P (x1 + D x2 + I x3)."""

    P: float = 10.0
    D: float = 1.0
    I: float = 10.0

    integral: ClassVar[bool] = True

    def parameters(self) -> dict[str, Parameter]:
        """Return P, D, I."""
        return (
            declare("P", self.P, "N/m", "proportional gain")
            | declare("D", self.D, "s", "derivative time: u holds P D v")
            | declare("I", self.I, "1/s", "integral rate: u holds P I z")
        )

    def effort(self, x: Expr, v: Expr, z: Expr, p: ParameterNamespace) -> Expr:
        """u = P (x1 + D x2 + I x3)."""
        return p.P * (x + p.D * v + p.I * z)
