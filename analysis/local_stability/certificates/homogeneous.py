"""The leading homogeneous part of a field beside an equilibrium, by weights of the states.

With x_i -> e^{r_i} x_i, e -> 0, the components of each side begin with e^{d_i}. The parts with d_i - r_i
= kappa for all i are homogeneous of degree kappa. An asymptotically stable homogeneous inclusion stays so
under terms of higher degree. Source: Hermes 1991; Bacciotti & Rosier 2005; for inclusions
Bernuau, Efimov, Perruquetti, Polyakov 2014, J. Franklin Inst. 351, 1866.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy
from sympy import Expr, Rational, Symbol

from filippov.analysis.local_stability.certificates.local import Local, Signs

EPSILON = sympy.Dummy("epsilon", positive=True)
ORDER = 9


@dataclass(frozen=True)
class Leading:
    """The leading part of a Local: fields and switching functions, homogeneous for the weights.

    fields   {signs: field (n,)}; degree: kappa
    """

    weights: tuple[Rational, ...]
    degree: Rational
    fields: Mapping[Signs, tuple[Expr, ...]]
    h: tuple[Expr, ...]


def lowest(expression: Expr) -> tuple[Expr, Expr] | None:
    """(exponent, coefficient) of the lowest power of EPSILON; (oo, 0) for 0, None where none is found."""
    e = sympy.expand(sympy.powdenest(sympy.expand(expression), force=False))
    parts: dict[Expr, Expr] = {}
    for term in sympy.Add.make_args(e):
        if term == 0:
            continue
        found = _power(term)
        if found is None:
            return _by_series(expression)
        coefficient, exponent = found
        parts[exponent] = parts.get(exponent, sympy.S.Zero) + coefficient
    parts = {k: c for k, v in parts.items() if (c := sympy.expand(v)) != 0}
    if not parts:
        return sympy.oo, sympy.S.Zero
    least = min(parts)
    return least, parts[least]


def _power(term: Expr) -> tuple[Expr, Expr] | None:
    coefficient, exponent = term.as_coeff_exponent(EPSILON)
    if coefficient.has(EPSILON) or not (exponent.is_Rational or exponent.is_Float):
        return None
    return coefficient, exponent


def _by_series(expression: Expr) -> tuple[Expr, Expr] | None:
    """The same by Taylor's formula for what is smooth in EPSILON."""
    try:
        for k in range(ORDER):
            part = sympy.limit(expression, EPSILON, 0) if k == 0 else None
            value = expression.subs(EPSILON, 0) if k == 0 else expression.diff(EPSILON, k).subs(EPSILON, 0)
            value = part if part is not None else value
            value = sympy.simplify(value)
            if value.has(sympy.nan, sympy.zoo, sympy.oo):
                return None
            if value != 0:
                return sympy.Integer(k), value / sympy.factorial(k)
    except (NotImplementedError, ValueError, TypeError):
        return None
    return None


def leading(found: Local, weights: Sequence[Rational]) -> Leading | None:
    """The leading part for these weights; None where it does not exist or a component has none."""
    scale = {x: EPSILON**r * x for x, r in zip(found.x, weights, strict=True)}
    n = len(found.x)
    degree: Expr = sympy.oo
    parts: dict[Signs, list[tuple[Expr, Expr]]] = {}
    for signs, field in found.fields.items():
        row = [_lowest_of(f, scale, found) for f in field]
        if any(p is None for p in row):
            return None
        parts[signs] = [p for p in row if p is not None]
        degree = min([degree, *(p[0] - r for p, r in zip(parts[signs], weights, strict=True))])
    if degree.is_infinite:
        return None
    fields = {
        signs: tuple(c if d - r == degree else sympy.S.Zero for (d, c), r in zip(row, weights, strict=True))
        for signs, row in parts.items()
    }
    if any(all(f[i] == 0 for f in fields.values()) for i in range(n)):
        return None
    h = []
    for g in found.h:
        part = lowest(g.xreplace(scale))
        if part is None or part[1] == 0:
            return None
        h.append(part[1])
    return Leading(tuple(weights), degree, fields, tuple(h))


def _lowest_of(f: Expr, scale: Mapping[Symbol, Expr], found: Local) -> tuple[Expr, Expr] | None:
    """The lowest power of one component; bases of roots are positive on their side, written as such."""
    roots = {q for q in f.atoms(sympy.Pow) if not q.exp.is_Integer and q.base.free_symbols & set(found.x)}
    put = {}
    for q in roots:
        base = lowest(q.base.xreplace(scale))
        if (
            base is None
            or base[1] == 0
            or sympy.expand(q.base.xreplace(scale) - base[1] * EPSILON ** base[0]) != 0
        ):
            return None
        put[q] = EPSILON ** (base[0] * q.exp) * base[1] ** q.exp
    hidden = {q: sympy.Dummy(positive=True) for q in put}
    return lowest(f.xreplace(hidden).xreplace(scale).xreplace({hidden[q]: put[q] for q in put}))
