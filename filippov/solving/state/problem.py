"""A problem: a system with initial state, time span and parameter values; re-made, never edited."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from typing import Any, ClassVar, NoReturn

import numpy as np
import numpy.typing as npt

from filippov.base.errors import UsageError
from filippov.base.given import shown
from filippov.base.keywords import keywords
from filippov.base.names import Answering
from filippov.base.quantity import is_quantity, plain, unit_of_label
from filippov.model.system import System
from filippov.solving.state.option_types import ANSWERS, SAME_AS, BranchOptions
from filippov.solving.state.options import as_pair, check_span, check_state, falls

_OF_SOLVE = {
    name: f"{name} is an option of the run: solve(problem, {name}=...)."
    for name in (*BranchOptions.__annotations__, "nonunique", "theta", "t_eval", "events", "throw")
}
_PARTS = ("x0", "t_span", "tspan", "parameters", "params", "system")


def needs_system(function: str, given: object) -> None:
    """Refuse what is no System in place of one, with what makes one of it."""
    if not isinstance(given, System):
        raise UsageError(no_system(function, given, "a System"))


def no_system(function: str, given: object, expected: str) -> str:
    """What is said of something else in place of a system."""
    what, how = type(given).__name__, "Equations make one: System({x: v, v: ...})."
    if isinstance(given, Problem):
        how = "The system of a problem is problem.system; problem.remake(x0=...) changes the rest."
    elif isinstance(given, str):
        what = shown(given)
        if given.isidentifier():
            how = f"A model has one, from filippov import models: models.get({given!r}).build()."
    elif what == "Model" and hasattr(given, "build"):
        how = f"Its system is models.get({getattr(given, 'name', '')!r}).build()."
    elif isinstance(given, type):
        what = f"the class {given.__name__}"
    elif callable(given):
        how = "A function f(t, x, p, s) makes one: System(field=f, states='x v')."
    return f"{function} was given {what}, expected {expected}: {function}(System({{...}}), x0, t_span). {how}"


class Problem(Answering):
    """x' in F(t, x; p), x(t0) = x0, t in [t0, t1]; immutable.

    x0          one number per state, in order or by name
    t_span      (t0, t1), finite
    parameters  values by name; the others keep their defaults
    backward    True for a span with t1 < t0, which is refused without it

    Raises UsageError, ModelError.
    """

    __slots__ = ("p", "parameters", "system", "t_span", "x0")
    _elsewhere: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("solve", "run", "simulate", "integrate"), "solve(problem) solves it."),
        **dict.fromkeys(
            ("copy", "replace", "set", "update", *(f"with_{part}" for part in _PARTS)),
            "problem.remake(x0=..., t_span=..., parameters={...}) is the same with other parts.",
        ),
    }

    system: System
    x0: npt.NDArray[np.float64]
    t_span: tuple[float, float]
    parameters: Mapping[str, float]
    p: npt.NDArray[np.float64]

    @keywords(
        "part of a problem", same=SAME_AS, answers=ANSWERS | _OF_SOLVE, own=("system",), first=needs_system
    )
    def __init__(
        self, system: System, x0: Any, t_span: Any, parameters: Mapping[str, float] | None = None,
        backward: bool | int = False,
    ) -> None:  # fmt: skip
        state, span = _start_and_span(system, x0, t_span, backward)
        self._set(system, state, span, system.parameters.resolve(parameters))

    def _set(
        self, system: System, x0: npt.NDArray[np.float64], t_span: tuple[float, float],
        p: npt.NDArray[np.float64],
    ) -> None:  # fmt: skip
        x0.flags.writeable = p.flags.writeable = False
        put = object.__setattr__
        put(self, "system", system)
        put(self, "x0", x0)
        put(self, "t_span", t_span)
        put(self, "p", p)
        put(self, "parameters", dict(zip(system.parameters.names, p.tolist(), strict=True)))

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a Problem is immutable; use remake({name}=...).")

    def __repr__(self) -> str:
        return f"Problem({self.system!r}, x0={self.x0.tolist()}, t_span={self.t_span})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Problem, (self.system, self.x0, self.t_span, dict(self.parameters), self.backward)

    @property
    def backward(self) -> bool:
        """Whether it runs backwards in time."""
        return self.t_span[1] < self.t_span[0]

    @keywords("part of a problem", same=SAME_AS, answers=ANSWERS | _OF_SOLVE)
    def remake(
        self, *, system: System | None = None, x0: Any = None, t_span: Any = None,
        parameters: Mapping[str, float] | None = None, backward: bool | int | None = None,
    ) -> Problem:  # fmt: skip
        """The same problem with some of system, x0, t_span, parameters replaced; parameters by name.

        A decreasing t_span needs backward=True, unless the problem runs backwards already.
        """
        whole = self.system if system is None else system
        new = dict(parameters or {})
        span = self.t_span if t_span is None else t_span
        moved = x0 is not None or t_span is not None or backward is not None
        if backward is None:
            backward = self.backward and falls(span)
        if whole is not self.system:
            values = {k: v for k, v in self.parameters.items() if k in whole.parameters} | new
            return Problem(whole, self.x0 if x0 is None else x0, span, values, backward)
        # What is the same was checked before.
        made, state = Problem.__new__(Problem), self.x0
        if moved:
            state, span = _start_and_span(whole, state if x0 is None else x0, span, backward)
        made._set(whole, state, span, whole.parameters.resolve(new, self.p))
        return made


def _start_and_span(
    system: System, x0: Any, t_span: Any, backward: bool | int
) -> tuple[npt.NDArray[np.float64], tuple[float, float]]:
    """The initial state and the span, checked."""
    _check_order(x0, t_span, system)
    state = check_state(x0, system)
    if isinstance(t_span, list | tuple) and any(map(is_quantity, t_span)):
        t_span = [plain(q, unit_of_label(system.labels.get("t", "")), "t_span") for q in t_span]
    span = check_span(t_span, backward, x0)
    for samples in system.inputs:
        samples.check_span(span)
    return state, span


def _check_order(x0: Any, t_span: Any, system: System) -> None:
    """Refuse a span in place of the state, where their lengths tell."""
    n, pair = system.dimension, as_pair(x0)
    if n == 2 or pair is None:
        return
    size = 1 if isinstance(t_span, int | float) else len(t_span) if isinstance(t_span, Sized) else 0
    if size == n:
        raise UsageError(
            f"x0 is {pair} and t_span is {t_span}: they look exchanged, as the system has "
            f"{n} state{'s' if n > 1 else ''} ({', '.join(system.states)}). x0 goes first: "
            f"x0={t_span}, t_span={pair}."
        )
