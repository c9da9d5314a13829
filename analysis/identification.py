"""Parameters of a friction law from measured data, by least squares on the exact, event-driven model.

The record is cut into windows. In each the model runs from its own initial state, which is estimated with the
parameters, under the measured force (linear between samples, or held), stick and slip included, and the
misfit of the position is minimised:

    min over p and (x_w, v_w):  sum_k (x(t_k; p, x_w, v_w) - x_k)^2

Standard errors are those of nonlinear regression: s^2 (J^T J)^-1, s^2 the sum over the degrees of freedom.
Sources: Bock 1983 (multiple shooting); Seber & Wild 2003, section 2.1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.stats import t as student

from filippov.analysis.record import Record
from filippov.ensemble import solve_many
from filippov.errors import UsageError
from filippov.names import unknown
from filippov.system import System

Array = npt.NDArray[np.float64]
STEP = 1e-6
INPUT = ("force", "change", "bend", "twist", "interval")
HOLDS = ("cubic", "first", "zero")


@dataclass(frozen=True)
class Identified:
    """Estimated parameters.

    values       estimate by name; errors: standard errors; intervals: at `level`, by Student's t
    covariance   of the free parameters in order, shape (p, p)
    t, measured, fitted, residual   the record and the fit (for a curve: v, force, fit, misfit)
    sigma        standard deviation of the residuals
    degrees      degrees of freedom
    success, message   whether the minimisation converged, and what it says
    """

    values: dict[str, float]
    errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    covariance: Array
    level: float
    t: Array
    measured: Array
    fitted: Array
    sigma: float
    degrees: int
    success: bool
    message: str

    @property
    def residual(self) -> Array:
        """measured - fitted."""
        return self.measured - self.fitted

    def to_dict(self) -> dict[str, Any]:
        """The estimate as plain data."""
        return {
            "values": self.values, "errors": self.errors,
            "intervals": {name: list(pair) for name, pair in self.intervals.items()},
            "covariance": self.covariance.tolist(), "level": self.level, "sigma": self.sigma,
            "degrees": self.degrees, "success": self.success, "message": self.message,
        }  # fmt: skip

    def __str__(self) -> str:
        rows = [
            f"{name} = {value:.6g} +- {self.errors[name]:.2g}  "
            f"[{self.intervals[name][0]:.6g}, {self.intervals[name][1]:.6g}] at {100 * self.level:g} %"
            for name, value in self.values.items()
            if name in self.errors
        ]
        rows.append(f"residual standard deviation {self.sigma:.3g}, {self.degrees} degrees of freedom")
        if not self.success:
            rows.append(f"not converged: {self.message}")
        return "\n".join(rows)


def identify(
    record: Record,
    system: System,
    free: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    windows: int | None = None,
    hold: str = "cubic",
    level: float = 0.95,
    rtol: float = 1e-9,
    progress: Callable[[int, float], None] | None = None,
) -> Identified:
    """Estimate parameters of a driven mass from time, position and applied force.

    system    `filippov.models.driven.driven_mass(law)`: states x, v and the input's parameters
    free      names of the parameters that are estimated
    start     their initial guesses; default: the system's values; fixed: values of others
    windows   number of windows; default: about one in 200 samples
    hold      the force between samples: "cubic" through the four nearest, "first" linear, "zero" held from
              each sample to the next (what a digital controller does)
    progress  called with (number of evaluations, standard deviation of the misfit)

    Raises UsageError for unknown names and too few samples.
    """
    names = check_names(system, free, start, fixed, hold)
    count = len(record.t)
    number = max(1, round(count / 200)) if windows is None else windows
    if number < 1 or count < 4 * number or count - 2 * number <= len(names) + 1:
        raise UsageError(
            f"{count} samples for {number} windows and {len(names)} parameters are too few; give more data, "
            "or fewer windows."
        )
    model = _Windows(record, system, names, dict(fixed or {}), number, hold, rtol)
    guess = dict(zip(system.parameters.names, system.parameters.resolve(fixed), strict=True))
    guess |= dict(start or {})
    first = np.concatenate(([guess[name] for name in names], model.initial_states().ravel()))
    low, high = parameter_bounds(system, names)
    unbounded = np.full(first.size - len(names), np.inf)
    low, high = np.append(low, -unbounded), np.append(high, unbounded)
    cache: dict[bytes, tuple[Array, Array]] = {}
    evaluations = 0

    def evaluate(theta: Array) -> tuple[Array, Array]:
        nonlocal evaluations
        key = theta.tobytes()
        if key not in cache:
            cache.clear()
            cache[key] = model.residual_and_jacobian(theta)
            evaluations += 1
            if progress is not None:
                progress(evaluations, float(np.std(cache[key][0])))
        return cache[key]

    scale = np.maximum(np.abs(first), 1e-3)
    found = least_squares(
        lambda theta: evaluate(theta)[0], first, jac=lambda theta: evaluate(theta)[1],
        bounds=(low, high), x_scale=scale, xtol=1e-10, ftol=1e-10, gtol=1e-12,
    )  # fmt: skip
    residual, jacobian = evaluate(np.asarray(found.x))
    return estimate(
        names, found.x, residual, jacobian, level, record.t, record.x, record.x + residual[: count],
        bool(found.success), str(found.message),
    )  # fmt: skip


def parameter_bounds(system: System, names: Sequence[str]) -> tuple[Array, Array]:
    """Least and largest values that the parameters declare."""
    declared = [system.parameters[name] for name in names]
    low = np.array([-np.inf if q.lower is None else q.lower for q in declared])
    return low, np.array([np.inf if q.upper is None else q.upper for q in declared])


def estimate(
    names: Sequence[str], theta: Array, residual: Array, jacobian: Array, level: float, t: Array,
    measured: Array, fitted: Array, success: bool, message: str,
) -> Identified:  # fmt: skip
    """Values, errors and intervals of the first parameters from residuals and their Jacobian."""
    degrees = residual.size - theta.size
    variance = float(residual @ residual) / degrees
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0] = 1.0
    information = (jacobian / scale).T @ (jacobian / scale)
    inverse = np.linalg.pinv(information, rcond=1e-14, hermitian=True) / np.outer(scale, scale)
    p = len(names)
    covariance = variance * inverse[:p, :p]
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors[np.linalg.norm(jacobian[:, :p], axis=0) == 0] = np.inf
    width = float(student.ppf(0.5 + 0.5 * level, degrees)) * errors
    values = {name: float(v) for name, v in zip(names, theta, strict=False)}
    return Identified(
        values,
        dict(zip(names, errors.tolist(), strict=True)),
        {n: (values[n] - float(w), values[n] + float(w)) for n, w in zip(names, width, strict=True)},
        covariance, level, t, measured, fitted, float(np.sqrt(variance)), degrees, success, message,
    )  # fmt: skip


def check_names(
    system: System, free: Sequence[str], start: Mapping[str, float] | None,
    fixed: Mapping[str, float] | None, hold: str,
) -> tuple[str, ...]:  # fmt: skip
    """The free parameters' names, each once; UsageError for unknown ones and a system without an input."""
    known = [name for name in system.parameters.names if name not in INPUT]
    if not set(INPUT) <= set(system.parameters.names) or system.states[:2] != ("x", "v"):
        raise UsageError(
            "identify needs a mass with a force as input: states x, v and the parameters "
            f"{', '.join(INPUT)}. Make it with filippov.models.driven.driven_mass(law)."
        )
    names = tuple(dict.fromkeys(free))
    if not names:
        raise UsageError(f"free is empty; name what is estimated: {', '.join(known)}.")
    for name in (*names, *(start or {}), *(fixed or {})):
        if name not in known:
            raise UsageError(unknown("parameter", name, known))
    both = set(names) & set(fixed or {})
    if both:
        raise UsageError(f"{', '.join(sorted(both))} cannot be both free and fixed.")
    if hold not in HOLDS:
        raise UsageError(unknown("value of hold:", hold, HOLDS))
    return names


