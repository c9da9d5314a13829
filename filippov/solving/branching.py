"""Follow every mode that can follow: the solutions of an inclusion as a tree (U1)."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import check_count, number_array, whole
from filippov.base.status import Status
from filippov.solving.loop import BranchStart, Followed, follow
from filippov.solving.selection.ambiguity import ambiguity_at
from filippov.solving.selection.modes import Successor
from filippov.solving.solution_tree import SolutionTree, TreeBranch
from filippov.solving.state.options import Options
from filippov.solving.state.problem import Problem

MAX_BRANCHES, MAX_DEPTH = 64, 8
MOST_RELEASES = 100_000


def branch(
    problem: Problem,
    options: Options,
    *,
    max_branches: int = MAX_BRANCHES,
    max_depth: int = MAX_DEPTH,
    release_times: Any = None,
    progress: Callable[[float, float], None] | None = None,
) -> SolutionTree:
    """All solutions from the problem's initial state, breadth first.

    max_branches   most whole solutions; max_depth: most decisions along one. Where a bound is reached, a
                   branch ends with NON_UNIQUE and holds its candidates, and the tree's status is BRANCHES
    release_times  a number n: for each segment of sliding that can be left at any time, the departures at n
                   equally spaced times inside it are followed; or a list of times. This is a sample:
                   solutions that leave in between are not in the tree

    max_time holds for the whole tree, the other budgets for each branch. Raises UsageError.
    """
    grower = _Grower(
        problem,
        options,
        check_count("max_branches", max_branches),
        check_count("max_depth", max_depth),
        _releases(release_times, problem),
        progress,
    )
    return grower.grow()


def _releases(given: Any, problem: Problem) -> int | Array:
    """A number of departures, or their times in the order of integration."""
    if given is None:
        return np.zeros(0)
    if isinstance(given, int) and not isinstance(given, bool):
        return whole("release_times", given, 1, most=MOST_RELEASES)
    times = np.unique(number_array("release_times", given))
    low, high = sorted(problem.t_span)
    if times.ndim != 1 or not np.all((times >= low) & (times <= high)):
        raise UsageError(
            f"release_times is {given!r}, expected a whole number or times in t_span = {problem.t_span}."
        )
    return times if problem.t_span[1] >= problem.t_span[0] else times[::-1]


@dataclass(frozen=True)
class _Shoot:
    """A branch to be followed."""

    parent: int | None
    depth: int
    begin: BranchStart | None
    t: float
    x: Array
    stop: npt.NDArray[np.int64] | None


class _Grower:
    """The tree while it grows."""

    def __init__(
        self,
        problem: Problem,
        options: Options,
        max_branches: int,
        max_depth: int,
        releases: int | Array,
        progress: Callable[[float, float], None] | None,
    ) -> None:
        self.problem, self.options, self.progress = problem, options, progress
        self.max_branches, self.max_depth, self.releases = max_branches, max_depth, releases
        self.branches: list[TreeBranch] = []
        self.children: list[list[int]] = []
        self.leaves = 1
        self.cut: set[str] = set()
        self.deadline = time.monotonic() + options.max_time
        self.waiting: deque[_Shoot] = deque()

    def grow(self) -> SolutionTree:
        """Follow all waiting branches until none is left, or until an interrupt."""
        self.waiting.append(_Shoot(None, 0, None, self.problem.t_span[0], self.problem.x0, None))
        while self.waiting:
            shoot = self.waiting.popleft()
            number, followed = self._grow_one(shoot)
            if followed.solution.status is Status.INTERRUPTED:
                break
            self._part(number, followed)
        done = tuple(
            replace(item, children=tuple(numbers))
            for item, numbers in zip(self.branches, self.children, strict=True)
        )
        return SolutionTree(self.problem, done, *self._outcome(done))

    def _follow(self, shoot: _Shoot, end: float) -> Followed:
        options = replace(self.options, max_time=max(self.deadline - time.monotonic(), 1e-3))
        problem = self.problem.remake(x0=shoot.x, t_span=(shoot.t, end))
        origin = self.problem.t_span[0]
        return follow(problem, options, self.progress, None, shoot.begin, origin, shoot.stop)

    def _grow_one(self, shoot: _Shoot) -> tuple[int, Followed]:
        """Follow one branch, parted at the release times where it slides; the number of its last part."""
        end = self.problem.t_span[1]
        followed = self._follow(shoot, end)
        for begin in self._departures(shoot, followed):
            t = begin.ambiguity.t
            part = self._follow(shoot, t)
            if not part.solution.success:
                break
            number = self._add(shoot, part)
            for candidate in begin.ambiguity.candidates:
                if candidate is not begin.chosen:
                    self._wait(number, shoot.depth + 1, BranchStart(begin.ambiguity, candidate), part)
            self.leaves += len(begin.ambiguity.candidates) - 1
            shoot = _Shoot(number, shoot.depth, begin, t, part.solution.x_end, part.stop)
            followed = self._follow(shoot, end)
        return self._add(shoot, followed), followed

    def _departures(self, shoot: _Shoot, followed: Followed) -> list[BranchStart]:
        """The release times at which the sliding that a branch begins with can be left, with its staying."""
        solution = followed.solution
        segment = solution.segments[-1 if len(solution.segments) == 1 else 0]
        dense = solution.sol
        if shoot.begin is None or 0 not in segment.mode or segment.mode != shoot.begin.chosen.mode:
            return []
        if isinstance(self.releases, int):
            times = np.linspace(segment.t0, segment.t1, self.releases + 2)[1:-1]
        else:
            times = self.releases
        inside = (times - segment.t0) * (times - segment.t1) < 0
        out: list[BranchStart] = []
        leaves = self.leaves
        multipliers = np.array(shoot.begin.chosen.multipliers)
        for t in times[inside].tolist():
            if dense is None:
                raise UsageError("release_times need the dense output; drop dense_output=False.")
            ambiguity = ambiguity_at(
                solution.problem, self.options, t, dense(t), segment.mode, multipliers
            )
            stays = None if ambiguity is None else _staying(ambiguity.candidates, segment.mode, multipliers)
            if ambiguity is None or stays is None:
                continue
            multipliers = np.array(stays.multipliers)
            leaves += len(ambiguity.candidates) - 1
            if self._refuses(leaves, shoot.depth + 1):
                break
            out.append(BranchStart(ambiguity, stays))
        return out

    def _part(self, number: int, followed: Followed) -> None:
        """Let every candidate at the end of a branch wait to be followed."""
        ambiguity, depth = followed.solution.ambiguity, self.branches[number].depth
        if ambiguity is None or not ambiguity.candidates:
            return
        if self._refuses(self.leaves + len(ambiguity.candidates) - 1, depth + 1):
            return
        self.leaves += len(ambiguity.candidates) - 1
        for candidate in ambiguity.candidates:
            self._wait(number, depth + 1, BranchStart(ambiguity, candidate), followed)

    def _refuses(self, leaves: int, depth: int) -> bool:
        """Whether a bound forbids so many leaves or decisions; it is remembered."""
        if depth > self.max_depth:
            self.cut.add(f"max_depth = {self.max_depth}")
        elif leaves > self.max_branches:
            self.cut.add(f"max_branches = {self.max_branches}")
        else:
            return False
        return True

    def _wait(self, parent: int, depth: int, begin: BranchStart, followed: Followed) -> None:
        end = followed.solution
        self.waiting.append(_Shoot(parent, depth, begin, end.t_end, end.x_end, followed.stop))

    def _add(self, shoot: _Shoot, followed: Followed) -> int:
        number = len(self.branches)
        begin = shoot.begin
        self.branches.append(
            TreeBranch(
                number,
                shoot.parent,
                shoot.depth,
                begin.chosen if begin is not None else None,
                begin.ambiguity if begin is not None else None,
                followed.solution,
            )
        )
        self.children.append([])
        if shoot.parent is not None:
            self.children[shoot.parent].append(number)
        return number

    def _outcome(self, branches: tuple[TreeBranch, ...]) -> tuple[Status, str]:
        leaves = [item.solution for item in branches if not item.children]
        early = [leaf for leaf in leaves if not leaf.success]
        found = f"{len(leaves)} solutions in {len(branches)} branches"
        cut = [leaf for leaf in early if leaf.status is Status.NON_UNIQUE]
        others = [leaf for leaf in early if leaf.status is not Status.NON_UNIQUE]
        if self.waiting:
            missing = f"{len(self.waiting)} candidates were not followed"
            return Status.INTERRUPTED, f"{found}, {missing}. {Status.INTERRUPTED.advice}"
        if others:
            counted = f"{len(others)} of {len(leaves)} solutions ended early, the first: {others[0].message}"
            return others[0].status, f"{found}. {counted}"
        if cut or self.cut:
            where = " and ".join(sorted(self.cut))
            return Status.BRANCHES, f"{found}, cut by {where}. {Status.BRANCHES.advice}"
        return Status.SUCCESS, f"{found}. Each was followed to its end."


def _staying(
    candidates: tuple[Successor, ...], mode: tuple[int, ...], multipliers: Array
) -> Successor | None:
    """The candidate that goes on sliding as before."""
    same = [c for c in candidates if c.mode == mode]
    return min(same, key=lambda c: math.dist(c.multipliers, multipliers), default=None)
