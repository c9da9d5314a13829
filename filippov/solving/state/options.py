"""Options of a run, checked: each is refused by name with what was given, what is expected and what to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.errors import ModelError, UsageError
from filippov.base.given import check_count, choice, flag, number, number_array, positive, several, shown
from filippov.base.labelled import in_order
from filippov.base.names import unknown
from filippov.base.quantity import is_quantity, plain, unit_of_label
from filippov.base.symbolic_value import is_expression, single
from filippov.kernel.codegen.interpreted import BACKENDS
from filippov.kernel.tables.layout import RULES
from filippov.kernel.tables.tableaus import INTEGRATORS, for_tolerance
from filippov.model.system import System
from filippov.model.user_event import UserEvent
from filippov.solving.state.events import Stop
from filippov.solving.state.option_types import METHODS_OF_OTHERS

# The method that takes steps of one length (see `filippov.solving.stepping`).
STEPPING = "Moreau"
METHODS = (*INTEGRATORS, STEPPING)
POLICIES = ("raise", "stick", "slip", "branch")
# Where none is given; see `filippov.solving.scale` for solutions that are small.
LARGEST_ATOL = 1e-12
# What 0 stands for: the error of a state that is 0 has no other measure, and a power of it is to be a number.
LEAST_ATOL = 1e-100
SMALLEST_RTOL = 100 * np.finfo(float).eps


@dataclass(frozen=True)
class Options:
    """Method, tolerances, budgets and policies of a run, after checking."""

    method: str = "DOP853"
    rtol: float = 1e-9
    atol: npt.NDArray[np.float64] | float = LARGEST_ATOL
    first_step: float | None = None
    max_step: float = math.inf
    max_steps: int = 10_000_000
    max_events: int = 100_000
    max_time: float = math.inf
    nonunique: str | tuple[str, ...] | Callable[..., Any] = "raise"
    on_graze: str = "continue"
    zeno: str = "stop"
    simultaneous: str = "raise"
    sliding: str = "filippov"
    stop: tuple[Stop, ...] = ()
    dense_output: bool = True
    save_events: str = "all"
    compile: bool | None = None
    backend: str = "compiled"
    dt: float | None = None
    theta: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "method", method_of(self.method))
        positive("rtol", self.rtol)
        if self.rtol < SMALLEST_RTOL:
            raise UsageError(f"rtol is {self.rtol:g}, expected at least {SMALLEST_RTOL:.2g} (100 roundings).")
        if isinstance(self.atol, float):
            good = 0.0 <= self.atol < math.inf
        else:
            atol = np.asarray(number_array("atol", self.atol))
            good = bool(np.all(np.isfinite(atol)) and not np.any(atol < 0))
        if not good:
            raise UsageError(f"atol is {self.atol}, expected numbers >= 0.")
        self._check_stepping()
        if self.first_step is not None:
            positive("first_step", self.first_step)
        positive("max_step", self.max_step, infinite=True)
        positive("max_time", self.max_time, infinite=True)
        for name in ("max_steps", "max_events"):
            check_count(name, getattr(self, name))
        if not isinstance(self.nonunique, tuple):
            choice("nonunique", self.nonunique, POLICIES, or_function=True)
        choice("on_graze", self.on_graze, ("continue", "error"))
        choice("zeno", self.zeno, ("stop", "continue"))
        choice("simultaneous", self.simultaneous, ("raise", "sequential", "generalised Newton"))
        choice("sliding", self.sliding, RULES)
        choice("backend", self.backend, BACKENDS)
        choice("save_events", self.save_events, ("all", "count"))
        flag("compile", self.compile, open_too=True)
        flag("dense_output", self.dense_output)
        if self.save_events == "count":
            object.__setattr__(self, "dense_output", False)

    @cached_property
    def stepper(self) -> str:
        """The method with its order at this tolerance, where it has several."""
        return for_tolerance(self.method, self.rtol)

    def _check_stepping(self) -> None:
        """dt and theta go with the method that takes steps of one length, and it with dt."""
        for name in ("dt", "theta"):
            if getattr(self, name) is not None and self.method != STEPPING:
                raise UsageError(
                    f"{name} is of method={STEPPING!r}, which takes steps of one length; {self.method} "
                    "chooses its steps: max_step is their bound, rtol and atol their error."
                )
        if self.method != STEPPING:
            return
        if self.dt is None:
            raise UsageError(f"method {STEPPING!r} needs dt, the length of its steps: solve(..., dt=1e-3).")
        positive("dt", self.dt)
        if self.theta is not None and not 0.5 <= positive("theta", self.theta) <= 1.0:
            raise UsageError(f"theta is {self.theta}, expected 0.5 (order 2) to 1 (implicit Euler).")

    def check_span(self, t_span: tuple[float, float]) -> None:
        """Refuse steps longer than the span: nothing could come of them."""
        span = abs(t_span[1] - t_span[0])
        for name in ("first_step", "max_step", "dt"):
            value = getattr(self, name)
            if value is not None and math.isfinite(value) and 0.0 < span * (1.0 + 1e-12) < value:
                hint = "" if name == "dt" else " Leave it out."
                raise UsageError(
                    f"{name} is {value:g}, longer than t_span, {span:g}: expected at most that.{hint}"
                )

    def check_system(self, system: System) -> None:
        """Refuse compile=False for a system that runs in no other way, and Taylor's method for functions."""
        if self.method == "Taylor" and system.field is not None:
            raise UsageError(
                "method is 'Taylor', which needs the field as expressions, but the system is given as plain "
                "functions. Leave method out (DOP853), or give the system as expressions: System({x: ...})."
            )
        if self.method == "Taylor" and system.inputs:
            raise UsageError(
                f"method is 'Taylor', whose series know no inputs, but the equations name input "
                f"{system.inputs[0].name!r}. Leave method out (DOP853)."
            )
        if self.compile is False and system.field is None:
            raise UsageError(
                "compile is False, but the system is given by expressions, which run compiled only. Leave "
                "compile out, or give the field as a plain function: System(field=f, ...)."
            )

    def tolerances(self, system: System) -> npt.NDArray[np.float64]:
        """One absolute tolerance per state, at least LEAST_ATOL."""
        if isinstance(self.atol, float):
            return np.full(system.dimension, max(self.atol, LEAST_ATOL))
        atol = np.asarray(self.atol, dtype=float)
        if atol.ndim and atol.shape != (system.dimension,):
            raise UsageError(
                f"atol has shape {atol.shape}, expected one number or {system.dimension} "
                f"(states: {', '.join(system.states)})."
            )
        return np.ascontiguousarray(np.broadcast_to(np.maximum(atol, LEAST_ATOL), (system.dimension,)))


