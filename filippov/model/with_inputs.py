"""Signals in place of parameters, or of other signals: the same system, driven from outside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.given import shown
from filippov.base.names import unknown
from filippov.model.assemble import check_inputs, put_into_source, with_contacts
from filippov.model.check import as_expression
from filippov.model.comparator import Exact
from filippov.model.signals.input import Sampled, sampled_in
from filippov.model.symbols import t


def with_inputs(system: Any, signals: Mapping[str, Any]) -> Any:
    """See `System.with_inputs`; system: a System, which imports this."""
    if system.symbolic is None:
        raise ModelError(
            "the field is a plain function, into which no signal can be put. Read it in there, with "
            "np.interp and a TimeEvent at its knots, or write the equations as expressions."
        )
    if not isinstance(system.comparator, Exact):
        return with_inputs(system.exact, signals).with_comparator(system.comparator)
    form = system.symbolic
    values = _values(system, signals)
    _check_fixed(system, values)
    gone = {q for q in values if isinstance(q, Symbol)}
    p = tuple(q for q in form.p if q not in gone)
    new = replace(form.put(values), p=p)
    check_inputs([node for e in new.expressions() for node in e.atoms(Sampled)], (*form.x, *p))
    # Whether a surface can be rested on is looked at anew, where it was not declared otherwise than found.
    free = tuple(q if q.reset is None else replace(q, contact=None) for q in system.surfaces)
    _, found = with_contacts(replace(form, contact=()), free)
    left = [a if b.contact == q.contact else q for a, b, q in zip(free, found, system.surfaces, strict=True)]
    new, surfaces = with_contacts(replace(new, contact=()), tuple(put_into_source(q, values) for q in left))
    clocks = tuple(put_into_source(q, values) for q in system.time_events)
    outputs = {name: e.xreplace(values) for name, e in system.outputs.items()}
    return system._of_form(new, surfaces, clocks, outputs, dict(system.labels))


def _values(system: Any, signals: Mapping[str, Any]) -> dict[Expr, Expr]:
    """What stands in the equations for each name, and the signal that goes there."""
    form = system.symbolic
    assert form is not None
    known = {q.name: q for q in form.p}
    nodes = [node for e in (*form.expressions(), *system.outputs.values()) for node in sampled_in(e)]
    inputs = {node.samples.name for node in nodes}
    out: dict[Expr, Expr] = {}
    for name, given in signals.items():
        if isinstance(given, list | tuple) or hasattr(given, "__array__"):
            raise ModelError(
                f"signal {name!r} is {shown(given)}, expected an Input or a formula in t: "
                f"Input({name!r}, times, values)."
            )
        e = as_expression(given, f"signal {name!r}")
        if not e.free_symbols <= {t}:
            strange = ", ".join(sorted(str(q) for q in e.free_symbols - {t}))
            raise ModelError(
                f"signal {name!r} is {e}, with {strange} in it, expected an Input or a formula in t alone."
            )
        if name in inputs:
            out |= {node: e.diff(t, node.order) for node in nodes if node.samples.name == name}
        elif name in known:
            for node in sampled_in(e):
                for extreme in (float(node.samples.values.min()), float(node.samples.values.max())):
                    known[name].parameter.check(extreme, f"a sample of {name!r}")
            out[known[name]] = e
        else:
            raise ModelError(unknown("parameter or input", name, [*known, *sorted(inputs)]))
    return out


def _check_fixed(system: Any, values: Mapping[Expr, Expr]) -> None:
    """Refuse a signal where a number has to stand for the whole run."""
    form = system.symbolic
    assert form is not None
    places = {f"the instants of time event {q.name!r}": q.instants for q in system.time_events}
    places |= {
        f"the width of surface {q.name!r}": (width,)
        for q, width in zip(system.surfaces, form.widths, strict=False)
    }
    for where, numbers in places.items():
        for e in numbers:
            for q in e.free_symbols & values.keys() if isinstance(e, sympy.Basic) else ():
                raise ModelError(f"parameter {q} sets {where}, which no signal can do. Give it a number.")
