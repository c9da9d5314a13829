"""A basis carried along a solution, decomposed so often that no direction is lost to rounding.

An interval in which one direction shrinks by 1e9 beside another is taken factor by factor: modes, cut into
shorter times where need be, and events. Sliding and resets of lower rank lose directions, nothing else does.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivatives, pieces
from filippov.base.arrays import Array
from filippov.solving.solution import Solution
from filippov.solving.state.events import Mode
from filippov.solving.state.machine import Machine

# What is smaller beside the largest than `_SMALL` is known badly, and than `_LOST` not at all.
_SMALL, _LOST = 1e-9, 1e-14
# Into so many parts modes are cut, one after the other, until no direction is lost in them.
_PARTS = (1, 8, 64, 512)


@dataclass(frozen=True)
class _Factor:
    """matrix (n, n) from a time on; slides: on so many surfaces, None for the events of an instant."""

    t: float
    matrix: Array
    mode: Mode
    slides: int | None


class CarriedBasis:
    """An orthonormal basis (n, k), in units of the states in which the matrices so far are balanced.

    unresolved  how many intervals shrink a direction faster than the finest parts tell
    """

    def __init__(self, basis: Array) -> None:
        self.basis, self.unresolved = basis, 0
        n = len(basis)
        self._units, self._sizes, self._parts = np.ones(n), np.zeros((n, n)), 0

    def over(self, run: Solution, t: float, cuts: Array, settling: bool) -> list[Array | None]:
        """Carried over intervals of a solution, from t to each of the cuts.

        Of each the logarithms of the growth (k,), -inf for a lost direction; None for an interval without a
        derivative. settling: the units may still change with what these matrices tell.
        """
        out: list[Array | None] = []
        begins = [t, *cuts[:-1].tolist()]
        known: dict[int, list[list[_Factor]]] = {}
        matrices = flow_derivatives(run, cuts.tolist())
        if settling:
            known[_PARTS[0]] = _factors(run, begins, cuts, _PARTS[0])
            self._take_units([factor.matrix for factors in known[_PARTS[0]] for factor in factors])
        for i, matrix in enumerate(matrices):
            if isinstance(matrix, NotDifferentiableError):
                out.append(None)
                continue
            inside = [s for s in run.segments if s.t1 > begins[i] and s.t0 < cuts[i]]
            slides = max((s.mode.count(0) for s in inside), default=0)
            whole = _Factor(begins[i], matrix, run.mode_at(begins[i], side="+"), slides)
            found = self._carried(run, [whole], False) if self._parts == 0 else None
            while found is None:
                last = self._parts == _PARTS[-1]
                self._parts = self._parts or _PARTS[0]
                if self._parts not in known:
                    known[self._parts] = _factors(run, begins, cuts, self._parts)
                found = self._carried(run, known[self._parts][i], last)
                if found is None:
                    self._parts = _PARTS[_PARTS.index(self._parts) + 1]
            self.basis, growth = found
            out.append(growth)
        return out

    def _take_units(self, matrices: list[Array]) -> None:
        """Those in which rows and columns of all matrices so far are of one size."""
        self._sizes += sum(np.abs(matrix) for matrix in matrices)
        if not np.all(np.isfinite(self._sizes)):
            return
        units = linalg.balance(self._sizes)
        self.basis = np.linalg.qr(self.basis * (self._units / units)[:, None])[0]
        self._units = units

    def _carried(self, run: Solution, factors: list[_Factor], last: bool) -> tuple[Array, Array] | None:
        """The basis after factors and the growth, None where one of them is too long."""
        basis, (n, k) = self.basis, self.basis.shape
        total = np.zeros(k)
        for factor in factors:
            if factor.slides and 0 in factor.mode:
                normal = _normal(run, factor) * self._units
                basis = basis - linalg.pinv(normal) @ (normal @ basis)
            image = factor.matrix / self._units[:, None] * self._units @ basis
            basis, r = np.linalg.qr(image)
            sizes = np.abs(np.diag(r)) / np.max(np.abs(image), initial=1e-300)
            lost = 0 if factor.slides is None else max(0, k - (n - factor.slides))
            if factor.slides is not None and np.sum(sizes <= _SMALL) > lost:
                if not last:
                    return None
                self.unresolved += 1
            with np.errstate(divide="ignore"):
                growth = np.log(np.abs(np.diag(r)))
            # Below rounding of the matrix a direction is lost, not merely small.
            growth[sizes <= _LOST] = -np.inf
            total = total + growth
        return basis, total


def _factors(run: Solution, begins: list[float], cuts: Array, parts: int) -> list[list[_Factor]]:
    """The factors of each interval, modes cut at parts of it."""
    shares = np.arange(1, parts + 1) / parts
    fine = np.concatenate([a + (b - a) * shares for a, b in zip(begins, cuts.tolist(), strict=True)])
    fine[parts - 1 :: parts] = cuts
    out: list[list[_Factor]] = [[] for _ in begins]
    for piece, matrix in pieces(run, (), None, fine):
        into = out[int(np.searchsorted(cuts, piece.t))]
        if matrix is not None:
            n = len(matrix) - 1
            into.append(_Factor(float(piece.start[0]), matrix[:n, :n], piece.mode, piece.mode.count(0)))
        else:
            n = run.problem.system.dimension
            # An interval without a derivative is left out as a whole.
            with suppress(NotDifferentiableError):
                into.append(_Factor(piece.t, piece.saltation()[:n, :n], piece.after, None))
    return out


def _normal(run: Solution, factor: _Factor) -> Array:
    """The gradients of the surfaces that are slid on where a factor begins: (m, n)."""
    assert run.sol is not None
    machine = Machine(run.problem.system, run.options.stepper, run.problem.p)
    x = run.sol(factor.t, side="+")
    gradients, _ = machine.gradients(factor.t, x, np.array(factor.mode, dtype=float))
    return np.asarray(gradients[[i for i, sign in enumerate(factor.mode) if sign == 0]])
