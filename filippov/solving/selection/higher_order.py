"""Sliding of higher order as a mode of a run: when it begins, which system follows it, how it is left.

A solution gets onto h = h' = 0 where its cycles pile up, where it arrives without any (overdamped
super-twisting), or where it starts there. From then on the run goes on with the machine of a `reduction`; its
own one comes back where a multiplier leaves its set, or a jump of the state throws the solution off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import EventKind
from filippov.kernel.tables import codes
from filippov.solving.selection.ambiguity import point_of
from filippov.solving.selection.faint_cycles import fades, noise
from filippov.solving.selection.modes import Successor, leading_off
from filippov.solving.state.events import Mode
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options
from filippov.solving.state.run import Run, guard_terms, near_within

if TYPE_CHECKING:
    from sympy import Symbol

    from filippov.model.reduction import Reduction

# A guard that is 0 at the projected state, in roundings of its terms.
ON = 1e4
# Beyond its set by less, a multiplier is in it.
INSIDE = 1e-9
# Of the terms of a rate: more than its rounding.
CLEAR = 1e-12
# Of the terms of a rate: what a sign does to it, clear of what is no zero but by rounding of the state.
ACTS = 1e-6
# Of the terms of a rate: what rates at both signs may differ by where the sign does not act.
NO_EFFECT = 1e-15
# Depth of a cycle that the run does not know, in tolerances of h, or in roundings where it is followed down
# to these; and its length in spacings of t, and in the accuracy of the ends of a cycle.
FAINT, ROUNDED, INSTANT, UNSURE = 40.0, 1e2, 1e5, 4e2
# Of a cycle, what is left of it where h cannot be told from 0 any more.
TOUCHED = 1e-3
# By how much the speed has come down in one approach where the solution has arrived.
CAME_DOWN = 1e-3
# Events that are looked back at.
RECENT = 64
# Of the time of the run: how long ago a slide ended that has led to where the run is.
MOMENT = 1e-3
# Of the speed at which a cycle was not faint: none slower by less is any fainter.
SLOWER = 0.97
NOTE, UNSETTLED = "sliding of order", "the solution does not settle there"
PLAIN = (
    "the field is a plain function, and sliding where h and dh/dt are both 0, as under super-twisting "
    "control, takes its derivatives. Write it as expressions: System({x: y - k1*sqrt(abs(x))*sign(x), y: "
    "-k2*sign(x)})"
)


@dataclass(frozen=True)
class Begun:
    """Sliding of higher order that begins: mode, multipliers and note for its events."""

    mode: Mode
    multipliers: Array
    note: str


@dataclass(frozen=True)
class Left:
    """Sliding of higher order that is left: the mode after, how often its guards vanish, what slides on."""

    mode: Mode
    order: tuple[int, ...]
    remaining: tuple[int, ...]


class HigherOrder:
    """What a run knows of its sliding of higher order; `active` is None while there is none."""

    def __init__(self, run: Run) -> None:
        self.run, self.plain = run, run.machine
        self.start = run.t, run.x.copy()
        self.active: Reduction | None = None
        self.asked: dict[int, float] = {}
        self.rates: dict[tuple[int, float, Mode], float] = {}
        # A root of |h| in the rate of h: only what is small beside |h| itself leaves the solution as it is.
        non_lipschitz = run.machine.non_lipschitz
        if non_lipschitz is not None:
            run.clock.relative = -float(non_lipschitz + 1)
            run.clock.fast_from = run.t
            run.clock.fast_span = abs(run.clock.t_end - run.t)

    # -- beginning -------------------------------------------------------------------------------------

    def begin(
        self, surfaces: Sequence[int], slack: Array | None, mode: Array | None = None, alone: bool = False
    ) -> Begun | str:
        """Slide on these surfaces and on what is coupled to them, or say why that cannot be.

        slack: how far each component may be moved; None for as far as a faint cycle. alone: only where no
        mode leads off these surfaces.
        """
        run, plain = self.run, self.plain
        if run.direction < 0:
            return "backwards in time it is not determined"
        base = (run.mode if mode is None else mode).copy()
        if plain.system.symbolic is None:
            return PLAIN
        wanted, x = {i for i in surfaces if _slides(plain, i)}, run.x
        if not wanted:
            return "no switching surface takes part"
        for _ in range(plain.m + 1):
            groups = {plain.component[i] for i in wanted}
            zero = {*wanted, *(i for i in range(plain.m) if base[i] == 0 and plain.component[i] in groups)}
            kinks = {i for i in surfaces if plain.roles[i] == "kink"}
            found, x = self._reduced(base, zero, kinks)
            if not isinstance(found, str):
                zero, kinks = set(found.zero), set(found.kinks)
            near = self._near(base, {*zero, *kinks}, x, slack if alone else None)
            more = {i for i in near if _slides(plain, i)} - zero
            folds = {i for i in near if plain.roles[i] == "kink"} - kinks
            if isinstance(found, str):
                # A rate may depend on all that the state lies on.
                if not folds:
                    return found
            elif not more and not folds:
                leads = alone and self._leads_off(base, found, x)
                return "other modes follow" if leads else self._taken(found, base, x, slack)
            wanted |= more
            surfaces = [*surfaces, *folds]
        return "the surfaces that take part do not come to an end"

    def _reduced(self, base: Array, zero: set[int], kinks: set[int]) -> tuple[Reduction | str, Array]:
        from filippov.model.reduction import reduction

        run = self.run
        at = self._values(base, run.x)
        found = reduction(self.plain.system, sorted(zero), sorted(kinks), at, self.plain.sliding)
        if isinstance(found, str):
            return found, run.x
        if found.order < 2 and not found.kinks:
            return "their signs act on the rates themselves", run.x
        along = None
        if len(found.pivots) == 1:
            # A cycle moves the state to and fro along what its sign does.
            sides = [np.where(np.arange(self.plain.m) == found.pivots[0], side, base) for side in (1.0, -1.0)]
            along = np.subtract(*(self.plain.rhs(run.t, run.x, np.where(s, s, 1.0), base) for s in sides))
        return found, found.projected(run.t, run.x, self._parameters(), along)

    def _taken(self, found: Reduction, base: Array, x: Array, slack: Array | None) -> Begun | str:
        """Take up the mode of a reduction, if its multipliers are in their sets."""
        run, plain = self.run, self.plain
        machine = Machine(found.system, plain.method, plain.values, plain.events, plain.sliding)
        if plain.callbacks is not None:
            machine.callbacks, machine.context = plain.callbacks, plain.context
        mode = base.copy()
        mode[list(found.zero)], mode[list(found.kinks)] = 0.0, found.sides
        code, velocity, lam, _ = machine.probe(run.t, 0.0, x, mode, np.zeros(plain.m))
        if code != 0 or not np.all(np.isfinite(velocity)) or not np.all(np.isfinite(lam)):
            return "no multipliers hold the solution there"
        radii = machine.radii(run.t, x)
        for i in found.pivots:
            low, high = radii[i]
            if not low - INSIDE <= lam[i] <= high + INSIDE:
                return f"the sign of {plain.surfaces[i].name!r} would have to be {lam[i]:.6g}"
        pull = self._pull(machine, found, mode, x)
        if pull <= 0.0 or (slack is None and not self._is_faint(machine, found, mode, x, pull)):
            return UNSETTLED if pull > 0.0 else "the signs push off the surfaces"
        if slack is not None and np.any(np.abs(x - run.x) > slack):
            return "the state is not close enough to it"
        self.active = found
        run.attach(machine)
        run.x[:] = x
        mode_after = tuple(int(v) for v in mode)
        run.put(mode_after, (0,) * plain.m, tuple(lam.tolist()))
        run.clock.step = 0.0
        run.zeno.array[:] = 0.0
        return Begun(mode_after, found.multipliers(lam), f"{NOTE} {found.order}")

    def _leads_off(self, base: Array, found: Reduction, x: Array) -> bool:
        """Whether a mode leads off the surfaces of a reduction."""
        run = self.run
        before, run.x[:] = run.x.copy(), x
        reached = sorted({*found.zero, *found.kinks})
        point, values = point_of(run), self._parameters()

        def stays(field: Array) -> bool:
            step = point.step * field
            off = found.projected(run.t + point.step, x + step, values) - x - step
            return bool(np.max(np.abs(off)) <= ACTS * np.max(np.abs(step)))

        others = leading_off(point, tuple(int(sign) for sign in base), reached, stays)
        run.x[:] = before
        return bool(others)

    def _pull(self, machine: Machine, found: Reduction, mode: Array, x: Array) -> float:
        """How strongly the weakest sign pulls back onto its surface; negative where one pushes off."""
        run, weakest = self.run, np.inf
        g, gt = machine.gradients(run.t, x, mode)
        signs = np.where(mode == 0.0, 0.0, mode)
        for i in found.pivots:
            if len(found.pivots) > 1 and found.orders[found.zero.index(i)] == 1:
                continue
            rates = []
            for side in (1.0, -1.0):
                signs[i] = side
                velocity = machine.rhs(run.t, x, np.where(signs == 0.0, 1.0, signs), mode)
                for j, _, _ in found.ties:
                    # The push that keeps the constraint of a tied surface is none of the solution's.
                    velocity = velocity + self._push(machine, j, x, mode)
                rates.append(float(gt[i]) + machine.rate(i, g, velocity))
            signs[i] = 0.0
            weakest = min(weakest, max(-rates[0], 0.0), max(rates[1], 0.0)) if rates[0] < rates[1] else -1.0
        return float(weakest)

    def _push(self, machine: Machine, j: int, x: Array, mode: Array) -> Array:
        g, _ = machine.gradients(self.run.t, x, mode)
        return np.asarray(g[j])

    def _is_faint(self, machine: Machine, found: Reduction, mode: Array, x: Array, pull: float) -> bool:
        """Whether what is left of the derivatives is gone within a cycle no deeper than h's tolerance."""
        run = self.run
        away = np.abs(machine.guards(run.t, run.x, mode))
        g, gt = self.plain.gradients(run.t, run.x, mode)
        # A root that is 0 has no slope; the others are known without it.
        g = np.where(np.isfinite(g), g, 0.0)
        terms = np.abs(g) @ np.abs(x) + np.abs(gt * run.t)
        known = run.options.rtol * terms + np.abs(g) @ run.atol
        instant = float(INSTANT * np.finfo(float).eps * abs(run.t))
        if run.clock.relative < 0.0:
            cycle = max(abs(run.t - run.clock.fast_from), run.clock.fast_span)
            instant = max(instant, UNSURE * run.options.rtol * cycle)
            if np.any(run.trigger[list(found.zero)] == codes.TOUCH):
                instant = max(instant, TOUCHED * cycle)
            known = ROUNDED * np.finfo(float).eps * terms
        for i, order in zip(found.zero, found.orders, strict=True):
            if order < 2 or i not in found.pivots:
                continue
            wait = away[i] / pull
            if pull * wait**order > FAINT * known[i] and wait > instant:
                return False
        return True

    def idle(self, candidates: Sequence[Successor]) -> Begun | str:
        """Begin where the only mode that follows slides on surfaces whose rates no sign acts on."""
        run = self.run
        if len(candidates) != 1 or self.active is not None:
            return "other modes follow"
        mode = np.array(candidates[0].mode, dtype=float)
        zero = [i for i in range(self.plain.m) if mode[i] == 0 and not self.plain.contacts[i]]
        effects = _effects(self.plain, run.t, run.x, mode, zero)
        resting = [i for i, row in zip(zero, effects, strict=True) if not np.any(row)]
        if not resting:
            return "the signs act on the rates"
        return self.begin(resting, self._slack(), mode)

    def along(self, chosen: Successor) -> Begun | str:
        """Begin to run along kinks on which a field that is not Lipschitz holds a solution, or lets it stay.

        There rounding of h is no rounding of its rate any more: the field is taken with |h| = 0.
        """
        kinks = {i for i in chosen.along if self.plain.roles[i] == "kink"}
        mode = np.array(chosen.mode, dtype=float)
        if not kinks or self.active is not None or np.any(mode == 0.0):
            return "it runs along no kink alone"
        plain = self.plain
        if any(plain.resets_from) or plain.time_events or plain.pieces is not None:
            # Guards of kinks that are held show nothing of a jump off them.
            return "the state may jump off the kink"
        found, x = self._reduced(mode, set(), kinks)
        return found if isinstance(found, str) else self._taken(found, mode, x, self._slack())

    # -- arrival ---------------------------------------------------------------------------------------

    def arrives(self, i: int) -> Begun | str:
        """Begin on a surface crossed with no more speed than the run can tell from 0, once that has settled.

        It has where its speed came down by CAME_DOWN, or the speeds of such cycles follow no law, or fade and
        the run began on the slide.
        """
        if self.active is not None or not _slides(self.plain, i):
            return "it slides already"
        if self._acts(i):
            return "its sign acts on its rate"
        now = abs(self._rate(i, self.run.t, self.run.x, self.run.mode))
        if SLOWER * self.asked.get(i, 0.0) < now <= self.asked.get(i, 0.0):
            return UNSETTLED
        recent = [(e, (i, e.t, e.before)) for e in self.run.decided(RECENT)]
        self.rates = {
            key: self.rates.get(key) or abs(self._rate(i, e.t, e.x, np.array(e.before, dtype=float)))
            for e, key in recent
        }
        speeds = [self.rates[key] for e, key in recent if e.index == i and e.kind is EventKind.CROSSING]
        first = abs(self._rate(i, *self.start, self.run.mode))
        came_down = now <= CAME_DOWN * max([first, *self.rates.values()])
        settled = came_down or noise([*speeds, now])
        if not settled and not (fades(speeds) and self._began_near(i)):
            return "the solution has not settled"
        begun = self.begin([i], None)
        self.asked[i] = now if begun == UNSETTLED else 0.0
        return begun

    def _began_near(self, i: int) -> bool:
        """Whether the run began on h_i = h_i' = 0, as closely as its states are accurate."""
        (t, x), mode, slack = self.start, self.run.mode, self._slack(self.start[1])
        g, _ = self.plain.gradients(t, x, mode)
        rate = self._rate(i, t, x, mode)
        moved = [self._rate(i, t, np.ascontiguousarray(x + step), mode) - rate for step in np.diag(slack)]
        on = abs(self.plain.guards(t, x, mode)[i]) <= np.abs(g[i]) @ slack
        return bool(on and abs(rate) <= np.sum(np.abs(moved)))

    def slid_lately(self, stuck: bool) -> list[int]:
        """The surfaces that are slid on, or were a moment ago, unless that is of higher order.

        stuck: and those that the run is on, as closely as it is accurate.
        """
        run, plain = self.run, self.plain
        if self.active is not None or run.direction < 0:
            return []
        lately = MOMENT * abs(run.t - float(run.clock.t_start))
        modes = [run.signs, *(e.before for e in run.decided(RECENT) if abs(run.t - e.t) <= lately)]
        near = near_within(run, run.x, self._slack(), run.mode) if stuck else []
        slid = {i for mode in modes for i in range(plain.m) if mode[i : i + 1] == (0,)}
        return [i for i in sorted({*slid, *near}) if _slides(plain, i)]

    def powerless(self) -> bool:
        """Whether a slide has come, as closely as the run is accurate, to where no sign acts on its rate."""
        run, plain = self.run, self.plain
        slid = [i for i in range(plain.m) if run.mode[i] == 0.0 and _slides(plain, i)]
        if not slid or self.active is not None or run.direction < 0:
            return False
        mode = run.mode.copy()
        mode[near_within(run, run.x, self._slack(), mode)] = 0.0
        effects = _effects(plain, run.t, run.x, mode, slid, CLEAR)
        return not np.all(np.any(effects, axis=1))

    def _slack(self, x: Array | None = None) -> Array:
        size = np.abs(self.run.x if x is None else x)
        return np.asarray(1e2 * (self.run.atol + self.run.options.rtol * size))

    def settles(self, slid: Sequence[int]) -> Begun | str:
        """Begin where a slide has led to the end of its own surface, off which nothing leads.

        The slope of the surface vanishes or is infinite there, and the slide has no multiplier.
        """
        found: Begun | str = "it does not slide"
        for i in slid:
            found = self.begin([i], self._slack(), alone=True)
            if isinstance(found, Begun):
                break
        return found

    def _acts(self, i: int) -> bool:
        """Whether the sign of a surface clearly acts on its rate, and nothing that slides on that sign."""
        run, plain, mode = self.run, self.plain, self.run.mode.copy()
        if any(mode[j] == 0.0 and plain.component[j] == plain.component[i] for j in range(plain.m)):
            return False
        mode[i] = 0.0
        return bool(np.any(_effects(plain, run.t, run.x, mode, [i], ACTS)))

    def across(self, i: int) -> Left | None:
        """The other side of a surface that was crossed with a rate on which its sign does not act.

        The same side where it leads away from the surface again; None where the sign acts, by the multipliers
        of other surfaces too, or where the rate is no more than rounding.
        """
        run, on = self.run, self.run.mode.copy()
        if np.any(on == 0.0):
            return None
        # On its own surface |h| is 0, whatever rounding left of h.
        on[i] = 0.0
        g, gt = self.plain.gradients(run.t, run.x, on)
        signs = run.mode.copy()
        sides = []
        for side in (1.0, -1.0):
            signs[i] = side
            velocity = self.plain.rhs(run.t, run.x, signs, on)
            sides.append(np.append(g[i] * np.where(g[i] == 0.0, 0.0, velocity), gt[i]))
        size = max(float(np.sum(np.abs(terms))) for terms in sides)
        rates = [float(np.sum(terms)) for terms in sides]
        if not abs(rates[0] - rates[1]) <= NO_EFFECT * size:
            return None
        outwards = run.mode[i] * run.direction * rates[0]
        if abs(outwards) <= CLEAR * size:
            return None
        mode, order = run.mode.copy(), np.zeros(self.plain.m, dtype=int)
        mode[i], order[i] = np.sign(outwards) * mode[i], 1
        return Left(tuple(int(v) for v in mode), tuple(order.tolist()), ())

    def _rate(self, i: int, time: float, x: Array, mode: Array) -> float:
        mode = np.resize(mode, self.plain.m)
        x = np.ascontiguousarray(x)
        g, gt = self.plain.gradients(time, x, mode)
        velocity = self.plain.rhs(time, x, np.where(mode == 0.0, 1.0, mode), mode)
        return float(gt[i]) + self.plain.rate(i, g, velocity)

    # -- end -------------------------------------------------------------------------------------------

    def suspend(self) -> tuple[int, ...]:
        """Give the run its own machine back, at a state on the surfaces; returns those slid on."""
        found = self.active
        assert found is not None
        self.run.x[:] = found.projected(self.run.t, self.run.x.copy(), self._parameters())
        self.run.attach(self.plain)
        self.run.lam[:] = found.multipliers(self.run.lam)
        self.active = None
        return found.zero

    def left(self, triggered: Sequence[int]) -> Left | None:
        """What follows where multipliers reached the ends of their sets; None where none of them did."""
        found, run = self.active, self.run
        assert found is not None
        sides = {i: 1.0 if run.trigger[i] == codes.UPPER else -1.0 for i in triggered if i in found.pivots}
        if not sides:
            return None
        sides |= {i: sides[pivot] * factor for i, pivot, factor in found.ties if pivot in sides}
        mode, order = run.mode.copy(), np.zeros(run.machine.m, dtype=int)
        for i, side in sides.items():
            mode[i] = side
            order[i] = found.orders[found.zero.index(i)] + 1
        remaining = tuple(i for i in found.zero if i not in sides)
        return Left(tuple(int(v) for v in mode), tuple(order.tolist()), remaining)

    # -- numbers ---------------------------------------------------------------------------------------

    def _near(self, base: Array, held: set[int], x: Array, slack: Array | None) -> list[int]:
        """Further surfaces that a state lies on beside those that hold it, to rounding or to `slack`."""
        run, plain = self.run, self.plain
        mode = base.copy()
        mode[list(held)] = 0.0
        if slack is not None:
            return [i for i in near_within(run, x, slack, mode) if i not in held]
        h = np.abs(plain.guards(run.t, x, mode))
        g, gt = plain.gradients(run.t, x, mode)
        scale = guard_terms(g, gt, run.t, x)
        return [i for i in range(plain.m) if i not in held and h[i] <= ON * np.finfo(float).eps * scale[i]]

    def _parameters(self) -> dict[Symbol, float]:
        form = self.plain.system.symbolic
        return {} if form is None else dict(zip(form.p, self.plain.values.tolist(), strict=True))

    def _values(self, base: Array, x: Array) -> dict[Symbol, float]:
        form = self.plain.system.symbolic
        if form is None:
            return {}
        from filippov.model.symbols import t

        h = self.plain.guards(self.run.t, x, base)
        signs = np.where(base == 0.0, self.run.lam, base)
        return {
            t: self.run.t,
            **dict(zip(form.x, x.tolist(), strict=True)),
            **self._parameters(),
            **dict(zip(form.a, np.abs(h).tolist(), strict=False)),
            **dict(zip(form.s, signs.tolist(), strict=False)),
        }


