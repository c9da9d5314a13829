"""Hunting under Coulomb and static + Coulomb friction, by the algebra of the linear slip phase.

    x' = v,  m v' = -P (x + D v + w) - b v - F,  w' = I x,   F = Fc sgn(v) in slip, |F| <= Fs in stick

A slip that breaks away at x = d > 0 (u = Fs, v = 0) is linear in d and in (Fs - Fc)/P:

    (x, v, w - Fc/P)(t) = d a(t) + (Fs - Fc)/P b(t),   a = exp(M t) (1, 0, -1),  b = exp(M t) (0, 0, 1)

It stops at the first T > 0 with v(T) = 0, and the half cycle closes where x(T) = -d. Without a jump (Fs = Fc)
nothing but the ratio -a_x(T) is left: the amplitudes shrink by it and there is no cycle.

Source of the question and of both answers: Armstrong-Helouvry & Amin, Automatica 32 (1996) 679; the formulas
follow from the equations above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.keywords import keywords

RATIOS, TIMES, TURNS = 240, 6000, 6.0


@dataclass(frozen=True)
class StaticCycle:
    """A symmetric hunting cycle.

    d            amplitude: |x| in stick
    slip, stick  durations of the two phases of a half period; period = 2 (slip + stick)
    multiplier   slope of the map d -> |x at the next stop|: stable where its size is below 1
    """

    d: float
    slip: float
    stick: float
    multiplier: float

    @property
    def period(self) -> float:
        """2 (slip + stick)."""
        return 2 * (self.slip + self.stick)

    @property
    def stable(self) -> bool:
        """|multiplier| < 1."""
        return abs(self.multiplier) < 1


class LinearSlip:
    """The slip phase of a PID-controlled mass with constant friction.

    m, P, I > 0 and P D + b > m I, so that the loop without friction is stable. Raises UsageError.
    """

    def __init__(self, *, m: float, P: float, D: float, I: float, b: float = 0.0) -> None:
        damping = P * D + b
        if not (m > 0 and P > 0 and I > 0 and damping > m * I):
            raise UsageError(
                f"m = {m}, P = {P}, D = {D}, I = {I}, b = {b}: expected m, P, I > 0 and P D + b > m I; the "
                "loop without friction is not stable otherwise (Routh-Hurwitz)."
            )
        self.P, self.I = P, I
        self.matrix = np.array([[0, 1, 0], [-P / m, -damping / m, -P / m], [I, 0, 0]], dtype=float)
        rates = np.linalg.eigvals(self.matrix)
        horizon = TURNS * 2 * np.pi / float(np.min(np.abs(rates)))
        self.times = np.linspace(0, horizon, TIMES + 1)
        step = expm(self.matrix * (horizon / TIMES))
        rows = np.empty((TIMES + 1, 3, 2))
        rows[0] = [[1, 0], [0, 0], [-1, 1]]
        for k in range(TIMES):
            rows[k + 1] = step @ rows[k]
        self.rows = rows

    def at(self, time: float, ratio: float) -> Array:
        """State (x, v, w - Fc/P) at a time for d = ratio and (Fs - Fc)/P = 1; ratio = inf: d = 1 and 0."""
        start = [1.0, 0.0, -1.0] if np.isinf(ratio) else [ratio, 0.0, 1.0 - ratio]
        return np.asarray(expm(self.matrix * time) @ start)

    def stop(self, ratio: float) -> float | None:
        """First T > 0 at which v is 0 again; None where the slip does not stop within the horizon."""
        v = self.rows[:, 1, 0] if np.isinf(ratio) else ratio * self.rows[:, 1, 0] + self.rows[:, 1, 1]
        found = np.nonzero(v[1:] >= 0)[0]
        # v leaves 0 downwards by the jump of the friction, or without one by its second derivative.
        found = found[found > 0]
        if not found.size:
            return None
        k = int(found[0])
        low, high = self.times[k], self.times[k + 1]
        return float(brentq(lambda time: self.at(time, ratio)[1], low, high, xtol=1e-15 * high, rtol=1e-14))

    def excess(self, ratio: float) -> float:
        """|x| at the stop minus d, for (Fs - Fc)/P = 1; NaN where the slip does not stop."""
        time = self.stop(ratio)
        return float("nan") if time is None else float(-self.at(time, ratio)[0] - ratio)


    def roughly(self, ratio: float) -> float:
        """`excess` from the table of times, between two of which v is taken for straight."""
        rows = ratio * self.rows[:, :, 0] + self.rows[:, :, 1]
        found = np.nonzero(rows[1:, 1] >= 0)[0]
        found = found[found > 0]
        if not found.size:
            return float("nan")
        k = int(found[0])
        share = rows[k, 1] / (rows[k, 1] - rows[k + 1, 1])
        return float(-(rows[k, 0] + share * (rows[k + 1, 0] - rows[k, 0])) - ratio)


@keywords("keyword", error=ModelError)
def coulomb_ratio(*, m: float, P: float, D: float, I: float, b: float = 0.0) -> float | None:
    """Ratio of successive stick positions under Coulomb friction alone, -a_x(T); None: no stop on the way.

    Below 1 the amplitudes die out: no hunting, whatever Fc is.
    """
    slip = LinearSlip(m=m, P=P, D=D, I=I, b=b)
    time = slip.stop(float("inf"))
    return None if time is None else float(-slip.at(time, float("inf"))[0])


@keywords("keyword", error=ModelError)
def static_cycles(
    *, m: float, P: float, D: float, I: float, Fs: float, Fc: float, b: float = 0.0
) -> tuple[StaticCycle, ...]:
    """All symmetric hunting cycles under static + Coulomb friction, by growing amplitude.

    m [kg]; P [N/m], D [s], I [1/s]: u = P (x + D x' + I int x); Fs > Fc >= 0 [N]; b [N s/m] viscous

    Every amplitude is proportional to (Fs - Fc)/P. Raises UsageError.
    """
    if not Fs > Fc >= 0:
        raise UsageError(f"Fs = {Fs}, Fc = {Fc}: expected Fs > Fc >= 0; with Fs = Fc use coulomb_ratio.")
    slip = LinearSlip(m=m, P=P, D=D, I=I, b=b)
    ratios = np.geomspace(1e-4, 1e4, RATIOS)
    balance = np.array([slip.roughly(float(ratio)) for ratio in ratios])
    # A root may be on the other side of a point of the scan than it seems.
    near = np.flatnonzero(balance[:-1] * balance[1:] < 0)
    near = np.unique(np.clip([near - 1, near, near + 1], 0, RATIOS - 2))
    cycles = []
    for low, high in zip(ratios[near], ratios[near + 1], strict=True):
        if not slip.excess(float(low)) * slip.excess(float(high)) < 0:
            continue
        ratio = float(brentq(slip.excess, low, high, xtol=1e-15 * high, rtol=1e-14))
        time = slip.stop(ratio)
        if time is None or abs(slip.excess(ratio)) > 1e-6 * ratio:
            continue
        unit = (Fs - Fc) / P
        x, _, q = slip.at(time, ratio) * unit
        left = (P * (x + q) + Fc + Fs) / (P * I * ratio * unit)
        if left < 0 or P * (x + q) + Fc > Fs:
            continue  # The force at the stop is beyond the static limit: the mass does not stick.
        # v(T) = 0, so the dependence of T on d drops out.
        slope = -float(slip.at(time, float("inf"))[0])
        cycles.append(StaticCycle(ratio * unit, time, float(left), slope))
    return tuple(cycles)
