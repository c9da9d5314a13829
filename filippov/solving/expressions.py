"""Expressions with signs, made functions: a sign of a surface of the system takes part in sliding.

While the solution slides on the surface, what stands for its sign is the multiplier, as in the equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.model.comparator import Exact, by_surface
from filippov.model.comparators.regularize import regularize_symbolic
from filippov.model.extract import Extractor
from filippov.model.signals.input import as_symbols, sampled_in
from filippov.model.symbolic import SymbolicForm, convex
from filippov.model.system import System


@lru_cache(maxsize=256)
def read_with_signs(system: System, expr: Expr) -> Expr:
    """An expression in t, x, p with the signs of the system's surfaces as its symbols s_i.

    The sign of what is no surface of the system stays as it is.
    """
    form = system.exact.symbolic
    assert form is not None
    extractor = Extractor()
    # As in assembling: while surfaces are distinguished an input may have any value.
    inputs = as_symbols([expr, *form.h])
    signals = {symbol: node for node, symbol in inputs.items()}
    own: list[Any] = []
    sizes: dict[Symbol, Expr] = {}
    for h, a in zip(form.h, form.a, strict=True):
        own.append(extractor.table.register(h.xreplace(inputs).xreplace(sizes))[0])
        sizes[a] = own[-1].a
    out = extractor.field(expr.xreplace(inputs), f"the expression {expr}")
    values: dict[Symbol, Expr] = {entry.s: s for entry, s in zip(own, form.s, strict=True)}
    for entry, h in zip(own, form.plain_h(), strict=True):
        values[entry.a] = sympy.Abs(h)
    for entry in extractor.table.entries[len(own) :]:
        h = entry.h.xreplace(values)
        values[entry.s], values[entry.a] = sympy.sign(h), sympy.Abs(h)
    out = out.xreplace(values).xreplace(signals)
    return out if isinstance(system.comparator, Exact) else _compared(system, form, out)


def _compared(system: System, form: SymbolicForm, out: Expr) -> Expr:
    """The same under the comparator of the system, in the signs of its own form."""
    wider = replace(form, field=(*form.field, out))
    surfaces = system.exact.surfaces
    chosen = by_surface(system.comparator, {q.name: q.kind == "switching" for q in surfaces})
    return regularize_symbolic(wider, surfaces, chosen)[0].field[-1]


@lru_cache(maxsize=1024)
def in_mode(system: System, expr: Expr, mode: tuple[int, ...]) -> Callable[..., Any]:
    """The function (t, x, p, s, u) -> values of an expression, arrays of times last, in one mode.

    u   the values of its inputs, in the order of `sampled_in`
    """
    form = system.symbolic
    assert form is not None
    fixed = {s: sympy.Integer(m) for s, m in zip(form.s, mode, strict=True) if m}
    free = {s for s, m in zip(form.s, mode, strict=True) if not m}
    plain = convex(expr.xreplace(fixed), free)
    symbols = (sympy.Symbol("t", real=True), form.x, form.p, form.s)
    names = [s for part in symbols[1:] for s in part]
    short = {s: sympy.Dummy(f"q{k}", real=True) for k, s in enumerate(names)}
    order = [tuple(short[s] for s in part) for part in symbols[1:]]
    signals = {node: sympy.Dummy(f"u{k}", real=True) for k, node in enumerate(sampled_in(expr))}
    plain = plain.xreplace(signals).xreplace(short)
    arguments = [symbols[0], *order, tuple(signals.values())]
    function: Callable[..., Any] = sympy.lambdify(arguments, plain, ["scipy", "numpy"])
    return function