def multipliers(machine: Machine, time: float, x: Array, mode: Array) -> Array | None:
    """The signs that hold a solution to an order above the first; None where it slides to first order."""
    zero = [i for i in range(machine.m) if mode[i] == 0]
    effects = _effects(machine, time, x, mode, zero)
    idle = [i for i, row in zip(zero, effects, strict=True) if not np.any(row)]
    if not idle or machine.system.symbolic is None:
        return None
    run = Run(machine, x, (time, time + 1.0), Options())
    run.mode[:] = mode
    begun = HigherOrder(run).begin(idle, np.full(machine.n, np.inf))
    return begun.multipliers if isinstance(begun, Begun) else None


def _effects(
    machine: Machine, time: float, x: Array, mode: Array, zero: Sequence[int], least: float = 1e-15
) -> Array:
    """What each sliding sign does to the rate of each sliding surface, 0 where it is rounding.

    least: what counts, in parts of the terms of the rate
    """
    g, _ = machine.gradients(time, x, mode)
    signs = np.where(mode == 0.0, 1.0, mode)
    base = machine.rhs(time, x, signs, mode)
    out = np.zeros((len(zero), len(zero)))
    for c, j in enumerate(zero):
        signs[j] = -1.0
        change = machine.rhs(time, x, signs, mode) - base
        signs[j] = 1.0
        for r, i in enumerate(zero):
            with np.errstate(invalid="ignore"):
                terms = np.abs(g[i]) @ np.where(g[i] == 0.0, 0.0, np.abs(base))
            effect = machine.rate(i, g, change)
            out[r, c] = effect if abs(effect) > least * terms else 0.0
    return out


def _slides(machine: Machine, i: int) -> bool:
    return machine.roles[i] == "switching" and machine.widths[i] == 0.0
