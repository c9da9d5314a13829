"""What sliding is expected to be like: where and when, with which multipliers and which velocity."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from scipy.optimize import linprog

from filippov.app.bank.motion import slides
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.status import EventKind
from filippov.solving.solution import Segment, Solution


def sliding_stretches(run: Solution) -> list[Segment]:
    """The segments that slide."""
    found = [s for s in run.segments if slides(s.mode) and s.t1 != s.t0]
    if not found:
        raise MissingError("the run does not slide")
    return found


def _inner(stretch: Segment, count: int = 9) -> Any:
    return np.linspace(stretch.t0, stretch.t1, count + 2)[1:-1]


@reads(r"slide_interval|sliding_interval|stick_interval", "first and last time of the first sliding")
def _interval(ask: Ask, _match: re.Match[str]) -> Any:
    first = sliding_stretches(ask.motion.main)[0]
    return [first.t0, first.t1]


@reads(r"slide_until|sliding_until|slides_to", "the state at the end of the first sliding")
def _until(ask: Ask, _match: re.Match[str]) -> Any:
    first = sliding_stretches(ask.motion.main)[0]
    return ask.motion.state(first.t1)


@reads(r"sliding_(?:speed|velocity)", "rate of the first state while it slides, or the speed in state space")
def _speed(ask: Ask, _match: re.Match[str]) -> Any:
    run = ask.motion.main
    rows = [ask.motion.velocity(run, float(t))[0] for s in sliding_stretches(run)[:3] for t in _inner(s)]
    field = np.array(rows)
    wanted = float(ask.wanted())
    readings = [field[:, 0], np.abs(field[:, 0]), np.linalg.norm(field, axis=1)]
    return Either([row[int(np.argmax(np.abs(row - wanted)))] for row in readings])


@reads(r"sliding_(?:vector_field|field|vector)|(?P<repels>(?:repelling|escaping)_(?:sliding_)?(?:vector_)?field)",
       "the field of the first sliding; of the sliding candidate where the motion is not unique")  # fmt: skip
def _field(ask: Ask, match: re.Match[str]) -> Any:
    run, candidates = ask.motion.candidates()
    if candidates:
        return Either([c.field for c in candidates if slides(c.mode)])
    if match["repels"]:
        raise MissingError("the motion is unique")
    return ask.motion.velocity(run, float(_inner(sliding_stretches(run)[0], 1)[0]))[0]


@reads(
    r"equivalent_control|u_eq|ueq|sliding_multiplier|equivalent_signs?",
    "the sign's value while sliding: a number, a list (one a sliding surface) or a formula in t",
)
def _multiplier(ask: Ask, _match: re.Match[str]) -> Any:
    run = ask.motion.main
    stretch = sliding_stretches(run)[0]
    on = [i for i, sign in enumerate(stretch.mode) if sign == 0]
    times = _inner(stretch)
    rows = np.array([ask.motion.velocity(run, float(t))[1][on] for t in times])
    value = ask.entry.value
    wanted = np.array(expected_over(ask, times) if isinstance(value, str) else ask.wanted(), dtype=float)
    if isinstance(value, str):
        return _worst(ask, rows[:, 0], wanted)
    return ask.compare(rows[int(np.argmax(np.max(np.abs(rows - wanted), axis=1)))], np.atleast_1d(wanted))


def expected_over(ask: Ask, times: Any) -> Any:
    """The value of a formula in t at some times."""
    from sympy import lambdify

    from filippov.app.bank.notation import formula
    from filippov.base.errors import ModelError
    from filippov.model.symbols import t

    try:
        expression = formula(str(ask.entry.value), ask.motion.built.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    if expression.free_symbols - {t}:
        raise NotUnderstoodError("it is no formula in t")
    return np.broadcast_to(np.asarray(lambdify(t, expression, "numpy")(times), dtype=float), np.shape(times))


def _worst(ask: Ask, got: Any, wanted: Any) -> Outcome:
    k = int(np.argmax(np.abs(got - wanted)))
    return ask.compare(got[k], wanted[k])


@reads(
    r"(?:bilinear_|sliding_|convex_)?weights",
    "convex weights (1 + s)/2 of the h > 0 sides in the sliding at the end",
)
def _weights(ask: Ask, _match: re.Match[str]) -> Any:
    run = ask.motion.main
    if not slides(run.end_mode):
        raise MissingError("the run does not end in sliding")
    _, lam = ask.motion.velocity(run)
    plus = [(1 + lam[i]) / 2 for i, sign in enumerate(run.end_mode) if sign == 0]
    wanted = np.atleast_1d(ask.wanted())
    return [plus[0], 1 - plus[0]] if len(plus) == 1 and wanted.size == 2 else plus


@reads(
    r"sliding_multipliers",
    "all sets of multipliers with which the motion can slide: lists, or u1=u2=1/2 and u1=-1/2",
)
def _multipliers(ask: Ask, _match: re.Match[str]) -> Any:
    _, candidates = ask.motion.candidates()
    rows = [
        [v for v, m in zip(c.multipliers, c.mode, strict=True) if m == 0]
        for c in candidates
        if slides(c.mode)
    ]
    wanted = _assignments(ask) if isinstance(ask.entry.value, str) else np.atleast_2d(ask.wanted()).tolist()
    if not rows:
        rows = [list(ask.motion.velocity(ask.motion.main)[1])]
    deepest = max(map(len, rows))
    return ask.compare(sorted(row for row in rows if len(row) == deepest), sorted(wanted))


def _assignments(ask: Ask) -> list[list[float]]:
    """Values of u1, u2, ... from "u1=u2=+1/2 and u1=u2=-1/2"; what stands in brackets at the end is prose."""
    text = re.sub(r"\s+\([^()]*(?:\([^()]*\)[^()]*)*\)\s*$", "", str(ask.entry.value))
    rows = []
    for part in re.split(r"\s+and\s+|;", text):
        found: dict[str, float] = {}
        for chain in part.split(","):
            *names, value = (piece.strip() for piece in chain.split("="))
            if not names or not all(re.fullmatch(r"[a-z]\w*", name) for name in names):
                raise NotUnderstoodError(f"{part!r} gives no multipliers")
            found |= dict.fromkeys(names, ask.number(value))
        rows.append([found[name] for name in sorted(found)])
    return rows


# -- rates of a state ----------------------------------------------------------------------------------


@reads(
    r"(?P<state>{state})dot(?:_bilinear)?|d(?P<state2>{state})(?:/)?dt",
    "derivative of a state in the mode at the end of the span",
)
def _rate(ask: Ask, match: re.Match[str]) -> Any:
    velocity, _ = ask.motion.velocity(ask.motion.main)
    return velocity[ask.states.index(match["state"] or match["state2"])]


@reads(
    r"(?P<state>{state})dot_values",
    "derivatives of a state in all sliding modes that can follow, in any order",
)
def _rates(ask: Ask, match: re.Match[str]) -> Any:
    _, candidates = ask.motion.candidates()
    k = ask.states.index(match["state"])
    wanted = np.sort(np.atleast_1d(ask.wanted()))
    every = sorted(c.field[k] for c in candidates)
    return ask.compare(Either([sorted(c.field[k] for c in candidates if slides(c.mode)), every]), wanted)


@reads(
    r"filippov_interval_(?P<state>{state})dot",
    "least and largest rate of a state over all convex combinations that stay on the surfaces",
)
def _hull(ask: Ask, match: re.Match[str]) -> Any:
    from filippov.solving.state.machine import Machine

    run = ask.motion.main
    on = [i for i, sign in enumerate(run.end_mode) if sign == 0]
    if not on:
        raise MissingError("the run does not end in sliding")
    machine = Machine(run.problem.system, "DOP853", run.problem.p)
    mode = np.array(run.end_mode, dtype=float)
    fields = []
    for corner in np.array(np.meshgrid(*[[-1.0, 1.0]] * len(on))).reshape(len(on), -1).T:
        signs = np.where(mode == 0, 1.0, mode)
        signs[on] = corner
        fields.append(machine.rhs(run.t_end, run.x_end, signs, mode))
    g, gt = machine.gradients(run.t_end, run.x_end, mode)
    rows = np.array(fields)
    stay = np.vstack([(rows @ g[on].T + gt[on]).T, np.ones(len(rows))])
    target = np.append(np.zeros(len(on)), 1.0)
    rate = rows[:, ask.states.index(match["state"])]
    ends = [linprog(sign * rate, A_eq=stay, b_eq=target, bounds=(0, 1)) for sign in (1, -1)]
    if not all(end.success for end in ends):
        raise MissingError("no convex combination stays on the surfaces")
    return [float(ends[0].fun), -float(ends[1].fun)]


# -- equilibria ----------------------------------------------------------------------------------------


@reads(
    r"(?:pseudo_?|pseudo-)?equilibrium(?:_point)?|rest_point",
    "a point at which the motion stays when started there",
)
def _equilibrium(ask: Ask, _match: re.Match[str]) -> Any:
    point = np.atleast_1d(ask.wanted())
    if point.shape != (len(ask.states),):
        raise NotUnderstoodError(f"the case has {len(ask.states)} states")
    start, end = ask.motion.built.t_span
    run = ask.motion.solve(x0=tuple(point), t_end=start + min(abs(end - start), 1.0), nonunique="stick")
    if not run.status.ok:
        raise MissingError(run.message)
    velocity, _ = ask.motion.velocity(run)
    drift = np.max(np.abs(run.x_end - point)) + np.max(np.abs(velocity))
    return Outcome(
        float(drift), ask.entry.tol, "" if drift <= ask.entry.tol else "the motion leaves the point"
    )


@reads(r"capture_times?", "text {(x0):t, ...}: from each state, the time of the last sliding entry")
def _capture(ask: Ask, _match: re.Match[str]) -> Any:
    pairs = re.findall(r"\(([^()]*)\)\s*:\s*([-+\d.eE]+)", str(ask.entry.value))
    if not pairs:
        raise NotUnderstoodError("no pairs (state):time were found")
    got, wanted = [], []
    for state, time in pairs:
        x0 = tuple(ask.number(text) for text in state.split(","))
        wanted.append(ask.number(time))
        start, end = ask.motion.built.t_span
        run = ask.motion.solve(x0=x0, t_end=max(end, start + 2 * wanted[-1]))
        entries = [e.t for e in ask.motion.events(run) if e.kind is EventKind.ENTRY]
        if not entries:
            raise MissingError(f"from ({state}) the motion is not captured")
        got.append(entries[-1])
    return ask.compare(got, wanted)
