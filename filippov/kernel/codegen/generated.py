"""What the compiled loop is given of a system: kernel source, and constants that say what it looks like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from filippov.kernel.codegen.structure import Structure
from filippov.kernel.language.unit import Constant
from filippov.model.surface import Surface

# `pair` where two calls of `rhs` are the best there is.
PAIR = (
    "def pair(t: float, x: Vector, p: Vector, s: Vector, s2: Vector, m: Vector, out: Vector, out2: Vector, "
    "ctx: Indices) -> int:"
)
TWICE = [
    PAIR,
    "    code = rhs(t, x, p, s, m, out, ctx)",
    "    if code != 0:",
    "        return code",
    "    return rhs(t, x, p, s2, m, out2, ctx)",
]
_ROLES = {"switching": 0, "kink": 1, "observer": 2, "reset": 3}


@dataclass(frozen=True)
class Generated:
    """Kernel source and constants of a system, ready for `build`."""

    source: str
    constants: dict[str, Constant]


def unit_constants(
    n: int,
    parameters: int,
    surfaces: tuple[Surface, ...],
    linear: Sequence[bool],
    affine: bool,
    is_non_lipschitz: bool,
    pattern: Structure,
    moving: Sequence[bool],
    straight: Sequence[bool],
    wide: bool = False,
    held: Sequence[bool] = (),
    clamped: bool = True,
    ticks: Sequence[object] = (),
    roots: Sequence[bool] = (),
    same_as: Sequence[int] = (),
) -> dict[str, Constant]:
    """The constants of `filippov.kernel.loop.model` that belong to the system.

    ticks: of every time event that the loop looks after its reset, or None
    """
    own: dict[str, Constant] = {
        "N": n,
        "M": len(surfaces),
        "P": parameters,
        "AFFINE": affine,
        "NON_LIPSCHITZ": is_non_lipschitz,
        "CLAMPED": is_non_lipschitz and clamped,
        "KINKED": any(surface.kind == "kink" for surface in surfaces),
        "WIDE": wide,
        "ROLE": [_ROLES[surface.kind] for surface in surfaces] or [0],
        "LINEAR": [int(flag) for flag in linear] or [1],
        "WIDTH": [float(surface.width) for surface in surfaces] or [0.0],
        "MOVING": [int(flag) for flag in moving] or [0],
        "STRAIGHT": [int(flag) for flag in straight] or [0],
        "ALL_LINEAR": all(linear),
        "ROOTS": any(roots),
        "ROOTED": [int(flag) for flag in roots] or [0] * max(len(surfaces), 1),
        "HELD": [int(flag) for flag in held] or [0] * max(len(surfaces), 1),
        "SAME_AS": list(same_as) or [0] * max(len(surfaces), 1),
        "OBSERVED": any(same_as),
        # Of an implicit method `newton_band` may find another order.
        "BAND": 0,
        "IN_BAND": [0],
        **_reset_constants(n, surfaces, ticks),
    }
    own |= pattern.constants(n)
    wider = any(tuple(surface.radius) != (-1, 1) for surface in surfaces)
    own["COUPLED"] = affine and (2 if wider else 3) <= own["LARGEST"]  # type: ignore[operator]
    return own


def _reset_constants(n: int, surfaces: Sequence[Surface], ticks: Sequence[object]) -> dict[str, Any]:
    """The constants of `filippov.kernel.loop.model` that say what resets the state."""
    sides = {"+": 1, "-": -1, "both": 2}
    come = [sides[q.side] if q.reset is not None else 0 for q in surfaces]
    contact = [sides[q.side] if q.contact else 0 for q in surfaces]
    resets = any(come)
    return {
        "RESET_FROM": come or [0],
        "CONTACT": contact or [0],
        "RESETS": resets,
        "CONTACTS": any(contact),
        "TICKS": len(ticks) > 0,
        "EVENT_SIZE": 3 + 2 * n if resets or any(row is not None for row in ticks) else 3 + n,
    }
