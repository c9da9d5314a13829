"""Floquet multipliers of a periodic orbit from the factors of its monodromy matrix.

Where the orbit slides, the matrix has as many zero multipliers as there are surfaces it slides on. They are
split off before the eigenvalues are taken: the product is begun anew at the segment with most sliding
surfaces and restricted to their tangent space, so that zeros are zeros and do not disturb the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.algebra import linalg
from filippov.analysis.sensitivity.saltation import Factor, flow_factors
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array
from filippov.solving.solution import Solution


def return_factors(
    solutions: Sequence[Solution], gate: Array | None = None, jacobian: Callable[..., Any] | None = None
) -> tuple[list[Array], int]:
    """Factors of the derivative of the return, one for each part of the orbit, the first applied first, and
    the number of zero multipliers that are split off.

    gate: symmetry G of the return Phi(x) = G x; None for a whole period.
    """
    n = solutions[0].problem.system.dimension
    factors: list[Array] = []
    places: list[tuple[Solution, Factor]] = []
    ends: list[int] = []
    for solution in solutions:
        for factor in flow_factors(solution, False, (), jacobian):
            factors.append(factor.matrix[:n, :n])
            places.append((solution, factor))
        ends.append(len(factors))
    if gate is not None:
        factors.append(np.asarray(linalg.inv(gate), dtype=np.float64))
    counts = [
        len(mode_field(solution.problem.system, factor.mode, (), jacobian).parts.owners)
        for solution, factor in places
    ]
    most = max(counts, default=0)
    if most == 0:
        begins = [0, *ends[:-1], len(factors)]
        return [_product(factors[a:b], n) for a, b in pairwise(begins)], 0
    j = counts.index(most)
    solution, factor = places[j]
    basis = _tangent_basis(solution, factor.t, factor.mode, jacobian)
    turned = [*factors[j + 1 :], *factors[: j + 1]]
    cuts = sorted({(end - j - 1) % len(factors) for end in ends} - {0})
    parts = [_product(turned[a:b], n) for a, b in pairwise([0, *cuts, len(turned)])]
    parts[0] = parts[0] @ basis
    parts[-1] = basis.T @ parts[-1]
    return parts, n - basis.shape[1]


def _product(factors: Sequence[Array], n: int) -> Array:
    total = np.eye(n)
    for matrix in factors:
        total = matrix @ total
    return total


def product_multipliers(
    factors: Sequence[Array], zeros: int, power: int = 1
) -> npt.NDArray[np.complex128]:
    """Eigenvalues of the product of factors to the power `power`, zeros split off, largest modulus first.

    Of several factors they are the powers of the eigenvalues of the block-cyclic matrix: of a product, large
    multipliers would spoil the small ones. Source: Lust 2001; Kressner 2005.
    """
    k, r = len(factors), factors[0].shape[1]
    if k == 1:
        return multipliers(factors[0], zeros, power)
    sizes = [factor.shape[1] for factor in factors]
    places = np.cumsum([0, *sizes])
    cyclic = np.zeros((places[-1], places[-1]))
    for i, factor in enumerate(factors):
        row, column = places[(i + 1) % k], places[i]
        cyclic[row : row + factor.shape[0], column : column + factor.shape[1]] = factor
    roots = np.asarray(linalg.eigvals(cyclic), dtype=complex)
    powers = roots[np.argsort(-np.abs(roots))][: k * r] ** k
    # Each multiplier has k roots: the nearest values belong together.
    values: list[complex] = []
    while len(powers):
        order = np.argsort(np.abs(powers - powers[0]))
        value = complex(np.mean(powers[order[:k]]))
        values.append(complex(value.real) if abs(value.imag) <= 1e-12 * abs(value) else value)
        powers = np.delete(powers, order[:k])
    everything = np.concatenate((np.array(values, dtype=complex) ** power, np.zeros(zeros, dtype=complex)))
    return everything[np.lexsort((-everything.imag, -np.abs(everything)))]


def _tangent_basis(
    solution: Solution, t: float, mode: tuple[int, ...], jacobian: Callable[..., Any] | None
) -> Array:
    """Orthonormal basis of the tangent space of the surfaces a mode slides on: (n, r)."""
    sol, p = solution.sol, solution.problem.p
    assert sol is not None
    system = solution.problem.system
    time = np.array([min(max(t, min(sol.span)), max(sol.span))])
    x = np.atleast_2d(sol(time, side="+").T)
    part = mode_field(system, mode, (), jacobian)
    slope = part.part("heldy", time, x, part.multipliers(time, x, p), p)[0, :, : system.dimension]
    return np.asarray(linalg.null_space(slope), dtype=np.float64)


def multipliers(matrix: Array, zeros: int, power: int = 1) -> npt.NDArray[np.complex128]:
    """Eigenvalues of the matrix to the power `power`, with the zeros split off, largest modulus first."""
    values = linalg.eigvals(matrix) if matrix.size else np.zeros(0)
    everything = np.concatenate((np.asarray(values, dtype=complex) ** power, np.zeros(zeros, dtype=complex)))
    return everything[np.lexsort((-everything.imag, -np.abs(everything)))]


def without_trivial(
    values: npt.NDArray[np.complex128],
) -> tuple[npt.NDArray[np.complex128], complex]:
    """The multipliers of an autonomous orbit without the one nearest to 1, and that one."""
    k = int(np.argmin(np.abs(values - 1.0)))
    return np.delete(values, k), complex(values[k])
