"""The equations of one mode, and the inequalities that say where a solution of them is an equilibrium."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy
from scipy.optimize import brentq
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import plain_exponents
from filippov.analysis.steady.branches import Family, periodic, short
from filippov.analysis.steady.common_roots import real_roots
from filippov.analysis.steady.edges import TOLERANCE, real_number, side
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, PointKind
from filippov.analysis.steady.interior import inner_point, is_affine
from filippov.model.symbolic import SymbolicForm
from filippov.model.system import System

FAR = 1e6
# Borders of a set that are taken in formulas, and the places that are looked at where there are none.
MOST_ROOTS, SAMPLES = 20, 4001
SIZES = np.logspace(-15, 15, 1801)


@dataclass(frozen=True)
class Bound:
    """g >= 0 (g > 0 where strict); g belongs to surface `surface`."""

    g: Expr
    strict: bool
    surface: str


@dataclass(frozen=True)
class ModeProblem:
    """f(x, s) = 0 and h_i(x) = 0 on the sliding surfaces, under the bounds; all without |h|.

    x, sliding   unknowns: the states, and one multiplier a sliding surface
    names        surface names of `sliding`
    limits       (lo, hi) of each multiplier
    kind         of a point inside all the bounds
    """

    mode: str
    x: tuple[Symbol, ...]
    sliding: tuple[Symbol, ...]
    names: tuple[str, ...]
    equations: tuple[Expr, ...]
    bounds: tuple[Bound, ...]
    limits: tuple[tuple[Expr, Expr], ...]
    kind: PointKind

    @classmethod
    def of(cls, system: System, form: SymbolicForm, mode: str) -> ModeProblem:
        """Make the problem of a mode."""
        signs = form.signs(mode)
        taken = {q.name for q in (*form.x, *form.p)}
        on = [i for i, m in enumerate(signs) if m == 0]
        renamed = {form.s[i]: multiplier_symbol(system, i, len(on) == 1, taken) for i in on}
        rows = [at_rest(f).xreplace(renamed) for f in form.at_mode(mode)]
        sizes = form.sizes_at_mode(mode)
        # The places: in contact h_at_mode gives the rate, which vanishes wherever the field does.
        h = [at_rest(g.xreplace(sizes)) for g in form.h]
        limits = {i: tuple(at_rest(r.xreplace(sizes)) for r in _ends(form, i)) for i in on}
        bounds: list[Bound] = []
        for i, (surface, m) in enumerate(zip(system.surfaces, signs, strict=True)):
            if m and surface.kind != "observer":
                # With hysteresis a sign is kept until h reaches the other edge.
                g = m * h[i] + exact_width(surface.width)
                bounds.append(Bound(g, surface.kind == "switching", surface.name))
            elif not m:
                s, (low, high) = renamed[form.s[i]], limits[i]
                ends = [g for g, end in ((s - low, low), (high - s, high)) if end.is_infinite is not True]
                bounds += [Bound(g, False, surface.name) for g in ends]
        return cls(
            mode,
            form.x,
            tuple(renamed[form.s[i]] for i in on),
            tuple(system.surfaces[i].name for i in on),
            (*(h[i] for i in on), *rows),
            tuple(bounds),
            tuple((limits[i][0], limits[i][1]) for i in on),
            _kind(form, on),
        )

    def put(self, values: Mapping[Symbol, Expr]) -> ModeProblem:
        """Replace symbols that are no unknowns."""
        if not values:
            return self
        return replace(
            self,
            equations=tuple(plain_exponents(at_rest(e.subs(values))) for e in self.equations),
            bounds=tuple(replace(b, g=plain_exponents(at_rest(b.g.subs(values)))) for b in self.bounds),
            limits=tuple((low.subs(values), high.subs(values)) for low, high in self.limits),
        )

    def has(self, symbol: Symbol) -> bool:
        """Whether an equation or a bound holds the symbol."""
        return any(e.has(symbol) for e in (*self.equations, *(b.g for b in self.bounds)))


def _kind(form: SymbolicForm, on: Sequence[int]) -> PointKind:
    if not on:
        return "equilibrium"
    rests = bool(form.contact) and all(form.contact[i] is not None for i in on)
    return "resting contact" if rests else "pseudo-equilibrium"


def _ends(form: SymbolicForm, i: int) -> tuple[Expr, Expr]:
    """The set of the multiplier of surface i; in contact it is open towards the obstacle."""
    low, high = form.radius[i]
    contact = form.contact[i] if form.contact else None
    if contact is None:
        return low, high
    return (-sympy.oo, high) if contact.side > 0 else (low, sympy.oo)


def exact_width(width: float) -> Expr:
    """The half-width of a hysteresis as a rational number."""
    return sympy.Rational(str(width)) if width else sympy.S.Zero


def multiplier_symbol(system: System, i: int, alone: bool, taken: set[str]) -> Symbol:
    """s, or s_name where there are several or the name s is taken."""
    if alone and "s" not in taken:
        return Symbol("s", real=True)
    name = "s_" + system.surfaces[i].name.replace(" ", "_")
    return Symbol(name if name not in taken else f"s_{i + 1}_", real=True)


def real_where(formulas: Iterable[Expr]) -> list[Expr]:
    """Expressions that are not negative where even roots, logarithms and inverse sines are real."""
    out: list[Expr] = []
    for e in formulas:
        for q in sorted(e.atoms(sympy.Pow), key=sympy.default_sort_key):
            if q.exp.is_Rational and q.exp.q % 2 == 0:
                out += [q.base]
        for q in sorted(e.atoms(sympy.log, sympy.asin, sympy.acos), key=sympy.default_sort_key):
            out += [q.args[0]] if isinstance(q, sympy.log) else [1 - q.args[0], 1 + q.args[0]]
    return [short(g) for g in dict.fromkeys(out) if g.free_symbols]


def at_rest(expression: Expr) -> Expr:
    """0**e -> 0 for symbolic e: a power of |h| whose exponent is no number is taken to be positive."""
    zero_powers = {
        q: sympy.S.Zero for q in expression.atoms(sympy.Pow) if q.base.is_zero and q.exp.free_symbols
    }
    return expression.subs(zero_powers) if zero_powers else expression


@dataclass(frozen=True)
class Existence:
    """Turns branches of a mode problem into the points and sets that exist at the parameter values.

    ranges    of each state, where the borders of a set are searched if they have no formula
    searched  the states for which that was done
    """

    problem: ModeProblem
    values: Mapping[Symbol, Expr]
    degenerate: tuple[str, ...] = ()
    exact: bool = True
    ranges: Mapping[Symbol, tuple[float, float]] = field(default_factory=dict)
    searched: set[Symbol] = field(default_factory=set)

    def of(self, branch: Family) -> list[EquilibriumPoint | EquilibriumSet]:
        """Return what of the branch exists."""
        unknowns = (*self.problem.x, *self.problem.sliding)
        free = tuple(q for q in unknowns if q not in branch)
        if not free:
            point = self.point(branch)
            return [] if point is None else [point]
        sets = self._sets(branch, free)
        if any(branch.get(q, q).has(*free) for q in self.problem.x):
            return [*sets]
        # x is one point, only its multipliers are not unique.
        return [self._loose(e) for e in sets]

    def _loose(self, found: EquilibriumSet) -> EquilibriumPoint:
        inner = found.inside or (_between(*pair) for pair in found.bounds)
        at = {q: sympy.Float(c) for q, c in zip(found.free, inner, strict=True)}
        s_value = (self.number(e.subs(at)) for _, e in found.multipliers)
        return EquilibriumPoint(
            found.mode,
            found.states,
            found.x,
            found.multipliers,
            tuple(float(self.number(e) or 0.0) for e in found.x),
            tuple(float(v or 0.0) for v in s_value),
            "boundary equilibrium",
            found.conditions,
            self.exact,
            self.degenerate,
        )

    def point(self, branch: Family) -> EquilibriumPoint | None:
        """Return the point if the bounds hold at the parameter values."""
        problem = self.problem
        bounds = [replace(b, g=short(b.g.subs(branch))) for b in problem.bounds]
        sides = [side(b.g, branch, self.values) for b in problem.bounds]
        if any(g is None or g < 0 for g in sides):
            return None
        edge = [g == 0 for g in sides]
        # On a switching surface it belongs to the sliding mode, whose closure holds it.
        if any(e and b.strict for e, b in zip(edge, bounds, strict=True)):
            return None
        kind: PointKind = problem.kind
        x = tuple(branch[q] for q in problem.x)
        s = tuple(branch[q] for q in problem.sliding)
        value = [self.number(e) for e in x]
        s_value = [self.number(e) for e in s]
        if any(v is None for v in (*value, *s_value)):
            return None
        # A number has been compared above: sympy forms its minimal polynomial to do so.
        conditions = (b.g > 0 if b.strict else b.g >= 0 for b in bounds if b.g.free_symbols)
        return EquilibriumPoint(
            problem.mode,
            tuple(q.name for q in problem.x),
            x,
            tuple(zip(problem.names, s, strict=True)),
            tuple(float(v) for v in value if v is not None),
            tuple(float(v) for v in s_value if v is not None),
            "boundary equilibrium" if any(edge) else kind,
            tuple(c for c in dict.fromkeys(conditions) if c != sympy.true),
            self.exact,
            self.degenerate,
        )

    def _sets(self, branch: Family, free: tuple[Symbol, ...]) -> list[EquilibriumSet]:
        bounds = [replace(b, g=short(b.g.subs(branch))) for b in self.problem.bounds]
        bounds += [Bound(g, False, "") for g in real_where(branch.values())]
        fixed = [b for b in bounds if not b.g.has(*free)]
        for b in fixed:
            g = side(b.g, {}, self.values)
            if g is None or g < 0 or (b.strict and g == 0):
                return []
        open_bounds = [b for b in bounds if b.g.has(*free)]
        if len(free) == 1:
            return [
                self._set(branch, free, (pair,), open_bounds)
                for pair in self._intervals(open_bounds, free[0])
            ]
        inside = inner_point(free, [b.g for b in open_bounds], self.values)
        if inside is None:
            if not is_affine(free, [b.g.subs(self.values) for b in open_bounds]):
                self.searched.update(free)
            return []
        domain = tuple(self._box(q, open_bounds) for q in free)
        return [replace(self._set(branch, free, domain, open_bounds), inside=inside)]

    def _set(
        self,
        branch: Family,
        free: tuple[Symbol, ...],
        domain: tuple[tuple[Expr, Expr], ...],
        bounds: list[Bound],
    ) -> EquilibriumSet:
        problem = self.problem
        whole = {**{q: q for q in free}, **branch}
        ends = []
        # The end of a half line too; corners only of what is bounded.
        corners = [pair for pair in itertools.product(*domain) if not any(e.is_infinite for e in pair)]
        if len(free) == 1 or len(corners) == 2 ** len(free):
            for corner in corners:
                at = dict(zip(free, corner, strict=True))
                place = {q: short(e.subs(at)) for q, e in whole.items()}
                end = replace(self, problem=self._closed()).point(place)
                if end is not None:
                    ends.append(end)
        low_high = tuple((_as_float(self.number(a), a), _as_float(self.number(b), b)) for a, b in domain)
        relations = (b.g > 0 if b.strict else b.g >= 0 for b in bounds)
        return EquilibriumSet(
            problem.mode,
            tuple(q.name for q in problem.x),
            tuple(whole[q] for q in problem.x),
            tuple((name, whole[q]) for name, q in zip(problem.names, problem.sliding, strict=True)),
            free,
            domain,
            low_high,
            tuple(ends),
            tuple(c for c in dict.fromkeys(relations) if c != sympy.true),
            self.exact,
            self.degenerate,
        )

    def _closed(self) -> ModeProblem:
        return replace(self.problem, bounds=tuple(replace(b, strict=False) for b in self.problem.bounds))

    def _intervals(self, bounds: list[Bound], c: Symbol) -> list[tuple[Expr, Expr]]:
        """The intervals of c on which all bounds hold at the parameter values, ends in the parameters."""
        roots: list[tuple[float, Expr]] = []
        for bound in bounds:
            roots += self._roots(bound.g, c)
        roots.sort(key=lambda pair: pair[0])
        marks = [(-float("inf"), -sympy.oo), *roots, (float("inf"), sympy.oo)]
        pieces: list[tuple[Expr, Expr]] = []
        joined = False
        for (a, low), (b, high) in itertools.pairwise(marks):
            if b - a <= TOLERANCE * min(1.0, max(abs(a), abs(b))):
                continue
            middle = _between(a, b, FAR)
            inside = True
            for bound in bounds:
                g = self.number(bound.g.subs(c, sympy.Float(middle, 30)))
                inside = inside and g is not None and g > 0
            if inside and joined:
                pieces[-1] = (pieces[-1][0], high)
            elif inside:
                pieces.append((low, high))
            joined = inside
        return pieces

    def _roots(self, g: Expr, c: Symbol) -> list[tuple[float, Expr]]:
        """Real zeros of g(c) at the parameter values: (number, formula)."""
        found: list[tuple[float, Expr]] = []
        if g.is_polynomial(c) and sympy.Poly(g, c).degree() == 1:
            c1, c0 = sympy.Poly(g, c).all_coeffs()
            formulas = [short(-c0 / c1)]
        else:
            formulas = self._solved(g.subs(self.values), c)
        for formula in formulas:
            number = self.number(formula)
            if number is not None:
                found.append((number, formula))
        return found

    def _solved(self, g: Expr, c: Symbol) -> list[Expr]:
        """The zeros of g(c) in formulas; where there are none, those found by sampling c at all sizes."""
        numerator, denominator = sympy.fraction(sympy.together(g))
        if numerator.is_polynomial(c) and denominator.is_polynomial(c):
            return [root for e in (numerator, denominator) for root in _polynomial_roots(e, c)]
        low, high = self.ranges.get(c, (-FAR, FAR))
        far = FAR * max(abs(low), abs(high)) / 10
        try:
            found = list(itertools.islice(sympy.solveset(g, c, sympy.Interval(-far, far)), MOST_ROOTS + 1))
        except (TypeError, NotImplementedError, ValueError):
            found = []
        else:
            if len(found) <= MOST_ROOTS:
                return found
        self.searched.add(c)
        at = sympy.lambdify(c, g, "numpy")
        places = np.linspace(low, high, SAMPLES)
        if not periodic(g, c):
            places = np.unique([*places, *-SIZES, 0.0, *SIZES])
        with np.errstate(all="ignore"):
            values = np.array([complex(at(x)) for x in places])
        real = np.isfinite(values) & (values.imag == 0)
        turns = real[:-1] & real[1:] & (np.sign(values.real[:-1]) != np.sign(values.real[1:]))
        between = [(places[k], places[k + 1]) for k in np.flatnonzero(turns)]
        roots = [brentq(lambda x: float(at(x)), a, b, xtol=1e-100, maxiter=1000) for a, b in between]
        return [sympy.Float(root, 17) for root in roots]

    def _box(self, q: Symbol, bounds: list[Bound]) -> tuple[Expr, Expr]:
        """The limits of one of several free symbols that hold it alone."""
        low: Expr = -sympy.oo
        high: Expr = sympy.oo
        for bound in bounds:
            if bound.g.diff(q) == 1 and not (bound.g - q).has(*self.problem.x, *self.problem.sliding):
                low = q - bound.g
            elif bound.g.diff(q) == -1 and not (bound.g + q).has(*self.problem.x, *self.problem.sliding):
                high = q + bound.g
        return low, high

    def folded(self, branch: Family) -> bool:
        """Whether a multiplier does not tell the states of the branch apart, or they run off as it changes.

        x turns back where a root stops being real: what ends there is the formula, not the set.
        """
        free = [q for q in (*self.problem.x, *self.problem.sliding) if q not in branch]
        if len(free) != 1 or free[0] not in self.problem.sliding:
            return False
        states = [branch[q] for q in self.problem.x]
        if any(sympy.fraction(sympy.together(e))[1].has(free[0]) for e in states):
            return True
        turns = real_where(states)
        edges = [edge for found in self._sets(branch, (free[0],)) for edge in found.domain[0] if turns]
        numbers = [self.number(g.subs(free[0], e)) for e in edges if not e.is_infinite for g in turns]
        return any(g is not None and abs(g) <= TOLERANCE for g in numbers)

    def number(self, expression: Any) -> float | None:
        """The expression at the parameter values, None where it is not a finite real number."""
        real = real_number(sympy.S(expression).subs(self.values))
        return None if real is None else float(real)


def _between(low: float, high: float, far: float = 1.0) -> float:
    """A point inside an interval that may be unbounded."""
    if low == -high:
        return 0.0
    if low == -float("inf"):
        return high - far * max(1.0, abs(high))
    return low + far * max(1.0, abs(low)) if high == float("inf") else (low + high) / 2


def _polynomial_roots(g: Expr, c: Symbol) -> list[Expr]:
    """The real roots of a polynomial, of any size: in formulas where its coefficients are fractions."""
    polynomial = sympy.Poly(g, c)
    if polynomial.degree() < 1:
        return []
    if polynomial.domain.is_ZZ or polynomial.domain.is_QQ:
        return list(polynomial.sqf_part().real_roots())
    return real_roots(polynomial)


def _as_float(number: float | None, expression: Expr) -> float:
    if number is not None:
        return number
    return float("inf") if expression == sympy.oo else -float("inf")
