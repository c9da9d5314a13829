"""Phases of sliding (sticking) and slip."""

from __future__ import annotations

from typing import Any, Literal

from filippov.app.bank.case_runs import CaseRuns, slides
from filippov.app.bank.measures.measure import Measure, one_of
from filippov.solving.segments import Segment


class Phases(Measure, quantity="phases"):
    """Phases that slide (stick), or that do not (slip); a slip through h = 0 is one phase.

    slides  whether those that slide are meant
    over    "span", or "period": those that lie within the last period of the solution that the run settles on
    whole   without those at the beginning and the end of the span, if there are others
    number  only that one, from 1 or from the end with -1; first: only so many
    take    length, interval ([begin, end]), begin, middle, end
    """

    slides: bool
    over: Literal["span", "period"] = "span"
    whole: bool = False
    number: int | None = None
    first: int | None = None
    take: Literal["length", "interval", "begin", "middle", "end"] = "length"

    def __call__(self, subject: CaseRuns) -> Any:
        segments: tuple[Segment, ...] = subject.main.segments
        if self.over == "period":
            (low, high), tiny = subject.cycle.span, 1e-9 * subject.cycle.period
            every = subject.cycle.run.segments
            segments = tuple(s for s in every if s.t0 >= low - tiny and s.t1 <= high + tiny)
        elif self.whole:
            segments = segments[1:-1] or segments
        found = [(low, high) for kind, low, high in phases(segments) if kind == self.slides]
        taken = [self._taken(*phase) for phase in found][: self.first]
        return taken if self.number is None else one_of(taken, self.number, "such phases")

    def _taken(self, low: float, high: float) -> Any:
        return {
            "length": high - low, "interval": [low, high], "begin": low, "middle": 0.5 * (low + high),
            "end": high,
        }[self.take]  # fmt: skip


def phases(segments: tuple[Segment, ...]) -> list[tuple[bool, float, float]]:
    """Whether it slides, its begin and end; a slip through h = 0 is one phase, in any number of modes."""
    out: list[tuple[bool, float, float]] = []
    for segment in segments:
        kind, low = slides(segment.mode), segment.t0
        if out and out[-1][0] == kind:
            low = out.pop()[1]
        out.append((kind, low, segment.t1))
    return [phase for phase in out if phase[1] != phase[2]]
