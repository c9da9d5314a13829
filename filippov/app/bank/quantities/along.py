"""A formula in t and the states along the solution: extremes, averages, constancy, zeros."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import field
from typing import Any, Literal

import numpy as np
import sympy
from scipy.optimize import minimize_scalar
from sympy import Symbol

from filippov import Solution
from filippov import t as time_symbol
from filippov.app.bank.case_runs import CaseRuns, slides
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.quantities.quantity import Over, Quantity, expression, segments_over
from filippov.base.arrays import Array

SAMPLES = 101
_NODES, _GAUSS = np.polynomial.legendre.leggauss(24)


class Along(Quantity, quantity="along"):
    """A property of a formula in t, the states and the parameters along the solution.

    take    max, min, max_abs (the largest magnitude: how far the formula is from vanishing), range (largest
            less least value), spread (the same in each part in one mode: how far it is from constant there),
            mean, rms
    over    span, period, first_sliding, sliding, or [begin, end]
    where   names of other quantities in the formula
    signs   names in the formula for the values of the signs that the solution slides on, in order
    rates   names in the formula for the derivatives of the states, in order
    """

    formula: str
    take: Literal["max", "min", "max_abs", "range", "spread", "mean", "rms"] = "max_abs"
    over: Over = "span"
    where: dict[str, Quantity] = field(default_factory=dict)
    signs: tuple[str, ...] = ()
    rates: tuple[str, ...] = ()

    def __call__(self, subject: CaseRuns) -> Any:
        parts = segments_over(subject, self.over)
        run, f = parts[0][0], self._function(subject, parts[0][0])
        if self.take in ("mean", "rms"):
            power = 1 if self.take == "mean" else 2
            mean = sum(_integral(run, f, a, b, power) for _, a, b in parts) / sum(b - a for _, a, b in parts)
            return mean if power == 1 else np.sqrt(mean)
        ends = np.array([self._extent(f, a, b) for _, a, b in parts])
        low, high = float(np.min(ends[:, 0])), float(np.max(ends[:, 1]))
        return {
            "max": high, "min": low, "max_abs": max(abs(low), abs(high)), "range": high - low,
            "spread": float(np.max(ends[:, 1] - ends[:, 0])),
        }[self.take]  # fmt: skip

    def _extent(self, f: Callable[[Array], Array], low: float, high: float) -> tuple[float, float]:
        """Least and largest value between two times of one mode, refined beside the largest samples."""
        # The multipliers at the ends belong to the mode of either side.
        probed = bool(self.signs or self.rates)
        times = np.linspace(low, high, SAMPLES)[1:-1:5] if probed else np.linspace(low, high, SAMPLES)
        values = f(times)
        if not np.all(np.isfinite(values)):
            raise MissingError(f"{self.formula[:60]!r} is not finite between t = {low:.9g} and {high:.9g}")
        out = []
        for sign in (1.0, -1.0):
            k = int(np.argmin(sign * values))
            best = sign * float(values[k])
            if not probed and 0 < k < len(times) - 1:
                bounds = (times[k - 1], times[k + 1])
                found = minimize_scalar(
                    lambda t, s=sign: s * float(f(np.array([t]))[0]), bounds=bounds, method="bounded",
                    options={"xatol": 1e-10 * (bounds[1] - bounds[0])},
                )  # fmt: skip
                best = min(best, float(found.fun))
            out.append(sign * best)
        return out[0], out[1]

    def _function(self, runs: CaseRuns, run: Solution) -> Callable[[Array], Array]:
        """The formula as a function of times."""
        probed = [Symbol(name, real=True) for name in (*self.signs, *self.rates)]
        whole = expression(runs, self.formula, self.where, {symbol.name: symbol for symbol in probed})
        if not probed:
            return runs.along(run, whole)
        assert run.sol is not None
        sol, compiled = run.sol, sympy.lambdify([time_symbol, *runs.built.states, *probed], whole, "numpy")

        def at(time: float) -> float:
            rates, multipliers = runs.velocity(run, time)
            on = [m for m, sign in zip(multipliers, run.mode_at(time, "+"), strict=True) if sign == 0]
            count = len(self.signs)
            if len(on) < count:
                raise MissingError(f"the solution does not slide on {count} surfaces at t = {time:.9g}")
            return float(compiled(time, *sol(time), *on[:count], *rates[: len(self.rates)]))

        return lambda times: np.array([at(float(time)) for time in times])


def _integral(run: Solution, f: Callable[[Array], Array], low: float, high: float, power: int) -> float:
    """The integral of a power, by Gauss's rule on each step."""
    inner = np.asarray(run.t)
    knots = np.unique(np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]]))
    total = 0.0
    for a, b in itertools.pairwise(knots):
        total += 0.5 * (b - a) * float(_GAUSS @ f(0.5 * (a + b) + 0.5 * (b - a) * _NODES) ** power)
    return total


class Share(Quantity, quantity="share"):
    """The part of the time spent in some modes, or that time itself.

    mode   a text of +, -, 0 and * (any) for each surface; missing ones are any
    slides  only modes that slide, or only those that do not
    """

    mode: str = ""
    slides: bool | None = None
    over: Over = "span"
    take: Literal["fraction", "time"] = "fraction"

    def __call__(self, subject: CaseRuns) -> Any:
        total = inside = 0.0
        letters = {"+": 1, "-": -1, "0": 0}
        for run, a, b in segments_over(subject, self.over):
            mode = run.mode_at(0.5 * (a + b), "+")
            fits = all(letters.get(c, s) == s for c, s in zip(self.mode, mode, strict=False))
            total += b - a
            inside += (b - a) * (fits and self.slides in (None, slides(mode)))
        return inside / total if self.take == "fraction" else inside
