"""Equations to a SymbolicForm: check symbols, extract surfaces, put them in order, tell their kinds."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.names import closest, unknown
from filippov.model.check import as_expression, check_size
from filippov.model.comparators.hysteresis import normalised
from filippov.model.contact import found_contact, slips_of
from filippov.model.extract import NONSMOOTH, Extractor
from filippov.model.kinds import Kinds
from filippov.model.levels import levelled
from filippov.model.parameter_symbol import ParameterNamespace, ParameterSymbol
from filippov.model.push import place
from filippov.model.signals.input import InputSymbol, as_symbols, inputs_in
from filippov.model.spelling import surface_name
from filippov.model.surface import Surface, no_surface
from filippov.model.symbolic import Contact, SymbolicForm
from filippov.model.symbols import t
from filippov.model.table import Entry, SizeSymbol
from filippov.model.time_event import TimeEvent

ROUNDING = 1e-12


def assemble(
    equations: Mapping[Symbol, Expr],
    surfaces: Sequence[Surface],
    parameters: ParameterNamespace | None,
    spare: bool = False,
    time_events: Sequence[TimeEvent] = (),
    outputs: Sequence[Expr] = (),
) -> tuple[SymbolicForm, tuple[Surface, ...]]:
    """Return the symbolic form and its surfaces, in one order.

    `spare`: a declared surface may be without effect. Raises ModelError.
    """
    given = tuple(_checked(surface, tuple(equations)) for surface in surfaces)
    if not any(e.has(*NONSMOOTH) for surface in given for _, e in surface.reset or ()):
        return _assembled(equations, given, parameters, spare, time_events, outputs, ())[:2]
    # What a contact pushes may depend on signs that the equations do not hold: surfaces of their own.
    form, found, unused = _assembled(equations, given, parameters, True, time_events, outputs, ())
    declared = {surface.name: surface for surface in given}
    contacts = [(i, declared[q.name]) for i, q in enumerate(found) if q.reset is not None]
    slips = list(dict.fromkeys(g for i, surface in contacts for g in slips_of(form, surface, i)))
    if not slips and (spare or not unused):
        return form, found
    given = _with_slips(form, given, slips)
    return _assembled(equations, given, parameters, spare, time_events, outputs, slips)[:2]


def _with_slips(form: SymbolicForm, given: Sequence[Surface], slips: Sequence[Expr]) -> tuple[Surface, ...]:
    """The surfaces, and those on which contacts slip that are not among those of the form."""
    out, known = list(given), list(form.plain_h())
    for g in slips:
        if place(known, g) is None:
            h = -g if g.could_extract_minus_sign() else g
            known.append(h)
            out.append(Surface(_free_name(h, {surface.name for surface in out}), h))
    return tuple(out)


def _assembled(
    equations: Mapping[Symbol, Expr],
    given: tuple[Surface, ...],
    parameters: ParameterNamespace | None,
    spare: bool,
    time_events: Sequence[TimeEvent],
    outputs: Sequence[Expr],
    slips: Sequence[Expr],
) -> tuple[SymbolicForm, tuple[Surface, ...], list[Entry]]:
    """The form, its surfaces, and those without effect; slips: on whose signs pushes of contacts depend."""
    x = tuple(equations)
    for symbol, f in equations.items():
        check_size(f, f"the equation of {symbol.name!r}")
    clocks = [e for event in time_events for e in event.expressions()]
    inputs = as_symbols([*equations.values(), *_expressions(given), *clocks, *outputs])
    if inputs:
        # While surfaces are distinguished an input may have any value, whatever its samples are.
        equations = {symbol: f.xreplace(inputs) for symbol, f in equations.items()}
        given = tuple(put_into_source(surface, inputs) for surface in given)
        time_events = [put_into_source(event, inputs) for event in time_events]
        outputs = [e.xreplace(inputs) for e in outputs]
        clocks = [e.xreplace(inputs) for e in clocks]
    _check_names(given)
    _check_resets((*given, *time_events), x)
    p = _parameters([*equations.values(), *_expressions(given), *clocks, *outputs], parameters, x)
    extractor = Extractor()
    extractor.note(equations.values())
    extractor.declare(given)
    field = [extractor.field(f, f"the equation of {symbol.name!r}") for symbol, f in equations.items()]
    radius = {surface.name: _radius(extractor, surface) for surface in given}
    after = {surface.name: _after(extractor, surface, x) for surface in given if surface.reset is not None}
    ticks = [None if event.reset is None else _after(extractor, event, x) for event in time_events]
    # Most states are left as they are by most resets.
    rows = [row for row in (*after.values(), *ticks) if row is not None]
    moved = [e for row in rows for q, e in zip(x, row, strict=True) if e is not q]
    acting = [found[0] for g in slips if (found := extractor.table.match(g)) is not None]
    holding = [*field, *moved, *(entry.s for entry in acting)]
    used, unused = _used(extractor.table.entries, holding, spare)
    entries = _ordered(used, [surface.name for surface in given])

    names = _names(entries)
    s = tuple(Symbol(f"_s{i}", real=True) for i in range(len(entries)))
    a = tuple(Symbol(f"_a{i}", nonnegative=True) for i in range(len(entries)))
    rename = {entry.s: s[i] for i, entry in enumerate(entries)} | {
        entry.a: a[i] for i, entry in enumerate(entries)
    }
    form = SymbolicForm(
        x=x,
        p=p,
        s=s,
        a=a,
        field=tuple(f.xreplace(rename) for f in field),
        h=tuple(entry.h.xreplace(rename) for entry in entries),
        radius=tuple(radius.get(name, (-sympy.S.One, sympy.S.One)) for name in names),
        reset=tuple(
            tuple(e.xreplace(rename) for e in after[name]) if name in after else None for name in names
        )
        if after
        else (),
        time_reset=tuple(None if row is None else tuple(e.xreplace(rename) for e in row) for row in ticks),
    )
    unexpanded = [extractor.unexpanded(f).xreplace(rename) for f in equations.values()]
    kinds = Kinds(form, unexpanded)
    out = []
    for i, entry in enumerate(entries):
        declared = entry.declared or Surface(names[i], kinds.h[i])
        kind = "switching" if entry in acting else kinds.kind(i, declared)
        if kind != "switching" and declared.wide:
            raise ModelError(
                f"surface {names[i]!r}: radius is {declared.radius}, but the equations do not jump across "
                "it, so no set "
                "stands on it. Leave the radius out, or write the jump with sign(...)."
            )
        out.append(replace(declared, kind=kind))
    form, out = levelled(form, out)
    if inputs:
        signals = {symbol: node for node, symbol in inputs.items()}
        form = form.put(signals)
        out = [put_into_source(surface, signals) for surface in out]
        check_inputs([*inputs], (*x, *p))
    return *with_contacts(*normalised(form, out)), unused


def check_inputs(nodes: Sequence[Expr], others: Sequence[Symbol]) -> None:
    """Refuse inputs with the name of a state or parameter, and two of one name. Raises ModelError."""
    taken = {q.name for q in others}
    for samples in inputs_in(nodes):
        if samples.name in taken:
            raise ModelError(
                f"{samples.name!r} is both an input and a state or parameter. Rename one of them."
            )


def put_into_source(source: Any, values: Mapping[Any, Expr]) -> Any:
    """A surface or time event with other expressions in its function and reset."""

    def put(e: Any) -> Any:
        return e.xreplace(values) if isinstance(e, Expr) else e

    after = source.reset
    moved: dict[str, Any] = {}
    if isinstance(after, tuple):
        moved["reset"] = tuple((k, put(e)) for k, e in after)
    if isinstance(source, TimeEvent):
        return replace(source, **moved)
    return replace(
        source, h=put(source.h), radius=tuple(map(put, source.radius)), width=put(source.width), **moved
    )


def with_contacts(
    form: SymbolicForm, surfaces: tuple[Surface, ...]
) -> tuple[SymbolicForm, tuple[Surface, ...]]:
    """Return the form with the contacts that its resets allow, and surfaces that say which have one."""
    contacts: list[Contact | None] = []
    out = []
    for i, surface in enumerate(surfaces):
        contact: Contact | None = None
        after = form.reset[i] if form.reset else None
        if after is not None and surface.contact is not False:
            found = found_contact(form, surface, i)
            if isinstance(found, Contact):
                contact = found
            elif surface.contact:
                raise ModelError(
                    f"surface {surface.name!r}: there is no resting contact, for {found}. contact=True fits "
                    "a reset that turns dh/dt round and keeps h = dh/dt = 0."
                )
        contacts.append(contact)
        out.append(surface if surface.reset is None else replace(surface, contact=contact is not None))
    if any(contact is not None for contact in contacts):
        form = replace(form, contact=tuple(contacts))
    return form, tuple(out)


# -- symbols -------------------------------------------------------------------------------------------


def _checked(surface: object, x: Sequence[Symbol]) -> Surface:
    if not isinstance(surface, Surface):
        raise ModelError(no_surface(surface))
    if not surface.symbolic:
        raise ModelError(
            f"surface {surface.name!r}: h is a function, expected an expression in {', '.join(map(str, x))}, "
            "because the equations are expressions. Functions go with System(field=f, ...)."
        )
    for bound in surface.radius:
        if not isinstance(bound, (float, Expr)):
            raise ModelError(
                f"surface {surface.name!r}: radius is a function, expected a number or an expression."
            )
    return surface


def _check_names(surfaces: Sequence[Surface]) -> None:
    seen: set[str] = set()
    for surface in surfaces:
        if surface.name in seen:
            raise ModelError(f"two surfaces are named {surface.name!r}. Every surface needs its own name.")
        seen.add(surface.name)


def _check_resets(sources: Sequence[Surface | TimeEvent], x: Sequence[Symbol]) -> None:
    known = [q.name for q in x]
    states = set(known)
    for source in sources:
        for name, _ in source.reset or ():
            if name not in states:
                raise ModelError(f"the reset of {source.name!r}: {unknown('state', name, known)}")


def _expressions(surfaces: Sequence[Surface]) -> list[Expr]:
    given = (e for surface in surfaces for e in (surface.h, *surface.radius, surface.width))
    out = [e for e in given if isinstance(e, Expr)]
    return out + [e for surface in surfaces for _, e in surface.reset or ()]


def _parameters(
    expressions: Sequence[Expr], declared: ParameterNamespace | None, x: Sequence[Symbol]
) -> tuple[ParameterSymbol, ...]:
    """Return the parameter symbols in order of declaration; refuse every other symbol that is no state."""
    free = set().union(*(e.free_symbols for e in expressions)) if expressions else set()
    strange = sorted(
        (q for q in free - {t, *x} if not isinstance(q, ParameterSymbol | InputSymbol)), key=lambda q: q.name
    )
    for symbol in strange:
        raise ModelError(_strange(symbol, x))
    found = sorted((q for q in free if isinstance(q, ParameterSymbol)), key=lambda q: (q.position, q.name))
    ordered = list(declared) if declared is not None else []
    known = set(ordered)
    ordered += [q for q in found if q not in known]
    by_name: dict[str, ParameterSymbol] = {}
    states = {state.name for state in x}
    for q in ordered:
        if q.name in by_name:
            raise ModelError(
                f"parameter {q.name!r} comes from two declarations, with the defaults "
                f"{by_name[q.name].parameter.default:g} and {q.parameter.default:g}. Declare all parameters "
                f"in one parameters(...), p, and write p.{q.name} wherever it is meant."
            )
        if q.name in states:
            raise ModelError(f"{q.name!r} is both a state and a parameter. Rename one of them.")
        by_name[q.name] = q
    return tuple(ordered)


def _strange(symbol: Symbol, x: Sequence[Symbol]) -> str:
    names = [state.name for state in x]
    if symbol.name == "t":
        return (
            "the equations hold a symbol 't' that is not filippov.t. Use `from filippov import t` for time."
        )
    if symbol.name in names:
        return (
            f"the equations hold another symbol named {symbol.name!r} than the state {symbol.name!r}: "
            "their assumptions "
            "differ. Make the states with states('...') and use these symbols only."
        )
    hint = closest(symbol.name, names)
    return (
        f"the equations hold the symbol {symbol.name!r}, which is no state with an equation, no parameter "
        "and not t"
        f"{' (' + hint + ')' if hint else ''}. If it is a number, write p = parameters({symbol.name}=...) "
        "and "
        f"p.{symbol.name}; if it is a state, add its equation."
    )


# -- surfaces ------------------------------------------------------------------------------------------


def _used(
    entries: Sequence[Entry], field: Sequence[Expr], spare: bool
) -> tuple[list[Entry], list[Entry]]:
    """The surfaces on which the field depends, directly or through another h, and those that are to be kept.

    Then those among them that are without effect; without `spare` they are refused.
    """
    # A reset names every state, of which it moves few.
    free = set().union(*(f.free_symbols for f in {*field}))
    kept: set[Entry] = set()

    def keep(unused: Collection[Entry] = ()) -> None:
        # A dependency is entered before the surface that needs it, save where the user declared it first.
        changed = True
        while changed:
            changed = False
            for entry in entries:
                if entry in kept:
                    continue
                watched = entry.declared is not None and (
                    entry.declared.kind == "observer" or entry.declared.reset is not None or entry in unused
                )
                if entry.s in free or entry.a in free or watched:
                    kept.add(entry)
                    free.update(entry.h.free_symbols)
                    changed = True

    keep()
    unused = [entry for entry in entries if entry.declared is not None and entry not in kept]
    for entry in unused if not spare else ():
        assert entry.declared is not None
        raise ModelError(
            f"surface {entry.declared.name!r} (h = {entry.declared.h}) does not occur in the equations. "
            "Correct its h, leave it out, or say kind='observer' if it is only to be watched."
        )
    keep(unused)
    return [entry for entry in entries if entry in kept], unused


def _ordered(entries: Sequence[Entry], declared: Sequence[str]) -> list[Entry]:
    """Declared surfaces in their order, then the others as found; each after those that its h needs."""
    place_of = {name: k for k, name in enumerate(declared)}
    wanted = sorted(entries, key=lambda e: len(declared) if e.declared is None else place_of[e.declared.name])
    out: dict[Entry, None] = {}

    def place(entry: Entry) -> None:
        if entry not in out:
            inside = entry.h.free_symbols
            for other in wanted if any(isinstance(q, SizeSymbol) for q in inside) else ():
                if other.a in inside:
                    place(other)
            out[entry] = None

    for entry in wanted:
        place(entry)
    return list(out)


def _names(entries: Sequence[Entry]) -> list[str]:
    taken = {entry.declared.name for entry in entries if entry.declared is not None}
    inside = set().union(*(entry.h.free_symbols for entry in entries))
    sizes: dict[Symbol, Expr] = {}
    names = []
    for entry in entries:
        plain = entry.h.xreplace(sizes) if sizes else entry.h
        if entry.a in inside:
            sizes[entry.a] = sympy.Abs(plain)
        if entry.declared is not None:
            names.append(entry.declared.name)
            continue
        names.append(_free_name(plain, taken))
        taken.add(names[-1])
    return names


def _free_name(h: Expr, taken: Collection[str]) -> str:
    """The name of a surface that was given none."""
    name = surface_name(h)
    while name in taken:
        name = f"({name})"
    return name


def _after(extractor: Extractor, source: Surface | TimeEvent, x: Sequence[Symbol]) -> list[Expr]:
    """The state after the reset of a surface or a time event, one expression per state."""
    given = dict(source.reset)
    what = "surface" if isinstance(source, Surface) else "time event"
    return [
        extractor.reset(given[q.name], f"{what} {source.name!r}: reset of {q.name!r}")
        if q.name in given
        else q
        for q in x
    ]


def _radius(extractor: Extractor, surface: Surface) -> tuple[Expr, Expr]:
    where = f"surface {surface.name!r}: radius"
    entry = next(e for e in extractor.table.entries if e.declared is surface)
    pair = []
    for bound, outward in zip(surface.radius, (-1, 1), strict=True):
        expr = extractor.continuous(as_expression(_exact(bound), where), where)
        expr = expr.xreplace({entry.a: sympy.S.Zero})  # |h| is 0 where the set stands
        if any(isinstance(q, SizeSymbol) for q in expr.free_symbols):
            raise ModelError(f"{where}: {bound} has a kink on another surface, expected a smooth expression.")
        defaults = {
            q: sympy.Float(q.parameter.default, 30)
            for q in expr.free_symbols
            if isinstance(q, ParameterSymbol)
        }
        value = expr.xreplace(defaults).evalf(20)
        if value.is_number and not (value.is_finite and value.is_real and value * outward >= 1 - ROUNDING):
            raise ModelError(
                f"{where}: {bound} is {sympy.Float(value, 6) if value.is_real else value} at the default "
                "parameters, "
                f"expected {'at least 1' if outward > 0 else 'at most -1'}: the set on the surface must "
                "contain both "
                "one-sided signs."
            )
        pair.append(expr)
    return pair[0], pair[1]


def _exact(value: float | Expr) -> float | Expr:
    return sympy.Integer(int(value)) if isinstance(value, float) and value.is_integer() else value
