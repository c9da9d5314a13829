"""Random piecewise-linear systems with small whole coefficients: a motion must be one of the inclusion.

Corners are degenerate in many of them. Whatever a run calls a success is held against the inclusion itself:
on the surfaces it slides on, multipliers in their sets, x' = A x + b + sum_i s_i B_i, nothing that repels.
"""

import os

import numpy as np
import pytest
from linear_oracle import Linear
from linear_systems import family, values

from filippov import Solution, Status, solve

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
DRAWS = {"default": 100, "ci": 300, "nightly": 30_000}[PROFILE]
SIZES = [(2, 2)] if PROFILE != "nightly" else [(2, 1), (3, 1), (2, 2), (3, 2), (4, 3)]
FINE = (Status.SUCCESS, Status.NON_UNIQUE, Status.ZENO)


def drawn(n: int, m: int, seed: int) -> tuple[Linear, np.ndarray]:
    rng = np.random.default_rng(seed)
    A = rng.integers(-1, 2, (n, n)).astype(float)
    c = np.zeros((m, n))
    while np.linalg.matrix_rank(c) < m:
        c = rng.integers(-1, 2, (m, n)).astype(float)
    B = rng.integers(-2, 3, (m, n)).astype(float)
    b, d = rng.integers(-1, 2, n).astype(float), rng.integers(-1, 2, m).astype(float)
    return Linear(A, b, B, c, d), rng.integers(-2, 3, n) / 2


def faults(a: Linear, run: Solution) -> list[str]:
    """What is wrong with a motion, as judged by the inclusion."""
    found: list[str] = []
    assert run.sol is not None
    for piece in run.segments:
        if piece.dwell < 1e-7:
            continue
        on = [i for i, value in enumerate(piece.mode) if value == 0]
        if len(on) == 1 and a.c[on[0]] @ a.B[on[0]] > 1e-12:
            found.append(f"repelling slide {piece}")
        for part in (0.2, 0.5, 0.8):
            time = piece.t0 + part * (piece.t1 - piece.t0)
            x = run.sol(time)
            h, size = a.c @ x - a.d, 1 + float(np.max(np.abs(x)))
            s = np.array([float(run.multiplier(f"h{i}", time)) for i in range(len(a.d))])
            signs = np.array(piece.mode)
            off = np.where(signs == 0, np.abs(h), -signs * h)
            if np.max(off) > 1e-9 * size:
                found.append(f"off its surface {piece}: {h}")
            if np.max(np.abs(s)) > 1 + 1e-6:
                found.append(f"multiplier {piece}: {s}")
            miss = run.sol.rate(time) - (a.A @ x + a.b + a.B.T @ s)
            if np.max(np.abs(miss)) > 1e-5 * size:
                found.append(f"defect {piece}: {miss}")
    return found


def examine(n: int, m: int, seed: int) -> list[str]:
    """Faults of one run; an end that is none of those foreseen is one."""
    a, x0 = drawn(n, m, seed)
    system = family(n, m, tuple(range(m)))
    run = solve(system, x0, (0, 3), parameters=values(a), rtol=1e-9, atol=1e-11, max_events=300, max_time=20)
    found = faults(a, run)
    if run.status not in FINE:
        found.append(f"{run.status.value}: {run.message}")
    return found


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("n", "m"), SIZES)
def test_F4_a_success_is_a_motion_of_the_inclusion(n: int, m: int) -> None:
    wrong = {seed: found for seed in range(DRAWS) if (found := examine(n, m, seed))}
    assert not wrong, wrong
