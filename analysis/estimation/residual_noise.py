"""Covariance of the residuals of a record, by restricted maximum likelihood, and least squares under it.

    V = sigma^2 R(rho) + kappa F F',   R(i, j) = rho^|i - j|

sigma and rho are those of the noise on the position, an autoregression of order 1 from sample to sample; F is
what the position owes to the unknown part of the force, a factor z ~ N(0, 1) each column. kappa is 1 where
the force's covariance is known, and estimated where it is known up to a factor. z is an unknown of its own
in the triangular factorisation, so that no large matrix is needed.
Sources: Harville 1977 (restricted likelihood); Giesbrecht & Burns 1985 (degrees of freedom).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from filippov.analysis.algebra import linalg
from filippov.base.arrays import Array

# Largest correlation from sample to sample that is distinguished from a drift.
LARGEST = 0.998
# Singular value, of columns of length 1, that differences of the model leave of 0.
UNSEEN = 1e-7


@dataclass(frozen=True)
class Window:
    """Residuals of a window, (k,), their derivatives by all that is estimated, (k, q), and F, (k, r)."""

    residual: Array
    jacobian: Array
    load: Array


@dataclass(frozen=True)
class Noise:
    """sigma [m], rho, kappa; log: the restricted log likelihood; hidden: the coordinates of the search."""

    sigma: float
    rho: float
    kappa: float
    log: float
    hidden: Array

    def moved(self, hidden: Array) -> tuple[float, float, float]:
        """sigma, rho, kappa at other coordinates."""
        change = hidden - self.hidden
        kappa = self.kappa * float(np.exp(change[2])) if len(change) > 2 else self.kappa
        return self.sigma * float(np.exp(change[0])), LARGEST * float(np.tanh(hidden[1])), kappa


@dataclass(frozen=True)
class Solved:
    """Generalised least squares: step of the unknowns, root: R of the whitened Jacobian.

    z      conditional means of each window's factors; squares: of the remainder; log: log |V|
    """

    step: Array
    root: Array
    z: tuple[Array, ...]
    squares: float
    log: float

    @property
    def covariance(self) -> Array:
        """Of the unknowns, (q, q)."""
        size = np.linalg.norm(self.root, axis=0)
        size[size == 0] = 1.0
        inverse = linalg.pinv(self.root / size, rcond=1e-13)
        return np.asarray((inverse @ inverse.T) / np.outer(size, size))


def whitened(rows: Array, rho: float) -> Array:
    """R^(-1/2) rows: innovations of the autoregression, the first with the variance of all."""
    out = np.array(rows, dtype=float)
    if rho:
        out[1:] = (rows[1:] - rho * rows[:-1]) / np.sqrt(1 - rho**2)
    return out


def generalised(windows: Sequence[Window], sigma: float, rho: float, kappa: float) -> Solved:
    """Least squares of all windows under V."""
    rows, ends, log = [], [], 0.0
    for w in windows:
        k, r = w.load.shape
        own = whitened(np.column_stack((np.sqrt(kappa) * w.load, w.jacobian, w.residual)), rho) / sigma
        prior = np.eye(r, own.shape[1])
        whole = triangle(np.vstack((own, prior)))
        log += 2 * (k * np.log(sigma) + float(np.sum(np.log(np.abs(np.diag(whole)[:r])))))
        log += (k - 1) * float(np.log1p(-(rho**2)))
        rows.append(whole[r:, r:])
        ends.append(whole[:r])
    whole = triangle(np.vstack(rows))
    q = windows[0].jacobian.shape[1]
    root, right = whole[:q, :q], whole[:q, q]
    size = np.linalg.norm(root, axis=0)
    size[size == 0] = 1.0
    step = linalg.lstsq(root / size, right, rcond=1e-13)[0] / size
    z = []
    for end in ends:
        r = len(end)
        z.append(linalg.solve(end[:, :r], end[:, -1] - end[:, r:-1] @ step) if r else np.zeros(0))
    return Solved(step, root, tuple(z), float(np.sum(whole[q:, q] ** 2)), log)


def bounded(solved: Solved, low: Array, high: Array, damping: Array) -> Array:
    """The step of least squares between bounds: what would pass its bound is held there, the rest follows.

    damping   of each unknown: the squares of damping * step are added to what is least
    """
    held = np.zeros(len(low), dtype=bool)
    root = np.vstack((solved.root, np.diag(damping)))
    right = np.append(solved.root @ solved.step, np.zeros(len(low)))
    step = np.zeros(len(low))
    for _ in range(len(low) + 1):
        free = root[:, ~held]
        size = np.linalg.norm(free, axis=0)
        size[size == 0] = 1.0
        step[~held] = linalg.lstsq(free / size, right - root[:, held] @ step[held], rcond=1e-13)[0] / size
        passed = ~held & ((step < low) | (step > high))
        if not np.any(passed):
            break
        held |= passed
        step = np.where(held, np.clip(step, low, high), step)
    return step


def squares(windows: Sequence[Window], residuals: Sequence[Array], noise: Noise) -> float:
    """r' V^-1 r of residuals of the windows."""
    total = 0.0
    for w, residual in zip(windows, residuals, strict=True):
        r = w.load.shape[1]
        load = np.sqrt(noise.kappa) * w.load
        own = whitened(np.column_stack((load, residual)), noise.rho) / noise.sigma
        total += float(np.sum(triangle(np.vstack((own, np.eye(r, r + 1))))[r:, r] ** 2))
    return total


