"""Equilibria on kinks of systems that depend on time or are reset by a clock: the multipliers of all sides.

The multipliers of one side do not decide for a point on a kink. If all sides have the same linear part and
the same resets, their multipliers are those of the point. A single state keeps its side between the clocks:
each side has a factor over the period, and the cycles that they form decide. In the plane the map of
directions over the period decides.
"""

from __future__ import annotations

import math

import numpy as np
import sympy

from filippov.analysis.local_stability.floquet import by_modulus, common_period, floquet, monodromy
from filippov.analysis.local_stability.kink_stability import modes_beside
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer
from filippov.analysis.steady.clocks import Phases, after, branch_points, resetting
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.base.arrays import Array
from filippov.model.symbols import t as time

STEPS, DIRECTIONS, PERIODS = 1024, 720, 12
# The least change of the logarithm of a length that is distinguished from none.
CLEAR_LOG = 1e-3
# How far from a point on a kink of a reset the slopes of its two sides are taken.
BESIDE = 1e-8
LEFT = "it lies on a kink, and the multipliers over the period are those of one side"


def on_kinks(
    context: Context, found: EquilibriumPoint | EquilibriumSet, on: list[int], moves: bool
) -> tuple[Answer, str]:
    """The verdict on a point on kinks: by its sides where these agree, and in dimensions 1 and 2."""
    kinds = {context.system.surfaces[i].kind for i in on}
    if isinstance(found, EquilibriumSet) or "0" in found.mode or kinds != {"kink"}:
        return "undecided", LEFT
    modes = ["".join("-+"[m > 0] for m in mode) for mode in modes_beside(context, found.mode, on).values()]
    put = dict(zip(context.form.x, found.x, strict=True))
    slopes = [
        [context.form.jacobian(mode).subs(context.put).subs(put).applyfunc(sympy.expand)]
        + [
            sympy.Matrix(after(context.system, k, mode)).jacobian(context.form.x).subs(put)
            for k in resetting(context.system)
        ]
        for mode in modes
    ]
    rows = [after(context.system, k, modes[0]) for k in resetting(context.system)]
    branches = any(branch_points(row, put, context.values) for row in rows)
    if all(other == slopes[0] for other in slopes) and not branches:
        return floquet(context, modes[0], slopes[0][0], found.x, moves)
    most = 1 if branches else 2
    if len(context.form.x) > most or any(context.form.h[i].has(time) for i in on):
        return "undecided", LEFT
    clocks = common_period(context, moves)
    if isinstance(clocks, str):
        return "undecided", clocks
    if any(q.has(time) for side in slopes for q in side[1:]):
        return "undecided", "a reset changes with time"
    if len(context.form.x) == 1:
        return on_line(context, found, on, clocks)
    return _plane(context, found, on, clocks, slopes)


def on_line(context: Context, found: EquilibriumPoint, on: list[int], clocks: Phases) -> tuple[Answer, str]:
    """One state: it keeps its side between the clocks, and each side has a factor over the period."""
    put = dict(zip(context.form.x, found.x, strict=True))
    gradients = context.form.gradients(found.mode).subs(put)
    slopes = {i: context.number(gradients[i]) for i in on}
    if any(not abs(g) > 0 for g in slopes.values()):
        return "undecided", "a kink that it lies on has no slope there"
    order = [*sorted((phase or clocks.period, k) for phase, k in clocks.instants), (clocks.period, -1)]
    ends: dict[int, tuple[int, float]] = {}
    for start in (1, -1):
        side, size, now = start, 1.0, 0.0
        for phase, k in order:
            mode = "".join("-+"[side * slopes[i] > 0] if i in slopes else c for i, c in enumerate(found.mode))
            rate = context.form.jacobian(mode).subs(context.put).subs(put)
            rate = rate.subs(time, time + sympy.Float(now, 20))
            part = Phases(phase - now, ((phase - now, k),) if k >= 0 else ())
            factor = monodromy(context, mode, rate, found.x, part, None, side * BESIDE)
            if factor is None:
                return "undecided", "a reset has no derivative at the equilibrium, or changes with time"
            value = float(factor[0, 0])
            side, size, now = side if value >= 0 else -side, size * abs(value), phase
        ends[start] = side, size
    # The cycles of the two sides: each onto itself, or one onto the other and back.
    factors = [size for start, (side, size) in ends.items() if side == start]
    largest = max(factors) if factors else math.sqrt(ends[1][1] * ends[-1][1])
    head = f"it lies on a kink: over the period {clocks.period:.6g} its sides are multiplied by up to"
    return by_modulus(largest, f"{head} {largest:.6g}")


