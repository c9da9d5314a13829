"""A system under comparators: Sgn(h) replaced by a function of h, by a relay, or within a band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.symbolic_value import is_expression
from filippov.model.comparator import Band, Comparator, Exact, Hysteresis, Karnopp, Smooth, Switch, numbers_of
from filippov.model.comparators.coupled_bands import CoupledBands, coupled
from filippov.model.comparators.moving_stick import with_moving_stick
from filippov.model.comparators.stick_band import UNIT, NewSurfaces, StickBand, kink
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.surface import Surface
from filippov.model.symbolic import Contact, Select, SymbolicForm, convex


def regularize_symbolic(
    form: SymbolicForm, surfaces: Sequence[Surface], chosen: Mapping[str, Comparator]
) -> tuple[SymbolicForm, tuple[Surface, ...]]:
    """Return the form and the surfaces with the comparator of each switching surface, Exact() by default.

    Where the field of a replaced surface also holds |h|, that kink stays as a surface named |name|. Raises
    ModelError, naming the surface, where a comparator cannot stand for it.
    """
    new = NewSurfaces()
    values: dict[Symbol, Expr] = {}  # old signs and sizes in terms of the new ones
    even: dict[Symbol, Expr] = {}  # the same without a Select: what a switching function may hold
    bands: list[StickBand] = []
    free: set[Symbol] = set()  # signs whose Selects become the mean of their branches
    for i, surface in enumerate(surfaces):
        own = chosen.get(surface.name, Exact())
        s, a, h = form.s[i], form.a[i], form.h[i].xreplace(values)
        width = form.widths[i] if form.widths else None
        if surface.kind != "switching" or isinstance(own, Exact):
            values[s], values[a] = new.add(surface, h, form.radius[i], width)
            even[a] = values[a]
            continue
        if surface.reset is not None:
            raise ModelError(
                f"surface {surface.name!r} switches the field and resets the state; no comparator can stand "
                "for it. Declare two surfaces, one for each."
            )
        if width is not None:  # the comparator's own width is one of h itself
            h, surface = h * width, replace(surface, h=surface.h * width)  # noqa: PLW2901
        if any(e.has(a) for e in (*form.field, *form.h)) and not _alone(form, i, own):
            _, size = new.add(kink(surface, f"|{surface.name}|", surface.h), h, UNIT)
            even[a] = values[a] = size if width is None else size / width
        if isinstance(own, Switch | Karnopp):
            bands.append(StickBand(form, i, surface, own, h, new))
            continue
        w = checked_width(surface, own)
        if isinstance(own, Hysteresis):
            if is_expression(own.width):
                values[s], _ = new.add(replace(surface, h=surface.h / w, width=1.0), h / w, form.radius[i], w)
            else:
                values[s], _ = new.add(replace(surface, width=own.width), h, form.radius[i])
            continue
        free.add(s)
        if isinstance(own, Band):
            upper, above = new.add(kink(surface, f"{surface.name}:upper", surface.h - w), h - w, UNIT)
            lower, below = new.add(kink(surface, f"{surface.name}:lower", surface.h + w), h + w, UNIT)
            values[s], even[s] = Select(upper, 1, Select(lower, h / w, -1)), (below - above) / (2 * w)
        else:
            values[s] = even[s] = shaped(own, h, w)
    field = [convex(f, free) if free else f for f in form.field]
    alone, several, many = coupled(bands)
    if many:
        form = replace(form, p=with_parameters(form.p, chosen))
        left = {name: own for name, own in chosen.items() if name not in {band.surface.name for band in many}}
        return regularize_symbolic(*with_moving_stick(form, surfaces, many), left)
    groups: list[StickBand | CoupledBands] = [*alone, *several]
    for group in groups:
        group.add_rates(new, lambda e: evened(e, form, surfaces, even))
    for group in groups:
        field = group.put_into(field)
    last = new.final()
    field = [f.xreplace(values).xreplace(last) for f in field]
    values = {q: e.xreplace(last) for q, e in values.items()}
    names = [q.name for q in new.surfaces]
    old = [next((i for i, q in enumerate(surfaces) if q.name == name), None) for name in names]
    gone = {q for band in bands for q in (band.s, band.a) if q not in values}
    moved = [e for row in (*form.reset, *form.time_reset) for e in row or ()]
    pushes = [e for contact in form.contact if contact is not None for e in contact.direction]
    for e in (*moved, *pushes, *new.h):
        if e.free_symbols & gone:
            raise ModelError(
                "a reset, a surface or the friction at a contact holds the sign or the size of one under "
                "Switch or Karnopp: it has none in the band. Choose Band or Smooth for it."
            )
    out = SymbolicForm(
        x=form.x,
        p=with_parameters(form.p, chosen),
        s=tuple(last[s] for s in new.s),
        a=tuple(last[a] for a in new.a),
        field=tuple(field),
        h=tuple(h.xreplace(last) for h in new.h),
        radius=tuple(new.radius),
        reset=tuple(None if i is None else _moved(form.reset[i], values) for i in old) if form.reset else (),
        time_reset=tuple(_moved(row, values) for row in form.time_reset),
        contact=tuple(None if i is None else _pushing(form.contact[i], values) for i in old)
        if form.contact else (),
        widths=tuple(new.widths) if any(w is not None for w in new.widths) else (),
    )
    return out, tuple(new.surfaces)


def _pushing(contact: Contact | None, values: Mapping[Symbol, Expr]) -> Contact | None:
    """A contact with other expressions for the signs in its friction."""
    if contact is None:
        return None
    return replace(contact, direction=tuple(e.xreplace(values) for e in contact.direction))


def _alone(form: SymbolicForm, i: int, own: Comparator) -> bool:
    """Whether |h| of a surface stands in the field only, where the edges of its band measure it."""
    return isinstance(own, Switch | Karnopp) and not any(h.has(form.a[i]) for h in form.h)


def evened(e: Expr, form: SymbolicForm, surfaces: Sequence[Surface], even: Mapping[Symbol, Expr]) -> Expr:
    """An expression without the signs of kinks: f+ or f- by the sign of h is (f+ + f-)/2 + |h| (f+ - f-)/2h.
    """
    for s, a, h, surface in zip(form.s, form.a, form.h, surfaces, strict=True):
        if surface.kind == "kink" and e.has(s):
            plus, minus = (e.xreplace({s: sympy.Integer(side)}) for side in (1, -1))
            half = sympy.cancel((plus - minus) / (2 * h))
            if not sympy.fraction(half)[1].free_symbols & h.free_symbols:
                e = (plus + minus) / 2 + half * a
    return e.xreplace(dict(even))


def shaped(own: Smooth, h: Expr, w: Expr) -> Expr:
    """The smooth sign of h."""
    if own.shape == "arctan":
        return 2 / sympy.pi * sympy.atan(sympy.pi * h / (2 * w))
    return sympy.tanh(h / w) if own.shape == "tanh" else h / sympy.sqrt(h**2 + w**2)


def checked_width(surface: Surface, own: Comparator) -> Expr:
    """The width of a comparator as an expression; ModelError for one that may not be positive."""
    width = next(iter(numbers_of(own).values()))
    if not is_expression(width):
        return sympy.Float(width)
    if not all(isinstance(q, ParameterSymbol) for q in width.free_symbols) or not width.is_positive:
        raise ModelError(
            f"surface {surface.name!r}: the width of {type(own).__name__} is {width}, expected a number > 0 "
            "or an expression of parameters that their bounds keep positive: parameters(w=Parameter(0.01, "
            "lower=1e-12))."
        )
    return width


def with_parameters(
    p: tuple[ParameterSymbol, ...], chosen: Mapping[str, Comparator]
) -> tuple[ParameterSymbol, ...]:
    """The parameters of a form, then those that only its comparators have. Raises ModelError."""
    out = list(p)
    for comparator in chosen.values():
        for value in numbers_of(comparator).values():
            for q in sorted(value.free_symbols if is_expression(value) else (), key=lambda q: q.name):
                if q in out:
                    continue
                if any(q.name == other.name for other in out):
                    raise ModelError(
                        f"parameter {q.name!r} of {type(comparator).__name__} is another one than that of "
                        "the system. Rename it, or take the system's own symbol."
                    )
                out.append(q)
    return tuple(out)


def _moved(after: tuple[Expr, ...] | None, values: dict[Symbol, Expr]) -> tuple[Expr, ...] | None:
    return None if after is None else tuple(e.xreplace(values) for e in after)
