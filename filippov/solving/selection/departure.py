"""Solutions that leave a surface along which the field runs, where the field is not Lipschitz.

On a kink h = 0 with dh/dt = 0 all along the solution, that stays. Where beside the surface dh/dt grows away
from it as c |h|^p with p < 1, others leave at any time, as |h| = (c (1 - p) t)^(1/(1 - p)): x' = |x|^(2/3) at
x = 0 (Peano 1890; Filippov 1988, section 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.selection.modes import Successor
from filippov.solving.selection.two_fold import on_surface
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point
from filippov.solving.state.run import Run, guard_terms

NON_LIPSCHITZ = "departure where the field is not Lipschitz"
EPS = float(np.finfo(float).eps)
# Distances from the surface at which the rate is read, on the scale of the state; what agrees with a power.
DISTANCES, STEADY = (1e-6, 1e-8, 1e-10), 0.02
# Powers closer to 1 are not told from it.
LARGEST = 0.96
# Of its terms: a rate along the surface that is rounding. Parts of the trial step at which it is asked for.
ROUNDING, PARTS = 64 * EPS, (0.0, 1 / 64, 1 / 8, 1.0)
# |h| after the first moment of a departure, on the scale of the state: where h is one state, and elsewhere.
FIRST, FAR = 1e-18, 1e-8
# Steps of that moment; |h| from where on it is followed with the ordinary tolerance.
STEPS, CLEAR = 16, 1e-2


class Law(NamedTuple):
    """dh/dt = side c |h|^p beside surface i."""

    surface: int
    side: int
    c: float
    p: float

    def moment(self, distance: float) -> float:
        """The time in which the surface is left by a distance."""
        return float(distance ** (1.0 - self.p) / (self.c * (1.0 - self.p)))


def departures(
    run: Run, point: Point, base: Mode, reached: Sequence[int], found: Sequence[Successor]
) -> tuple[Successor, ...]:
    """To stay on a kink, and to leave it where that is possible; () where no field is such.

    The run is moved onto the kink. Where both sides lead onto it, the one candidate is to stay.
    """
    if not point.machine.constants["NON_LIPSCHITZ"]:
        return ()
    kinks = [i for i in reached if point.machine.roles[i] == "kink"]
    others = {tuple(v for i, v in enumerate(c.mode) if i not in kinks) for c in found}
    if len(others) > 1 or (not found and any(i not in kinks for i in reached)):
        return ()
    first = found[0] if found else Successor(base, (0,) * len(base), (0.0,) * len(base), (), 0.0)
    for i in kinks:
        mode = _with(first.mode, i, base[i])
        here = on_surface(point, mode, i, point.t, point.x)
        laws = {side: _law(run, point, mode, here, i, side) for side in (1, -1)}
        off = [side for side, law in laws.items() if law is not None and law.c > 0.0]
        pulled = all(law is not None and law.c < 0.0 for law in laws.values())
        known = [law for law in laws.values() if law is not None]
        if not (off or pulled) or not _stays(point, mode, here, i, known):
            continue
        still = _still(point, mode, here, i)
        if pulled and still:
            continue
        run.x[:] = here
        order = tuple(0 if j == i else k for j, k in enumerate(first.order))
        along = first.along if still else (*first.along, i)
        field = tuple(_field(point, point.t, here, mode).tolist())
        stay = replace(first, mode=mode, order=order, field=field, along=along)
        left = tuple(-1 if j == i else k for j, k in enumerate(order))
        return (stay, *(replace(stay, mode=_with(mode, i, s), order=left, along=first.along) for s in off))
    return ()


def leave(run: Run, point: Point, chosen: Successor, i: int) -> None:
    """Follow a departure for a first moment by its law, and then |h| relative to itself.

    Of a surface whose h is the difference of larger terms the moment is as long as their rounding asks for.
    """
    mode, side, scale = chosen.mode, chosen.mode[i], _scale(run)
    law = _law(run, point, mode, run.x, i, side)
    if law is None or law.c <= 0.0:
        return
    g, gt = point.gradients(np.array(mode, dtype=float))
    terms = float(guard_terms(g, gt, run.t, run.x)[i])
    distance = FIRST * scale if _still(point, mode, run.x, i) else FAR * max(scale, terms)
    moment = min(law.moment(distance), abs(float(run.clock.t_end) - run.t))
    begun, t, x, power = run.t, run.t, run.x.copy(), 0.0
    for _ in range(STEPS):
        # |h|^(1 - p) grows with the rate (1 - p) c, of which c changes along the surface.
        part = run.direction * moment / STEPS
        middle = x + 0.5 * part * _field(point, t, x, mode)
        middle = on_surface(point, mode, i, t + 0.5 * part, middle)
        power += abs(part) * (1.0 - law.p) * _strength(run, point, t + 0.5 * part, middle, mode, law)
        x = on_surface(point, mode, i, t + part, x + part * _field(point, t + 0.5 * part, middle, mode))
        t += part
    way = run.direction * _field(point, t, _beside(run, point, t, x, mode, law), mode)
    way -= run.direction * _field(point, t, x, mode)
    slope = point.machine.gradients(t, x, np.array(mode, dtype=float))[0][i]
    height = power ** (1.0 / (1.0 - law.p))
    straight(run, t, x + height * way / abs(float(slope @ way)), np.zeros(len(x)))
    run.taken, run.order[i] = (t, run.x.copy()), 0
    run.clock.relative = float(i) + 1.0
    run.clock.step = 0.5 * moment
    run.clock.fast_from, run.clock.fast_span = begun, law.moment(CLEAR * scale)
    run.clock.start_noise = 16 * EPS * terms * law.c * height ** (law.p - 1.0) + 1e-300


def straight(run: Run, t: float, x: Array, bend: Array) -> None:
    """Take the run to x at t; the dense output up to there is a straight line, and a bend."""
    if run.options.dense_output and t != run.t:
        coef = np.zeros((1, *run.coef.shape[1:]))
        coef[0, 0], coef[0, 1], coef[0, 2] = run.x, x - run.x - bend, bend
        run.steps.append((np.array([[run.t, t - run.t]]), coef))
    run.clock.t = t
    run.x[:] = x


def _with(mode: Mode, i: int, sign: int) -> Mode:
    return (*mode[:i], sign, *mode[i + 1 :])


def _scale(run: Run) -> float:
    """The size of states; 1 where all are 0."""
    size = max(float(np.max(np.abs(x), initial=0.0)) for x in (run.x, run.begun))
    return size or 1.0


def _field(point: Point, t: float, x: Array, mode: Mode) -> Array:
    signs = np.array(mode, dtype=float)
    _, velocity, _, _ = point.machine.probe(t, 0.0, np.ascontiguousarray(x), signs, point.guess)
    return velocity.copy()


def _rate(point: Point, t: float, x: Array, i: int, mode: Mode) -> tuple[float, float]:
    """dh/dt in the direction of integration, and the size of its terms."""
    g, gt = point.machine.gradients(t, x, np.array(mode, dtype=float))
    velocity = _field(point, t, x, mode)
    terms = np.append(g[i] * velocity, gt[i])
    return point.direction * float(np.sum(terms)), float(np.sum(np.abs(terms)))


def _law(run: Run, point: Point, mode: Mode, here: Array, i: int, side: int) -> Law | None:
    """The power law beside the surface on one side, None where there is none below 1."""
    mode, scale = _with(mode, i, side), _scale(run)
    g = point.machine.gradients(point.t, here, np.array(mode, dtype=float))[0][i]
    if not np.all(np.isfinite(g)) or not np.any(g):
        return None
    rates: list[float] = []
    for part in DISTANCES:
        rate, terms = _rate(point, point.t, here + side * part * scale * g / float(g @ g), i, mode)
        if not abs(rate) > 1e2 * EPS * terms or rate * (rates or [rate])[0] < 0.0:
            return None
        rates.append(rate)
    powers = np.diff(np.log(np.abs(rates))) / np.diff(np.log(DISTANCES))
    if not powers[1] <= LARGEST or abs(powers[1] - powers[0]) > STEADY:
        return None
    p = float(powers[1])
    return Law(i, side, side * rates[1] / (DISTANCES[1] * scale) ** p, p) if p > STEADY else None


def _beside(run: Run, point: Point, t: float, x: Array, mode: Mode, law: Law) -> Array:
    """A point off the surface, at a distance at which the law is read."""
    g = point.machine.gradients(t, x, np.array(mode, dtype=float))[0][law.surface]
    return np.ascontiguousarray(x + law.side * DISTANCES[1] * _scale(run) * g / float(g @ g))


def _strength(run: Run, point: Point, t: float, x: Array, mode: Mode, law: Law) -> float:
    """c of the law, at another point of the surface."""
    rate, _ = _rate(point, t, _beside(run, point, t, x, mode, law), law.surface, mode)
    return float(abs(rate) / (DISTANCES[1] * _scale(run)) ** law.p)


def _stays(point: Point, mode: Mode, here: Array, i: int, laws: Sequence[Law]) -> bool:
    """Whether the solution that stays on the surface is one: dh/dt is 0 along it, but for rounding in h."""
    field = _field(point, point.t, here, mode)
    for part in PARTS:
        t, x = point.t + part * point.step, here + part * point.step * field
        x = on_surface(point, mode, i, t, x)
        rate, terms = _rate(point, t, x, i, mode)
        g, gt = point.machine.gradients(t, x, np.array(mode, dtype=float))
        off = ROUNDING * float(guard_terms(g, gt, t, x)[i])
        if not abs(rate) <= ROUNDING * terms + max(abs(law.c) * off**law.p for law in laws):
            return False
    return True


def _still(point: Point, mode: Mode, here: Array, i: int) -> bool:
    """Whether nothing moves in h along the solution that stays, so that rounding leaves it 0."""
    field = _field(point, point.t, here, mode)
    ahead = [(point.t + part * point.step, here + part * point.step * field) for part in PARTS]
    return not any(_rate(point, t, x, i, mode)[1] for t, x in ahead)
