"""What slides and switches in the panels of a solution: each panel shows its own surfaces.

A surface belongs to a state that its function holds, and to a place whose rate is made of such states; to an
output that holds its sign. With one surface that slides all panels are shaded: it is plain which one it is.
Where more surfaces slide than there are colours, or one that has no panel, a strip below has a row for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.escape import figure_text
from filippov.base.status import EventKind
from filippov.plot.style import GREY, MARKS, SLIDING
from filippov.solving.reading import expression_of
from filippov.solving.solution import Solution

MOST_MARKS, FEW_MARKS = 160, 40
# Sets of sliding surfaces with a colour each, rows of the strip.
MOST_SETS, MOST_ROWS = 6, 40
Bars = list[tuple[float, float]]


def own_surfaces(solution: Solution, name: str) -> set[str] | None:
    """The surfaces that belong to a state, output or formula; None where that is not known."""
    system = solution.system
    form, surfaces = system.symbolic, system.surface_names
    if form is None:
        return None
    if name not in system.states:
        try:
            signs = expression_of(system, name).free_symbols
        except (UsageError, ModelError):
            return None
        return {surface for surface, s in zip(surfaces, form.s, strict=True) if s in signs}
    states = set(form.x)
    q = form.x[system.states.index(name)]
    rate = form.field[system.states.index(name)].free_symbols
    near = {q} | (rate if rate <= states - {q} else set())
    return {surface for surface, h in zip(surfaces, form.plain_h(), strict=True) if h.free_symbols & near}


class Sliding:
    """The sliding phases of a solution and how the panels of some names show them."""

    def __init__(self, solution: Solution, names: Sequence[str]) -> None:
        self.solution = solution
        self.rows: dict[str, Bars] = {}
        for segment in solution.segments:
            for surface, m in zip(solution.system.surface_names, segment.mode, strict=True):
                if m == 0:
                    bars = self.rows.setdefault(surface, [])
                    bars.append((min(segment.t0, segment.t1), segment.dwell))
        own = {name: own_surfaces(solution, name) for name in names}
        every = set(solution.system.surface_names)
        whole = len(self.rows) < 2
        self.own = {name: every if found is None or whole else found for name, found in own.items()}
        shown = set().union(*self.own.values()) if self.own else set()
        sets = {key for name in names for key in self._sets(name)}
        self.strip = len(self.rows) > 1 and (len(sets) > MOST_SETS or not set(self.rows) <= shown)
        self._colours: dict[str, str] = {}
        self._named: set[str] = set()

    def _sets(self, name: str) -> dict[str, Bars]:
        """The times in which each set of a panel's own surfaces slides."""
        surfaces, own = self.solution.system.surface_names, self.own[name]
        spans: dict[str, Bars] = {}
        for segment in self.solution.segments:
            on = [s for s, m in zip(surfaces, segment.mode, strict=True) if m == 0 and s in own]
            if on:
                spans.setdefault(", ".join(on), []).append((min(segment.t0, segment.t1), segment.dwell))
        return spans

    def shade(self, ax: Any, name: str) -> None:
        """Bands behind a panel while its own surfaces slide: a colour for each set, or one for all."""
        spans = self._sets(name)
        if self.strip:
            spans = {"its own surface": [bar for bars in spans.values() for bar in bars]} if spans else {}
        for key, bars in spans.items():
            colour = self._colours.setdefault(key, SLIDING[len(self._colours) % len(SLIDING)])
            ax.broken_barh(
                bars, (0, 1), transform=ax.get_xaxis_transform(), facecolor=colour, alpha=0.22,
                linewidth=0, zorder=0, label=self._once(figure_text(f"sliding on {key}")),
            )  # fmt: skip

    def mark(self, ax: Any, name: str, a: Sequence[float], b: Sequence[float]) -> None:
        """A mark for each event on the panel's own surfaces, and where its state jumps."""
        marks(ax, self.solution, a, b, self._own_events(name), self._once)

    def _own_events(self, name: str) -> list[int]:
        solution = self.solution
        own = self.own[name]
        if len(solution.system.surface_names) > 1:
            found = own_surfaces(solution, name)
            own = own if found is None else found
        i = solution.system.states.index(name)
        surfaces = set(solution.system.surface_names)
        return [
            k
            for k, e in enumerate(solution.events)
            if e.surface in own
            or (e.surface not in surfaces and e.kind is not EventKind.RESET)
            or (e.x_after is not None and e.x_after[i] != e.x[i])
        ]

    def draw_strip(self, ax: Any) -> None:
        """A row for each surface that slides, with a bar while it does."""
        longest = sorted(self.rows, key=lambda s: -sum(dwell for _, dwell in self.rows[s]))[:MOST_ROWS]
        order = [s for s in self.solution.system.surface_names if s in longest]
        for k, surface in enumerate(order):
            ax.broken_barh(self.rows[surface], (k - 0.4, 0.8), facecolor=SLIDING[0], linewidth=0)
            ax.axhline(k + 0.5, color=GREY, linewidth=0.3)
        left = len(self.rows) - len(order)
        ax.set_ylim(len(order) - 0.5, -0.5)
        ax.set_yticks(range(len(order)), [figure_text(s) for s in order], fontsize=6.5)
        ax.tick_params(axis="y", length=0)
        ax.set_ylabel(f"sliding on\n({left} more do)" if left else "sliding on")

    @property
    def strip_height(self) -> float:
        """In parts of a panel's height."""
        return 0.35 + 0.085 * min(len(self.rows), MOST_ROWS)

    def _once(self, label: str) -> str | None:
        if label in self._named:
            return None
        self._named.add(label)
        return label


def marks(
    ax: Any, solution: Solution, a: Sequence[float], b: Sequence[float], chosen: Sequence[int], once: Any
) -> None:
    """A mark for each chosen event, in front of the line; none at all where they would cover it."""
    if len(chosen) > MOST_MARKS:
        return
    size = 5 * min(1.0, (FEW_MARKS / max(len(chosen), 1)) ** 0.5)
    kinds = [event.kind for event in solution.events]
    for kind, (marker, colour) in MARKS.items():
        here = [k for k in chosen if kinds[k] is kind]
        if here:
            ax.plot(
                [a[k] for k in here], [b[k] for k in here], marker, color=colour, markersize=size,
                zorder=4, markeredgewidth=1.0 if marker == "x" else 0, label=once(str(kind)),
            )  # fmt: skip
