"""Parameters as symbols of expressions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NoReturn, Self

import sympy

from filippov.base.errors import ModelError
from filippov.base.names import check_name, unknown
from filippov.model.parameter import Declaration, Parameter, as_parameter


class ParameterSymbol(sympy.Symbol):
    """A real sympy symbol that carries its Parameter and its place in the declaration.

    Both belong to the identity of the symbol: two symbols of one name and different defaults are different
    objects to sympy's caches. The sign that the bounds imply is among its assumptions.
    """

    __slots__ = ("parameter", "position")
    parameter: Parameter
    position: int

    def __new__(cls, name: str, parameter: Parameter, position: int = 0) -> Self:
        """Make the symbol; `position` is its place in the declaration."""
        assumptions: dict[str, bool] = {"real": True}
        if parameter.lower is not None and parameter.lower >= 0:
            assumptions["positive" if parameter.lower > 0 else "nonnegative"] = True
        if parameter.upper is not None and parameter.upper <= 0:
            assumptions["negative" if parameter.upper < 0 else "nonpositive"] = True
        symbol: Self = sympy.Symbol.__xnew__(cls, name, **assumptions)
        symbol.parameter = parameter
        symbol.position = position
        return symbol

    def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        return (self.name, self.parameter, self.position), {}

    def _hashable_content(self) -> tuple[Any, ...]:
        content = super()._hashable_content()
        return (*content, f"{self.position} {self.parameter!r}")


class ParameterNamespace(Declaration):
    """What `parameters(...)` returns: the symbols by attribute (p.m), by name (p["m"]) and in order."""

    __slots__ = ()
    _symbols: dict[str, ParameterSymbol]

    def __init__(self, symbols: Mapping[str, ParameterSymbol]) -> None:
        object.__setattr__(self, "_symbols", dict(symbols))

    def __getattr__(self, name: str) -> ParameterSymbol:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._symbols[name]
        except KeyError:
            raise AttributeError(unknown("parameter", name, self._symbols)) from None

    def __getitem__(self, name: str) -> ParameterSymbol:
        try:
            return self._symbols[name]
        except KeyError:
            raise KeyError(unknown("parameter", name, self._symbols)) from None

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(
            f"parameters are declared once: write parameters({name}=...), or give the value to the run."
        )

    def __iter__(self) -> Iterator[ParameterSymbol]:
        return iter(self._symbols.values())

    def __len__(self) -> int:
        return len(self._symbols)

    def __contains__(self, name: object) -> bool:
        return name in self._symbols

    def __dir__(self) -> list[str]:
        return list(self._symbols)

    def __repr__(self) -> str:
        return "parameters(" + ", ".join(f"{s.name}={s.parameter.default:g}" for s in self) + ")"

    def __reduce__(self) -> tuple[Any, ...]:
        return ParameterNamespace, (self._symbols,)


def parameters(*unnamed: object, **values: object) -> ParameterNamespace:
    """Declare the parameters of a model: parameters(m=1, beta=Parameter(2, lower=0)).

    Each value is a default (a finite real number) or a Parameter. Raises ModelError for a name that is no
    identifier or a keyword, and for a value that is not a finite real number.
    """
    if unnamed:
        raise ModelError(
            f"parameters was given {unnamed[0]!r} without a name, expected names: parameters(m=1, k=2); of a "
            "dict parameters(**{'m': 1})."
        )
    symbols: dict[str, ParameterSymbol] = {}
    for position, (given, value) in enumerate(values.items()):
        name = check_name(given, "parameter")
        symbols[name] = ParameterSymbol(name, as_parameter(name, value), position)
    return ParameterNamespace(symbols)
