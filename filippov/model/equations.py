"""Equations as a user writes them, checked: one per state, or one vector field for each vector of signs."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.names import state_names
from filippov.base.symbolic_value import single
from filippov.model.check import as_expression
from filippov.model.parameter_symbol import ParameterNamespace, ParameterSymbol
from filippov.model.surface import Surface
from filippov.model.symbolic import Select


def read_namespace(parameters: Any) -> ParameterNamespace | None:
    """The declared parameters, or None where they are left out. Raises ModelError for anything else."""
    if parameters is None or isinstance(parameters, ParameterNamespace):
        return parameters
    raise ModelError(
        f"parameters are {parameters!r}, expected the object that parameters(...) returned, because the "
        "equations hold "
        "its symbols. It may be left out."
    )


def read_equations(equations: Any, states: Any) -> dict[Symbol, Expr]:
    """Return checked equations, in the order of `states` where given."""
    if not isinstance(equations, Mapping):
        how = " A function goes with System(field=f, states='x v')." if callable(equations) else ""
        raise ModelError(f"equations are {equations!r}, expected a dict {{x: dx/dt, v: dv/dt}}.{how}")
    if not equations:
        raise ModelError("there is no equation, expected at least one: System({x: ...}).")
    out: dict[Symbol, Expr] = {}
    for given, value in equations.items():
        symbol = single(given)
        if not isinstance(symbol, Symbol) or isinstance(symbol, ParameterSymbol):
            raise ModelError(
                f"an equation is given for {symbol!r} ({type(symbol).__name__}), expected a state. "
                "Make the states with x, v = states('x v')."
            )
        state_names([symbol])
        if symbol != Symbol(symbol.name, real=True):
            raise ModelError(
                f"the state {symbol.name!r} is not the real symbol of this name. Make the states with "
                f"states({symbol.name!r})."
            )
        out[symbol] = as_expression(value, f"the equation of {symbol.name!r}")
    if states is None:
        return out
    order = state_names(states)
    by_name = {symbol.name: symbol for symbol in out}
    for name in order:
        if name not in by_name:
            raise ModelError(f"state {name!r} has no equation. Add one: {{..., {name}: ...}}.")
    for name in by_name:
        if name not in order:
            raise ModelError(
                f"there is an equation for {name!r}, which states={' '.join(order)!r} does not name. Add it "
                "there, or leave states out."
            )
    return {by_name[name]: out[by_name[name]] for name in order}


def read_modes(fields: Any, k: int, symbols: tuple[Symbol, ...]) -> dict[tuple[int, ...], list[Expr]]:
    """Return one list of expressions for each of the 2^k sign vectors."""
    if not isinstance(fields, Mapping):
        raise ModelError(
            f"fields are {fields!r}, expected a dict from sign vectors such as '+-' to vector fields."
        )
    signs = {"+": (1,), "-": (-1,), "*": (1, -1), 1: (1,), -1: (-1,)}
    out: dict[tuple[int, ...], list[Expr]] = {}
    for key, value in fields.items():
        entries = list(key) if isinstance(key, (str, tuple)) else [key]
        if len(entries) != k or any(e not in signs for e in entries):
            raise ModelError(
                f"fields holds the sign vector {key!r}, expected {k} entries, each '+', '-' or '*' (either)."
            )
        if isinstance(value, Mapping):
            missing = [x.name for x in symbols if x not in value]
            if missing or len(value) != len(symbols):
                raise ModelError(
                    f"field {key!r}: expected one equation for each of {', '.join(map(str, symbols))}."
                )
            row: Any = [value[x] for x in symbols]
        else:
            row = value
        if not isinstance(row, Sequence) or isinstance(row, str) or len(row) != len(symbols):
            raise ModelError(
                f"field {key!r} is {value!r}, expected {len(symbols)} expressions, one for each of "
                f"{', '.join(map(str, symbols))}."
            )
        exprs = [
            as_expression(e, f"field {key!r}, the equation of {x.name!r}")
            for x, e in zip(symbols, row, strict=True)
        ]
        for vector in itertools.product(*(signs[e] for e in entries)):
            if vector in out:
                raise ModelError(
                    f"fields holds the sign vector {_text(vector)!r} twice (by {key!r}): give it one field."
                )
            out[vector] = exprs
    missing_modes = [_text(v) for v in itertools.product((1, -1), repeat=k) if v not in out]
    if missing_modes:
        raise ModelError(
            f"fields has no entry for {', '.join(missing_modes)}. Give one for every sign vector; '*' "
            "stands for either "
            "sign, also where a combination cannot occur."
        )
    return out


def _text(vector: Sequence[int]) -> str:
    return "".join("+" if m > 0 else "-" for m in vector)


def by_mode(
    surfaces: Sequence[Surface], table: Mapping[tuple[int, ...], list[Expr]], known: tuple[int, ...], i: int
) -> Expr:
    """The equation of state i as branches on the signs of the surfaces, those before `len(known)` known."""
    if len(known) == len(surfaces):
        return table[known][i]
    plus, minus = (by_mode(surfaces, table, (*known, m), i) for m in (1, -1))
    return Select(surfaces[len(known)].h, plus, minus)
