"""The event map d -> R(d) of a section: with its iterates, derivative and fixed points.

Source: Hensen & van de Molengraft 2002 (event maps of a controlled mass); Galvanetto & Knudsen 1997.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np

from filippov import Solution, Status, System, UsageError
from filippov.analysis.maps.first_return import MOST_STEPS, first_return, first_returns
from filippov.analysis.maps.map_units import level, map_units
from filippov.analysis.maps.missed import missed
from filippov.analysis.maps.section import BoundSection, Section
from filippov.analysis.sensitivity.saltation import derivative_by_all, onto_section
from filippov.base.arrays import Array
from filippov.base.given import Amount, Count, Natural, Positive, number_array
from filippov.base.keywords import keywords
from filippov.base.names import Answering
from filippov.base.shown import Shown
from filippov.solving.ensemble import Prepared
from filippov.solving.state.option_types import Tolerance
from filippov.solving.uncut import solve


class EventMap(Shown, Answering):
    """R(d): from coordinate d on the section, along the solution, to that of the section's next event.

    order       the map is the order-th iterate (2 for orbits that come back after two returns)
    parameters  values by name
    rtol, atol  of every return; atol is one number, or one per state. Default: 0.03 rtol times the size of
                each state along the return from coordinates of that size
    lanes       as in `solve_many`; 1 where so little is asked that compiling 8 or 16 at once would not pay

    Call it with a number or an array; the value is NaN where the solution does not return within t_max.
    """

    @keywords()
    def __init__(
        self, system: System, section: Section, *, parameters: Mapping[str, float] | None = None,
        order: Count = 1, rtol: Positive = 1e-10, atol: Tolerance | None = None, method: str = "DOP853",
        lanes: int | None = None,
    ) -> None:  # fmt: skip
        self._set(
            system, section, section.bind(system), parameters,
            order=order, rtol=rtol, atol=atol, method=method, lanes=lanes,
        )  # fmt: skip

    def __repr__(self) -> str:
        section = self.section
        return f"EventMap({section.coordinate} at {section.kind} on {section.surface}, order {self.order})"

    def _set(
        self, system: System, section: Section, bound: BoundSection,
        parameters: Mapping[str, float] | None, *, order: int, rtol: float, atol: Any, method: str,
        lanes: int | None,
    ) -> None:  # fmt: skip
        self.system, self.section, self.order = system, section, order
        self.bound = bound
        self.p = system.parameters.resolve(parameters)
        self.parameters = dict(zip(system.parameters.names, self.p.tolist(), strict=True))
        self.rtol, self.atol, self.method, self.lanes = rtol, atol, method, lanes
        self._prepared: dict[float, Prepared] = {}
        self._atol: dict[float, Array] = {}
        self._rows = np.empty((0, 0))

    def __getstate__(self) -> dict[str, Any]:
        """Machine code stays in its process."""
        return {**vars(self), "_prepared": {}}

    def remake(self, **changes: Any) -> Self:
        """The same map with other parameters (updated by name), order, rtol, atol or method."""
        return self._remade(**changes)

    @keywords()
    def _remade(
        self, *, parameters: Mapping[str, float] | None = None, order: Count | None = None,
        rtol: Positive | None = None, atol: Tolerance | None = None, method: str | None = None,
    ) -> Self:  # fmt: skip
        made = type(self).__new__(type(self))
        made._set(
            self.system, self.section, self.bound, {**self.parameters, **(parameters or {})},
            order=self.order if order is None else order, rtol=self.rtol if rtol is None else rtol,
            atol=self.atol if atol is None else atol, method=self.method if method is None else method,
            lanes=self.lanes,
        )  # fmt: skip
        return made

    @keywords()
    def power(self, order: Count) -> EventMap:
        """The map's own iterate: power(2) of a first return is the second return."""
        return self.remake(order=self.order * order)

    @keywords()
    def returns(self, d: Any) -> tuple[Array, tuple[Status, ...]]:
        """Values of the map and how each trajectory ended; NaN with its status where it did not return
        (NO_RETURN: not within t_max)."""
        values = np.atleast_1d(number_array("d", d))
        if values.ndim > 1:
            raise UsageError(f"d has shape {values.shape}, expected a number or numbers in a row.")
        if self.order == 1 and all(map(math.isfinite, values.tolist())):
            return self._return(values)
        statuses = [Status.STOPPED] * values.size
        for _ in range(self.order):
            alive = np.flatnonzero(np.isfinite(values))
            if not alive.size:
                break
            values[alive], ended = self._return(values[alive])
            for position, status in zip(alive.tolist(), ended, strict=True):
                statuses[position] = status
        return values, tuple(statuses)

    def _return(self, d: Array) -> tuple[Array, tuple[Status, ...]]:
        """Images and endings; coordinates of one level go together, whatever stands beside them."""
        if self.atol is not None:
            return self._returned(d, 0.0)
        ends = {level(float(end)) for end in (np.min(d), np.max(d))} if d.size else {0.0}
        if len(ends) == 1:
            return self._returned(d, ends.pop())
        levels = list(map(level, d.tolist()))
        values, ended = np.empty(d.size), [Status.STOPPED] * d.size
        for least in dict.fromkeys(levels):
            at = [k for k, own in enumerate(levels) if own == least]
            values[at], endings = self._returned(d[at], least)
            for k, status in zip(at, endings, strict=True):
                ended[k] = status
        return values, tuple(ended)

    def _returned(self, d: Array, least: float) -> tuple[Array, tuple[Status, ...]]:
        start = self.bound.start(d, self.p)
        if self.section.after:
            x, ended, resting = first_returns(
                self.bound, start, self.parameters, rtol=self.rtol, atol=self.tolerance(least),
                method=self.method, lanes=self.lanes,
            )  # fmt: skip
        else:
            if least not in self._prepared:
                self._prepared[least] = Prepared(
                    self.system, (0.0, self.section.t_max), stop=self.section.stop, rtol=self.rtol,
                    atol=self.tolerance(least), method=self.method, lanes=self.lanes, max_steps=MOST_STEPS,
                )  # fmt: skip
            rows = self._rows
            if len(rows) != d.size:
                rows = self._rows = np.empty((d.size, self.p.size))
                rows[:] = self.p
            x, ended, mode = self._prepared[least].ends(start, rows)
            resting = None
        values = self.bound.read(x)
        if ended.count(Status.STOPPED) == len(values):
            return values, tuple(ended)
        if resting is None:
            resting = np.any(mode[:, self.bound.surfaces] == 0, axis=1)
        lost = [q for q, status in enumerate(ended) if status is not Status.STOPPED]
        for q in lost:
            # A solution that never leaves the section rests there: its coordinate does not change.
            rests = ended[q] is Status.SUCCESS and resting[q]
            if not (rests and abs(values[q] - d[q]) <= 1e-15 * abs(d[q])):
                values[q] = np.nan
        came = [Status.NO_RETURN if q in lost and np.isnan(values[q]) and status is Status.SUCCESS else status
                for q, status in enumerate(ended)]  # fmt: skip
        return values, tuple(came)

    def __call__(self, d: Any) -> Any:
        """R(d), a number or an array like d; NaN where the solution does not return, see `why`."""
        if type(d) is float and self.order == 1 and math.isfinite(d):
            return float(self._return(np.array([d]))[0][0])
        values, _ = self.returns(d)
        return values if np.ndim(d) else float(values[0])

    @keywords()
    def why(self, d: float) -> str:
        """Why the solution from d does not return, and what came in place of the event; "" where it does."""
        if not math.isnan(self(d)):
            return ""
        start = self.bound.start(np.array([d]), self.p)[0]
        if not np.all(np.isfinite(start)):
            return f"the parametrisation gives no state at d = {d:g}"
        run = solve(self.system, start, (0.0, self.section.t_max), parameters=self.parameters, rtol=self.rtol,
                    method=self.method, max_steps=MOST_STEPS, zeno="continue")  # fmt: skip
        ended = "" if run.success else f". The solution ended: {run.message}"
        return f"{missed(self.bound, run)}{ended}"

    @keywords()
    def iterate(self, d: float, n: Natural) -> Array:
        """d, R(d), R(R(d)), ...: n + 1 numbers."""
        out = [float(d)]
        for _ in range(n):
            out.append(float(self(out[-1])))
        return np.array(out)

    @keywords()
    def orbit(self, d: float) -> tuple[Solution, ...]:
        """The solution behind the map, one solution per return."""
        solutions: list[Solution] = []
        for _ in range(self.order):
            solutions.append(self._solve(d))
            d = float(self.bound.read(solutions[-1].x_end[None])[0])
        return tuple(solutions)

    def _solve(self, d: float) -> Solution:
        x0 = self.bound.start(np.array([d]), self.p)[0]
        atol = self.tolerance(level(d))
        options = {"rtol": self.rtol, "atol": atol, "method": self.method}
        return first_return(self.bound, x0, self.parameters, **options)

    def tolerance(self, least: float) -> Any:
        """The absolute tolerance of returns from a level: what was given, else one per state."""
        if self.atol is not None:
            return self.atol
        if least not in self._atol:
            # Nothing is known at 0: a solution that does not rest there starts with a relative one.
            atol = map_units(self, least).tolerance(self.rtol) if least else np.zeros(self.system.dimension)
            self._atol[least] = atol
        return self._atol[least]

    @keywords()
    def derivative(self, d: float) -> float:
        """dR/dd from saltation matrices (no differences); NaN where the map does not return."""
        return float(self.jet(d)[1])

    @keywords()
    def jet(self, d: float, parameters: Sequence[str] = ()) -> Array:
        """R(d), dR/dd, and dR/dq for the named parameters q, in one array; NaN where the map does not return.

        All derivatives come from saltation matrices; that of the parametrisation by parameters from
        differences.
        """
        names = tuple(parameters)
        out = np.zeros(2 + len(names))
        out[:2] = d, 1.0
        n = self.system.dimension
        for _ in range(self.order):
            solution = self._solve(out[0])
            if solution.status is not Status.STOPPED:
                return np.full(out.size, np.nan)
            change = derivative_by_all(solution, True, names) @ self.bound.start_change(out[0], self.p, names)
            slope = self.bound.slope(solution.x_end)
            ending = self.bound.cause(solution.events)
            change = slope @ onto_section(solution, ending, change, names)[:n]
            out[2:] = change[0] * out[2:] + change[1:]
            out[1] *= change[0]
            out[0] = self.bound.read(solution.x_end[None])[0]
        return out

    @keywords()
    def fixed_points(self, lo: float, hi: float, points: Amount = 400) -> tuple[Any, ...]:
        """Every fixed point in [lo, hi] with kind, slope and stability; see `fixed_points`."""
        from filippov.analysis.maps.fixed_points import fixed_points

        return fixed_points(self, lo, hi, points)

    @keywords()
    def basins(self, lo: float, hi: float, points: Amount = 400) -> tuple[Any, ...]:
        """Intervals of [lo, hi] that go to the same attractor (see `filippov.analysis.maps.fixed_points`)."""
        from filippov.analysis.maps.fixed_points import basins

        return basins(self, lo, hi, points)

    @keywords()
    def jumps(self, lo: float, hi: float, points: Amount = 400) -> tuple[Any, ...]:
        """Places in [lo, hi] where the map is not continuous (see `filippov.analysis.maps.fixed_points`)."""
        from filippov.analysis.maps.fixed_points import jumps

        return jumps(self, lo, hi, points)
