"""Nonlinear systems of python-control by what their functions make of symbols, numbers as parameters."""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from typing import Any

import numpy as np
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.given import as_float
from filippov.interop.wiring import Block, identifier
from filippov.model.check import as_expression
from filippov.model.parameter import Parameter
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.symbols import t

# At these values besides its own a parameter has to say the same as a symbol and as a number: functions ask
# for 0, 1, 2 ... by ==, which is False for every symbol, or by `is None`.
PROBES = (0.0, 1.0, 2.0, 3.0, -1.0, 0.37, 20.0)


class Params:
    """The symbols of numbers in params, one for each name and value, over all blocks of a diagram.

    Of two blocks with one name python-control takes the last one's value for both.


    taken   names of the system that no parameter may have
    """

    def __init__(self, taken: set[str]) -> None:
        self.taken = taken
        self.made: dict[str, ParameterSymbol] = {}

    def symbol(self, block: str, label: str, value: float) -> Symbol | None:
        """The parameter under its label, or block_label where that means something else; None: there is none.
        """
        for name in (label, f"{identifier(block)}_{label}"):
            known = self.made.get(name)
            if known is not None and known.parameter.default == value:
                return known
            usable = name.isidentifier() and not keyword.iskeyword(name) and name not in self.taken
            if known is None and usable:
                # After the parameters in what the user gives for inputs, which count from 0.
                self.made[name] = ParameterSymbol(name, Parameter(value), 1000 + len(self.made))
                return self.made[name]
        return None


class Asked:
    """A nonlinear system with symbols for its state x and its inputs u.

    params  as python-control gives them to its functions
    """

    def __init__(
        self, system: Any, u: tuple[Symbol, ...], x: tuple[Symbol, ...], params: Mapping[str, Any]
    ) -> None:
        self.system, self.u, self.x, self.params = system, u, x, params

    def block(self, name: str, found: Params) -> Block:
        """Its block: each number in params that its functions take as a symbol is a parameter."""
        kept: dict[str, Any] = {}
        best = self._ask(kept)
        for label, given in self.params.items():
            value = None if isinstance(given, bool | np.bool_) else as_float(given)
            if value is None or not np.isfinite(value) or not isinstance(label, str):
                continue
            symbol = found.symbol(name, label, value)
            tried = None if symbol is None else self._tried({**kept, label: symbol}, label, value)
            if tried is not None:
                kept[label], best = symbol, tried
        rates, outputs = best
        return Block(name, self.u, outputs, self.x, rates)

    def _tried(self, symbols: Mapping[str, Any], label: str, value: float) -> Any:
        """What it says with one more symbol; None where that is not what numbers say."""
        try:
            said = self._ask(symbols)
        except ModelError:
            return None
        values: dict[Any, Any] = dict.fromkeys([t, *self.x, *self.u])
        draw = np.random.default_rng(0)
        for number in (value, *PROBES):
            try:
                compared = self._ask({**symbols, label: number})
            except ModelError:  # a value that it does not take
                continue
            for symbol in values:
                values[symbol] = draw.uniform(0.2, 2.0)
            for symbol in symbols.values():
                values[symbol] = symbol.parameter.default
            values[symbols[label]] = number
            for one, other in zip(sum(said, ()), sum(compared, ()), strict=True):
                if not _same(one, other, values):
                    return None
        return said

    def _ask(self, symbols: Mapping[str, Any]) -> tuple[tuple[Expr, ...], tuple[Expr, ...]]:
        """Rates and outputs with symbols in place of some of the params."""
        system, params = self.system, {**self.params, **symbols}
        state, given = np.array(self.x, dtype=object), np.array(self.u, dtype=object)

        def ask(function: Any, what: str, count: int) -> tuple[Expr, ...]:
            try:
                row = np.atleast_1d(np.asarray(function(t, state, given, params), dtype=object)).ravel()
                values = tuple(as_expression(q, f"{what} of {system.name!r}") for q in row)
            except Exception as error:
                raise ModelError(
                    f"{what} of {system.name!r} does not take symbols ({type(error).__name__}: {error}). "
                    "Write it with arithmetic and functions of numpy, or use a block of filippov.interop."
                ) from error
            if len(values) != count:
                raise ModelError(f"{what} of {system.name!r} gives {len(values)} values, expected {count}.")
            return values

        rates = ask(system.updfcn, "updfcn", len(self.x)) if len(self.x) else ()
        if system.outfcn is None:
            return rates, tuple(self.x)
        return rates, ask(system.outfcn, "outfcn", system.noutputs)


def _same(one: Expr, other: Expr, values: Mapping[Any, Any]) -> bool:
    """Whether two expressions have one value there, or neither has any."""
    found = []
    for e in (one, other):
        try:
            found.append(float(e.xreplace({q: as_expression(v, "a probe") for q, v in values.items()})))
        except (TypeError, ValueError, OverflowError, ZeroDivisionError):
            found.append(np.nan)
    return bool(np.isclose(found[0], found[1], rtol=1e-9, atol=1e-12, equal_nan=True))
