"""One fit of a driven mass to a record: the force between samples, the noise, least squares in turn."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.driven_run import DrivenRun, DrivenTrajectory, Pieces, Slopes
from filippov.analysis.estimation.feedback import feedback
from filippov.analysis.estimation.force_input import SmoothForce, plain_pieces
from filippov.analysis.estimation.record import Record
from filippov.analysis.estimation.residual_noise import (
    Noise,
    Solved,
    Window,
    bounded,
    estimate_noise,
    generalised,
    reduced,
    squares,
)
from filippov.base.arrays import Array
from filippov.model.system import System

# Rounds of force, noise and least squares; they end when the estimates stay within this part of their errors.
ROUNDS, SETTLED = 15, 0.1
# Rounds in which the force's kinks may still move.
PLACING = 4
# Samples of the windows on which the search begins.
SHORT = 25
# A held force: parts by which parameters are moved in search of a better side of a jump, and how often; a
# side is tried where the sum of squares may come down by this factor.
REACH, RESTARTS, BETTER = np.geomspace(5e-4, 0.08, 12), 6, 0.9
# Part of the residuals' size that an unknown force may move a position by and be left out.
FINEST = 0.01
# Damping of the steps of least squares, in errors a change by the whole size, one after the other; up to FREE
# what the record tells at all is not held back.
DAMPINGS, FREE = (0.0, 10.0, 100.0, 1e3, 1e4, 1e5), 100.0
# Half of chi-square's 95 % of one degree: more likelihood than chance adds by one more parameter.
CONTRADICTED = 1.92
# Where the size of the force's noise is not known, part of its effect that may be left out.
COARSE = 2e-3


@dataclass(frozen=True)
class Linear:
    """The model about theta and a force: trajectories, their slopes, the windows' linear least squares.

    axes   the factors of each window as combinations of those of its force
    """

    trajectories: tuple[DrivenTrajectory, ...]
    slopes: tuple[Slopes, ...]
    windows: tuple[Window, ...]
    axes: tuple[Array, ...]


@dataclass(frozen=True)
class Fit:
    """The end of a fit: theta holds the free parameters, then the windows' initial states."""

    theta: Array
    linear: Linear
    noise: Noise
    success: bool
    message: str


