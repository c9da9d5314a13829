"""The cycles of a smoother model of the same system, followed over the study's parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov import Solution, SolveError
from filippov.analysis import Orbit, find_orbit
from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.app.report.case import StudyRun
from filippov.app.report.cycles import rows_of
from filippov.app.report.effort import Effort
from filippov.app.report.part import NONE, Chapter, Picture, TextTable, first, number
from filippov.models.studies import Study
from filippov.plot.branch import draw_line
from filippov.plot.style import GREY, INK, SERIES, new_figure, style
from filippov.solving.uncut import solve

SAID = {"unstable": "repels", "undecided": "undecided"}

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RTOL, MOST = 1e-9, 400


@dataclass(frozen=True)
class Followed:
    """One case of the smoother model.

    branch   over the study's parameter, with the coordinate `amplitude`; beyond: further on, where it was
             followed
    small    (start, comes to rest) of starts near rest
    """

    branch: Branch
    beyond: Branch | None
    small: tuple[tuple[float, bool], ...]

    @property
    def fold(self) -> BranchPoint | None:
        """The first fold, beyond the study's range where it is there."""
        found = [*self.branch.folds, *(self.beyond.folds if self.beyond else [])]
        return found[0] if found else None


def followed(study: Study, effort: Effort, k: int) -> Followed:
    """The branch of the smoother model of a study in case k, and the behaviour of starts near rest."""
    model, asked = Smoother(study), study.relative
    assert asked is not None
    own = {k: v for k, v in study.cases[k].parameters.items() if k in model.system.parameters}
    branch = model.branch(model.orbit(own, asked.x0), study.values[-1], effort.follow)
    beyond = None
    if not branch.folds and effort.relatives is None:
        value, x0 = asked.beyond
        far = model.orbit({**own, study.parameter: value}, x0)
        beyond = model.branch(far, max(study.beyond), 1)
    return Followed(branch, beyond, tuple((a, model.rests(own, a)) for a in asked.small))


class Smoother:
    """The smoother model of a study, and its solutions, orbits and branches."""

    def __init__(self, study: Study) -> None:
        assert study.relative is not None
        self.study, self.asked = study, study.relative
        self.system = self.asked.build()
        self.size = f"amplitude {self.system.states[0]}"

    def solution(self, values: Mapping[str, float], x0: Sequence[float], time: float) -> Solution:
        """A solution of a given length."""
        run = solve(
            self.system, x0, (0.0, time), parameters=values, method=self.asked.method, rtol=1e-8, atol=1e-10
        )
        if not run.success:
            raise SolveError(f"the solution of {self.asked.name} ended early: {run.message}", run)
        return run

    def orbit(self, values: Mapping[str, float], x0: Sequence[float]) -> Orbit:
        """The orbit to which a solution converges."""
        end = self.solution(values, x0, self.asked.transient).x_end
        return find_orbit(
            self.system, end, symmetry=self.study.symmetry, method=self.asked.method, rtol=RTOL,
            atol=1e-2 * RTOL, parameters=values,
        )  # fmt: skip

    def rests(self, values: Mapping[str, float], start: float) -> bool:
        """Whether a solution from near rest is at rest in the last tenth of the time it is given."""
        end = self.asked.settle
        run = self.solution(values, (start, *(0.0 for _ in self.system.states[1:])), end)
        assert run.sol is not None
        return bool(np.max(np.abs(run.sol(np.linspace(0.9 * end, end, 2001))[1])) < self.asked.threshold)

    def branch(self, orbit: Orbit, last: float, follow: int) -> Branch:
        """The branch to larger values, up to a number of points after its first fold.

        In parts: steps are in units of the orbit at a part's start, so a new one begins where the word has
        changed and where the orbit has become half as large.
        """
        name, whole = self.study.parameter, None
        bounds = (orbit.parameters[name], last)
        while True:
            run = continuation(
                self.system, orbit, parameter=name, bounds=bounds, direction=1, step=0.15, max_step=1.0,
                max_points=MOST,
            )  # fmt: skip
            whole = whole or Branch(name, run.branch.kind, run.branch.parameters)
            point = self._leg(run, whole, follow)
            whole.message = run.branch.message
            if point is None:
                return whole
            orbit = self.orbit({**orbit.parameters, name: point.value}, point.u[: self.system.dimension])

    def _leg(self, run: Continuation, whole: Branch, follow: int) -> BranchPoint | None:
        """Append the points of one part; the point at which the next one begins, None after the last."""
        start, changed, begun = None, False, bool(whole.points)
        for point in run:
            if start is None:
                start = point.coordinates[self.size]
                if begun:
                    continue
            whole.points.append(point)
            if whole.folds:
                if len(whole.points) - whole.points.index(whole.folds[0]) > follow:
                    return None
            elif point.special:
                changed = True
            elif changed or point.coordinates[self.size] < 0.5 * start:
                return point
        return None


