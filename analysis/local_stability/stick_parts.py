"""Segments of equilibria on one surface that a kink cuts into parts: only the outer ends are ends of stick.

At a kink the field is continuous: the next part begins where one ends, with the same multiplier, and
nothing breaks away there. Parts that share an end are one segment; its ends are those that no other part
has.
"""

from __future__ import annotations

from collections.abc import Iterable

from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

NEAR = 1e-9


def joined(
    found: Iterable[EquilibriumPoint | EquilibriumSet],
) -> dict[int, tuple[EquilibriumPoint, ...]]:
    """By the id of each set that is part of a longer segment: the ends of the segment."""
    sets = [e for e in found if isinstance(e, EquilibriumSet)]
    parts = [e for e in sets if e.dimension == 1 and e.mode.count("0") == 1]
    group = list(range(len(parts)))
    for i, first in enumerate(parts):
        for j, second in enumerate(parts[:i]):
            same = first.mode.index("0") == second.mode.index("0") and first.mode != second.mode
            if same and any(_meet(a, b) for a in first.ends for b in second.ends):
                old, new = group[i], group[j]
                group = [new if g == old else g for g in group]
    out: dict[int, tuple[EquilibriumPoint, ...]] = {}
    for number in set(group):
        members = [part for part, g in zip(parts, group, strict=True) if g == number]
        if len(members) < 2:
            continue
        every = [(part, end) for part in members for end in part.ends]
        outer = tuple(
            end for part, end in every if not any(other is not part and _meet(end, e) for other, e in every)
        )
        infinite = sum(abs(b) == float("inf") for part in members for b in part.bounds[0])
        if len(outer) + infinite == 2:
            out |= {id(part): outer for part in members}
    return out


def _meet(a: EquilibriumPoint, b: EquilibriumPoint) -> bool:
    pairs = zip((*a.value, *a.s_value), (*b.value, *b.s_value), strict=True)
    return all(abs(p - q) <= NEAR * max(1.0, abs(p)) for p, q in pairs)
