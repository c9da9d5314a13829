"""Whether an explicit run is stiff: steps held down by the field's fastest decay and not by its accuracy.

An explicit method is stable while step * |lambda| stays below its limit, lambda the eigenvalue of the mode's
Jacobian of largest size (Hairer & Wanner 1996, section IV.2). Steps that stay near the limit long after that
decay is over are what stiffness is.
"""

from __future__ import annotations

import numpy as np

from filippov.base.status import Status
from filippov.solving.state.run import Run

# step * |lambda| above which stability limits the step, two thirds of where it ends.
LIMITS = {"DOP853": 4.0, "DP5": 2.2}
LONG = 20_000
SLOW = (Status.MAX_STEPS, Status.TIMEOUT, Status.MIN_STEP)
_SPACING = 256


class StiffnessMonitor:
    """Looks at the fastest decay of the field, taken now and then along a run."""

    def __init__(self) -> None:
        self.products: list[float] = []
        self.rate, self.step = 0.0, 0.0
        self._next = _SPACING

    def look(self, run: Run, now: bool = False) -> None:
        """Compare the step with the fastest decay here, if the last look is some steps ago."""
        # A look costs n field calls and the eigenvalues of an n x n matrix.
        spacing = max(_SPACING, 32 * run.machine.n)
        early = run.attempts < max(self._next, spacing)
        if run.options.method not in LIMITS or (early and not now):
            return
        self._next = run.attempts + spacing + run.attempts // 8
        rate = fastest_decay(run)
        step = min(float(run.clock.step), run.options.max_step)
        self.products.append(rate * step)
        if rate * step >= LIMITS[run.options.method]:
            self.rate, self.step = rate, step

    def hint(self, run: Run, status: Status) -> str:
        """A sentence where most looks found the step held down; after a good end only for many steps."""
        asked = status in SLOW or (status.ok and run.attempts >= LONG)
        if run.options.method not in LIMITS or not asked:
            return ""
        self.look(run, now=True)
        if np.median(self.products) < LIMITS[run.options.method]:
            return ""
        return (
            f" The field is stiff here (decay at a rate of {self.rate:.1g}, steps of {self.step:.1g}): "
            "method='Radau'."
        )


def fastest_decay(run: Run) -> float:
    """|lambda| of the largest eigenvalue of the mode's Jacobian if it is one of decay, else 0."""
    machine, x = run.machine, run.x
    speed = np.empty((machine.n, machine.n))
    try:
        _, field, _, _ = machine.probe(run.t, 0.0, x, run.mode, run.lam)
        base = field.copy()
        for j in range(machine.n):
            moved = x.copy()
            moved[j] += 1.5e-8 * max(abs(x[j]), abs(base[j] * run.clock.step), 1e-9)
            _, field, _, _ = machine.probe(run.t, 0.0, moved, run.mode, run.lam)
            speed[:, j] = (field - base) / (moved[j] - x[j])
        values = np.linalg.eigvals(speed) if np.all(np.isfinite(speed)) else np.zeros(1)
    except Exception:  # noqa: BLE001 - a look beside the solution must not end the run
        return 0.0
    largest = values[np.argmax(np.abs(values))]
    decays = run.direction * largest.real < -0.5 * abs(largest)
    return float(abs(largest)) if decays else 0.0
