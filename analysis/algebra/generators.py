"""Expressions as rational functions: of their symbols, and of the functions and powers that occur in them.

exp(u), exp(-u) and exp(2 u) are powers of one generator, as are a**b and a**(2 b); sympy's factorisation
takes them for different ones or refuses them. Two generators that are related otherwise, such as sin and cos,
are taken as independent: what holds for them as polynomials holds for the functions too.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from math import gcd, lcm

import sympy
from sympy import Expr


class Generators:
    """What stands for the functions and powers of some expressions, and back."""

    def __init__(self, expressions: Iterable[Expr]) -> None:
        self._own: dict[Expr, sympy.Dummy] = {}
        # Of base**(c rest) for rational c: the largest step of which all c are multiples.
        self._steps: dict[tuple[Expr, Expr], Fraction] = {}
        given = list(expressions)
        for e in given:
            self._steps_of(e)
        self.plain = [self._plain(e) for e in given]
        self.back = {dummy: atom for atom, dummy in self._own.items()}

    def _steps_of(self, e: Expr) -> None:
        if _rational(e):
            for arg in e.args:
                self._steps_of(arg)
            return
        if _power(e):
            base, exponent = e.as_base_exp()
            for c, rest in _terms(exponent):
                key = base, rest
                if rest != 1 or c.denominator != 1:
                    self._steps[key] = _common(self._steps.get(key, Fraction(0)), c)
            self._steps_of(base)

    def _plain(self, e: Expr) -> Expr:
        if e.is_Rational or e.is_Symbol:
            return e
        if _rational(e):
            return e.func(*map(self._plain, e.args))
        if not _power(e):
            return self._generator(e)
        base, exponent = e.as_base_exp()
        factors = []
        for c, rest in _terms(exponent):
            step = self._steps.get((base, rest))
            if step is None:
                factors.append(self._plain(base) ** sympy.Integer(c.numerator))
            else:
                unit = sympy.Rational(step.numerator, step.denominator) * rest
                factors.append(self._generator(sympy.Pow(base, unit)) ** int(c / step))
        return sympy.Mul(*factors)

    def _generator(self, e: Expr) -> Expr:
        if e.is_Rational or e.is_Symbol:
            return e
        return self._own.setdefault(e, sympy.Dummy(f"a{len(self._own)}", real=True))


def _rational(e: Expr) -> bool:
    return bool(e.is_Add or e.is_Mul or (e.is_Pow and e.exp.is_Integer))


def _power(e: Expr) -> bool:
    return isinstance(e, sympy.Pow | sympy.exp)


def _terms(exponent: Expr) -> list[tuple[Fraction, Expr]]:
    """(c, rest) of a sum of c rest, c rational; a leading minus sign is never part of the rest."""
    out = []
    for term in sympy.Add.make_args(sympy.expand(exponent)):
        c, rest = term.as_coeff_Mul(rational=True)
        if not c.is_Rational:
            c, rest = sympy.S.One, term
        out.append((Fraction(int(c.p), int(c.q)), rest))
    return out


def _common(a: Fraction, b: Fraction) -> Fraction:
    """The largest number of which both are multiples."""
    below = lcm(a.denominator, b.denominator)
    return Fraction(gcd(int(a * below), int(b * below)), below)


def factor_list(expression: Expr) -> tuple[Expr, list[tuple[Expr, int]]]:
    """(constant, [(factor, power)]) as sympy.factor_list, of expressions with functions and powers too."""
    generators = Generators([expression])
    above, below = sympy.fraction(sympy.together(generators.plain[0]))
    constant, found = sympy.S.One, []
    for part, sign in ((above, 1), (below, -1)):
        number, factors = sympy.factor_list(part)
        constant *= number**sign
        found += [(f.xreplace(generators.back), sign * m) for f, m in factors]
    return constant, found
