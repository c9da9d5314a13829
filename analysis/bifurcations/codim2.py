"""Test functions of codimension-2 points on curves in two parameters, by what the curve is of.

    fold             cusp (quadratic coefficient 0); another multiplier 1, -1 or a pair on the unit circle:
                     resonance 1:1, fold-flip, fold-Neimark-Sacker; of equilibria Bogdanov-Takens, fold-Hopf
    period doubling  generalized period doubling (cubic coefficient 0); resonance 1:2, fold-flip,
                     flip-Neimark-Sacker
    Neimark-Sacker   resonances 1:1 to 1:4 by the cosine of the angle; fold- and flip-Neimark-Sacker
    Hopf             Bogdanov-Takens, fold-Hopf, Bautin (cubic coefficient 0)
    grazing, crossing-, switching-, adding-sliding (KIND)
                     KIND-fold, KIND-doubling, KIND-Neimark-Sacker: a multiplier 1, -1, a pair;
                     double grazing: another least height is 0; degenerate crossing- and switching-sliding:
                     L_F2^2 H = 0, where the two kinds meet
    boundary equilibrium
                     boundary fold, boundary Hopf; degenerate boundary equilibrium, C A^-1 B = 0 (on a kink
                     det A = 0 beyond it), between persistence and non-smooth fold; boundary tangency,
                     C B = 0; boundary node-focus in the plane; corner equilibrium on a second surface
    curves of equilibria that meet a surface: boundary fold, boundary Hopf

Source: Kuznetsov 2004; Kowalczyk et al. 2006, Int. J. Bif. Chaos 16, 601, for the border
collisions of orbits; Dercole, Della Rossa, Colombo & Kuznetsov 2011 for boundary equilibria.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.bifurcations.boundary_normal_form import KinkEquilibrium, boundary
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.branch_problem import OrbitProblem, pairs, product
from filippov.analysis.bifurcations.corrector import FAILURES
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.bifurcations.return_jets import return_jets
from filippov.analysis.bifurcations.smooth_normal_form import hopf_jets, quadratic
from filippov.base.arrays import Array, Complex
from filippov.base.errors import UsageError

# Keys of tests begin with it: "codim 2 NAME" or "codim 2 NAME @boundary SURFACE".
PREFIX = "codim 2 "
Tests = Iterator[tuple[str, float]]
DOUBLING = ("period doubling", "symmetry breaking")


def is_boundary(kind: str) -> bool:
    """Whether a kind is that of a boundary equilibrium: "boundary NAME", "upper NAME", "lower NAME"."""
    return kind.split(" ", maxsplit=1)[0] in ("boundary", "upper", "lower")


def title(key: str) -> tuple[str, str]:
    """Name and note of a test."""
    name, _, surface = key.removeprefix(PREFIX).partition(" @")
    return name, surface


def smooth_tests(
    kind: str, inner: Any, u: Array, value: float, point: BranchPoint, null: tuple[Array, Array] | None
) -> dict[str, float]:
    """Tests on a curve of smooth points or boundary equilibria; null: left and right vector of a fold."""
    found: dict[str, float] = {}
    if kind == "fold" and null is not None:
        found["cusp"] = quadratic(inner, u, value, *null)
    if isinstance(inner, EquilibriumProblem):
        source = _boundary(kind, inner, u, value, point) if is_boundary(kind) else _still(
            kind, inner, u, value, point
        )  # fmt: skip
        found |= dict(source)
    else:
        found |= dict(_moving(kind, inner, u, value, point))
    return {PREFIX + name: number for name, number in found.items() if np.isfinite(number)}


def orbit_multipliers(inner: Any, u: Array, value: float, point: BranchPoint) -> Complex:
    """Multipliers, of a symmetric orbit those of its half map."""
    if isinstance(inner, OrbitProblem):
        orbit = inner.orbit(u, value)
        half = orbit.half_multipliers
        return orbit.multipliers if half is None else half
    return np.array(point.multipliers, dtype=complex)


def without(values: Complex, goal: float) -> Complex:
    """All but the one nearest to a number."""
    return np.delete(values, int(np.argmin(np.abs(values - goal)))) if values.size else values


def critical_pair(values: Complex, sums: bool) -> tuple[Complex, Complex]:
    """The pair with the product 1 (or the sum 0), and the others."""
    count = len(values)
    at = min(
        ((i, j) for i in range(count) for j in range(i + 1, count)),
        key=lambda ij: abs(values[ij[0]] + values[ij[1]] if sums else 1 - values[ij[0]] * values[ij[1]]),
    )
    return values[list(at)], np.delete(values, at)


def _moving(kind: str, inner: Any, u: Array, value: float, point: BranchPoint) -> Tests:
    """Of maps and orbits."""
    values = orbit_multipliers(inner, u, value, point)
    if kind == "fold":
        rest = without(values, 1.0)
        names = ("resonance 1:1", "fold-flip", "fold-Neimark-Sacker")
    elif kind in DOUBLING:
        rest = without(values, -1.0)
        names = ("fold-flip", "resonance 1:2", "flip-Neimark-Sacker")
        try:
            yield "generalized period doubling", return_jets(inner, u, value)[0].cubic_flip()[0]
        except (*FAILURES, UsageError):
            pass
    elif kind == "Neimark-Sacker" and len(values) > 1:
        pair, rest = critical_pair(values, False)
        cosine = float(np.sum(pair).real) / 2
        for name, goal in (("1:1", 1.0), ("1:2", -1.0), ("1:3", -0.5), ("1:4", 0.0)):
            yield f"resonance {name}", cosine - goal
        names = ("fold-Neimark-Sacker", "flip-Neimark-Sacker", "")
    else:
        return
    if len(rest):
        yield names[0], product(1.0 - rest)
        yield names[1], product(1.0 + rest)
    if len(rest) > 1 and names[2]:
        yield names[2], pairs(rest)


def _still(kind: str, inner: EquilibriumProblem, u: Array, value: float, point: BranchPoint) -> Tests:
    """Of equilibria."""
    values = np.array(point.multipliers, dtype=complex)
    if kind == "fold":
        rest = without(values, 0.0)
        if len(rest):
            yield "Bogdanov-Takens", product(rest)
        if len(rest) > 1:
            yield "fold-Hopf", pairs(rest, True)
    elif kind == "Hopf" and len(values) > 1:
        pair, rest = critical_pair(values, True)
        square = product(pair)
        yield "Bogdanov-Takens", square
        if len(rest):
            yield "fold-Hopf", product(rest)
        if square > 0 and not inner.sliding:
            yield "Bautin", hopf_jets(inner, u, value)[0].cubic_hopf(float(np.sqrt(square)))[0]
    for key, number in point.tests.items():
        if is_boundary(key) and kind in ("fold", "Hopf"):
            yield f"boundary {kind} @{key}", number


def _boundary(kind: str, inner: EquilibriumProblem, u: Array, value: float, point: BranchPoint) -> Tests:
    """Of boundary equilibria."""
    for key, number in point.tests.items():
        # On the border itself one of both ends of a set is 0.
        if is_boundary(key) and key.split(" ", 1)[1] != kind.split(" ", 1)[1]:
            yield f"corner equilibrium @{key}", number
    try:
        at = boundary(inner, kind, u, value)
    except UsageError:
        return
    if isinstance(at, KinkEquilibrium):
        yield "degenerate boundary equilibrium", float(np.linalg.det(at.A[1]))
        A = at.A[0]
        if inner.sliding:
            yield "boundary fold", float(np.linalg.det(A))
            return
    else:
        yield "degenerate boundary equilibrium", at.bordered
        yield "boundary tangency", at.across
        A = at.A
    values = linalg.eigvals(A).astype(complex)
    yield "boundary fold", product(values)
    if len(values) > 1:
        yield "boundary Hopf", pairs(values, True)
    if len(values) == 2:
        yield "boundary node-focus", float(np.trace(A) ** 2 - 4 * np.linalg.det(A))


def border_tests(kind: str, values: Complex, others: list[float], bend: float | None) -> dict[str, float]:
    """Tests on a curve of grazing or of a change of sliding.

    values: multipliers; others: heights of the other tangencies; bend: L_F2^2 H at an arrival
    """
    found = {f"{kind}-fold": product(1.0 - values), f"{kind}-doubling": product(1.0 + values)}
    if len(values) > 1:
        found[f"{kind}-Neimark-Sacker"] = pairs(values)
    if others:
        found["double grazing"] = min(others)
    if bend is not None:
        found[f"degenerate {kind}"] = bend
    return {PREFIX + name: number for name, number in found.items()}
