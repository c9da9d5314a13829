"""The surfaces found while a model is read: equal ones are recognised up to a constant factor."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import sympy
from sympy import Expr, Rational, S, Symbol

from filippov.base.errors import ModelError
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.signals.input import as_symbols
from filippov.model.size import MOST_TERMS, cancelled, terms
from filippov.model.surface import Surface

DIGITS = 40
# Sizes in one argument of which the sides are looked through for regions in which it is 0.
MOST_SIZES = 6
CLOSE = sympy.Float("1e-30")


@dataclass(eq=False)
class Entry:
    """One surface: h, the symbols of its sign and size, and what the user declared of it."""

    h: Expr
    s: Symbol
    a: Symbol
    declared: Surface | None = None


class SignSymbol(Symbol):
    """The sign of a surface while a model is read."""

    __slots__ = ()


class SizeSymbol(Symbol):
    """The size |h| of a surface while a model is read."""

    __slots__ = ()


def dynamic(expr: Expr) -> bool:
    """Whether expr varies along a solution: it holds anything but parameters and numbers."""
    return any(not isinstance(symbol, ParameterSymbol) for symbol in expr.free_symbols)


@lru_cache(maxsize=4096)
def _moving(expr: Expr) -> frozenset[Symbol]:
    """What varies in an expression along a solution."""
    return frozenset(symbol for symbol in expr.free_symbols if dynamic(symbol))


class SurfaceTable:
    """Surfaces in the order in which they were entered."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self._by_sign: dict[Symbol, Entry] = {}
        # By what varies in them: only such functions are multiples of each other.
        self._alike: dict[frozenset[Symbol], list[Entry]] = {}
        self._written: dict[frozenset[Symbol], list[Expr]] = {}

    def write(self, arguments: Iterable[Expr]) -> None:
        """Remember arguments of signs and conditions as the model has them: they orient surfaces."""
        for h in arguments:
            self._written.setdefault(_moving(h), []).append(h)

    def entry(self, s: Symbol) -> Entry:
        """Return the surface whose sign is s."""
        return self._by_sign[s]

    def signs_in(self, expr: Expr) -> list[Symbol]:
        """Return the signs that expr holds, in the order of the table."""
        free = expr.free_symbols & self._by_sign.keys()
        return list(free) if len(free) < 2 else [s for s in self._by_sign if s in free]

    def declare(self, surface: Surface, h: Expr) -> Entry:
        """Enter a surface of the user; ModelError if it cannot switch or equals one declared before."""
        where = f"surface {surface.name!r}"
        if not dynamic(h):
            raise ModelError(
                f"{where}: h = {h} holds no state and no time, so its sign never changes. Write h in them: "
                "v - vb."
            )
        if h.is_nonnegative or h.is_nonpositive:
            raise ModelError(
                f"{where}: h = {h} never changes its sign, expected a function that does. "
                "Give the function whose zero set it is, without the square or the absolute value."
            )
        found = self.match(h)
        if found is not None:
            entry, factor = found
            if entry.declared is None:
                entry.declared = surface  # found inside another surface before its own turn
                self._rescale(entry, h, factor)
                return entry
            raise ModelError(
                f"surfaces {entry.declared.name!r} and {surface.name!r} are the same set: "
                f"{h} = ({factor}) * ({entry.h}). Declare it once. Resets from both sides have "
                "side='both' and values that tell the sides by dh/dt: Piecewise((a, v < 0), (b, True))."
            )
        return self._enter(h, surface)

    def _rescale(self, entry: Entry, h: Expr, factor: Expr) -> None:
        if factor == 1:
            entry.h = h
            return
        raise ModelError(
            f"surface {entry.declared.name if entry.declared else ''!r}: h = {h} occurs as {entry.h} "
            "inside another "
            f"surface. Write h = {entry.h}."
        )

    def register(self, h: Expr, written: bool = True) -> tuple[Entry, Expr]:
        """Enter h as it stands in an expression; return the entry and h/entry.h.

        written     h stands as it was written; else it takes the orientation that a written argument has
        """
        if not written and self._turned(self.plain(h)):
            return self._enter(-h, None), S.NegativeOne
        return self._enter(h, None), S.One

    def _turned(self, h: Expr) -> bool:
        """Whether h is the opposite of what was written; without that, whether its canonical form is -h."""
        for other in self._written.get(_moving(h), ()):
            factor = self.ratio(h, other)
            if factor is not None:
                return bool(sympy.sign(factor) == -1)
        return bool(h.could_extract_minus_sign())

    def _enter(self, h: Expr, declared: Surface | None) -> Entry:
        number = len(self.entries)
        entry = Entry(
            h, SignSymbol(f"_s{number}", real=True), SizeSymbol(f"_a{number}", nonnegative=True), declared
        )
        self.entries.append(entry)
        self._by_sign[entry.s] = entry
        self._alike.setdefault(_moving(h), []).append(entry)
        return entry

    def outermost(self, expr: Expr) -> Entry | None:
        """Return the last surface whose size expr holds; None where it holds none."""
        free = expr.free_symbols
        return next((entry for entry in reversed(self.entries) if entry.a in free), None)

    def flat(self, expr: Expr, deep: int = 0) -> bool:
        """Whether expr is 0 in a whole region, between the surfaces whose sizes it holds: |y| - y."""
        entry = self.outermost(expr)
        if entry is None:
            return vanishes(expr)
        sides = (expr.xreplace({entry.a: m * entry.h}) for m in (1, -1))
        return deep < MOST_SIZES and any(self.flat(side, deep + 1) for side in sides)

    def plain(self, h: Expr) -> Expr:
        """Return h with the sizes written out as Abs."""
        if not any(isinstance(q, SizeSymbol) for q in h.free_symbols):
            return h
        sizes: dict[Symbol, Expr] = {}
        for entry in self.entries:
            sizes[entry.a] = sympy.Abs(entry.h.xreplace(sizes))
        return h.xreplace(sizes)

    def match(self, h: Expr) -> tuple[Entry, Expr] | None:
        """Return the entry that is h up to a constant factor, and that factor h/entry.h."""
        for entry in self._alike.get(_moving(h), ()):
            factor = self.ratio(h, entry.h)
            if factor is not None:
                return entry, factor
        return None

    def on_side(self, expr: Expr, s: Symbol, m: int) -> Expr:
        """Return expr, which holds where the sign s is m, with m |h| for h under powers that are not whole.

        They are undefined beyond the surface, on which rounding leaves h on either side of 0.
        """
        entry, sizes = self._by_sign[s], {}
        for power in expr.atoms(sympy.Pow):
            factors = [] if power.exp.is_integer else sympy.Mul.make_args(power.base)
            for k, factor in enumerate(factors):
                ratio = self.ratio(factor, entry.h) if dynamic(factor) else None
                if ratio is not None:
                    base = sympy.Mul(*factors[:k], ratio * m * entry.a, *factors[k + 1 :])
                    if not base.is_nonpositive:  # undefined on its own side
                        sizes[power] = sympy.Pow(base, power.exp)
                    break
        return expr.xreplace(sizes) if sizes else expr

    @staticmethod
    def ratio(h: Expr, k: Expr) -> Expr | None:
        """Return h/k if it is a constant that is not 0, else None."""
        if h == k:
            return S.One
        if _moving(h) != _moving(k):
            return None
        if h == -k:
            return S.NegativeOne
        if not _moving(h):
            return None
        # Decimal fractions are taken as exact: two thresholds may differ in their last digit only.
        h, k = decimal(h), decimal(k)
        points = samples(h.free_symbols | k.free_symbols, 4)
        fixed = {s: q for s, q in points[0].items() if not dynamic(s)}
        values = (number(h, {**q, **fixed}, k) for q in points)
        first = next(values)
        if first is None or first.is_zero or any(v is None or abs(v / first - 1) > CLOSE for v in values):
            return None
        constant = cancelled(h / k)
        if dynamic(constant):
            moving = {s: q for s, q in points[0].items() if dynamic(s)}
            constant = cancelled((h / k).xreplace(as_decimals(moving, h / k)))
        return constant