OPTIONS = tuple(item.name for item in fields(Options))
_DEFAULTS = {item.name: None if item.name == "atol" else item.default for item in fields(Options)}
_PLAIN, _NUMBERS = frozenset({float, int, str, bool}), frozenset({float, int})


def given_options(values: Mapping[str, Any]) -> dict[str, Any]:
    """Of a function's arguments by name the options that differ from their defaults; atol: that are given."""
    out = {}
    for name, default in _DEFAULTS.items():
        value = values.get(name, default)
        if value is not default and not (type(value) is type(default) and value == default):
            out[name] = value
    return out


def checked_options(given: Mapping[str, Any]) -> Options:
    """Options(**given); numbers and words that were checked before are not checked again."""
    for name, value in given.items():
        if type(value) not in _PLAIN and not (name == "stop" and all(type(item) is Stop for item in value)):
            return Options(**given)
    # By type as well: True is equal to 1, and refused where 1 is taken.
    return _checked(tuple([(name, type(value), value) for name, value in given.items()]))


@lru_cache(maxsize=256)
def _checked(given: tuple[tuple[str, type, Any], ...]) -> Options:
    return Options(**{name: value for name, _, value in given})


def method_of(name: object) -> str:
    """The name of a method here; scipy's RK45 is DP5. Raises UsageError, with the equivalent of others'."""
    if isinstance(name, str) and name == "RK45":
        return "DP5"
    if isinstance(name, str) and name in METHODS_OF_OTHERS:
        raise UsageError(f"method {name!r} is not among {', '.join(METHODS)}: use {METHODS_OF_OTHERS[name]}.")
    if not isinstance(name, str) or name not in METHODS:
        raise UsageError(unknown("method", name, METHODS))
    return name


def options_but(*others: str) -> tuple[str, ...]:
    """The options of `solve` without some, for what takes only the rest."""
    assert set(others) <= set(OPTIONS)
    return tuple(name for name in OPTIONS if name not in others)


