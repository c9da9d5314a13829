"""The box-constrained complementarity problem: all solutions, none, families; Lemke's method against them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import UsageError
from filippov.solving.selection.complementarity import Box, complementarity, enumerate_solutions, lemke

OPEN = np.inf


def standard(A: list[list[float]], q: list[float]) -> tuple[np.ndarray, ...]:
    k = len(q)
    return np.array(A), np.array(q), np.zeros(k), np.full(k, OPEN)


def boxes(sizes: st.SearchStrategy[int]) -> st.SearchStrategy[Box]:
    def of(pair: tuple[int, int]) -> Box:
        k, seed = pair
        rng = np.random.default_rng(seed)
        lower, upper = -rng.uniform(0.5, 2, k), rng.uniform(0.5, 2, k)
        return Box(rng.normal(size=(k, k)), rng.normal(size=k), lower, upper)

    return st.tuples(sizes, st.integers(0, 2**31)).map(of)


def certified(box: Box, z: np.ndarray) -> None:
    """w >= 0 at the lower bound, <= 0 at the upper, 0 between, without the module's own measure."""
    w, small = box.A @ z + box.q, 1e-8 * (1 + np.abs(box.A).sum() + np.abs(box.q).sum())
    assert np.all(z >= box.lower - small)
    assert np.all(z <= box.upper + small)
    assert np.all((w <= small) | (z <= box.lower + small))
    assert np.all((w >= -small) | (z >= box.upper - small))


def test_c11_minus_identity_has_four_solutions() -> None:
    found = complementarity(*standard([[-1, 0], [0, -1]], [1, 1]))
    assert sorted(tuple(z) for z in found.solutions) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert found.complete
    assert found.unique is False


def test_c11_no_solution() -> None:
    found = complementarity(*standard([[0, 0], [0, 0]], [-1, -1]))
    assert found.solutions == ()
    assert found.complete


def test_c11_continuum_has_a_certificate() -> None:
    A, q, lower, upper = standard([[1, 1], [1, 1]], [-1, -1])
    found = complementarity(A, q, lower, upper)
    assert found.unique is False
    assert found.family is not None
    for share in np.linspace(0, 1, 5):
        certified(Box(A, q, lower, upper), found.solutions[0] + share * found.family)


@given(boxes(st.integers(1, 5)))
def test_lemke_finds_one_of_the_enumerated(box: Box) -> None:
    z = lemke(box, np.ones(len(box.q)))
    assert z is not None
    certified(box, z)
    every = enumerate_solutions(box)
    assert min(np.max(np.abs(z - other)) for other in every.solutions) < 1e-7
    # The map of a box to itself has fixed points of index sum 1: an odd number of them, generically.
    assert len(every.solutions) % 2 == 1


@given(st.integers(7, 40), st.integers(0, 2**31))
def test_positive_definite_is_unique(k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    half, skew = rng.normal(size=(k, k)), rng.normal(size=(k, k))
    A = half @ half.T / k + 0.1 * np.eye(k) + skew - skew.T
    box = Box(A, 3 * rng.normal(size=k), -np.ones(k), np.ones(k))
    found = complementarity(box.A, box.q, box.lower, box.upper)
    assert found.unique is True
    certified(box, found.solutions[0])


def test_a_large_degenerate_one() -> None:
    k = 40
    box = Box(np.eye(k), -np.ones(k), -np.ones(k), np.ones(k))
    found = complementarity(box.A, box.q, box.lower, box.upper)
    assert np.allclose(found.solutions[0], 1.0, atol=1e-12)


def test_parts_that_do_not_fit_are_refused() -> None:
    with pytest.raises(UsageError, match="shapes"):
        complementarity(np.eye(2), np.ones(3), np.zeros(3), np.ones(3))
    with pytest.raises(UsageError, match="above"):
        complementarity(np.eye(1), np.ones(1), np.ones(1), np.zeros(1))
