"""Derivative of the flow through events: saltation matrices between the transition matrices of the modes.

Derivatives are by y = (x, q, t): states, requested parameters, time (see
`filippov.analysis.sensitivity.variation`). At an event with guard G (h of a surface reached; for a sliding
exit the multiplier less the end of its set), with y' = v- before and v+ after,

    S = I + (v+ - v-) G_y / (G_y v-)

(Aizerman & Gantmakher 1958; Leine & Nijmeijer 2004; di Bernardo et al. 2008). Entry
into sliding loses rank by one for each surface: the multipliers that belong to it are 0. At a tangency
(G_y v- = 0) the flow has no derivative, and that is an error. Several surfaces at once have a saltation
matrix if it does not depend on their order; then it is the product of theirs. At a reset y+ = R(y), v+ taken
at y+,

    S = R_y + (v+ - R_y v-) G_y / (G_y v-)

(di Bernardo et al. 2008, (2.59)), with G = t - t_k at a time event, whose instant t_k does not depend on x.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from filippov import Solution, System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.sensitivity.reset_slopes import instant_slopes, reset_slopes, slopes_in_turn
from filippov.analysis.sensitivity.smooth_parts import Smooth, along, arrived, cut
from filippov.analysis.sensitivity.variation import mode_field, signs_at, transitions
from filippov.base.arrays import Array
from filippov.base.keywords import keywords
from filippov.base.status import AT_KNOT, JUMPED_OVER, EventKind, mode_text
from filippov.solving.selection.modes import successors
from filippov.solving.state.events import Event, Mode
from filippov.solving.state.machine import Machine
from filippov.solving.state.point import Point

# Of what a reset moves h: what is left of it is rounding.
ON_SURFACE = 1e-6


class NotDifferentiableError(ArithmeticError):
    """The flow has no derivative here: it grazes a surface, or reaches several whose order matters."""


@dataclass(frozen=True)
class Factor:
    """One factor of the derivative: over a segment of one mode, or of the events of one instant.

    t, mode  time and mode where it ends; matrix: (N, N) in y = (x, q, t)
    """

    t: float
    mode: Mode
    matrix: Array


# By solution: (before_last, jacobian), names of parameters, factors.
_Kept = tuple[tuple[bool, Any], tuple[str, ...], list[Factor]]
_KEPT: WeakKeyDictionary[Solution, _Kept] = WeakKeyDictionary()


@keywords()
def flow_derivative(
    solution: Solution,
    before_last: bool = False,
    *,
    parameters: Sequence[str] = (),
    jacobian: Callable[..., Any] | None = None,
) -> Array:
    """d x(t_end) / d (x(t0), parameters), at fixed times: (n, n + number of parameters).

    before_last: leave out the saltation of events at the very end (the derivative just before them).
    parameters: names of parameters by which it is differentiated too
    jacobian: of a system of plain functions, (t, x, p, s) -> df/dx with signs held; default: by dual
              numbers, else differences

    A solution that starts on sliding surfaces stays on them: the derivative belongs to displacements along
    them. Raises NotDifferentiableError at tangencies and at several surfaces at once whose order matters;
    UsageError without dense output.
    """
    total = derivative_by_all(solution, before_last, tuple(parameters), jacobian)
    n = solution.problem.system.dimension
    return total[:n, : n + len(parameters)]


def derivative_by_all(
    solution: Solution,
    before_last: bool = False,
    names: tuple[str, ...] = (),
    jacobian: Callable[..., Any] | None = None,
) -> Array:
    """d y(t_end) / d y(t0), y = (x, parameters, t): (N, N), with the time between held."""
    total = np.eye(solution.problem.system.dimension + len(names) + 1)
    for factor in flow_factors(solution, before_last, names, jacobian):
        total = factor.matrix @ total
    return total


def flow_factors(
    solution: Solution,
    before_last: bool = False,
    names: tuple[str, ...] = (),
    jacobian: Callable[..., Any] | None = None,
) -> list[Factor]:
    """The factors of the derivative in the order of the solution.

    Those of the last call are kept with the solution: derivatives by fewer parameters are parts of them.
    """
    asked = before_last, jacobian
    kept = _KEPT.get(solution)
    if kept is not None and kept[0] == asked and set(names) <= set(kept[1]):
        n, known, out = solution.problem.system.dimension, kept[1], kept[2]
        rows = [*range(n), *(n + known.index(name) for name in names), n + len(known)]
        return [replace(factor, matrix=factor.matrix[np.ix_(rows, rows)]) for factor in out]
    out = _flow_factors(solution, before_last, names, jacobian)
    _KEPT[solution] = asked, names, out
    return out


def flow_derivatives(solution: Solution, ends: Sequence[float]) -> list[Array | NotDifferentiableError]:
    """d x(end) / d x(begin) over intervals of time, (n, n) each, one after the other from the start on.

    ends   of the intervals, the last one not after the solution's; an event at an end belongs to the interval
           before it. In the place of an interval without a derivative stands the error that says why
    """
    n, cuts = solution.problem.system.dimension, np.asarray(ends, dtype=float)
    sense = 1.0 if solution.sol is None else solution.sol.direction
    out: list[Array | NotDifferentiableError] = [np.eye(n + 1) for _ in ends]
    for piece, matrix in pieces(solution, (), None, cuts):
        k = int(np.searchsorted(sense * cuts, sense * piece.t))
        try:
            so_far = out[k]
            if not isinstance(so_far, NotDifferentiableError):
                out[k] = (piece.saltation() if matrix is None else matrix) @ so_far
        except NotDifferentiableError as error:
            out[k] = error
    return [matrix if isinstance(matrix, NotDifferentiableError) else matrix[:n, :n] for matrix in out]


def _flow_factors(
    solution: Solution, before_last: bool, names: tuple[str, ...], jacobian: Callable[..., Any] | None
) -> list[Factor]:
    out: list[Factor] = []
    for piece, matrix in pieces(solution, names, jacobian, np.zeros(0)):
        if matrix is not None:
            out.append(Factor(piece.t, piece.mode, matrix))
        elif not (before_last and piece.t == solution.t_end and piece.events[-1] is solution.events[-1]):
            out.append(Factor(piece.t, piece.after, piece.saltation()))
    return out


def pieces(
    solution: Solution, names: tuple[str, ...], jacobian: Callable[..., Any] | None, cuts: Array
) -> list[tuple[Any, Array | None]]:
    """The parts of a solution in order: (Smooth, its transition matrix) and, for the events of an instant,
    (Together, None). Segments are cut where they pass the times `cuts`, and left out after the last one."""
    _check_rule(solution)
    sol = solution.sol
    if sol is None:
        raise UsageError(
            "the derivative of the flow needs the dense output; solve without dense_output=False."
        )
    found: list[Smooth | Together] = []
    begin, mode = 0, solution.start_mode
    leaving: tuple[Array, Array] | None = None

    def smooth(end: int, t: float, x: Array, here: Together | None = None) -> None:
        if end > begin:
            # A step's polynomial may reach beyond the event that ended the step.
            starts = sol.start[begin:end]
            whole = Smooth(mode, starts, np.diff(np.append(starts, t)), t, x, leaving, None)
            if here is not None and not whole.resolved:
                whole = replace(whole, arriving=here.arriving())
            found.extend(cut(sol, whole, cuts))

    for _, group in itertools.groupby(solution.events, key=lambda event: event.group):
        events = list(group)
        t = events[0].t
        end = int(np.searchsorted(sol.direction * sol.start, sol.direction * t, side="left"))
        here = Together(solution, events, names, jacobian)
        smooth(end, t, events[0].x, here)
        begin, mode = end, events[-1].after
        found.append(here)
        leaving = here.leaving()
    smooth(len(sol.start), solution.t_end, solution.x_end)
    if cuts.size:
        found = [piece for piece in found if sol.direction * (cuts[-1] - piece.t) >= 0]
    # All that is in one mode is integrated side by side.
    known: dict[int, Array] = {}
    parts = [(k, part) for k, part in enumerate(found) if isinstance(part, Smooth)]
    for mode in dict.fromkeys(part.mode for _, part in parts):
        field, p = mode_field(solution.problem.system, mode, names, jacobian), solution.problem.p
        mine = [(k, part) for k, part in parts if part.mode == mode]
        over = transitions(field, [(part.start, part.step) for _, part in mine], _states(solution), p)
        for (k, part), matrix in zip(mine, over, strict=True):
            known[k] = matrix
            if part.leaving is not None:
                known[k] = along(field, matrix, part, *part.leaving, p)
            if part.arriving is not None:
                begun = sol(part.start[0], side="+")
                known[k] = arrived(field, known[k], part, part.arriving, begun, p)
    return [(piece, known.get(k)) for k, piece in enumerate(found)]


def saltation(solution: Solution, event: Event) -> Array:
    """The saltation matrix of an event and those at the same instant: (n, n)."""
    together = [other for other in solution.events if other.group == event.group]
    n = solution.problem.system.dimension
    return Together(solution, together).saltation()[:n, :n]


def _check_rule(solution: Solution) -> None:
    """Refuse solutions under another rule of sliding: their sliding field is not the one differentiated."""
    rule = solution.options.sliding
    if rule != "filippov":
        raise UsageError(
            f"the derivative of the flow is that of sliding='filippov', the solution has {rule!r}. Solve "
            "with the default rule, or take differences of solutions."
        )


def _states(solution: Solution) -> Callable[[Array], Array]:
    """Dense output that may be asked a rounding beyond the span: a step's last node may lie there."""
    sol = solution.sol
    assert sol is not None

    def state(t: Array) -> Array:
        low, high = min(sol.span), max(sol.span)
        return np.ascontiguousarray(sol(np.clip(t, low, high), side="+").T)

    return state


