"""Boundary equilibria of Filippov systems: what meets at a surface, and on which side of the parameter.

With H = side h >= 0 on the side of the equilibrium, A = F1_x, C = H_x, B = F2 there (F1 = 0) and the shift
H of the equilibrium as the parameter changes, D = dH/d(value), the equilibrium of F1 is there for D dv > 0
and the pseudo-equilibrium, A x + B l + ... = 0 on H = 0, for l = D dv/(C A^-1 B) > 0:

    C A^-1 B < 0    persistence       C A^-1 B > 0    non-smooth fold
    C B > 0         sliding attracts  C B < 0         sliding repels

The sliding field has the eigenvalues of (1 - B C/(C B)) A on C x = 0; in the plane that is one,
det A (C A^-1 B)/(C B). A planar focus that repels (for C B < 0: that attracts, with time reversed) has a
sliding cycle if the solution from the visible tangency comes back to the surface before the pseudo-saddle.
In the plane the point is a boundary focus, node or saddle by the roots of A.

On a kink, where the field is continuous, B = 0 and nothing slides. There an equilibrium of one side meets
that of the other. The Jacobians A, A' differ by a matrix c C of rank 1, so that D det A is the same on both
sides, and the equilibria are there for D dv > 0 and D' dv < 0:

    det A det A' > 0  persistence       det A det A' < 0  non-smooth fold

Source: di Bernardo, Budd, Champneys & Kowalczyk 2008; Leine & Nijmeijer 2004 (kinks); Kuznetsov, Rinaldi &
Gragnani 2003 (the three classes; their cases are described here, not numbered: later classifications count
them differently, Hogan, Homer, Jeffrey & Szalai 2016).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import ROUNDING
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem, is_kink
from filippov.analysis.bifurcations.smooth_normal_form import number
from filippov.base.arrays import Array
from filippov.base.errors import UsageError

Form = tuple[dict[str, float], str]
_ZERO, _SAMPLES, _TURNS = 1e-7, 64, 1.5
# Determinants below this part of the product of the lengths of their rows, in balanced units, are 0.
_SINGULAR, _SWEEPS = 1e-9, 30
_CHANGE = "; the stability changes there"


class BoundaryEquilibrium:
    """A, B, C, D at a boundary equilibrium, in the mode beside the surface, in units that balance A.

    problem  equilibria of that mode, or pseudo-equilibria; test: "boundary NAME", "upper NAME", "lower NAME"
    """

    def __init__(self, problem: EquilibriumProblem, test: str, u: Array, value: float) -> None:
        end, _, name = test.partition(" ")
        system = problem.system
        i = self.index = system.surface_index(name)
        n = system.dimension
        self.side = problem.mode[i] if end == "boundary" else (1 if end == "upper" else -1)
        values = dict(zip(system.parameters.names, problem.base.tolist(), strict=True))
        mode = (*problem.mode[:i], self.side, *problem.mode[i + 1 :])
        if any(m == 0 for m in mode):
            raise UsageError("another surface is slid on: the coefficients of the point are not known.")
        regular = EquilibriumProblem(system, mode, problem.parameter, u[:n], values)
        other = EquilibriumProblem(
            system, (*mode[:i], -self.side, *mode[i + 1 :]), problem.parameter, u[:n], values
        )
        at = regular._at(u[:n], value)
        radius = regular.field.part("radius", *at)[0, i]
        if np.max(np.abs(radius - (-1.0, 1.0))) > 1e-12:
            raise UsageError(f"surface {name!r} has a set wider than the hull of its fields.")
        by = regular.field.part("fy", *at)[0]
        slope = self.side * regular.field.part("hy", *at)[0, i]
        beyond = other.field.part("f", *other._at(u[:n], value))[0, :, 0]
        self.units = linalg.balance(by[:, :n])
        self.A, self.M = by[:, :n] / self.units[:, None] * self.units, by[:, n] / self.units
        self.B, self.C, self.moves = beyond / self.units, slope[:n] * self.units, float(slope[n])

    @property
    def across(self) -> float:
        """C B: positive where sliding attracts."""
        return float(self.C @ self.B)

    @property
    def bordered(self) -> float:
        """det A (C A^-1 B), also where A is singular."""
        block = np.block([[self.A, self.B[:, None]], [self.C[None, :], np.zeros((1, 1))]])
        return -float(np.linalg.det(block))

    def sliding(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of the sliding field at the pseudo-equilibrium."""
        n = len(self.B)
        basis = linalg.null_space(self.C[None, :])
        matrix = (np.eye(n) - np.outer(self.B, self.C) / self.across) @ self.A
        return np.asarray(linalg.eigvals(basis.T @ matrix @ basis), dtype=complex)

    def cycle(self) -> tuple[float, float] | None:
        """Of a planar focus at H = 1 with CB > 0: where the solution from the tangency comes back, and where
        the pseudo-equilibrium is, along the surface from the tangency; None where it does not come back."""
        sense = 1.0 if self.across > 0 else -1.0
        A, B, C = sense * self.A, sense * self.B, self.C
        tangency = linalg.solve(np.vstack([C, C @ A]), [-1.0, 0.0])
        turn = 2 * np.pi / float(np.max(np.abs(linalg.eigvals(A).imag)))

        def height(t: float) -> float:
            return 1.0 + float(C @ linalg.expm(A * t) @ tangency)

        times = np.linspace(0.05, _TURNS, _SAMPLES) * turn
        values = [height(t) for t in times]
        after = next((k for k in range(1, _SAMPLES) if values[k - 1] > 0 >= values[k]), None)
        if after is None:
            return None
        t = float(brentq(height, times[after - 1], times[after], xtol=1e-14))
        # A vector of length 1 along the surface, in the states' own units.
        along = np.array([-C[1] / self.units[1], C[0] / self.units[0]])
        along *= self.units / np.linalg.norm(along)
        back = float(along @ (linalg.expm(A * t) @ tangency - tangency))
        # A z + B l = 0 and C z = -1.
        block = np.block([[A, B[:, None]], [C[None, :], np.zeros((1, 1))]])
        pseudo = float(along @ (linalg.solve(block, [0.0, 0.0, -1.0])[:2] - tangency))
        return back, pseudo

    def form(self, value: float, width: float, name: str) -> Form:
        """Coefficients and what they predict; width: of the bounds; name: of the parameter."""
        size = float(np.linalg.norm(self.A, 2))
        if not _determinant(self.A):
            return {"C B": self.across}, "degenerate: an eigenvalue of the equilibrium is 0"
        inverse = float(self.C @ linalg.solve(self.A, self.B))
        shift = _moves(self.moves, self.C, linalg.solve(self.A, self.M))
        out = {"C A^-1 B": inverse, "C B": self.across, "dH/dvalue": shift}
        scale = float(np.linalg.norm(self.C) * np.linalg.norm(self.B))
        if min(abs(self.across), abs(inverse) * size) < _ZERO * scale:
            return out, "degenerate: the other field is tangent to the surface or the branch turns there"
        if not shift:
            return out, "degenerate: the parameter does not move the equilibrium across the surface"
        regular = _kind(linalg.eigvals(self.A))
        values = self.sliding()
        pseudo = self._pseudo(values)
        for k, v in enumerate(sorted(values.real)):
            out[f"sliding eigenvalue {k + 1}"] = float(v)
        away, back = (">", "<") if shift > 0 else ("<", ">")
        there, here = (f"for {name} {sign} {number(value, width)}" for sign in (away, back))
        cycle = self._cycle(out, inverse)
        of = f"; a boundary {regular.split()[-1]}" if len(self.B) == 2 else ""
        if inverse < 0:
            return out, f"persistence: {regular}{cycle} {there}, {pseudo} {here}{of}"
        return out, f"non-smooth fold: {regular}{cycle} and {pseudo} {there}, neither {here}{of}"

    def _pseudo(self, values: npt.NDArray[np.complex128]) -> str:
        if not values.size:
            return "a pseudo-equilibrium"
        repels = self.across < 0
        if np.all(values.real < 0):
            if repels:
                return "a pseudo-saddle" if len(self.B) == 2 else "an unstable pseudo-equilibrium"
            return "a stable pseudo-node" if len(self.B) == 2 else "a stable pseudo-equilibrium"
        if len(self.B) == 2:
            return "an unstable pseudo-node" if repels else "a pseudo-saddle"
        return "an unstable pseudo-equilibrium"

    def _cycle(self, out: dict[str, float], inverse: float) -> str:
        """The sliding cycle around a planar focus, in words; its length on the surface in units of H."""
        values = linalg.eigvals(self.A)
        if len(self.B) != 2 or not np.any(values.imag) or values[0].real * self.across <= 0:
            return ""
        found = self.cycle()
        if found is None:
            raise UsageError("the solution from the tangency does not come back within a turn and a half.")
        back, pseudo = found
        out["return"] = abs(back)
        if inverse > 0:
            out["pseudo-saddle"] = abs(pseudo)
            if abs(back) >= abs(pseudo):
                return ""
        return f" inside {'a stable' if self.across > 0 else 'an unstable'} sliding cycle"


