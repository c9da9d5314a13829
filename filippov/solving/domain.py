"""Where a solution comes to the edge of what its equations are defined for: a root, logarithm or division."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from filippov.solving.state.run import Run

if TYPE_CHECKING:
    from sympy import Expr

# An edge is here if the solution is to reach it within this part of the span.
HERE = 1e-6


def edge(run: Run) -> str:
    """What of the equations ends at the present point, and what to write; "" where nothing is known."""
    machine, form = run.machine, run.machine.system.symbolic
    if form is None:
        return ""
    from filippov.model.symbols import t

    signs = np.where(run.mode == 0.0, run.lam, run.mode)
    with np.errstate(all="ignore"):
        field = machine.rhs(run.t, run.x, np.where(run.mode == 0.0, 1.0, signs), run.mode)
        sizes = np.abs(machine.guards(run.t, run.x, run.mode))
    at = {t: run.t, **dict(zip((*form.x, *form.p), (*run.x.tolist(), *machine.p.tolist()), strict=False))}
    at |= dict(zip(form.a, sizes.tolist(), strict=False)) | dict(zip(form.s, signs.tolist(), strict=False))
    span = abs(float(run.clock.t_end) - float(run.clock.t_start))
    for x, f in zip(form.x, form.field, strict=True):
        for whole, inner in _bounded(f):
            if not inner.free_symbols & {t, *form.x}:
                continue
            value = _number(inner, at)
            rate = _number(inner.diff(t), at)
            rate += sum(_number(inner.diff(y), at) * v for y, v in zip(form.x, field.tolist(), strict=True))
            divided = whole.is_Pow and whole.exp.is_negative
            near = value == 0.0 or abs(value) <= HERE * span * abs(rate)
            if np.isnan(value) or (not near and (divided or value > 0.0)):
                continue
            if not near:
                return f"d{x}/dt holds {whole}, which has no value here, where {inner} is {value:.6g}."
            if divided:
                return f"d{x}/dt is divided by {inner}, which comes to 0 here: the solution ends there."
            stays = whole.xreplace({inner: type(x)(f"Max({inner}, 0)")})
            return (
                f"d{x}/dt holds {whole}, and {inner} comes to 0 here, below which it has no value. If it is "
                f"to stay at 0, write {stays}."
            )
    return ""


def _bounded(f: Expr) -> Iterator[tuple[Expr, Expr]]:
    """Parts of an expression that are not defined everywhere, each with what it is defined by."""
    import sympy

    for part in sorted(f.atoms(sympy.Pow, sympy.log), key=sympy.default_sort_key):
        if not part.is_Pow or part.exp.is_integer is not True or part.exp.is_negative:
            yield part, part.args[0]


def _number(expression: Expr, at: dict[Expr, float]) -> float:
    value = complex(expression.evalf(subs=at) if expression.free_symbols else expression)
    return value.real if value.imag == 0.0 else float("nan")
