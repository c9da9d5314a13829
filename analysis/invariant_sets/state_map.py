"""The map whose iterates show where solutions go: the flow over a period, over a step, or to a section.

forced or clocked    R(x) = Phi(t0 + T, t0, x), the stroboscopic map
autonomous           R(x) = Phi(dt, x), or the next event of a section
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from filippov import Solution, Status, System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.shooting import resolved
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.analysis.sensitivity.variation import mode_field
from filippov.analysis.steady.forcing import Period, is_forced
from filippov.base.arrays import Array
from filippov.base.changed import changed
from filippov.solving.ensemble import Ensemble, Prepared
from filippov.solving.uncut import solve, whole

Kind = Literal["strobe", "step", "section"]
STEPS = 200_000
# Of so many events in one step half tell the law of what leads to a corner through ever more of them.
EVENTS = 20_000
# A step that is chosen has no more: near a corner there are ever more of them.
FEW_EVENTS = 500
# A solution is at rest where it is unchanged at these shares of the map's time as well.
SHARES = (0.371, 0.713)
# Displacement in one step, in parts of the box, up to which it is doubled; what doubling has to gain, at once
# above LEAST, else within a step that is so many times as long: a drift may hide behind a small oscillation,
# what has come close to a point does not move in any time.
MOST, LEAST, GAIN, FURTHER = 0.3, 1e-4, 1.5, 256
# Displacement in tolerances that is none.
NOISE = 10.0
# Of an ensemble, what has a row for each trajectory.
_ROWS = ("t", "x", "mode", "nfev", "counts", "last")
# Of differences, in parts of the sizes; how much wider they are taken to compare, and up to which part of the
# largest they may differ; part of a displacement off a slide that may be left where it is lost;
# singular value of unit normals that belongs to equal ones.
REACH, WIDER, ALIKE, LOST, SAME = 1e-5, 16.0, 0.2, 1e-2, 1e-9
# Shares of the map's time at which it is looked for.
SOON = (0.02, 0.2, 1.0)
# How often the step is chosen anew, after so many steps.
ROUNDS, SETTLED = 3, 20


class StateMap:
    """R: states (k, n) -> states (k, n).

    kind      "strobe" (one period of the forcing), "step" (a fixed time) or "section" (the next event)
    duration  period, step, or the longest time of a return
    t0        time at which a period starts

    Raises UsageError, for a system with hysteresis too: the sign of such a surface is a state of its own.
    """

    def __init__(
        self, system: System, *, parameters: Mapping[str, float] | None = None, section: Section | None =
        None, period: Any = None, step: float | None = None, t0: float = 0.0, rtol: float = 1e-8,
        atol: float | None = None, threads: int | None = None,
    ) -> None:  # fmt: skip
        if any(surface.width != 0 for surface in system.surfaces):
            raise UsageError(
                "a surface has hysteresis: where a solution goes on depends on its sign, which is not in the "
                "state. Make the sign a state, or sample the system by an event map (EventMap)."
            )
        given = [
            name for name, v in (("section", section), ("period", period), ("step", step)) if v is not None
        ]
        if len(given) > 1:
            raise UsageError(f"{' and '.join(given)} are given, expected one of them at most.")
        forced = is_forced(system)
        if forced and (section is not None or step is not None):
            raise UsageError(
                f"the system depends on time, so that {given[0]} does not fit; give its period or nothing."
            )
        if step is not None and not (0 < step < np.inf):
            raise UsageError(f"step is {step!r}, expected a time > 0.")
        if section is not None and section.after:
            raise UsageError(
                f"the section asks for mode {section.after!r} after its event; expected any mode."
            )
        self.system, self.t0 = system, float(t0)
        self.p = resolved(system, parameters)
        self.parameters = dict(zip(system.parameters.names, self.p.tolist(), strict=True))
        self.section = None if section is None else section.bind(system).section
        self.kind: Kind = (
            "section" if section is not None else "strobe" if forced or period is not None else "step"
        )
        if section is not None:
            self.duration = float(section.t_max)
        elif self.kind == "strobe":
            self.duration = Period(system, period).following(self.p)(self.p)
        else:
            self.duration = 1.0 if step is None else float(step)
        self.options: dict[str, Any] = {
            "rtol": rtol, "atol": 1e-3 * rtol if atol is None else atol, "max_steps": STEPS,
            "zeno": "continue",
        }  # fmt: skip
        if self.kind == "step":
            self.options["max_events"] = EVENTS
        self.threads = threads

    def at_pace(self, states: Array, size: Array) -> StateMap:
        """The same map with a step in which solutions cover a good part of their extent.

        It is doubled from a short one until half of them go MOST of the sizes (n,), or no further by more
        time, or through more than FEW_EVENTS; and again from where they are after some steps, for
        transients are faster than what they lead to.
        """
        x, step = states, self.duration
        for _ in range(ROUNDS):
            while self._pace(x, size, step) > MOST and step > 1e-12:
                step *= 0.5
            pace, tried = self._pace(x, size, step), step
            while pace > 0.0 and tried < FURTHER * step:
                tried *= 2
                further = self._pace(x, size, tried)
                if further > MOST or (pace > LEAST and further < GAIN * pace):
                    break
                if further >= GAIN * pace:
                    step, pace = tried, further
            ends = self.over(x, SETTLED * step, max_events=SETTLED * FEW_EVENTS)
            good = np.array([status is Status.SUCCESS for status in ends.status])
            if not good.any():
                break
            x = ends.x[good]
        return changed(self, duration=step)

    def _pace(self, states: Array, size: Array, step: float) -> float:
        """Median displacement in a step of the solutions that move, in parts of the sizes."""
        ends = self.over(states, step, max_events=FEW_EVENTS)
        good = np.array([status is Status.SUCCESS for status in ends.status])
        gone = np.max(np.abs(ends.x - states) / size, axis=1)
        gone = np.where(good, gone, np.inf)
        gone = gone[gone > NOISE * self.options["rtol"]]
        return float(np.median(gone)) if gone.size else 0.0

    @cached_property
    def _prepared(self) -> Prepared:
        stop = () if self.section is None else self.section.stop
        start = 0.0 if self.kind == "section" else self.t0
        return Prepared(
            self.system, (start, start + self.duration), stop=stop, threads=self.threads, **self.options
        )

    def __call__(self, states: Array) -> tuple[Array, Ensemble]:
        """Images of states with how each solution ended; one that meets no section is at its end."""
        ends = self._ends(self._prepared, states)
        return ends.x, ends

    def timed(self) -> StateMap:
        """This map, or in place of an event map the flow over its longest return."""
        if self.kind != "section":
            return self
        return StateMap(
            self.system, parameters=self.parameters, step=self.duration, threads=self.threads,
            rtol=self.options["rtol"], atol=self.options["atol"],
        )  # fmt: skip

    def over(self, states: Array, duration: float, **options: Any) -> Ensemble:
        """Where solutions from states at t0 are after another time than the map's, by options of `solve`."""
        used = {**self.options, **options}
        prepared = Prepared(self.system, (self.t0, self.t0 + duration), threads=self.threads, **used)
        return self._ends(prepared, states)

    def _ends(self, prepared: Prepared, states: Array) -> Ensemble:
        """How solutions from these states end; equal states, as of those at rest, are solved once."""
        unlike, place = np.unique(states, axis=0, return_inverse=True)
        if len(unlike) == len(states):
            return whole(prepared.run(states, np.tile(self.p, (len(states), 1))))
        ends = whole(prepared.run(unlike, np.tile(self.p, (len(unlike), 1))))
        place = place.reshape(-1)
        each: dict[str, Any] = {name: getattr(ends, name)[place] for name in _ROWS}
        each |= {name: tuple(getattr(ends, name)[k] for k in place) for name in ("status", "message")}
        return replace(ends, **each)

    def done(self, ends: Ensemble) -> npt.NDArray[np.bool_]:
        """Which solutions reached the end of the map's time, or its section."""
        wanted = Status.STOPPED if self.kind == "section" else Status.SUCCESS
        return np.array([status is wanted for status in ends.status])

    def resting(self, states: Array, near: Array) -> npt.NDArray[np.bool_]:
        """Which states a solution does not leave: the same to `near` (n,) at three times of a step."""
        kept = np.ones(len(states), dtype=bool)
        for share in (*SHARES, 1.0):
            ends = self.over(states, share * self.duration)
            same = np.all(np.abs(ends.x - states) <= near, axis=1)
            kept &= same & np.array([status is Status.SUCCESS for status in ends.status])
        return kept

    def derivative(self, x: Array, size: Array) -> Array:
        """dPhi/dx over the map's time at x, (n, n): exact through events; by differences where that fails.

        Of a state that slides, directions off the surfaces are lost where states beside it come back. NaN
        where differences over WIDER as much are others: the flow has no derivative there.
        """
        run = solve(
            self.system, x, (self.t0, self.t0 + self.duration), parameters=self.parameters, rtol=1e-11,
            atol=1e-13, zeno="continue", nonunique="stick",
        )  # fmt: skip
        exact = None
        try:
            if run.success:
                exact = np.asarray(flow_derivative(run))
        except NotDifferentiableError:
            pass
        if exact is not None and 0 not in run.start_mode:
            return exact
        near, far = (
            self._differences(x, reach * size) if exact is None
            else self._off_slides(run, exact, size, reach)
            for reach in (REACH, WIDER * REACH)
        )  # fmt: skip
        shape = size / size[:, None]
        largest = max(float(np.max(np.abs(near * shape))), 1.0)
        alike = bool(np.max(np.abs((near - far) * shape)) <= ALIKE * largest)
        return near if alike else np.full_like(near, np.nan)

    def _differences(self, x: Array, reach: Array) -> Array:
        """dPhi/dx at x by central differences over the reach (n,); NaN where a solution fails."""
        aside = np.diag(reach)
        ends = self.over(np.vstack([x + aside, x - aside]), self.duration)
        arrived = np.where(self._whole(ends)[:, None], ends.x, np.nan)
        return np.asarray(((arrived[: len(x)] - arrived[len(x) :]) / (2 * reach[:, None])).T)

    def _whole(self, ends: Ensemble) -> npt.NDArray[np.bool_]:
        """Which solutions reached the end of their time."""
        return np.array([status is Status.SUCCESS for status in ends.status])

    def _off_slides(self, run: Solution, matrix: Array, size: Array, reach: float) -> Array:
        """The derivative of states beside a slide from that along it: (n, n).

        States beside it come to it: what they were off it is lost. Where they do not, by differences over
        so many parts of the sizes.
        """
        x = run.problem.x0
        field = mode_field(self.system, run.start_mode)
        here = np.array([self.t0]), x[None, :]
        signs = field.multipliers(*here, self.p)
        held = [i for i, sign in enumerate(run.start_mode) if sign == 0]
        # A contact that rests holds h besides h', which stands in its place where it rests.
        beside = mode_field(self.system, tuple(sign or 1 for sign in run.start_mode))
        slopes = np.vstack([
            field.part("heldy", *here, signs, self.p)[0, :, : len(x)],
            beside.part("hy", *here, signs, self.p)[0, held, : len(x)],
        ])  # fmt: skip
        slopes = slopes * size
        slopes /= np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-300)
        along = np.asarray(linalg.null_space(slopes, rcond=SAME))
        off = np.asarray(linalg.null_space(along.T)) if along.size else np.eye(len(x))
        kept = matrix * size / size[:, None] @ along @ along.T
        step = reach * size * off.T
        starts = np.vstack([x + step, x - step])
        ahead = self._ahead_of_stops(starts)
        gone = np.zeros_like(starts)
        assert run.sol is not None
        # Early as well: what is unstable along the surfaces may leave them in the end.
        for share in SOON if ahead.any() else ():
            ends = self.over(starts[ahead], share * self.duration)
            arrived = np.where(self._whole(ends)[:, None], ends.x, np.nan)
            gone[ahead] = (arrived - run.sol(self.t0 + share * self.duration)) / size
            if np.max(np.abs(gone @ off)) <= LOST * reach:
                break
        else:
            first, second = np.split(gone, 2)
            sides = np.maximum(np.sum(np.split(ahead, 2), axis=0), 1)
            kept += (first - second).T / (reach * sides) @ off.T
        return np.asarray(kept * size[:, None] / size)

    def _ahead_of_stops(self, states: Array) -> npt.NDArray[np.bool_]:
        """Which states (k, n) are not behind a surface with a reset that has one side."""
        signs = np.ones((len(states), len(self.system.surfaces)))
        field = mode_field(self.system, (1,) * signs.shape[1])
        h = field.part("h", np.full(len(states), self.t0), states, signs, self.p)[:, :, 0]
        ahead = np.ones(len(states), dtype=bool)
        for i, surface in enumerate(self.system.surfaces):
            if surface.reset is not None and surface.side != "both":
                ahead &= h[:, i] >= 0.0 if surface.side == "+" else h[:, i] <= 0.0
        return ahead
