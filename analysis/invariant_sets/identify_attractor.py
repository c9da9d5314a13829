"""What a recurrent solution has come to: an equilibrium, a periodic orbit, chaos, or none for sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from filippov import SolveError, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.invariant_sets.attractor import Attractor, AttractorKind, curve_of
from filippov.analysis.invariant_sets.recurrence import Grid
from filippov.analysis.invariant_sets.state_map import StateMap
from filippov.analysis.invariant_sets.undifferentiated import attracts, undifferentiated
from filippov.analysis.maps.stroboscope import strobes_and_turns
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.sensitivity.lyapunov import lyapunov
from filippov.analysis.sensitivity.saltation import NotDifferentiableError
from filippov.base.arrays import Array
from filippov.solving.uncut import solve

# Iterates that are looked at; longest period of the map that is searched; iterates kept of a chaotic
# attractor.
LOOK, LONGEST, KEPT = 200, 48, 1200
# Displacement that counts as none, and distance that one solution has to keep to another, in parts of the
# sizes.
NEAR, CLOSE, SLACK = 1e-8, 2e-2, 1e-4
NEWTON, EXPONENT = 30, 300
# An exponent is positive where it is so many of its errors above 0.
ERRORS = 4.0
# What looks chaotic is followed for so many iterates more from so many of its states, moved by ASIDE parts of
# the size: where one of them then repeats to SETTLED, it was a transient.
LATER, STARTS, ASIDE, SETTLED = 600, 64, 1e-9, 1e-6
# Of an autonomous system: where one of them then fills so small a part of the extent.
LESS = 0.3
FAILS = (SolveError, ArithmeticError, np.linalg.LinAlgError)
UNDIFFERENTIATED = "no multipliers, but states beside it come back: the flow has no derivative there"
# An aperiodic solution has the same extent early and late to this part of it.
STEADY = 0.02


class Identifier:
    """Looks at one solution after the other; `size`: of the box by state, (n,)."""

    def __init__(self, flow: StateMap, grid: Grid, size: Array) -> None:
        self.flow, self.grid, self.size = flow, grid, size
        # Cells of irregular solutions that settle down in the end.
        self.passed = np.zeros(0, dtype=np.uint64)

    def __call__(self, x: Array, transient: bool = False) -> Attractor | None:
        """What the solution from x is at, whether it attracts or not; None where the solution ends.

        transient  x is what an irregular solution has come down to
        """
        if (found := self.rest_after(x)) is not None:
            return found
        y = self.run(x, LOOK)
        if y is None:
            return None
        late = y[LOOK // 2 :]
        still = np.max(np.abs(y[-1] - y[-2]) / self.size) <= NEAR
        if still and self.flow.kind != "section" and self.flow.resting(y[-1:], 10 * NEAR * self.size)[0]:
            return self.at_rest(y[-1])
        if self.flow.kind == "step":
            return self.equilibrium(y) or self.cycle(y) or self.other(y, transient)
        gaps = [float(np.max(np.abs(late[q:] - late[:-q]) / self.size)) for q in range(1, LONGEST + 1)]
        order = [q + 1 for q, gap in enumerate(gaps) if gap <= CLOSE and gap <= 2 * min(gaps[: q + 1])]
        for periods in order[:4]:
            found = self.periodic(y, periods)
            if found is not None:
                return found
        if self.flow.kind == "section":
            found = self.cycle(y)
            if found is not None:
                return found
        return self.other(y, transient)

    def run(self, x: Array, count: int) -> Array | None:
        """Iterates of x, (count, n); None where the solution ends."""
        out, here = [], x[None, :]
        for _ in range(count):
            here, ends = self.flow(here)
            if not self.flow.done(ends)[0]:
                return None
            out.append(here[0])
        return np.array(out)

    def rest_after(self, x: Array) -> Attractor | None:
        """Where the solution from x has come to rest after the time of LOOK steps; None where it has not.

        In one run, for on the way there may be ever more events, of which none has to be seen.
        """
        if self.flow.kind != "step":
            return None
        ends = self.flow.over(x[None, :], LOOK * self.flow.duration)
        if not self.flow.done(ends)[0] or not self.flow.resting(ends.x, NEAR * self.size)[0]:
            return None
        return self.at_rest(ends.x[0])

    # -- equilibria --------------------------------------------------------------------------------------

    def at_rest(self, x: Array) -> Attractor:
        """A state that the solution does not leave: an equilibrium, or one state of a set."""
        matrix = self.flow.derivative(x, self.size)
        if not np.all(np.isfinite(matrix)):
            found = Attractor("equilibrium", x[None, :], low=x.copy(), high=x.copy())
            drawn = self.flow.kind != "section" and attracts(self.flow, found, x, self.size)
            return replace(found, drawn=drawn, note=UNDIFFERENTIATED if drawn else "")
        values = linalg.eigvals(matrix).astype(complex)
        values = values[np.argsort(-np.abs(values), kind="stable")]
        kind: AttractorKind = "equilibrium set" if np.any(np.abs(values - 1) <= 1e-6) else "equilibrium"
        return Attractor(kind, x[None, :], multipliers=values, low=x.copy(), high=x.copy())

    def equilibrium(self, y: Array) -> Attractor | None:
        """The fixed point of all times that iterates draw near to, by Newton's method."""
        x = y[-20:].mean(axis=0)
        for _ in range(NEWTON):
            image, ends = self.flow(x[None, :])
            if not self.flow.done(ends)[0]:
                return None
            matrix = self.flow.derivative(x, self.size) - np.eye(len(x))
            if not np.all(np.isfinite(matrix)):
                return None
            scaled = matrix * self.size / self.size[:, None]
            # A direction in which the map is the identity belongs to a set: the nearest state of it is taken.
            change = self.size * (linalg.pinv(scaled, rcond=1e-9) @ ((x - image[0]) / self.size))
            x = x + change
            if not np.all(np.isfinite(x)) or np.max(np.abs(x - y[-1]) / self.size) > 0.5:
                return None
            if np.max(np.abs(change) / self.size) <= 1e-10:
                break
        if not self.flow.resting(x[None, :], NEAR * self.size)[0]:
            return None
        away = np.linalg.norm((y - x) / self.size, axis=1)
        found = self.at_rest(x)
        early, end = float(np.max(away[: LOOK // 4])), float(np.max(away[-LOOK // 4 :]))
        # The solution has to draw near: by its multipliers, or markedly where they do not decide.
        rate = float(np.max(np.abs(found.multipliers), initial=0.0))
        fall = 0.3 * (1.0 - rate ** (LOOK // 2)) if found.stable is True else 0.02
        near = end <= (1.0 - fall) * early or end <= SLACK
        return found if near and end <= 10 * CLOSE else None

    # -- periodic ----------------------------------------------------------------------------------------

    def periodic(self, y: Array, periods: int) -> Attractor | None:
        """The orbit of a forced system that repeats after so many strobes."""
        if self.flow.kind == "section":
            return None
        flow = self.flow
        try:
            orbit = find_orbit(
                flow.system, y[-1], parameters=flow.parameters, period=periods * flow.duration, t0=flow.t0
            )
        except NotDifferentiableError as error:
            return undifferentiated(flow, y, self.size, str(error).split(". ")[0])
        except FAILS:
            return None
        return self._of_orbit(orbit, y)

    def cycle(self, y: Array) -> Attractor | None:
        """The limit cycle at the end of a solution of an autonomous system."""
        flow = self.flow
        try:
            orbit = find_orbit(
                flow.system, y[-1], parameters=flow.parameters, t_max=max(400 * flow.duration, 1e-9)
            )
        except NotDifferentiableError as error:
            return undifferentiated(flow, y, self.size, str(error).split(". ")[0])
        except FAILS:
            return None
        return self._of_orbit(orbit, y)

    def _of_orbit(self, orbit: Orbit, y: Array) -> Attractor | None:
        """The attractor of an orbit, where the solution keeps near to it."""
        flow = self.flow
        found = Attractor(
            "periodic", orbit.x0[None, :], None, orbit.period, orbit.multipliers, low=orbit.low,
            high=orbit.high, orbit=orbit,
        )  # fmt: skip
        if flow.kind == "strobe":
            periods, _ = strobes_and_turns(orbit.period, flow.duration)
            x = self._at_strobe(orbit)
            if x is None:
                return None
            points = self.run(x, periods)
            if points is None:
                return None
            found = replace(found, states=points, period=periods)
        else:
            found = replace(found, curve=curve_of(orbit))
            if flow.kind == "section":
                points = self.run(y[-1], LONGEST)
                if points is None:
                    return None
                same = np.max(np.abs(points - points[-1]) / self.size, axis=1) <= CLOSE / 10
                periods = int(np.diff(np.flatnonzero(same))[-1]) if np.sum(same) > 1 else len(points)
                found = replace(found, states=points[-periods:], period=periods)
        away = found.distance(y, self.size)
        # Chords of the orbit's curve are off it by up to SLACK.
        if np.max(away[-20:]) > CLOSE or np.max(away[-20:]) > np.max(away[:40]) + SLACK:
            return None
        return found

    def _at_strobe(self, orbit: Orbit) -> Array | None:
        """The state of the orbit at a strobe: it may have been solved for at another phase."""
        flow = self.flow
        shift = (orbit.t0 - flow.t0) / flow.duration
        strobes = float(np.ceil(shift - 1e-9))
        if strobes - shift <= 1e-9:
            return orbit.x0
        # The time of the strobe itself, not what rounding makes of it: a clock may tick there.
        end = flow.t0 + strobes * flow.duration
        run = solve(
            orbit.system, orbit.x0, (orbit.t0, end), parameters=orbit.parameters, rtol=orbit.rtol,
            atol=orbit.atol, zeno="continue", nonunique="stick", dense_output=False,
        )  # fmt: skip
        return run.x_end if run.success else None

    # -- what is left ------------------------------------------------------------------------------------

    def other(self, y: Array, transient: bool) -> Attractor | None:
        """Chaos where the largest exponent says so; else aperiodic. Known by the cells that it fills."""
        flow = self.flow
        kept = self.run(y[-1], KEPT)
        if kept is None:
            return None
        # One that clearly grows or shrinks is on its way: its exponent would say nothing.
        drift = self.drift(kept)
        if drift > 10 * STEADY:
            return None
        if not transient and (x := self.settled(kept)) is not None:
            end = self(x, True)
            if end is not None and end.stable:
                self.passed = np.union1d(self.passed, self.grid.names(self.grid.around(kept)))
                return end
        value, error = float("nan"), float("nan")
        interval = flow.duration
        if flow.kind == "section":
            ends = flow(y[-1:])[1]
            interval = float(ends.t[0])
        try:
            found = lyapunov(
                flow.system, y[-1], EXPONENT * interval, interval=interval, t0=flow.t0, number=1,
                parameters=flow.parameters,
            )  # fmt: skip
            if found.interrupted:
                raise KeyboardInterrupt
            value, error = float(found.exponents[0]), float(found.error[0])
        except (*FAILS, UsageError):
            pass
        chaotic = np.isfinite(value) and value > ERRORS * error and value * EXPONENT * interval > 5.0
        if not chaotic and drift > STEADY:
            return None
        note = (
            ""
            if chaotic
            else "no period up to the longest was found, and no positive exponent beyond its error"
        )
        return Attractor(
            "chaotic" if chaotic else "aperiodic", kept[:: KEPT // 200], exponent=(value, error),
            low=kept.min(axis=0), high=kept.max(axis=0), note=note,
            cells=np.unique(self.grid.names(self.grid.around(kept))),
        )  # fmt: skip

    def settled(self, kept: Array) -> Array | None:
        """A state at the end of an irregular solution, or of ones beside it, that repeats or hardly moves.

        What is no attractor is left after some time by some of them: a chaotic saddle beside a stable orbit.
        In steps of no period of its own an orbit does not repeat, but fills less. None where all go on.
        """
        rng = np.random.default_rng(0)
        x = kept[np.linspace(len(kept) - 1, 0, STARTS).astype(int)]
        x[1:] += ASIDE * self.size * rng.uniform(-1, 1, x[1:].shape)
        last: list[Array] = []
        ended = np.zeros(len(x), dtype=bool)
        for k in range(LATER):
            image, ends = self.flow(x)
            # What ends, or escapes, stays where it is and says nothing.
            done = self.flow.done(ends)
            ended |= ~done
            x = np.where(done[:, None], image, x)
            if k >= LATER - 2 * LONGEST:
                last.append(x)
        rows = np.array(last)[:, ~ended] / self.size
        x = x[~ended]
        if self.flow.kind == "step":
            extent = np.maximum(np.ptp(kept, axis=0), NEAR * self.size)
            least = np.max(np.ptp(rows, axis=0) * self.size / extent, axis=1)
            found = np.flatnonzero(least <= LESS)
            return x[found[0]] if found.size else None
        best = np.full(len(x), np.inf)
        for q in range(1, LONGEST + 1):
            best = np.fmin(best, np.max(np.abs(rows[LONGEST:] - rows[LONGEST - q : -q]), axis=(0, 2)))
        found = np.flatnonzero(best <= SETTLED)
        return x[found[0]] if found.size else None

    def drift(self, kept: Array) -> float:
        """Change of the extent of a long solution from its first quarter to its last, in parts of it."""
        first, last = kept[: len(kept) // 4], kept[-(len(kept) // 4) :]
        size = np.maximum(np.ptp(kept, axis=0), NEAR * self.size)
        low = np.abs(first.min(axis=0) - last.min(axis=0)) / size
        high = np.abs(first.max(axis=0) - last.max(axis=0)) / size
        return float(max(np.max(low), np.max(high)))
