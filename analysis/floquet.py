"""Floquet multipliers of a periodic orbit from the factors of its monodromy matrix.

Where the orbit slides, the matrix has as many zero multipliers as there are surfaces it slides on. They are
split off before the eigenvalues are taken: the product is begun anew at the stretch with most sliding
surfaces and restricted to their tangent space, so that zeros are zeros and do not disturb the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from filippov.analysis.saltation import Factor, flow_factors
from filippov.analysis.variation import mode_field
from filippov.solution import Solution

Array = npt.NDArray[np.float64]


def return_matrix(
    motions: Sequence[Solution], gate: Array | None = None, jacobian: Callable[..., Any] | None = None
) -> tuple[Array, int]:
    """The derivative of the return, zero multipliers split off: (matrix (r, r), number of zeros split off).

    gate: symmetry G of the return Phi(x) = G x; None for a whole period.
    """
    n = motions[0].problem.system.dimension
    factors: list[Array] = []
    places: list[tuple[Solution, Factor]] = []
    for motion in motions:
        for factor in flow_factors(motion, False, (), jacobian):
            factors.append(factor.matrix[:n, :n])
            places.append((motion, factor))
    if gate is not None:
        factors.append(np.asarray(np.linalg.inv(gate), dtype=np.float64))
    counts = [sum(v == 0 for v in factor.mode) for _, factor in places]
    most = max(counts, default=0)
    if most == 0:
        return _product(factors, n), 0
    j = counts.index(most)
    motion, factor = places[j]
    basis = _tangent_basis(motion, factor.t, factor.mode, jacobian)
    total = _product([*factors[j + 1 :], *factors[: j + 1]], n)
    return np.asarray(basis.T @ total @ basis), n - basis.shape[1]


def _product(factors: Sequence[Array], n: int) -> Array:
    total = np.eye(n)
    for matrix in factors:
        total = matrix @ total
    return total


def _tangent_basis(
    motion: Solution, t: float, mode: tuple[int, ...], jacobian: Callable[..., Any] | None
) -> Array:
    """Orthonormal basis of the tangent space of the surfaces a mode slides on: (n, r)."""
    sol, p = motion.sol, motion.problem.p
    assert sol is not None
    system = motion.problem.system
    time = np.array([min(max(t, min(sol.span)), max(sol.span))])
    x = np.atleast_2d(sol(time, side="+").T)
    part = mode_field(system, mode, (), jacobian)
    rows = [i for i, sign in enumerate(mode) if sign == 0]
    slope = part.part("hy", time, x, part.multipliers(time, x, p), p)[0, rows, : system.dimension]
    return np.asarray(scipy.linalg.null_space(slope), dtype=np.float64)


def multipliers(matrix: Array, zeros: int, turns: int = 1) -> npt.NDArray[np.complex128]:
    """Eigenvalues of the matrix to the power `turns`, with the zeros split off, largest modulus first."""
    values = np.linalg.eigvals(matrix) if matrix.size else np.zeros(0)
    everything = np.concatenate((np.asarray(values, dtype=complex) ** turns, np.zeros(zeros, dtype=complex)))
    return everything[np.lexsort((-everything.imag, -np.abs(everything)))]


def without_trivial(
    values: npt.NDArray[np.complex128],
) -> tuple[npt.NDArray[np.complex128], complex]:
    """The multipliers of an autonomous orbit without the one nearest to 1, and that one."""
    k = int(np.argmin(np.abs(values - 1.0)))
    return np.delete(values, k), complex(values[k])
