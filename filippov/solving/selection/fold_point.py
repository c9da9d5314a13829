"""A run at a two-fold: whether it is one, what can follow, and the first moment of what follows.

Sliding that comes to the end of a multiplier's set close to a two-fold leaves by rounding on either side, or
passes through; which of them says nothing. The linear flow of sliding there decides whether it is drawn into
the two-fold (`filippov.solving.selection.two_fold`), on the scale of the slide: with sigma the difference
of the rates over the largest one since the slide began, and rho how fast a deviation from the direction of
entry grows while that difference falls, a deviation at the beginning of sigma**(1 + max(rho, 0)) would lead
into it. Up to RESOLUTION this counts as meeting it, whatever the tolerance of the run. So that sigma does not
depend on the tolerance either, the slide is followed once more (`filippov.solving.selection.slide_again`)
where it comes close.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.tables import codes
from filippov.solving.selection.ambiguity import name_point, point_of
from filippov.solving.selection.corner import can_slide
from filippov.solving.selection.departure import NON_LIPSCHITZ, departures, leave, straight
from filippov.solving.selection.modes import Successor, successors
from filippov.solving.selection.slide_again import Way, slide_again
from filippov.solving.selection.two_fold import (
    EPS,
    Direction,
    TwoFold,
    led_to,
    on_surface,
    rate_terms,
    side_rates,
    two_fold,
)
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point
from filippov.solving.state.run import Run

# Of the scale of the slide: a deviation that counts as none.
RESOLUTION = 1e-4
# Difference of the rates over the largest of the slide: closer than this the linear flow is asked.
NEAR = 0.1
# A two-fold lies ahead where it would be reached in as much less time than the slide has lasted, or in this
# part of that time. Rates that fade away exponentially, and vanish nowhere, are as small as rounding
# before it is as small a part.
AHEAD, SOON = 30.0, 0.02
# A tangency is at most so far from where the rate vanishes, of the time of the run.
TURN = 1e-2
# Of the terms of a rate, far above any rounding of it: a point where a rate is more is no two-fold.
CLEAR = 1e-4
# First moment of what leaves a two-fold along the surface, of the time scale of the solution.
MOMENT = 1e-5


def followers(
    run: Run, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None
) -> tuple[str, tuple[Successor, ...], Point]:
    """Name of the point, all that can follow on the surfaces reached, and the point.

    base, triggered: as in `filippov.solving.selection.modes.successors`. The run is moved onto a two-fold
    into which its slide leads.
    """
    _back_to_tangency(run, triggered)
    base, reached, triggered = _beyond_relays(run, base, reached, triggered)
    point = point_of(run)
    if (fold := _at_fold(run, point, base, reached, triggered, behind=False)) is not None:
        return fold
    found = successors(point, base, reached, triggered)
    if left := departures(run, point, base, reached, found):
        return NON_LIPSCHITZ if len(left) > 1 else "", left, point_of(run)
    name, candidates = name_point(point, reached, found)
    # A step that went past a two-fold ends where nothing follows.
    lost = None if candidates else _at_fold(run, point, base, reached, triggered, behind=True)
    return (name, candidates, point) if lost is None else lost


def _beyond_relays(
    run: Run, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None
) -> tuple[Mode, Sequence[int], Sequence[int] | None]:
    """The mode, and what is left to decide, after relays with hysteresis that came to the edge of their band.

    s is memory: it changes at h = -s width whatever the rate of h is afterwards; only the others are asked.
    """
    relays = [i for i in reached if run.machine.widths[i] > 0.0]
    if not relays:
        return base, reached, triggered
    turned = [i for i in relays if run.trigger[i] == codes.ROOT]
    base = tuple(-sign if i in turned else sign for i, sign in enumerate(base))
    # What a relay acts on need not go on sliding: all that is slid on is asked again.
    again = None if turned else [i for i in triggered or () if i not in relays]
    return base, [i for i in reached if i not in relays], again


def _at_fold(
    run: Run, point: Point, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None, behind: bool
) -> tuple[str, tuple[Successor, ...], Point] | None:
    """What can follow at a two-fold, or where a slide came close to one; None elsewhere."""
    fold = _fold(run, point, base, reached, triggered, behind)
    if isinstance(fold, Way):
        return "", (_exit(point, base, fold),), point
    found = [] if fold is None else _continuations(point, base, fold)
    return (fold.name, tuple(found), point) if fold is not None and found else None


def _back_to_tangency(run: Run, triggered: Sequence[int] | None) -> None:
    """Backwards in time, move a run that grazes a surface to where its rate vanishes.

    There a slide may have been left; the tangency is known only as well as the integration is accurate.
    """
    i = triggered[0] if triggered is not None and len(triggered) == 1 else -1
    if i < 0 or run.direction > 0 or run.mode[i] == 0 or run.trigger[i] != codes.TOUCH:
        return
    point, base = point_of(run), run.signs
    if not can_slide(point, i):
        return
    signs = np.where(run.mode == 0.0, run.lam, run.mode)
    elapsed = abs(run.t - float(run.clock.t_start))
    side, step = 0 if base[i] > 0 else 1, 0.1 * MOMENT * elapsed
    t, x = run.t, run.x.copy()
    for _ in range(2):
        rates, fields = side_rates(point, t, x, base, signs, i)
        ahead, _ = side_rates(point, t - step, x + step * fields[side], base, signs, i)
        change = float(ahead[side] - rates[side])
        wait = -float(rates[side]) * step / change if change != 0.0 else np.inf
        if not abs(wait) <= TURN * elapsed:
            return
        t, x = t - wait, on_surface(point, base, i, t - wait, x + wait * fields[side])
    _go_to(run, t, x)


def _fold(
    run: Run, point: Point, base: Mode, reached: Sequence[int], triggered: Sequence[int] | None, behind: bool
) -> TwoFold | Way | None:
    """The two-fold of the only surface on which something happens, where the run is at one.

    The way out of a slide where that comes close to a two-fold and leaves beside it.
    """
    machine = run.machine
    active = [i for i in reached if triggered is None or base[i] != 0 or i in triggered]
    if len(active) != 1 or not can_slide(point, active[0]) or machine.contacts[active[0]]:
        return None
    i = active[0]
    group = [j for j in range(machine.m) if machine.component[j] == machine.component[i] and j != i]
    ends = machine.radii(run.t, run.x)[i]
    if any(base[j] == 0 for j in group) or not np.allclose(ends, (-1.0, 1.0), 1e-12):
        return None
    if not machine.affine and 0 in [base[j] for j in range(machine.m) if j != i]:
        return None
    if triggered is not None and base[i] == 0 and run.trigger[i] in (codes.UPPER, codes.LOWER):
        found = _left(run, point, base, i, behind)
        if found is not None:
            return found
    if _clear(point, base, i):
        return None
    fold = two_fold(point, base, i, abs(float(run.clock.t_end) - run.t) or np.inf)
    return None if fold is None or np.any(np.abs(fold.rates) > fold.noise) else fold


def _clear(point: Point, base: Mode, i: int) -> bool:
    """Whether a rate of surface i is too large for a two-fold."""
    signs = np.where(np.array(base) == 0, point.guess, base)
    rates, fields = side_rates(point, point.t, point.x, base, signs, i)
    mode = np.array(base, dtype=float)
    mode[i] = 0.0
    terms = np.maximum(rate_terms(point, base, i, fields), point.largest_terms(i, mode))
    return bool(np.any(np.abs(rates) > CLEAR * terms))


def _left(run: Run, point: Point, base: Mode, i: int, behind: bool) -> TwoFold | Way | None:
    """The end of a slide that comes close to a two-fold, to which the run is moved; None elsewhere.

    behind: the run may have gone past it
    """
    lasted = _slid(run, i)
    fold = two_fold(point, base, i, lasted) if lasted > 0.0 else None
    if fold is None or not (_distance(run, fold) <= NEAR if behind else _near(run, fold, lasted)):
        return None
    way = None
    attracts = -1.0 if run.order[i] < 0 else 1.0
    if sum(sign == 0 for sign in base) == 1:
        way = slide_again(run, point, base, i, attracts, sum(map(abs, fold.way())))
    near = _distance(run, fold) if way is None else way.near
    if not (way is not None and way.side == 0) and not _meets(fold, near, attracts):
        if way is not None:
            _go_to(run, way.t, way.x)
        return way
    if way is not None:
        fold = two_fold(replace(point, t=way.t, x=way.x), base, i, lasted) or fold
    there = led_to(point, base, fold, lasted)
    if there is not None:
        _go_to(run, there.t, there.x)
    return there


def funnelled(run: Run, behind: bool = False) -> list[int]:
    """The sliding surface towards whose two-fold the steps of the run shrink, marked as left.

    behind: the run may have gone past it
    """
    for i in [i for i, sign in enumerate(run.signs) if sign == 0 and run.machine.contacts[i] == 0]:
        lasted = _slid(run, i)
        fold = two_fold(point_of(run), run.signs, i, lasted) if lasted > 0.0 else None
        if fold is None:
            continue
        if _distance(run, fold) <= NEAR if behind else _near(run, fold, lasted):
            run.trigger[:] = 0
            run.trigger[i] = codes.UPPER
            return [i]
    return []


def _slid(run: Run, i: int) -> float:
    """How long the run has been sliding on surface i."""
    for event in reversed(run.events):
        if event.after[i] == 0 != event.before[i]:
            return abs(run.t - event.t)
    return abs(run.t - float(run.clock.t_start))


def _distance(run: Run, fold: TwoFold) -> float:
    """The rates and their difference over the largest difference of the slide."""
    widest = float(run.zeno[fold.surface].widest)
    a, b = fold.rates.tolist()
    return max(abs(a), abs(b), abs(b - a)) / widest if widest > 0.0 else np.inf


def _near(run: Run, fold: TwoFold, lasted: float) -> bool:
    """Whether a slide ends where rounding may decide how: close to a two-fold that lies ahead."""
    near = _distance(run, fold)
    above, below = fold.way()
    # Rates that fade away together never vanish.
    return near <= NEAR and abs(above) + abs(below) <= max(AHEAD * near, SOON) * lasted


def _meets(fold: TwoFold, near: float, attracts: float) -> bool:
    """Whether a slide that ends so near to the two-fold meets it, up to RESOLUTION."""
    entries = [d for d in fold.directions() if attracts * d.rate < 0.0]
    growths = [attracts * d.other / abs(d.rate) for d in entries]
    return any(near ** (1.0 + max(growth, 0.0)) <= RESOLUTION for growth in growths)


def _exit(point: Point, base: Mode, way: Way) -> Successor:
    """Leaving the surface at the end of a slide, tangentially."""
    i = way.surface
    mode = (*base[:i], way.side, *base[i + 1 :])
    signs = np.array(mode, dtype=float)
    field = point.machine.rhs(way.t, way.x, signs, signs)
    order = tuple(2 if j == i else 0 for j in range(len(base)))
    return Successor(mode, order, (0.0,) * len(base), tuple(field.tolist()), 0.0)


def _continuations(point: Point, base: Mode, fold: TwoFold) -> list[Successor]:
    """What can follow at a two-fold: the visible sides, and sliding in every direction that leaves it.

    Where sliding leaves it repelling, it may be left at once; on a side whose fold is invisible that is so
    only by way of it (order -2).
    """
    i, sense = fold.surface, fold.direction
    directions = fold.directions()
    repels = any(d.rate < 0.0 for d in directions)

    def successor(sign: int, order: int, multiplier: float, velocity: Array) -> Successor:
        mode = (*base[:i], sign, *base[i + 1 :])
        orders = tuple(order if j == i else 0 for j in range(len(base)))
        lam = [float(v) if m == 0 else 0.0 for v, m in zip(point.guess, mode, strict=True)]
        lam[i] = multiplier
        field = tuple((sense * velocity).tolist())
        return Successor(mode, orders, tuple(lam), field, 0.0)

    found = []
    for side, visible, velocity in zip((1, -1), fold.visible, fold.fields, strict=True):
        if visible or repels:
            found.append(successor(side, 2 if visible else -2, 0.0, velocity))
    for d in directions:
        order = 3 if d.rate > 0.0 else -3
        found.append(successor(0, order, d.multiplier, fold.velocity(d.multiplier)))
    if fold.rests is not None:
        found.append(successor(0, 0, fold.rests, np.zeros(len(point.x))))
    return found


def _go_to(run: Run, t: float, x: Array) -> None:
    """Put the run on a point next to it, with its dense output up to there and no further."""
    end = float(run.clock.t_end)
    t = min(t, end) if run.direction > 0 else max(t, end)
    if (t - run.t) * run.direction > 0.0:
        straight(run, t, x, np.zeros(len(x)))
    else:
        run.cut(t)
    run.clock.t = t
    run.x[:] = x


def depart(run: Run, chosen: Successor) -> None:
    """Follow what was chosen for a first moment, where the rates are 0: at a two-fold, or off a kink."""
    for i, (sign, order) in enumerate(zip(chosen.mode, chosen.order, strict=True)):
        if run.machine.roles[i] == "kink":
            if order < 0:
                leave(run, point_of(run), chosen, i)
        elif abs(order) == 3 if sign == 0 else order < 0:
            _depart(run, chosen, i)


def _depart(run: Run, chosen: Successor, i: int) -> None:
    point = point_of(run)
    left = abs(float(run.clock.t_end) - run.t)
    size, speed = float(np.max(np.abs(run.x), initial=0.0)) + 1e-3, float(np.max(np.abs(chosen.field)))
    span = min(left, _slid(run, i) or size / max(speed, 1e-300))
    fold = two_fold(point, chosen.mode, i, span or np.inf)
    direction = None if fold is None else _direction(fold, chosen, i)
    if fold is None or direction is None:
        return
    moment = min(max(MOMENT * span, 1e4 * EPS * abs(run.t)), left)
    t = run.t + run.direction * moment
    multiplier, mode = direction.multiplier, run.mode.copy()
    mode[i] = 0.0
    first = moment * fold.velocity(multiplier)
    lam = run.lam.copy()
    lam[i] = multiplier
    x = on_surface(point, chosen.mode, i, t, run.x + first)
    code, velocity, multipliers, _ = run.machine.local.probe(t, 0.0, x, mode, lam)
    if code != 0:
        return
    bend = 0.5 * (moment * run.direction * velocity - first)
    x = on_surface(point, chosen.mode, i, t, run.x + first + bend)
    straight(run, t, x, bend)
    run.taken = t, x
    if chosen.mode[i] == 0:
        run.lam[:] = multipliers
        run.order[i] = -1 if direction.rate < 0.0 else 0
    else:
        run.order[i] = 1


def _direction(fold: TwoFold, chosen: Successor, i: int) -> Direction | None:
    """The direction of sliding in which a chosen mode leaves a two-fold."""
    directions = fold.directions()
    if chosen.mode[i] == 0:
        wanted = [d for d in directions if (d.rate > 0.0) == (chosen.order[i] > 0)]
        return min(wanted, key=lambda d: abs(d.multiplier - chosen.multipliers[i]), default=None)
    return min((d for d in directions if d.rate < 0.0), key=lambda d: abs(d.rate), default=None)
