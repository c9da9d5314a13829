"""Points at which the inclusion does not say which mode follows: their names, and what can follow (U2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.status import mode_text
from filippov.kernel.loop.corner import TURNS_OUT
from filippov.solving.selection.modes import Successor, successors
from filippov.solving.state.events import Mode
from filippov.solving.state.leading import Terms, leading_term
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options
from filippov.solving.state.point import Point
from filippov.solving.state.problem import Problem
from filippov.solving.state.run import Run, guard_terms

CORNER, REPELLING = "ambiguous corner", "repelling sliding"
SPIRAL = "spiral out of a corner"
BACKWARDS = {"before a reset": "a reset", "before a relay": "a relay at the edge of its band"}
VISIBLE, INVISIBLE, MIXED = "visible two-fold", "invisible two-fold", "visible-invisible two-fold"
TANGENCY, STICTION = "visible tangency", "sliding or slip"


@dataclass(frozen=True)
class Ambiguity:
    """A point from which several modes are consistent.

    t           time
    name        "repelling sliding", "visible two-fold", "invisible two-fold", "visible-invisible two-fold",
                "visible tangency", "sliding or slip", "ambiguous corner", "departure where the field is not
                Lipschitz", or "spiral out of a corner": a solution that circles the corner leaves it in
                infinitely many crossings, and is not among the candidates; backwards in
                time "before a reset", without candidates: the state from which the reset led here is not
                determined; "before a relay": the sign is not that a relay with hysteresis had before
    candidates  every consistent next mode
    before      the mode in which the point was reached
    triggered   numbers of the surfaces that were reached there (`hit`: its earlier name)
    start       whether it is the initial state
    """

    t: float
    name: str
    candidates: tuple[Successor, ...]
    before: Mode
    triggered: tuple[int, ...]
    start: bool

    @property
    def hit(self) -> tuple[int, ...]:
        """`triggered` under its earlier name."""
        return self.triggered

    def __str__(self) -> str:
        if not self.candidates:
            return self.name
        return f"{self.name}, one of {len(self.candidates)}: {listing(self.candidates)}"


def listing(candidates: Sequence[Successor]) -> str:
    """Candidates as text."""
    return "; ".join(str(candidate) for candidate in candidates)


def noted(point: Point, name: str, chosen: Successor) -> str:
    """The note of an event with one continuation: the point's name, and multipliers that are not unique."""
    names = ", ".join(repr(point.machine.surfaces[i].name) for i in chosen.undetermined)
    shared = f"the multipliers of {names} are not unique, the solution is" if names else ""
    return "; ".join(text for text in (name, shared) if text)


def name_point(
    point: Point, reached: Sequence[int], candidates: Sequence[Successor]
) -> tuple[str, tuple[Successor, ...]]:
    """What the point is called where several modes follow, or where two folds meet; else "".

    The candidates are returned with the orders that follow from the name: sliding that starts at a two-fold
    repels where both folds are visible and attracts where both are invisible; the rates, which are zero
    there, do not show it. Names after Kuznetsov, Rinaldi & Gragnani 2003, in the direction of integration.
    """
    name, surface = _name(point, reached, candidates)
    order = {VISIBLE: -3, INVISIBLE: 3}.get(name, 0)
    if order == 0:
        return name, tuple(candidates)
    return name, tuple(
        replace(c, order=tuple(order if i == surface else v for i, v in enumerate(c.order)))
        if c.mode[surface] == 0 and sum(v == 0 for v in c.mode) == 1
        else c
        for c in candidates
    )


def _name(point: Point, reached: Sequence[int], candidates: Sequence[Successor]) -> tuple[str, int]:
    """The name of a point and the surface it is about, -1 for a corner."""
    if not candidates:
        return "", -1
    machine = point.machine
    if len(candidates) == 1 and any(
        spirals_out(point, candidates[0].mode, pair) for pair in _pairs(point, candidates[0].mode)
    ):
        return SPIRAL, -1
    differ = sorted({i for c in candidates for i in reached if c.mode[i] != candidates[0].mode[i]})
    if len(candidates) > 1 and len(differ) != 1:
        return CORNER, -1
    able = [i for i in reached if machine.roles[i] == "switching" and machine.widths[i] == 0.0]
    able = [i for i in able if not machine.contacts[i]]
    if not differ and len(able) != 1:
        return "", -1
    surface = differ[0] if differ else able[0]
    if surface not in able:
        return CORNER if differ else "", -1
    sides = [_side(point, candidates[0], surface, sign) for sign in (1.0, -1.0)]
    if any(side is None for side in sides):
        return CORNER if differ else "", -1
    (plus, leaves_up), (minus, leaves_down) = (side for side in sides if side is not None)
    if plus > 1 and minus > 1:
        return {2: VISIBLE, 1: MIXED, 0: INVISIBLE}[leaves_up + leaves_down], surface
    if not differ:
        return "", -1
    if leaves_up and leaves_down:
        return REPELLING if plus == minus == 1 else TANGENCY, surface
    return STICTION, surface


