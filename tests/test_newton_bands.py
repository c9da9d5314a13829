"""Radau's matrices of large sparse systems are bands: their factors, their order, and the solutions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg
from numpy.random import Generator, default_rng

from filippov import EventKind, Surface, System, cos, sign, solve, states, t
from filippov.kernel.codegen.newton_band import newton_band
from filippov.kernel.methods import band_lu
from filippov.kernel.tables import codes, layout, radau_tables, root_tables
from filippov.solving.state.machine import unit_of


def band_of(system: System) -> int:
    """Half the width of the band in which the system's matrices are, 0 where they are dense."""
    form = system.symbolic
    assert form is not None
    band = newton_band(form, unit_of(system).constants)["BAND"]
    assert isinstance(band, int)
    return band


def graph(kind: str, n: int, rng: Generator) -> list[tuple[int, int]]:
    """Pairs of neighbours, in an order of states that hides the band."""
    hidden = rng.permutation(n)
    pairs = [(k, k + 1) for k in range(n - 1)]
    if kind == "ring":
        pairs += [(n - 1, 0)]
    elif kind == "grid":
        side = 4
        pairs = [(k, k + side) for k in range(n - side)]
        pairs += [(k, k + 1) for k in range(n - 1) if k % side != side - 1]
    elif kind == "star":
        pairs = [(0, k) for k in range(1, n)]
    return [(int(hidden[i]), int(hidden[j])) for i, j in pairs]


def network(kind: str, n: int, rng: Generator, relays: int, stiff: float) -> tuple[Any, System, np.ndarray]:
    """States that diffuse along a graph, some held by relays at levels, one pulled by a kink."""
    x = states(" ".join(f"u{k}" for k in range(n)))
    matrix = np.diag(-rng.uniform(0.1, 1.0, n))
    for i, j in graph(kind, n, rng):
        matrix[i, j], matrix[j, i] = rng.uniform(0.5, 1.5, 2) * stiff
    matrix -= np.diag(np.sum(matrix, axis=1) - np.diag(matrix))
    field = {x[i]: sum(matrix[i, j] * x[j] for j in np.flatnonzero(matrix[i])) for i in range(n)}
    for i in rng.choice(n, relays, replace=False):
        field[x[i]] += 0.4 * cos(3 * t) - 2.0 * stiff * sign(x[i] - 0.2)
    other = rng.choice(n)
    field[x[other]] -= 0.5 * abs(x[other] - 0.3)
    return x, System(field), matrix


@pytest.mark.parametrize("seed", range(20))
def test_14_5_factors_of_bands_solve_as_those_of_full_matrices_do(seed: int) -> None:
    rng = default_rng(seed)
    n, band = int(rng.integers(2, 30)), int(rng.integers(1, 5))
    inside = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) <= band
    full = rng.normal(size=(n, n)) * inside + 1j * rng.normal(size=(n, n)) * inside
    if seed % 2:
        full -= np.diag(np.diag(full))  # every pivot comes from below
        full += 1e-12 * np.eye(n)
    packed = np.zeros((n, 3 * band + 1), dtype=complex)
    for i, j in np.argwhere(inside):
        packed[i, j - i + band] = full[i, j]
    one, other = packed.real.ravel().copy(), packed.imag.ravel().copy()
    alone, pivots, twins = one.copy(), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    b, c = rng.normal(size=(2, n))
    x, y, z = b.copy(), b.copy(), c.copy()
    assert band_lu.factor_band(alone, pivots, n, band)
    band_lu.substitute_band(alone, pivots, x, n, band)
    assert band_lu.factor_band_complex(one, other, twins, n, band)
    band_lu.substitute_band_complex(one, other, twins, y, z, n, band)
    for found, matrix, right in ((x, full.real, b), (y + 1j * z, full, b + 1j * c)):
        left = np.max(np.abs(matrix @ found - right))
        assert left <= 1e-12 * np.max(np.abs(matrix)) * np.max(np.abs(found))


