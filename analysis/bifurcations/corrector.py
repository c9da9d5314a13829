"""Predictor and corrector of a continuation: points along a branch, in scaled unknowns z = (u, value)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.analysis.orbits.time_limit import check_time
from filippov.base.arrays import Array
from filippov.base.errors import ModelError, SolveError

FAILURES = (SolveError, ArithmeticError, np.linalg.LinAlgError, ModelError)
_ITERATIONS, _TOLERANCE, _NOISE, _FARTHEST = 12, 1e-9, 1e-6, 0.5
# Two points of a branch that are no farther apart are one.
_SAME = 1e-5
# Least cosine of the angle between an orbit and the normal of its phase condition.
_FACING = 0.5
# At this distance the matrix of one point is used for another.
_CLOSE = 1e-3


@dataclass(frozen=True)
class Along:
    """A point with the tangent there (scaled, of length 1) and the corrector it was found with."""

    corrector: Corrector
    z: Array
    tangent: Array
    point: BranchPoint

    @property
    def u(self) -> Array:
        """The unknowns."""
        return self.corrector.plain(self.z)[0]

    def moved(self) -> Along:
        """The same with the problem's phase condition moved here, the tangent taken anew."""
        old = self.corrector
        u, value = old.plain(self.z)
        towards, z, problem = self.tangent, self.z, old.problem
        rephased = getattr(problem, "rephased", lambda u, value: None)(u, value)
        if rephased is not None:
            problem, u, carried = rephased
            z = old.scaled(u, value)
            along = self.tangent * old.sizes
            towards = np.append(carried @ along, along[-1]) / old.sizes
        problem = problem.moved(u, value)
        if problem is old.problem:
            return self
        corrector = Corrector(problem, old.width)
        if rephased is None and hasattr(problem, "in_phase"):
            towards = problem.in_phase(u, value, self.tangent * old.sizes) / old.sizes
        point = self.point
        if rephased is not None:
            point = replace(point, u=tuple(u.tolist()), phase=problem.phase)
        return replace(self, corrector=corrector, z=z, tangent=corrector.tangent(z, towards), point=point)

    def turned(self) -> bool:
        """Whether an autonomous orbit passes the plane of its phase condition at a small angle: a smaller
        cycle would not reach the plane, and the equations turn back there."""
        facing = getattr(self.corrector.problem, "facing", None)
        return facing is not None and facing(self.u, self.point.value) < _FACING

    def same(self, other: Along) -> bool:
        """Whether this is the same point passed in the same direction."""
        if self.point.word != other.point.word or self.tangent[-1] * other.tangent[-1] <= 0:
            return False
        if len(self.z) == len(other.z) and self.point.phase == other.point.phase:
            return bool(np.linalg.norm(self.z - other.z) < _SAME)
        mine, theirs = ({"": p.value, **p.coordinates} for p in (self.point, other.point))
        if mine.keys() != theirs.keys() or len(self.point.multipliers) != len(other.point.multipliers):
            return False
        pairs = zip(self.point.multipliers, other.point.multipliers, strict=True)
        near = all(abs(a - b) < _SAME * (1.0 + abs(a)) for a, b in pairs)
        return near and all(abs(v - theirs[k]) < _SAME * (1.0 + abs(v)) for k, v in mine.items())


def closed_by(first: Along, current: Along, following: Along) -> Along | None:
    """The first point of a branch, found again between two later ones; None where it is not between them."""
    value = first.point.value
    if (current.point.value - value) * (following.point.value - value) > 0 or current.point.value == value:
        return None
    if current.tangent[-1] * first.tangent[-1] <= 0:
        return None
    try:
        found = current.corrector.at_value(current, following, value)
    except FAILURES:
        return None
    return found if found.same(first) else None


