"""Lyapunov exponents of a solution with events: growth of small displacements, saltation included.

The derivative of the flow over intervals of time, with a QR decomposition after each; the logarithms of the
diagonals add up (Benettin et al. 1980). Sliding loses rank, which is an exponent of minus infinity. The first
tenth of the intervals only turns the basis into its directions and is not counted.
Source for the events: Mueller 1995 (saltation in Lyapunov exponents); Leine & Nijmeijer 2004.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from filippov import System, UsageError
from filippov.analysis.sensitivity.carried_basis import CarriedBasis
from filippov.base.arrays import Array
from filippov.base.given import NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.base.shown import Told
from filippov.plot.style import time_unit
from filippov.solving.state.options import Options, check_state
from filippov.solving.uncut import solve

BLOCKS = 8
# Intervals that are solved at once: so many steps of the solver, and no more of them than this.
_STEPS, _MOST = 1000, 64


@dataclass(frozen=True)
class Lyapunov(Told):
    """Exponents [1/time], largest first.

    exponents  (k,), -inf where rank is lost in sliding or in a reset
    error      from the scatter over 8 parts of the run
    t, running times and the exponents estimated up to them, (r,), (r, k): whether they have settled
    skipped    intervals left out because the solution grazes a surface in them
    message    how the run ended and what is left out, "" for as planned; interrupted: by Ctrl-C
    parameters values by name; labels: of the axes, "t" and "exponents"
    """

    _untold = ("running", "interrupted")

    exponents: Array
    error: Array
    t: Array
    running: Array
    skipped: int
    message: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    interrupted: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Plain data, without the estimates on the way; t: from when to when they are taken."""
        return super().to_dict() | {"t": [float(self.t[0]), float(self.t[-1])]}

    def __str__(self) -> str:
        rows = [f"{v:.6g} +- {e:.2g}" for v, e in zip(self.exponents, self.error, strict=True)]
        return f"Lyapunov exponents over {self.t[-1] - self.t[0]:.6g}: " + ", ".join(rows)


@keywords(same={"stretch": "interval"})
def lyapunov(
    system: System,
    x0: Any,
    duration: Positive,
    *,
    interval: Positive,
    transient: NonNegative = 0.0,
    t0: float = 0.0,
    number: int | None = None,
    parameters: Mapping[str, float] | None = None,
    rtol: Positive = 1e-9,
    atol: NonNegative = 1e-12,
    progress: Callable[[float, float], None] | None = None,
) -> Lyapunov:
    """Exponents along the solution from x0: `transient` is run first, then `duration` in intervals.

    interval  time between two decompositions; of a forced system a multiple of the period
    number    how many exponents, the largest ones; default: all

    A run that fails, or Ctrl-C, ends the average where it is, and the message says so. Raises UsageError.
    """
    if not (0 < interval <= duration and transient >= 0):
        raise UsageError(
            f"interval {interval}, duration {duration}, transient {transient}: expected 0 < interval <= "
            "duration and transient >= 0."
        )
    n = system.dimension
    k = n if number is None else number
    if not 1 <= k <= n:
        raise UsageError(f"number is {number}, expected 1 ... {n}.")
    t, x, message = t0, check_state(x0, system), ""
    options: dict[str, Any] = {"parameters": parameters, "rtol": rtol, "atol": atol}
    if transient > 0:
        run = solve(system, x, (t, t + transient), dense_output=False, **options)
        t, x = run.t_end, run.x_end
        if not run.success:
            raise UsageError(
                f"the transient did not reach its end: {run.message} Take a shorter one, or another x0."
            )
    carried = CarriedBasis(np.linalg.qr(np.random.default_rng(0).standard_normal((n, k)))[0])
    logs: list[Array] = []
    times, lengths = [t], []
    skipped, end, interrupted = 0, t + duration, False
    count = 1
    try:
        while t < end - 1e-9 * interval and not message:
            # Intervals that are solved at once, with what each of them could take alone.
            cuts = np.minimum(t + interval * np.arange(1, count + 1), end)
            cuts = cuts[: 1 + int(np.searchsorted(cuts, end - 1e-9 * interval))]
            options |= {"max_steps": count * Options.max_steps, "max_events": count * Options.max_events}
            run = solve(system, x, (t, float(cuts[-1])), **options)
            if not run.success:
                message, cuts = run.message, cuts[cuts < run.t_end]
                if not cuts.size:
                    break
            settling = len(logs) <= duration / interval / 10
            for stop, growth in zip(cuts.tolist(), carried.over(run, t, cuts, settling), strict=True):
                if growth is None:
                    skipped += 1
                else:
                    logs.append(growth)
                    times.append(stop)
                    lengths.append(stop - t)
                t = stop
                if progress is not None:
                    progress(t, end)
            assert run.sol is not None
            x, count = run.x_end, max(1, min(_MOST, _STEPS * count // len(run.sol.start)))
    except KeyboardInterrupt:
        if not logs:
            raise
        message, interrupted = f"interrupted at t = {t:.9g}", True
    if carried.unresolved:
        much = f"{carried.unresolved} times a direction shrinks faster than is resolved"
        message = "; ".join(filter(None, (message, f"{much}: take a shorter interval")))
    if not logs:
        raise UsageError(f"no interval could be used: {message or 'all of them graze a surface'}")
    if skipped:
        share = f"{skipped} of {skipped + len(logs)} intervals graze a surface and are left out"
        message = "; ".join(filter(None, (message, f"{share}: the exponents may be off")))
    first = len(logs) // 10
    # An interval that was skipped adds neither growth nor time.
    table, times, spans = np.array(logs[first:]), times[first:], np.array(lengths[first:])
    running = np.cumsum(table, axis=0) / np.cumsum(spans)[:, None]
    named = {"t": f"time that the estimate rests on{time_unit(system)}",
             "exponents": f"Lyapunov exponents{time_unit(system, '1/')}"}  # fmt: skip
    return Lyapunov(
        running[-1], _scatter(table, spans), np.array(times), running, skipped, message,
        system.parameters.others(parameters), named, interrupted,
    )  # fmt: skip


def _scatter(table: Array, spans: Array) -> Array:
    parts = [p for p in np.array_split(np.arange(len(spans)), BLOCKS) if p.size]
    if len(parts) < 2:
        return np.full(table.shape[1], np.nan)
    means = np.array([table[p].sum(axis=0) / spans[p].sum() for p in parts])
    finite = np.all(np.isfinite(means), axis=0)
    spread = np.std(np.where(finite, means, 0.0), axis=0, ddof=1) / np.sqrt(len(parts))
    return np.asarray(np.where(finite, spread, 0.0))