def force_terms(record: Record, hold: str) -> Array:
    """The applied force on each interval as a cubic in tau in [0, 1]: coefficients, shape (k - 1, 4)."""
    t, force = record.t, record.force
    terms = np.zeros((len(t) - 1, 4))
    terms[:, 0] = force[:-1]
    if hold == "first":
        terms[:, 1] = np.diff(force)
    if hold == "cubic":
        for k in range(len(t) - 1):
            first = min(max(k - 1, 0), len(t) - 4)
            part = slice(first, first + 4)
            tau = (t[part] - t[k]) / (t[k + 1] - t[k])
            terms[k] = np.linalg.solve(np.vander(tau, 4, increasing=True), force[part])
    return terms


class _Windows:
    """The model on all windows at once, with perturbed copies of each for the Jacobian."""

    def __init__(
        self, record: Record, system: System, names: tuple[str, ...], fixed: dict[str, float], number: int,
        hold: str, rtol: float,
    ) -> None:  # fmt: skip
        self.record, self.system, self.names, self.fixed = record, system, names, fixed
        self.rtol = rtol
        self.terms = force_terms(record, hold)
        # Window w holds the samples edge[w] ... edge[w + 1] - 1.
        self.edge = np.linspace(0, len(record.t), number + 1).round().astype(int)
        self.scale = float(np.max(np.abs(record.x - np.mean(record.x)))) or 1.0
        self.speed = float(np.max(np.abs(np.gradient(record.x, record.t)))) or 1.0

    def initial_states(self) -> Array:
        """Position and slope of a line through the first samples of each window, shape (w, 2)."""
        out = []
        for first, last in zip(self.edge[:-1], self.edge[1:], strict=True):
            part = slice(first, min(first + 6, last))
            t, x = self.record.t[part], self.record.x[part]
            slope, level = np.polyfit(t - t[0], x, 1)
            out.append((level, slope if self.record.v is None else self.record.v[first]))
        return np.array(out)

    def residual_and_jacobian(self, theta: Array) -> tuple[Array, Array]:
        """x(t_k) - x_k for all samples, and its derivatives by differences of the exact solution."""
        p, w = len(self.names), len(self.edge) - 1
        states = theta[p:].reshape(w, 2)
        steps = np.concatenate(
            (STEP * np.maximum(np.abs(theta[:p]), 1e-3), STEP * np.array([self.scale, self.speed]))
        )
        copies = p + 3
        rows = np.repeat(states, copies, axis=0)
        values = np.tile(theta[:p], (w * copies, 1))
        for k in range(p + 2):
            where = np.arange(w) * copies + k + 1
            if k < p:
                values[where, k] += steps[k]
            else:
                rows[where, k - p] += steps[k]
        x = self._run(rows, values, copies)
        residual = np.zeros(len(self.record.t))
        jacobian = np.zeros((len(self.record.t), theta.size))
        for q in range(w):
            part = slice(self.edge[q], self.edge[q + 1])
            mine = x[q * copies : (q + 1) * copies, : self.edge[q + 1] - self.edge[q]]
            residual[part] = mine[0] - self.record.x[part]
            slopes = (mine[1:] - mine[0]) / steps[:, None]
            jacobian[part, :p] = slopes[:p].T
            jacobian[part, p + 2 * q : p + 2 * q + 2] = slopes[p:].T
        return residual, jacobian

    def _run(self, rows: Array, values: Array, copies: int) -> Array:
        """Positions at the samples of each window, one row a copy; NaN never leaves here."""
        t = self.record.t
        lengths = np.diff(self.edge)
        x = np.full((len(rows), int(lengths.max())), 1e3 * self.scale)
        x[:, 0] = rows[:, 0]
        state = rows.copy()
        alive = np.ones(len(rows), dtype=bool)
        for j in range(int(lengths.max()) - 1):
            here = np.repeat(self.edge[:-1] + j, copies)
            active = np.nonzero(alive & np.repeat(lengths - 1 > j, copies))[0]
            k = here[active]
            inputs = dict(zip(INPUT[:4], self.terms[k].T, strict=True)) | {"interval": t[k + 1] - t[k]}
            free = {name: values[active, i] for i, name in enumerate(self.names)}
            got = solve_many(
                self.system, state[active], (0.0, 1.0), parameters={**self.fixed, **free, **inputs},
                rtol=self.rtol, atol=1e-3 * self.rtol * self.scale, first_step=1.0,
            )  # fmt: skip
            good = got.success
            state[active] = got.x
            x[active[good], j + 1] = got.x[good, 0]
            # A copy that cannot go on keeps the large misfit its row was filled with.
            alive[active[~good]] = False
        return x