class KinkEquilibrium:
    """The two sides at a boundary equilibrium on a kink.

    problem  equilibria of the side from which the branch comes; test: "boundary NAME"
    other    the mode in which it goes on, where kinks meet; default: the other side of the one
    """

    def __init__(
        self, problem: EquilibriumProblem, test: str, u: Array, value: float, other: str = ""
    ) -> None:
        i = problem.system.surface_index(test.partition(" ")[2])
        self.sides = problem, problem.in_mode(other, u) if other else problem.beyond([i], u)
        self.points = [side.point(u, value) for side in self.sides]
        matrices = [side.evaluate(u, value)[1] for side in self.sides]
        self.slopes = [side.inwards(i, u, value)[1] for side in self.sides]
        # With other surfaces slid on, the matrices are those of field and surfaces together.
        self.A = [matrix[:, :-1] for matrix in matrices]
        self.M = [matrix[:, -1] for matrix in matrices]
        self.dets = [_determinant(A) for A in self.A]

    def form(self, value: float, width: float, name: str) -> Form:
        """Coefficients and what they predict; width: of the bounds; name: of the parameter."""
        out = {"det A": self.dets[0], "det A beyond": self.dets[1]}
        if 0.0 in self.dets:
            return out, "degenerate: an eigenvalue of the equilibrium of one side is 0"
        moves = [
            _moves(float(slope[-1]), slope[:-1], linalg.solve(A, M))
            for A, M, slope in zip(self.A, self.M, self.slopes, strict=True)
        ]
        out |= {"dH/dvalue": moves[0], "dH/dvalue beyond": moves[1]}
        if 0.0 in moves:
            return out, "degenerate: the parameter does not move the equilibrium across the surface"
        away, back = (">", "<") if moves[0] > 0 else ("<", ">")
        there, here = (f"for {name} {sign} {number(value, width)}" for sign in (away, back))
        mine, other = (self._named(k) for k in (0, 1))
        # Beside one kink the signs of the determinants say the same.
        if moves[0] * moves[1] > 0:
            return out, f"non-smooth fold: {mine} and {other} {there}, neither {here}"
        changes = {point.verdict for point in self.points} == {"stable", "unstable"}
        return out, f"persistence: {mine} {there}, {other} {here}{_CHANGE if changes else ''}"

    def _named(self, k: int) -> str:
        """The equilibrium of one side, with its mode."""
        point = self.points[k]
        if self.sides[k].sliding:
            verdict = {"stable": "a stable", "unstable": "an unstable"}.get(point.verdict, "an undecided")
            return f"{verdict} pseudo-equilibrium in mode {point.word}"
        return f"{_kind(np.array(point.multipliers))} in mode {point.word}"