def reduced(load: Array, small: float, part: float = 0.0) -> tuple[Array, Array]:
    """F with fewer columns, and those as combinations of the old.

    What is left out moves nothing by `small`, or by more than `part` of what the whole does.
    """
    u, s, axes = linalg.svd(load, full_matrices=False)
    kept = s > max(small, part * float(s[0])) if s.size else s > small
    return np.asarray(u[:, kept] * s[kept]), np.asarray(axes[kept].T)


def estimate_noise(
    windows: Sequence[Window], given: float | None, least: float, start: Array | None = None
) -> Noise:
    """Noise of the windows together; given: kappa, where it is known. start: hidden coordinates to begin at.

    least   smallest sigma: what the integration alone leaves
    """
    size = float(np.sqrt(np.mean(np.concatenate([_projected(w) for w in windows]) ** 2))) or 1e-300
    largest = max(float(np.max(np.sum(w.load**2, axis=1), initial=0.0)) for w in windows)
    load = 1.0 / largest if largest else 0.0

    def parts(hidden: Array) -> tuple[float, float, float]:
        kappa = given if given is not None else load * float(np.exp(2 * hidden[2])) if load else 0.0
        return max(float(np.exp(hidden[0])), least), LARGEST * float(np.tanh(hidden[1])), kappa

    def cost(hidden: Array) -> float:
        return likelihood(windows, *parts(hidden))

    number = 2 if given is not None or not load else 3
    level = np.log(max(size, least))
    first = [
        np.array([level + down, np.arctanh(rho), level - 4])[:number]
        for rho in (0.0, 0.8)
        for down in (-0.3, -2.0, -4.0)
    ]  # fmt: skip
    first += [start] if start is not None and len(start) == number else []
    begin = min(first, key=cost)
    simplex = np.vstack([begin, *(begin + (0.1 if begin is start else 0.4) * np.eye(number))])
    found = minimize(
        cost, begin, method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 3e-3, "fatol": 3e-3, "maxfev": 250},
    )  # fmt: skip
    sigma, rho, kappa = parts(np.asarray(found.x))
    return Noise(sigma, rho, kappa, -float(found.fun), np.asarray(found.x))


def likelihood(windows: Sequence[Window], sigma: float, rho: float, kappa: float) -> float:
    """Minus the restricted log likelihood, without its constant."""
    if not 1e-300 < sigma < 1e300:
        return 1e300
    got = generalised(windows, sigma, rho, kappa)
    size = np.maximum(np.abs(np.diag(got.root)), 1e-300)
    return 0.5 * (got.log + got.squares) + float(np.sum(np.log(size)))


def degrees_of_freedom(windows: Sequence[Window], noise: Noise, places: Sequence[int]) -> Array:
    """2 V^2/(g' W g) of the variances V at `places`.

    g   their derivatives by the noise's parameters, W the covariance of those
    """
    number = len(noise.hidden)
    unit = np.eye(number)

    def cost(hidden: Array) -> float:
        return likelihood(windows, *noise.moved(hidden))

    def variances(hidden: Array) -> Array:
        return np.diag(generalised(windows, *noise.moved(hidden)).covariance)[list(places)]

    at, h = noise.hidden, 0.02
    here = variances(at)
    g = np.array([(variances(at + h * e) - variances(at - h * e)) / (2 * h) for e in unit])
    values, axes = linalg.eigh(_second(cost, at, 0.05))
    # A direction in which the likelihood is flat is one in which the variances do not change.
    inverse = (axes / np.maximum(values, 0.05)) @ axes.T
    spread = np.einsum("qj,qr,rj->j", g, inverse, g)
    total = sum(len(w.residual) for w in windows) - windows[0].jacobian.shape[1]
    return np.asarray(np.clip(2 * here**2 / np.maximum(spread, 1e-300), 2.0, total))


def undetermined(rows: Array) -> npt.NDArray[np.bool_]:
    """Which unknowns take part in a combination that the rows, (k, q) with k >= q, do not depend on."""
    size = np.linalg.norm(rows, axis=0)
    _, s, axes = linalg.svd(rows / np.where(size > 0, size, 1.0), full_matrices=False)
    return np.asarray(np.any(np.abs(axes[s <= UNSEEN * s[0]]) > 1e-5, axis=0))


def triangle(rows: Array) -> Array:
    """R of rows = Q R."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _projected(w: Window) -> Array:
    """The residuals without what the Jacobian explains, by ordinary least squares."""
    q = np.linalg.qr(w.jacobian)[0]
    return np.asarray(w.residual - q @ (q.T @ w.residual))


def _second(cost: Callable[[Array], float], at: Array, h: float) -> Array:
    n = len(at)
    out = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            e, f = h * np.eye(n)[i], h * np.eye(n)[j]
            near = cost(at + e + f) - cost(at + e - f) - cost(at - e + f) + cost(at - e - f)
            out[i, j] = out[j, i] = near / (4 * h * h)
    return out
