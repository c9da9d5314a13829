"""A view: it determines everything that the page shows, and a link contains it.

    ?p.k=2&x0.x=0.5&t1=20&against=Smooth&width=0.01

A link contains the settings that differ from those of the subject. It is read as text and numbers, every name
and value is checked, and nothing in it is executed.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Self
from urllib.parse import parse_qsl, urlencode

from filippov import Parameter, UsageError
from filippov.app.explorer.field import Field, slider_range, step_of
from filippov.app.explorer.subject import Subject
from filippov.base.names import unknown
from filippov.model.comparator import NAMES
from filippov.solving.state.options import check_state

EXACT = "Exact"
LONGEST = 4000  # characters of a link
MOST_PARTS = 200
MOST_ORDER = 8


class View:
    """Values of all fields of a subject, checked; `view["p.k"]` reads one."""

    def __init__(self, subject: Subject, values: Mapping[str, Any] | None = None) -> None:
        """Take the subject's own values where none is given. Raises UsageError, with every complaint."""
        self.subject = subject
        given = dict(values or {})
        known = self.fields = fields_of(subject, given.get("over"))
        wrong = [unknown("setting", key, known) for key in given if key not in known]
        self.values: dict[str, Any] = {key: item.default for key, item in known.items()}
        for key, value in given.items():
            try:
                self.values[key] = known[key].read(value) if key in known else None
            except UsageError as error:
                wrong.append(str(error))
        if not wrong:
            wrong = [*self._crossed()]
        if wrong:
            raise UsageError(" ".join(text if text.endswith(".") else text + "." for text in wrong))

    def _crossed(self) -> list[str]:
        pairs = [("t0", "t1"), *([("low", "high")] if "low" in self.values else [])]
        return [
            f"{a} is {self[a]:g} and {b} is {self[b]:g}, expected {a} < {b}."
            for a, b in pairs if not self[a] < self[b]
        ]  # fmt: skip

    def __getitem__(self, key: str) -> Any:
        return self.values[key]

    def but(self, settings: Mapping[str, Any] | None = None, /, **changes: Any) -> Self:
        """The view with other values: settings by key, changes by the name of a parameter or by key.

        x0 takes a state as `solve` does, or some components by name. Raises UsageError, also for a name that
        is both a parameter's and a setting's.
        """
        named: dict[str, Any] = {}
        for name, value in changes.items():
            parameter = f"p.{name}" in self.values
            if parameter and name in self.values:
                raise UsageError(
                    f"{name!r} is a parameter and a setting: give {{'p.{name}': ...}} or {{{name!r}: ...}}."
                )
            if not parameter and name not in {"x0", *self.values}:
                short = [*self.subject.parameters, "x0", *(key for key in self.values if "." not in key)]
                raise UsageError(unknown("setting", name, short))
            if name == "x0":
                own = dict(zip(self.subject.system.states, self.x0, strict=True))
                state = check_state(
                    {**own, **value} if isinstance(value, dict) else value, self.subject.system
                )
                named |= {f"x0.{q}": v for q, v in zip(own, state.tolist(), strict=True)}
            else:
                named[f"p.{name}" if parameter else name] = value
        new = {**(settings or {}), **named}
        # Another parameter has its own range, unless one is given.
        left = {"low", "high"} - set(new) if "over" in new else set()
        return type(self)(self.subject, {k: v for k, v in (self.values | new).items() if k not in left})

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters by name."""
        return {name: self["p." + name] for name in self.subject.parameters}

    @property
    def x0(self) -> list[float]:
        """The initial state."""
        return [self["x0." + name] for name in self.subject.system.states]

    @property
    def t_span(self) -> tuple[float, float]:
        """First and last time."""
        return self["t0"], self["t1"]

    @property
    def query(self) -> str:
        """The part of a link after the question mark: the settings that differ from the subject's."""
        changed = {key: value for key, value in self.values.items() if value != self.fields[key].default}
        return urlencode({k: repr(v) if isinstance(v, float) else v for k, v in changed.items()})

    @classmethod
    def from_query(cls, subject: Subject, text: str) -> Self:
        """The view of a link, or of its part after the question mark. Raises UsageError."""
        if len(text) > LONGEST:
            raise UsageError(f"the link has {len(text)} characters, expected at most {LONGEST}.")
        part = text.rpartition("?")[2] if "?" in text else text
        try:
            pairs = parse_qsl(
                part, keep_blank_values=True, strict_parsing=bool(part), max_num_fields=MOST_PARTS
            )
        except ValueError:
            raise UsageError(
                f"the link has {part[:80]!r} after its ?, expected name=value&name=value."
            ) from None
        if twice := {key for key, _ in pairs if sum(key == other for other, _ in pairs) > 1}:
            raise UsageError(f"the link gives {', '.join(sorted(twice))} more than once.")
        return cls(subject, dict(pairs))


def fields_of(subject: Subject, over: Any = None) -> dict[str, Field]:
    """All settings of a view, by key, in the order of the page; over: the parameter of its diagram."""
    system, items = subject.system, []
    for name, value in subject.parameters.items():
        q = system.parameters[name]
        items.append(Field(
            f"p.{name}", value, q.description or "", q.unit, check=partial(_within, q),
            slider=slider_range(q, value), group="parameters",
        ))  # fmt: skip
    for name, value in zip(system.states, subject.x0, strict=True):
        items.append(Field(f"x0.{name}", value, subject.label(name), group="start",
                           slider=slider_range(Parameter(0.0), value)))  # fmt: skip
    items += [
        Field("t0", subject.t_span[0], "from " + subject.label("t"), group="start"),
        Field("t1", subject.t_span[1], "to " + subject.label("t"), group="start"),
    ]
    shown = system.states
    items += [
        Field("x", shown[0], "phase portrait, across", choices=shown, group="shown"),
        Field("y", shown[min(1, len(shown) - 1)], "phase portrait, up", choices=shown, group="shown"),
        Field("against", EXACT, "beside the exact one", choices=tuple(NAMES), group="shown"),
        Field("width", 0.01, "its half-width", check=_positive, group="shown"),
    ]
    if subject.section is not None:
        if subject.interval is not None:
            low, high = subject.interval
            items.append(Field("d", low + 0.5 * (high - low), f"cobweb from {subject.section.coordinate}",
                               slider=(low, high, step_of(low, high)), group="map"))  # fmt: skip
        items.append(Field("order", 1, "returns per step", check=_order, group="map"))
        if ranges := diagram_ranges(subject):
            chosen = over if over in ranges else next(iter(ranges))
            items += [
                Field("over", next(iter(ranges)), "diagram over", choices=tuple(ranges), group="map"),
                Field("low", ranges[chosen][0], "from", group="map"),
                Field("high", ranges[chosen][1], "to", group="map"),
            ]
    return {item.key: item for item in items}


def diagram_ranges(subject: Subject) -> dict[str, tuple[float, float]]:
    """Parameters of a diagram, with their initial ranges."""
    ranges = {
        name: slider_range(subject.system.parameters[name], v) for name, v in subject.parameters.items()
    }
    return {name: found[:2] for name, found in ranges.items() if found is not None}


def _within(parameter: Parameter, value: float) -> float:
    return parameter.check(value, "it")


def _positive(value: float) -> float:
    if not value > 0:
        raise UsageError(f"it is {value:g}, expected a number > 0.")
    return value


def _order(value: int) -> int:
    if not 1 <= value <= MOST_ORDER:
        raise UsageError(f"it is {value}, expected 1 to {MOST_ORDER}.")
    return value
