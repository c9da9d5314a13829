"""Linear algebra that says what it cannot do: MatrixError where a matrix is singular or is not of numbers.

numpy and LAPACK tell these apart by chance ("SVD did not converge") and as errors of theirs, which no search
for a solution expects. The functions are numpy's and scipy's of the same name, but `balance` and `expm`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from filippov.base.errors import SolveError


class MatrixError(SolveError, np.linalg.LinAlgError):
    """A linear problem without a solution: its matrix is singular, or has entries that are no numbers."""


def _named(function: Callable[..., Any], task: str, *, of_numbers: bool = True) -> Callable[..., Any]:
    """The function with MatrixError in place of the library's; of_numbers: NaN and inf are refused before."""

    @wraps(function)
    def called(*matrices: Any, **options: Any) -> Any:
        if of_numbers and not all(np.all(np.isfinite(matrix)) for matrix in matrices):
            raise MatrixError(
                f"{task} failed: the matrix has entries that are not finite. The field, its derivatives or "
                "those of an event have no value where it was taken; give another state or parameters."
            )
        try:
            return function(*matrices, **options)
        except np.linalg.LinAlgError as error:
            raise MatrixError(
                f"{task} failed: {str(error).rstrip('.').lower()}. What it was to give is not determined "
                "there; give another state or parameters."
            ) from None

    return called


# NaN rows of a stack are let through: one point of many without a value is nothing to end for.
solve = _named(np.linalg.solve, "solving linear equations", of_numbers=False)
inv = _named(np.linalg.inv, "inverting a matrix")
pinv = _named(np.linalg.pinv, "inverting a matrix")
lstsq = _named(np.linalg.lstsq, "solving linear equations")
svd = _named(np.linalg.svd, "finding singular values")
eig = _named(np.linalg.eig, "finding eigenvalues")
eigh = _named(np.linalg.eigh, "finding eigenvalues")
eigvals = _named(np.linalg.eigvals, "finding eigenvalues")
eigvalsh = _named(np.linalg.eigvalsh, "finding eigenvalues")
cholesky = _named(np.linalg.cholesky, "factoring a matrix")
roots = _named(np.roots, "finding roots of a polynomial")
null_space = _named(scipy.linalg.null_space, "finding a null space")
# values, left and right eigenvectors
eig_both = _named(lambda matrix: scipy.linalg.eig(matrix, left=True, right=True), "finding eigenvalues")
# Terms of the exponential's series: of a matrix of norm 0.5 the next one is 2e-18.
_TERMS = 15


def _balance(matrix: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Units of the states, powers of two, in which rows and columns of a matrix are of one size: (n,)."""
    # scipy casts the units to an integer permutation that is not asked for.
    with np.errstate(invalid="ignore"):
        _, (units, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
    return np.asarray(units, dtype=float)


balance = _named(_balance, "balancing a matrix")


def _expm(matrix: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """exp(matrix) of a small real matrix (n, n): the series of matrix / 2**k, squared k times.

    scipy's function of this name hands matrices of any size to threads: one of 3 x 3 may take 10 ms where
    other work keeps the cores busy. Source: Moler & Van Loan 2003, "Nineteen dubious ways to compute the
    exponential of a matrix", method 3. It is taken in units of the states in which the matrix is balanced
    (there, section 8): its errors are relative to its norm.
    """
    units = _balance(matrix)
    matrix = matrix * units / units[:, None]
    identity = np.eye(len(matrix))
    k = max(0, int(np.frexp(np.max(np.sum(np.abs(matrix), axis=0), initial=0.0))[1]) + 1)
    part = 0.5**k * matrix
    out = identity
    for j in range(_TERMS, 0, -1):
        out = identity + part @ out / j
    for _ in range(k):
        out = out @ out
    balanced: npt.NDArray[np.float64] = out * units[:, None] / units
    return balanced


expm = _named(_expm, "taking a matrix exponential")
