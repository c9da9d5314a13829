"""Outputs: quantities of a system by name, as expressions in state, time and parameters.

Where an output holds the sign of a surface of the system, that sign takes part in sliding: while the motion
slides, what stands for it is the multiplier, as in the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.names import check_known, check_name
from filippov.model.check import as_expression, check_expression
from filippov.model.comparator import Exact
from filippov.model.extract import Extractor
from filippov.model.regularize import regularize_symbolic
from filippov.model.symbolic import SymbolicForm, convex

if TYPE_CHECKING:
    from filippov.model.system import System


def check_outputs(outputs: Any, states: Sequence[str], symbolic: bool) -> dict[str, Any]:
    """Outputs by name: expressions, or functions f(t, x, p, s) of a system of functions. Raises ModelError.
    """
    if outputs is None:
        return {}
    if not isinstance(outputs, Mapping):
        raise ModelError(f"outputs are {outputs!r}, expected a dict from names to expressions.")
    out: dict[str, Any] = {}
    for given, value in outputs.items():
        name = check_name(given, "output")
        if name in states:
            raise ModelError(f"the output {name!r} has the name of a state. Rename the output.")
        where = f"the output {name!r}"
        if symbolic:
            out[name] = as_expression(value, where)
            check_expression(out[name], where)
        elif callable(value) and not isinstance(value, Expr):
            out[name] = value
        else:
            raise ModelError(
                f"{where} is {value!r}, expected a function f(t, x, p, s) -> float, because the field is a "
                "function."
            )
    return out


def check_labels(labels: Any, known: Sequence[str]) -> dict[str, str]:
    """Labels of axes by name of state or output, and "t". Raises ModelError."""
    if labels is None:
        return {}
    if not isinstance(labels, Mapping) or not all(isinstance(text, str) for text in labels.values()):
        raise ModelError(f"labels are {labels!r}, expected texts by name: {{'x': 'position [m]'}}.")
    check_known("label", labels, ("t", *known))
    return dict(labels)


@lru_cache(maxsize=256)
def read_with_signs(system: System, expr: Expr) -> Expr:
    """An expression in t, x, p with the signs of the system's surfaces as its symbols s_i.

    The sign of what is no surface of the system stays as it is.
    """
    form = system.exact.symbolic
    assert form is not None
    extractor = Extractor()
    own, sizes = [], {}
    for h, a in zip(form.h, form.a, strict=True):
        own.append(extractor.table.register(h.xreplace(sizes))[0])
        sizes[a] = own[-1].a
    out = extractor.field(expr, f"the expression {expr}")
    values: dict[Symbol, Expr] = {entry.s: s for entry, s in zip(own, form.s, strict=True)}
    for entry, h in zip(own, form.plain_h(), strict=True):
        values[entry.a] = sympy.Abs(h)
    for entry in extractor.table.entries[len(own) :]:
        h = entry.h.xreplace(values)
        values[entry.s], values[entry.a] = sympy.sign(h), sympy.Abs(h)
    out = out.xreplace(values)
    return out if isinstance(system.comparator, Exact) else _compared(system, form, out)


def _compared(system: System, form: SymbolicForm, out: Expr) -> Expr:
    """The same under the comparator of the system, in the signs of its own form."""
    wider = replace(form, field=(*form.field, out))
    return regularize_symbolic(wider, system.exact.surfaces, system.comparator)[0].field[-1]


@lru_cache(maxsize=1024)
def in_mode(system: System, expr: Expr, mode: tuple[int, ...]) -> Callable[..., Any]:
    """The function (t, x, p, s) -> values of an expression, arrays of times last, in one mode."""
    form = system.symbolic
    assert form is not None
    fixed = {s: sympy.Integer(m) for s, m in zip(form.s, mode, strict=True) if m}
    free = {s for s, m in zip(form.s, mode, strict=True) if not m}
    plain = convex(expr.xreplace(fixed), free)
    symbols = (sympy.Symbol("t", real=True), form.x, form.p, form.s)
    names = [s for part in symbols[1:] for s in part]
    short = {s: sympy.Dummy(f"q{k}", real=True) for k, s in enumerate(names)}
    order = [tuple(short[s] for s in part) for part in symbols[1:]]
    return sympy.lambdify([symbols[0], *order], plain.xreplace(short), ["scipy", "numpy"])