class Corrector:
    """Newton's method on a problem, in unknowns divided by their sizes; width: of the bounds."""

    def __init__(self, problem: Any, width: float) -> None:
        self.problem, self.width = problem, width
        self.sizes = np.append(problem.scale, width)
        # Sizes of the equations; those of an equilibrium have the units of the states and of the time.
        self._rows: Array | None = getattr(problem, "rows", None)
        # The point of the latest matrix, and the matrix.
        self._last: tuple[Array, Array] | None = None

    def scaled(self, u: Array, value: float) -> Array:
        """z."""
        return np.asarray(np.append(u, value) / self.sizes)

    def plain(self, z: Array) -> tuple[Array, float]:
        """(u, value)."""
        full = z * self.sizes
        return full[:-1], float(full[-1])

    def equations(self, z: Array, *, roughly: bool = False) -> tuple[Array, Array]:
        """Residual and matrix by z; roughly: as Newton's method needs it. Raises OutOfTimeError."""
        check_time()
        found = getattr(self.problem, "roughly", self.problem.evaluate) if roughly else self.problem.evaluate
        residual, matrix = found(*self.plain(z))
        if not np.all(np.isfinite(residual)) or not np.all(np.isfinite(matrix)):
            raise NoConvergenceError("the equations are not finite.")
        matrix = matrix * self.sizes
        if self._rows is None and getattr(self.problem, "of_units", False):
            largest = np.max(np.abs(matrix), axis=1)
            self._rows = np.where(largest > 0.0, largest, 1.0)
        if self._rows is not None:
            residual, matrix = residual / self._rows, matrix / self._rows[:, None]
        self._last = z.copy(), matrix
        return residual, matrix

    def _finished(self, z: Array, guess: Array, normal: Array) -> Array | None:
        """The solution next to z by the matrix of a nearby point, where only rounding remains.

        The matrix is most of the work; its error is proportional to the distance.
        """
        residual = getattr(self.problem, "residual", None)
        if residual is None or self._last is None or not np.linalg.norm(z - self._last[0]) < _CLOSE:
            return None
        rows = 1.0 if self._rows is None else self._rows
        left = np.append(residual(*self.plain(z)) / rows, normal @ (z - guess))
        if not np.max(np.abs(left)) < _NOISE:
            return None
        change = linalg.solve(np.vstack([self._last[1], normal]), -left)
        if not np.linalg.norm(change) < _TOLERANCE:
            return None
        word, found = self.word(z), np.asarray(z + change)
        # Next to a grazing orbit the matrix varies like a square root.
        close = np.max(np.abs(residual(*self.plain(found)) / rows)) < _TOLERANCE
        return found if close and self.word(found) == word else None

    def correct(self, guess: Array, normal: Array) -> tuple[Array, int]:
        """The solution in the plane through the guess across `normal`, and the number of iterations."""
        z, moved, last = guess.copy(), 0.0, np.inf
        for count in range(1, _ITERATIONS + 1):
            if (done := self._finished(z, guess, normal)) is not None:
                return done, count
            residual, matrix = self.equations(z, roughly=True)
            full, word = np.vstack([matrix, normal]), self.word(z)
            change = linalg.solve(full, -np.append(residual, normal @ (z - guess)))
            size = float(np.linalg.norm(change))
            moved += size
            if not np.isfinite(size) or moved > _FARTHEST or (count > 3 and size > 4 * last and size > 1e-6):
                raise NoConvergenceError("the corrector leaves the branch.")
            z = z + change
            # Changes that no longer shrink are rounding of the solutions.
            rounding = size < _NOISE and size > 0.1 * last and float(np.max(np.abs(residual))) < _NOISE
            # Beyond a non-smooth fold the method goes to and fro between the two words whose branches end
            # there, by as little as the fold is away: no solution is near.
            if (size < _TOLERANCE or rounding) and self.word(z) == word:
                return z, count
            last = size
        raise NoConvergenceError(f"the corrector does not converge (last change {last:.2g}).")

    def word(self, z: Array) -> str:
        """The mode word of the solution z, without what else describes it; "" where solutions have none."""
        return str(self.problem.word(*self.plain(z))) if hasattr(self.problem, "word") else ""

    def tangent(self, z: Array, towards: Array | None) -> Array:
        """The direction of the branch, in the sense of `towards`."""
        _, matrix = self.equations(z)
        found = _null(matrix)
        if towards is not None and found @ towards < 0:
            found = -found
        return found

    def along(self, z: Array, towards: Array | None, way: int = 1) -> Along:
        """The point at z with its tangent; without `towards`, the one in which the parameter goes `way`."""
        _, matrix = self.equations(z)
        tangent = _null(matrix)
        sense = tangent @ towards if towards is not None else tangent[-1] * way
        tangent = -tangent if sense < 0 else tangent
        point = self.problem.point(*self.plain(z))
        # The determinant with the tangent as last row changes its sign at branch points.
        sign, size = np.linalg.slogdet(np.vstack([matrix, tangent]))
        crossed = float(sign * np.exp(size / len(z)))
        tests = {**point.tests, "fold": float(tangent[-1]), "branch point": crossed}
        return Along(self, z, tangent, replace(point, tests=tests, tangent=tuple(tangent.tolist())))

    def step(self, current: Along, length: float) -> tuple[Along, int]:
        """The point at a distance along the tangent, and how many iterations it took."""
        z, count = self.correct(current.z + length * current.tangent, current.tangent)
        return self.along(z, current.tangent), count

    def at_value(self, current: Along, following: Along, value: float) -> Along:
        """The point between two where the parameter has a value."""
        a, b = current.z, following.z
        goal = value / self.width
        share = (goal - a[-1]) / (b[-1] - a[-1])
        guess = a + share * (b - a)
        normal = np.zeros_like(guess)
        normal[-1] = 1.0
        guess[-1] = goal
        z, _ = self.correct(guess, normal)
        z[-1] = goal
        found = self.along(z, current.tangent)
        return replace(found, point=replace(found.point, value=value))

    def fixed(self, u: Array, value: float) -> BranchPoint:
        """The solution at a value of the parameter."""
        normal = np.zeros(len(u) + 1)
        normal[-1] = 1.0
        z, _ = self.correct(self.scaled(u, value), normal)
        point: BranchPoint = self.problem.point(self.plain(z)[0], value)
        return point

    def settle(self, u: Array, value: float) -> Array:
        """The solution near the start. Raises NoConvergenceError where there is none or it is singular."""
        z = self.scaled(u, value)
        for _ in range(_ITERATIONS):
            residual, matrix = self.equations(z)
            change = np.append(linalg.lstsq(matrix[:, :-1], -residual, rcond=1e-12)[0], 0.0)
            z = z + change
            if np.linalg.norm(change) < _TOLERANCE:
                break
        residual, matrix = self.equations(z)
        sizes = linalg.svd(matrix, compute_uv=False)
        if sizes[-1] <= 1e-10 * max(float(sizes[0]), self._usual(z, residual) if sizes[0] < 1e-6 else 0.0):
            raise NoConvergenceError(
                "the start is singular: the equations do not fix a direction to go on. Common causes: a "
                "residual that depends on nothing, a start on a branch point, or solutions that are not "
                "isolated. Start elsewhere.", float(np.max(np.abs(residual))),
            )  # fmt: skip
        change = linalg.lstsq(matrix[:, :-1], -residual, rcond=1e-12)[0]
        if not np.linalg.norm(change) < 1e-6 or not np.max(np.abs(residual)) < 1e-6:
            raise NoConvergenceError(
                f"the start is no solution: Newton's method leaves {np.max(np.abs(residual)):.3g} of its "
                "equations. Give one nearer to it.", float(np.max(np.abs(residual))),
            )  # fmt: skip
        return z

    def _usual(self, z: Array, residual: Array) -> float:
        """The change of the residual a tenth of a unit away: the scale of its slopes."""
        moved = [self.equations(z + 0.1 * row)[0] for row in np.eye(len(z))]
        return 10.0 * max(float(np.linalg.norm(left - residual)) for left in moved)


def _null(matrix: Array) -> Array:
    """The unit vector that the matrix (m, m + 1) maps to 0."""
    _, _, rows = linalg.svd(matrix)
    return np.asarray(rows[-1], dtype=np.float64)