class Together:
    """The events of one instant."""

    def __init__(
        self, solution: Solution, events: Sequence[Event], names: tuple[str, ...] = (), jacobian: Any = None
    ) -> None:
        _check_rule(solution)
        self.solution, self.events, self.names, self.jacobian = solution, list(events), names, jacobian
        self.system: System = solution.problem.system
        self.p, self.t, self.x = solution.problem.p, events[0].t, events[0].x
        self.before, self.after = events[0].before, events[-1].after
        # What is asked for several times: y' by mode, G_y by mode, surface and side.
        self._velocities: dict[Mode, Array] = {}
        self._guards: dict[tuple[Mode, int, int], Array] = {}

    def velocity(self, mode: Mode) -> Array:
        """y' in a mode here."""
        if mode not in self._velocities:
            self._velocities[mode] = self._velocity(mode, self.x)
        return self._velocities[mode]

    def _velocity(self, mode: Mode, state: Array) -> Array:
        return mode_field(self.system, mode, self.names, self.jacobian).velocity_at(self.t, state, self.p)

    def guard(self, mode: Mode, i: int, side: int) -> Array:
        """G_y of surface i in a mode: of h where it is off it, of the multiplier less its end where it slides
        (side: +1 the upper end, -1 the lower)."""
        key = mode, i, side
        if key not in self._guards:
            self._guards[key] = self._guard(*key)
        return self._guards[key]

    def _guard(self, mode: Mode, i: int, side: int) -> Array:
        part = mode_field(self.system, mode, self.names, self.jacobian)
        t, x = np.array([self.t]), self.x[None, :]
        s = part.multipliers(t, x, self.p)
        if mode[i] != 0:
            return np.asarray(part.part("hy", t, x, s, self.p)[0, i])
        slope = part.multiplier_slope(t, x, s, self.p)[0, part.sliding.index(i)]
        end = part.part("radiusy", t, x, s, self.p)[0, 2 * i + (side > 0)]
        return np.asarray(slope - end)

    def rate(self, mode: Mode, i: int, side: int) -> tuple[Array, float]:
        """G_y and G_y v in a mode. Raises NotDifferentiableError where the guard is reached without speed."""
        slope, velocity = self.guard(mode, i, side), self.velocity(mode)
        rate = float(slope @ velocity)
        if not abs(rate) >= 1e-10 * (np.abs(slope) @ np.abs(velocity) + 1e-300):
            raise self.refused(f"surface {self.system.surfaces[i].name!r} is reached without speed")
        return slope, rate

    def refused(self, why: str) -> NotDifferentiableError:
        """The error that says why there is no derivative."""
        return NotDifferentiableError(f"the flow is not differentiable at t = {self.t:.9g}: {why}.")

    def saltation(self) -> Array:
        """(N, N). Raises NotDifferentiableError."""
        identity = np.eye(self.system.dimension + len(self.names) + 1)
        if any(e.note == AT_KNOT and e.x_after is not None for e in self.events):
            raise self.refused("a knot of an input sets off a reset")
        events = [e for e in self.events if not passive(e)]
        if any(e.x_after is not None for e in events):
            return self._reset(events)
        for event in events:
            if event.kind is EventKind.ENTRY and self.system.surfaces[event.index].kind == "reset":
                raise self.refused(
                    f"impacts accumulate on {event.surface!r}; that is not differentiated. Begin at an orbit "
                    "whose impacts do not accumulate; a cycle on which they do, if it attracts, is where "
                    "solve(system, x0, t_span, zeno='continue') ends after many periods"
                )
        switching = [
            e
            for e in events
            if self.system.surfaces[e.index].kind == "switching"
            or (self.system.surfaces[e.index].kind == "reset" and e.kind is not EventKind.CROSSING)
        ]
        for event in switching:
            if event.kind is EventKind.GRAZING:
                raise self.refused(f"the solution grazes surface {event.surface!r}")
        reached = [e for e in switching if self.leads(e)]
        if not reached:
            if self.before == self.after or not switching or self._slides_end(switching):
                return identity
            raise self.refused("no surface is reached, yet the mode changes (the end of an accumulation?)")
        if len(reached) == 1:
            return self._one(self.before, self.after, reached[0])
        return self._several(reached)

    def arriving(self) -> Array | None:
        """G_y of the surface that is reached first, from beside it; None where none is, or without speed."""
        for event in self.events:
            if not passive(event) and event.index < len(self.before) and self.before[event.index] != 0:
                try:
                    return self.rate(self.before, event.index, 1)[0]
                except NotDifferentiableError:
                    return None
        return None

    def leaving(self) -> tuple[Array, Array] | None:
        """G_y and y' where the instant is one sliding exit, across which y' is continuous; else None."""
        event = self.events[0]
        if len(self.events) != 1 or event.kind is not EventKind.EXIT or not self.leads(event):
            return None
        slope = self.guard(self.before, event.index, 1 if event.after[event.index] > 0 else -1)
        return slope, self.velocity(self.after)

    def _reset(self, events: Sequence[Event]) -> Array:
        # What follows from the reset of a surface has the state after it, too.
        kinds = (EventKind.RESET, EventKind.TIME)
        resets = [e for e in events if e.kind in kinds]
        left = [e for e in events if e.kind not in kinds]
        if not resets:
            raise self._resets_among(events)
        clocks = all(e.kind is EventKind.TIME for e in resets)
        if not all(e.kind is EventKind.EXIT for e in left) or (len(resets) > 1 and not clocks):
            raise self._resets_among(events)
        if len(resets) > 1:
            machine = Machine(self.system, self.solution.options.stepper, self.p)
            by = slopes_in_turn(machine, resets, self.names, self.p, self.x, self.before)
        else:
            by = reset_slopes(self.system, resets[0], self.names, self.p, self.x)
        x_after = resets[-1].x_after
        assert x_after is not None
        before, after = self.velocity(self.before), self._velocity(self.after, x_after)
        if clocks:
            slopes = [instant_slopes(self.system, event, self.names, self.p) for event in resets]
            slope, rate = slopes[0], 1.0
            if any(not np.array_equal(slope, other) for other in slopes):
                raise self._resets_among(events)
        else:
            slope, rate = self.rate(self.before, resets[0].index, 1)
        # A slide that the reset moves off its surface ends with it, also from beside.
        on = [e for e in left if not self._moved_off(e.index, x_after)]
        if on and not (clocks and self._off(on, by - np.outer(by @ before, slope), x_after)):
            raise self._resets_among(events)
        return np.asarray(by + np.outer(after - by @ before, slope) / rate)

    def _moved_off(self, i: int, x_after: Array) -> bool:
        """Whether a reset moves the state off the surface i on which it slides, by more than rounding."""
        t, x, n = np.array([self.t]), x_after[None, :], self.system.dimension
        h, signs = signs_at(self.system, t, x, self.p, self.jacobian)
        part = mode_field(self.system, self.after, self.names, self.jacobian)
        normal = part.part("hy", t, x, signs, self.p)[0, i, :n]
        return bool(abs(h[0, i]) > ON_SURFACE * (np.abs(normal) @ np.abs(x_after[:n] - self.x[:n])))

    def _off(self, left: Sequence[Event], change: Array, x_after: Array) -> bool:
        """Whether neighbours, which slide too, are on the surfaces that a clock makes them leave, after it.

        change: dy after by dy before, each at the clock's instant
        """
        signs = np.zeros((1, len(self.before)))
        t, part = np.array([self.t]), mode_field(self.system, self.after, self.names, self.jacobian)
        held = [i for i, sign in enumerate(self.before) if sign == 0]
        normals = part.part("hy", t, self.x[None, :], signs, self.p)[0, held]
        seen = part.part("hy", t, x_after[None, :], signs, self.p)[0, [e.index for e in left]] @ change
        beside = seen - seen @ linalg.pinv(normals) @ normals
        return bool(np.max(np.abs(beside)) <= 1e-9 * (np.max(np.abs(seen)) + np.max(np.abs(normals))))

    def _resets_among(self, events: Sequence[Event]) -> NotDifferentiableError:
        names = ", ".join(repr(e.surface) for e in events)
        return self.refused(f"{names} happen at once, resets among them")

    def leads(self, event: Event) -> bool:
        """Whether the event occurs by itself, and does not follow from another one of the instant."""
        i, alone = event.index, len(self.events) == 1
        if self.before[i] != 0:
            return True
        part = mode_field(self.system, self.before)
        t, x = np.array([self.t]), self.x[None, :]
        s = part.multipliers(t, x, self.p)
        low, high = part.part("radius", t, x, s, self.p)[0, i]
        at_end = bool(min(abs(s[0, i] - low), abs(s[0, i] - high)) < 1e-6 * (1.0 + high - low))
        try:
            self.rate(self.before, i, 1 if event.after[i] > 0 else -1)
        except linalg.MatrixError:  # no multiplier holds the slide: it ends by what took that from it
            return False
        except NotDifferentiableError:
            return at_end and alone
        # A slide whose multiplier is beyond its end has ended by the event before it.
        return at_end or bool(alone and low < s[0, i] < high)

    def _slides_end(self, events: Sequence[Event]) -> bool:
        """Whether the instant ends slides alone, and y' is the same after it."""
        before, after = self.velocity(self.before), self.velocity(self.after)
        same = np.max(np.abs(after - before)) <= 1e-9 * np.max(np.abs(before))
        return bool(same) and all(event.kind is EventKind.EXIT for event in events)

    def _one(self, before: Mode, after: Mode, event: Event) -> Array:
        slope, rate = self.rate(before, event.index, 1 if event.after[event.index] > 0 else -1)
        change = self.velocity(after) - self.velocity(before)
        return np.eye(len(slope)) + np.outer(change, slope) / rate

    def _several(self, reached: Sequence[Event]) -> Array:
        """The product over each order in which neighbouring solutions meet the surfaces, if all agree."""
        machine = Machine(self.system, self.solution.options.stepper, self.p)
        direction = float(self.events[0].sense)
        found: list[Array] = []
        for order in itertools.permutations(reached):
            mode, total = self.before, np.eye(self.system.dimension + len(self.names) + 1)
            for k, event in enumerate(order):
                places = sorted({e.index for e in order[: k + 1]})
                following = self.after
                if k < len(order) - 1:
                    here = Point(machine, self.t, self.x, direction, direction * 1e-6, np.zeros(machine.m))
                    near = [c for c in successors(here, mode, places) if c.mode != mode]
                    if len(near) != 1:
                        raise self._disagree(reached)
                    following = near[0].mode
                total = self._one(mode, following, event) @ total
                mode = following
            found.append(total)
        scale = max(float(np.max(np.abs(matrix))) for matrix in found)
        if any(np.max(np.abs(matrix - found[0])) > 1e-8 * scale for matrix in found):
            raise self._disagree(reached)
        return found[0]

    def _disagree(self, reached: Sequence[Event]) -> NotDifferentiableError:
        names = ", ".join(repr(event.surface) for event in reached)
        return self.refused(
            f"the surfaces {names} are reached at once "
            f"({mode_text(self.before)} -> {mode_text(self.after)}), "
            "and neighbouring solutions depend on the order in which they reach them"
        )


def passive(event: Event) -> bool:
    """Whether an event leaves the flow as it is: a user's, a time event alone, a surface jumped over."""
    still = event.kind is EventKind.TIME and event.x_after is None
    return event.kind is EventKind.USER or still or event.note in (JUMPED_OVER, AT_KNOT)


def onto_section(solution: Solution, event: Event, change: Array, names: tuple[str, ...] = ()) -> Array:
    """Variation of y at an event: that at fixed time, moved along the solution to it, and through its reset.

    change: (N, any number), y = (x, parameters, t).
    """
    here = Together(solution, [event], names)
    velocity = here.velocity(event.before)
    slope, rate = here.rate(event.before, event.index, 1 if event.after[event.index] > 0 else -1)
    rows = change.shape[0]
    moved = np.asarray(change - np.multiply.outer(velocity[:rows], slope[:rows] @ change) / rate)
    if event.x_after is None:
        return moved
    return np.asarray(reset_slopes(here.system, event, names, here.p)[:rows, :rows] @ moved)
