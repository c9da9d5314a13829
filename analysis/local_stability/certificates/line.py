"""Equilibria on the line: the sign of the field on either side, by its lowest power.

x' = c |x|^q + o(|x|^q) leads to x = 0 where c x < 0. Source: Filippov 1988.
"""

from __future__ import annotations

from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.homogeneous import EPSILON, lowest
from filippov.analysis.local_stability.certificates.local import Local

SOURCE = "Filippov 1988"


def line(found: Local) -> Certificate | None:
    """The verdict on a point of a system with one state; None where a side has no lowest power."""
    if len(found.x) != 1 or found.resets:
        return None
    (x,) = found.x
    told, away = [], []
    for side in (1, -1):
        signs = []
        for h in found.h:
            part = lowest(h.xreplace({x: side * EPSILON}))
            if part is None or not part[1].is_number or part[1] == 0:
                return None
            signs.append(1 if part[1] > 0 else -1)
        part = lowest(found.fields[tuple(signs)][0].xreplace({x: side * EPSILON}))
        if part is None or not part[1].is_number or part[1] == 0:
            return None
        name = "x > 0" if side > 0 else "x < 0"
        told.append(f"for {name} beside it the field begins with {part[1]} |x|**({part[0]})")
        away.append(bool(side * part[1] > 0))
    if any(away):
        text = "the field leads away on " + ("both sides" if all(away) else "one side")
        return Certificate("unstable", text, SOURCE, tuple(told))
    return Certificate("asymptotically stable", "the field leads to it from both sides", SOURCE, tuple(told))
