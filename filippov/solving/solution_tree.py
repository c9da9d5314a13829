"""All solutions of an inclusion from one initial state, as a tree with branches where several modes follow.

A branch is the part of a solution from one such point to the next. A path is a whole solution: the sequence
of branches from the root to a leaf.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from filippov.base.arrays import Array
from filippov.base.delegates import delegate
from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import Answering
from filippov.base.shown import Shown
from filippov.base.status import Status, mode_text
from filippov.solving.segments import Segment
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.selection.modes import Successor
from filippov.solving.solution import Solution
from filippov.solving.state.events import Event, Events
from filippov.solving.state.interpolant import outside
from filippov.solving.state.problem import Problem

if TYPE_CHECKING:
    import networkx as nx

    from filippov.model.system import System


@dataclass(frozen=True)
class TreeBranch:
    """The part of a solution between two branching points.

    number    its place in `tree.branches`; parent: that of the branch it continues (None for the root)
    depth     decisions taken since the root; continuing to slide past a release time does not count
    chosen    the mode taken where it begins (None for the root)
    ambiguity the point it begins at, with all candidates (None for the root)
    solution  an ordinary Solution over its time interval
    """

    number: int
    parent: int | None
    depth: int
    chosen: Successor | None
    ambiguity: Ambiguity | None
    solution: Solution
    children: tuple[int, ...] = ()

    @property
    def t0(self) -> float:
        """Where it begins in time."""
        return self.solution.problem.t_span[0]

    @property
    def t1(self) -> float:
        """Where it ends."""
        return self.solution.t_end

    @property
    def mode(self) -> str:
        """The mode it begins in, as text; "" for a root that ends where it begins."""
        if self.chosen is None and self.children and self.t0 == self.t1:
            return ""
        return mode_text(self.chosen.mode if self.chosen is not None else self.solution.start_mode)

    def holds(self, t: float) -> bool:
        """Whether t belongs to this branch: its end does, its beginning is the parent's end."""
        direction = 1.0 if self.solution.problem.t_span[1] >= self.t0 else -1.0
        after = (t - self.t0) * direction > 0 or (self.parent is None and t == self.t0)
        return after and (t - self.t1) * direction <= 0


