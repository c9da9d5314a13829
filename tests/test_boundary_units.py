"""Boundary equilibria in any units of states, time and parameter: the same words, coefficients in units."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from test_codim2 import first
from test_normal_forms import FOCI

from filippov import System, parameters, states
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.continuation import continuation

x, y, z = NAMES = states("x y z")
DRAWS = {"nightly": 200}.get(os.environ.get("FILIPPOV_PROFILE", ""), 12)


def _powers(rng: np.random.Generator, count: int) -> Any:
    return 10.0 ** rng.integers(-6, 7, count)


def _point(A: Any, M: Any, other: Any, units: Any, time: float, unit: float) -> BranchPoint:
    """Where x' = A x + M m meets x = 0, beyond which is the field `other`; x -> units x, m -> unit m."""
    names, p = NAMES[: len(M)], parameters(m=0.4 * unit)
    sizes = time * units[:, None] / np.append(units, unit)

    def field(matrix: Any) -> list[Any]:
        rows = (matrix * sizes).tolist()
        return [sum(a * q for a, q in zip(row, (*names, p.m), strict=True)) for row in rows]

    beyond = (other * time * units).tolist() if other.ndim == 1 else field(other)
    fields = {"+": field(np.column_stack([A, M])), "-": beyond}
    system = System.from_modes([x], fields, list(names), parameters=p)
    shift = -np.linalg.solve(A, M)
    value = 0.4 * np.sign(shift[0])
    run = continuation(
        system, value * shift * units, parameter="m", value=value * unit, bounds=(-0.5 * unit, 0.5 * unit),
        mode="+", direction=-int(np.sign(value)),
    )  # fmt: skip
    return first(run, "boundary equilibrium")


@pytest.mark.parametrize("seed", range(DRAWS))
def test_boundary_equilibria_in_any_units(seed: int) -> None:
    rng, n = np.random.default_rng([2026, seed]), 2 + seed % 2
    inverse = across = shift = 0.0
    while min(abs(inverse), abs(across), abs(shift)) < 0.05:
        A, B, M = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
        inverse, across, shift = np.linalg.solve(A, B)[0], B[0], -np.linalg.solve(A, M)[0]
    units, (time, unit) = _powers(rng, n), _powers(rng, 2)
    point = _point(A, M, B, units, time, unit)
    found = point.coefficients
    assert point.predicts.startswith("persistence" if inverse < 0 else "non-smooth fold")
    if n == 2:
        det, apart = np.linalg.det(A), np.trace(A) ** 2 - 4 * np.linalg.det(A)
        word = "saddle" if det < 0 else "focus" if apart < 0 else "node"
        assert point.predicts.endswith(f"; a boundary {word}")
        assert ("pseudo-saddle" in point.predicts) == (det * inverse > 0)
    np.testing.assert_allclose(
        [found["C A^-1 B"], found["C B"], found["dH/dvalue"]],
        [inverse * units[0], across * units[0] * time, shift * units[0] / unit], rtol=1e-7,
    )  # fmt: skip
    # (1 - B C/(C B)) A on C x = 0, the surface x = 0.
    want = sorted(np.linalg.eigvals((A - np.outer(B, A[0]) / B[0])[1:, 1:]).real)
    told = [found[f"sliding eigenvalue {k + 1}"] / time for k in range(n - 1)]
    np.testing.assert_allclose(told, want, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_equilibria_on_kinks_in_any_units(seed: int) -> None:
    """Beyond x = 0 the field has c x more: what meets by the determinants; H = x, and -x beyond."""
    rng, n = np.random.default_rng([2027, seed]), 2 + seed % 2
    dets = shift = 0.0
    while min(np.min(np.abs(dets)), abs(shift)) < 0.05:
        A, c, M = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
        beyond = A + np.outer(c, np.eye(n)[0])
        dets, shift = np.array([np.linalg.det(A), np.linalg.det(beyond)]), -np.linalg.solve(A, M)[0]
    units, (time, unit) = _powers(rng, n), _powers(rng, 2)
    point = _point(A, M, np.column_stack([beyond, M]), units, time, unit)
    found = point.coefficients
    assert point.predicts.startswith("persistence" if np.prod(dets) > 0 else "non-smooth fold")
    np.testing.assert_allclose([found["det A"], found["det A beyond"]], dets * time**n, rtol=1e-7)
    np.testing.assert_allclose(
        [found["dH/dvalue"], found["dH/dvalue beyond"]],
        np.array([shift, np.linalg.solve(beyond, M)[0]]) * units[0] / unit, rtol=1e-7,
    )  # fmt: skip


@pytest.mark.parametrize(("growth", "other"), FOCI)
def test_sliding_cycles_around_foci_in_any_units(growth: float, other: tuple[float, float]) -> None:
    A, M = np.array([[growth, -1.0], [1.0, growth]]), np.array([-growth, -1.0])
    one = _point(A, M, np.array(other), np.ones(2), 1.0, 1.0)
    rng = np.random.default_rng([2028, *np.abs([10 * growth, other[1]]).astype(int)])
    for _ in range(max(1, DRAWS // 20)):
        units, (time, unit) = _powers(rng, 2), _powers(rng, 2)
        point = _point(A, M, np.array(other), units, time, unit)
        assert ("sliding cycle" in point.predicts) == ("sliding cycle" in one.predicts)
        # Along the surface y is measured, in units of H = x.
        want = np.array([one.coefficients[k] for k in ("return", "pseudo-saddle") if k in one.coefficients])
        told = [point.coefficients[k] for k in ("return", "pseudo-saddle") if k in point.coefficients]
        np.testing.assert_allclose(told, want * units[1] / units[0], rtol=1e-6)
