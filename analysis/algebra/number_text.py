"""Formulas as text and LaTeX: numbers as the model has them written, names with subscripts.

A model that is written with decimals gets decimals where a fraction ends (1/5 is 0.2), one written with
fractions keeps them. Fractions too long to be read are given to 10 digits, and for a part of a formula that
would fill a page stands how many symbols it has. In LaTeX a name of several
letters is its first letter with the others as subscript: Fs is F_s, x1 is x_1, beta stays a Greek letter.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import sympy
from sympy import Expr
from sympy.printing.latex import latex, tex_greek_dictionary, translate

from filippov.model.symbolic import Select

LONGEST = 10
# Symbols and numbers of a part of a formula that are printed: LaTeX cannot set much more.
LARGEST = 500
Formula = Callable[[Any], str]
_GREEK = {
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu",
    "nu", "xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega",
}  # fmt: skip


def has_decimals(expressions: Iterable[Expr]) -> bool:
    """Whether a decimal stands in one of them."""
    return any(e.has(sympy.Float) for e in expressions)


def abridged(expression: Any) -> Any:
    """The expression with a symbol "[formula of N symbols]" for the parts too large to be printed."""
    size = _size(expression)
    if size <= LARGEST:
        return expression
    if not isinstance(expression, sympy.Add):
        # A product, a power or a relation keeps what can be read of it.
        parts = expression.func(*(abridged(arg) for arg in expression.args))
        if _size(parts) <= LARGEST:
            return parts
    return sympy.Symbol(f"[formula of {size} symbols]", real=True)


def _size(expression: Any) -> int:
    """Symbols and numbers in it."""
    return sum(1 for q in sympy.preorder_traversal(expression) if not getattr(q, "args", ()))


def written(expression: Any, decimals: bool) -> Any:
    """The expression with its fractions as they are to be printed."""
    if isinstance(expression, Select):
        sign, plus, minus = expression.args
        expression = sympy.Piecewise((plus, sign > 0), (minus, True))
    expression = _shortened(expression)
    if isinstance(expression, sympy.Rational) and not expression.is_Integer:
        return _number(expression, decimals)
    if isinstance(expression, sympy.Float):
        return sympy.Float(expression, LONGEST)
    args = getattr(expression, "args", ())
    if not args:
        return expression
    # Exponents stay: a root is no decimal power.
    if isinstance(expression, sympy.Pow):
        done = [written(args[0], decimals), args[1] if args[1].is_number else written(args[1], decimals)]
    else:
        done = [written(arg, decimals) for arg in args]
    return expression if all(a is b for a, b in zip(done, args, strict=True)) else expression.func(*done)


def _shortened(e: Expr) -> Expr:
    """A quotient with the whole content of its denominator divided out, where its numbers are long."""
    if not isinstance(e, Expr) or not any(len(str(abs(int(q)))) > LONGEST for q in e.atoms(sympy.Integer)):
        return e
    above, below = sympy.fraction(sympy.together(e))
    content, rest = below.as_content_primitive()
    return sympy.expand(above / content) / rest


def _number(q: sympy.Rational, decimals: bool) -> Expr:
    if decimals and _ends(q):
        digits = len(str(abs(q.p) * 10 ** len(str(q.q)) // q.q))
        return sympy.Float(q, max(digits, 15))
    return sympy.Float(q, LONGEST) if _is_long(q) else q


def _ends(q: sympy.Rational) -> bool:
    """Whether its decimals end."""
    rest = q.q
    for prime in (2, 5):
        while rest % prime == 0:
            rest //= prime
    return bool(rest == 1)


def _is_long(q: sympy.Rational) -> bool:
    return max(len(str(abs(q.p))), len(str(q.q))) > LONGEST


@dataclass(frozen=True)
class Printer:
    """How formulas are printed: as plain text, or as LaTeX without dollar signs."""

    decimals: bool
    tex: bool

    def __call__(self, expression: Any) -> str:
        """The text of one."""
        shown = written(abridged(expression), self.decimals)
        if not self.tex:
            return str(sympy.sstr(shown, full_prec=False))
        names = {q: tex_name(str(q)) for q in getattr(shown, "free_symbols", ())}
        return str(latex(shown, symbol_names=names, full_prec=False))

    def rounds(self, expression: Any) -> bool:
        """Whether a fraction in it is given to 10 digits."""
        fractions = [q for q in _shortened(abridged(expression)).atoms(sympy.Rational) if not q.is_Integer]
        return any(_is_long(q) and not (self.decimals and _ends(q)) for q in fractions)


def plain(decimals: bool) -> Printer:
    """The printer of plain text."""
    return Printer(decimals, tex=False)


def tex(decimals: bool) -> Printer:
    """The printer of LaTeX, without dollar signs."""
    return Printer(decimals, tex=True)


def tex_name(name: str) -> str:
    """A name in LaTeX: a letter, Greek if it is one, with the rest as subscript."""
    if name.startswith("["):
        return rf"[\mathrm{{formula\ of}}\ {name.split()[2]}\ \mathrm{{symbols}}]"
    head, *parts = [part for part in name.split("_") if part] or [name]
    first = re.fullmatch(r"([^\W\d_]+?)(\d*)", head)
    if first is None:
        return rf"\mathrm{{{_roman(name)}}}"
    letters, digits = first.groups()
    subscripts = [digits] if digits else []
    if letters.lower() in _GREEK:
        letter = tex_greek_dictionary.get(letters) or translate(letters)
    elif len(letters) == 1:
        letter = letters
    else:
        letter, subscripts = letters[0], [letters[1:] + digits]
    subscripts += parts
    if not subscripts:
        return str(letter)
    text = ",".join(q if q.isdigit() or len(q) == 1 else rf"\mathrm{{{_roman(q)}}}" for q in subscripts)
    return f"{letter}_{{{text}}}"


def _roman(text: str) -> str:
    return text.replace("_", r"\_")
