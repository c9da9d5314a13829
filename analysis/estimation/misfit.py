"""Whether a fitted friction law can be the one of the record: what its residuals must not depend on.

Each test adds unknowns to the linear least squares about the fit and asks for them by an F test: parameters
that were held fixed, a force that depends on speed, direction or position in a way that the law does not
have, a displacement at rest that follows the force (elastic presliding), correlation that the noise does
not have.
Sources: Godfrey 1988 (added-variable tests); Ljung & Box 1978; Newey & West 1987.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2
from scipy.stats import f as fisher

from filippov.analysis.estimation.identify_fit import Fit
from filippov.analysis.estimation.residual_noise import (
    Noise,
    Window,
    degrees_of_freedom,
    generalised,
    triangle,
    whitened,
)
from filippov.base.arrays import Array

# Chance that one of the tests refuses the true law, and that one of them widens its intervals.
REFUSED, DOUBTED = 1e-4, 0.05
LAGS, BUMPS = 20, 3
# Largest residuals in parts of the trajectory.
EXPLAINED = 0.5


@dataclass(frozen=True)
class Test:
    """One test: what the residuals were asked for, its chance p under the law, the added columns."""

    name: str
    p: float
    columns: tuple[Array, ...]


def misfit_tests(fit: Fit, fixed: Sequence[str], force: Sequence[Array]) -> list[Test]:
    """All tests; fixed: names behind the free ones in the slopes; force: at each window's samples."""
    linear, noise = fit.linear, fit.noise
    tests = []
    free = len(linear.slopes[0].names) - len(fixed)
    for k, name in enumerate(fixed):
        tests.append(
            _added(f"{name} (held fixed)", [s.parameters[:, [free + k]] for s in linear.slopes], fit)
        )
    speeds = np.concatenate([np.abs(m.v[m.v != 0]) for m in linear.trajectories])
    if speeds.size > 10 * BUMPS:
        top = np.quantile(speeds, np.linspace(0.1, 0.95, BUMPS))
        shapes = [[], [], []]  # type: list[list[Array]]
        for m, s in zip(linear.trajectories, linear.slopes, strict=True):
            v, x = m.states[:-1, 1], m.states[:-1, 0]
            by_start = s.force[:, :, 0]
            width = np.diff(np.concatenate(([0.0], top)))
            bumps = np.sign(v)[:, None] * np.exp(-(((np.abs(v)[:, None] - top) / width) ** 2))
            shapes[0].append(by_start @ bumps)
            shapes[1].append(by_start.sum(axis=1)[:, None])
            shapes[2].append(by_start @ (x[:, None] - np.mean(x)))
        for name, columns in zip(("speed", "direction", "position"), shapes, strict=True):
            tests.append(_added(f"the force as a function of {name}", columns, fit))
    rest = [(q * (m.v == 0))[:, None] for q, m in zip(force, linear.trajectories, strict=True)]
    if sum(int(np.count_nonzero(q)) for q in rest) >= LAGS:
        tests.append(_added("the force at rest (an elastic displacement)", rest, fit))
    tests.append(Test("earlier residuals", _whiteness(linear.windows, noise), ()))
    return tests


def refusal(fit: Fit, tests: Sequence[Test], measured: Array) -> str:
    """The sentence that refuses the law, "" where no test does; measured: the positions of the record."""
    left = np.std(measured - np.concatenate([m.x for m in fit.linear.trajectories]))
    if left > EXPLAINED * np.std(measured):
        return (
            f"refused: the residuals are {100 * left / np.std(measured):.0f} % of the solution, so the fit "
            "explains nothing. Start nearer to the values, or take another law."
        )
    worst = min(tests, key=lambda q: q.p)
    if worst.p * len(tests) >= REFUSED:
        return ""
    return (
        f"refused: the residuals depend on {worst.name}, p = {max(worst.p, 1e-300):.1g}, so the model is "
        "not that of the record and intervals would mean nothing. Free what was held fixed, "
        "take another law, or give the force as it was applied (hold)."
    )


