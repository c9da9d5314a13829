"""All solutions of algebraic equations, by elimination: branches of unknown = expression, the others free.

Every step divides only by what is not zero at given values of the parameters, so a branch holds in a
neighbourhood of them, and it is checked there by putting it back into the equations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import sympy
from sympy import Expr, Symbol
from sympy.polys.matrices import DomainMatrix
from sympy.polys.polyerrors import BasePolynomialError
from sympy.polys.polytools import NoConvergence

from filippov.analysis.algebra.budget import Clock, OutOfBudgetError
from filippov.analysis.algebra.polynomial import sign_of_number
from filippov.analysis.steady.common_roots import common_roots, real_roots
from filippov.base.errors import UsageError

MOST_BRANCHES = 64
ROUNDING = 1e-9
# Work that one equation may take, in the units of a budget.
ROOTS = 1.0
# Of a polynomial in roots of the unknowns or exponentials: its factors are sought in loops that no budget
# stops.
MOST_DEGREE = 60

WAVES = (sympy.sin, sympy.cos, sympy.tan)

Family = dict[Symbol, Expr]


class DegenerateError(Exception):
    """A step would divide by an expression in the parameters that is 0 at their values."""

    def __init__(self, expression: Expr) -> None:
        super().__init__(str(expression))
        self.expression = expression


class UnsolvedError(Exception):
    """No step is left that leads on, though equations are."""


@dataclass
class Elimination:
    """The unknowns, states before multipliers, which rather stay free; and the values of the parameters.

    by_state  the states rather stay free where an equation is nonlinear in them and affine in a multiplier
    """

    states: Sequence[Symbol]
    multipliers: Sequence[Symbol]
    values: Mapping[Symbol, Expr]
    clock: Clock
    numeric: bool = False
    by_state: bool = False
    found: list[Family] = field(default_factory=list)

    @property
    def unknowns(self) -> tuple[Symbol, ...]:
        """States, then multipliers."""
        return (*self.states, *self.multipliers)

    def solve(self, equations: Sequence[Expr]) -> list[Family]:
        """Return the branches on which all equations are 0; unknowns that are no key of one are free."""
        affine = self._affine(equations)
        if affine is not None:
            return affine
        self.found = []
        self._step(list(equations), {})
        return [b for b in self._different() if self._holds(b, equations)]

    def _affine(self, equations: Sequence[Expr]) -> list[Family] | None:
        """The branch, or none, of affine equations with rational numbers, by exact linear algebra; else None.

        The last unknowns stay free, as they do where one unknown after the other is eliminated.
        """
        self.clock.check()
        rows = [_affine_row(equation, self.unknowns) for equation in equations]
        known = [row for row in rows if row is not None]
        if len(known) < len(rows) or not rows:
            return None
        size = len(self.unknowns)
        reduced, pivots = DomainMatrix(known, (len(known), size + 1), sympy.QQ).rref()
        if size in pivots:
            return []
        numbers, branch = reduced.to_Matrix(), Family()
        for k, i in enumerate(pivots):
            rest = zip(self.unknowns[i + 1 :], numbers[k, i + 1 : size], strict=True)
            branch[self.unknowns[i]] = short(-numbers[k, size] - sum(c * x for x, c in rest))
        return [branch]

    def _step(self, equations: list[Expr], known: Family) -> None:
        self.clock.check()
        if len(self.found) > MOST_BRANCHES:
            raise UnsolvedError
        left: list[list[Expr]] = []
        for equation in equations:
            factors = self._factors(equation.subs(known) if known else equation)
            if factors is None:
                return
            if factors and factors not in left:
                left.append(factors)
        if not left:
            self.found.append(known)
            return
        left.sort(key=len)
        rest = [sympy.Mul(*factors) for factors in left]
        single = [k for k, factors in enumerate(left) if len(factors) == 1]
        if self._eliminate(single, rest, known, states_only=True):
            return
        if len(single) < len(left):  # a product is 0 where one of its factors is
            k = len(single)
            for factor in left[k]:
                self._step([factor, *rest[:k], *rest[k + 1 :]], known)
            return
        free = set().union(*(e.free_symbols for e in rest)) & set(self.unknowns)
        if len(rest) < len(free):
            if self.by_state and self._split(rest, known, self.multipliers):
                return
            if not self.by_state and self._nonlinear(rest, known, self.states):
                return
        if self._eliminate(single, rest, known, states_only=False):
            return
        if self._nonlinear(rest, known, self.unknowns) or (self.numeric and self._pair(rest, known)):
            return
        if not self._split(rest, known, self.unknowns):
            raise UnsolvedError

    def _eliminate(self, single: list[int], rest: list[Expr], known: Family, states_only: bool) -> bool:
        """Solve one equation for an unknown in which it is linear; the plainest coefficient first."""
        best: tuple[int, int, Symbol, Expr] | None = None
        degenerate: Expr | None = None
        for unknown in self.states if states_only else self.unknowns:
            for k in single:
                parts = _linear(rest[k], unknown)
                if parts is None:
                    continue
                slope, constant = parts
                if not slope.has(*self.unknowns):
                    if self.at_values(slope) == 0:
                        degenerate = slope
                        continue
                    rank = 0 if slope.is_number else 1
                elif not constant.has(*self.unknowns) and self.at_values(constant) != 0:
                    rank = 2
                else:
                    continue
                if best is None or rank < best[0]:
                    best = rank, k, unknown, -constant / slope
        if best is None:
            if degenerate is not None:
                raise DegenerateError(degenerate)
            return False
        _, k, unknown, value = best
        self._put(unknown, value, rest[:k] + rest[k + 1 :], known)
        return True

    def _nonlinear(self, rest: list[Expr], known: Family, unknowns: Sequence[Symbol]) -> bool:
        """Solve one equation for an unknown in which it is not linear."""
        for unknown in unknowns:
            for k, equation in enumerate(rest):
                roots = self._roots(equation, unknown) if equation.has(unknown) else None
                if roots is None:
                    continue
                for root in roots:
                    self._put(unknown, root, rest[:k] + rest[k + 1 :], known)
                return True
        return False

    def _pair(self, rest: list[Expr], known: Family) -> bool:
        """Solve two polynomial equations in two unknowns together."""
        if any(_degree(e) > MOST_DEGREE for e in rest):
            return False
        for k, f in enumerate(rest):
            held = [x for x in self.unknowns if f.has(x)]
            for j in range(k + 1, len(rest)):
                if len(held) != 2 or not all(rest[j].has(x) == (x in held) for x in self.unknowns):
                    continue
                g, (u, v) = rest[j], held
                try:
                    roots = self.clock.within(partial(common_roots, f, g, u, v))
                except NoConvergence:
                    continue
                if roots is None:
                    continue
                others = [e for i, e in enumerate(rest) if i not in (k, j)]
                for first, second in roots:
                    put = {u: first, v: second}
                    moved = {x: e.subs(put) for x, e in known.items()}
                    self._step([e.subs(put) for e in others], {**moved, **put})
                return True
        return False

    def _split(self, rest: list[Expr], known: Family, unknowns: Sequence[Symbol]) -> bool:
        """c y + d = 0 with unknowns in both: c = d = 0, or y = -d/c."""
        for unknown in unknowns:
            for k, equation in enumerate(rest):
                parts = _linear(equation, unknown)
                if parts is not None:
                    slope, constant = parts
                    others = rest[:k] + rest[k + 1 :]
                    self._step([slope, constant, *others], known)
                    self._put(unknown, -constant / slope, others, known)
                    return True
        return False

    def _put(self, unknown: Symbol, value: Expr, rest: list[Expr], known: Family) -> None:
        value = short(value)
        put = {unknown: value}
        self._step([e.subs(put) for e in rest], {**{x: short(e.subs(put)) for x, e in known.items()}, **put})

    def _factors(self, equation: Expr) -> list[Expr] | None:
        """Return the factors that hold unknowns; [] if the equation holds, None if it cannot hold."""
        if _degree(equation) > MOST_DEGREE:
            return self._kept(_monomials(equation))
        apart, numbers = _numbers_apart(equation)
        numerator = sympy.fraction(sympy.together(apart))[0]
        try:
            constant, powers = self.clock.within(lambda: sympy.factor_list(numerator))
            factors = [constant, *(factor for factor, _ in powers)]
        except sympy.PolynomialError:
            factors = list(sympy.Mul.make_args(sympy.factor_terms(numerator)))
        return self._kept([factor.xreplace(numbers) for factor in factors])

    def _kept(self, factors: Sequence[Expr]) -> list[Expr] | None:
        kept = []
        for factor in factors:
            if factor.is_zero:
                return []
            if factor.has(*self.unknowns):
                if not _never_zero(factor):
                    kept.append(factor)
            elif self.at_values(factor) == 0:
                if not factor.free_symbols:
                    return []
                raise DegenerateError(factor)
        return kept or None

    def _roots(self, equation: Expr, unknown: Symbol) -> list[Expr] | None:
        if _degree(equation) > MOST_DEGREE:
            return _of_one_power(equation, unknown)
        if equation.is_polynomial(unknown):
            polynomial = sympy.Poly(equation, unknown)
            if polynomial.degree() < 2:
                return None
            if polynomial.degree() > 2 and self.numeric and not polynomial.free_symbols_in_domain:
                return real_roots(polynomial)
            if polynomial.degree() > 2:
                return None
        unit = _unit_of_waves(equation, unknown)
        scaled = equation.subs(unknown, unknown / unit)
        if _exponential_degree(scaled, WAVES) > MOST_DEGREE or _beside_waves(scaled, unknown):
            return None
        apart, numbers = _numbers_apart(scaled)
        try:
            found = self.clock.within(lambda: sympy.solve(apart, unknown), ROOTS)
            roots = [r.xreplace(numbers) / unit for r in found]
        except OutOfBudgetError:
            self.clock.check()
            return _of_one_power(equation, unknown)
        except (NotImplementedError, ValueError, TypeError, AttributeError, KeyError, sympy.PolynomialError):
            return None
        plain = [r for r in roots if isinstance(r, Expr) and not r.has(unknown, sympy.I, sympy.Piecewise)]
        return plain if plain or equation.is_polynomial(unknown) else _of_one_power(equation, unknown)

    def at_values(self, expression: Expr) -> Expr:
        """Return an expression in parameters at their values."""
        value = expression.subs(self.values)
        try:
            return sympy.S.Zero if not value.free_symbols and sign_of_number(value) == 0 else value
        except (UsageError, TypeError):
            return value

    def _holds(self, branch: Family, equations: Sequence[Expr]) -> bool:
        """Whether the branch is real and the equations are 0 on it, at some values of what is free."""
        free = [x for x in self.unknowns if x not in branch]
        for guess in (sympy.Rational(1, 7), sympy.Rational(-2, 11), sympy.Rational(3, 17)):
            point = {x: guess * (1 + sympy.Rational(k, 5)) for k, x in enumerate(free)}
            place = {x: self._number(e.subs(point)) for x, e in branch.items()}
            if any(v is None for v in place.values()):
                continue
            if all(self._balanced(e, {**place, **point}) for e in equations):
                return True
        return False

    def _balanced(self, equation: Expr, place: Mapping[Symbol, Any]) -> bool:
        """Whether the terms of an equation cancel at a place."""
        whole = self._number(equation.subs(place))
        if whole is None or abs(whole) < ROUNDING:
            return whole is not None
        terms = [self._number(e.subs(place)) for e in sympy.Add.make_args(equation)]
        sizes = [abs(e) for e in terms if e is not None]
        return len(sizes) == len(terms) and bool(abs(whole) < ROUNDING * sum(sizes))

    def _number(self, expression: Expr) -> Expr | None:
        value = expression.subs(self.values).evalf(25)
        if not value.is_number or value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
            return None
        real, imaginary = value.as_real_imag()
        return real if abs(imaginary) < ROUNDING else None

    def _different(self) -> list[Family]:
        kept: list[Family] = []
        for branch in self.found:
            if branch not in kept:
                kept.append(branch)
        return kept


def short(expression: Expr) -> Expr:
    """Return a rational expression cancelled and factored, any other as it is."""
    if expression.is_number or expression.is_Symbol or _degree(expression) > MOST_DEGREE:
        return expression
    apart, numbers = _numbers_apart(expression)
    try:
        return sympy.factor(sympy.cancel(apart)).xreplace(numbers)
    except (sympy.PolynomialError, NotImplementedError):
        return expression


def _numbers_apart(expression: Expr) -> tuple[Expr, dict[Expr, Expr]]:
    """exp(c + u) as C exp(u), and the numbers exp(c) of the symbols C.

    Among polynomials exp(139/200) is exp(1/200) to the power 139.
    """
    symbols: dict[Expr, Expr] = {}
    if not expression.has(sympy.exp):
        return expression, symbols

    def apart(power: Expr) -> Expr:
        number, rest = power.args[0].expand().as_coeff_Add()
        if not number.is_Rational or number.is_zero:
            return power
        return symbols.setdefault(number, sympy.Dummy("C", positive=True)) * sympy.exp(rest)

    found = expression.replace(lambda q: isinstance(q, sympy.exp), apart)
    return found, {symbol: sympy.exp(number) for number, symbol in symbols.items()}


def _degree(expression: Expr) -> int:
    """The largest degree in a base of powers, or in the root of it of which all its powers are whole ones.

    An exponent that is a float has no such root, and a degree above all. exp(-1521 v**2/100) is a power of
    exp(v**2/100).
    """
    found: dict[Expr, set[sympy.Rational]] = {}
    for power in expression.atoms(sympy.Pow):
        if power.exp.is_Rational and power.base.free_symbols:
            found.setdefault(power.base, set()).add(power.exp)
        elif power.exp.has(sympy.Float) and power.base.free_symbols:
            return MOST_DEGREE + 1
    largest = _exponential_degree(expression)
    for base, exponents in found.items():
        if len(exponents) == 1 and not expression.has(sympy.Add):
            continue
        powers = {base**e: sympy.S.One for e in exponents}
        # Beside x**(1/3), x itself is (x**(1/3))**3.
        every = [*exponents, sympy.S.One] if expression.xreplace(powers).has(base) else [*exponents]
        root = math.lcm(*(int(e.q) for e in every))
        largest = max(largest, *(abs(int(e * root)) for e in every))
    return largest


def _unit_of_waves(equation: Expr, unknown: Symbol) -> Expr:
    """k of the sines and cosines of k x + c: with 1e8 in it they are a polynomial of that degree to sympy."""
    slopes = (q.args[0].diff(unknown) for q in equation.atoms(*WAVES))
    return min((k for k in slopes if k.is_Rational and k != 0), key=abs, default=sympy.S.One)


def periodic(equation: Expr, unknown: Symbol) -> bool:
    """Whether the unknown stands in sines alone."""
    return equation.has(*WAVES) and not _outside_of_waves(equation, unknown)


def _outside_of_waves(equation: Expr, unknown: Symbol) -> bool:
    waves = {q: sympy.Dummy() for q in equation.atoms(*WAVES) if q.has(unknown)}
    return bool(equation.xreplace(waves).has(unknown))


def _beside_waves(equation: Expr, unknown: Symbol) -> bool:
    """Whether the unknown stands in sines and outside of them: such roots have no formulas."""
    return any(q.has(unknown) for q in equation.atoms(*WAVES)) and _outside_of_waves(equation, unknown)


def _exponential_degree(expression: Expr, functions: Sequence[type] = (sympy.exp,)) -> int:
    """The largest degree in an exponential of which all exponentials with the same exponent are powers."""
    found: dict[Expr, set[sympy.Rational]] = {}
    for power in expression.atoms(*functions):
        for term in sympy.Add.make_args(power.args[0].expand()):
            number, rest = term.as_coeff_Mul(rational=True)
            if rest.free_symbols:
                found.setdefault(rest, set()).add(number)
    largest = 0
    for numbers in found.values():
        root = math.lcm(*(int(q.q) for q in numbers))
        largest = max(largest, *(abs(int(q * root)) for q in numbers))
    return largest


def _monomials(expression: Expr) -> list[Expr]:
    """Factors without which an expression is not 0, found without polynomials: bases of its common powers."""
    if not isinstance(expression, sympy.Add):
        parts = [e.as_base_exp() for e in sympy.Mul.make_args(expression)]
        return [base if e.is_positive else base**e for base, e in parts]
    terms = [term.as_powers_dict() for term in expression.args]
    least: dict[Expr, Expr] = {}
    for base in {q for term in terms for q in term if q.free_symbols}:
        exponents = [sympy.S(term.get(base, 0)) for term in terms]
        if all(e.is_Rational or e.is_Float for e in exponents):
            least[base] = min(exponents)
    pulled = sympy.Mul(*(q**e for q, e in least.items()))
    rest = sympy.Add(*(term / pulled for term in expression.args))
    return [*(q for q, e in least.items() if e > 0), rest]


def _of_one_power(equation: Expr, unknown: Symbol) -> list[Expr] | None:
    """The roots where the unknown stands in one exponential, or in one power with a fraction as exponent."""
    exponentials = [q for q in equation.atoms(sympy.exp) if q.has(unknown)]
    if exponentials:
        return _of_one_exponential(equation, unknown, exponentials)
    powers = [q for q in equation.atoms(sympy.Pow) if q.base.has(unknown)]
    y = sympy.Dummy()
    if len(powers) != 1 or not powers[0].exp.is_Number or powers[0].exp.is_Integer:
        return None
    (power,) = powers
    of_power, of_base = _linear(equation.xreplace({power: y}), y), _linear(power.base, unknown)
    if of_power is None or of_base is None or any(e.has(unknown) for e in of_power):
        return None
    value = -of_power[1] / of_power[0]
    if value.is_negative:
        return []
    return [(value ** (1 / power.exp) - of_base[1]) / of_base[0]]


def _of_one_exponential(equation: Expr, unknown: Symbol, found: list[Expr]) -> list[Expr] | None:
    y = sympy.Dummy()
    of_power = _linear(equation.xreplace({found[0]: y}), y)
    of_exponent = _linear(found[0].exp, unknown)
    if len(found) > 1 or of_power is None or of_exponent is None:
        return None
    value = -of_power[1] / of_power[0]
    if value.has(unknown) or of_exponent[1].has(unknown) or not value.is_number:
        return None
    return [(sympy.log(value) - of_exponent[1]) / of_exponent[0]] if value.is_positive else []


def _linear(equation: Expr, unknown: Symbol) -> tuple[Expr, Expr] | None:
    """(slope, constant) of an equation that is affine in the unknown."""
    if not equation.has(unknown):
        return None
    slope = sympy.expand(equation).diff(unknown)
    if slope.has(unknown) or slope.is_zero:
        return None
    return slope, sympy.expand(equation.subs(unknown, 0))


def _affine_row(equation: Expr, unknowns: Sequence[Symbol]) -> list[Any] | None:
    """Coefficients of the unknowns and the constant, rational numbers; None of any other equation."""
    try:
        polynomial = sympy.Poly(equation, *unknowns)
    except BasePolynomialError:
        return None
    if not (polynomial.domain.is_ZZ or polynomial.domain.is_QQ) or polynomial.total_degree() > 1:
        return None
    row = [sympy.QQ(0)] * (len(unknowns) + 1)
    for powers, coefficient in polynomial.terms():
        row[powers.index(1) if any(powers) else -1] = sympy.QQ(coefficient.p, coefficient.q)
    return row


def _never_zero(factor: Expr) -> bool:
    return bool(factor.is_nonzero) or isinstance(factor, sympy.exp)
