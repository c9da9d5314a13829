"""A switching surface: one scalar function h(t, x; p) with a name, and the set that stands at h = 0."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import sympy
from sympy.logic.boolalg import Boolean

from filippov.errors import ModelError
from filippov.parameter import as_number

Kind = Literal["switching", "kink", "observer"]
# A number, an expression, or a function (t, x, p) -> float.
Bound = Any


@dataclass(frozen=True)
class Surface:
    """The surface h = 0 with sign s = sgn(h), and s in [lo, hi] at h = 0 (`radius` r means [-r, r]).

    name      non-empty text
    h         sympy expression in t, states and parameters, or a function h(t, x, p) -> float
    radius    number, expression or function (t, x, p) -> float, or a pair (lo, hi); lo <= -1 and hi >= 1.
              Kept as the pair.
    kind      "switching": the field jumps; "kink": it is continuous, its derivative jumps (nothing can slide
              there); "observer": watched only
    gradient  for a function h: gradient(t, x, p) -> dh/dx, shape (n,)
    linear    for a function h: it is affine in x and does not depend on t
    width     half-width of the hysteresis: the sign s is left at h = -s width; 0 for none

    Raises ModelError. Static friction Fs above the limit Fc of the slip curve is radius=Fs/Fc.
    """

    name: str
    h: Any
    radius: Any = 1.0
    kind: Kind = "switching"
    gradient: Callable[..., Any] | None = None
    linear: bool = False
    width: float = 0.0

    def __post_init__(self) -> None:
        if not _is_text(self.name):
            raise ModelError(f"a surface has the name {self.name!r}, expected non-empty text.")
        where = f"surface {self.name!r}"
        if isinstance(self.h, Boolean) and not isinstance(self.h, sympy.Expr):
            raise ModelError(
                f"{where}: h = {self.h} is a condition, expected a continuous function that changes its "
                "sign. "
                "Give the difference of its two sides."
            )
        if not isinstance(self.h, sympy.Expr) and not callable(self.h):
            raise ModelError(
                f"{where}: h is {self.h!r} ({type(self.h).__name__}), expected a sympy expression or a "
                "function h(t, x, p)."
            )
        if self.kind not in get_args(Kind):
            raise ModelError(
                f"{where}: kind is {self.kind!r}, expected one of {', '.join(map(repr, get_args(Kind)))}."
            )
        object.__setattr__(self, "radius", _bounds(self.radius, where))
        if self.gradient is not None and not callable(self.gradient):
            raise ModelError(
                f"{where}: gradient is {self.gradient!r}, expected a function (t, x, p) -> dh/dx."
            )
        if self.symbolic and (self.gradient is not None or self.linear):
            raise ModelError(f"{where}: gradient and linear are for functions; an expression has its own.")
        width = as_number(self.width, f"{where}: width")
        if width < 0:
            raise ModelError(f"{where}: width is {width}, expected a number >= 0.")
        object.__setattr__(self, "width", width)

    @property
    def symbolic(self) -> bool:
        """Whether h is a sympy expression."""
        return isinstance(self.h, sympy.Expr)

    @property
    def wide(self) -> bool:
        """Whether the set at h = 0 is, or may be, larger than [-1, 1]."""
        return any(not isinstance(b, float) or not math.isclose(abs(b), 1.0) for b in self.radius)


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _bounds(radius: object, where: str) -> tuple[Bound, Bound]:
    """Return the set [lo, hi] at h = 0 from a radius or a pair."""
    if isinstance(radius, (tuple, list)):
        if len(radius) != 2:
            raise ModelError(f"{where}: radius has {len(radius)} entries, expected a number or (lo, hi).")
        low, high = (_bound(b, where) for b in radius)
    else:
        high = _bound(radius, where)
        low = _Negative(high) if callable(high) and not isinstance(high, sympy.Expr) else -high
    if (isinstance(low, float) and low > -1 + 1e-12) or (isinstance(high, float) and high < 1 - 1e-12):
        raise ModelError(
            f"{where}: the set at h = 0 is [{low}, {high}], which does not contain [-1, 1]. "
            "It must hold both one-sided signs; scale the field instead."
        )
    return low, high


def _bound(value: object, where: str) -> Bound:
    if isinstance(value, sympy.Expr) and not value.is_number:
        return value
    if callable(value) and not isinstance(value, sympy.Expr):
        return value
    return as_number(value, f"{where}: radius")


@dataclass(frozen=True)
class _Negative:
    """The function (t, x, p) -> -f(t, x, p), picklable where f is."""

    f: Callable[..., float]

    def __call__(self, t: float, x: Any, p: Any) -> float:
        return -self.f(t, x, p)
