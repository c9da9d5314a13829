"""A problem: a system with initial state, time span and parameter values; re-made, never edited."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from filippov.errors import UsageError
from filippov.names import check_known
from filippov.options import check_span, check_state
from filippov.system import System


class Problem:
    """x' in F(t, x; p), x(t0) = x0, t in [t0, t1]; immutable.

    x0          one number a state, in order or by name
    t_span      (t0, t1), finite
    parameters  values by name; the others keep their defaults

    Raises UsageError, ModelError.
    """

    __slots__ = ("p", "parameters", "system", "t_span", "x0")

    system: System
    x0: npt.NDArray[np.float64]
    t_span: tuple[float, float]
    parameters: Mapping[str, float]
    p: npt.NDArray[np.float64]

    def __init__(
        self, system: System, x0: Any, t_span: Any, parameters: Mapping[str, float] | None = None
    ) -> None:
        if not isinstance(system, System):
            raise UsageError(f"Problem was given {type(system).__name__}, expected a System.")
        state = check_state(x0, system)
        state.flags.writeable = False
        p = system.parameters.resolve(parameters)
        p.flags.writeable = False
        values = {
            "system": system,
            "x0": state,
            "t_span": check_span(t_span),
            "parameters": dict(zip(system.parameters.names, p.tolist(), strict=True)),
            "p": p,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a Problem is immutable; use remake({name}=...).")

    def __repr__(self) -> str:
        return f"Problem({self.system!r}, x0={self.x0.tolist()}, t_span={self.t_span})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Problem, (self.system, self.x0, self.t_span, dict(self.parameters))

    def remake(self, **changes: Any) -> Problem:
        """The same problem with some of system, x0, t_span, parameters replaced; parameters by name."""
        check_known("part of a problem", changes, ("system", "x0", "t_span", "parameters"), UsageError)
        system = changes.get("system", self.system)
        parameters = {k: v for k, v in self.parameters.items() if k in system.parameters}
        parameters |= changes.get("parameters", {})
        return Problem(system, changes.get("x0", self.x0), changes.get("t_span", self.t_span), parameters)
