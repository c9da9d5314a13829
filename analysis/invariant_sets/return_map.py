"""The return map of an orbit with its inverse: by the period of the forcing, or by a section."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from filippov import Solution, SolveError, Status, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.saddle import Side
from filippov.analysis.orbits.shooting import onto_surfaces
from filippov.analysis.sensitivity.saltation import flow_derivative, onto_section
from filippov.base.arrays import Array
from filippov.solving.ensemble import Prepared
from filippov.solving.uncut import solve, whole

STEPS, RETURNS, SAME = 200_000, 64, 1e-6


class ReturnMap:
    """R with R(x) = x on the orbit, for states (k, n); its inverse runs backwards in time.

    x        the point of the orbit at the strobe or on the section
    returns  section events in a period of the orbit (1 for a forced one)
    reasons  what solutions that did not come back ended with, and how many

    Raises UsageError, SolveError where the orbit does not come to the section.
    """

    def __init__(self, orbit: Orbit, section: Section | None = None, rtol: float = 1e-10) -> None:
        self.orbit, self.system, self.parameters = orbit, orbit.system, dict(orbit.parameters)
        self.p = self.system.parameters.resolve(self.parameters)
        if orbit.forced and section is not None:
            raise UsageError(
                "the orbit is one of a forced system: it is cut by its period, drop the section."
            )
        if not orbit.forced and section is None:
            raise UsageError(
                "the orbit is one of an autonomous system; give the section= on which its curve lies."
            )
        if section is not None and section.after:
            raise UsageError(
                f"the section asks for mode {section.after!r} after its event; expected any mode."
            )
        self.section = None if section is None else section.bind(self.system)
        self.options: dict[str, Any] = {
            "rtol": rtol, "atol": 1e-3 * rtol, "max_steps": STEPS, "zeno": "continue",
        }  # fmt: skip
        self.x, self.returns = orbit.x0.copy(), 1
        self.reasons: dict[str, int] = {}
        if self.section is not None:
            self.x = self._event(orbit.x0).x_end
            x = self.x
            for self.returns in range(1, RETURNS + 1):
                x = self._event(x).x_end
                if np.max(np.abs(x - self.x)) <= SAME * (1.0 + np.max(np.abs(self.x))):
                    return
            raise SolveError(f"the orbit is not back on its section after {RETURNS} events.")

    def _event(self, x: Array, dense: bool = False) -> Solution:
        """The solution to the next event of the section."""
        assert self.section is not None
        section = self.section.section
        run: Solution = solve(
            self.system, x, (0.0, section.t_max), parameters=self.parameters, stop=section.stop,
            dense_output=dense, **self.options,
        )  # fmt: skip
        if run.status is not Status.STOPPED:
            raise SolveError(f"the orbit does not come to its section: {run.message}", run)
        return run

    @cached_property
    def _ahead(self) -> Prepared:
        return self._prepared(False)

    @cached_property
    def _back(self) -> Prepared:
        if any(s.reset is not None for s in self.system.surfaces) or any(
            e.reset is not None for e in self.system.time_events
        ):
            raise UsageError(
                "the system has resets, which are not undone backwards in time: no stable manifold."
            )
        return self._prepared(True)

    def _prepared(self, back: bool) -> Prepared:
        if self.section is None:
            a, b = self.orbit.t0, self.orbit.t0 + self.orbit.period
            stop: Any = ()
        else:
            a, b, stop = 0.0, self.section.section.t_max, self.section.section.stop
            if back:
                a, b = 0.0, -b
        span = (b, a) if back and self.section is None else (a, b)
        return Prepared(self.system, span, stop=stop, backward=back, **self.options)

    def map_of(self, side: Side) -> Callable[[Array], Array]:
        """R for the unstable side, its inverse for the stable one; NaN where a solution does not return."""
        prepared = self._ahead if side == "unstable" else self._back
        wanted = Status.SUCCESS if self.section is None else Status.STOPPED

        def image(x: Array) -> Array:
            out = x.copy()
            for _ in range(self.returns):
                rows = np.flatnonzero(np.all(np.isfinite(out), axis=1))
                if not rows.size:
                    break
                ends = whole(prepared.run(out[rows], np.tile(self.p, (rows.size, 1))))
                good = np.array([status is wanted for status in ends.status])
                for status in (s for s, fine in zip(ends.status, good, strict=True) if not fine):
                    self.reasons[status.value] = self.reasons.get(status.value, 0) + 1
                out[rows] = np.where(good[:, None], ends.x, np.nan)
            return out

        return image

    def onto(self, x: Array) -> Array:
        """States moved onto the section along its gradient."""
        if self.section is None:
            return x
        return np.array(
            [onto_surfaces(self.system, row, 0.0, self.p, tuple(self.section.surfaces[:1])) for row in x]
        )

    @cached_property
    def matrix(self) -> Array:
        """dR/dx at the orbit, (n, n)."""
        n = self.system.dimension
        if self.section is None:
            run = solve(
                self.system, self.x, (self.orbit.t0, self.orbit.t0 + self.orbit.period),
                parameters=self.parameters, **self.options,
            )  # fmt: skip
            return np.asarray(flow_derivative(run))
        total, x = np.eye(n), self.x
        for _ in range(self.returns):
            run = self._event(x, dense=True)
            ending = self.section.cause(run.events)
            total = onto_section(run, ending, flow_derivative(run, before_last=True))[:n] @ total
            x = run.x_end
        return total

    def direction(self, side: Side) -> tuple[float, Array]:
        """The multiplier of a manifold that is a curve, and its unit eigenvector. Raises UsageError."""
        values, vectors = linalg.eig(self.matrix)
        if self.section is not None:
            # On the section: along the solution R does not change, which is a multiplier 0 of this matrix.
            keep = np.argsort(np.abs(values))[1:]
            values, vectors = values[keep], vectors[:, keep]
        inside, outside = np.abs(values) < 1 - 1e-7, np.abs(values) > 1 + 1e-7
        if not (inside.any() and outside.any() and np.all(inside | outside)):
            listed = ", ".join(f"{v:.6g}" for v in values)
            raise UsageError(f"the orbit has multipliers {listed}: it is not of saddle type.")
        mine = np.flatnonzero(outside if side == "unstable" else inside)
        if mine.size != 1:
            raise UsageError(
                f"the {side} manifold of the orbit has dimension {mine.size} in its section; "
                "only curves are drawn."
            )
        value = float(values[mine[0]].real)
        if side == "stable" and abs(value) < 1e-12:
            raise UsageError(
                "the stable multiplier of the orbit is 0, as it slides: backwards in time it is not unique, "
                "and its stable manifold is no curve that an inverse map draws."
            )
        vector = np.real(vectors[:, mine[0]])
        vector = vector / np.linalg.norm(vector)
        return value, np.asarray(vector * np.sign(vector[np.argmax(np.abs(vector))]))
