"""Relays whose width is an expression w of parameters: h/w with the width 1 in place of h with w."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.surface import Surface
from filippov.model.symbolic import SymbolicForm


def normalised(
    form: SymbolicForm, surfaces: Sequence[Surface]
) -> tuple[SymbolicForm, tuple[Surface, ...]]:
    """Divide each h whose width is an expression by it; |h| in the equations becomes width |h/width|.

    The sign is left at h/w = -s, that is at h = -s w. Raises ModelError for a width that depends on states or
    time, or is not positive at the default parameters.
    """
    widths = tuple(None if isinstance(q.width, float) else _checked(q) for q in surfaces)
    if all(w is None for w in widths):
        return form, tuple(surfaces)
    sizes: dict[Symbol, Expr] = {a: w * a for a, w in zip(form.a, widths, strict=True) if w is not None}
    scaled = form.put(sizes)
    h = tuple(e if w is None else e / w for e, w in zip(scaled.h, widths, strict=True))
    scaled = replace(scaled, h=h, widths=widths)
    out = tuple(
        q if w is None else replace(q, h=q.h / w, width=1.0) for q, w in zip(surfaces, widths, strict=True)
    )
    return scaled, out


def _checked(surface: Surface) -> Expr:
    where = f"surface {surface.name!r}: width"
    width: Expr = surface.width
    if not all(isinstance(q, ParameterSymbol) for q in width.free_symbols):
        raise ModelError(f"{where} is {width}, expected a number or an expression of parameters only.")
    at = {q: sympy.Float(q.parameter.default, 30) for q in width.free_symbols}
    value = width.xreplace(at).evalf(20)
    if not (value.is_number and value.is_real and value.is_finite and value > 0):
        raise ModelError(f"{where}: {width} is {value} at the default parameters, expected a number > 0.")
    return width


def check_widths(form: SymbolicForm, surfaces: Sequence[Surface], values: npt.NDArray[np.float64]) -> None:
    """Refuse parameters, (P,) or rows (k, P), that make a width anything but positive."""
    for surface, width in zip(surfaces, form.widths, strict=False):
        if width is None:
            continue
        with np.errstate(all="ignore"):
            at = np.broadcast_to(_function(width, form.p)(*np.moveaxis(values, -1, 0)), values.shape[:-1])
        wrong = ~((at > 0) & np.isfinite(at))
        if np.any(wrong):
            raise ModelError(
                f"surface {surface.name!r}: width = {width} is {at[wrong].flat[0]:g} with these parameters, "
                "expected a number > 0."
            )


@lru_cache(maxsize=64)
def _function(width: Expr, p: tuple[Symbol, ...]) -> Any:
    plain = {q: sympy.Dummy() for q in p}
    return sympy.lambdify(list(plain.values()), width.xreplace(plain), "numpy")
