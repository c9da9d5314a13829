"""Normal forms of folds, period doublings, symmetry breakings, Neimark-Sacker and Hopf points, and what they
predict.

    fold              value = value0 + curvature s^2 along the null vector
    period doubling   xi -> -(1 + beta) xi + cubic xi^3: xi = +-sqrt(beta/cubic), stable if cubic > 0
    Neimark-Sacker    |z| -> (1 + beta) |z| + cubic |z|^3: a closed curve |z| = sqrt(-beta/cubic)
    Hopf              |z|' = mu |z| + cubic |z|^3: a cycle of |z| = sqrt(-mu/cubic), stable if cubic < 0

Coefficients "root NAME" give the size by coordinates: NAME = NAME0 +- root sqrt|value - value0|.
Source: Kuznetsov 2004, Elements of Applied Bifurcation Theory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import Growth, by_eigenvalues, by_multipliers
from filippov.analysis.bifurcations.branch import LOCATED, BranchPoint
from filippov.analysis.bifurcations.branch_problem import MapProblem, OrbitProblem
from filippov.analysis.bifurcations.corrector import Corrector
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.bifurcations.jets import Jets
from filippov.analysis.bifurcations.return_jets import return_jets
from filippov.analysis.steady.dimensionless import APART
from filippov.base.arrays import Array
from filippov.base.errors import UsageError

Form = tuple[dict[str, float], str]
_ASIDE, _REACH, _FLAT = 1e-3, 1e-3, 1e-7
# Part of a matrix by which it changes where nonlinear terms count.
_BENT = 0.3
# Distance, in the angle, to a root of unity of order up to 4 below which a closed curve is not predicted.
_RESONANT = 1e-3


def number(value: float, width: float) -> str:
    """A value of the parameter in words; width: of its bounds, of which 1e-10 is 0."""
    return f"{round(value / width, 10) * width + 0.0:.6g}"


def null_vectors(matrix: Array) -> tuple[Array, Array]:
    """Left and right unit vectors of the least singular value."""
    left, _, right = linalg.svd(matrix)
    lead = right[-1][int(np.argmax(np.abs(right[-1])))]
    return left[:, -1] * np.sign(lead), right[-1] * np.sign(lead)


def quadratic(problem: Any, u: Array, value: float, p: Array, q: Array) -> float:
    """p . F_uu q q / 2 in scaled unknowns."""
    rows = [
        p @ problem.evaluate(u + side * _REACH * q * problem.scale, value)[1][:, :-1] @ (problem.scale * q)
        for side in (1.0, -1.0)
    ]
    return float(rows[0] - rows[1]) / (4 * _REACH)


def fold(problem: Any, u: Array, value: float, width: float, name: str) -> Form:
    """Curvature of the branch, and how far apart its two halves are; width: of the bounds."""
    matrix = problem.evaluate(u, value)[1]
    sizes = np.max(np.abs(matrix * np.append(problem.scale, width)), axis=1)
    rows = np.where(sizes > 0.0, sizes, 1.0) if problem.kind == "equilibrium" else np.ones(len(sizes))
    p, q = null_vectors(matrix[:, :-1] * problem.scale / rows[:, None])
    p = p / rows
    a, b = quadratic(problem, u, value, p, q), float(p @ matrix[:, -1])
    if abs(b) * width < _FLAT:
        raise UsageError("the parameter does not unfold the point: two branches meet, it is no fold.")
    curvature = -a / b
    out = {"curvature": curvature}
    if abs(curvature) < _FLAT * width:
        return out, "degenerate: the quadratic coefficient is 0 (a cusp in two parameters)"
    ends = [problem.point(u + side * _REACH * q * problem.scale, value).coordinates for side in (1.0, -1.0)]
    for key in ends[0]:
        if key != "slope":
            slope = (ends[0][key] - ends[1][key]) / (2 * _REACH)
            out[f"root {key}"] = abs(slope) / float(np.sqrt(abs(curvature)))
    inside, outside = (">", "<") if curvature > 0 else ("<", ">")
    at = number(value, width)
    return out, f"two solutions for {name} {inside} {at}, none for {name} {outside} {at}"


def _rate(
    problem: Any, u: Array, value: float, width: float, read: Callable[[BranchPoint], float]
) -> float:
    """d(read)/d(value) along the branch."""
    corrector, step = Corrector(problem, width), _ASIDE * width
    sides = [read(corrector.fixed(u, value + side * step)) for side in (1.0, -1.0)]
    return (sides[0] - sides[1]) / (2 * step)


def doubling(problem: Any, u: Array, value: float, width: float, name: str, symmetric: bool) -> Form:
    """A period doubling, of the half map where it breaks a symmetry."""
    jets, directions = return_jets(problem, u, value)
    cubic, q = jets.cubic_flip()

    def multiplier(point: BranchPoint) -> float:
        if isinstance(problem, MapProblem):
            return float(point.tests["symmetry breaking" if symmetric else "period doubling"]) - 1.0
        values = np.array(point.multipliers)
        near = values[int(np.argmin(np.abs(values - (1.0 if symmetric else -1.0))))].real
        return -float(np.sqrt(abs(near))) if symmetric else float(near)

    rate = _rate(problem, u, value, width, multiplier)
    others = list(linalg.eigvals(jets.A))
    del others[int(np.argmin(np.abs(np.array(others) + 1.0)))]
    attracts = by_multipliers(others, LOCATED)
    out = {"cubic": cubic, "rate": rate}
    what = "pair without the symmetry" if symmetric else "doubled orbit"
    return _branching(out, cubic, -rate, directions @ q, _names(problem), value, name, what, attracts,
                      width)  # fmt: skip


def neimark_sacker(problem: Any, u: Array, value: float, width: float, name: str) -> Form:
    """A Neimark-Sacker point."""
    jets, directions = return_jets(problem, u, value)
    values = linalg.eigvals(jets.A)
    upper = values[values.imag > 1e-6]
    if not upper.size:
        raise UsageError("no pair of multipliers is complex: a neutral saddle, without a closed curve.")
    angle = float(np.angle(upper[int(np.argmin(np.abs(np.abs(upper) - 1.0)))]))
    out = {"angle": angle}
    for k, goal in ((1, 0.0), (2, np.pi), (3, 2 * np.pi / 3), (4, np.pi / 2)):
        if abs(angle - goal) < _RESONANT:
            return out, f"strong resonance 1:{k}: the cubic coefficient alone decides nothing"
    cubic = jets.cubic_neimark_sacker(angle)

    def modulus(point: BranchPoint) -> float:
        near = np.asarray(
            np.array(point.multipliers, dtype=complex) ** (0.5 if _half(problem) else 1.0), dtype=complex
        )
        pair = near[np.abs(near.imag) > 1e-9]
        return _nearest(pair)

    rate = _rate(problem, u, value, width, modulus)
    q, _ = jets.pair(np.exp(1j * angle))
    others = [v for v in values if abs(abs(v) - 1.0) > 1e-4]
    out |= {"cubic": cubic, "rate": rate}
    size = 2 * np.abs(directions @ q)
    return _branching(out, -cubic, rate, size, _names(problem), value, name, "closed invariant curve",
                      by_multipliers(others, LOCATED), width)  # fmt: skip


def _half(problem: Any) -> bool:
    return isinstance(problem, OrbitProblem) and problem.shooting.symmetry_order == 2


def _nearest(pair: npt.NDArray[np.complex128]) -> float:
    sizes = np.abs(pair)
    return float(sizes[int(np.argmin(np.abs(sizes - 1.0)))])


def hopf(problem: EquilibriumProblem, u: Array, value: float, width: float, name: str) -> Form:
    """A Hopf point of an equilibrium off the surfaces."""
    jets, scale = hopf_jets(problem, u, value)
    values = linalg.eigvals(jets.A)
    upper = values[values.imag > 1e-8 * np.max(np.abs(values))]
    if not upper.size:
        raise UsageError("the two eigenvalues are real: a neutral saddle, without a cycle.")
    frequency = float(upper[int(np.argmin(np.abs(upper.real)))].imag)
    cubic, q = jets.cubic_hopf(frequency)

    def growth(point: BranchPoint) -> float:
        pair = np.array(point.multipliers)
        return float(pair[int(np.argmin(np.abs(pair - 1j * frequency)))].real)

    rate = _rate(problem, u, value, width, growth)
    pair = np.argsort(np.abs(np.abs(values.imag) - frequency) + np.abs(values.real))[:2]
    others = np.delete(values, pair)
    out = {"cubic": cubic, "rate": rate, "frequency": frequency}
    return _branching(out, -cubic, rate, 2 * np.abs(scale * q), list(problem.system.states), value, name,
                      "cycle", by_eigenvalues(others), width, frequency)  # fmt: skip


def hopf_jets(problem: EquilibriumProblem, u: Array, value: float) -> tuple[Jets, Array]:
    """Jets of the field of the equilibrium's mode, and the sizes of its states."""
    if problem.sliding:
        raise UsageError("the coefficient of a Hopf point is not known for a sliding field.")
    n, scale = problem.system.dimension, problem.scale[: problem.system.dimension]

    def matrix(z: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.asarray(problem.evaluate(u + scale * z, value)[1][:n, :n] * scale / scale[:, None])

    # The ratios of the units by the linear terms, then their common size by the others.
    units = linalg.balance(matrix(np.zeros(n)))
    if np.max(units) > APART * np.min(units):
        scale = scale * units / float(np.exp(np.mean(np.log(units))))
    scale = scale * _bend(matrix, n)
    return Jets(matrix, n), scale


def _bend(matrix: Callable[[Array], Array], n: int) -> float:
    """How far from 0, along the axes and the diagonals, a matrix changes by a part of itself; 1 if near 1.

    An equilibrium at 0 does not tell the unit of its states: there only the nonlinear terms do.
    """
    here = matrix(np.zeros(n))
    size = float(np.max(np.abs(here)))
    rows = np.vstack([np.eye(n), -np.eye(n), np.ones((1, n)), -np.ones((1, n))])
    for reach in 10.0 ** np.arange(-12.0, 12.5, 0.5):
        change = [float(np.max(np.abs(matrix(reach * row) - here))) for row in rows]
        if not np.max(change) < _BENT * size:
            return reach if not 1.0 / APART < reach < APART else 1.0
    return 1.0


def _names(problem: MapProblem | OrbitProblem) -> list[str]:
    if isinstance(problem, MapProblem):
        return [problem.event_map.section.coordinate]
    return list(problem.shooting.system.states)


def _branching(
    out: dict[str, float], restoring: float, rate: float, size: Array, names: list[str], value: float,
    name: str, what: str, others: Growth, width: float, unit: float = 1.0,
) -> Form:  # fmt: skip
    """The solutions that branch off where growth = rate (value - value0) is balanced by restoring xi^3.

    width  of the bounds of the parameter; unit: of the growth
    """
    flat = abs(restoring) < _FLAT * unit
    if flat or abs(rate) * width < _FLAT * unit:
        return out, f"degenerate: the {'cubic coefficient' if flat else 'rate'} is 0"
    factor = float(np.sqrt(abs(rate / restoring)))
    out |= {f"root {key}": factor * abs(float(s)) for key, s in zip(names, size, strict=True)}
    above = rate * restoring > 0
    kind = "supercritical" if restoring > 0 else "subcritical"
    born = "a stable" if restoring > 0 and others == "stable" else "an unstable"
    if restoring > 0 and others == "undecided":
        born = "an undecided"
    return out, f"{kind}: {born} {what} for {name} {'>' if above else '<'} {number(value, width)}"
