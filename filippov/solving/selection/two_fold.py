"""Two-folds: points of a surface at which the rates of h along the fields of both sides vanish.

With F+ and F- the velocities of (t, x) on both sides, in the direction of integration, and a, b the rates of
h along them, sliding attracts where a < 0 < b, and moves by (b F+ - a F-) / (b - a). Without the denominator,
that is in a time tau with dt = (b - a) dtau, the rates themselves obey near a two-fold

    d/dtau (a, b) = [[-F-a, F+a], [-F-b, F+b]] (a, b).

The eigenvectors of this linear flow with a b < 0 are the directions in which sliding enters the two-fold, and
leaves it, in finite time. Where a < 0 < b the flow runs as tau does, where b < 0 < a against it. A fold is
visible where the solution beside it leaves the surface: F+a > 0 above, F-b < 0 below.

Sources: Filippov 1988, sections 19 to 22; Teixeira 1990; Jeffrey & Colombo 2009, section 2; Colombo & Jeffrey
2011, section 3; Cristiano, Carvalho, Tonon & Pagano 2018.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point

VISIBLE, INVISIBLE, MIXED = "visible two-fold", "invisible two-fold", "visible-invisible two-fold"
EPS = float(np.finfo(float).eps)
# Of the largest entry: what an entry or an eigenvalue of the linear flow cannot be told from 0 by.
VANISHING = 1e-6
# A derivative is one where half the step gives the same, to this share of the largest.
STEADY = 0.1
# Steps in which derivatives are taken, of the time scale of the point; roundings in the terms of a rate.
DIFFERENCE, ROUNDINGS = 1e-5, 64.0
NEWTON = 4
# Opposite fields, to which a point is an equilibrium.
OPPOSITE = 1e-9


@dataclass(frozen=True)
class Direction:
    """A direction in which sliding enters or leaves a two-fold.

    rate        its eigenvalue: below 0 sliding that attracts enters by it and sliding that repels leaves
    other       the other eigenvalue
    multiplier  the sign of the surface along it
    """

    rate: float
    other: float
    multiplier: float


@dataclass(frozen=True)
class TwoFold:
    """A point next to a two-fold of surface i, and the linear flow there.

    t, x        the point; direction: that of integration
    rates       (a, b)
    fields      F+ and F- without their time, shape (2, n)
    slopes      [[F+a, F-a], [F+b, F-b]]
    noise       rounding of a and b
    still       whether a and b stay as they are where only time passes
    """

    surface: int
    t: float
    x: Array
    direction: float
    rates: Array
    fields: Array
    slopes: Array
    noise: Array
    still: bool

    @property
    def visible(self) -> tuple[bool, bool]:
        """Whether the folds above and below are visible."""
        return bool(self.slopes[0, 0] > 0), bool(self.slopes[1, 1] < 0)

    @property
    def name(self) -> str:
        """The kind of the two-fold."""
        return {2: VISIBLE, 1: MIXED, 0: INVISIBLE}[sum(self.visible)]

    def directions(self) -> list[Direction]:
        """The directions of sliding through the point."""
        (up_a, down_a), (up_b, down_b) = self.slopes
        flow = np.array([[-down_a, up_a], [-down_b, up_b]])
        values, vectors = np.linalg.eig(flow)
        found = []
        for q in (0, 1):
            value, (a, b) = values[q], vectors[:, q]
            if np.iscomplexobj(values) and values[q].imag != 0.0:
                continue
            if abs(value) <= VANISHING * np.max(np.abs(flow)) or not (a * b).real < -VANISHING:
                continue
            a, b = float(a.real), float(b.real)
            found.append(Direction(float(value.real), float(values[1 - q].real), (b + a) / (b - a)))
        return found

    def way(self) -> tuple[float, float]:
        """(times along F+ and F- to the two-fold); those along which sliding gets there, to first order."""
        found, *_ = np.linalg.lstsq(self.slopes, -self.rates, rcond=VANISHING)
        return float(found[0]), float(found[1])

    @property
    def rests(self) -> float | None:
        """The multiplier with which the point is an equilibrium, None where it is none."""
        if not self.still:
            return None
        up, down = self.fields
        sizes = float(np.linalg.norm(up)), float(np.linalg.norm(down))
        if sizes[0] + sizes[1] == 0.0:
            return 0.0
        weight = sizes[1] / (sizes[0] + sizes[1])
        left = np.linalg.norm(weight * up + (1.0 - weight) * down)
        return 2.0 * weight - 1.0 if left <= OPPOSITE * max(sizes) else None

    def velocity(self, multiplier: float) -> Array:
        """The sliding field with a multiplier; reversed where the integration runs backwards."""
        up, down = self.fields
        return np.asarray(0.5 * ((1.0 + multiplier) * up + (1.0 - multiplier) * down))


def two_fold(point: Point, base: Mode, i: int, span: float) -> TwoFold | None:
    """The linear flow of sliding at a point on surface i; None where a fold is of higher order.

    span: a time in which the solution changes, an upper limit of it.
    """
    signs = np.array(base, dtype=float)
    signs = np.where(signs == 0.0, point.guess, signs)
    size = float(np.max(np.abs(point.x), initial=0.0)) + 1e-3

    def at(t: float, x: Array) -> tuple[Array, Array]:
        return side_rates(point, t, x, base, signs, i)

    rates, fields = at(point.t, point.x)
    if not np.all(np.isfinite(rates)) or not np.all(np.isfinite(fields)):
        return None
    speed = float(np.max(np.abs(fields), initial=0.0))
    step = DIFFERENCE * min(span, size / speed if speed > 0.0 else np.inf)
    if not 0.0 < step < np.inf:
        return None

    def along(step: float) -> Array:
        columns = []
        for velocity in fields:
            ahead, _ = at(point.t + point.direction * step, point.x + step * velocity)
            behind, _ = at(point.t - point.direction * step, point.x - step * velocity)
            columns.append((ahead - behind) / (2.0 * step))
        return np.array(columns).T

    slopes = along(step)
    scale = float(np.max(np.abs(slopes)))
    if not np.isfinite(scale) or min(abs(slopes[0, 0]), abs(slopes[1, 1])) <= VANISHING * scale:
        return None
    if np.max(np.abs(along(0.5 * step) - slopes)) > STEADY * scale:
        return None  # rates such as t**3 or t**5, whose difference quotients follow the step
    noise = _noise(point, base, signs, i, fields)
    later, _ = at(point.t + point.direction * step, point.x)
    still = bool(np.max(np.abs(later - rates)) <= VANISHING * scale * step)
    return TwoFold(i, point.t, point.x, point.direction, rates, fields, slopes, noise, still)


def side_rates(point: Point, t: float, x: Array, base: Mode, signs: Array, i: int) -> tuple[Array, Array]:
    """(a, b) and the fields of both sides, in the direction of integration, shape (2, n)."""
    mode = np.array(base, dtype=float)
    mode[i] = 0.0
    x = np.ascontiguousarray(x)
    g, gt = point.machine.gradients(t, x, mode)
    chosen, rates, fields = signs.copy(), [], []
    for side in (1.0, -1.0):
        chosen[i] = side
        fields.append(point.direction * point.machine.rhs(t, x, chosen, mode))
        rates.append(point.machine.rate(i, g, fields[-1]) + point.direction * float(gt[i]))
    return np.array(rates), np.array(fields)


def rate_terms(point: Point, base: Mode, i: int, fields: Array) -> Array:
    """The size of the terms of (a, b), from the fields of both sides."""
    mode = np.array(base, dtype=float)
    mode[i] = 0.0
    g, gt = point.machine.gradients(point.t, point.x, mode)
    return np.asarray(np.abs(g[i]) @ np.where(g[i] == 0.0, 0.0, np.abs(fields)).T + abs(float(gt[i])))


def _noise(point: Point, base: Mode, signs: Array, i: int, fields: Array) -> Array:
    """Rounding of the rates: what they move by when every state and the time move by a rounding."""
    terms = rate_terms(point, base, i, fields)
    moved = np.zeros(2)
    for j in range(-1, len(point.x)):
        size = abs(point.t) if j < 0 else abs(float(point.x[j]))
        if size == 0.0:
            continue
        x, t = point.x.copy(), point.t
        reach = DIFFERENCE * size
        both = []
        for sign in (1.0, -1.0):
            if j < 0:
                t = point.t + sign * reach
            else:
                x[j] = point.x[j] + sign * reach
            both.append(side_rates(point, t, x, base, signs, i)[0])
        moved += np.abs(both[0] - both[1]) / (2.0 * DIFFERENCE)
    return np.asarray(ROUNDINGS * EPS * (terms + moved))


def led_to(point: Point, base: Mode, fold: TwoFold, span: float) -> TwoFold | None:
    """The two-fold itself, by Newton's method along F+ and F-; None where it is not reached."""
    first = float(np.max(np.abs(fold.rates)))
    for _ in range(NEWTON):
        above, below = fold.way()
        t = fold.t + fold.direction * (above + below)
        x = on_surface(point, base, fold.surface, t, fold.x + above * fold.fields[0] + below * fold.fields[1])
        moved = two_fold(replace(point, t=t, x=x), base, fold.surface, span)
        if moved is None:
            return None
        fold = moved
        if np.all(np.abs(fold.rates) <= fold.noise):
            return fold
    return fold if float(np.max(np.abs(fold.rates))) <= 1e-6 * first else None


def on_surface(point: Point, base: Mode, i: int, t: float, x: Array) -> Array:
    """The state put back on surface i along its gradient."""
    mode = np.array(base, dtype=float)
    mode[i] = 0.0
    for _ in range(4):
        x = np.ascontiguousarray(x)
        h = float(point.machine.guards(t, x, mode)[i])
        g, _ = point.machine.gradients(t, x, mode)
        size = float(g[i] @ g[i])
        if h == 0.0 or not 0.0 < size < np.inf:
            break
        x = x - (h / size) * g[i]
    return np.ascontiguousarray(x)
