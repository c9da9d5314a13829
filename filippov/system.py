"""A model: x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }, with names, parameters and surfaces."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

import sympy
from sympy import Expr, Symbol

from filippov.assemble import assemble
from filippov.check import as_expression
from filippov.comparator import Comparator, Exact, check_comparator
from filippov.errors import ModelError
from filippov.names import closest
from filippov.parameter import ParameterNamespace, ParameterSet, ParameterSymbol
from filippov.regularize import regularize_functions, regularize_symbolic
from filippov.surface import Surface
from filippov.symbolic import Select, SymbolicForm
from filippov.symbols import state_names
from filippov.time_event import TimeEvent

Field = Callable[..., Any]


class System:
    """x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }; immutable.

    From expressions, surfaces found in them:

        System({x: v, v: (-u - g*sign(v))/p.m})
        System({...}, surfaces=[Surface("velocity", v, radius=p.Fs/p.Fc)])  # names and sets for some of them

    From functions f(t, x, p, s) -> (n,) and h(t, x, p) -> float, which are kept as they are:

        System(field=f, surfaces=[Surface("velocity", h)], states="x v", parameters={"m": 1})

    With events at known times: time_events=[TimeEvent("clock", period=p.T, reset={ramp: 0})].

    From one vector field a sign vector (Filippov's form): System.from_modes. Raises ModelError.
    """

    __slots__ = (
        "_base", "_digest", "comparator", "field", "parameters", "states", "surfaces", "symbolic",
        "time_events",
    )  # fmt: skip

    states: tuple[str, ...]
    parameters: ParameterSet
    surfaces: tuple[Surface, ...]
    time_events: tuple[TimeEvent, ...]
    comparator: Comparator
    symbolic: SymbolicForm | None
    field: Field | None
    _base: System | None
    _digest: str | None

    def __init__(
        self,
        equations: Mapping[Symbol, object] | None = None,
        *,
        field: Field | None = None,
        surfaces: Sequence[Surface] = (),
        states: str | Sequence[str | Symbol] | None = None,
        parameters: Mapping[str, object] | ParameterNamespace | ParameterSet | None = None,
        time_events: Sequence[TimeEvent] = (),
    ) -> None:
        clocks = _clocks(time_events, symbolic=equations is not None)
        if (equations is None) == (field is None):
            raise ModelError(
                "a System is made from equations, System({x: ..., v: ...}), or from a function, "
                f"System(field=f, ...): {'neither was' if field is None else 'both were'} given."
            )
        if isinstance(surfaces, Surface):
            surfaces = (surfaces,)
        if equations is not None:
            checked = _equations(equations, states)
            form, found = assemble(checked, tuple(surfaces), _namespace(parameters), time_events=clocks)
            self._set_symbolic(form, found, clocks)
            return
        self._set_functions(field, surfaces, states, parameters, clocks)

    @classmethod
    def from_modes(
        cls,
        h: Sequence[Expr | Surface],
        fields: Mapping[Any, Any],
        states: Sequence[Symbol],
        *,
        parameters: ParameterNamespace | None = None,
        time_events: Sequence[TimeEvent] = (),
    ) -> System:
        """x' = f_m(t, x; p) where the signs of h_1 ... h_k are m, for every sign vector m: "++", "+-", ...

        h        expressions or Surfaces
        fields   from sign vectors (text or tuples of +-1; "*" stands for either sign) to one expression a
                 state, in order or as a dict
        Source: Filippov 1988, chapter 2, section 4.
        """
        symbols = tuple(states)
        surfaces = [g if isinstance(g, Surface) else Surface(str(g), g) for g in h]
        for surface in surfaces:
            if not surface.symbolic:
                raise ModelError(f"surface {surface.name!r}: h is a function, expected an expression.")
        table = _mode_fields(fields, len(surfaces), symbols)
        equations = {x: _by_mode(surfaces, table, (), i) for i, x in enumerate(symbols)}
        checked = _equations(equations, None)
        clocks = _clocks(time_events, symbolic=True)
        form, found = assemble(checked, surfaces, _namespace(parameters), spare=True, time_events=clocks)
        system = object.__new__(cls)
        system._set_symbolic(form, found, clocks)
        return system

    # -- construction ----------------------------------------------------------------------------------

    def _set_symbolic(
        self, form: SymbolicForm, surfaces: tuple[Surface, ...], clocks: tuple[TimeEvent, ...] = ()
    ) -> None:
        _check_clock_names(clocks, surfaces)
        self._set(
            time_events=clocks,
            states=tuple(x.name for x in form.x),
            parameters=ParameterSet({q.name: q.parameter for q in form.p}),
            surfaces=surfaces,
            symbolic=form,
            field=None,
        )

    def _set_functions(
        self, field: Any, surfaces: Any, states: Any, parameters: Any, clocks: tuple[TimeEvent, ...]
    ) -> None:
        if not callable(field):
            raise ModelError(f"field is {field!r}, expected a function f(t, x, p, s) that returns dx/dt.")
        if states is None:
            raise ModelError(
                "states are missing: System(field=f, ...) needs states='x v', the names in order."
            )
        names = state_names(states)
        values = ParameterSet(parameters)
        for name in values:
            if name in names:
                raise ModelError(f"{name!r} is both a state and a parameter. Rename one of them.")
        seen: dict[str, Surface] = {}
        for surface in surfaces:
            if not isinstance(surface, Surface):
                raise ModelError(f"surfaces holds {surface!r}, expected Surface('name', h).")
            if surface.symbolic or any(isinstance(bound, Expr) for bound in surface.radius):
                raise ModelError(
                    f"surface {surface.name!r}: h or radius is an expression, expected a function of (t, "
                    "x, p) or a "
                    "number, because the field is a function. Expressions go with System({x: ...})."
                )
            if surface.name in seen:
                raise ModelError(
                    f"two surfaces are named {surface.name!r}. Every surface needs its own name."
                )
            for other in seen.values():
                if other.h is surface.h:
                    raise ModelError(
                        f"surfaces {other.name!r} and {surface.name!r} are the same set: both have the "
                        "function "
                        f"{getattr(surface.h, '__name__', surface.h)!r}. Declare it once."
                    )
            seen[surface.name] = surface
        _check_clock_names(clocks, tuple(seen.values()))
        self._set(
            states=names,
            parameters=values,
            surfaces=tuple(seen.values()),
            time_events=clocks,
            symbolic=None,
            field=field,
        )

    def _set(self, **content: Any) -> None:
        for name, value in {"comparator": Exact(), "_base": None, "_digest": None, **content}.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a System is immutable: {name!r} cannot be set. Make another System.")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"a System is immutable: {name!r} cannot be deleted.")

    # -- content ---------------------------------------------------------------------------------------

    @property
    def dimension(self) -> int:
        """The number n of states."""
        return len(self.states)

    @property
    def exact(self) -> System:
        """The system as it was written, with the comparator Exact()."""
        return self if self._base is None else self._base

    @property
    def digest(self) -> str | None:
        """sha256 of the model as text (names, expressions, kinds, comparator); None for plain functions."""
        if self.symbolic is None:
            return None
        if self._digest is None:
            text = hashlib.sha256("\n".join(self._lines(self.symbolic)).encode()).hexdigest()
            object.__setattr__(self, "_digest", text)
        return self._digest

    def _lines(self, form: SymbolicForm) -> list[str]:
        lines = ["filippov system 1", repr(self.states), repr(self.parameters.names), repr(self.comparator)]
        lines += [
            f"{s.name!r} {s.kind} {s.width!r}" + ("" if s.reset is None else f" {s.side} {s.contact}")
            for s in self.surfaces
        ]
        for event in self.time_events:
            lines.append(f"{event.name!r} {sympy.srepr(sympy.Tuple(*event.instants))} {event.times is None}")
        return lines + [sympy.srepr(e) for e in form.expressions()]

    def surface_index(self, name: str) -> int:
        """Return the place of a surface; ModelError with a suggestion if there is none of this name."""
        names = [surface.name for surface in self.surfaces]
        if name in names:
            return names.index(name)
        hint = closest(str(name), names)
        raise ModelError(
            f"unknown surface {name!r}; {hint + ' ' if hint else ''}known: {', '.join(names) or '(none)'}"
        )

    def state_index(self, name: str | Symbol) -> int:
        """Return the place of a state given by name or symbol; ModelError with a suggestion if unknown."""
        key = name.name if isinstance(name, Symbol) else name
        if key in self.states:
            return self.states.index(key)
        hint = closest(str(key), self.states)
        raise ModelError(
            f"unknown state {key!r}; {hint + ' ' if hint else ''}known: {', '.join(self.states)}"
        )

    def jacobian(self, mode: Sequence[int] | str) -> sympy.Matrix:
        """df/dx in a mode as a sympy matrix (n, n); ModelError for a system of plain functions."""
        if self.symbolic is None:
            raise ModelError(
                "the field is a plain function and has no symbolic Jacobian. Write it as expressions."
            )
        return self.symbolic.jacobian(mode)

    def with_comparator(self, comparator: Comparator) -> System:
        """Return the system with another comparator in the place of Sgn on its switching surfaces."""
        checked = check_comparator(comparator)
        base = self.exact
        if isinstance(checked, Exact):
            return base
        system = object.__new__(System)
        content: dict[str, Any] = {
            "states": base.states,
            "parameters": base.parameters,
            "time_events": base.time_events,
            "comparator": checked,
            "_base": base,
        }
        if base.symbolic is not None:
            form, surfaces = regularize_symbolic(base.symbolic, base.surfaces, checked)
            system._set(**content, symbolic=form, surfaces=surfaces, field=None)
        else:
            assert base.field is not None
            field, surfaces = regularize_functions(base.field, base.surfaces, checked)
            system._set(**content, symbolic=None, surfaces=surfaces, field=field)
        return system

    # -- identity --------------------------------------------------------------------------------------

    def _key(self) -> tuple[Any, ...]:
        if self.symbolic is not None:
            return self.digest, self.parameters
        return self.field, self.states, self.parameters, self.surfaces, self.time_events, self.comparator

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, System):
            return NotImplemented
        return self is other or self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        surfaces = ", ".join(surface.name for surface in self.surfaces)
        return (
            f"System(states={' '.join(self.states)!r}, surfaces=[{surfaces}], comparator={self.comparator})"
        )


def _clocks(time_events: Any, symbolic: bool) -> tuple[TimeEvent, ...]:
    """Return time events that fit the system."""
    items = (time_events,) if isinstance(time_events, TimeEvent) else tuple(time_events)
    for item in items:
        if not isinstance(item, TimeEvent):
            raise ModelError(f"time_events holds {item!r}, expected TimeEvent('name', period=...).")
        if symbolic and not item.symbolic:
            raise ModelError(
                f"time event {item.name!r} has a function, expected numbers and expressions, because the "
                "equations are expressions."
            )
        if not symbolic and (item.expressions() or isinstance(item.reset, tuple)):
            raise ModelError(
                f"time event {item.name!r} has an expression, expected numbers and functions, because the "
                "field is a function: reset=lambda t, x, p: [...]."
            )
    return items


def _check_clock_names(clocks: Sequence[TimeEvent], surfaces: Sequence[Surface]) -> None:
    seen = [surface.name for surface in surfaces]
    for clock in clocks:
        if clock.name in seen:
            raise ModelError(f"two surfaces or time events are named {clock.name!r}. Rename one of them.")
        seen.append(clock.name)
        for e in clock.instants:
            if isinstance(e, Expr) and not all(isinstance(q, ParameterSymbol) for q in e.free_symbols):
                raise ModelError(
                    f"time event {clock.name!r}: its instants are {e}, expected numbers or parameters. What "
                    "depends on the state is a Surface."
                )


def _namespace(parameters: Any) -> ParameterNamespace | None:
    if parameters is None or isinstance(parameters, ParameterNamespace):
        return parameters
    raise ModelError(
        f"parameters are {parameters!r}, expected the object that parameters(...) returned, because the "
        "equations hold "
        "its symbols. It may be left out."
    )


def _equations(equations: Any, states: Any) -> dict[Symbol, Expr]:
    """Return checked equations, in the order of `states` where given."""
    if not isinstance(equations, Mapping):
        raise ModelError(f"equations are {equations!r}, expected a dict {{x: dx/dt, v: dv/dt}}.")
    if not equations:
        raise ModelError("there is no equation, expected at least one: System({x: ...}).")
    out: dict[Symbol, Expr] = {}
    for symbol, value in equations.items():
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
                f"there is an equation for {name!r}, which states={' '.join(order)!r} does not name."
            )
    return {by_name[name]: out[by_name[name]] for name in order}


def _mode_fields(fields: Any, k: int, symbols: tuple[Symbol, ...]) -> dict[tuple[int, ...], list[Expr]]:
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
                raise ModelError(f"fields holds the sign vector {_text(vector)!r} twice (by {key!r}).")
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


def _by_mode(
    surfaces: Sequence[Surface], table: Mapping[tuple[int, ...], list[Expr]], known: tuple[int, ...], i: int
) -> Expr:
    if len(known) == len(surfaces):
        return table[known][i]
    plus, minus = (_by_mode(surfaces, table, (*known, m), i) for m in (1, -1))
    return Select(surfaces[len(known)].h, plus, minus)
