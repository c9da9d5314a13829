"""A field of plain functions under comparators: signs computed from h in place of Sgn(h)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from filippov.base.errors import ModelError
from filippov.base.symbolic_value import is_expression
from filippov.model.comparator import Band, Comparator, Exact, Hysteresis, Smooth, numbers_of
from filippov.model.comparators.stick_band import kink
from filippov.model.surface import Surface


def regularize_functions(
    field: Callable[..., Any], surfaces: Sequence[Surface], chosen: Mapping[str, Comparator]
) -> tuple[Callable[..., Any], tuple[Surface, ...]]:
    """Return f(t, x, p, s) and surfaces with the comparator of each switching surface, Exact() by default.

    Raises ModelError for a comparator that needs expressions.
    """
    kept: list[Surface] = []
    signs: list[Kept | Clipped | Saturated] = []
    for surface in surfaces:
        own = chosen.get(surface.name, Exact()) if surface.kind == "switching" else Exact()
        if any(is_expression(value) for value in numbers_of(own).values()):
            raise ModelError(
                f"surface {surface.name!r}: {own} holds an expression, expected a number, because the "
                "field is a function."
            )
        if isinstance(own, Exact | Hysteresis):
            signs.append(Kept(len(kept)))
            kept.append(replace(surface, width=own.width) if isinstance(own, Hysteresis) else surface)
        elif isinstance(own, Band):
            w = own.width
            signs.append(Clipped(len(kept), len(kept) + 1, surface.h, w))
            kept.append(kink(surface, f"{surface.name}:upper", Shifted(surface.h, -w)))
            kept.append(kink(surface, f"{surface.name}:lower", Shifted(surface.h, w)))
        elif isinstance(own, Smooth):
            signs.append(Saturated(surface.h, own.width, own.shape))
        else:
            raise ModelError(
                f"surface {surface.name!r}: {type(own).__name__} takes dh/dt apart by its sign; the field "
                "is a plain function. Write the system as expressions, or choose Band, Smooth or Hysteresis."
            )
    if all(isinstance(sign, Kept) for sign in signs):
        return field, tuple(kept)
    return SignsOf(field, tuple(signs)), tuple(kept)


@dataclass(frozen=True)
class Shifted:
    """h(t, x, p) + offset."""

    h: Callable[..., float]
    offset: float

    def __call__(self, t: float, x: Any, p: Any) -> float:
        """Return h + offset."""
        return self.h(t, x, p) + self.offset


@dataclass(frozen=True)
class Kept:
    """The sign of a surface that stays, now at another place."""

    place: int

    def __call__(self, t: float, x: Any, p: Any, s: Any) -> float:
        """Return s of the kept surface."""
        return float(s[self.place])


@dataclass(frozen=True)
class Clipped:
    """clip(h/width, -1, 1), its branch chosen by the signs of h - width and h + width."""

    upper: int
    lower: int
    h: Callable[..., float]
    width: float

    def __call__(self, t: float, x: Any, p: Any, s: Any) -> float:
        """Return the clipped sign."""
        if s[self.upper] > 0:
            return 1.0
        return self.h(t, x, p) / self.width if s[self.lower] > 0 else -1.0


@dataclass(frozen=True)
class Saturated:
    """tanh(h/width), or another shape (see `filippov.model.comparator.Smooth`)."""

    h: Callable[..., float]
    width: float
    shape: str = "tanh"

    def __call__(self, t: float, x: Any, p: Any, s: Any) -> float:
        """Return the smooth sign."""
        q = self.h(t, x, p) / self.width
        if self.shape == "arctan":
            return 2.0 / math.pi * math.atan(0.5 * math.pi * q)
        return math.tanh(q) if self.shape == "tanh" else q / math.hypot(q, 1.0)


@dataclass(frozen=True)
class SignsOf:
    """f(t, x, p, s) with each sign computed from h and the signs of the kinks that are left."""

    field: Callable[..., Any]
    signs: tuple[Kept | Clipped | Saturated, ...]

    def __call__(self, t: float, x: Any, p: Any, s: Any) -> Any:
        """Return f with its signs put in."""
        return self.field(t, x, p, np.array([sign(t, x, p, s) for sign in self.signs], dtype=float))
