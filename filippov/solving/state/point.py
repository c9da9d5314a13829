"""A point at which modes are asked for, with what the compiled system says there, asked once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.loop.start import LATER, NUDGE, PER_STATE
from filippov.solving.state.events import Mode
from filippov.solving.state.machine import Machine

DIFFERENCES = 32.0

Probe = tuple[int, Array, Array, Array]


@dataclass(frozen=True)
class Point:
    """Where modes are asked for: machine, time and state, direction of time, a trial step.

    guess    the last multipliers
    resting  surfaces with a contact on which the state may rest
    reached  surfaces that the point lies on
    back     surfaces that the solution of the mode `base` ran onto
    along    surfaces on which that solution stayed without sliding on them
    longest  step to which the trial step may be lengthened where nothing shows in it
    fine     whether excursions off a surface that are rounding of its terms count
    """

    machine: Machine
    t: float
    x: Array
    direction: float
    step: float
    guess: Array
    resting: frozenset[int] = frozenset()
    reached: frozenset[int] = frozenset()
    base: Mode = ()
    back: frozenset[int] = frozenset()
    along: frozenset[int] = frozenset()
    longest: float = 0.0
    fine: bool = False
    reaches: dict[tuple[int, tuple[int, ...]], float] = field(default_factory=dict, compare=False, repr=False)
    summed: dict[bytes, Array] = field(default_factory=dict, compare=False, repr=False)
    moved: dict[bytes, Array] = field(default_factory=dict, compare=False, repr=False)
    probed: dict[tuple[float, bytes, bytes], Probe] = field(default_factory=dict, compare=False, repr=False)

    @property
    def grain(self) -> float:
        """By how much differences as gradients add to the rounding of formulas."""
        return 1.0 if self.machine.system.field is None else DIFFERENCES

    def gradients(self, mode: Array) -> tuple[Array, Array]:
        """dh/dx and dh/dt with the sizes of a mode."""
        return self.machine.gradients(self.t, self.x, mode)

    def rhs(self, signs: Array, mode: Array) -> Array:
        """The vertex field at signs +-1."""
        return self.machine.rhs(self.t, self.x, signs, mode)

    def corner_kind(self, mode: Array, pair: Sequence[int]) -> int:
        """What the corner of two surfaces is, in bits (see `kernel.loop.corner`)."""
        return self.machine.corner_kind(self.t, self.x, mode, pair, self.direction)

    def reach(self, i: int, mode: Array) -> float:
        """By how much the signs of the surfaces reached move the rate of surface i: where they balance, by 0.

        What is left of forces in balance is rounding of these, however small the sum itself is.
        """
        # A contact that rests has its rate for a guard: its reach is of forces, not of speeds.
        held = tuple(j for j, side in enumerate(self.machine.contacts) if side != 0.0 == mode[j])
        if (i, held) not in self.reaches:
            component = self.machine.component
            group = [j for j in self.reached if component[j] == component[i]]
            g, _ = self.gradients(mode)
            g = np.where(np.isfinite(g), g, 0.0)
            signs = np.where(mode == 0.0, 1.0, mode)
            effects = []
            for j in group:
                signs[j] = -signs[j]
                effects.append(self.rhs(signs, mode))
                signs[j] = -signs[j]
            base = self.rhs(signs, mode)
            for k in {i, *group}:
                change = [abs(self.machine.rate(k, g, effect - base)) for effect in effects]
                self.reaches[k, held] = float(np.nansum(change))
        return self.reaches[i, held]

    def terms(self, i: int, mode: Array) -> float:
        """Size of the terms that the rate of surface i is a sum of: what rounding in it is measured by.

        Those of grad h . f, what the signs make of it, and what the states and the time do inside f and h:
        sum_k |x_k d(h')/dx_k|. The rate itself and the states in h may be 0 while these are not.
        """
        key = mode.tobytes()
        if key not in self.summed:
            signs = np.where(mode == 0.0, 1.0, mode)
            base = self.rhs(signs, mode)
            g, gt = self.gradients(mode)
            g = np.where(np.isfinite(g), g, 0.0)
            with np.errstate(invalid="ignore", over="ignore"):
                total = np.abs(gt) + np.abs(g) @ np.nan_to_num(np.abs(base), posinf=0.0)
                rates = _rates(g, base, gt)
                for t, x in self._nudged():
                    slopes, drift = self.machine.gradients(t, x, mode)
                    moved = _rates(slopes, self.machine.rhs(t, x, signs, mode), drift)
                    change = np.abs(moved - rates) / NUDGE
                    total += np.where(np.isfinite(change), change, 0.0)
            self.summed[key] = total
        return float(self.summed[key][i]) + self.reach(i, mode)

    def largest_terms(self, i: int, mode: Array) -> float:
        """About the size of the `terms` of surface i, from all states and the time moved at once.

        0 for plain functions, which need have no values beside the point.
        """
        if self.machine.callbacks is not None:
            return 0.0
        key = mode.tobytes()
        if key not in self.moved:
            signs = np.where(mode == 0.0, 1.0, mode)
            parts = 1.0 + PER_STATE * (np.arange(len(self.x)) % 5)
            with np.errstate(invalid="ignore", over="ignore"):
                rates = []
                for part in (0.0, NUDGE):
                    t, x = self.t * (1.0 + LATER * part), self.x * (1.0 + part * parts)
                    g, gt = self.machine.gradients(t, x, mode)
                    rates.append(_rates(g, self.machine.rhs(t, x, signs, mode), gt))
                change = np.abs(rates[1] - rates[0]) / NUDGE
            self.moved[key] = np.where(np.isfinite(change), change, 0.0)
        return float(self.moved[key][i])

    def speed_terms(self, i: int, mode: Array) -> float:
        """Size of all that the field balances in the rate of surface i (see `field_terms`)."""
        g, gt = self.gradients(mode)
        slopes = np.where(np.isfinite(g[i]), np.abs(g[i]), 0.0)
        return float(slopes @ self.field_terms(tuple(mode)) + abs(gt[i]))

    def field_terms(self, base: Mode) -> Array:
        """Size of the terms of each component of the field: what rounding in it is measured by.

        What every sign makes of it, those of surfaces that are far away included, and what the states and the
        time do: forces in balance leave a component that is rounding of them.
        """
        mode = np.array(base, dtype=float)
        signs = np.where(mode == 0.0, 1.0, mode)
        start = self.rhs(signs, mode)
        total = np.abs(start)
        for j in range(len(mode)):
            signs[j] = -signs[j]
            total = total + np.nan_to_num(np.abs(self.rhs(signs, mode) - start), posinf=0.0)
            signs[j] = -signs[j]
        with np.errstate(invalid="ignore", over="ignore"):
            for t, x in self._nudged():
                change = np.abs(self.machine.rhs(t, x, signs, mode) - start) / NUDGE
                total = total + np.where(np.isfinite(change), change, 0.0)
        return np.nan_to_num(total, posinf=0.0)

    def _nudged(self) -> Iterator[tuple[float, Array]]:
        """(t, x) with each state that is not 0 moved by a part of itself, then the time."""
        for k in np.flatnonzero(self.x):
            x = self.x.copy()
            x[k] *= 1.0 + NUDGE
            yield self.t, x
        if self.t != 0.0:
            yield self.t * (1.0 + NUDGE), self.x

    def probe(self, step: float, mode: Array, lam: Array) -> Probe:
        """`Machine.probe` at this point; many surfaces ask for the same one."""
        key = (step, mode.tobytes(), lam.tobytes())
        if key not in self.probed:
            code, velocity, multipliers, rows = self.machine.probe(self.t, step, self.x, mode, lam)
            self.probed[key] = code, velocity.copy(), multipliers, rows
        return self.probed[key]


def _rates(g: Array, velocity: Array, gt: Array) -> Array:
    """All grad h . f + dh/dt, not a number where one has no value."""
    return np.asarray(np.sum(g * np.where(g == 0.0, 0.0, velocity), axis=1) + gt)
