"""The cycles of one case, followed over the study's parameter."""

from __future__ import annotations

import numpy as np

from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.app.report.case import CaseResults
from filippov.app.report.context import Context
from filippov.app.report.part import first

LOOSE, TIGHT = 1e-12, 1e-13
# Longest step along a branch, in units of its size: short enough to be drawn.
LONGEST = 0.04


class CaseCycles:
    """The cycles of one case.

    orbits  at its own parameters, by growing coordinate
    runs    the continuations over the study's parameter; at: points on them at every value of the study
    pairs   every number with that of a tighter tolerance
    """

    def __init__(self, run: Context, case: CaseResults) -> None:
        study, once = run.study, case.event_map
        self.case = case
        self.orbits = tuple(
            find_orbit(run.system, once.bound.start(np.array([q.d]), once.p)[0], symmetry=study.symmetry,
                       parameters=case.parameters)
            for q in case.cycles
        )  # fmt: skip
        self.runs, tight = _runs(run, case, LOOSE), _runs(run, case, TIGHT)
        self.branches = tuple(r.branch for r in self.runs)
        self.at = {v: [p for r in self.runs for p in r.at(v)] for v in study.values}
        self.pairs = [
            (first(p), first(q))
            for v, points in self.at.items()
            for p, q in zip(points, [p for r in tight for p in r.at(v)], strict=True)
        ]
        for one, other in zip(self.runs, tight, strict=True):
            special = zip(one.branch.special, other.branch.special, strict=True)
            self.pairs += [(a.value, b.value) for a, b in special]

    @property
    def spread(self) -> float:
        """Largest relative difference of the pairs."""
        return max((abs(a - b) / abs(b) for a, b in self.pairs), default=0.0)

    @property
    def special(self) -> list[BranchPoint]:
        """Special points of all branches."""
        return [point for branch in self.branches for point in branch.special]


def _runs(run: Context, case: CaseResults, rtol: float) -> tuple[Continuation, ...]:
    """Branches through all cycles of the case, from the largest down; each is followed once."""
    name, values = run.study.parameter, run.study.values
    power = case.power.remake(rtol=rtol, atol=1e-2 * rtol)
    own, bounds = power.parameters[name], (values[0], values[-1])
    out: list[Continuation] = []
    known: list[float] = []
    for q in sorted(case.cycles, key=lambda q: -q.d):
        if any(abs(q.d - d) < 1e-6 * abs(q.d) for d in known):
            continue
        way = 1 if own <= bounds[0] else -1 if own >= bounds[1] else 0
        found = continuation(
            run.system, (power, q.d), parameter=name, bounds=bounds, direction=way, max_step=LONGEST
        )
        found.run()
        known += [first(p) for p in found.at(own)]
        out.append(found)
    return tuple(out)
