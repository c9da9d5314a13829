"""A section: where an event map starts from a number and where it reads the next one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from filippov.errors import ModelError, UsageError
from filippov.events import STOP_KINDS, Stop
from filippov.expression import parse_expression
from filippov.names import unknown
from filippov.system import System

Array = npt.NDArray[np.float64]
# A Dummy: a parameter of the system may be called d as well.
D = sympy.Dummy("d", real=True)


@dataclass(frozen=True)
class Section:
    """The events of one kind on one surface, with one state as coordinate on it.

    surface, kind  the event that ends a turn of the map (as in `Stop`)
    coordinate     name of the state that is read there
    lift           where a turn starts for a coordinate d: an expression a state (sympy or text) in `d` and
                   the parameters, or a function (d, p) -> x0 with p by name
    t_max          longest time of a turn; a motion that takes longer does not return

    Raises UsageError, ModelError.
    """

    surface: str
    kind: str
    coordinate: str
    lift: Mapping[str, Any] | Callable[..., Any] = field(hash=False)
    t_max: float = 100.0

    def __post_init__(self) -> None:
        if self.kind not in STOP_KINDS:
            raise UsageError(unknown("kind of event", self.kind, STOP_KINDS))
        if not self.t_max > 0:
            raise UsageError(f"Section: t_max is {self.t_max}, expected a number > 0.")

    @classmethod
    def from_model(cls, model: Any) -> Section:
        """The section a registered model proposes; its `section` is plain data."""
        data = getattr(model, "section", None)
        if data is None:
            raise UsageError(
                f"model {model.name!r} proposes no section; give Section(surface, kind, coordinate, lift)."
            )
        return cls(data.surface, data.kind, data.coordinate, data.lift, data.t_max)

    @property
    def stop(self) -> Stop:
        """The terminal event of a turn."""
        return Stop(self.surface, self.kind)

    def bind(self, system: System) -> BoundSection:
        """The section on a system: names checked, the lift compiled to numpy with its derivative."""
        names = [surface.name for surface in system.surfaces]
        if self.surface not in names:
            raise UsageError(unknown("surface", self.surface, names))
        if self.coordinate not in system.states:
            raise UsageError(unknown("state", self.coordinate, system.states))
        return BoundSection(self, system)


class BoundSection:
    """A section on one system."""

    def __init__(self, section: Section, system: System) -> None:
        self.section, self.system = section, system
        self.index = system.state_index(section.coordinate)
        self.surface = system.surface_index(section.surface)
        self._functions: tuple[Callable[..., Any], Callable[..., Any]] | None = None
        if not callable(section.lift):
            self._functions = self._compile(section.lift)

    def _compile(self, lift: Mapping[str, Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
        symbols: dict[str, sympy.Symbol] = {
            name: sympy.Symbol(name, real=True) for name in self.system.parameters
        }
        missing = [name for name in self.system.states if name not in lift]
        if missing:
            raise UsageError(
                f"the lift has no expression for state {', '.join(missing)}; give one for every state."
            )
        for name in lift:
            if name not in self.system.states:
                raise UsageError(unknown("state", name, self.system.states))
        names: dict[str, Any] = {**symbols, "d": D}
        rows = []
        for state in self.system.states:
            value = lift[state]
            expression = parse_expression(value, names) if isinstance(value, str) else sympy.S(value)
            expression = expression.xreplace(
                {s: names[s.name] for s in expression.free_symbols if s.name in names}
            )
            extra = expression.free_symbols - set(names.values())
            if extra:
                raise ModelError(
                    f"the lift of {state!r} holds {sorted(map(str, extra))}, expected d and parameters of "
                    "the system."
                )
            rows.append(expression)
        arguments = [D, *symbols.values()]
        # sign(d) is constant where the derivative is taken.
        slopes = [row.diff(D).subs(sympy.DiracDelta(D), 0) for row in rows]
        return sympy.lambdify(arguments, rows, "numpy"), sympy.lambdify(arguments, slopes, "numpy")

    def start(self, d: Array, p: Array) -> Array:
        """Initial states for coordinates d (k,) and parameter rows p (k, P) or (P,): (k, n)."""
        values = np.atleast_1d(np.asarray(d, dtype=float))
        if self._functions is not None:
            return self._stack(self._functions[0], values, p)
        rows = np.broadcast_to(p, (values.size, p.shape[-1]))
        lift: Any = self.section.lift
        out = [
            lift(float(v), self.system.parameters.record(row)) for v, row in zip(values, rows, strict=True)
        ]
        return np.array(out, dtype=float).reshape(values.size, self.system.dimension)

    def start_slope(self, d: float, p: Array) -> Array:
        """Derivative of the initial state by d: (n,). A lift given as a function is differenced."""
        if self._functions is not None:
            return np.asarray(self._stack(self._functions[1], np.array([d]), p)[0])
        reach = 1e-6 * max(abs(d), 1e-3)
        pair = self.start(np.array([d + reach, d - reach]), p)
        return np.asarray((pair[0] - pair[1]) / (2 * reach))

    def start_change(self, d: float, p: Array, names: tuple[str, ...]) -> Array:
        """Derivative of (initial state, parameters, t) by d and the named parameters: (N, 1 + names)."""
        n = self.system.dimension
        out = np.zeros((n + len(names) + 1, 1 + len(names)))
        out[:n, 0] = self.start_slope(d, p)
        for k, name in enumerate(names):
            i = self.system.parameters.index(name)
            reach = 1e-4 * max(abs(float(p[i])), 1e-3)
            rows = np.tile(p, (4, 1))
            rows[:, i] += reach * np.array([-2.0, -1.0, 1.0, 2.0])
            moved = self.start(np.full(4, d), rows)
            out[:n, 1 + k] = np.array([1.0, -8.0, 8.0, -1.0]) @ moved / (12.0 * reach)
            out[n + k, 1 + k] = 1.0
        return out

    def _stack(self, function: Callable[..., Any], d: Array, p: Array) -> Array:
        out = np.empty((d.size, self.system.dimension))
        for place, column in enumerate(function(d, *p.T)):
            out[:, place] = column
        return out