def widened(fit: Fit, tests: Sequence[Test], count: int) -> list[tuple[Array, Array, Array]]:
    """Shifts, errors and degrees of freedom of the free parameters under each doubted test's wider model."""
    out = []
    for test in tests:
        if test.p * len(tests) >= DOUBTED:
            continue
        if test.columns:
            windows = _with(fit.linear.windows, test.columns)
            got = generalised(windows, fit.noise.sigma, fit.noise.rho, fit.noise.kappa)
            errors = np.sqrt(np.diag(got.covariance)[:count])
            out.append((got.step[:count], errors, degrees_of_freedom(windows, fit.noise, range(count))))
        else:
            out.append(
                (np.zeros(count), _sandwich(fit.linear.windows, fit.noise)[:count], np.full(count, np.inf))
            )
    return out


def _with(windows: Sequence[Window], columns: Sequence[Array]) -> list[Window]:
    return [
        replace(w, jacobian=np.column_stack((w.jacobian, c))) for w, c in zip(windows, columns, strict=True)
    ]


def _added(name: str, columns: Sequence[Array], fit: Fit) -> Test:
    """F test of added columns; p = 1 for such as the model has already."""
    noise = fit.noise
    size = np.linalg.norm(np.vstack(list(columns)), axis=0)
    if not np.all(size > 0):
        return Test(name, 1.0, ())
    columns = tuple(c / size for c in columns)
    windows = _with(fit.linear.windows, columns)
    got = generalised(windows, noise.sigma, noise.rho, noise.kappa)
    k = len(size)
    own = np.abs(np.diag(got.root))[-k:]
    if np.any(own < 1e-7 * np.linalg.norm(got.root[:, -k:], axis=0)):
        return Test(name, 1.0, ())
    # The last rows of R hold the added unknowns alone: their squares are the test's.
    statistic = float(np.sum((got.root[-k:, -k:] @ got.step[-k:]) ** 2)) / k
    q = windows[0].jacobian.shape[1]
    degrees = float(np.min(degrees_of_freedom(windows, noise, range(q - k, q))))
    return Test(name, float(fisher.sf(statistic, k, degrees)), tuple(columns))


def _white(windows: Sequence[Window], noise: Noise) -> tuple[list[Array], list[Array]]:
    """Whitened residuals after the fit, and whitened Jacobians, of each window."""
    step = generalised(windows, noise.sigma, noise.rho, noise.kappa).step
    residuals, jacobians = [], []
    for w in windows:
        rows = np.column_stack((w.load, w.residual - w.jacobian @ step, w.jacobian))
        rows = whitened(rows, noise.rho) / noise.sigma
        load, rest = rows[:, : w.load.shape[1]], rows[:, w.load.shape[1] :]
        # The root of 1 + kappa F F' without that sum: beside a large F its 1 is below rounding.
        root = triangle(np.vstack((np.sqrt(noise.kappa) * load.T, np.eye(len(load))))).T
        own = solve_triangular(root * np.sign(np.diag(root)), rest, lower=True)
        residuals.append(own[:, 0])
        jacobians.append(own[:, 1:])
    return residuals, jacobians


def _whiteness(windows: Sequence[Window], noise: Noise) -> float:
    """p of Ljung and Box's Q over the first lags of all windows; one degree is rho's."""
    rows, _ = _white(windows, noise)
    n = sum(len(e) for e in rows)
    lags = min(LAGS, n // 5)
    squares = sum(float(e @ e) for e in rows)
    r = np.array(
        [sum(float(e[j:] @ e[:-j]) for e in rows if len(e) > j) / squares for j in range(1, lags + 1)]
    )
    return float(chi2.sf(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))), lags - 1))


def _sandwich(windows: Sequence[Window], noise: Noise) -> Array:
    """Errors from correlations up to LAGS samples by Bartlett's weights, none below the model's own."""
    rows, jacobians = _white(windows, noise)
    q = jacobians[0].shape[1]
    middle = np.zeros((q, q))
    for e, j in zip(rows, jacobians, strict=True):
        score = j * e[:, None]
        middle += score.T @ score
        for lag in range(1, min(LAGS, len(e) - 1) + 1):
            part = (1 - lag / (LAGS + 1)) * score[lag:].T @ score[:-lag]
            middle += part + part.T
    outer = generalised(windows, noise.sigma, noise.rho, noise.kappa).covariance
    return np.sqrt(np.maximum(np.diag(outer @ middle @ outer), np.diag(outer)))