def test_14_5_a_singular_band_has_no_factors() -> None:
    pivots = np.zeros(3, dtype=np.int64)
    assert not band_lu.factor_band(np.zeros(12), pivots, 3, 1)
    assert not band_lu.factor_band_complex(np.zeros(12), np.zeros(12), pivots, 3, 1)


@pytest.mark.parametrize("kind", ["line", "ring", "grid", "star"])
def test_14_5_the_order_of_states_does_not_matter_to_a_band(kind: str) -> None:
    """A line has a band of 1, a ring of 2, a grid of its side or little more; a star is dense."""
    bands = {"line": (1, 1), "ring": (2, 2), "grid": (4, 8), "star": (0, 0)}
    for seed in range(5):
        _, system, _ = network(kind, 60, default_rng(seed), 0, 1.0)
        least, most = bands[kind]
        assert least <= band_of(system) <= most


def test_14_5_plain_functions_few_states_and_a_multiplier_that_all_move_are_dense() -> None:
    x = states(" ".join(f"u{k}" for k in range(40)))
    assert band_of(System({q: -q for q in x[:5]})) == 0
    assert band_of(System({q: -q for q in x})) == 1
    assert band_of(System({q: -q - (sign(sum(x)) if q == x[0] else 0) for q in x})) == 0
    watched = System({q: -q for q in x}, surfaces=[Surface("total", sum(x) - 1, kind="observer")])
    assert band_of(watched) == 1
    run = solve(watched, np.ones(40), (0, 5), method="Radau", rtol=1e-8)
    assert [e.t for e in run.events] == pytest.approx([np.log(40)], rel=1e-8)


@pytest.mark.parametrize("kind", ["line", "ring", "grid"])
def test_14_5_a_linear_network_moves_as_its_matrix_says(kind: str) -> None:
    for seed in range(3):
        x, _, matrix = network(kind, 48, default_rng(seed), 0, 40.0)
        rows = [sum(matrix[i, j] * x[j] for j in np.flatnonzero(matrix[i])) for i in range(48)]
        system = System(dict(zip(x, rows, strict=True)))
        start = default_rng(seed).uniform(-1, 1, 48)
        run = solve(system, start, (0, 2), method="Radau", rtol=1e-9, atol=1e-12)
        assert band_of(system) > 0
        np.testing.assert_allclose(run.x_end, scipy.linalg.expm(2 * matrix) @ start, rtol=0, atol=1e-8)
        # One difference for the states of a colour, or two where they are repeated, in place of one each.
        assert run.njev <= run.steps + run.rejected


@pytest.mark.parametrize("kind", ["line", "ring", "grid"])
@pytest.mark.parametrize("seed", range(4))
def test_14_5_relays_in_a_stiff_network_slide_as_with_an_explicit_method(kind: str, seed: int) -> None:
    """Slides, exits and crossings of several relays whose multipliers feel their neighbours."""
    _, system, _ = network(kind, 36, default_rng(seed), 4, 10.0)
    start = default_rng(seed).uniform(-0.5, 1.0, 36)
    runs = [
        solve(system, start, (0, 3), method=method, rtol=1e-10, atol=1e-12) for method in ("Radau", "DOP853")
    ]
    assert band_of(system) > 0
    assert all(run.success for run in runs)
    kinds = [[(e.index, e.kind) for e in run.events] for run in runs]
    assert kinds[0] == kinds[1]
    assert any(kind is EventKind.ENTRY for _, kind in kinds[0])
    np.testing.assert_allclose([e.t for e in runs[0].events], [e.t for e in runs[1].events], atol=1e-8)
    np.testing.assert_allclose(runs[0].x_end, runs[1].x_end, atol=1e-8)
    np.testing.assert_array_equal(runs[0].end_mode, runs[1].end_mode)


def test_13_3_no_two_tables_have_a_constant_of_one_name() -> None:
    """The kernels take the constants of all tables from one place."""
    seen: dict[str, str] = {}
    for module in (codes, root_tables, radau_tables, layout):
        for name, value in vars(module).items():
            if name.isupper() and not name.startswith("_") and isinstance(value, int | float | list):
                assert seen.setdefault(name, module.__name__) == module.__name__, name
