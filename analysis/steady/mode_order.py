"""Modes that are not empty, and may hold an equilibrium.

Signs of surfaces at a constant distance, as knots of a table, exclude others; where q' = c v an equilibrium
has v = 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from filippov.analysis.algebra.exact_form import exact_form
from filippov.model.system import System

Relations = Mapping[int, list[tuple[int, int, int]]]
SIGNS = {"+": 1, "0": 0, "-": -1}


def existing_modes(system: System, options: Sequence[str]) -> Iterator[str]:
    """The modes with one sign of each surface's options that are not empty, in order."""
    relations = _relations(system)

    def grown(mode: str) -> Iterator[str]:
        if len(mode) == len(options):
            yield mode
            return
        for sign in options[len(mode)]:
            if all(_meet(sign, mode[j], way, side) for j, way, side in relations.get(len(mode), ())):
                yield from grown(mode + sign)

    return grown("")


def at_rest_only(system: System, options: Sequence[str]) -> list[str]:
    """The options with "0" alone for the surfaces that vanish where all speeds do.

    A speed is a state that is another's rate, to a factor.
    """
    form = exact_form(system)
    if form is None:
        return list(options)
    rates = [f.as_coeff_Mul() for f in form.field]
    still = {v: 0 for c, v in rates if c != 0 and v in form.x}
    out = list(options)
    for i, h in enumerate(form.h):
        if "0" in options[i] and not h.has(*form.a) and h.subs(still).expand().is_zero:
            out[i] = "0"
    return out


def _relations(system: System) -> Relations:
    """For surface i the earlier j with h_i = way h_j + d: (j, way, sign of d), d a number that is not 0."""
    form = exact_form(system)
    out: dict[int, list[tuple[int, int, int]]] = {}
    if form is None:
        return out
    plain = [i for i, s in enumerate(system.surfaces) if s.kind in {"switching", "kink"} and s.width == 0]
    for place, i in enumerate(plain):
        for j in plain[:place]:
            for way in (1, -1):
                d = (form.h[i] - way * form.h[j]).expand()
                if d.is_Rational and d != 0:
                    out.setdefault(i, []).append((j, way, 1 if d > 0 else -1))
    return out


def _meet(sign: str, other: str, way: int, side: int) -> bool:
    """Whether h = way h_j + d, d of the sign `side`, can have its sign where h_j has the other."""
    return side * way * SIGNS[other] < 0 or SIGNS[sign] == side
