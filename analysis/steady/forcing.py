"""How a system depends on time: not at all, or periodically through sines and cosines of t and clocks."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from filippov import ModelError, System, UsageError
from filippov import t as time
from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.steady.repetition import repeats
from filippov.base.arrays import Array
from filippov.base.changed import changed
from filippov.base.given import positive
from filippov.base.signature import check_signature
from filippov.model.expression import parse_expression
from filippov.model.signals.input import Sampled

# Parts of the forcing's period that are tried, and the relative error of a period given as a number.
_PARTS, _SAME = 64, 1e-9
# Times after which plain functions give the same where t does not stand in them.
_MOMENTS = (0.377, 1.913)


@lru_cache(maxsize=128)
def depends_on_time(system: System) -> bool:
    """Whether t stands in the field or in a surface. Plain functions are compared at a few times."""
    form = system.symbolic
    if form is not None:
        return any(time in expression.free_symbols for expression in form.expressions())
    return not all(repeats(system, system.parameters.defaults, span, 0.0) for span in _MOMENTS)


def is_forced(system: System) -> bool:
    """Whether a solution shifted in time is none: t stands in the equations, or a clock ticks."""
    return depends_on_time(system) or any(e.period is not None for e in system.time_events)


@lru_cache(maxsize=128)
def forcing_period(system: System) -> sympy.Expr | None:
    """Period of the forcing, from the sines and cosines in t and the clocks; None where it is not clear."""
    form = system.symbolic
    clocks = [e.period for e in system.time_events if e.period is not None]
    if any(callable(q) and not isinstance(q, sympy.Expr) for q in clocks):
        return None
    rates = {2 * sympy.pi / exact(q) for q in clocks}
    if form is None:
        return _common(rates) if not depends_on_time(system) else None
    for whole in form.expressions():
        signals = whole.atoms(Sampled)
        if any(node.samples.period is None for node in signals):
            return None
        rates |= {2 * sympy.pi / exact(node.samples.period) for node in signals}
        expression = whole.xreplace({node: sympy.Dummy() for node in signals})
        waves = expression.atoms(sympy.sin, sympy.cos, sympy.tan)
        hidden = {wave: sympy.Dummy() for wave in waves if time in wave.free_symbols}
        if time in expression.xreplace(hidden).free_symbols:
            return None
        for wave in hidden:
            rate = wave.args[0].diff(time)
            if rate.free_symbols & {time, *form.x, *form.s, *form.a}:
                return None
            rates.add(sympy.simplify(rate))
    return _common(rates)


def _common(rates: set[sympy.Expr]) -> sympy.Expr | None:
    """The common period of angular frequencies; None where their ratios are not rational."""
    if not rates:
        return None
    first = next(iter(rates))
    ratios = [sympy.nsimplify(sympy.simplify(rate / first)) for rate in rates]
    if not all(ratio.is_rational for ratio in ratios):
        return None
    common = sympy.gcd_list([abs(ratio) for ratio in ratios])
    return 2 * sympy.pi / sympy.Abs(first * common)


class Period:
    """The period of the forcing, with its derivatives by parameters.

    given   a number, a formula in the parameters such as "2*pi/omega" (text or sympy), a function of the
            parameters by name, or None: read off the system
    """

    def __init__(self, system: System, given: Any = None) -> None:
        self.system, self._function = system, None
        # Whether it is read off the system, and whether it is a number.
        self.read, self.number = given is None, isinstance(given, int | float | np.number)
        self.text: str | float | None = given if isinstance(given, str | float | int) else None
        if given is None:
            given = forcing_period(system)
            if given is None:
                raise UsageError(
                    "the system depends on time, and its period cannot be read off it; give period=, a "
                    "number or a formula in the parameters such as '2*pi/omega'."
                )
            self.text = None
        if isinstance(given, str):
            symbols = {name: sympy.Symbol(name, real=True) for name in system.parameters}
            try:
                given = parse_expression(given, symbols)
            except ModelError as error:
                told = f"period is {self.text!r}, expected a number or a formula"
                raise UsageError(f"{told}: {error}") from None
        if isinstance(given, sympy.Expr):
            self._value, self._slopes = self._compile(given)
        elif callable(given):
            check_signature(given, ("p",), "period", "a number", UsageError)
            self._value, self._slopes = self._called(given)
        else:
            number = positive("period", given)
            self._value, self._slopes = (lambda p: number), (lambda p: np.zeros(len(p)))

    def _compile(self, formula: sympy.Expr) -> tuple[Callable[..., float], Callable[..., Array]]:
        names = self.system.parameters.names
        symbols = [sympy.Symbol(name, real=True) for name in names]
        by_name = {symbol.name: symbol for symbol in symbols}
        plain = formula.xreplace({s: by_name[s.name] for s in formula.free_symbols if s.name in by_name})
        extra = plain.free_symbols - set(symbols)
        if extra:
            raise UsageError(f"period holds {sorted(map(str, extra))}, expected parameters of the system.")
        value = sympy.lambdify(symbols, plain, "numpy")
        slopes = sympy.lambdify(symbols, [plain.diff(q) for q in symbols], "numpy")
        return (lambda p: float(value(*p))), (lambda p: np.array(slopes(*p), dtype=float))

    def _called(self, function: Callable[..., Any]) -> tuple[Callable[..., float], Callable[..., Array]]:
        def value(p: Array) -> float:
            return float(function(self.system.parameters.record(p)))

        def slopes(p: Array) -> Array:
            reach = 1e-6 * np.maximum(np.abs(p), 1e-3)
            steps = np.diag(reach)
            moved = [value(p + d) - value(p - d) for d in steps]
            return np.array(moved) / (2 * reach)

        return value, slopes

    def following(self, p: Array) -> Period:
        """This period where it is one of the forcing at p (P,); a number then follows the parameters.

        A solution that returns after any other time is not periodic: UsageError. Where the period of the
        forcing cannot be read off the system, its equations are compared wherever this period is asked for.
        """
        if self.read:
            return self
        if forcing_period(self.system) is None:
            return changed(self, _value=self._compared)
        least, own = Period(self.system), float(self._value(p))
        ratio = own / least(p)
        count = Fraction(ratio).limit_denominator(_PARTS)
        if count <= 0 or abs(ratio - count) > _SAME * count or not self._is_part(p, count, own):
            raise UsageError(
                f"period is {own:.12g}, and the forcing repeats after {least(p):.12g} at these "
                "parameters; expected a multiple of that. Leave period out, or give it as a formula in "
                "the parameters."
            )
        return least.times(float(count)) if self.number else self

    def _is_part(self, p: Array, count: Fraction, own: float) -> bool:
        whole, form = count.denominator == 1, self.system.symbolic
        if whole or form is None or self.system.time_events:
            return whole
        return not any(e.atoms(Sampled) for e in form.expressions()) and repeats(self.system, p, own)

    def _compared(self, p: Array) -> float:
        """The period, after which the equations repeat at p, or UsageError."""
        own = self._value(p)
        if not self.system.time_events and not repeats(self.system, p, own):
            values = zip(self.system.parameters.names, p.tolist(), strict=True)
            where = ", ".join(f"{name} = {value:.9g}" for name, value in values)
            raise UsageError(
                f"period is {own:.12g}, and the equations do not repeat after that time"
                f"{f' where {where}' if where else ''}. Give it in full accuracy, and as a formula where it "
                "depends on parameters: period='2*pi/omega'."
            )
        return own

    def times(self, count: float) -> Period:
        """A multiple of this period, or a part of it."""
        value, slopes = self._value, self._slopes
        return changed(
            self, text=None, _value=lambda p: count * value(p), _slopes=lambda p: count * slopes(p)
        )

    def __call__(self, p: Array) -> float:
        """The period at resolved parameter values."""
        value = self._value(p)
        if not value > 0 or not np.isfinite(value):
            raise UsageError(f"the period of the forcing is {value} at these parameters, expected > 0.")
        return value

    def slope(self, p: Array, names: tuple[str, ...]) -> Array:
        """Its derivatives by the named parameters."""
        rows = self._slopes(p)
        return np.array([rows[self.system.parameters.index(name)] for name in names])