def relative(run: StudyRun) -> Chapter:
    """Where the smoother model is right, and where it is not."""
    asked, name = run.study.relative, run.study.parameter
    assert asked is not None
    found: list[Followed] = []
    with run.stage("smoother model", run.until):
        chosen = run.cases[: run.effort.relatives]
        for k, case in enumerate(chosen):
            run.tell(k / len(chosen), f"{asked.name}, {case.label}")
            found.append(run.aside.value(followed, k))
    size, unit = f"amplitude {asked.build().states[0]}", run.study.unit
    rows, points = [], []
    summary: dict[str, Any] = {}
    facts: dict[str, float] = {}
    for item, exact, case in zip(found, run.cycles, run.cases, strict=False):
        fold = item.fold
        largest = max((first(p) for p in exact.at[run.study.values[0]]), default=None)
        ends = [f"{q.special}, {name} = {q.value:.6f}" for q in exact.special]
        own = item.branch.points[0].coordinates[size]
        change = NONE if largest is None else f"{100 * (own / largest - 1):+.1f} %"
        told = {q.verdict for q in case.fixed if q.d == 0}
        rests = all(rests for _, rests in item.small)
        ratios = [abs(float(case.event_map(start))) / start for start, _ in item.small]
        rows.append((
            case.label, number(largest, 7), number(own, 7), change, "; ".join(ends) or "never",
            f"fold, {name} = {fold.value:.6f}" if fold else "no end found",
            next((word for verdict, word in SAID.items() if verdict in told), "attracts"),
            "attracts" if rests else "repels",
        ))  # fmt: skip
        summary[case.case.key] = {
            "amplitude": own,
            "fold": None if fold is None else {name: fold.value, "amplitude": fold.coordinates[size]},
            "small": [
                {"start": start, "rests": rests, "exact_ratio": ratio}
                for (start, rests), ratio in zip(item.small, ratios, strict=True)
            ],
        }
        facts |= {} if fold is None else {f"relative_fold_{case.slug}": fold.value}
        branches = [b for b in (item.branch, item.beyond) if b is not None]
        points += [(case.case.key, *row) for b in branches for row in rows_of(b, size)]
    starts = ", ".join(f"{start:g}" for start in asked.small)
    source = "filippov.analysis.bifurcations.continuation of an orbit of the model"
    table = TextTable(
        f"{asked.name} beside the inclusion",
        ("case", f"amplitude, inclusion [{unit}]", f"{asked.name} [{unit}]", "change",
         "cycles end, inclusion", f"cycles end, {asked.name}", "rest, inclusion", f"rest, {asked.name}"),
        tuple(rows),
        f"Amplitudes at {name} = {run.study.values[0]:g}. Rest of {asked.name}: solutions from {starts} "
        f"{unit} at this value, {asked.settle:g} s long.", f"{source}, relative.csv.", "relative",
    )  # fmt: skip
    picture = Picture(
        "relative", f"Cycles of {asked.name} over those of the inclusion", source,
        lambda: _branches(run, asked.name, size, found),
    )  # fmt: skip
    columns = ("case", name, "amplitude", "multiplier", "stable", "special")
    return Chapter(
        "relative", f"{asked.name} beside the inclusion", [picture, table], facts, {"relative": summary},
        [("relative.csv", columns, points)],
    )  # fmt: skip


def _branches(run: StudyRun, name: str, size: str, found: list[Followed]) -> Figure:
    """The branches of the smoother model over the exact ones, on a linear and on a logarithmic scale."""
    smooth = {case.slug: item.branch for case, item in zip(run.cases, found, strict=False)}
    with style():
        figure = new_figure(8.6, 4.2)
        linear, log = figure.subplots(1, 2)
        log.set_yscale("log")
        for colour, exact in zip(SERIES, run.cycles, strict=False):
            branch, label = smooth.get(exact.case.slug), exact.case.label
            for ax in (linear, log):
                for b in exact.branches:
                    draw_line(ax, b.values, b.d, b.stable, f"inclusion, {label}", color=colour, linewidth=3.2,
                              alpha=0.3)  # fmt: skip
                if branch is not None:
                    draw_line(ax, branch.values, branch.coordinate(size), branch.stable, f"{name}, {label}",
                              color=colour, linewidth=1.4, alpha=1.0)  # fmt: skip
                    for q in branch.folds:
                        ax.plot(q.value, q.coordinates[size], "D", color=INK, markersize=4, zorder=5)
        linear.set(xlabel=run.label("parameter"), ylabel=run.label("amplitude"))
        log.set(xlabel=run.label("parameter"))
        log.set_title("logarithmic; folds marked", loc="left", fontsize=9.5, color=GREY)
        linear.set_title("stable solid, unstable dashed", loc="left", fontsize=9.5, color=GREY)
        linear.legend(loc="upper right")
        log.set_ylim(bottom=0.3 * min(float(np.min(b.coordinate(size))) for b in smooth.values()))
    return figure
