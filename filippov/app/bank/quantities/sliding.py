"""Sliding: the values of the signs and the field; what can follow where several modes can, and its reach."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy.optimize import linprog

from filippov.app.bank.case_runs import CaseRuns, slides
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.quantities.quantity import Quantity, When, moment, one_of
from filippov.app.bank.quantities.states import Rule, mode_at, under
from filippov.base.arrays import Array
from filippov.solving.solution import Solution
from filippov.solving.state.machine import Machine


def _sliding(run: Solution, t: float) -> list[int]:
    on = [i for i, sign in enumerate(mode_at(run, t)) if sign == 0]
    if not on:
        raise MissingError(f"the solution does not slide at t = {t:.9g}")
    return on


class Signs(Quantity, quantity="signs"):
    """The values of the signs that the solution slides on at a time (the equivalent control), in order.

    surface  only that of one surface; sliding: the rule of sliding
    """

    t: When = None
    surface: int | str | None = None
    sliding: Rule | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        run, t = under(subject, self.sliding, self.t)
        on, (_, multipliers) = _sliding(run, t), subject.velocity(run, t)
        if self.surface is None:
            return [multipliers[i] for i in on]
        place = subject.place(self.surface)
        if place not in on:
            raise MissingError(f"the solution does not slide on {self.surface} at t = {t:.9g}")
        return multipliers[place]


class Rate(Quantity, quantity="rate"):
    """x' in the mode at a time.

    component  of one state by name; sliding: the rule of sliding
    """

    t: When = None
    component: str | None = None
    sliding: Rule | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        run, t = under(subject, self.sliding, self.t)
        if self.sliding is not None:
            _sliding(run, t)
        return subject.part(subject.velocity(run, t)[0], self.component)


class VertexWeights(Quantity, quantity="moments_weights"):
    """Weights of the vertex fields --, -+, +-, ++, ... in the moments solution at the end of the span."""

    def __call__(self, subject: CaseRuns) -> Any:
        """Weights with the multipliers as their marginals that satisfy the equations of the moments rule."""
        run, t = under(subject, "moments", None)
        on, (_, multipliers) = _sliding(run, t), subject.velocity(run)
        signs, fields, g, gt = _vertices(run, on)
        w = (fields @ g[on].T + gt[on]) / np.linalg.norm(g[on], axis=1)
        rows, right = [np.ones(len(signs))], [1.0]
        for k, i in enumerate(on):
            rows.append(signs[:, k])
            right.append(float(multipliers[i]))
        for size in range(2, len(on) + 1):
            for some in map(list, itertools.combinations(range(len(on)), size)):
                rows.append(np.prod(signs[:, some], axis=1) * np.linalg.norm(w[:, some], axis=1))
                right.append(0.0)
        return [float(v) for v in np.linalg.solve(np.array(rows), np.array(right))]


def _vertices(run: Solution, on: list[int]) -> tuple[Array, Array, Array, Array]:
    """Signs and fields of the vertices at the end of a run, gradients and time derivatives of surfaces."""
    machine = Machine(run.problem.system, run.options.stepper, run.problem.p)
    mode = np.array(run.end_mode, dtype=float)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(on))))
    fields = []
    for corner in signs:
        s = np.where(mode == 0, 1.0, mode)
        s[on] = corner
        fields.append(machine.rhs(run.t_end, run.x_end, s, mode))
    g, gt = machine.gradients(run.t_end, run.x_end, mode)
    return signs, np.array(fields), g, gt


class RateBounds(Quantity, quantity="rate_bounds"):
    """[least, largest] rate of a state over all convex combinations of the vertex fields that stay on the
    surfaces, at the end of the span."""

    component: str

    def __call__(self, subject: CaseRuns) -> Any:
        run = subject.main
        on = _sliding(run, run.t_end)
        _, fields, g, gt = _vertices(run, on)
        stay = np.vstack([(fields @ g[on].T + gt[on]).T, np.ones(len(fields))])
        target = np.append(np.zeros(len(on)), 1.0)
        rate = fields[:, subject.component(self.component)]
        ends = [linprog(sign * rate, A_eq=stay, b_eq=target, bounds=(0, 1)) for sign in (1, -1)]
        if not all(end.success for end in ends):
            raise MissingError("no convex combination stays on the surfaces")
        return [float(ends[0].fun), -float(ends[1].fun)]


class Continuations(Quantity, quantity="continuations"):
    """The modes that can follow where the solution is not unique.

    slides  only those that slide
    deepest  only those that slide on as many surfaces as any
    number  only that one, from 1, in the order in which they are found
    take    count, fields (a list for each), signs (those slid on, a list for each), or the name of a state:
            its rates
    """

    slides: bool = False
    deepest: bool = False
    number: int | None = None
    take: str = "count"

    def __call__(self, subject: CaseRuns) -> Any:
        found = [c for c in subject.candidates() if slides(c.mode) or not self.slides]
        if self.deepest:
            depth = max((c.mode.count(0) for c in found), default=0)
            found = [c for c in found if c.mode.count(0) == depth]
        if not found:
            raise MissingError("the solution is unique")
        if self.take == "count":
            return float(len(found))
        if self.take == "signs":
            rows = [[v for v, m in zip(c.multipliers, c.mode, strict=True) if m == 0] for c in found]
        else:
            part: Any = slice(None) if self.take == "fields" else subject.component(self.take)
            rows = [c.field[part] for c in found]
        return rows if self.number is None else one_of(rows, self.number, "continuations")


class Reachable(Quantity, quantity="reachable"):
    """The states that all solutions reach at a time.

    component  [least, largest] value of one state; default: the ends of all branches, a list of points
    releases   departures that are sampled along sliding that can be left at any time
    """

    t: When = None
    component: str | None = None
    releases: int = 0

    def __call__(self, subject: CaseRuns) -> Any:
        """The interval, or the points. Raises MissingError where the solution is unique."""
        time = moment(subject, self.t)
        tree = subject.tree(time, self.releases)
        if tree.unique:
            raise MissingError("the solution is unique")
        found = tree.reachable(time)
        if not found.complete:
            raise MissingError(f"not every solution was followed to t = {time:.9g}: {tree.message}")
        if self.component is None:
            return found.x
        values = found.x[:, subject.component(self.component)]
        return [float(np.min(values)), float(np.max(values))]
