"""What other rules of sliding are expected to give: the moments solution and Utkin's equivalent control."""

from __future__ import annotations

import itertools
import re
from typing import Any

import numpy as np

from filippov.app.bank.expect.slide import sliding_stretches
from filippov.app.bank.motion import slides
from filippov.app.bank.outcome import Ask, Either, reads
from filippov.app.bank.reason import MissingError
from filippov.solving.solution import Solution
from filippov.solving.state.machine import Machine

_RULE = "moments|utkin"


def under(ask: Ask, rule: str) -> Solution:
    """The run under a rule of sliding, which ends in sliding. Raises MissingError."""
    run = ask.motion.solve(sliding=rule)
    if not run.status.ok or not slides(run.end_mode):
        raise MissingError(f"with sliding={rule!r} the run does not end in sliding ({run.message})")
    return run


@reads(
    rf"(?P<state>{{state}})dot_(?P<rule>{_RULE})|(?P<rule2>{_RULE})_(?P<state2>{{state}})dot",
    "derivative of a state at the end of the span, where sliding follows the moments rule or Utkin's",
)
def _rate(ask: Ask, match: re.Match[str]) -> Any:
    run = under(ask, match["rule"] or match["rule2"])
    velocity, _ = ask.motion.velocity(run)
    return velocity[ask.states.index(match["state"] or match["state2"])]


@reads(
    rf"(?:final_state|x_final|final)_(?P<rule>{_RULE})|(?P<rule2>{_RULE})_(?:final_state|x_final|final)",
    "the state at the end of the span under that rule of sliding",
)
def _final(ask: Ask, match: re.Match[str]) -> Any:
    run = ask.motion.solve(sliding=match["rule"] or match["rule2"])
    if not run.status.ok:
        raise MissingError(run.message)
    return run.x_end


@reads(
    rf"(?P<rule>{_RULE})_(?:sliding_)?(?:vector_)?field|sliding_(?:vector_)?field_(?P<rule2>{_RULE})",
    "the field of the first sliding under that rule",
)
def _field(ask: Ask, match: re.Match[str]) -> Any:
    run = ask.motion.solve(sliding=match["rule"] or match["rule2"])
    first = sliding_stretches(run)[0]
    return ask.motion.velocity(run, 0.5 * (first.t0 + first.t1))[0]


@reads(
    rf"(?P<rule>{_RULE})_(?:multipliers?|equivalent_control|u_eq)|(?:equivalent_control|u_eq)_(?P<rule2>{_RULE})",
    "values of the signs in the sliding at the end of the span under that rule",
)
def _multipliers(ask: Ask, match: re.Match[str]) -> Any:
    run = under(ask, match["rule"] or match["rule2"])
    _, multipliers = ask.motion.velocity(run)
    return [multipliers[i] for i, sign in enumerate(run.end_mode) if sign == 0]


@reads(
    r"moments_weights",
    "weights of the vertex fields --, -+, +-, ++ in the moments solution at the end of the span, or those of "
    "the sides h > 0",
)
def _weights(ask: Ask, _match: re.Match[str]) -> Any:
    run = under(ask, "moments")
    on = [i for i, sign in enumerate(run.end_mode) if sign == 0]
    _, multipliers = ask.motion.velocity(run)
    sides = [(1 + multipliers[i]) / 2 for i in on]
    return Either([_vertex_weights(run, on, multipliers), sides])


def _vertex_weights(run: Solution, on: list[int], multipliers: Any) -> list[float]:
    """Weights with the multipliers as their marginals that satisfy the equations of the moments rule."""
    machine = Machine(run.problem.system, run.options.method, run.problem.p)
    mode = np.array(run.end_mode, dtype=float)
    g, gt = machine.gradients(run.t_end, run.x_end, mode)
    signs = list(itertools.product((-1.0, 1.0), repeat=len(on)))
    rates = []
    for corner in signs:
        s = np.where(mode == 0, 1.0, mode)
        s[on] = corner
        field = machine.rhs(run.t_end, run.x_end, s, mode)
        rates.append((g[on] @ field + gt[on]) / np.linalg.norm(g[on], axis=1))
    corners, w = np.array(signs), np.array(rates)
    rows, right = [np.ones(len(signs))], [1.0]
    for k, i in enumerate(on):
        rows.append(corners[:, k])
        right.append(float(multipliers[i]))
    for size in range(2, len(on) + 1):
        for chosen in itertools.combinations(range(len(on)), size):
            some = list(chosen)
            rows.append(np.prod(corners[:, some], axis=1) * np.linalg.norm(w[:, some], axis=1))
            right.append(0.0)
    return [float(v) for v in np.linalg.solve(np.array(rows), np.array(right))]