class Fitting:
    """What the fits to a record have in common; `others` are parameters that slopes are wanted of."""

    def __init__(
        self, record: Record, system: System, names: Sequence[str], others: Sequence[str],
        fixed: Mapping[str, float], number: int, rtol: float, bounds: tuple[Array, Array],
        progress: Callable[[int, float], None] | None,
    ) -> None:  # fmt: skip
        self.record, self.count = record, len(names)
        # Window w holds the samples edge[w] ... edge[w + 1] - 1.
        self.edge = np.linspace(0, len(record.t), number + 1).round().astype(int)
        scale = float(np.max(np.abs(record.x - np.mean(record.x)))) or 1.0
        speed = float(np.max(np.abs(np.gradient(record.x, record.t)))) or 1.0
        # Errors of the intervals' integrations add up, and grow where friction falls with speed.
        self.least = 100 * rtol * scale
        self.run = DrivenRun(system, [*names, *others], fixed, rtol, scale, speed)
        self.rest = self.run.base[self.run.places][self.count :]
        free = np.full(2 * number, np.inf)
        self.bounds = np.append(bounds[0], -free), np.append(bounds[1], free)
        self.evaluations, self.progress = 0, progress
        self.first: SmoothForce | None = None
        self.cut: dict[bytes, SmoothForce] = {}

    @property
    def known(self) -> list[slice]:
        """Samples of each window."""
        return [slice(a, b) for a, b in zip(self.edge[:-1], self.edge[1:], strict=True)]

    def initial_states(self) -> Array:
        """Position and slope of a line through the first samples of each window, shape (w, 2)."""
        out = []
        for first, last in zip(self.edge[:-1], self.edge[1:], strict=True):
            part = slice(first, min(first + 6, last))
            t, x = self.record.t[part], self.record.x[part]
            slope, level = np.polyfit(t - t[0], x, 1)
            out.append((level, slope if self.record.v is None else self.record.v[first]))
        return np.array(out)

    def fit(self, first: Array, hold: str) -> Fit:
        """The fit from theta = first; of a held force, whose objective jumps, the best over jumps nearby."""
        pieces = self.force(hold)  # before the copy for short windows, which has the same first force
        theta = self.least_squares(self._by_short_windows(first, hold), pieces)
        best = self._settled(theta, pieces, hold)
        if hold != "zero":
            return best
        for _ in range(RESTARTS):
            start = self._over_jumps(best)
            if start is None:
                break
            again = self._settled(start, pieces, hold)
            if again.noise.log <= best.noise.log:
                break
            best = again
        return best

    def _by_short_windows(self, first: Array, hold: str) -> Array:
        """theta by least squares on many short windows, where no trajectory gets far from the record.

        A guess with which the mass would not move at all has no slope on long windows.
        """
        short, inner = copy.copy(self), []
        for part in self.known:
            parts = max(1, round((part.stop - part.start) / SHORT))
            inner.extend(np.linspace(part.start, part.stop, parts + 1).round().astype(int)[:-1].tolist())
        short.edge = np.array([*inner, self.edge[-1]])
        free = np.full(2 * len(inner), np.inf)
        short.bounds = (
            np.append(self.bounds[0][: self.count], -free), np.append(self.bounds[1][: self.count], free)
        )  # fmt: skip
        start = np.append(first[: self.count], short.initial_states().ravel())
        theta = short.least_squares(start, short.force(hold))
        states = theta[self.count :].reshape(-1, 2)
        at = np.searchsorted(short.edge[:-1], self.edge[:-1])
        return np.append(theta[: self.count], states[at].ravel())

    def _settled(self, theta: Array, pieces: tuple[Pieces, ...], hold: str) -> Fit:
        """Force, noise and least squares in turn until the estimates stay."""
        noise: Noise | None = None
        z, success = _zero(pieces), False
        for round_ in range(ROUNDS):
            if round_ < PLACING:
                force = self.smooth(theta, _moved(pieces, z))
                if hold == "cubic":
                    pieces = tuple(force.pieces(q.start, q.stop) for q in self.known)
                    z = _zero(pieces)
            linear = self.linear(theta, pieces, z)
            noise = self.noise(linear.windows, hold, force.s, noise)
            got = generalised(linear.windows, noise.sigma, noise.rho, noise.kappa)
            step, free = self._step(theta, pieces, z, linear, noise, got)
            theta = np.clip(theta + step, *self.bounds)
            root = np.sqrt(noise.kappa)
            z = tuple(root * axes @ own for axes, own in zip(linear.axes, got.z, strict=True))
            change = got.root @ step
            success = free and bool(np.sqrt(change @ change / len(theta)) < SETTLED)
            if success and round_:
                break
        linear = self.linear(theta, pieces, z)
        assert noise is not None
        noise = self.noise(linear.windows, hold, force.s, noise)
        success = success and all(m.good for m in linear.trajectories)
        said = "the estimates stay"
        if not success:
            said = f"the estimates still move after {ROUNDS} rounds; start nearer, or free fewer parameters"
        return Fit(theta, linear, noise, success, said)

    def _step(
        self, theta: Array, pieces: tuple[Pieces, ...], z: tuple[Array, ...], linear: Linear, noise: Noise,
        got: Solved,
    ) -> tuple[Array, bool]:  # fmt: skip
        """The step of least squares, damped until it leads down, and whether the estimates were free in it.

        A window that begins at rest says nothing of its initial velocity, which would go anywhere.
        """
        states = np.tile((self.run.scale, self.run.speed), len(self.known))
        scale = np.append(np.maximum(np.abs(theta[: self.count]), 1e-3), states)
        moved = _moved(pieces, z)
        # What the force's estimate took from the residuals does not change with the step.
        shift = [
            w.residual - (self.record.x[q] - m.x)
            for w, q, m in zip(linear.windows, self.known, linear.trajectories, strict=True)
        ]
        here = squares(linear.windows, [w.residual for w in linear.windows], noise)
        for damping in DAMPINGS:
            step = bounded(
                got, self.bounds[0] - theta, self.bounds[1] - theta, np.full(len(theta), damping) / scale
            )
            trajectories = self.trajectories(np.clip(theta + step, *self.bounds), moved)
            residuals = [
                self.record.x[q] - m.x + own
                for q, m, own in zip(self.known, trajectories, shift, strict=True)
            ]
            if squares(linear.windows, residuals, noise) < here + SETTLED:
                return step, damping <= FREE
        return np.zeros(len(theta)), False

    def _over_jumps(self, fit: Fit) -> Array | None:
        """A start beyond a jump of the objective, None where none is better.

        A held force lets the mass break away at samples only, so the objective jumps where a level passes a
        sample's force. Each parameter is moved by up to some percent; what the others can do about the
        residuals is taken to first order.
        """
        p, windows = self.count, fit.linear.windows
        moves = np.concatenate((-REACH, REACH))
        thetas = np.repeat(fit.theta[None], p * len(moves), axis=0)
        for j in range(p):
            rows = slice(j * len(moves), (j + 1) * len(moves))
            thetas[rows, j] = np.clip(fit.theta[j] * (1 + moves), self.bounds[0][j], self.bounds[1][j])
        number = len(windows)
        starts = np.repeat(fit.theta[None, p:].reshape(1, number, 2), len(thetas), axis=0).reshape(-1, 2)
        full = np.repeat(
            np.column_stack((thetas[:, :p], np.tile(self.rest, (len(thetas), 1)))), number, axis=0
        )
        trajectories = self.run.trajectories(list(self.force("zero")) * len(thetas), starts, full)
        costs = []
        for k in range(len(thetas)):
            own = trajectories[k * number : (k + 1) * number]
            moved = [
                replace(w, residual=self.record.x[part] - m.x)
                for w, m, part in zip(windows, own, self.known, strict=True)
            ]
            noise = fit.noise
            costs.append(generalised(moved, noise.sigma, noise.rho, noise.kappa).squares)
        here = generalised(windows, fit.noise.sigma, fit.noise.rho, fit.noise.kappa).squares
        best = int(np.argmin(costs))
        return thetas[best] if costs[best] < BETTER * here else None

    def events(
        self, trajectories: Sequence[DrivenTrajectory]
    ) -> tuple[list[int], npt.NDArray[np.bool_], bytes]:
        """Intervals in which trajectories stop, start or turn, which intervals move, and both as a key."""
        moving = np.ones(len(self.record.t) - 1, dtype=bool)
        cuts: list[int] = []
        for part, trajectory in zip(self.known, trajectories, strict=True):
            v = trajectory.v
            moving[part.start : part.stop - 1] = (v[1:] != 0) | (v[:-1] != 0)
            changes = ((v[1:] != 0) != (v[:-1] != 0)) | (v[1:] * v[:-1] < 0)
            cuts.extend((part.start + np.flatnonzero(changes)).tolist())
        return cuts, moving, np.array(cuts).tobytes() + moving.tobytes()

    def noise(self, windows: Sequence[Window], hold: str, s: float, before: Noise | None) -> Noise:
        """The noise of the residuals, that of a held or linear force by its samples' own noise s [N].

        Where the residuals contradict s, for the force errs otherwise, by the residuals alone.
        """
        start = None if before is None else before.hidden
        kappa = 1.0 if hold == "cubic" else s**2
        known = estimate_noise(windows, kappa, self.least, start)
        if hold == "cubic":
            return known
        free = estimate_noise(windows, None, self.least, start)
        return free if free.log - known.log > CONTRADICTED else known

    def smooth(self, theta: Array, pieces: tuple[Pieces, ...]) -> SmoothForce:
        """The force as a smooth function: of the trajectory fed back, or cut into segments at its events.

        Whichever the samples of the force are likelier under.
        """
        trajectories = self.trajectories(theta, pieces)
        cuts, moving, key = self.events(trajectories)
        t, force = self.record.t, self.record.force
        if key not in self.cut:
            self.cut = {key: SmoothForce(t, force, cuts, moving)}
        cut = self.cut[key]
        if not all(m.good for m in trajectories):
            return cut
        starts, times = theta[self.count :].reshape(-1, 2), [t[q] for q in self.known]
        fed = feedback(self.run, pieces, trajectories, starts, self.full(theta), self.count, times)
        whole = SmoothForce(t, force, (self.edge[1:-1] - 1).tolist(), moving, fed)
        return whole if whole.cost < cut.cost else cut

    def force(self, hold: str) -> tuple[Pieces, ...]:
        """The force on each window before anything is known of the trajectory."""
        t, force = self.record.t, self.record.force
        if hold == "cubic":
            if self.first is None:
                self.first = SmoothForce(t, force, (), np.ones(len(t) - 1, dtype=bool))
            return tuple(self.first.pieces(q.start, q.stop) for q in self.known)
        return tuple(plain_pieces(t, force, hold, q.start, q.stop) for q in self.known)

    def trajectories(self, theta: Array, pieces: tuple[Pieces, ...]) -> tuple[DrivenTrajectory, ...]:
        """The trajectory of every window."""
        starts = theta[self.count :].reshape(-1, 2)
        return tuple(self.run.trajectories(pieces, starts, self.full(theta)))

    def full(self, theta: Array) -> Array:
        """All parameters that slopes are taken by."""
        return np.append(theta[: self.count], self.rest)

    def linear(self, theta: Array, pieces: tuple[Pieces, ...], z: tuple[Array, ...]) -> Linear:
        """Trajectories with their slopes, residuals measured - fitted, and what the force's spread adds."""
        pieces = _moved(pieces, z)
        trajectories = self.trajectories(theta, pieces)
        full = self.full(theta)
        slopes = tuple(self.run.slopes(pieces, trajectories, full))
        windows, every = [], []
        for w, (part, own) in enumerate(zip(self.known, slopes, strict=True)):
            load = np.tensordot(own.force, pieces[w].spread, axes=([1, 2], [0, 1]))
            # Linear about the force's estimate: F z is what it took from the residual.
            residual = self.record.x[part] - trajectories[w].x + load @ z[w]
            jacobian = self.jacobian(w, own)
            rest = residual - load @ z[w]
            size = float(np.std(rest - jacobian @ linalg.lstsq(jacobian, rest, rcond=None)[0]))
            load, axes = reduced(load, FINEST * size, 0.0 if pieces[w].known else COARSE)
            windows.append(Window(residual, jacobian, load))
            every.append(axes)
        return Linear(trajectories, slopes, tuple(windows), tuple(every))

    def jacobian(self, w: int, slopes: Slopes) -> Array:
        """Derivatives of a window's positions by theta."""
        out = np.zeros((len(slopes.start), self.count + 2 * (len(self.edge) - 1)))
        out[:, : self.count] = slopes.parameters[:, : self.count]
        out[:, self.count + 2 * w : self.count + 2 * w + 2] = slopes.start
        return out

    def least_squares(self, first: Array, pieces: tuple[Pieces, ...]) -> Array:
        """theta at which the sum of squares of the residuals is least."""
        kept: dict[bytes, tuple[DrivenTrajectory, ...]] = {}

        def trajectories(theta: Array) -> tuple[DrivenTrajectory, ...]:
            key = theta.tobytes()
            if key not in kept:
                kept.clear()
                kept[key] = self.trajectories(theta, pieces)
            return kept[key]

        def misfit(theta: Array) -> Array:
            rows = [m.x - self.record.x[q] for m, q in zip(trajectories(theta), self.known, strict=True)]
            self.evaluations += 1
            if self.progress is not None:
                self.progress(self.evaluations, float(np.std(np.concatenate(rows))))
            return np.concatenate(rows)

        def slope(theta: Array) -> Array:
            rows = self.run.slopes(pieces, trajectories(theta), self.full(theta), by_force=False)
            return np.concatenate([self.jacobian(w, own) for w, own in enumerate(rows)])

        found = least_squares(
            misfit, first, jac=slope, bounds=self.bounds, x_scale=np.maximum(np.abs(first), 1e-3),
            xtol=1e-8, ftol=1e-5, gtol=1e-12,
        )  # fmt: skip
        return np.asarray(found.x)


def _zero(pieces: tuple[Pieces, ...]) -> tuple[Array, ...]:
    return tuple(np.zeros(q.spread.shape[2]) for q in pieces)


def _moved(pieces: tuple[Pieces, ...], z: tuple[Array, ...]) -> tuple[Pieces, ...]:
    """The force with the factors z."""
    return tuple(replace(q, terms=q.terms + q.spread @ own) for q, own in zip(pieces, z, strict=True))
