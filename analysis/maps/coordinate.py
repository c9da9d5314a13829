"""What is read on a section: a state, or a formula in states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy

from filippov import ModelError, System, UsageError
from filippov.base.arrays import Array
from filippov.model.expression import parse_expression


class Coordinate:
    """The name of a state of a system, or a formula in states (sympy or text). Raises UsageError."""

    def __init__(self, text: Any, system: System) -> None:
        self.text, self.system = text, system
        self._read = None if text in system.states else self._formula(text)
        self._place = system.state_index(text) if self._read is None else -1

    @property
    def index(self) -> int:
        """Place of the state that is the coordinate. Raises UsageError where it is a formula."""
        if self._read is not None:
            raise UsageError(
                f"the section's coordinate is the formula {self.text!r}; expected one state, "
                f"of {', '.join(self.system.states)}."
            )
        return self._place

    def read(self, x: Array) -> Array:
        """The coordinate of states (k, n): (k,)."""
        if self._read is None:
            return np.array(x[:, self._place])
        return np.array(np.broadcast_to(self._read[0](*x.T), len(x)), dtype=float)

    def slope(self, x: Array) -> Array:
        """Derivative of the coordinate by the states at x (n,): (n,)."""
        if self._read is None:
            return np.asarray(np.eye(len(x))[self.index])
        return np.array([float(v) for v in self._read[1](*x)])

    def _formula(self, text: Any) -> tuple[Callable[..., Any], Callable[..., Any]]:
        names = {name: sympy.Symbol(name, real=True) for name in self.system.states}
        try:
            formula = parse_expression(text, names) if isinstance(text, str) else sympy.S(text)
        except ModelError as error:
            raise UsageError(
                f"the section's coordinate is {text!r}, expected a state or a formula in states: {error}"
            ) from None
        symbols = list(names.values())
        slopes = [formula.diff(q) for q in symbols]
        return sympy.lambdify(symbols, formula, "numpy"), sympy.lambdify(symbols, slopes, "numpy")
