"""Singular matrices and such with NaN end an analysis by name, never by an error of numpy or LAPACK."""

from typing import Any

import mpmath
import numpy as np
import pytest

from filippov import SolveError, System, sqrt, states
from filippov.analysis import find_orbit
from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.linalg import MatrixError
from filippov.analysis.orbits.saddle import saddle
from filippov.model.symbols import Abs, sign
from filippov.models import hunting

x, y = states("x y")
SINGULAR, NAN = np.zeros((2, 2)), np.full((2, 2), np.nan)
NAMES = ["expm", "inv", "pinv", "lstsq", "svd", "eig", "eigh", "eigvals", "eigvalsh", "cholesky"]
NAMES += ["null_space", "eig_both"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_13_4_what_is_not_finite_is_named(name: str, value: float, capfd: pytest.CaptureFixture[str]) -> None:
    right = (np.ones(2),) if name == "lstsq" else ()
    with pytest.raises(MatrixError, match="not finite"):
        getattr(linalg, name)(np.array([[1.0, value], [0.0, 1.0]]), *right)
    assert capfd.readouterr().out == ""  # LAPACK writes to stdout
    for kind in (SolveError, np.linalg.LinAlgError):
        assert issubclass(MatrixError, kind)


def test_13_4_what_is_singular_is_named() -> None:
    with pytest.raises(MatrixError, match="solving linear equations failed: singular matrix"):
        linalg.solve(SINGULAR, np.ones(2))
    with pytest.raises(MatrixError, match="singular"):
        linalg.inv(SINGULAR)
    with pytest.raises(MatrixError, match="not positive definite"):
        linalg.cholesky(-np.eye(2))
    with pytest.raises(MatrixError, match="not finite"):
        linalg.roots([1.0, np.nan])
    # One point without a value does not end the others.
    assert np.isnan(linalg.solve(np.array([NAN, np.eye(2)]), np.ones((2, 2, 1)))).sum() == 2


def test_13_4_no_cycle_beyond_the_fold_of_hunting_is_told() -> None:
    """The excursions shrink to rest, where the map has no slope; the fold is at P = 21.0149797699."""
    with pytest.raises(SolveError, match="NO_RETURN: the solution does not come back"):
        find_orbit(hunting(), (0.1, 0, 0), parameters={"P": 22}, t_max=60)


FIELDS = [((sqrt(Abs(x)) + 1, -y), None), ((1 / x, -y), None), ((sign(y), y), "0"), ((0 * x, 0 * y), None)]


def test_the_matrix_exponential_to_rounding_of_its_parts() -> None:
    """Of matrices of any norm and shape, against series of 60 digits; each squaring doubles the rounding."""
    rng = np.random.default_rng(5)
    for k in range(60):
        n = int(rng.integers(1, 7))
        matrix = 10 ** rng.uniform(-6, 1.2) * rng.standard_normal((n, n))
        if k % 3 == 0:  # far from normal, and decaying
            matrix = np.triu(matrix, 1) * 10 - np.diag(rng.uniform(0, 30, n))
        with mpmath.workdps(60):
            exact = np.array(mpmath.expm(mpmath.matrix(matrix.tolist())).tolist(), dtype=float)
        norm = np.max(np.sum(np.abs(matrix), axis=0))
        error = np.max(np.abs(linalg.expm(matrix) - exact)) / np.max(np.abs(exact))
        assert error < 20 * np.finfo(float).eps * (1 + norm)
    np.testing.assert_array_equal(linalg.expm(np.zeros((3, 3))), np.eye(3))
    assert linalg.expm(np.zeros((0, 0))).shape == (0, 0)


@pytest.mark.parametrize(("right", "mode"), FIELDS)
def test_13_4_a_saddle_where_the_field_has_no_slope_is_refused(right: tuple[Any, Any], mode: str) -> None:
    with pytest.raises((SolveError, ValueError)) as told:
        saddle(System({x: right[0], y: right[1]}), (0.0, 0.0), mode=mode)
    assert type(told.value).__module__.startswith("filippov.")
