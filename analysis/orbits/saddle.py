"""Saddles and pseudo-saddles: their places, and the directions in which solutions leave and arrive.

On attracting sliding the state is pressed onto its surfaces, on repelling sliding it can leave them at any
time; so the surfaces count as stable or unstable directions in addition to the eigenvalues of the sliding
field along them:

    unstable dimension = number of Re > 0 (+ surfaces that repel),  stable = number of Re < 0 (+ those that
    attract)

Source: Kuznetsov, Rinaldi & Gragnani 2003, Int. J. Bifurcation Chaos 13, 2157 (pseudo-saddles);
Filippov 1988.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from filippov import SolveError, System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.orbits.shooting import NoConvergenceError, resolved, velocity_at
from filippov.analysis.sensitivity.variation import mode_field, signs_at
from filippov.analysis.steady.forcing import is_forced
from filippov.base.arrays import Array
from filippov.base.keywords import keywords
from filippov.base.status import mode_text
from filippov.solving.state.events import Mode
from filippov.solving.state.options import check_state

Side = Literal["stable", "unstable"]
NEWTON, EDGE = 60, 1e-6
# Real parts below this share of the largest eigenvalue do not decide.
ZERO = 1e-7


@dataclass(frozen=True, eq=False)
class Saddle:
    """An equilibrium with solutions that leave it and solutions that approach it.

    x, mode     the state, and the signs of the surfaces, 0 where it lies on them
    eigenvalues of the field, or of the sliding field along its surfaces, largest real part first
    vectors     their eigenvectors (n, number); rows: left eigenvectors (number, n)
    matrix      of the linearised field (n, n); normals: gradients of the surfaces that it slides on (k, n)
    """

    system: System
    parameters: Mapping[str, float]
    x: Array
    mode: Mode
    eigenvalues: npt.NDArray[np.complex128]
    vectors: npt.NDArray[np.complex128]
    rows: npt.NDArray[np.complex128]
    matrix: Array
    normals: Array

    @property
    def kind(self) -> str:
        """What it is called."""
        return "pseudo-saddle" if 0 in self.mode else "saddle"

    @cached_property
    def normal(self) -> str:
        """Without sliding "", else whether solution beside its surface "attracts" or "repels". Raises
        UsageError where it is neither, and on several surfaces."""
        return _normal(self) if 0 in self.mode else ""

    @property
    def undecided(self) -> bool:
        """Whether an eigenvalue has no real part to speak of."""
        size = float(np.max(np.abs(self.eigenvalues), initial=1e-300))
        return bool(np.any(np.abs(self.eigenvalues.real) <= ZERO * size))

    def growing(self, side: Side) -> npt.NDArray[np.intp]:
        """Places of the eigenvalues of the unstable, or stable, side."""
        return np.flatnonzero((1 if side == "unstable" else -1) * self.eigenvalues.real > 0)

    def dimension(self, side: Side) -> int:
        """Dimension of its stable or unstable manifold."""
        surfaces = self.normal == ("repels" if side == "unstable" else "attracts")
        return self.growing(side).size + (len(self.normals) if surfaces else 0)

    def direction(self, side: Side) -> Array | None:
        """The unit eigenvector of a curve; None where solutions reach it across its surface."""
        found = self.growing(side)
        if not found.size:
            return None
        vector = np.real(self.vectors[:, found[0]])
        vector = vector / np.linalg.norm(vector)
        # The same direction every time: its largest entry is positive.
        return np.asarray(vector * np.sign(vector[np.argmax(np.abs(vector))]))

    @property
    def unstable(self) -> Array:
        """The direction in which solutions leave a saddle that has one unstable eigenvalue."""
        direction = self.direction("unstable")
        assert direction is not None
        return direction

    @property
    def left(self) -> Array:
        """The row l of its one unstable eigenvalue: l (x1 - x) = 0 on the linearised stable manifold, and 1
        at `unstable`."""
        row = np.real(self.rows[self.growing("unstable")[0]])
        return np.asarray(row / (row @ self.unstable))

    @property
    def stable(self) -> int:
        """The number of directions along which solutions approach it asymptotically."""
        return self.growing("stable").size


def find_saddle(
    system: System, mode: Mode, near: Any, p: Array, jacobian: Callable[..., Any] | None = None
) -> Saddle:
    """The equilibrium of the field of a mode next to a state, by Newton's method, whatever its eigenvalues.

    In modes that slide it is one of the sliding field, on its surfaces. Raises NoConvergenceError.
    """
    part, n, time = mode_field(system, mode, (), jacobian), system.dimension, np.zeros(1)
    on = [i for i, sign in enumerate(mode) if sign == 0]
    x, text = np.asarray(near, dtype=float).copy(), mode_text(mode)
    told = NoConvergenceError(
        f"Newton's method found no equilibrium in mode {text!r} near {_at(np.asarray(near))}. Give another "
        "state or mode."
    )

    def linearised(x: Array) -> tuple[Array, Array, Array]:
        """Residual, matrix of the field and gradients of the surfaces."""
        state = x[None, :]
        s = part.multipliers(time, state, p)
        f = part.velocity(time, state, s, p)[0, :n]
        h = part.part("held", time, state, s, p)[0, :, 0]
        normals = part.part("heldy", time, state, s, p)[0, :, :n]
        values = np.append(f, h), part.matrix(time, state, s, p)[0, :n, :n], normals
        if not all(np.all(np.isfinite(value)) for value in values):
            raise told
        return values

    for _ in range(NEWTON):
        left, matrix, normals = linearised(x)
        change = linalg.lstsq(np.vstack([matrix, normals]), left, rcond=1e-12)[0]
        x = x - change
        if np.max(np.abs(change)) <= 1e-14 * (1.0 + np.max(np.abs(x))):
            break
    left, matrix, normals = linearised(x)
    if not np.max(np.abs(left)) <= 1e-9 * (1.0 + np.max(np.abs(matrix))):
        raise told
    basis = linalg.null_space(normals) if on else np.eye(n)
    empty = np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))
    found: Any = linalg.eig_both(basis.T @ matrix @ basis) if basis.size else empty
    values, rows, vectors = found
    order = np.argsort(-values.real)
    vectors, rows = vectors[:, order].astype(complex), rows[:, order].conj().T.astype(complex)
    named = dict(zip(system.parameters.names, p.tolist(), strict=True))
    values = values[order].astype(complex)
    return Saddle(system, named, x, mode, values, basis @ vectors, rows @ basis.T, matrix, normals)


@keywords()
def saddle(
    system: System, near: Any, *, parameters: Mapping[str, float] | None = None,
    mode: str | Sequence[int] | None = None,
) -> Saddle:  # fmt: skip
    """The saddle near a state, by Newton's method in its mode.

    near   a state, in order or by name; mode: such as "+0"; default: the signs of h there, 0 where |h| is
           below 1e-6 or 1e-6 of the state's size, of which the one with the equilibrium nearest to the state

    Raises SolveError where there is no equilibrium in this mode near the state, UsageError where it is no
    saddle or the system depends on time.
    """
    if is_forced(system):
        raise UsageError("the system depends on time and has no saddles; give an orbit (find_orbit).")
    p, x = resolved(system, parameters), check_state(near, system)
    found = _nearest(system, x, p) if mode is None else _in_mode(system, given_mode(system, mode), x, p)
    listed = f"{_at(found.x)} has eigenvalues {_listed(found.eigenvalues)}"
    if found.undecided:
        raise UsageError(f"the equilibrium {listed}: one of them does not decide.")
    if not (found.dimension("stable") and found.dimension("unstable")):
        raise UsageError(
            f"the equilibrium {listed} in mode {mode_text(found.mode)!r}"
            f"{', and its surface ' + found.normal if found.normal else ''}: it is no saddle, there is "
            "no such manifold to be drawn."
        )
    return found


def one_way_out(found: Saddle) -> Saddle:
    """The saddle, if it has one unstable direction. Raises NoConvergenceError."""
    if found.undecided or found.growing("unstable").size != 1:
        raise NoConvergenceError(
            f"the equilibrium {_at(found.x)} in mode {mode_text(found.mode)!r} has the eigenvalues "
            f"{_listed(found.eigenvalues)}; expected a saddle with one positive eigenvalue. Several unstable "
            "directions are not followed."
        )
    return found


def given_mode(system: System, mode: str | Sequence[int]) -> Mode:
    """The signs of a mode such as "+0", or given as numbers. Raises UsageError."""
    known = {"-": -1, "0": 0, "+": 1, "-1": -1, "1": 1}
    given = [known.get(str(sign)) for sign in mode if sign != "."]
    signs = tuple(sign for sign in given if sign is not None)
    if not len(signs) == len(given) == len(system.surfaces):
        raise UsageError(
            f"mode is {mode!r}, expected one of the signs +, 0 and - for each of {len(system.surfaces)} "
            "surfaces."
        )
    return signs


def _in_mode(system: System, mode: Mode, x: Array, p: Array) -> Saddle:
    found = find_saddle(system, mode, x, p)
    _check_mode(found, p)
    return found


def _nearest(system: System, x: Array, p: Array) -> Saddle:
    """The equilibrium nearest to x of the modes it may be in: beside a surface, or on it but for an error.

    Which of them is not told by a distance: it has a unit.
    """
    size = float(np.max(np.abs(x)))
    modes = dict.fromkeys(_signs(system, x, p, EDGE * reach) for reach in (1.0 + size, size))
    found, errors = [], []
    for mode in modes:
        try:
            found.append(_in_mode(system, mode, x, p))
        except SolveError as error:
            errors.append(error)
    if not found:
        raise errors[-1]
    return min(found, key=lambda one: (one.undecided, float(np.linalg.norm(one.x - x))))


def _signs(system: System, x: Array, p: Array, size: float) -> Mode:
    """The signs of h, 0 for surfaces on which the field jumps and whose |h| is at most this size."""
    h = signs_at(system, np.zeros(1), x[None, :], p)[0][0]
    jumps = [surface.kind == "switching" for surface in system.surfaces]
    return tuple(
        0 if abs(v) <= size and jump else (1 if v >= 0 else -1) for v, jump in zip(h, jumps, strict=True)
    )


def _check_mode(found: Saddle, p: Array) -> None:
    """Refuse an equilibrium that lies outside of its mode."""
    if not found.mode:
        return
    part, time, state = mode_field(found.system, found.mode), np.zeros(1), found.x[None, :]
    s = part.multipliers(time, state, p)
    h = part.part("h", time, state, s, p)[0, :, 0]
    for i, sign in enumerate(found.mode):
        surface = found.system.surfaces[i]
        radius = [float(r) for r in surface.radius if isinstance(r, float | int)]
        if sign == 0 and len(radius) == 2:
            low, high = radius
            if not low < s[0, i] < high:
                raise SolveError(
                    f"the equilibrium {_at(found.x)} needs s = {s[0, i]:.6g} on {surface.name!r}, outside of "
                    f"({low:g}, {high:g}): it is not one of the inclusion."
                )
        elif sign and surface.kind != "observer" and sign * h[i] < 0:
            raise SolveError(
                f"the equilibrium {_at(found.x)} of mode {mode_text(found.mode)!r} lies on the other side of "
                f"{surface.name!r}: it is virtual."
            )


def _normal(found: Saddle) -> str:
    """Whether the fields beside the surface point to it or away from it."""
    system, on = found.system, [i for i, sign in enumerate(found.mode) if sign == 0]
    if len(on) > 1:
        raise UsageError(
            f"the equilibrium {_at(found.x)} lies on {len(on)} surfaces; manifolds are drawn of those on one."
        )
    rates, p = [], resolved(system, found.parameters)
    for side in (1, -1):
        beside = tuple(side if i == on[0] else s for i, s in enumerate(found.mode))
        rates.append(side * float(found.normals[0] @ velocity_at(system, beside, 0.0, found.x, p)))
    if max(rates) < 0:
        return "attracts"
    if min(rates) > 0:
        return "repels"
    raise UsageError(
        f"the fields beside {system.surfaces[on[0]].name!r} at {_at(found.x)} neither both point to it nor "
        "both away."
    )


def _at(x: Array) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in x) + ")"


def _listed(values: Any) -> str:
    return ", ".join(
        f"{v.real:.4g}" if v.imag == 0 else f"{v:.4g}" for v in np.asarray(values, dtype=complex)
    )