class Path(Shown):
    """A whole solution: branches from the root to a leaf, with the parts of a Solution."""

    def __init__(self, branches: tuple[TreeBranch, ...]) -> None:
        self.branches = branches
        last = branches[-1].solution
        self.status, self.message = last.status, last.message
        self.t_end, self.x_end, self.end_mode = last.t_end, last.x_end, last.end_mode

    @property
    def number(self) -> int:
        """Number of the leaf it leads to."""
        return self.branches[-1].number

    @property
    def success(self) -> bool:
        """Whether it was followed to the end."""
        return self.status.ok

    @cached_property
    def t(self) -> Array:
        """Times of all parts in order, each once."""
        return np.concatenate([branch.solution.t[first:] for branch, first in self._parts()])

    @cached_property
    def y(self) -> Array:
        """States at `t`, shape (n, k)."""
        return np.concatenate([branch.solution.y[:, first:] for branch, first in self._parts()], axis=1)

    def _parts(self) -> Iterator[tuple[TreeBranch, int]]:
        for k, branch in enumerate(self.branches):
            yield branch, 1 if k else 0

    @cached_property
    def events(self) -> Events:
        """Events of all pieces; the choice at a branching point is the first event of the part after it."""
        items: list[Event] = []
        for branch in self.branches:
            shift = items[-1].group + 1 if items else 0
            items += [event._replace(group=event.group + shift) for event in branch.solution.events]
        return Events(items, self.branches[0].solution.events)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Segments, each in one mode; two of the same mode that meet at a branching point are one."""
        out: list[Segment] = []
        for branch in self.branches:
            for segment in branch.solution.segments:
                if out and (out[-1].mode == segment.mode or out[-1].t0 == out[-1].t1):
                    begin = out.pop()
                    out.append(Segment(begin.t0, segment.t1, segment.mode))
                elif segment.t0 != segment.t1 or not out:
                    out.append(segment)
        return tuple(out)

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes of the segments, as text."""
        return tuple(mode_text(segment.mode) for segment in self.segments)

    @keywords()
    def sol(self, t: Any, side: str = "-") -> Array:
        """States at the times, shape (n,) or (n, k); UsageError outside the span of the path."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        first, last = self.branches[0].t0, self.t_end
        low, high = min(first, last), max(first, last)
        bad = ~((times >= low) & (times <= high))
        if np.any(bad):
            raise UsageError(outside("sol", float(times[np.argmax(bad)]), low, high))
        columns = []
        for time in times.tolist():
            held = next(branch for branch in self.branches if branch.holds(time))
            dense = held.solution.sol
            if dense is None:
                raise UsageError("sol needs the dense output; solve without dense_output=False.")
            columns.append(dense(time, side=side))
        return np.array(columns).T if np.ndim(t) else columns[0]

    def __repr__(self) -> str:
        numbers = " - ".join(str(branch.number) for branch in self.branches)
        return f"Path({numbers}; modes {' '.join(self.modes)}; {self.status.value} at t = {self.t_end:.9g})"


@dataclass(frozen=True)
class Reachable:
    """States reached at one time.

    x          one row per state found, shape (k, n)
    branches   the branch of each row
    low, high  bounds of x, shape (n,). The set of states reached at a time is connected (Filippov 1988,
               section 7), so every value between them is reached by some solution; if x is only a sample of
               the set, its bounds may lie further out
    complete   whether all branches got this far
    """

    t: float
    x: Array
    branches: tuple[int, ...]
    low: Array
    high: Array
    complete: bool


class SolutionTree(Shown, Answering):
    """The solutions from one initial state, which branch where several modes can follow.

    tree[k]   the path that leads to leaf number k; len(tree) is their number
    branches  all pieces, parents before children; root: the first
    problem   what was solved
    status    SUCCESS; BRANCHES where the tree is cut by max_branches or max_depth; else the status of the
              first branch that ended early. message: a sentence
    """

    _write: ClassVar[str] = ': what solve(..., nonunique="branch") returns'
    _elsewhere: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("sol", "t", "x", "y", "t_end", "x_end", "events", "segments", "evaluate", "mode_at", "to_pandas"),
        "it holds several solutions: those of tree.paths() go from the initial state to an end each.",
    )

    def __init__(
        self, problem: Problem, branches: tuple[TreeBranch, ...], status: Status, message: str
    ) -> None:
        self.problem, self.branches = problem, branches
        self.status, self.message = status, message

    @property
    def system(self) -> System:
        """The system that was solved."""
        return self.problem.system

    @property
    def success(self) -> bool:
        """Whether every branch was followed to the end."""
        return self.status.ok

    @property
    def root(self) -> TreeBranch:
        """The branch that begins at the initial state."""
        return self.branches[0]

    @property
    def unique(self) -> bool:
        """Whether there is one solution only."""
        return len(self.branches) == 1

    def leaves(self) -> tuple[TreeBranch, ...]:
        """The branches without children."""
        return tuple(branch for branch in self.branches if not branch.children)

    @keywords()
    def children(self, branch: TreeBranch) -> tuple[TreeBranch, ...]:
        """The branches that continue this one."""
        return tuple(self.branches[number] for number in branch.children)

    @keywords()
    def path(self, leaf: TreeBranch | int) -> Path:
        """The whole solution that ends with a branch."""
        branch: TreeBranch | None = self.branches[leaf] if isinstance(leaf, int) else leaf
        found: list[TreeBranch] = []
        while branch is not None:
            found.append(branch)
            branch = None if branch.parent is None else self.branches[branch.parent]
        return Path(tuple(reversed(found)))

    def paths(self) -> tuple[Path, ...]:
        """One whole solution per leaf."""
        return tuple(self.path(leaf) for leaf in self.leaves())

    @keywords()
    def reachable(self, t: float) -> Reachable:
        """The states of all branches at a time; UsageError where no branch covers it."""
        rows, numbers = [], []
        for branch in self.branches:
            if branch.holds(t):
                if branch.solution.sol is None:
                    raise UsageError("reachable needs the dense output; solve without dense_output=False.")
                rows.append(branch.solution.sol(float(t)))
                numbers.append(branch.number)
        if not rows:
            first, last = self.problem.t_span
            raise UsageError(
                f"reachable was asked for t = {t}, where no branch of the tree is: take a time between "
                f"{first:g} and "
                f"{last:g}, at which a solution goes on (tree.leaves() tells where each ends)."
            )
        x = np.array(rows)
        direction = 1.0 if self.problem.t_span[1] >= self.problem.t_span[0] else -1.0
        complete = all((leaf.t1 - t) * direction >= 0 for leaf in self.leaves())
        return Reachable(float(t), x, tuple(numbers), x.min(axis=0), x.max(axis=0), complete)

    def graph(self) -> nx.DiGraph:
        """Branches as nodes (t0, t1, mode, modes, depth, status), choices as edges (t, at, mode)."""
        import networkx as nx

        graph = nx.DiGraph()
        for branch in self.branches:
            graph.add_node(
                branch.number, t0=branch.t0, t1=branch.t1, mode=branch.mode, modes=branch.solution.modes,
                depth=branch.depth, status=branch.solution.status.value,
            )  # fmt: skip
            if branch.parent is not None and branch.ambiguity is not None:
                graph.add_edge(
                    branch.parent, branch.number, t=branch.t0, at=branch.ambiguity.name, mode=branch.mode
                )
        return graph

    def plot(self, states: Sequence[str] | str | None = None, **options: Any) -> Any:
        """All solutions over time, branching points marked (see `filippov.plot.tree`)."""
        return delegate("SolutionTree.plot")(self, states, **options)

    def plot_tree(self, **options: Any) -> Any:
        """The tree itself: branches by time, with their modes (see `filippov.plot.tree`)."""
        return delegate("SolutionTree.plot_tree")(self, **options)

    def __len__(self) -> int:
        return len(self.leaves())

    def __getitem__(self, k: int) -> Path:
        return self.paths()[k]

    @keywords()
    def save(self, path: str | FilePath) -> FilePath:
        """Write the tree to one file; it appears complete or not at all (see `filippov.io.tree_storage`)."""
        written: FilePath = delegate("SolutionTree.save")(self, path)
        return written

    @classmethod
    @keywords()
    def load(cls, path: str | FilePath, system: System | None = None) -> SolutionTree:
        """Read what `save` wrote; a system of plain functions has to be given again."""
        loaded: SolutionTree = delegate("SolutionTree.load")(path, system)
        return loaded

    def __repr__(self) -> str:
        counts = f"{len(self.leaves())} solutions, {len(self.branches)} branches"
        lines = [f"SolutionTree({self.status.value}; {counts})"]
        waiting = [(self.root, 0)]
        while waiting:
            branch, indent = waiting.pop()
            at = f"{branch.ambiguity.name}, " if branch.ambiguity is not None else ""
            span = f"[{branch.t0:.9g}, {branch.t1:.9g}]"
            ended = "" if branch.children else f" {branch.solution.status.value}"
            lines.append(f"{'  ' * indent}{branch.number}: {at}{branch.mode or 'start'} {span}{ended}")
            waiting += [(child, indent + 1) for child in reversed(self.children(branch))]
        return "\n".join(lines)
