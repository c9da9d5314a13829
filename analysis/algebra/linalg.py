"""Linear algebra that says what it cannot do: MatrixError where a matrix is singular or is not of numbers.

numpy and LAPACK tell these apart by chance ("SVD did not converge") and as errors of theirs, which no search
for a solution expects. The functions are numpy's and scipy's of the same name.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
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