def _plane(
    context: Context, found: EquilibriumPoint, on: list[int], clocks: Phases, slopes: list[list[sympy.Matrix]]
) -> tuple[Answer, str]:
    """Two states: the map of directions over the period, and the factor of each direction.

    Positively homogeneous fields map rays to rays. All directions that have shrunk after a number of periods
    show the decay, one that comes back longer the growth.
    """
    put = dict(zip(context.form.x, found.x, strict=True))
    rows = context.numbers(context.form.gradients(found.mode).extract(on, [0, 1]).subs(context.put).subs(put))
    numbers = [context.numbers(part) for side in slopes for part in side[1:]]
    if not all(np.all(np.isfinite(part)) for part in (rows, *numbers)):
        return "undecided", LEFT
    fields = [sympy.lambdify(time, side[0].subs(context.values), "numpy") for side in slopes]
    by_clock = np.array(numbers).reshape(len(slopes), -1, 2, 2).swapaxes(0, 1)
    resets = dict(zip(resetting(context.system), by_clock, strict=True))
    weights = 2 ** np.arange(len(on) - 1, -1, -1)

    def along(y: Array, matrices: Array) -> Array:
        """Each column of y times the matrix of its side."""
        side = weights @ (rows @ y < 0)
        product: Array = np.einsum("kij,jk->ik", matrices[side], y)
        return product

    def over_a_period(y: Array) -> Array:
        now = 0.0
        order = sorted((phase or clocks.period, k) for phase, k in clocks.instants)
        for phase, k in [*order, (clocks.period, -1)]:
            steps = math.ceil(STEPS * (phase - now) / clocks.period)
            dt = (phase - now) / max(steps, 1)
            for step in range(steps):
                t = now + step * dt
                times = (t, t + dt / 2, t + dt)
                first, middle, last = (np.array([f(q) for f in fields], dtype=float) for q in times)
                a = along(y, first)
                b = along(y + dt / 2 * a, middle)
                c = along(y + dt / 2 * b, middle)
                y = y + dt / 6 * (a + 2 * b + 2 * c + along(y + dt * c, last))
            now = phase
            y = along(y, resets[k]) if k >= 0 else y
        return y

    angles = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
    start = np.array([np.cos(angles), np.sin(angles)])
    y, size = start, np.zeros(DIRECTIONS)
    head = f"it lies on a kink: over the period {clocks.period:.6g}, followed from {DIRECTIONS} directions,"
    for periods in range(1, PERIODS + 1):
        y = over_a_period(y)
        length = np.maximum(np.hypot(*y), 1e-300)
        y, size = y / length, size + np.log(length)
        # Between two directions the factor is taken to change no more than from one to the next.
        change = float(np.max(np.abs(size - np.roll(size, 1))))
        if float(np.max(size)) + change < -CLEAR_LOG:
            return "asymptotically stable", f"{head} all are shorter after {periods}"
        if float(np.min(size)) - change > CLEAR_LOG:
            return "unstable", f"{head} all are longer after {periods}"
        # A ray between two directions that turn towards or away from each other comes back.
        turn, ahead = start[0] * y[1] - start[1] * y[0], np.sum(y * start, axis=0) > 0.5
        kept = ahead & np.roll(ahead, 1) & (turn * np.roll(turn, 1) <= 0)
        if np.any(kept & (size > change + CLEAR_LOG)):
            return "unstable", f"{head} one comes back longer after {periods}"
    return "undecided", LEFT
