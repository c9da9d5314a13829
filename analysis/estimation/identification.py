"""Parameters of a friction law from measured data, by least squares on the exact, event-driven model.

The record is divided into windows. In each, the model runs under the measured force, with stick and slip,
from an initial state that is estimated with the parameters, and the misfit of the position is minimised,
weighted by the inverse of the residuals' covariance V:

    min over p and (x_w, v_w):  r' V^-1 r,   r_k = x_k - x(t_k; p, x_w, v_w),   cov = (J' V^-1 J)^-1

V consists of the noise of the position (an autoregression of order 1) and the uncertainty of the force: its
noise, and its values between the samples. Intervals are Student's, with the degrees of freedom that
estimating V leaves. Tests decide whether the residuals are compatible with the law; if not, no interval is
given. Sources: Bock 1983 (multiple shooting); Seber & Wild 2003 (correlated errors); Fuller 1987 (errors in
variables); Giesbrecht & Burns 1985 (degrees of freedom).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from filippov import System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.driven_run import INPUT
from filippov.analysis.estimation.identify_fit import Fit, Fitting
from filippov.analysis.estimation.misfit import DOUBTED, Test, misfit_tests, refusal, widened
from filippov.analysis.estimation.record import Record
from filippov.analysis.estimation.residual_noise import degrees_of_freedom, generalised, undetermined
from filippov.base.arrays import Array
from filippov.base.escape import figure_text
from filippov.base.given import Amount, Positive, Values
from filippov.base.given import level as check_level
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.shown import Told

HOLDS = ("auto", "cubic", "first", "zero")


@dataclass(frozen=True)
class Identified(Told):
    """Estimated parameters.

    values       estimate by name; errors: standard errors; intervals: at `level`, by Student's t
    covariance   of the free parameters in order, shape (p, p)
    t, measured, fitted, residual   the record and the fit (for a curve: v, force, fit, misfit)
    sigma        standard deviation of the residuals; of a record: of the noise on the position
    degrees      degrees of freedom of the residuals
    success, message   whether the minimisation converged, the law was not refused and the data determine
                 every parameter; a sentence. What they do not determine has infinite errors
    hold         the force model between samples that was used; rho: correlation of the noise from sample to
                 sample
    tests        p of each test of the residuals, by what they must not depend on
    refused      the sentence that refuses the law, "" where it stands; errors and intervals are then infinite
    fixed        values that were given
    labels       of "t", "x", "v" and "force", with the units of the system, for figures
    """

    _untold = ("t", "measured", "fitted")

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
    hold: str = ""
    rho: float = 0.0
    tests: dict[str, float] = field(default_factory=dict)
    refused: str = ""
    fixed: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def residual(self) -> Array:
        """measured - fitted."""
        return self.measured - self.fitted

    def __str__(self) -> str:
        rows = [
            f"{name} = {value:.6g} +- {self.errors[name]:.2g}  "
            f"[{self.intervals[name][0]:.6g}, {self.intervals[name][1]:.6g}] at {100 * self.level:g} %"
            for name, value in self.values.items()
            if name in self.errors
        ]
        rows.append(f"residual standard deviation {self.sigma:.3g}, {self.degrees} degrees of freedom")
        if self.hold:
            rows.append(
                f"noise correlated {self.rho:.2f} from sample to sample, force between samples: {self.hold}"
            )
        if not self.success:
            rows.append(self.refused or f"not converged: {self.message}")
        return "\n".join(rows)


@keywords()
def identify(
    record: Record,
    system: System,
    free: Sequence[str],
    *,
    start: Values | None = None,
    fixed: Values | None = None,
    windows: Amount | None = None,
    hold: str = "auto",
    level: float = 0.95,
    rtol: Positive = 1e-9,
    progress: Callable[[int, float], None] | None = None,
) -> Identified:
    """Estimate parameters of a driven mass from time, position and applied force.

    system    `filippov.models.driven.driven_mass(law)`: states x, v and the input's parameters
    free      names of the parameters that are estimated
    start     their initial guesses; default: the system's values; fixed: values of others
    windows   number of windows; default: about one in 200 samples
    hold      the force between samples: "cubic" smooth, with kinks where the mass stops or starts; "first"
              linear; "zero" held from each sample to the next (what a digital controller does); "auto":
              smooth, and if the residuals contradict that, the most likely of the three
    level     of the intervals, in (0, 1)
    progress  called with (number of evaluations, standard deviation of the misfit)

    Raises UsageError for unknown names and too few samples.
    """
    names = check_names(system, free, start, fixed, hold)
    level = check_level(level)
    count = len(record.t)
    number = max(1, round(count / 200)) if windows is None else windows
    if number < 1 or count < 4 * number or count - 2 * number <= len(names) + 1:
        raise UsageError(
            f"{count} samples for {number} windows and {len(names)} parameters are too few; give more data, "
            "or fewer windows."
        )
    values = dict(zip(system.parameters.names, system.parameters.resolve(fixed), strict=True))
    others = [name for name in values if name not in (*INPUT, *names)]
    fitting = Fitting(
        record, system, names, others, dict(fixed or {}), number, rtol, parameter_bounds(system, names),
        progress,
    )  # fmt: skip
    guess = values | dict(start or {})
    first = np.concatenate(([guess[name] for name in names], fitting.initial_states().ravel()))
    force = [record.force[part] for part in fitting.known]

    def attempt(kind: str) -> tuple[Fit, list[Test]]:
        fit = fitting.fit(first, kind)
        return fit, misfit_tests(fit, others, force)

    kind = "cubic" if hold == "auto" else hold
    fit, tests = attempt(kind)
    if hold == "auto" and min(q.p for q in tests) * len(tests) < DOUBTED:
        for other in ("zero", "first"):
            again = attempt(other)
            if again[0].success and again[0].noise.log > fit.noise.log:
                (fit, tests), kind = again, other
    found = _identified(names, fit, tests, kind, level, record)
    return replace(found, fixed=given_values(fixed), labels=labels_of(system))


def _identified(
    names: tuple[str, ...], fit: Fit, tests: list[Test], hold: str, level: float, record: Record
) -> Identified:
    """The result of a fit: intervals, none where a test refuses the law, wider ones where one doubts it."""
    p, windows, noise = len(names), fit.linear.windows, fit.noise
    solved = generalised(windows, noise.sigma, noise.rho, noise.kappa)
    covariance, lost = solved.covariance[:p, :p], undetermined(solved.root)[:p]
    covariance[:, lost] = np.inf
    covariance[lost] = np.inf
    errors = np.sqrt(np.diag(covariance))
    refused = refusal(fit, tests, record.x)
    low, high = np.full(p, np.inf), np.full(p, -np.inf)
    here = (np.zeros(p), errors, degrees_of_freedom(windows, noise, range(p)))
    for shift, size, degrees in (here, *widened(fit, tests, p)):
        width = student.ppf(0.5 + 0.5 * level, degrees) * size
        low, high = np.minimum(low, shift - width), np.maximum(high, shift + width)
    if refused or not fit.success:
        low, high, errors = np.full(p, -np.inf), np.full(p, np.inf), np.full(p, np.inf)
        covariance = np.full((p, p), np.inf)
    told = not_told(names, lost)
    values = {name: float(v) for name, v in zip(names, fit.theta, strict=False)}
    ends = zip(fit.theta[:p] + low, fit.theta[:p] + high, strict=True)
    fitted = np.concatenate([m.x for m in fit.linear.trajectories])
    return Identified(
        values, dict(zip(names, errors.tolist(), strict=True)),
        {name: (float(a), float(b)) for name, (a, b) in zip(names, ends, strict=True)},
        covariance, level, record.t, record.x, fitted, noise.sigma, len(record.t) - len(fit.theta),
        fit.success and not refused and not told, refused or told or fit.message, hold, noise.rho,
        {q.name: q.p for q in tests}, refused,
    )  # fmt: skip


def given_values(fixed: Values | None) -> dict[str, float]:
    """Values by name as plain numbers."""
    return {name: float(value) for name, value in dict(fixed or {}).items()}


def labels_of(system: System) -> dict[str, str]:
    """Labels of what is measured, with units where the system has them: of its states, or its input."""
    told = {"t": "time", "x": "position", "v": "velocity", "force": "friction force"}
    told |= {name: system.labels[name] for name in ("x", "v") if name in system.labels}
    # Its own t is the part of a sampling interval.
    units = {name: system.parameters[q].unit for name, q in (("t", "interval"), ("force", "force"))}
    return told | {name: figure_text(f"{told[name]} [{unit}]") for name, unit in units.items() if unit}


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
    inverse = linalg.pinv(information, rcond=1e-14, hermitian=True) / np.outer(scale, scale)
    p = len(names)
    covariance = variance * inverse[:p, :p]
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    lost = undetermined(jacobian)[:p]
    errors[lost] = np.inf
    width = float(student.ppf(0.5 + 0.5 * level, degrees)) * errors
    told = not_told(names, lost)
    values = {name: float(v) for name, v in zip(names, theta, strict=False)}
    return Identified(
        values,
        dict(zip(names, errors.tolist(), strict=True)),
        {n: (values[n] - float(w), values[n] + float(w)) for n, w in zip(names, width, strict=True)},
        covariance, level, t, measured, fitted, float(np.sqrt(variance)), degrees, success and not told,
        told or message,
    )  # fmt: skip


def not_told(names: Sequence[str], lost: npt.NDArray[np.bool_]) -> str:
    """The sentence about parameters that the data do not determine, "" without any."""
    left = [name for name, there in zip(names, lost, strict=True) if there]
    if not left:
        return ""
    alone = "it" if len(left) == 1 else "each of them by itself"
    return (
        f"the data do not determine {', '.join(left)}: other values fit as well. Give data that depend on "
        f"{alone}, or a value with fixed={{{left[0]!r}: ...}}."
    )


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
        raise UsageError(f"{', '.join(sorted(both))} cannot be both free and fixed. Leave it out of one.")
    if hold not in HOLDS:
        raise UsageError(unknown("value of hold:", hold, HOLDS))
    return names
