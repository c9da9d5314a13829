"""A model: x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }, with names, parameters and surfaces."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from filippov.base.answers import ANSWERS, ELSEWHERE
from filippov.base.delegates import delegate
from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.base.names import closest, no_attribute, state_names
from filippov.base.signature import check_signature
from filippov.base.symbolic_value import is_expression, single
from filippov.model.comparator import Comparator, Exact, PerSurface, by_surface, check_comparator, per_surface
from filippov.model.parameter import ParameterSet
from filippov.model.surface import Role, Surface, no_surface, surfaces_of
from filippov.model.time_event import TimeEvent, check_clock_names, read_clocks

if TYPE_CHECKING:
    from pathlib import Path

    import sympy
    from sympy import Expr, Symbol

    from filippov.model.parameter_symbol import ParameterNamespace
    from filippov.model.signals.samples import Samples
    from filippov.model.symbolic import SymbolicForm

Field = Callable[..., Any]
# What holds expressions. Another process, to which it goes packed, may never ask for it, nor a system that
# was kept (see `filippov.solving.state.kept`).
_HEAVY = ("surfaces", "symbolic", "time_events", "outputs", "comparator", "_base")

# What a system made from another one has of it, whatever its equations.
_KEPT = ("states", "parameters", "time_events", "outputs", "labels", "_named")


class System:
    """x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }; immutable.

    From expressions, in which the surfaces are found:

        System({x: v, v: (-u - g*sign(v))/p.m})
        System({...}, surfaces=[Surface("velocity", v, radius=p.Fs/p.Fc)])  # names and sets for some of them

    From functions f(t, x, p, s) -> (n,) and h(t, x, p) -> float, which are kept as they are:

        System(field=f, surfaces=[Surface("velocity", h)], states="x v", parameters={"m": 1})

    With events at known times: time_events=[TimeEvent("clock", period=p.T, reset={ramp: 0})].

    With outputs, and labels of axes: outputs={"effort": u}, labels={"x": "position [m]"}.

    From one vector field per sign vector (Filippov's form): System.from_modes. Raises ModelError.
    """

    __slots__ = (
        "_base", "_digest", "_named", "_packed", "_whole", "clocked", "comparator", "compile", "field",
        "inputs", "labels", "outputs", "parameters", "roles", "runs", "states", "surface_names", "surfaces",
        "symbolic", "time_events", "units", "variable_widths",
    )  # fmt: skip

    states: tuple[str, ...]
    parameters: ParameterSet
    surfaces: tuple[Surface, ...]
    surface_names: tuple[str, ...]
    roles: tuple[Role, ...]  # of the surfaces
    time_events: tuple[TimeEvent, ...]
    # The samples of the inputs in the equations.
    inputs: tuple[Samples, ...]
    clocked: bool
    variable_widths: bool
    comparator: Comparator | PerSurface
    outputs: Mapping[str, Any]
    labels: Mapping[str, str]
    symbolic: SymbolicForm | None
    field: Field | None
    compile: bool | None
    # What the compiled loop was given of it, by what was asked for (see `filippov.solving.state.machine`): it
    # goes along.
    units: dict[Any, Any]
    runs: dict[Any, Any]  # that wait for the next one (see `filippov.solving.state.ready`), in this process
    _base: System | None
    _digest: str | None
    _named: tuple[Any, ...]
    _packed: bytes | None
    _whole: Callable[[], System] | None

    @keywords("keyword", answers=ANSWERS, error=ModelError, own=("equations", "surfaces", "time_events"))
    def __init__(
        self,
        equations: Mapping[Symbol, object] | None = None,
        *,
        field: Field | None = None,
        surfaces: Sequence[Surface] = (),
        states: str | Sequence[str | Symbol] | None = None,
        parameters: Mapping[str, object] | ParameterNamespace | ParameterSet | None = None,
        time_events: Sequence[TimeEvent] = (),
        compile: bool | None = None,  # noqa: A002 (the word for it)
        outputs: Mapping[str, object] | None = None,
        labels: Mapping[str, str] | None = None,
    ) -> None:
        clocks = read_clocks(time_events, symbolic=equations is not None)
        if (equations is None) == (field is None):
            raise ModelError(
                "a System is made from equations, System({x: ..., v: ...}), or from a function, "
                f"System(field=f, ...): {'neither was' if field is None else 'both were'} given."
            )
        given: Any = surfaces
        surfaces = (given,) if isinstance(given, Surface) else surfaces_of(given)
        if equations is not None:
            from filippov.model.assemble import assemble
            from filippov.model.equations import read_equations, read_namespace

            if compile is False:
                raise ModelError("compile=False is for System(field=f, ...): equations run compiled only.")

            checked = read_equations(equations, states)
            named = _outputs(outputs, [x.name for x in checked], True)
            form, found = assemble(
                checked, surfaces, read_namespace(parameters), time_events=clocks,
                outputs=tuple(named.values()),
            )  # fmt: skip
            self._set_symbolic(form, found, clocks)
        else:
            self._set_functions(field, surfaces, states, parameters, clocks)
            object.__setattr__(self, "compile", compile)
            named = _outputs(outputs, self.states, False)
        self._name(named, labels)

    @classmethod
    @keywords("keyword", error=ModelError)
    def from_modes(
        cls,
        h: Sequence[Expr | Surface],
        fields: Mapping[Any, Any],
        states: Sequence[Symbol],
        *,
        parameters: ParameterNamespace | None = None,
        time_events: Sequence[TimeEvent] = (),
        outputs: Mapping[str, object] | None = None,
        labels: Mapping[str, str] | None = None,
    ) -> System:
        """x' = f_m(t, x; p) where the signs of h_1 ... h_k are m, for every sign vector m: "++", "+-", ...

        h        expressions or Surfaces
        fields   from sign vectors (text or tuples of +-1; "*" stands for either sign) to one expression per
                 state, in order or as a dict
        Source: Filippov 1988, chapter 2, section 4.
        """
        from filippov.model.assemble import assemble
        from filippov.model.equations import by_mode, read_equations, read_modes, read_namespace
        from filippov.model.symbols import states_of

        symbols = states_of(states)
        surfaces = [g if isinstance(g, Surface) else Surface(str(g), g) for g in h]
        for surface in surfaces:
            if not surface.symbolic:
                raise ModelError(f"surface {surface.name!r}: h is a function, expected an expression.")
        table = read_modes(fields, len(surfaces), symbols)
        equations = {x: by_mode(surfaces, table, (), i) for i, x in enumerate(symbols)}
        checked = read_equations(equations, None)
        clocks = read_clocks(time_events, symbolic=True)
        named = _outputs(outputs, [x.name for x in checked], True)
        form, found = assemble(
            checked, surfaces, read_namespace(parameters), spare=True, time_events=clocks,
            outputs=tuple(named.values()),
        )  # fmt: skip
        return cls._of_form(form, found, clocks, named, labels)

    # -- construction ----------------------------------------------------------------------------------

    @classmethod
    def _of_form(
        cls, form: SymbolicForm, surfaces: tuple[Surface, ...], clocks: tuple[TimeEvent, ...] = (),
        outputs: Mapping[str, Any] | None = None, labels: Any = None,
    ) -> System:  # fmt: skip
        """A system of expressions that are checked."""
        system = object.__new__(cls)
        system._set_symbolic(form, surfaces, clocks)
        system._name(outputs or {}, labels)
        return system

    def _set_symbolic(self, form: SymbolicForm, surfaces: tuple[Surface, ...], clocks: Any) -> None:
        check_clock_names(clocks, surfaces)
        values = ParameterSet({q.name: q.parameter for q in form.p})
        self._set(
            states=tuple(x.name for x in form.x), parameters=values, surfaces=surfaces, time_events=clocks,
            symbolic=form, field=None,
        )  # fmt: skip

    def _set_functions(
        self, field: Any, surfaces: Any, states: Any, parameters: Any, clocks: tuple[TimeEvent, ...]
    ) -> None:
        if not callable(field):
            raise ModelError(f"field is {field!r}, expected a function f(t, x, p, s) that returns dx/dt.")
        check_signature(field, ("t", "x", "p", "s"), "field", "[...], one number per state")
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
                raise ModelError(no_surface(surface))
            given = (surface.h, *surface.radius, surface.width)
            if any(is_expression(item) for item in given):
                raise ModelError(
                    f"surface {surface.name!r}: h, radius or width is an expression, expected a function of "
                    "(t, x, p) or a number, because the field is a function. Expressions go with "
                    "System({x: ...})."
                )
            if surface.name in seen:
                raise ModelError(
                    f"two surfaces are named {surface.name!r}. Every surface needs its own name."
                )
            for other in seen.values():
                if other.h is surface.h:
                    raise ModelError(
                        f"surfaces {other.name!r} and {surface.name!r} are the same set: both have the "
                        f"function {getattr(surface.h, '__name__', surface.h)!r}. Declare it once."
                    )
            seen[surface.name] = surface
        for name, surface in seen.items():
            where = f"surface {name!r}"
            check_signature(surface.h, ("t", "x", "p"), f"{where}: h", "the switching function, a float")
            if surface.reset is not None:
                check_signature(surface.reset, ("t", "x", "p"), f"{where}: reset", "the state after it")
        check_clock_names(clocks, tuple(seen.values()))
        self._set(
            states=names, parameters=values, surfaces=tuple(seen.values()), time_events=clocks,
            symbolic=None, field=field,
        )  # fmt: skip

    def _name(self, outputs: Mapping[str, Any], labels: Any) -> None:
        """Give it outputs and the labels of axes."""
        for name in outputs:
            if name in self.parameters:
                raise ModelError(f"{name!r} is both an output and a parameter. Rename one of them.")
        if labels is not None:
            from filippov.model.output import check_labels

            inputs = (samples.name for samples in self.inputs)
            labels = check_labels(labels, (*self.states, *outputs, *inputs))
        written: tuple[Any, ...] = tuple(outputs.items())
        if outputs and self.field is None:
            import sympy

            # As text: equality must not ask for expressions on the way to another process.
            written = tuple((name, sympy.srepr(e)) for name, e in outputs.items())
        content = {"outputs": dict(outputs), "labels": labels or {}}
        for name, value in {**content, "_named": (written, tuple((labels or {}).items()))}.items():
            object.__setattr__(self, name, value)

    def _set(self, *, symbolic: SymbolicForm | None, **content: Any) -> None:
        rest: dict[str, Any] = {
            "comparator": Exact(), "_base": None, "_digest": None, "_packed": None, "_whole": None,
            "surface_names": tuple(surface.name for surface in content["surfaces"]), "compile": None,
            "roles": tuple(surface.role for surface in content["surfaces"]), "units": {}, "runs": {},
            "clocked": bool(content["time_events"] or (symbolic and symbolic.inputs)), "_named": ((), ()),
            "inputs": symbolic.inputs if symbolic else (), "outputs": {}, "labels": {}, "symbolic": symbolic,
            "variable_widths": bool(symbolic and symbolic.widths),
        }  # fmt: skip
        for name, value in {**rest, **content}.items():
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
        if self._digest is None and self.symbolic is not None:
            import sympy
            *lines, expressions = self.content
            known = {x: sympy.srepr(x) for x in self.symbolic.x}  # a reset names every state, and moves few
            text = "\n".join([*lines, *(known.get(e) or sympy.srepr(e) for e in expressions)])
            object.__setattr__(self, "_digest", hashlib.sha256(text.encode()).hexdigest())
        return self._digest

    @property
    def content(self) -> tuple[Any, ...]:
        """What the digest tells, expressions as they are: sooner made, to be compared."""
        import sympy

        lines = ["filippov system 1", repr(self.states), repr(self.parameters.names), repr(self.comparator)]
        lines += [
            f"{s.name!r} {s.kind} {s.width!r}" + ("" if s.reset is None else f" {s.side} {s.contact}")
            for s in self.surfaces
        ]
        clocks = [(e.name, sympy.srepr(sympy.Tuple(*e.instants)), e.times is None) for e in self.time_events]
        lines += [f"{name!r} {instants} {endless}" for name, instants, endless in clocks]
        return *lines, tuple(self.symbolic.expressions()) if self.symbolic is not None else ()

    def surface_index(self, name: str) -> int:
        """Return the place of a surface; ModelError with a suggestion if there is none of this name."""
        return self.surface_place(name)[0]

    def surface_place(self, name: str) -> tuple[int, int]:
        """Return the index of a surface and the orientation in which it is requested.

        name    its name, or the formula of its h in either orientation: for h = v - vb "v - vb" gives +1 and
                "vb - v" gives -1

        Raises ModelError with a suggestion if there is none.
        """
        if name in (names := self.surface_names):
            return names.index(name), 1
        if self.symbolic is not None and isinstance(name, str):
            from filippov.model.spelling import place_of

            found = place_of(self.symbolic, names, name)
            if found is not None:
                return found
        clocks = [clock.name for clock in self.time_events]
        hint = "a time event is no surface;" if name in clocks else closest(str(name), names)
        raise ModelError(
            f"unknown surface {name!r}; {hint + ' ' if hint else ''}known: {', '.join(names) or '(none)'}"
        )

    @keywords("keyword", error=ModelError)
    def state_index(self, name: str | Symbol) -> int:
        """Return the place of a state given by name or symbol; ModelError with a suggestion if unknown."""
        key = getattr(single(name), "name", name)
        if key in self.states:
            return self.states.index(key)
        hint = closest(str(key), self.states)
        raise ModelError(
            f"unknown state {key!r}; {hint + ' ' if hint else ''}known: {', '.join(self.states)}"
        )

    @keywords("keyword", error=ModelError)
    def jacobian(self, mode: Sequence[int] | str) -> sympy.Matrix:
        """df/dx in a mode as a sympy matrix (n, n); ModelError for a system of plain functions."""
        if self.symbolic is None:
            raise ModelError(
                "the field is a plain function and has no symbolic Jacobian. Write it as expressions."
            )
        return self.symbolic.jacobian(mode)

    @keywords("keyword", error=ModelError)
    def with_comparator(self, comparator: Comparator | PerSurface | Mapping[str, Comparator]) -> System:
        """Return the system with another comparator in place of Sgn on its switching surfaces.

        One for all of them, or a mapping from names of surfaces (or the formulas of their h); those left out
        stay exact. It replaces any earlier comparator, and may add states, last. Raises ModelError where a
        comparator cannot be used for a surface (see `filippov.model.comparator`).
        """
        base, checked = self.exact, self.exact._read_comparator(comparator)
        if isinstance(checked, Exact):
            return base
        chosen = by_surface(checked, {q.name: q.kind == "switching" for q in base.surfaces})
        content: dict[str, Any] = {"comparator": checked, "_base": base}
        if base.symbolic is not None:
            from filippov.model.comparators.regularize import regularize_symbolic
            form, surfaces = regularize_symbolic(base.symbolic, base.surfaces, chosen)
            if form.p != base.symbolic.p:
                content["parameters"] = ParameterSet({q.name: q.parameter for q in form.p})
            names = tuple(q.name for q in form.x)
            content |= {"states": names, "outputs": _outputs(base.outputs, names, symbolic=True)}
            return base._with(**content, symbolic=form, surfaces=surfaces, field=None)
        from filippov.model.comparators.regularize_plain import regularize_functions

        assert base.field is not None
        field, surfaces = regularize_functions(base.field, base.surfaces, chosen)
        # A comparator in place of Sgn stands around the field: what runs is another function.
        how = base.compile if field is base.field else None
        return base._with(**content, symbolic=None, surfaces=surfaces, field=field, compile=how)

    def _read_comparator(self, given: Any) -> Comparator | PerSurface:
        """A comparator, or those of a mapping, with the names of their surfaces."""
        if isinstance(given, PerSurface):
            given = dict(given.items())
        if not isinstance(given, Mapping):
            return check_comparator(given)
        named = {self.surface_names[self.surface_place(str(single(q)))[0]]: own for q, own in given.items()}
        return per_surface(named, {q.name: q.kind == "switching" for q in self.surfaces})

    def with_form(self, form: SymbolicForm, surfaces: tuple[Surface, ...]) -> System:
        """Return a system with other expressions for the same states, parameters and surfaces."""
        return self._with(surfaces=surfaces, symbolic=form, field=None)

    def _with(self, **content: Any) -> System:
        system = object.__new__(System)
        system._set(**{name: getattr(self, name) for name in _KEPT} | content)
        return system

    @keywords("keyword", error=ModelError)
    def with_inputs(self, signals: Mapping[str, Any]) -> System:
        """The system with signals in place of parameters, or other signals in that of inputs, by name.

        signals  from a parameter or an input to an `Input`, a test signal, or a formula in t: a set point
                 that was a number follows a table, {"r": Input.from_csv("r", "steps.csv")}

        It is then no longer a parameter. A comparator is kept. Raises ModelError, also for a parameter that
        sets instants of a clock or a width, which must be numbers, and for samples outside its bounds.
        """
        from filippov.model.with_inputs import with_inputs

        made: System = with_inputs(self, signals)
        return made

    @keywords("keyword", error=ModelError)
    def export(
        self, path: str | Path, to: str | None = None, *, parameters: Mapping[str, float] | None = None,
        x0: Any = None, t_span: Sequence[float] | None = None,
    ) -> Path:  # fmt: skip
        """Write the exact automaton as Python, C, Modelica or an FMU; see `filippov.export_system`."""
        write = delegate("System.export")
        written: Path = write(self, path, to, parameters=parameters, x0=x0, t_span=t_span)
        return written

    # -- identity --------------------------------------------------------------------------------------

    def _key(self) -> tuple[Any, ...]:
        if self.field is None:
            return self.digest, self.parameters, self._named
        written = self.field, self.states, self.parameters, self.surfaces, self.time_events
        return *written, self.comparator, self._named

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, System):
            return NotImplemented
        return self is other or self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __getstate__(self) -> dict[str, Any]:
        if self.field is not None:
            return {name: getattr(self, name) for name in self.__slots__} | {"runs": {}}
        packed = self._packed or pickle.dumps({name: getattr(self, name) for name in _HEAVY})
        light = {name: getattr(self, name) for name in self.__slots__ if name not in _HEAVY}
        light |= {name: value for name in _HEAVY if _is_none(value := getattr(self, name))}
        return light | {"runs": {}, "_digest": self.digest, "_packed": packed, "_whole": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        # Asked for what is not there: the first time after the way from another process, or of one kept.
        if name not in _HEAVY:
            raise AttributeError(no_attribute("System", name, dir(type(self)), ELSEWHERE))
        if self._whole is not None:
            whole = self._whole()
            if whole.digest != self._digest:
                raise ModelError("the files of this model have changed while it runs. Start again.")
            self.__setstate__({part: getattr(whole, part) for part in _HEAVY})
        else:
            assert self._packed is not None
            self.__setstate__(pickle.loads(self._packed))  # noqa: S301  # packed above, not from a file
        return object.__getattribute__(self, name)

    def _repr_latex_(self) -> str:
        text: str = delegate("System._repr_latex_")(self)
        return text

    def __repr__(self) -> str:
        surfaces = ", ".join(surface.name for surface in self.surfaces)
        return (
            f"System(states={' '.join(self.states)!r}, surfaces=[{surfaces}], comparator={self.comparator})"
        )


def _is_none(part: Any) -> bool:
    """Whether a part that may hold expressions holds none for sure."""
    return not part or isinstance(part, Exact)


def _outputs(outputs: Any, states: Sequence[str], symbolic: bool) -> dict[str, Any]:
    """Checked outputs; what has none does not load what they need."""
    if outputs is None:
        return {}
    from filippov.model.output import check_outputs

    return check_outputs(outputs, states, symbolic)
