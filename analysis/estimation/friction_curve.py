"""A friction law as a curve: its force off rest, and its parameters from measured points (v, F)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy
from scipy.optimize import least_squares

from filippov import System, UsageError, t
from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.driven_run import INPUT
from filippov.analysis.estimation.identification import (
    Identified,
    check_names,
    estimate,
    given_values,
    labels_of,
    parameter_bounds,
)
from filippov.analysis.estimation.record import Curve
from filippov.analysis.estimation.residual_noise import undetermined
from filippov.base.arrays import Array
from filippov.base.given import Values
from filippov.base.given import level as check_level
from filippov.base.keywords import keywords

# Of the size of the force: what stands for a misfit that is no number.
BEYOND = 1e6
# Relative changes of the sum of squares, of the parameters, and the slope at which the search ends.
CONVERGED = 1e-11
# Powers of 10 by which two parameters at once are multiplied, how many of these places are searched from, and
# how many searches have to end in one place, to this part of their cost, for it to be trusted.
POWERS, PLACES, AGREED, ALIKE = np.arange(-4.0, 5.0), 6, 3, 1e-6
# Of its unit: steps of a smaller parameter are no smaller.
SMALL = 1e-3


@keywords()
def friction_force(system: System, v: Array, values: Mapping[str, float]) -> Array:
    """F(v) [N] of a driven mass off v = 0: the force that keeps the velocity v, shape of v.

    Raises UsageError for a system without the input's parameters.
    """
    p = system.parameters.resolve({**values, "force": 0.0, "interval": 1.0})
    return np.asarray(_force_function(system)(v, p))


def _force_function(system: System) -> Callable[[Array, Array], Array]:
    form = system.symbolic
    if form is None or not set(INPUT) <= set(system.parameters.names):
        raise UsageError("friction_force needs a driven mass: filippov.models.driven.driven_mass(law).")
    mass = next(q for q in form.p if q.name == "m")
    force = sympy.lambdify([form.x, form.p, form.s, form.a, t], -mass * form.field[1], "numpy")

    def evaluate(v: Array, p: Array) -> Array:
        signs = np.repeat(np.sign(v)[None], len(form.s), axis=0)
        sizes = np.repeat(np.abs(v)[None], len(form.s), axis=0)
        values = force((0.0 * v, v), p, signs, sizes, 0.0)
        return np.asarray(np.broadcast_to(np.asarray(values, dtype=float), v.shape))

    return evaluate


@keywords()
def identify_curve(
    curve: Curve,
    system: System,
    free: Sequence[str],
    *,
    start: Values | None = None,
    fixed: Values | None = None,
    level: float = 0.95,
) -> Identified:
    """Estimate parameters of a friction law from points (v, F), v != 0, by least squares of the force.

    Other arguments as in `identify`. The minimisation starts from several places, because vs and the
    exponent of a steep curve have local minima. Raises UsageError.
    """
    names, level = check_names(system, free, start, fixed, "zero"), check_level(level)
    moving = curve.v != 0
    v, friction = curve.v[moving], curve.friction[moving]
    if v.size <= len(names) + 1:
        raise UsageError(
            f"{v.size} points with v != 0 are too few for {len(names)} parameters: give {len(names) + 2} or "
            "more, or "
            "fix some of them: fixed={'beta': 2}."
        )
    force = _force_function(system)
    base = system.parameters.resolve({**(fixed or {}), **(start or {})})
    places = [system.parameters.index(name) for name in names]
    bounds = parameter_bounds(system, names)

    def misfit(theta: Array) -> Array:
        p = base.copy()
        p[places] = theta
        with np.errstate(all="ignore"):
            return np.asarray(friction - force(v, p))

    theta, slopes, success, message = _least_squares(misfit, base[places], bounds, friction)
    residual = misfit(theta)
    order = np.argsort(v)
    found = estimate(
        names, theta, residual, slopes, level, v[order], friction[order], (friction - residual)[order],
        success, message,
    )  # fmt: skip
    return replace(found, fixed=given_values(fixed), labels=labels_of(system))


def _least_squares(
    misfit: Callable[[Array], Array], guess: Array, bounds: tuple[Array, Array], friction: Array
) -> tuple[Array, Array, bool, str]:
    """The best of several searches: theta, the slopes of the misfit, whether it converged, and the message.

    Forces are measured in the size of the data and parameters in that of the guess, or by what moves the
    force by its size: tests of convergence in the units of the data would end early in some of them.
    """
    size = float(np.sqrt(np.mean(friction**2))) or 1.0

    def moving(theta: Array, k: int) -> float:
        """What a parameter that is as good as 0 has to be to move the force by its size; 0 for none."""
        moved = theta.copy()
        moved[k] = theta[k] + 1e-6 * size
        moves = float(np.sqrt(np.mean((misfit(moved) - misfit(theta)) ** 2)))
        return 1e-6 * size * size / moves if np.isfinite(moves) and moves > 0 else 0.0

    unit = np.abs(guess)
    for k in np.flatnonzero(unit == 0).tolist():
        unit[k] = moving(guess, k) or 1.0
    low, high = (edge / unit for edge in bounds)

    def scaled(u: Array) -> Array:
        return np.asarray(np.nan_to_num(misfit(u * unit) / size, nan=BEYOND, posinf=BEYOND, neginf=-BEYOND))

    def search(begin: Array) -> Any:
        return least_squares(
            scaled, np.clip(begin, np.nextafter(low, np.inf), high), bounds=(low, high),
            x_scale=np.maximum(np.abs(begin), SMALL), ftol=CONVERGED, xtol=CONVERGED, gtol=CONVERGED,
        )  # fmt: skip

    ends = [search(guess / unit * factor) for factor in (1.0, 0.3, 3.0, 0.1, 10.0)]
    best = min(ends, key=lambda end: float(end.cost))
    alike = sum(bool(end.cost <= best.cost * (1 + ALIKE)) for end in ends)
    # Where the force does not depend on some of them the search had no slope to follow: far off, too.
    if alike < AGREED or np.any(undetermined(best.jac)):
        more = [search(begin) for begin in _around(scaled, best.x, (low, high))]
        best = min([best, *more], key=lambda end: float(end.cost))
    theta = best.x * unit
    # Far from the guess: once more in units of its own.
    if np.any(np.abs(np.log10(np.maximum(np.abs(best.x), SMALL))) > 1):
        nil = np.flatnonzero(np.abs(best.x) < SMALL**2).tolist()
        unit = np.where(theta == 0, unit, np.abs(theta))
        for k in nil:
            unit[k] = moving(theta, k) or unit[k]
        low, high = (edge / unit for edge in bounds)
        best = search(theta / unit)
    return best.x * unit, best.jac * size / unit, bool(best.success), str(best.message)


def _around(
    misfit: Callable[[Array], Array], u: Array, bounds: tuple[Array, Array]
) -> list[Array]:
    """Places to search from: the best of those with two parameters multiplied by powers of 10, the others
    moved to where a linear force would be nearest."""
    found: list[tuple[float, Array]] = []
    for pair in itertools.combinations(range(u.size), min(2, u.size)):
        others = [k for k in range(u.size) if k not in pair]
        for powers in itertools.product(POWERS, repeat=len(pair)):
            row = u.copy()
            row[list(pair)] *= 10.0 ** np.array(powers)
            row = np.clip(row, *bounds)
            left = misfit(row)
            steps = np.maximum(SMALL * np.abs(row), SMALL**2)
            slopes = [(misfit(row + steps[k] * np.eye(u.size)[k]) - left) / steps[k] for k in others]
            if slopes:
                row[others] -= linalg.lstsq(np.column_stack(slopes), left, rcond=None)[0]
                row = np.clip(row, *bounds)
                left = misfit(row)
            found.append((float(left @ left), row))
    return [row for _, row in sorted(found, key=lambda one: one[0])[:PLACES]]
