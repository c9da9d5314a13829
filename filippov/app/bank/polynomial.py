"""A case that is a polynomial: its coefficients from text, highest power first."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.routh_hurwitz import RouthHurwitz, routh_hurwitz
from filippov.app.bank.notation import formula
from filippov.base.errors import ModelError
from filippov.base.names import check_name
from filippov.model.expression import FUNCTIONS

_WORD = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True)
class Polynomial:
    """a_0 s^n + ... + a_n with real parameters.

    names   what stands for the parameters: their symbols
    budget  seconds for its analysis
    """

    coefficients: tuple[Expr, ...]
    names: Mapping[str, Any]
    budget: float

    @cached_property
    def routh(self) -> RouthHurwitz:
        """Its Routh-Hurwitz analysis."""
        return routh_hurwitz(list(self.coefficients), budget=self.budget)

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """The parameters, by name."""
        return tuple(self.names[name] for name in sorted(self.names) if isinstance(self.names[name], Symbol))

    def at(self, values: Mapping[str, Expr]) -> Polynomial:
        """The polynomial with numbers in the place of parameters."""
        chosen = {self.names[name]: value for name, value in values.items()}
        return Polynomial(tuple(c.subs(chosen) for c in self.coefficients), {}, self.budget)

    def roots(self) -> list[complex]:
        """All roots with their multiplicity, to double precision. Raises ModelError with parameters left."""
        s = Symbol("s")
        if any(c.free_symbols for c in self.coefficients):
            raise ModelError("the polynomial has parameters that are not given")
        whole = sympy.Poly(
            [sympy.nsimplify(c, rational=True) if c.is_Float else c for c in self.coefficients], s
        )
        # Repeated roots are found one by one: numerically they are worth a fraction of the digits.
        found: list[complex] = []
        for factor, multiplicity in whole.sqf_list()[1]:
            for root in sympy.Poly(factor, s).nroots(n=30, maxsteps=500):
                found += [complex(root)] * multiplicity
        return found


def read_polynomial(raw: Mapping[str, Any], budget: float) -> Polynomial:
    """The polynomial of a case: `polynomial` is the list of its coefficients. Raises ModelError."""
    given = raw["polynomial"]
    if isinstance(given, str) or not isinstance(given, Sequence) or not given:
        raise ModelError(f"polynomial is {given!r:.60}, expected the list of its coefficients.")
    texts = [value if isinstance(value, str) else repr(value) for value in given]
    words = itertools.chain.from_iterable(_WORD.findall(text) for text in texts)
    names: dict[str, Any] = {}
    for word in words:
        if word not in FUNCTIONS and word not in ("pi", "t", "e", "E") and not re.fullmatch(r"[eE]\d*", word):
            names[check_name(word, "parameter")] = Symbol(word, real=True)
    for key, value in (raw.get("params") or {}).items():
        names[check_name(key, "parameter")] = formula(str(value), names)
    return Polynomial(tuple(formula(text, names) for text in texts), names, budget)
