"""A sweep: one problem, what is varied in it, and what is measured at every point."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from filippov.base.arrays import Whole
from filippov.base.errors import ModelError, UsageError
from filippov.base.failure import failure
from filippov.base.given import Count, Natural, Positive, positive
from filippov.base.keywords import keywords, renamed
from filippov.base.names import unknown
from filippov.base.version import package_version
from filippov.model.system import System
from filippov.solving.ensemble import solve_many
from filippov.solving.state.option_types import (
    ANSWERS,
    MethodName,
    OnGraze,
    OnZeno,
    Policy,
    SlidingRule,
    Stops,
    Together,
    Tolerance,
)
from filippov.solving.state.options import Options, check_priority, check_stops, given_options
from filippov.solving.state.problem import Problem
from filippov.sweep.dependence import Dependence, dependence, plain_system
from filippov.sweep.measure import Function, Measure, OfOutput, read_measures
from filippov.sweep.point import START, Plan, compute_many, compute_one
from filippov.sweep.points import Points, extremes, shape_of
from filippov.sweep.reduction import check_reduce, reduce_table
from filippov.sweep.rows import Limits, Rows
from filippov.sweep.samples import sample
from filippov.sweep.table import SweepTable
from filippov.sweep.toolchain import own_sources, toolchain

_ENOUGH = 64
FORMER = {"vary": renamed("vary", "over", "{'P': [10, 20]}")}


class Sweep:
    """Measures of the solutions of a problem over many parameter values and initial states.

    problem   the template
    over      values by name: of parameters, or of initial states as "x0.v"; for samples="latin_hypercube"
              and "sobol" (low, high) by name
    samples   "grid" (every combination, the last name fastest), "list" (the first values, the second ones,
              ...), "latin_hypercube" or "sobol" with n points and a seed
    measure   texts and functions, see `filippov.sweep.measure`
    tail      part of the time reached over which extrema and periods are taken, 0 < tail <= 1
    reduce    names such as "mean" and "max" for a summary of every column, or a function of the SweepTable
    stop      terminal events; other options as in `solve`

    Where the measures need the ends only, points are computed together in compiled code (`solve_many`), else
    one by one (`solve`). Raises UsageError, ModelError.
    """

    grain = 1

    @keywords(answers={**ANSWERS, **FORMER}, own=("problem", "method"))
    def __init__(
        self,
        problem: Problem,
        over: Mapping[str, Any],
        samples: str = "grid",
        *,
        measure: Any = ("end", "t_end"),
        n: Count | None = None,
        seed: Natural = 0,
        tail: float = 0.5,
        reduce: Any = None,
        stop: Stops = (),
        method: MethodName | str = "DOP853",
        rtol: Positive = Options.rtol,
        atol: Tolerance | None = None,
        first_step: Positive | None = None,
        max_step: Positive = math.inf,
        max_steps: Count = Options.max_steps,
        max_events: Count = Options.max_events,
        nonunique: Policy = "raise",
        on_graze: OnGraze = "continue",
        zeno: OnZeno = "stop",
        simultaneous: Together = "raise",
        sliding: SlidingRule = "filippov",
    ) -> None:
        options = given_options({**locals(), "stop": ()})
        if not isinstance(problem, Problem):
            raise UsageError(
                f"Sweep was given {type(problem).__name__}, expected Problem(system, x0, t_span): the run "
                "that is varied."
            )
        if not 0 < positive("tail", tail) <= 1:
            raise UsageError(f"tail is {tail!r}, expected a number in (0, 1].")
        if str(options.get("nonunique")) == "branch":
            raise UsageError("nonunique='branch' gives a tree of solutions; a sweep needs one solution.")
        self.problem, self.samples = problem, samples
        self.tail, self.stop = float(tail), check_stops(stop, problem.system)
        self.options = options
        if "nonunique" in options:
            self.options["nonunique"] = check_priority(options["nonunique"], problem.system)
        Options(stop=self.stop, **self.options).tolerances(problem.system)
        self.names = _names(over, problem.system)
        self.points: Points = sample(over, samples, n, seed)
        self.shape = shape_of(self.points)
        self._check_bounds()
        self.measures = self._tried(read_measures(measure, problem.system))
        self.reduce = check_reduce(reduce)

    # -- content ---------------------------------------------------------------------------------------

    @property
    def system(self) -> System:
        """The system of the template."""
        return self.problem.system

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the results."""
        return tuple(name for measure in self.measures for name in measure.columns(self.system))

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters that are varied, where they have one."""
        parameters = self.system.parameters
        units = {name: parameters[name].unit for name in self.names if name in parameters}
        return {name: unit for name, unit in units.items() if unit}

    @property
    def first(self) -> int:
        """Points to begin with in one go."""
        return 512 if self.lanes else 4

    @cached_property
    def lanes(self) -> int:
        """How many trajectories run side by side in compiled code; 0 where points are solved one by one."""
        together = "on_graze" not in self.options and not callable(self.options.get("nonunique"))
        if not together or self.system.field is not None or any(measure.needs for measure in self.measures):
            return 0
        # A run of no length says how an ensemble of this size would go, and compiles for all workers.
        start = self.problem.t_span[0]
        rows = np.tile(self.problem.x0, (min(len(self.points), _ENOUGH), 1))
        trial = solve_many(
            self.system, rows, (start, start), parameters=self.problem.parameters, threads=1, **self.options
        )
        return trial.lanes

    @cached_property
    def fields(self) -> dict[str, str]:
        """All that decides the results, by name."""
        measures = [
            f"{m.path}:{m.name} {depends.digest}" if isinstance(m, Function) else repr(m)
            for m, depends in zip(self.measures, self._measures, strict=True)
        ]
        fields = {
            "filippov": f"{package_version()} {own_sources()}", **toolchain(),
            "model": self.system.digest or self._model.digest,
            "parameters": dict(self.problem.parameters), "x0": self.problem.x0.tolist(),
            "t_span": self.problem.t_span, "measure": measures, "tail": self.tail,
            "stop": [repr(stop) for stop in self.stop],
        }  # fmt: skip
        fields |= {name: _plain(value) for name, value in self.options.items()}
        return {name: _text(value) for name, value in fields.items()}

    @cached_property
    def unseen(self) -> tuple[str, ...]:
        """What decides the results as well, in functions of the user's, and cannot be seen beforehand."""
        policy = self.options.get("nonunique")
        given = [self._model, *self._measures, *([dependence(policy)] if callable(policy) else [])]
        return tuple(sorted({sentence for depends in given for sentence in depends.unseen}))

    @cached_property
    def _model(self) -> Dependence:
        return Dependence("") if self.system.field is None else dependence(*plain_system(self.system))

    @cached_property
    def _measures(self) -> list[Dependence]:
        return [m.depends if isinstance(m, Function | OfOutput) else Dependence("") for m in self.measures]

    @keywords()
    def problem_at(self, point: int) -> Problem:
        """The problem of one point."""
        return self.plan.problem_at(point)

    @property
    def plan(self) -> Plan:
        """What the points need."""
        return Plan(
            self.problem, self.names, self.points, self.measures, self.options, self.stop, self.tail,
            self.lanes,
        )  # fmt: skip

    # -- computing -------------------------------------------------------------------------------------

    def compute(self, index: Whole, limits: Limits) -> Rows:
        """Rows of the points with these numbers."""
        return (compute_many if self.lanes else compute_one)(self.plan, index, limits)

    @keywords()
    def run(self, folder: str | Path | None = None, **how: Any) -> SweepTable:
        """Compute every point; see `filippov.sweep.run.run` for folder and the keywords."""
        from filippov.sweep.run import run

        _ = self.lanes, self.fields, self.unseen  # once, here, for all workers
        table = run(self, folder, **how)
        table.shape = self.shape
        if table.complete and self.reduce is not None:
            table.reduced = reduce_table(table, self.reduce)
        return table

    def __getstate__(self) -> dict[str, Any]:
        # What the driver alone needs stays with it: a reduction may be a lambda.
        return {**self.__dict__, "reduce": None, "fields": {}, "unseen": ()}

    # -- checks ----------------------------------------------------------------------------------------

    def _check_bounds(self) -> None:
        parameters = self.system.parameters
        for k, name in enumerate(self.names):
            if name in parameters:
                for extreme in extremes(self.points, k):
                    try:
                        parameters[name].check(extreme, f"parameter {name!r}")
                    except ModelError as error:
                        raise UsageError(f"over: {error}") from None

    def _tried(self, measures: tuple[Measure | Function, ...]) -> tuple[Measure | Function, ...]:
        """The measures, with the names of what functions return found by a trial at the template."""
        if not any(isinstance(measure, Function) for measure in measures):
            return measures
        from filippov.solving.uncut import solve

        solution = solve(self.problem, stop=self.stop, **self.options)
        out: list[Measure | Function] = []
        for measure in measures:
            if isinstance(measure, Function):
                try:
                    names = tuple(measure.call(solution))
                except UsageError:
                    raise
                except BaseException as error:  # a function of the user's may raise anything, or leave
                    raise UsageError(
                        f"measure {measure.name} fails for the template itself: {failure(error)}. A function "
                        "takes the solution and returns a dict of numbers by name."
                    ) from error
                measure = replace(measure, names=names)  # noqa: PLW2901
            out.append(measure)
        made = [name for measure in out for name in measure.columns(self.system)]
        twice = [name for name in made if made.count(name) > 1 or name in self.names]
        if twice:
            raise UsageError(
                f"two measures (or a coordinate and a measure) are named {twice[0]!r}. Rename one."
            )
        return tuple(out)


def _names(over: Any, system: System) -> tuple[str, ...]:
    if not isinstance(over, Mapping):
        raise UsageError(f"over is {over!r}, expected values by name.")
    known = [*system.parameters.names, *(f"{START}{state}" for state in system.states)]
    for name in over:
        if name not in known:
            if f"{START}{name}" in known:
                raise UsageError(
                    f"unknown name to vary: {name!r} is a state; its initial value is {f'{START}{name}'!r}."
                )
            raise UsageError(unknown("name to vary:", name, known))
    return tuple(over)


def _plain(value: Any) -> Any:
    if callable(value):
        return dependence(value).digest
    return value.tolist() if hasattr(value, "tolist") else value


def _text(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) < 200 else f"{len(text)} characters {_digest(text)}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()