def refuse_flat(where: str, h: Expr, factors: Iterable[Expr]) -> None:
    """Refuse a declared h with a factor that is a power, at least the second, of what vanishes on the way."""
    for base, exponent in (part.as_base_exp() for part in factors):
        if exponent.is_Integer and exponent > 1 and dynamic(base) and not base.is_nonzero:
            raise ModelError(
                f"{where}: h = {h} has no slope where {base} is 0, expected simple zeros. "
                "Give the same zeros without the power."
            )


def decimal(expr: Expr) -> Expr:
    """Return expr with its floats as the decimal fractions that they were written as."""
    floats = expr.atoms(sympy.Float)
    return expr.xreplace({q: Rational(repr(float(q))) for q in floats}) if floats else expr


def number(expr: Expr, at: dict[Symbol, Expr], divisor: Expr = S.One) -> Expr | None:
    """Return expr/divisor at a point as a number of 30 digits, None where it is not finite."""
    try:
        top = expr.xreplace(as_decimals(at, expr)).evalf(DIGITS)
        bottom = divisor.xreplace(as_decimals(at, divisor)).evalf(DIGITS)
    except (TypeError, ValueError):  # Max and Min of what is not real there
        return None
    if not (top.is_number and bottom.is_number) or bottom.is_zero or top.is_finite is not True:
        return None
    return top / bottom


