"""A section: where an event map starts for a coordinate, and where it reads the next one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import sympy

from filippov import ModelError, System, UsageError
from filippov.analysis.maps.coordinate import Coordinate
from filippov.base.arrays import Array
from filippov.base.keywords import constructor
from filippov.base.names import unknown
from filippov.base.status import JUMPED_OVER, no_kind
from filippov.model.expression import parse_expression
from filippov.solving.state.events import STOP_KINDS, Event, Stop, turned

# A Dummy: a parameter of the system may be called d as well.
D = sympy.Dummy("d", real=True)


@constructor(same={"lift": "parametrisation"})
@dataclass(frozen=True)
class Section:
    """The events of one kind on a surface (or several), with a number as coordinate on them.

    surface, kind  the event that is a return of the map (as in `Stop`); several surfaces with commas between.
                   A surface is named, or given by the formula of its h in either orientation
    coordinate     what is read there: the name of a state, or a formula in states (sympy or text). At a
                   "reset" that is the state after it: the speed with which a ball leaves the ground
    parametrisation
                   the state at coordinate d, where a solution starts: an expression per state (sympy or text)
                   in `d` and the parameters, or a function (d, p) -> x0 with p by name; None: one solution is
                   followed from an initial state (`filippov.analysis.maps.returns`). `lift` is taken as well
    t_max          longest time of a return; a solution that takes longer does not return
    after          mode after the event, such as "0" or "+0" with * for any sign, one per surface:
                   other events are not returns; "": any. For systems that do not depend on time

    Raises UsageError, ModelError.
    """

    _write: ClassVar[str] = (
        ": Section('v', 'sliding entry', 'x', {'x': 'd', 'v': '0'}), Section.from_model(model), or "
        "find_section(system, x0)"
    )

    surface: str
    kind: str
    coordinate: Any
    parametrisation: Mapping[Any, Any] | Callable[..., Any] | None = field(default=None, hash=False)
    t_max: float = 100.0
    after: str = ""

    def __post_init__(self) -> None:
        if self.kind not in STOP_KINDS:
            raise UsageError(no_kind(self.kind, STOP_KINDS))
        if not self.t_max > 0:
            raise UsageError(f"Section: t_max is {self.t_max}, expected a number > 0.")
        if set(self.after) - set("+0-*"):
            raise UsageError(f"Section: after is {self.after!r}, expected signs +, 0, - or * for any.")

    @classmethod
    def from_model(cls, model: Any) -> Section:
        """The section a registered model proposes; its `section` is plain data."""
        data = getattr(model, "section", None)
        if data is None:
            raise UsageError(
                f"model {model.name!r} proposes no section; give Section(surface, kind, "
                "coordinate, parametrisation)."
            )
        return cls(data.surface, data.kind, data.coordinate, data.parametrisation, data.t_max, data.after)

    @property
    def lift(self) -> Mapping[str, Any] | Callable[..., Any] | None:
        """`parametrisation` under its earlier name."""
        return self.parametrisation

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Names of the surfaces."""
        return tuple(name.strip() for name in self.surface.split(","))

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The events of which one is the return, one per surface."""
        return tuple(Stop(name, self.kind) for name in self.surfaces)

    @property
    def stop(self) -> Stop | tuple[Stop, ...]:
        """The event, or events, of which one is the return."""
        return self.stops[0] if len(self.stops) == 1 else self.stops

    def to_dict(self) -> dict[str, Any]:
        """Where it is and what is read there, as plain data."""
        return {"surface": self.surface, "kind": self.kind, "coordinate": str(self.coordinate),
                "after": self.after}  # fmt: skip

    def bind(self, system: System) -> BoundSection:
        """The section on a system: names checked, parametrisation and derivative compiled to numpy."""
        names = system.surface_names
        try:
            places = [system.surface_place(name) for name in self.surfaces]
        except ModelError as error:
            raise UsageError(str(error)) from None
        if self.after and len(self.after) != len(names):
            raise UsageError(
                f"Section: after is {self.after!r}, expected {len(names)} signs, for {', '.join(names)}."
            )
        kinds = {self.kind if sense > 0 else turned(self.kind) for _, sense in places}
        if len(kinds) > 1:
            raise UsageError(
                f"Section: {self.surface!r} with kind {self.kind!r} means {' and '.join(sorted(kinds))} on "
                f"{', '.join(names)}; expected one kind. Write every surface by its name."
            )
        if "sliding" in self.kind:
            for place, _ in places:
                if system.surfaces[place].width != 0:
                    raise UsageError(
                        f"Section: {names[place]!r} has a hysteresis, on which no solution slides, so no "
                        f"{self.kind!r} ever comes. Take kind 'crossing', 'crossing up' or 'crossing down'."
                    )
        surface = ", ".join(names[place] for place, _ in places)
        return BoundSection(replace(self, surface=surface, kind=kinds.pop()), system)


class BoundSection:
    """A section on one system."""

    def __init__(self, section: Section, system: System) -> None:
        self.section, self.system = section, system
        self.surfaces = [system.surface_index(name) for name in section.surfaces]
        self._coordinate = Coordinate(section.coordinate, system)
        self._functions: tuple[Callable[..., Any], Callable[..., Any]] | None = None
        given = section.parametrisation
        if given is not None and not callable(given):
            # Sections are bound again and again: to systems that differ in numbers, by every search.
            named = tuple((getattr(state, "name", state), value) for state, value in given.items())
            self._functions = _compiled(named, tuple(system.states), tuple(system.parameters))

    @property
    def index(self) -> int:
        """Place of the state that is the coordinate. Raises UsageError where it is a formula."""
        return self._coordinate.index

    @property
    def surface(self) -> int:
        """Place of the one surface. Raises UsageError where a mode is asked for or there are several."""
        if len(self.surfaces) > 1 or self.section.after:
            raise UsageError(
                "the section has several surfaces or asks for a mode after the event; expected one surface "
                "and any mode."
            )
        return self.surfaces[0]

    def wanted(self, mode: Sequence[int]) -> bool:
        """Whether the mode after an event makes it a return."""
        signs = {"+": 1, "0": 0, "-": -1}
        return all(a == "*" or signs[a] == m for a, m in zip(self.section.after, mode, strict=False))

    def ending(self, events: Sequence[Event]) -> Event:
        """The section's event at which a run ended: what a reset jumps over may stand behind it."""
        kind = self.section.kind
        own = (e for e in reversed(events) if e.index in self.surfaces and kind.startswith(str(e.kind)))
        return next(own, events[-1])

    def cause(self, events: Sequence[Event]) -> Event:
        """The event at which a run ended on the section, or the reset that took the state over it there."""
        found = self.ending(events)
        if found.note != JUMPED_OVER:
            return found
        return next((e for e in events if e.group == found.group and e.note != JUMPED_OVER), found)

    def read(self, x: Array) -> Array:
        """The coordinate of states (k, n): (k,)."""
        return self._coordinate.read(x)

    def slope(self, x: Array) -> Array:
        """Derivative of the coordinate by the states at x (n,): (n,)."""
        return self._coordinate.slope(x)

    def start(self, d: Array, p: Array) -> Array:
        """Initial states for coordinates d (k,) and parameter rows p (k, P) or (P,): (k, n)."""
        given: Any = self.section.parametrisation
        if given is None:
            wanted = ", ".join(f"{name!r}: ..." for name in self.system.states)
            raise UsageError(
                "the section has no parametrisation, so no solution starts from a coordinate. Give "
                f"Section(..., parametrisation={{{wanted}}}), or start from a state: returns(system, "
                "section, x0, count), brute_force(..., start=x0), bifurcation(..., x0=x0)."
            )
        values = np.atleast_1d(np.asarray(d, dtype=float))
        if self._functions is not None:
            return self._stack(self._functions[0], values, p)
        rows = np.broadcast_to(p, (values.size, p.shape[-1]))
        out = [
            given(float(v), self.system.parameters.record(row)) for v, row in zip(values, rows, strict=True)
        ]
        return np.array(out, dtype=float).reshape(values.size, self.system.dimension)

    def start_slope(self, d: float, p: Array) -> Array:
        """Derivative of the initial state by d: (n,). A function is differenced."""
        if self._functions is not None:
            return np.asarray(self._stack(self._functions[1], np.array([d]), p)[0])
        reach = 1e-6 * (abs(d) or 1e-3)
        pair = self.start(np.array([d + reach, d - reach]), p)
        return np.asarray((pair[0] - pair[1]) / (2 * reach))

    def start_change(self, d: float, p: Array, names: tuple[str, ...]) -> Array:
        """Derivative of (initial state, parameters, t) by d and the named parameters: (N, 1 + names)."""
        n = self.system.dimension
        out = np.zeros((n + len(names) + 1, 1 + len(names)))
        out[:n, 0] = self.start_slope(d, p)
        for k, name in enumerate(names):
            i = self.system.parameters.index(name)
            reach = 1e-4 * (abs(float(p[i])) or 1e-3)
            rows = np.tile(p, (4, 1))
            rows[:, i] += reach * np.array([-2.0, -1.0, 1.0, 2.0])
            moved = self.start(np.full(4, d), rows)
            out[:n, 1 + k] = np.array([1.0, -8.0, 8.0, -1.0]) @ moved / (12.0 * reach)
            out[n + k, 1 + k] = 1.0
        return out

    def _stack(self, function: Callable[..., Any], d: Array, p: Array) -> Array:
        if d.size == 1:
            # Plain numbers cost a tenth of arrays of one. Where they have no value, arrays do as numpy does.
            try:
                row = p if p.ndim == 1 else p.reshape(-1)
                return np.array([function(d.item(), *row.tolist())], dtype=float)
            except (ArithmeticError, TypeError, ValueError):
                pass
        out = np.empty((d.size, self.system.dimension))
        for place, column in enumerate(function(d, *p.T)):
            out[:, place] = column
        return out