def boundary(
    problem: EquilibriumProblem, test: str, u: Array, value: float, other: str = ""
) -> BoundaryEquilibrium | KinkEquilibrium:
    """What meets at a boundary equilibrium, by the surface of a test; other: see `KinkEquilibrium`."""
    end, _, name = test.partition(" ")
    if end == "boundary" and is_kink(problem.system, problem.system.surface_index(name)):
        return KinkEquilibrium(problem, test, u, value, other)
    return BoundaryEquilibrium(problem, test, u, value)


def _determinant(matrix: Array) -> float:
    """The determinant; 0 where rounding decides its sign."""
    rows, columns = np.ones(len(matrix)), np.ones(len(matrix))
    for _ in range(_SWEEPS):
        sizes = np.abs(matrix) / rows[:, None] / columns
        rows *= np.sqrt(np.max(sizes, axis=1, initial=0.0)) + (~np.any(sizes, axis=1))
        columns *= np.sqrt(np.max(sizes, axis=0, initial=0.0)) + (~np.any(sizes, axis=0))
    scaled = matrix / rows[:, None] / columns
    found = float(np.linalg.det(scaled))
    if abs(found) <= _SINGULAR * float(np.prod(np.linalg.norm(scaled, axis=1))):
        return 0.0
    return found * float(np.prod(rows * columns))


def _moves(own: float, slope: Array, shift: Array) -> float:
    """dH/dvalue of an equilibrium that the parameter shifts by -shift; 0 where rounding decides its sign."""
    terms = [own, *(-slope * shift)]
    found = float(np.sum(terms))
    return found if abs(found) > _ZERO * float(np.sum(np.abs(terms))) else 0.0


def _kind(values: npt.NDArray[np.complex128]) -> str:
    """An equilibrium by its eigenvalues."""
    if not np.all(np.abs(values.real) > ROUNDING * np.max(np.abs(values))):
        return "an undecided equilibrium"
    if np.all(values.real < 0) or np.all(values.real > 0):
        word = "a stable" if values[0].real < 0 else "an unstable"
        if len(values) != 2:
            return f"{word} equilibrium"
        return f"{word} {'focus' if abs(values[0].imag) > 0 else 'node'}"
    return "a saddle" if len(values) == 2 else "an unstable equilibrium"
