"""A system as a linear part with one set-valued feedback, in exact numbers: x' in A x + f - b psi(c . x).

The sides of the surfaces cut the line of the input y = c . x into pieces, on each of which the feedback is a
polynomial. Source: Khalil 2002; Yakubovich, Leonov, Gelig 2004.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import sympy
from sympy import Expr, Poly

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.characteristic import INPUT, OO, Characteristic, Piece
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

LARGEST, MOST = 8, 6


@dataclass(frozen=True)
class LureForm:
    """x' in A x + f - b psi(c . x), all entries rational: A (n, n), f and b (n, 1), c (1, n)."""

    A: sympy.Matrix
    f: sympy.Matrix
    b: sympy.Matrix
    c: sympy.Matrix
    psi: Characteristic

    def around(self, context: Context, found: EquilibriumPoint | EquilibriumSet) -> Characteristic | None:
        """psi(c . e + .) less its value at an equilibrium e; of a set one with multipliers in the middle."""
        put: dict[sympy.Symbol, Expr] = {**context.values, **context.put}
        if isinstance(found, EquilibriumSet):
            for free, (low, high) in zip(found.free, found.bounds, strict=True):
                if not -float("inf") < low < high < float("inf"):
                    return None
                put[free] = exact((low + high) / 2)
        place = sympy.Matrix([exact(sympy.S(e).subs(put)) for e in found.x])
        if any(not e.is_Rational for e in place):
            return None
        k = next(i for i, e in enumerate(self.b) if e != 0)
        held = self.A * place + self.f
        level = held[k] / self.b[k]
        if not (held - level * self.b).is_zero_matrix:
            return None
        return self.psi.moved((self.c * place)[0], level)


def lure_form(context: Context) -> LureForm | None:
    """The form of a system, or None for one that has not this form or whose numbers are not rational."""
    form, system = context.form, context.system
    values = {**context.values, **context.put}
    if not 1 <= len(form.h) <= MOST or len(form.x) > LARGEST or system.time_events:
        return None
    if any(s.width or s.kind not in {"switching", "kink"} for s in system.surfaces):
        return None
    first = sympy.expand(exact(form.h[0].subs(values)))
    c = sympy.Matrix([first]).jacobian(form.x)
    if any(not e.is_Rational for e in c) or c.is_zero_matrix:
        return None
    j = next(i for i, e in enumerate(c) if e != 0)
    others = sum((e * q for i, (e, q) in enumerate(zip(c, form.x, strict=True)) if i != j), sympy.S.Zero)
    inside = {form.x[j]: (INPUT - others) / c[j]}
    sides = []
    for mode in itertools.product((1, -1), repeat=len(form.h)):
        span = _span(context, mode, inside)
        if span is None:
            return None
        if span[0] < span[1]:
            rows = [sympy.expand(exact(f.subs(values)).xreplace(inside)) for f in form.at_mode(mode)]
            sides.append((*span, sympy.Matrix(rows)))
    sides.sort(key=lambda side: side[0])
    if any(a[1] != b[0] for a, b in itertools.pairwise(sides)) or not sides:
        return None
    free = [q for q in form.x if q != form.x[j]]
    linear = sides[0][2].jacobian(free) if free else sympy.zeros(len(form.x), 0)
    if any(not e.is_Rational for e in linear):
        return None
    rests = []
    for _, _, rows in sides:
        rest = (rows - linear * sympy.Matrix(free)).applyfunc(sympy.expand) if free else rows
        if rest.free_symbols - {INPUT} or any(not e.is_polynomial(INPUT) for e in rest):
            return None
        rests.append(rest)
    split = _split(rests)
    if split is None:
        return None
    start, slope, b, polys = split
    A = sympy.zeros(len(form.x), len(form.x))
    for k, q in enumerate(free):
        A[:, form.x.index(q)] = linear[:, k]
    if _falls(polys, [high for _, high, _ in sides[:-1]]):
        b, polys = -b, [-p for p in polys]
    pieces = tuple(Piece(low, high, p) for (low, high, _), p in zip(sides, polys, strict=True))
    jumps = _jumps(context, pieces, inside, linear, free, (start, slope, b))
    if jumps is None:
        return None
    return LureForm(A + slope * c, start, b, c, Characteristic(pieces, jumps))


