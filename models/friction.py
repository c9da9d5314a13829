"""Dry friction laws: one family of set-valued forces F(v), opposed to the sliding velocity v.

    F(v) in  g+(|v|) + b v      v > 0
             [-Fs-, Fs+]        v = 0
            -g-(|v|) + b v      v < 0

A law owns its parameters and gives the same force as an expression with sign(v) (one surface), as one-sided
pieces (for band models) and as numbers (for plots). Every level is one number, or a pair (v > 0, v < 0).
Where the static level is above the limit of the slip curve, the set at v = 0 is wider than Filippov's hull.

Sources: Armstrong-Helouvry, Dupont, Canudas de Wit 1994 (survey); Leine & Nijmeijer 2004.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Abs, Expr, Symbol, sign

from filippov import ModelError, Surface
from filippov.model.parameter import Parameter, ParameterSet, as_number
from filippov.model.parameter_symbol import ParameterNamespace, parameters

# Labels of axes for a mass that moves along x.
AXIS_LABELS = {"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"}

# One number for both directions, or a pair (v > 0, v < 0).
Level = float | tuple[float, float]
Sides = tuple[Expr, Expr]

# Stands for "> 0" where a bound must be closed.
SMALLEST = 1e-12


def declare(name: str, value: Level, unit: str, description: str, lower: float = 0.0) -> dict[str, Parameter]:
    """Return the parameter `name`, or `name_plus` and `name_minus` for a pair; ModelError for a bad value."""
    sides: tuple[tuple[str, str, Any], ...] = (("", "", value),)
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise ModelError(f"{name} has {len(value)} entries, expected a number or (v > 0, v < 0).")
        sides = (("_plus", " for v > 0", value[0]), ("_minus", " for v < 0", value[1]))
    out = {}
    for ending, where, given in sides:
        number = as_number(given, name + ending)
        if number < lower:
            raise ModelError(f"{name + ending} is {number}, expected at least {lower:g} {unit}.".rstrip())
        out[name + ending] = Parameter(number, unit, lower, None, description + where)
    return out


def sides(p: ParameterNamespace, name: str) -> Sides:
    """Return the symbols of a level for v > 0 and v < 0."""
    if name in p:
        return p[name], p[name]
    return p[f"{name}_plus"], p[f"{name}_minus"]


@dataclass(frozen=True)
class FrictionLaw(ABC):
    """What every law gives. A user's law defines `parameters` and `slip`, and `static` if it jumps."""

    @abstractmethod
    def parameters(self) -> dict[str, Parameter]:
        """Return the parameters that the law owns, in order."""

    @abstractmethod
    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """Return (g+, g-) >= 0, the dry force at a sliding speed |v| >= 0, without the viscous part."""

    def static(self, p: ParameterNamespace) -> Sides:
        """Return (Fs+, Fs-): at rest the force is any in [-Fs-, Fs+]. Here the limits of the slip curve."""
        return self.slip(sympy.S.Zero, p)

    def viscosity(self, p: ParameterNamespace) -> Sides:
        """Return the viscous coefficients (b+, b-), 0 for a law that owns no b."""
        own = self.parameters()
        return sides(p, "b") if "b" in own or "b_plus" in own else (sympy.S.Zero, sympy.S.Zero)

    # -- what follows from them ------------------------------------------------------------------------

    @property
    def dry(self) -> bool:
        """Whether the law has a dry part; a level whose value is 0 counts as one."""
        speed = Symbol("_speed", nonnegative=True)
        return not all(g.is_zero for g in self.slip(speed, parameters(**self.parameters())))

    def pieces(self, v: Expr, speed: Expr, p: ParameterNamespace) -> Sides:
        """Return F for v > 0 and for v < 0, smooth in v and in speed, which stands for |v|."""
        (plus, minus), (b_plus, b_minus) = self.slip(speed, p), self.viscosity(p)
        return plus + b_plus * v, -minus + b_minus * v

    def viscous(self, v: Expr, p: ParameterNamespace) -> Expr:
        """Return the viscous part, b v, continuous at v = 0."""
        plus, minus = self.viscosity(p)
        return plus * v if plus == minus else (plus * (v + Abs(v)) + minus * (v - Abs(v))) / 2

    def force(self, v: Expr, p: ParameterNamespace) -> Expr:
        """Return F(v) with sign(v) and |v|: (1 + s)/2 g+ - (1 - s)/2 g- + b v, s = sign(v)."""
        plus, minus = self.slip(Abs(v), p)
        blend = plus * sign(v) if plus == minus else ((1 + sign(v)) * plus - (1 - sign(v)) * minus) / 2
        return blend + self.viscous(v, p)

    def wholly_signed(self, v: Expr, p: ParameterNamespace) -> Expr:
        """Return F(v) as a function of |v| times sign(v): at |v| = 0 nothing but the set at rest is left."""
        speed = Abs(v)
        plus, minus = (
            g + b * speed for g, b in zip(self.slip(speed, p), self.viscosity(p), strict=True)
        )
        return plus * sign(v) if plus == minus else ((1 + sign(v)) * plus - (1 - sign(v)) * minus) / 2

    def radius(self, p: ParameterNamespace) -> Sides:
        """Return (lo, hi): the multipliers s at which (1 + s)/2 g+(0) - (1 - s)/2 g-(0) is -Fs- and Fs+."""
        (plus, minus), (up, down) = self.slip(sympy.S.Zero, p), self.static(p)
        if (plus, minus) == (up, down):
            return -sympy.S.One, sympy.S.One
        return (-2 * down - plus + minus) / (plus + minus), (2 * up - plus + minus) / (plus + minus)

    def surfaces(self, v: Expr, p: ParameterNamespace, name: str = "velocity") -> tuple[Surface, ...]:
        """Return the surface v = 0 with its stiction set; none for a law without a dry part."""
        return (Surface(name, v, radius=self.radius(p)),) if self.dry else ()

    def curve(self, v: npt.ArrayLike, values: Mapping[str, float] | None = None) -> npt.NDArray[np.float64]:
        """Return F(v) for an array of velocities, NaN at v = 0, where the force is the set `levels`."""
        symbols, numbers = self._numbers(values)
        velocity, speed = Symbol("_velocity", real=True), Symbol("_speed", nonnegative=True)
        at = np.asarray(v, dtype=float)
        size = np.abs(at)
        evaluate = sympy.lambdify((velocity, speed, *symbols), self.pieces(velocity, speed, symbols), "numpy")
        plus, minus = (np.broadcast_to(f, at.shape) for f in evaluate(at, size, *numbers))
        return np.where(at > 0, plus, np.where(at < 0, minus, np.nan)).astype(np.float64)

    def levels(self, values: Mapping[str, float] | None = None) -> tuple[float, float]:
        """Return the ends (-Fs-, Fs+) of the set at v = 0."""
        up, down = self._at(self.static, values)
        return -down, up

    def limits(self, values: Mapping[str, float] | None = None) -> tuple[float, float]:
        """Return (-g-, g+) at |v| = 0, the ends of Filippov's hull of the slip curve."""
        up, down = self._at(lambda symbols: self.slip(sympy.S.Zero, symbols), values)
        return -down, up

    def _at(
        self, sides_of: Callable[[ParameterNamespace], Sides], values: Mapping[str, float] | None
    ) -> tuple[float, float]:
        # One point: a compiled function would load most of numpy's modules first.
        symbols, numbers = self._numbers(values)
        named = dict(zip(symbols, numbers, strict=True))
        plus, minus = (float(sympy.S(side).xreplace(named)) for side in sides_of(symbols))
        return plus, minus

    def _numbers(self, values: Mapping[str, float] | None) -> tuple[ParameterNamespace, list[float]]:
        symbols = parameters(**self.parameters())
        return symbols, [float(q) for q in ParameterSet(symbols).resolve(values)]

    def __post_init__(self) -> None:
        self.parameters()


def viscosity(b: Level) -> dict[str, Parameter]:
    """Return the parameter b of the viscous part."""
    return declare("b", b, "N s/m", "viscous friction coefficient")