def check_state(x0: Any, system: System) -> npt.NDArray[np.float64]:
    """The initial state as a float64 vector: a sequence in the order of the states, or values by name.

    By name are a mapping, a row of a table of pandas and an array of one record.
    """
    array = _usual_state(x0, system.dimension)
    if array is not None:
        return array
    if isinstance(x0, dict):
        names = [str(getattr(single(key), "name", key)) for key in x0]
        for name in names:
            if name not in system.states:
                raise UsageError(unknown("state", name, system.states))
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise UsageError(f"x0 gives {', '.join(twice)} twice, by name and as a symbol; give it once.")
        missing = [name for name in system.states if name not in names]
        if missing:
            raise UsageError(
                f"x0 has no value for {', '.join(missing)}; expected one for each of {system.states}."
            )
        values = dict(zip(names, x0.values(), strict=True))
        x0 = [values[name] for name in system.states]
    elif getattr(x0, "ndim", 1) < 2 and (labelled := in_order(x0, system.states, "x0")) is not None:
        x0 = labelled
    x0 = without_units(x0, system)
    if is_quantity(x0):
        raise UsageError(f"x0 is the quantity {x0}, expected one quantity or number per state: x0=(q1, q2).")
    array = number_array("x0", x0)
    if array.shape != (system.dimension,):
        raise UsageError(
            f"x0 has shape {array.shape}, expected {system.dimension} number{'s'[: system.dimension - 1]} "
            f"(states: {', '.join(system.states)}). Write x0=({', '.join(['0'] * system.dimension)}"
            f"{',' if system.dimension == 1 else ''}), or by name: "
            f"x0={{{', '.join(repr(name) + ': 0' for name in system.states)}}}."
            f"{' Several initial states: solve_many(system, x0, t_span).' if array.ndim == 2 else ''}"
        )
    for name, value in zip(system.states, array, strict=True):
        if not math.isfinite(value):
            raise UsageError(f"x0: state {name!r} is {value}, expected a finite number.")
    return np.array(array)


def without_units(x0: Any, system: System, name: str = "x0") -> Any:
    """A state whose quantities are converted to the units of the labels; anything else as it is.

    Raises ModelError for a quantity of another dimension, or where a label has no unit.
    """
    entries = x0.tolist() if isinstance(x0, np.ndarray) and x0.dtype == object and x0.ndim == 1 else x0
    if not isinstance(entries, list | tuple) or len(entries) != system.dimension:
        return x0
    if not any(map(is_quantity, entries)):
        return x0
    return [
        plain(q, unit_of_label(system.labels.get(state, "")), f"{name}: state {state!r}")
        for q, state in zip(entries, system.states, strict=True)
    ]


def _usual_state(x0: Any, n: int) -> npt.NDArray[np.float64] | None:
    """A state as it is given mostly, n finite numbers in order, copied; None for anything else."""
    if type(x0) is np.ndarray and x0.dtype == np.float64 and x0.shape == (n,):
        array: npt.NDArray[np.float64] = x0.copy()
    elif type(x0) in (tuple, list) and len(x0) == n and _NUMBERS.issuperset(map(type, x0)):
        try:
            array = np.array(x0, dtype=np.float64)
        except OverflowError:  # an integer beyond the range of numbers
            return None
    else:
        return None
    return array if all(map(math.isfinite, array.tolist())) else None


def check_span(t_span: Any, backward: bool | int = False, x0: Any = None) -> tuple[float, float]:
    """Two finite times, the second before the first only where `backward` says so.

    x0      the initial state given with it: a span that falls may be one, in scipy's order
    """
    try:
        start, end = t_span
    except (TypeError, ValueError):
        more = ""
        if isinstance(t_span, list | tuple | np.ndarray) and np.ndim(t_span) == 1 and len(t_span) > 2:
            more = f" Times at which to evaluate are t_eval=...: t_span=({t_span[0]}, {t_span[-1]})."
        wanted = "expected two times, (t0, t1): t_span=(0, 10)."
        raise UsageError(f"t_span is {shown(t_span)}, {wanted}{more}") from None
    values = []
    for name, value in (("t0", start), ("t1", end)):
        found = number(value, f"t_span: {name}", infinite=True)
        if math.isinf(found):
            raise UsageError(
                f"t_span: {name} is {value}, expected a finite number. A run that is to end at an event has "
                "stop=Stop(surface, kind), or events with terminal=True, and a late t1 such as 1e6."
            )
        values.append(found)
    # -1 is a sense of time as well as a flag.
    backward = True if type(backward) is int and backward == -1 else flag("backward", backward)
    if values[1] < values[0] and not backward:
        other = exchanged(x0, (values[0], values[1]))
        raise UsageError(
            f"t_span is {tuple(values)}, which runs backwards in time. If that is meant, say "
            f"backward=True.{other}"
        )
    if values[1] > values[0] and backward:
        raise UsageError(
            f"backward is True, but t_span is {tuple(values)}, which runs forwards. Give (t0, t1) with "
            "t1 < t0, or drop backward."
        )
    return values[0], values[1]


