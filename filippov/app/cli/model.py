"""MODEL on the command line: a registered name, or `path/to/file.py:name` with a file of the user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from filippov import ModelError, Problem, System, UsageError
from filippov.base.escape import figure_text
from filippov.base.names import closest
from filippov.base.user_file import load_file, place_of
from filippov.models import problem, registry
from filippov.plot.style import axis_label
from filippov.solving.state.options import check_state, falls

# States that a message names one by one.
MOST_NAMED = 6


@dataclass(frozen=True)
class Loaded:
    """A system with the values to start from.

    x0, t_span   None where the model has none
    parameters   values by name that differ from the system's defaults
    entry        the registry's entry or its name, None for a bare system
    """

    name: str
    system: System
    x0: Any = None
    t_span: tuple[float, float] | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    entry: registry.Model | str | None = None

    @property
    def model(self) -> registry.Model | None:
        """The registry's entry, None for a bare system."""
        return registry.get(self.entry) if isinstance(self.entry, str) else self.entry

    @property
    def title(self) -> str:
        """The name as the title of a picture."""
        return figure_text(self.name)

    def labels(self, *names: str) -> dict[str, str]:
        """Labels of axes with units, by name of state, output or parameter."""
        return {name: axis_label(self.system, name) for name in names}

    def values(self, given: Mapping[str, float] | None) -> dict[str, float]:
        """All parameter values of a run; UsageError, with a suggestion, for one the system does not have."""
        try:
            resolved = self.system.parameters.resolve({**self.parameters, **(given or {})})
        except ModelError as error:
            raise UsageError(str(error)) from None
        return dict(zip(self.system.parameters.names, resolved.tolist(), strict=True))

    def problem(self, settings: Mapping[str, Any]) -> Problem:
        """The problem, with what the settings have of x0, t_span and parameters. Raises UsageError."""
        span = settings.get("t_span") or self.t_span
        if span is None:
            also = self.x0 is None and settings.get("x0") is None
            state = f" and --x0 {self.blanks()}" if also else ""
            raise UsageError(
                f"{self.name} has no time span{' and no initial state' if also else ''} of its own; give "
                f"--t-span T0 T1{state}."
            )
        state, values = self.state(settings.get("x0")), self.values(settings.get("parameters"))
        own, backward = not settings.get("t_span"), bool(settings.get("backward"))
        if not own and backward != falls(span):
            way, cure = ("forwards", "drop") if backward else ("backwards", "add")
            cure = f"{cure} --backward or " if "backward" in settings else ""  # not every command has it
            raise UsageError(f"--t-span {span[0]:g} {span[1]:g} runs {way} in time: {cure}exchange the two.")
        backward = backward or falls(span)
        return Problem(self.system, state, span, values, backward)

    def blanks(self) -> str:
        """What is to be written after --x0."""
        names = self.system.states
        if len(names) <= MOST_NAMED:
            return ",".join(f"{name}=..." for name in names)
        first = ",".join(f"{name}=..." for name in names[:2])
        return f"{first},... (a value for each of the {len(names)} states, or all in order: 0,0,...)"

    def state(self, given: Any) -> Any:
        """An initial state: what is given, by name over the model's own."""
        if given is None:
            if self.x0 is None:
                raise UsageError(f"{self.name} has no initial state of its own; give --x0 {self.blanks()}.")
            return self.x0
        if isinstance(given, dict) and self.x0 is not None:
            own = dict(zip(self.system.states, check_state(self.x0, self.system).tolist(), strict=True))
            return own | given
        dimension = len(self.system.states)
        if isinstance(given, list | tuple) and len(given) != dimension:
            raise UsageError(
                f"--x0 gives {len(given)} number{'s'[: len(given) - 1]}, expected {dimension} numbers "
                f"(states: {', '.join(self.system.states)}): --x0 {self.blanks()}."
            )
        return given


def load_model(name: str | None) -> Loaded:
    """The model that MODEL names. Raises UsageError; ModelError where the file itself fails."""
    if not name:
        raise UsageError("no MODEL was given: name a registered one (filippov models) or file.py:name.")
    if ".py" not in name:
        file, colon, attribute = name.partition(":")
        if colon:
            raise UsageError(f"{name!r} names no file; write {file}.py:{attribute}, what is in which file.")
        if name not in registry.names() and Path(f"{name}.py").is_file():
            raise UsageError(f"unknown model {name!r}; there is a file of this name: write {name}.py:NAME.")
        return _of_problem(name, problem(name), name)
    path, colon, attribute = name.rpartition(":")
    if not colon or not path.endswith(".py"):
        path, attribute = name.removesuffix(":"), ""
    module = load_file(Path(path))
    if not attribute:
        raise UsageError(f"{path!r} names a file; name what is in it too: {path}:{_listing(module, '|')}.")
    if not hasattr(module, attribute):
        near = closest(attribute, [n for n in vars(module) if not n.startswith("_")])
        near = near + " " if near else ""
        raise UsageError(f"{path!r} has no {attribute!r}; {near}systems in it: {_listing(module, ', ')}")
    return _of_object(name, getattr(module, attribute))


def loaded_of(settings: Mapping[str, Any]) -> Loaded:
    """The model of the settings, with the signals of --input in it. Raises UsageError, ModelError."""
    loaded = load_model(settings["model"])
    given = settings.get("input")
    if not given:
        return loaded
    from filippov.model.signals.input import Input

    made: Any = Input
    signals = {}
    for name, (file, options) in given.items():
        try:
            signals[name] = made.from_csv(name, file, **options)
        except ModelError as error:
            raise UsageError(f"--input {name}: {error}") from None
    try:
        system = loaded.system.with_inputs(signals)
    except ModelError as error:
        raise UsageError(f"--input: {error}") from None
    own = {name: value for name, value in loaded.parameters.items() if name not in signals}
    return replace(loaded, system=system, parameters=own, entry=None)


def _of_model(model: registry.Model) -> Loaded:
    return Loaded(model.name, model.build(), model.x0, model.t_span, model.parameters, entry=model)


def _of_problem(name: str, made: Problem, entry: str | None = None) -> Loaded:
    return Loaded(name, made.system, made.x0, made.t_span, made.parameters, entry)


def _of_object(name: str, value: Any) -> Loaded:
    made = value
    if callable(value) and not isinstance(value, System | Problem | registry.Model):
        try:
            made = value()
        except Exception as error:
            raise ModelError(f"{name} failed: {place_of(error, name)}") from error
    if isinstance(made, registry.Model):
        return _of_model(made)
    if isinstance(made, Problem):
        return _of_problem(name, made)
    if isinstance(made, System):
        return Loaded(name, made)
    what = f"returned {type(made).__name__}" if made is not value else f"is {type(made).__name__}"
    raise UsageError(f"{name} {what}, expected a System, a Problem, or a function that returns a System.")


def _listing(module: ModuleType, between: str) -> str:
    names = [n for n, value in vars(module).items() if isinstance(value, System | Problem | registry.Model)]
    own = [
        n for n, value in vars(module).items()
        if callable(value) and not isinstance(value, type) and value.__module__ == module.__name__
    ]  # fmt: skip
    return between.join([*names, *(n for n in own if n not in names)]) or "(none)"