@lru_cache(maxsize=64)
def _compiled(
    given: tuple[tuple[str, Any], ...], states: tuple[str, ...], parameters: tuple[str, ...]
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The initial state for (d, parameters), and its derivative by d, in numpy."""
    formulas, symbols = dict(given), {name: sympy.Symbol(name, real=True) for name in parameters}
    for name in formulas:
        if name not in states:
            raise UsageError(f"the parametrisation: {unknown('state', name, states)}")
    missing = [name for name in states if name not in formulas]
    if missing:
        raise UsageError(
            f"the parametrisation has no expression for state {', '.join(missing)}; give one for every state."
        )
    names: dict[str, Any] = {**symbols, "d": D}
    rows = []
    for state in states:
        value = formulas[state]
        expression = parse_expression(value, names) if isinstance(value, str) else sympy.S(value)
        expression = expression.xreplace(
            {s: names[s.name] for s in expression.free_symbols if s.name in names}
        )
        extra = expression.free_symbols - set(names.values())
        if extra:
            raise ModelError(
                f"the parametrisation of {state!r} holds {sorted(map(str, extra))}, expected d and "
                "parameters of the system."
            )
        rows.append(expression)
    arguments = [D, *symbols.values()]
    # sign(d) is constant where the derivative is taken.
    slopes = [row.diff(D).subs(sympy.DiracDelta(D), 0) for row in rows]
    return sympy.lambdify(arguments, rows, "numpy"), sympy.lambdify(arguments, slopes, "numpy")
