"""Derivative of the flow through events: saltation matrices between the transition matrices of the modes.

At an event with guard G (h of a surface reached, the rate at the end of the multiplier's set for a sliding
exit), fields f- before and f+ after,

    S = I + (f+ - f-) (grad G)^T / (dG/dt + grad G . f-)

(Aizerman & Gantmakher 1958; Leine & Nijmeijer 2004, section 7.3; di Bernardo et al. 2008, section 2.5). Entry
into sliding loses rank by one for each surface: the multipliers that belong to it are 0. At a touching
(dG/dt = 0 along the motion) the flow has no derivative, and that is an error.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from filippov.analysis.variation import mode_field, transition
from filippov.errors import UsageError
from filippov.events import Event, Mode
from filippov.solution import Solution
from filippov.status import EventKind

Array = npt.NDArray[np.float64]


class NotDifferentiableError(ArithmeticError):
    """The flow has no derivative here: it touches a surface, or meets several at once."""


def flow_derivative(solution: Solution, before_last: bool = False) -> Array:
    """d x(t_end) / d x(t0), at fixed times: (n, n).

    before_last: leave out the saltation of an event at the very end (the derivative just before it).
    Raises NotDifferentiableError at touchings and at several surfaces at once; UsageError without dense
    output or for a system of plain functions.
    """
    if solution.sol is None:
        raise UsageError(
            "the derivative of the flow needs the dense output; solve without dense_output=False."
        )
    system, p, sol = solution.problem.system, solution.problem.p, solution.sol
    total = np.eye(system.dimension)
    mode: Mode = solution.start_mode
    begin = 0
    bounds = _steps_before(solution)
    for event, end in zip(solution.events, bounds, strict=True):
        if end > begin:
            total = (
                transition(system, mode, sol.start[begin:end], sol.step[begin:end], _states(solution), p)
                @ total
            )
        begin = end
        last = event is solution.events[-1] and event.t == solution.t_end
        if not (last and before_last):
            total = saltation(solution, event) @ total
        mode = event.after
    count = len(sol.start)
    if count > begin:
        total = (
            transition(system, mode, sol.start[begin:count], sol.step[begin:count], _states(solution), p)
            @ total
        )
    return total


def _states(solution: Solution) -> Callable[[Array], Array]:
    """Dense output that may be asked a rounding beyond the span: a step's last node may lie there."""
    sol = solution.sol
    assert sol is not None

    def state(t: Array) -> Array:
        low, high = min(sol.span), max(sol.span)
        return np.ascontiguousarray(sol(np.clip(t, low, high), side="+").T)

    return state


def _steps_before(solution: Solution) -> list[int]:
    """For each event, how many steps end before or at it."""
    sol = solution.sol
    assert sol is not None
    direction = sol.direction
    return [
        int(np.searchsorted(direction * sol.start, direction * event.t, side="left"))
        for event in solution.events
    ]


def saltation(solution: Solution, event: Event) -> Array:
    """The saltation matrix of one event: (n, n)."""
    system, p = solution.problem.system, solution.problem.p
    n = system.dimension
    together = [other for other in solution.events if other.group == event.group]
    if len(together) > 1:
        names = ", ".join(repr(other.surface) for other in together)
        raise NotDifferentiableError(
            f"the flow is not differentiable at t = {event.t:.9g}: the surfaces {names} are met at once."
        )
    if event.kind is EventKind.GRAZING:
        raise NotDifferentiableError(
            f"the flow is not differentiable at t = {event.t:.9g}: the motion grazes surface "
            f"{event.surface!r}."
        )
    if system.surfaces[event.index].kind != "switching":
        return np.eye(n)
    t, x = np.array([event.t]), event.x[None, :]
    fields = []
    for mode in (event.before, event.after):
        part = mode_field(system, mode)
        fields.append(part.part("f", t, x, part.multipliers(t, x, p), p)[0, :, 0])
    gradient, rate = event_guard(solution, event, fields[0])
    if abs(rate) < 1e-10 * (np.abs(gradient) @ np.abs(fields[0]) + 1e-300):
        raise NotDifferentiableError(
            f"the flow is not differentiable at t = {event.t:.9g}: surface {event.surface!r} is met without "
            "speed."
        )
    return np.eye(n) + np.outer(fields[1] - fields[0], gradient) / rate


def event_guard(solution: Solution, event: Event, before: Array) -> tuple[Array, float]:
    """Gradient of the guard of an event and its rate along the motion before it."""
    system, p = solution.problem.system, solution.problem.p
    t, x = np.array([event.t]), event.x[None, :]
    part = mode_field(system, event.before)
    s = part.multipliers(t, x, p)
    i = event.index
    if event.kind is not EventKind.EXIT:
        gradient = part.part("g", t, x, s, p)[0, i]
        return gradient, float(part.part("gt", t, x, s, p)[0, i, 0] + gradient @ before)
    # The guard is s_i(t, x) minus the end of its set; ends may vary with the state: the rate is differenced.
    row = part.sliding.index(i)
    gradient = part.multiplier_slope(t, x, s, p)[0, row]
    step = 1e-6 * max(abs(event.t), 1e-3)
    side = 1 if event.after[i] > 0 else 0

    def excess(dt: float) -> float:
        at, state = t + dt, x + dt * before
        value = part.multipliers(at, state, p)[0, i]
        return float(value - part.part("radius", at, state, s, p)[0, i, side])

    return gradient, (excess(step) - excess(-step)) / (2 * step)