def _pairs(point: Point, mode: Mode) -> list[list[int]]:
    """Corners of two surfaces that a mode slides on."""
    groups: dict[int, list[int]] = {}
    for i, value in enumerate(mode):
        if value == 0 and point.machine.roles[i] == "switching" and not point.machine.contacts[i]:
            groups.setdefault(point.machine.component[i], []).append(i)
    return [group for group in groups.values() if len(group) == 2]


def spirals_out(point: Point, mode: Mode, pair: Sequence[int]) -> bool:
    """Whether the four fields at a corner circle it and lead away from it."""
    return len(pair) == 2 and bool(point.corner_kind(np.array(mode, dtype=float), pair) & TURNS_OUT)


def _side(point: Point, beside: Successor, surface: int, sign: float) -> tuple[int, bool] | None:
    """Order with which the field of one side leaves the surface, and whether it does so to its own side."""
    mode: Array = np.array(beside.mode, dtype=float)
    mode[surface] = sign
    lam = np.array(beside.multipliers)
    g, gt = point.gradients(mode)
    size = float(guard_terms(g, gt, point.t, point.x)[surface])
    terms = Terms(size, point.terms(surface, mode), grain=point.grain)
    term = leading_term(point, mode, lam, partial(guard_rows_of, surface), terms)
    return None if term is None or term[0] == 0 else (term[0], term[1] > 0)


def guard_rows_of(surface: int, rows: Array) -> Array:
    """A surface's guard among the guards along a step."""
    return np.asarray(rows[:, 0, surface])


def _touching(candidates: Sequence[Successor], before: Mode, triggered: Sequence[int]) -> Successor | None:
    """A surface only touched: the solution goes on where it was, if the other side does not lead away."""
    off = [i for i in triggered if before[i] != 0]
    parted = any(c.mode[i] == -before[i] and c.order[i] in (1, -1) for c in candidates for i in off)
    if not off or len(off) < len(triggered) or parted:
        return None
    same = [c for c in candidates if all(c.mode[i] == before[i] for i in off)]
    exact = [c for c in same if c.mode == before]
    return exact[0] if exact else same[0] if len(same) == 1 else None


def picked(
    policy: str | tuple[str, ...] | Callable[..., Any], candidates: Sequence[Successor], before: Mode,
    triggered: Sequence[int],
) -> Successor | None:  # fmt: skip
    """The candidate that the option `nonunique` chooses, None where it chooses none or several."""
    same = _touching(candidates, before, triggered)
    if same is not None:
        return same
    if callable(policy):
        found = policy(list(candidates))
        if found is None or isinstance(found, Successor):
            return found
        raise UsageError(
            f"nonunique returned {found!r}, expected one of the candidates it was given, or None."
        )
    if policy in ("raise", "branch"):
        return None
    if isinstance(policy, tuple):
        by_rank = [[c for c in candidates if mode_text(c.mode) == mode] for mode in policy]
        fitting = next((some for some in by_rank if some), [])
    else:
        # What leaves a kink at a place where the solution may stay holds one less.
        left = [any(v != 0 and k == -1 for v, k in zip(c.mode, c.order, strict=True)) for c in candidates]
        counts = [sum(v == 0 for v in c.mode) - gone for c, gone in zip(candidates, left, strict=True)]
        wanted = max(counts) if policy == "stick" else min(counts)
        fitting = [c for c, n in zip(candidates, counts, strict=True) if n == wanted]
    return fitting[0] if len(fitting) == 1 else None


# Shortest trial step, of the time that has passed.
LEAST_TRIAL = 1e-9


def point_of(run: Run) -> Point:
    """The present point, with a trial step on the scale of the solution."""
    t_end = float(run.clock.t_end)
    _, field, _, _ = run.machine.probe(run.t, 0.0, run.x, run.mode, run.lam)
    size = float(np.max(np.abs(run.x), initial=0.0)) + 1e-3
    speed = float(np.max(np.abs(field), initial=0.0)) + 1e-300
    # Steps that shrank towards a point where the field is not Lipschitz say nothing of what follows.
    least = LEAST_TRIAL * abs(run.t - float(run.clock.t_start))
    hint = max(float(run.clock.step), least) or np.inf
    step = min(hint, 1e-2 * size / speed, abs(t_end - run.t) or np.inf, run.options.max_step)
    if not np.isfinite(step):
        step = 1e-3
    longest = min(abs(t_end - run.t), run.options.max_step)
    return Point(
        run.machine.local, run.t, run.x.copy(), run.direction, run.direction * step, run.lam.copy(),
        longest=longest,
    )  # fmt: skip


def ambiguity_at(
    problem: Problem, options: Options, t: float, x: Array, mode: Mode, multipliers: Array
) -> Ambiguity | None:
    """What can follow at a point of sliding, where that is more than to go on sliding."""
    machine = Machine(problem.system, options.stepper, problem.p, sliding=options.sliding)
    run = Run(machine, x, (t, problem.t_span[1]), options)
    run.put(mode, (0,) * len(mode), tuple(multipliers.tolist()))
    point, reached = point_of(run), [i for i, sign in enumerate(mode) if sign == 0]
    found = successors(point, mode, reached)
    if len(found) < 2:
        return None
    return Ambiguity(t, *name_point(point, reached, found), mode, (), False)
