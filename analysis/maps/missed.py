"""What came on a section's surfaces where none of its events did."""

from __future__ import annotations

from collections import Counter

from filippov.analysis.maps.section import BoundSection
from filippov.solving.solution import Solution


def missed(bound: BoundSection, run: Solution) -> str:
    """A sentence on the events of a solution that is none of the section's; what may be asked for instead."""
    names = {bound.system.surface_names[i] for i in bound.surfaces}
    where = ", ".join(repr(name) for name in sorted(names))
    kinds = Counter(str(e.kind) for e in run.events if e.surface in names)
    if not kinds:
        others = Counter(f"{e.kind} on {e.surface!r}" for e in run.events)
        told = ", ".join(f"{count} x {what}" for what, count in others.most_common(3))
        there = f"no event came on {where} until t = {run.t_end:g}"
        return f"{there}; elsewhere: {told}" if told else f"{there}, and none elsewhere"
    told = ", ".join(f"{count} x {kind!r}" for kind, count in kinds.most_common())
    mode = f" into mode {bound.section.after!r}" if bound.section.after else ""
    return f"no {bound.section.kind!r}{mode} came on {where} until t = {run.t_end:g}; what came there: {told}"
