"""The linear parts of the field at an equilibrium: in its mode, and beside the surfaces on which it lies.

Beside a surface, h -> 0+ (side +) or 0- (side -):

    f(x* + y, +-1) = f(x*, +-1) + A y + B |h|**e + ...

with a constant jump part, a linear part A, and B where a power of |h| has an infinite slope at 0 (0 < e <
1). While sliding, J = (1 - G (C G)^-1 C) df/dx with C = dh/dx and G = df/ds (f = 0 at an equilibrium, so
nothing else contributes). Source: Filippov 1988; the one-sided expansion: Hensen & van de
Molengraft 2002, section 3.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy
from sympy import Dummy, Expr, Symbol

from filippov import ModelError, System
from filippov.analysis.algebra.exact_form import exact_form
from filippov.analysis.algebra.exponents import (
    ExponentCase,
    SizePower,
    UndeterminedSlopeError,
    exponent_cases,
    size_powers,
)
from filippov.analysis.algebra.polynomial import in_large_field
from filippov.analysis.steady.branches import short
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.existence import at_rest
from filippov.base.keywords import keywords
from filippov.model.symbolic import SymbolicForm, convex


@dataclass(frozen=True)
class SlipLinearisation:
    """The field on one side of the surfaces on which an equilibrium lies, in one case of the exponents.

    mode         the smooth mode beside the surfaces
    condition    where the case holds: true, or an inequality such as beta > 1
    case         the case, with `holds(values)`
    jump         f(x*, +-1), the constant part
    matrix       A, in the parameters and the free symbols of a set; None where it is not determined
    singular     (exponent e, B) where B |h|**e has an infinite slope at 0, else None
    validity     where the linear part is one, a sentence
    neglected    (exponent e, scale c) of each power (|h|/c)**e of slope 0 at h = 0 that it leaves out
    """

    mode: str
    condition: Any
    case: ExponentCase
    jump: tuple[Expr, ...]
    matrix: sympy.Matrix | None
    singular: tuple[Expr, tuple[Expr, ...]] | None
    validity: str
    neglected: tuple[tuple[Expr, Expr], ...] = ()


@dataclass(frozen=True)
class SlidingLinearisation:
    """The sliding field linearised.

    normal    C G = d(dh/dt)/ds, shape (k, k): negative for k = 1 where the surface attracts
    matrix    J, shape (n, n), None where C G is singular
    tangent   columns that span the tangent space of the surfaces, shape (n, n - k)
    """

    normal: sympy.Matrix
    matrix: sympy.Matrix | None
    gradient: sympy.Matrix
    tangent: sympy.Matrix


@dataclass(frozen=True)
class Linearisation:
    """The linear parts at one equilibrium: `smooth` of a smooth mode, else `sliding` and `slip`."""

    smooth: sympy.Matrix | None
    sliding: SlidingLinearisation | None
    slip: tuple[SlipLinearisation, ...]


@keywords()
def linearise(
    system: System,
    equilibrium: EquilibriumPoint | EquilibriumSet,
    *,
    values: Mapping[Symbol, Expr] | None = None,
    sides: Sequence[str] | None = None,
) -> Linearisation:
    """Return the linear parts at an equilibrium (at every point of a set, in its free symbols).

    values  numbers for some parameters, put before anything is computed
    sides   smooth modes to be treated, such as ["+"]; all beside the equilibrium by default

    Raises ModelError for a system of plain functions, which has no formulas to expand.
    """
    form = exact_form(system)
    if form is None:
        raise ModelError(
            "the field is a plain function and cannot be expanded at a surface. Write it as expressions: "
            "System({x: ..., v: ...})."
        )
    put = dict(values or {})
    point = {x: e.subs(put) for x, e in zip(form.x, equilibrium.x, strict=True)}
    signs = form.signs(equilibrium.mode)
    on = [i for i, m in enumerate(signs) if m == 0]
    if not on:
        jacobian = form.jacobian(equilibrium.mode).subs(put)
        return Linearisation(_at(jacobian, point), None, ())
    sliding = _sliding(form, equilibrium, on, put, point)
    slip: list[SlipLinearisation] = []
    choices = ["+-" if m == 0 else "+" if m > 0 else "-" for m in signs]
    if sides is None:
        modes = ["".join(mode) for mode in itertools.product(*choices)]
    else:
        fit = [len(m) == len(choices) and all(map(str.__contains__, choices, m)) for m in sides]
        modes = sorted({m for m, fits in zip(sides, fit, strict=True) if fits})
    for mode in modes:
        slip += _slip(form, mode, on, put, point)
    return Linearisation(None, sliding, tuple(slip))


def _sliding(
    form: SymbolicForm,
    equilibrium: EquilibriumPoint | EquilibriumSet,
    on: list[int],
    put: dict[Symbol, Expr],
    point: dict[Symbol, Expr],
) -> SlidingLinearisation:
    mode = equilibrium.mode
    s = [form.s[i] for i in on]
    place = {**point, **{q: e.subs(put) for q, (_, e) in zip(s, equilibrium.multipliers, strict=True)}}
    field = sympy.Matrix([at_rest(f.subs(put)) for f in form.at_mode(mode)])
    h = sympy.Matrix([at_rest(form.h_at_mode(mode)[i].subs(put)) for i in on])
    a, g, c = (_at(m, place) for m in (field.jacobian(form.x), field.jacobian(s), h.jacobian(form.x)))
    normal = (c * g).applyfunc(short)
    tangent = sympy.Matrix.hstack(*c.nullspace()) if c.cols > c.rank() else sympy.zeros(c.cols, 0)
    if short(normal.det()).is_zero:
        return SlidingLinearisation(normal, None, c, tangent)
    # Elimination asks of each pivot whether it is 0, which takes long in a large field.
    large = not normal.free_symbols and in_large_field(normal)
    inverse = normal.adjugate() / normal.det() if large else normal.inv()
    matrix = ((sympy.eye(a.rows) - g * inverse * c) * a).applyfunc(short)
    return SlidingLinearisation(normal, matrix, c, tangent)


def _slip(
    form: SymbolicForm, mode: str, on: list[int], put: dict[Symbol, Expr], point: dict[Symbol, Expr]
) -> list[SlipLinearisation]:
    signs = form.signs(mode)
    own = {form.a[i]: Dummy(f"a{i}", positive=True) for i in on}
    fixed = dict(zip(form.s, map(sympy.Integer, signs), strict=True))
    sizes: dict[Symbol, Expr] = {}
    h: list[Expr] = []
    for i, (a, g) in enumerate(zip(form.a, form.h, strict=True)):
        h.append(g.xreplace(sizes).subs(put))
        sizes[a] = own[a] if i in on else signs[i] * h[-1]
    field = [convex(f.xreplace(fixed), set()).xreplace(sizes).subs(put) for f in form.field]
    names = {
        d: sympy.Symbol(f"|h{i + 1}|" if len(form.h) > 1 else "|h|")
        for i, d in zip(on, own.values(), strict=True)
    }
    rows = {own[form.a[i]]: signs[i] * sympy.Matrix([[h[i].diff(x) for x in form.x]]) for i in on}
    try:
        powers = size_powers(field, list(own.values()))
        cases = exponent_cases(powers)
    except UndeterminedSlopeError as error:
        case = ExponentCase(sympy.true, (), ())
        text = f"the slope at the surface is not determined: {error} is not read off".replace("  ", " ")
        return [SlipLinearisation(mode, sympy.true, case, (), None, None, _named(text, names))]
    return [_case(form, mode, field, rows, powers, case, point) for case in cases]


def _case(
    form: SymbolicForm,
    mode: str,
    field: list[Expr],
    rows: dict[Symbol, sympy.Matrix],
    powers: list[SizePower],
    case: ExponentCase,
    point: dict[Symbol, Expr],
) -> SlipLinearisation:
    put = dict(case.put)
    marks = {
        p.power: Dummy(f"w{k}")
        for k, (p, slope) in enumerate(zip(powers, case.slopes, strict=True))
        if slope != "finite"
    }
    marked = sympy.Matrix([f.xreplace(marks).subs(put) for f in field])
    rest = {**dict.fromkeys(rows, sympy.S.Zero), **dict.fromkeys(marks.values(), sympy.S.Zero)}
    place = {x: e.subs(put) for x, e in point.items()}
    linear = marked.jacobian(form.x)
    for size, row in rows.items():
        linear += marked.diff(size) * row.subs(put)
    matrix: sympy.Matrix | None = _at(linear.subs(rest), place)
    if matrix is not None and matrix.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
        matrix = None
    jump = tuple(_at(marked.subs(rest), place))
    singular = None
    for p, slope in zip(powers, case.slopes, strict=True):
        if slope == "infinite":
            b = _at(marked.diff(marks[p.power]).subs(rest), place) / p.scale ** p.exponent.subs(put)
            singular = p.exponent.subs(put), tuple(short(e) for e in b)
            break
    neglected = tuple(
        (p.exponent, p.scale) for p, slope in zip(powers, case.slopes, strict=True) if slope == "zero"
    )
    validity = _validity(powers, case, neglected)
    return SlipLinearisation(mode, case.condition, case, jump, matrix, singular, validity, neglected)


def _validity(powers: list[SizePower], case: ExponentCase, neglected: tuple[tuple[Expr, Expr], ...]) -> str:
    """Where the linear part stands for the field, as a sentence."""
    if "infinite" in case.slopes:
        return "none: the slope of the field at the surface is infinite"
    scales = ", ".join(str(p.scale) for p in powers)
    near = f" small against {scales}" if scales else " -> 0"
    parts = [f"on its side only, |h|{near}; at h = 0 the multiplier takes the place of the jump part"]
    parts += [f"neglected: a term of order (|h|/({scale}))**{_bracket(e)}" for e, scale in neglected]
    return "; ".join(parts)


def _bracket(e: Expr) -> str:
    return str(e) if e.is_Symbol or e.is_Integer else f"({e})"


def _named(text: str, names: Mapping[Symbol, Symbol]) -> str:
    for dummy, name in names.items():
        text = text.replace(str(dummy), str(name))
    return text


def _at(matrix: sympy.Matrix, point: Mapping[Symbol, Expr]) -> sympy.Matrix:
    """A matrix at a point, each entry shortened."""
    return matrix.subs(point).applyfunc(lambda e: short(at_rest(e)))


def characteristic_polynomial(matrix: sympy.Matrix) -> tuple[Expr, ...]:
    """Coefficients of det(s - A), highest first.

    Of entries in a large field they are left as sums and products: sympy would look for the field.
    """
    if not matrix.free_symbols and in_large_field(matrix):
        return _leverrier(matrix)
    variable = Dummy("lambda")
    try:
        return tuple(short(c) for c in matrix.charpoly(variable).all_coeffs())
    except TypeError:  # sympy orders factors by their sign, which roots of expressions do not have
        return _leverrier(matrix)


def _leverrier(matrix: sympy.Matrix) -> tuple[Expr, ...]:
    """The same by traces (Faddeev & Leverrier): M_k = A M_(k-1) + c_(k-1), c_k = -tr(A M_k)/k."""
    n, coefficients = matrix.rows, [sympy.S.One]
    M = sympy.zeros(n, n)
    for k in range(1, n + 1):
        M = matrix * M + sympy.eye(n) * coefficients[-1]
        coefficients.append(short(-(matrix * M).trace() / k))
    return tuple(coefficients)
