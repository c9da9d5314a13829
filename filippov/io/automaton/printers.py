"""Expressions as text of Python, C and Modelica, by sympy's printers; signs, sizes and powers as runtimes do.

No name of the user's is printed: symbols stand as x[0], p[0], s[0], m[0].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy
from sympy import Expr, Symbol
from sympy.printing.c import C99CodePrinter
from sympy.printing.codeprinter import CodePrinter
from sympy.printing.precedence import precedence
from sympy.printing.pycode import PythonCodePrinter

from filippov.base.elementary import ELEMENTARY
from filippov.base.errors import ModelError
from filippov.model.symbolic import Select

_KNOWN = {getattr(sympy, f.symbolic) for f in ELEMENTARY} | {
    sympy.Abs, sympy.sign, sympy.Min, sympy.Max, sympy.Heaviside, Select,
}  # fmt: skip


class Text:
    """What the printers share: names of symbols, and powers of sizes |h|, which runtimes hold at 0 below."""

    language = ""
    choice = "({plus} if {c} > 0 else {minus})"
    power = "math.pow({base}, {exponent})"
    without: frozenset[str] = frozenset()

    def name(self, names: Mapping[Symbol, str], sizes: Sequence[Symbol]) -> Any:
        """Take the names of symbols, and which of them are sizes; returns itself."""
        self.names, self.sizes = dict(names), set(sizes)
        return self

    def __call__(self, e: Expr) -> str:
        """The text of an expression. Raises ModelError for a function that the language does not have."""
        for f in e.atoms(sympy.Function):
            if f.func not in _KNOWN or f.func.__name__ in self.without:
                raise ModelError(
                    f"the function {f.func.__name__} cannot be written in {self.language}. Write the model "
                    "without it, or export to Python."
                )
        text: str = self._print(e)  # type: ignore[attr-defined]
        return text

    def _print_Symbol(self, e: Symbol) -> str:
        text: str = self.names[e]
        return text

    _print_Dummy = _print_Symbol

    def _print_Integer(self, e: sympy.Integer) -> str:
        return repr(float(int(e)))

    def _print_Float(self, e: sympy.Float) -> str:
        return f"({float(e)!r})" if e < 0 else repr(float(e))

    def _print_Rational(self, e: sympy.Rational) -> str:
        return f"({float(int(e.p))!r}/{float(int(e.q))!r})"

    def _print_NumberSymbol(self, e: Expr) -> str:
        return repr(float(e))

    _print_Pi = _print_Exp1 = _print_NumberSymbol

    def _print_Select(self, e: Expr) -> str:
        c, plus, minus = (self._print(a) for a in e.args)  # type: ignore[attr-defined]
        return self.choice.format(c=f"({c})", plus=f"({plus})", minus=f"({minus})")

    def _print_sign(self, e: Expr) -> str:
        return f"sign_of({self._print(e.args[0])})"  # type: ignore[attr-defined]

    def _print_Heaviside(self, e: Expr) -> str:
        return f"(0.5 + 0.5*sign_of({self._print(e.args[0])}))"  # type: ignore[attr-defined]

    def _print_Min(self, e: Expr) -> str:
        return self._folded("fmin", e)

    def _print_Max(self, e: Expr) -> str:
        return self._folded("fmax", e)

    def _folded(self, function: str, e: Expr) -> str:
        first, *rest = (self._print(a) for a in e.args)  # type: ignore[attr-defined]
        for other in rest:
            first = f"{function}({first}, {other})"
        return str(first)

    def _print_Pow(self, e: Expr, **_: Any) -> str:
        base, exponent = e.base, e.exp
        if base == sympy.E:
            return self._print(sympy.exp(exponent, evaluate=False))  # type: ignore[attr-defined, no-any-return]
        text = self._print(base)  # type: ignore[attr-defined]
        if exponent.is_Integer and abs(int(exponent)) <= 4:
            one = f"({text})" if precedence(base) < 1000 else text
            product = "*".join([one] * abs(int(exponent)))
            return f"({product})" if exponent > 0 else f"(1.0/({product}))"
        shown = self._print(exponent)  # type: ignore[attr-defined]
        if base.free_symbols & self.sizes and not exponent.is_Integer:
            return f"size_power({text}, {shown})"
        return self.power.format(base=text, exponent=shown)


class PythonText(Text, PythonCodePrinter):
    """Expressions as Python with `math`."""

    language = "Python"

    def _print_Min(self, e: Expr) -> str:
        return f"min({', '.join(self._print(a) for a in e.args)})"

    def _print_Max(self, e: Expr) -> str:
        return f"max({', '.join(self._print(a) for a in e.args)})"


class CText(Text, C99CodePrinter):
    """Expressions as C99 with math.h."""

    language = "C"
    choice = "({c} > 0 ? {plus} : {minus})"
    power = "pow({base}, {exponent})"


class ModelicaText(Text, CodePrinter):
    """Expressions as Modelica, inside functions."""

    language = "Modelica"
    choice = "(if {c} > 0 then {plus} else {minus})"
    power = "(({base})^({exponent}))"
    without = frozenset({"erf", "asinh", "acosh", "atanh"})

    def _print_Min(self, e: Expr) -> str:
        return self._folded("min", e)

    def _print_Max(self, e: Expr) -> str:
        return self._folded("max", e)

    def _print_Abs(self, e: Expr) -> str:
        return f"abs({self._print(e.args[0])})"

    def _print_ceiling(self, e: Expr) -> str:
        return f"ceil({self._print(e.args[0])})"

    def _print_Function(self, e: Expr) -> str:
        return f"{e.func.__name__}({', '.join(self._print(a) for a in e.args)})"


def assignments(
    printer: Text, targets: Sequence[tuple[str, Expr]], sizes: Sequence[tuple[Symbol, Expr]], form: str
) -> list[str]:
    """Lines that compute sizes, parts that are common, and the targets.

    form    a line with places for `new` (a name not used before), `name` and `value`; targets are not new
    """
    lines = [
        form.format(name=printer.names[a], value=printer(e)) for a, e in sizes
    ]  # fmt: skip
    shared, reduced = sympy.cse([e for _, e in targets], symbols=sympy.numbered_symbols("c", cls=sympy.Dummy))
    for number, (symbol, e) in enumerate(shared):
        printer.names[symbol] = f"c{number}"
        if e.free_symbols & printer.sizes:
            printer.sizes.add(symbol)
        lines.append(form.format(name=f"c{number}", value=printer(e)))
    return lines + [f"{name} = {printer(e)}" for (name, _), e in zip(targets, reduced, strict=True)]
