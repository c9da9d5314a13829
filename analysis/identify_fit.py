"""One fit of a driven mass to a record: the force between samples, the noise, least squares in turn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from filippov.analysis.driven_run import DrivenRun, Motion, Pieces, Slopes
from filippov.analysis.force_input import SmoothForce, plain_pieces
from filippov.analysis.record import Record
from filippov.analysis.residual_noise import Noise, Window, estimate_noise, generalised, reduced
from filippov.system import System

Array = npt.NDArray[np.float64]
# Rounds of force, noise and least squares; they end when the estimates stay within this part of their errors.
ROUNDS, SETTLED = 8, 0.1
# Rounds in which the force's kinks may still move.
PLACING = 4
# Part of the residuals' size that an unknown force may move a position by and be left out.
FINEST = 0.01


@dataclass(frozen=True)
class Linear:
    """The model about theta and a force: motions, their slopes, the windows' linear least squares.

    axes   the factors of each window as combinations of those of its force
    """

    motions: tuple[Motion, ...]
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
        """The fit from theta = first."""
        pieces, key = self.force(hold), b""
        theta, success, message = self.least_squares(first, pieces)
        noise: Noise | None = None
        z = _zero(pieces)
        for turn in range(ROUNDS):
            if turn < PLACING and hold == "cubic":
                events = self.events(self.motions(theta, _moved(pieces, z)))
                if events[2] != key:
                    pieces, key = self.smooth(events[0], events[1]), events[2]
                    z = _zero(pieces)
            linear = self.linear(theta, pieces, z)
            noise = estimate_noise(
                linear.windows, hold == "cubic", self.least, None if noise is None else noise.hidden
            )
            got = generalised(linear.windows, noise.sigma, noise.rho, noise.kappa)
            theta = np.clip(theta + got.step, *self.bounds)
            root = np.sqrt(noise.kappa)
            z = tuple(root * axes @ own for axes, own in zip(linear.axes, got.z, strict=True))
            change = got.root @ got.step
            success = bool(np.sqrt(change @ change / len(theta)) < SETTLED)
            if success and (turn + 1 >= PLACING or hold != "cubic" or turn):
                break
        linear = self.linear(theta, pieces, z)
        assert noise is not None
        noise = estimate_noise(linear.windows, hold == "cubic", self.least, noise.hidden)
        return Fit(theta, linear, noise, success, message)

    def events(self, motions: Sequence[Motion]) -> tuple[list[int], npt.NDArray[np.bool_], bytes]:
        """Intervals in which the motions stop, start or turn, which intervals move, and both as a key."""
        moving = np.ones(len(self.record.t) - 1, dtype=bool)
        cuts: list[int] = []
        for part, motion in zip(self.known, motions, strict=True):
            v = motion.v
            moving[part.start : part.stop - 1] = (v[1:] != 0) | (v[:-1] != 0)
            changes = ((v[1:] != 0) != (v[:-1] != 0)) | (v[1:] * v[:-1] < 0)
            cuts.extend((part.start + np.flatnonzero(changes)).tolist())
        return cuts, moving, np.array(cuts).tobytes() + moving.tobytes()

    def smooth(self, cuts: Sequence[int], moving: npt.NDArray[np.bool_]) -> tuple[Pieces, ...]:
        """A smooth force on each window, with kinks in the intervals `cuts`."""
        force = SmoothForce(self.record.t, self.record.force, cuts, moving)
        return tuple(force.pieces(q.start, q.stop) for q in self.known)

    def force(self, hold: str) -> tuple[Pieces, ...]:
        """The force on each window before anything is known of the motion."""
        t, force = self.record.t, self.record.force
        if hold == "cubic":
            return self.smooth((), np.ones(len(t) - 1, dtype=bool))
        return tuple(plain_pieces(t, force, hold, q.start, q.stop) for q in self.known)

    def motions(self, theta: Array, pieces: tuple[Pieces, ...]) -> tuple[Motion, ...]:
        """The motion of every window."""
        starts = theta[self.count :].reshape(-1, 2)
        return tuple(self.run.motions(pieces, starts, self.full(theta)))

    def full(self, theta: Array) -> Array:
        """All parameters that slopes are taken by."""
        return np.append(theta[: self.count], self.rest)

    def linear(self, theta: Array, pieces: tuple[Pieces, ...], z: tuple[Array, ...]) -> Linear:
        """Motions with their slopes, residuals measured - fitted, and what the force's spread adds."""
        pieces = _moved(pieces, z)
        motions = self.motions(theta, pieces)
        full = self.full(theta)
        slopes = tuple(self.run.slopes(p, m, full) for p, m in zip(pieces, motions, strict=True))
        windows, every = [], []
        for w, (part, own) in enumerate(zip(self.known, slopes, strict=True)):
            load = np.tensordot(own.force, pieces[w].spread, axes=([1, 2], [0, 1]))
            # Linear about the force's estimate: F z is what it took from the residual.
            residual = self.record.x[part] - motions[w].x + load @ z[w]
            jacobian = self.jacobian(w, own)
            rest = residual - load @ z[w]
            size = float(np.std(rest - jacobian @ np.linalg.lstsq(jacobian, rest, rcond=None)[0]))
            load, axes = reduced(load, FINEST * size)
            windows.append(Window(residual, jacobian, load))
            every.append(axes)
        return Linear(motions, slopes, tuple(windows), tuple(every))

    def jacobian(self, w: int, slopes: Slopes) -> Array:
        """Derivatives of a window's positions by theta."""
        out = np.zeros((len(slopes.start), self.count + 2 * (len(self.edge) - 1)))
        out[:, : self.count] = slopes.parameters[:, : self.count]
        out[:, self.count + 2 * w : self.count + 2 * w + 2] = slopes.start
        return out

    def least_squares(self, first: Array, pieces: tuple[Pieces, ...]) -> tuple[Array, bool, str]:
        """theta at which the sum of squares of the residuals is least."""
        kept: dict[bytes, tuple[Motion, ...]] = {}

        def motions(theta: Array) -> tuple[Motion, ...]:
            key = theta.tobytes()
            if key not in kept:
                kept.clear()
                kept[key] = self.motions(theta, pieces)
            return kept[key]

        def misfit(theta: Array) -> Array:
            rows = [m.x - self.record.x[q] for m, q in zip(motions(theta), self.known, strict=True)]
            self.evaluations += 1
            if self.progress is not None:
                self.progress(self.evaluations, float(np.std(np.concatenate(rows))))
            return np.concatenate(rows)

        def slope(theta: Array) -> Array:
            full = self.full(theta)
            rows = [
                self.run.slopes(p, m, full, by_force=False)
                for p, m in zip(pieces, motions(theta), strict=True)
            ]
            return np.concatenate([self.jacobian(w, own) for w, own in enumerate(rows)])

        found = least_squares(
            misfit, first, jac=slope, bounds=self.bounds, x_scale=np.maximum(np.abs(first), 1e-3),
            xtol=1e-8, ftol=1e-5, gtol=1e-12,
        )  # fmt: skip
        return np.asarray(found.x), bool(found.success), str(found.message)


def _zero(pieces: tuple[Pieces, ...]) -> tuple[Array, ...]:
    return tuple(np.zeros(q.spread.shape[2]) for q in pieces)


def _moved(pieces: tuple[Pieces, ...], z: tuple[Array, ...]) -> tuple[Pieces, ...]:
    """The force with the factors z."""
    return tuple(replace(q, terms=q.terms + q.spread @ own) for q, own in zip(pieces, z, strict=True))
