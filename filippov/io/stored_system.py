"""A symbolic system as plain data and back: names, parameters, surfaces and expressions."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.names import state_names
from filippov.io.tree import Reader, Symbols, Writer
from filippov.model.assemble import with_contacts
from filippov.model.comparator import NAMES, Comparator, PerSurface, numbers_of
from filippov.model.output import check_outputs
from filippov.model.parameter import Parameter
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.signals.input import input_of, inputs_in
from filippov.model.signals.samples import ROOM, Samples
from filippov.model.surface import Surface
from filippov.model.symbolic import SymbolicForm
from filippov.model.system import System
from filippov.model.time_event import TimeEvent

_PARAMETER = ("default", "unit", "lower", "upper", "description")


@lru_cache(maxsize=64)
def system_data(system: System) -> dict[str, Any] | None:
    """The system as plain data; None where it cannot be read back exactly: it has functions, or an unusual
    one."""
    base = system.exact.symbolic
    if base is None:
        return None
    writer = Writer({**_symbols(base), "u": _signals(_inputs(system))})
    try:
        data = {
            "states": list(system.exact.states),
            "inputs": [_input_data(samples) for samples in _inputs(system)],
            "parameters": [
                {"name": q.name, "position": q.position} | {k: getattr(q.parameter, k) for k in _PARAMETER}
                for q in base.p
            ],
            "resets": [None if after is None else [writer.tree(e) for e in after] for after in base.reset],
            "field": [writer.tree(f) for f in base.field],
            "h": [writer.tree(h) for h in base.h],
            "radius": [[writer.tree(bound) for bound in pair] for pair in base.radius],
            "widths": [None if w is None else writer.tree(w) for w in base.widths],
            "time_events": [_clock_data(event, writer) for event in system.time_events],
            "time_resets": [
                None if row is None else [writer.tree(e) for e in row] for row in base.time_reset
            ],
            "outputs": {name: writer.tree(e) for name, e in system.outputs.items()},
            "labels": dict(system.labels),
            "surfaces": [_surface_data(surface, writer) for surface in system.exact.surfaces],
            "comparator": _comparator_data(system.comparator),
        }  # fmt: skip
        same = system_of(data) == system
    except ModelError:
        return None
    return data if same else None


def system_of(data: Any) -> System:
    """The system that data describe. Raises ModelError for data that do not describe one."""
    try:
        base = _base(data)
        comparator = _comparator(data["comparator"])
    except (KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
        if isinstance(error, ModelError):
            raise
        raise ModelError(
            f"the stored system is incomplete or damaged ({type(error).__name__}: {error})."
        ) from None
    return base.with_comparator(comparator)


def _symbols(form: SymbolicForm) -> Symbols:
    return {"x": form.x, "p": form.p, "s": form.s, "a": form.a}


def _inputs(system: System) -> tuple[Samples, ...]:
    """The inputs of the equations and of the outputs."""
    base = system.exact.symbolic
    assert base is not None
    return inputs_in([*base.expressions(), *system.outputs.values()])


def _signals(inputs: Sequence[Samples]) -> list[Any]:
    """Every input with its derivatives."""
    return [input_of(samples, order) for samples in inputs for order in range(ROOM)]


def _input_data(samples: Samples) -> list[Any]:
    name, t, values, *rest = samples.arguments()
    return [name, t.tolist(), values.tolist(), *rest]


def _surface_data(surface: Surface, writer: Writer) -> dict[str, Any]:
    radius = [writer.tree(b) if isinstance(b, Expr) else b for b in surface.radius]
    return {
        "name": surface.name,
        "h": writer.tree(surface.h),
        "radius": radius,
        "kind": surface.kind,
        "width": surface.width,
        "side": surface.side,
        "contact": surface.contact,
        "reset": None if surface.reset is None else [[k, writer.tree(e)] for k, e in surface.reset],
    }


def _clock_data(event: TimeEvent, writer: Writer) -> dict[str, Any]:
    return {
        "name": event.name,
        "periodic": event.times is None,
        "instants": [writer.tree(q) if isinstance(q, Expr) else q for q in event.instants],
        "reset": None if event.reset is None else [[k, writer.tree(e)] for k, e in event.reset],
    }


def _clock(item: Any, read: Any) -> TimeEvent:
    instants = tuple(read(q) if isinstance(q, list) else q for q in item["instants"])
    reset = None if item["reset"] is None else tuple((k, read(e)) for k, e in item["reset"])
    if item["periodic"]:
        return TimeEvent(item["name"], start=instants[0], period=instants[1], reset=reset)
    return TimeEvent(item["name"], times=instants, reset=reset)


def _base(data: Any) -> System:
    names = state_names(data["states"])
    m = len(data["surfaces"])
    if len(data["field"]) != len(names) or len(data["h"]) != m or len(data["radius"]) != m:
        raise ModelError(
            "the stored system has another number of equations than of states, or of h than of surfaces."
        )
    p = tuple(
        ParameterSymbol(item["name"], Parameter(**{k: item[k] for k in _PARAMETER}), int(item["position"]))
        for item in data["parameters"]
    )
    inputs = [Samples(*item) for item in data.get("inputs", ())]
    symbols: Symbols = {
        "u": _signals(inputs),
        "x": tuple(Symbol(name, real=True) for name in names),
        "p": p,
        "s": tuple(Symbol(f"_s{i}", real=True) for i in range(m)),
        "a": tuple(Symbol(f"_a{i}", nonnegative=True) for i in range(m)),
    }
    read = Reader(symbols).expression
    surfaces = tuple(
        Surface(
            item["name"], read(item["h"]),
            radius=tuple(read(b) if isinstance(b, list) else b for b in item["radius"]),
            kind=item["kind"], width=item["width"], side=item["side"], contact=item["contact"],
            reset=None if item["reset"] is None else tuple((k, read(e)) for k, e in item["reset"]),
        )
        for item in data["surfaces"]
    )  # fmt: skip
    form = SymbolicForm(
        x=symbols["x"],  # type: ignore[arg-type]
        p=p,
        s=symbols["s"],  # type: ignore[arg-type]
        a=symbols["a"],  # type: ignore[arg-type]
        field=tuple(read(f) for f in data["field"]),
        h=tuple(read(h) for h in data["h"]),
        radius=tuple((read(low), read(high)) for low, high in data["radius"]),
        reset=tuple(None if row is None else tuple(read(e) for e in row) for row in data["resets"]),
        time_reset=tuple(None if row is None else tuple(read(e) for e in row) for row in data["time_resets"]),
        widths=tuple(None if w is None else read(w) for w in data.get("widths", ())),
    )
    form, surfaces = with_contacts(form, surfaces)
    clocks = tuple(_clock(item, read) for item in data["time_events"])
    # Files from before there were outputs have none.
    outputs = check_outputs({name: read(e) for name, e in data.get("outputs", {}).items()}, names, True)
    return System._of_form(form, surfaces, clocks, outputs, data.get("labels", {}))


def _comparator_data(comparator: Comparator | PerSurface) -> dict[str, Any]:
    """A comparator, or those of the surfaces; ModelError where one has an expression for a width."""
    if isinstance(comparator, PerSurface):
        return {"surfaces": {name: _comparator_data(own) for name, own in comparator.items()}}
    values = numbers_of(comparator)
    if any(isinstance(value, Expr) for value in values.values()):
        raise ModelError(f"{comparator} has an expression for a width, which is not stored.")
    return {"name": type(comparator).__name__, **values}


def _comparator(data: Any) -> Comparator | dict[str, Any]:
    if "surfaces" in data:
        return {name: _comparator(own) for name, own in data["surfaces"].items()}
    name = data["name"]
    if name not in NAMES:
        raise ModelError(f"the stored comparator is {name!r}, expected one of {', '.join(NAMES)}.")
    given = {key: value for key, value in data.items() if key != "name" and value is not None}
    made: Comparator = NAMES[name](**given)
    return made