def as_decimals(at: dict[Symbol, Expr], expr: Expr) -> dict[Symbol, Expr]:
    """Return a point with decimals of 80 digits where expr has powers that are not whole, else as it is.

    Of a fraction to the power of a fraction sympy looks for the prime factors, and writes out what it finds.
    """
    if all(q.exp.is_Integer for q in expr.atoms(sympy.Pow)):
        return at
    return {q: sympy.Float(value, 2 * DIGITS) for q, value in at.items()}


def vanishes(e: Expr) -> bool:
    """Whether an expression is 0: multiplied out, or, where that has too many terms, at exact points."""
    if terms(e) <= MOST_TERMS:
        return bool(sympy.expand(e).is_zero)
    seen, e = False, e.xreplace(as_symbols([e]))
    for point in samples(e.free_symbols, 4):
        parts = [number(part, point) for part in sympy.Add.make_args(e)]
        found = [part for part in parts if part is not None]
        if len(found) == len(parts):
            seen = True
            if abs(sum(found)) > CLOSE * sum(abs(part) for part in found):
                return False
    return seen


def samples(symbols: Iterable[Symbol], count: int, seed: int = 1) -> list[dict[Symbol, Expr]]:
    """Return reproducible rational points; parameters lie within their bounds, sizes are positive."""
    source = random.Random(seed)  # noqa: S311  (test points, not secrets)
    ordered = sorted(symbols, key=lambda s: (s.name, type(s).__name__))
    return [{s: _sample(s, source) for s in ordered} for _ in range(count)]


def _sample(symbol: Symbol, source: random.Random) -> Expr:
    unit = Rational(source.randint(1001, 9999), 10007)
    if isinstance(symbol, ParameterSymbol):
        low, high = symbol.parameter.lower, symbol.parameter.upper
        if low is not None and high is not None:
            return Rational(str(low)) + unit * (Rational(str(high)) - Rational(str(low)))
        if low is not None:
            return Rational(str(low)) + 2 * unit
        return Rational(str(high)) - 2 * unit if high is not None else 2 * unit
    if isinstance(symbol, SizeSymbol):
        return 2 * unit
    return (4 * unit - 2) if source.random() < 0.75 else 2 * unit