def _span(
    context: Context, mode: tuple[int, ...], inside: dict[sympy.Symbol, Expr]
) -> tuple[Expr, Expr] | None:
    """The inputs at which the surfaces have these signs, (0, 0) for none; None where they are no line's."""
    form, values = context.form, {**context.values, **context.put}
    sizes: dict[sympy.Symbol, Expr] = {}
    low, high = -OO, OO
    for h, a, s in zip(form.h, form.a, mode, strict=True):
        g = sympy.expand(exact(h.subs(values)).xreplace(sizes).xreplace(inside))
        if g.free_symbols - {INPUT} or not g.is_polynomial(INPUT):
            return None
        line = Poly(g, INPUT)
        if line.degree() > 1 or any(not e.is_Rational for e in line.all_coeffs()):
            return None
        slope, level = s * line.coeff_monomial(INPUT), s * line.coeff_monomial(1)
        sizes[a] = s * g
        if slope == 0:
            if level <= 0:
                return sympy.S.Zero, sympy.S.Zero
        elif slope > 0:
            low = max(low, -level / slope)
        else:
            high = min(high, -level / slope)
    return (low, high) if low < high else (sympy.S.Zero, sympy.S.Zero)


def _split(
    rests: list[sympy.Matrix],
) -> tuple[sympy.Matrix, sympy.Matrix, sympy.Matrix, list[Poly]] | None:
    """(f, a, b, psi) with every rest = f + a y - b psi(y); None where they need more than one b."""
    first = [Poly(e, INPUT) for e in rests[0]]
    start = sympy.Matrix([p.coeff_monomial(1) for p in first])
    slope = sympy.Matrix([p.coeff_monomial(INPUT) for p in first])
    left = [(rest - start - slope * INPUT).applyfunc(sympy.expand) for rest in rests]
    vectors = []
    for rest in left:
        rows = [Poly(e, INPUT) for e in rest]
        most = max(p.degree() for p in rows if not p.is_zero) if any(not p.is_zero for p in rows) else -1
        vectors += [sympy.Matrix([p.coeff_monomial(INPUT**k) for p in rows]) for k in range(most + 1)]
    vectors = [q for q in vectors if not q.is_zero_matrix]
    if not vectors or any(not e.is_Rational for q in vectors for e in q):
        return None
    b = vectors[0]
    if any(sympy.Matrix.hstack(b, q).rank() > 1 for q in vectors):
        return None
    k = next(i for i, e in enumerate(b) if e != 0)
    polys = [Poly(-rest[k] / b[k], INPUT, domain="QQ") for rest in left]
    if any(not e.is_Rational for e in (*start, *slope)):
        return None
    return start, slope, b, polys


def _falls(polys: list[Poly], cuts: list[Expr]) -> bool:
    """Whether psi ends downwards as a polynomial, or jumps so on the whole, or has its steepest slope so."""
    if polys[-1].degree() > 1:
        return bool(polys[-1].LC() < 0)
    steps = sum((q.eval(y) - p.eval(y) for (p, q), y in zip(itertools.pairwise(polys), cuts, strict=True)))
    slopes = [p.diff().eval(0) for p in polys]
    return bool(steps < 0 or (steps == 0 and -min(slopes) > max(slopes)))


def _jumps(
    context: Context,
    pieces: tuple[Piece, ...],
    inside: dict[sympy.Symbol, Expr],
    linear: sympy.Matrix,
    free: list[sympy.Symbol],
    split: tuple[sympy.Matrix, sympy.Matrix, sympy.Matrix],
) -> dict[Expr, tuple[Expr, Expr]] | None:
    """The sets of psi where pieces meet; None where more than one sign jumps at a time."""
    form, values = context.form, {**context.values, **context.put}
    start, slope, b = split
    k = next(i for i, e in enumerate(b) if e != 0)
    out: dict[Expr, tuple[Expr, Expr]] = {}
    for before, after in itertools.pairwise(pieces):
        y = before.high
        sizes: dict[sympy.Symbol, Expr] = {}
        mode = []
        for h, a in zip(form.h, form.a, strict=True):
            g = exact(h.subs(values)).xreplace(sizes).xreplace(inside).subs(INPUT, y)
            sign = int(sympy.sign(sympy.expand(g)))
            mode.append(sign)
            sizes[a] = abs(sympy.expand(g))
        on = [i for i, m in enumerate(mode) if m == 0 and context.system.surfaces[i].kind == "switching"]
        ends = [before.poly.eval(y), after.poly.eval(y)]
        if len(on) > 1:
            return None
        if on:
            (i,) = on
            given = [exact(sympy.S(e).subs(values)) for e in form.radius[i]]
            field = sympy.Matrix(form.at_mode([m or 1 if q != i else 0 for q, m in enumerate(mode)]))
            rows = field.subs(values).applyfunc(exact).xreplace(inside)
            rest = (rows - linear * sympy.Matrix(free) if free else rows) - start - slope * INPUT
            value = sympy.expand((-rest[k] / b[k]).subs(INPUT, y))
            if value.free_symbols - {form.s[i]} or not value.is_polynomial(form.s[i]):
                return None
            if sympy.degree(value, form.s[i]) > 1 or any(not e.is_Rational for e in given):
                return None
            ends += [value.subs(form.s[i], e) for e in given]
            low, high = min(ends), max(ends)
            if low < high:
                out[y] = (low, high)
        elif ends[0] != ends[1]:
            return None
    return out
