"""The slope of an event map at the set where it rests, in closed form: a return of the linearised inclusion.

From an end of a set of rest positions the slip field vanishes, so a return from a coordinate d next to the
set obeys y' = A y on its side of the surface, y(0) = d dx0/dd, until c y = 0 again at T: then R(d)/d -> r
y(T)/d, with c = grad h and r the gradient of the coordinate. Where the slip field grows out of the surface
like |h|**e with 0 < e < 1, or does not vanish at the end, a solution that starts arbitrarily close to the set
leaves it by a finite distance: the map jumps there. Source: `filippov.analysis.steady.rest_map`; Hensen & van
de Molengraft 2002, section 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from filippov import System
from filippov.analysis.algebra import linalg
from filippov.analysis.sensitivity.variation import mode_field
from filippov.analysis.steady.drift_map import first_zero
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.linearisation import linearise
from filippov.base.arrays import Array
from filippov.base.status import mode_text
from filippov.solving.uncut import solve

if TYPE_CHECKING:
    from filippov.analysis.maps.scalar_map import ScalarMap

# A constant part below this part of the field's terms is rounding.
ROUNDING = 1e-11
# What the smallest number, as the coordinate, leaves of a rate is below this.
NONE = 1e-150
# Coordinate, in units of the reach, from which the mode of the slip is read.
NEAR = 1e-3


def linear_slope(return_map: ScalarMap, reach: float) -> float | None:
    """Limit of R(d)/d for d -> 0 on the side of `reach`, for a map of one return.

    inf or -inf where the map jumps at 0 or slip grows without end; None where no formula gives it: a system
    of plain functions, a section on several surfaces or of another kind than an entry into sliding, a return
    that does not begin with slip from the end of a set, slip that fades away beside the surface.
    """
    system, section = return_map.system, return_map.section
    if system.symbolic is None or system.time_events or len(return_map.bound.surfaces) > 1 or section.after:
        return None
    if section.kind != "sliding entry" or any(s.kind != "switching" for s in system.surfaces):
        return None
    i, side = return_map.bound.surfaces[0], math.copysign(1.0, reach)
    x0 = return_map.bound.start(np.array([NEAR * reach]), return_map.p)[0]
    mode = solve(system, x0, (0.0, 0.0), parameters=return_map.parameters).start_mode
    if mode[i] == 0 or 0 in mode:
        return None
    tiny = side * np.finfo(float).tiny
    x0 = return_map.bound.start(np.array([tiny]), return_map.p)[0]
    signs = np.array([mode], dtype=float)
    heights = mode_field(system, mode).part("h", np.zeros(1), x0[None], signs, return_map.p)[0, :, 0]
    normals = _normal(return_map, mode, x0)
    sizes = np.abs(normals) @ np.abs(x0)
    on = np.abs(heights) <= ROUNDING * sizes
    if any(on[k] != (k == i) for k in range(len(heights))):
        return None
    normal = normals[i]
    outward, at = mode[i] * normal, (*return_map.p, *x0)
    slip = next((case for case in _cases(system, mode, i) if case.condition(*at)), None)
    if slip is None:
        return None
    if slip.growth is not None and (grows := float(outward @ np.array(slip.growth(*at), dtype=float))):
        return _jumping(return_map, reach) if grows > 0 else None
    if slip.matrix is None:
        return None
    jump = np.array(slip.jump(*at), dtype=float)
    matrix = np.array(slip.matrix(*at), dtype=float)
    if np.any(np.abs(jump) > ROUNDING * np.array(slip.size(*at), dtype=float) + NONE):
        return _jumping(return_map, reach) if outward @ jump > 0 else None
    y = side * return_map.bound.start_slope(tiny, return_map.p)
    if abs(normal @ y) > ROUNDING * float(np.abs(normal) @ np.abs(y)):
        return None
    time = first_zero(matrix, outward, y)
    if time == math.inf:
        return _jumping(return_map, reach)
    if time is None or not time > 0:
        return None
    return float(side * return_map.bound.slope(x0) @ linalg.expm(matrix * time) @ y)


def _normal(return_map: ScalarMap, mode: tuple[int, ...], x0: Array) -> Array:
    """Gradients of the surfaces' h: (m, n)."""
    field, signs = mode_field(return_map.system, mode), np.array([mode], float)
    rows = field.part("hy", np.zeros(1), x0[None], signs, return_map.p)
    return np.asarray(rows[0, :, : return_map.system.dimension])


@dataclass(frozen=True)
class _Case:
    """The slip field beside the surface in one case of the exponents, as functions of parameters and states.

    size    of the terms of the jump
    growth  the coefficients of |h|**e where its slope at 0 is infinite
    """

    condition: Callable[..., Any]
    jump: Callable[..., Any]
    size: Callable[..., Any]
    matrix: Callable[..., Any] | None
    growth: Callable[..., Any] | None


@lru_cache(maxsize=64)
def _cases(system: System, mode: tuple[int, ...], i: int) -> tuple[_Case, ...]:
    """Made once for a system, a mode and the surface it lies beside: the states stay symbols."""
    form = system.symbolic
    assert form is not None
    on = mode_text(tuple(0 if k == i else m for k, m in enumerate(mode)))
    multiplier = ((system.surfaces[i].name, sympy.Integer(mode[i])),)
    point = EquilibriumPoint(on, system.states, form.x, multiplier, (), (), "boundary equilibrium")

    def function(rows: Any) -> Callable[..., Any]:
        made: Callable[..., Any] = sympy.lambdify((*form.p, *form.x), rows, "numpy")
        return made

    return tuple(
        _Case(
            function(sympy.S(slip.condition)),
            function(list(slip.jump)),
            function([_size(e) for e in slip.jump]),
            None if slip.matrix is None else function(slip.matrix.tolist()),
            None if slip.singular is None else function(list(slip.singular[1])),
        )
        for slip in linearise(system, point, sides=[mode_text(mode)]).slip
        if slip.jump
    )


def _size(expression: Any) -> Any:
    """The magnitudes of the terms of an expression together: what rounding of it is measured by."""
    return sympy.Add(*(sympy.Abs(term) for term in sympy.Add.make_args(sympy.expand(expression))))


def _jumping(return_map: ScalarMap, reach: float) -> float | None:
    """Infinite, with the sign of the map next to 0."""
    value = float(return_map(NEAR * reach))
    return math.copysign(math.inf, value * reach) if math.isfinite(value) and value else None