def exchanged(x0: Any, span: tuple[float, float]) -> str:
    """What is said where a state may be the span and the span the state, in scipy's order; else nothing."""
    pair = as_pair(x0)
    if pair is None or pair[0] > pair[1] or (pair[0] == pair[1] and span[0] == span[1]):
        return ""
    return (
        f" If {pair} is the span and {span} the state, they are in the order of "
        f"scipy's solve_ivp: here x0 goes first, x0={span}, t_span={pair}."
    )


def as_pair(value: Any) -> tuple[float, float] | None:
    """Two plain numbers, None for anything else."""
    if is_quantity(value) or (isinstance(value, list | tuple) and any(map(is_quantity, value))):
        return None
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    if array.shape != (2,) or array.dtype.kind not in "fiu":
        return None
    first, second = array.tolist()
    return first, second


def falls(t_span: Any) -> bool:
    """Whether a span, checked or not, has its end before its start."""
    try:
        start, end = t_span
        return bool(end < start)
    except (TypeError, ValueError):
        return False


def check_times(t_eval: Any, span: tuple[float, float]) -> npt.NDArray[np.float64]:
    """Output times inside the span, in the direction of integration, each once."""
    times = number_array("t_eval", t_eval)
    if times.ndim != 1:
        raise UsageError(
            f"t_eval has shape {times.shape}, expected one dimension: the times themselves, such as "
            f"np.linspace({span[0]:g}, {span[1]:g}, 100)."
        )
    low, high = min(span), max(span)
    outside = ~((times >= low) & (times <= high))
    if np.any(outside):
        i = int(np.argmax(outside))
        raise UsageError(
            f"t_eval[{i}] = {times[i]} lies outside t_span = {span}. Leave it out, or solve further."
        )
    steps = np.diff(times) * (1.0 if span[1] >= span[0] else -1.0)
    if np.any(steps <= 0):
        i = int(np.argmax(steps <= 0))
        raise UsageError(
            f"t_eval[{i}] = {times[i]} and t_eval[{i + 1}] = {times[i + 1]} are not in the order of "
            "integration; sort them and drop repeated ones."
        )
    return times


def check_priority(nonunique: Any, system: System) -> Any:
    """A list of modes as text, made a tuple and compared with the surfaces; other policies as they are."""
    if isinstance(nonunique, str) or callable(nonunique):
        return nonunique
    try:
        modes = tuple(nonunique)
    except TypeError:
        modes = ()
    if not modes or not all(isinstance(mode, str) for mode in modes):
        raise UsageError(
            f"nonunique is {nonunique!r}, expected one of {', '.join(POLICIES)}, a list of modes such as "
            "['+', '0'], or a function from the list of candidates to the one to take."
        )
    names = system.surface_names
    for mode in modes:
        if len(mode) != len(names) or set(mode) - set("+0-"):
            raise UsageError(
                f"nonunique holds the mode {mode!r}, expected one of +, 0, - for each of the "
                f"{len(names)} surfaces ({', '.join(names)})."
            )
    return modes


def check_stops(stops: Sequence[Stop] | Stop, system: System) -> tuple[Stop, ...]:
    """Stops at surfaces that the system has, under the names that they have there."""
    given: Any = stops
    alone = isinstance(given, Stop | str | bool | UserEvent) or callable(given) or is_expression(given)
    items = [given] if alone else several("stop", given)
    return tuple(_stop_at(item, system) for item in items)


def _stop_at(stop: object, system: System) -> Stop:
    if not isinstance(stop, Stop):
        raise UsageError(
            f"stop holds {shown(stop)}, expected Stop(surface, kind, count): stop=Stop('v', 'crossing'). A "
            "function or an expression is watched by events=UserEvent(g, terminal=True)."
        )
    try:
        place, sense = system.surface_place(stop.surface)
    except ModelError as error:
        raise UsageError(str(error)) from None
    return stop.on(system.surface_names[place], sense)
