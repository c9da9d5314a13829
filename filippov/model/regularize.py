"""A system under a comparator: Sgn(h) replaced by a function of h, or by a relay with hysteresis."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.model.comparator import Band, Comparator, Hysteresis, Smooth
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, SymbolicForm, convex

UNIT = (sympy.S.NegativeOne, sympy.S.One)


def regularize_symbolic(
    form: SymbolicForm, surfaces: Sequence[Surface], comparator: Comparator
) -> tuple[SymbolicForm, tuple[Surface, ...]]:
    """Return the form and the surfaces with `comparator` on every switching surface.

    Where the field of a replaced surface also holds |h|, that kink stays as a surface named |name|.
    """
    new = _Builder()
    values: dict[Symbol, Expr] = {}
    for i, surface in enumerate(surfaces):
        if surface.kind == "switching" and surface.reset is not None:
            raise ModelError(
                f"surface {surface.name!r} switches the field and resets the state; no comparator can stand "
                "for it. Declare two surfaces, one for each."
            )
        s, a, h = form.s[i], form.a[i], form.h[i].xreplace(values)
        width = form.widths[i] if form.widths and surface.kind == "switching" else None
        if width is not None:  # the comparator's own width is one of h itself
            h, surface = h * width, replace(surface, h=surface.h * width)  # noqa: PLW2901
        if surface.kind != "switching":
            values[s], values[a] = new.add(surface, h, form.radius[i])
            continue
        if any(e.has(a) for e in (*form.field, *form.h)):
            _, size = new.add(_kink(surface, f"|{surface.name}|", surface.h), h, UNIT)
            values[a] = size if width is None else size / width
        if isinstance(comparator, Hysteresis):
            values[s], _ = new.add(replace(surface, width=comparator.width), h, form.radius[i])
        elif isinstance(comparator, Band):
            w = sympy.Float(comparator.width)
            upper, _ = new.add(_kink(surface, f"{surface.name}:upper", surface.h - w), h - w, UNIT)
            lower, _ = new.add(_kink(surface, f"{surface.name}:lower", surface.h + w), h + w, UNIT)
            values[s] = Select(upper, 1, Select(lower, h / w, -1))
        elif isinstance(comparator, Smooth):
            values[s] = sympy.tanh(h / sympy.Float(comparator.width))
    switching = {form.s[i] for i, surface in enumerate(surfaces) if surface.kind == "switching"}
    field = (
        form.field if isinstance(comparator, Hysteresis) else tuple(convex(f, switching) for f in form.field)
    )
    names = [q.name for q in new.surfaces]
    old = [next((i for i, q in enumerate(surfaces) if q.name == name), None) for name in names]
    out = SymbolicForm(
        x=form.x,
        p=form.p,
        s=tuple(new.s),
        a=tuple(new.a),
        field=tuple(f.xreplace(values) for f in field),
        h=tuple(new.h),
        radius=tuple(new.radius),
        reset=tuple(None if i is None else _moved(form.reset[i], values) for i in old) if form.reset else (),
        time_reset=tuple(_moved(row, values) for row in form.time_reset),
        contact=tuple(form.contact[i] if i is not None else None for i in old) if form.contact else (),
    )
    return out, tuple(new.surfaces)


def _moved(after: tuple[Expr, ...] | None, values: dict[Symbol, Expr]) -> tuple[Expr, ...] | None:
    return None if after is None else tuple(e.xreplace(values) for e in after)


def _kink(surface: Surface, name: str, h: Any) -> Surface:
    return replace(surface, name=name, h=h, radius=1.0, kind="kink", width=0.0)


class _Builder:
    """The surfaces of the new form, numbered as they are added."""

    def __init__(self) -> None:
        self.s: list[Symbol] = []
        self.a: list[Symbol] = []
        self.h: list[Expr] = []
        self.radius: list[tuple[Expr, Expr]] = []
        self.surfaces: list[Surface] = []

    def add(self, surface: Surface, h: Expr, radius: tuple[Expr, Expr]) -> tuple[Symbol, Symbol]:
        number = len(self.s)
        self.s.append(Symbol(f"_s{number}", real=True))
        self.a.append(Symbol(f"_a{number}", nonnegative=True))
        self.h.append(h)
        self.radius.append(radius)
        self.surfaces.append(surface)
        return self.s[-1], self.a[-1]


# -- plain functions -----------------------------------------------------------------------------------


def regularize_functions(
    field: Callable[..., Any], surfaces: Sequence[Surface], comparator: Comparator
) -> tuple[Callable[..., Any], tuple[Surface, ...]]:
    """Return f(t, x, p, s) and surfaces with `comparator` on every switching surface."""
    if isinstance(comparator, Hysteresis):
        width = comparator.width
        return field, tuple(replace(q, width=width) if q.kind == "switching" else q for q in surfaces)
    kept: list[Surface] = []
    signs: list[Kept | Clipped | Saturated] = []
    for surface in surfaces:
        if surface.kind != "switching":
            signs.append(Kept(len(kept)))
            kept.append(surface)
        elif isinstance(comparator, Band):
            w = comparator.width
            signs.append(Clipped(len(kept), len(kept) + 1, surface.h, w))
            kept.append(_kink(surface, f"{surface.name}:upper", Shifted(surface.h, -w)))
            kept.append(_kink(surface, f"{surface.name}:lower", Shifted(surface.h, w)))
        elif isinstance(comparator, Smooth):
            signs.append(Saturated(surface.h, comparator.width))
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
    """tanh(h/width)."""

    h: Callable[..., float]
    width: float

    def __call__(self, t: float, x: Any, p: Any, s: Any) -> float:
        """Return the smooth sign."""
        return math.tanh(self.h(t, x, p) / self.width)


@dataclass(frozen=True)
class SignsOf:
    """f(t, x, p, s) with each sign computed from h and the signs of the kinks that are left."""

    field: Callable[..., Any]
    signs: tuple[Kept | Clipped | Saturated, ...]

    def __call__(self, t: float, x: Any, p: Any, s: Any) -> Any:
        """Return f with its signs put in."""
        return self.field(t, x, p, np.array([sign(t, x, p, s) for sign in self.signs], dtype=float))
