"""Saddles and pseudo-saddles: where they are, and the directions in which motions leave and come.

On attracting sliding the state is pressed onto its surfaces, on repelling sliding it leaves them at will; so
the surfaces count as stable or unstable directions beside the eigenvalues of the sliding field along them:

    unstable dimension = number of Re > 0 (+ surfaces that repel),  stable = number of Re < 0 (+ those that
    attract)

Source: Kuznetsov, Rinaldi & Gragnani 2003, Int. J. Bifurcation Chaos 13, 2157 (pseudo-saddles);
Filippov 1988.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from filippov.analysis.orbits.shooting import resolved, velocity_at
from filippov.analysis.sensitivity.variation import mode_field
from filippov.analysis.steady.forcing import is_forced
from filippov.base.errors import SolveError, UsageError
from filippov.base.status import mode_text
from filippov.model.system import System
from filippov.solving.state.options import check_state

Array = npt.NDArray[np.float64]
Mode = tuple[int, ...]
Side = Literal["stable", "unstable"]
NEWTON, EDGE = 60, 1e-6
# Real parts below this share of the largest eigenvalue do not decide.
ZERO = 1e-7


@dataclass(frozen=True, eq=False)
class Saddle:
    """An equilibrium with motions that leave it and motions that come to it.

    x, mode     the state, and the signs of the surfaces, 0 where it lies on them
    values      eigenvalues of the field, or of the sliding field along its surfaces
    vectors     their eigenvectors, (n, number)
    normal      "" without sliding, "attracts" or "repels" for the surfaces
    """

    system: System
    parameters: Mapping[str, float]
    x: Array
    mode: Mode
    values: npt.NDArray[np.complex128]
    vectors: npt.NDArray[np.complex128]
    normal: str = ""

    @property
    def kind(self) -> str:
        """What it is called."""
        return "pseudo-saddle" if self.normal else "saddle"

    def dimension(self, side: Side) -> int:
        """Dimension of its stable or unstable manifold."""
        sign = 1 if side == "unstable" else -1
        surfaces = self.normal == ("repels" if side == "unstable" else "attracts")
        on = sum(s == 0 for s in self.mode) if surfaces else 0
        return int(np.sum(sign * self.values.real > 0)) + on

    def direction(self, side: Side) -> Array | None:
        """The unit eigenvector of a curve; None where motions reach it across its surface."""
        sign = 1 if side == "unstable" else -1
        found = np.flatnonzero(sign * self.values.real > 0)
        if not found.size:
            return None
        vector = np.real(self.vectors[:, found[0]])
        vector = vector / np.linalg.norm(vector)
        # The same direction every time: its largest entry is positive.
        return np.asarray(vector * np.sign(vector[np.argmax(np.abs(vector))]))


def saddle(
    system: System, near: Any, *, parameters: Mapping[str, float] | None = None, mode: str | None = None
) -> Saddle:
    """The saddle near a state, by Newton's method in its mode.

    near   a state, in order or by name; mode: such as "+0"; default: the signs of h there, 0 where |h| is
           below 1e-6 of the state's size

    Raises SolveError where there is no equilibrium in this mode near the state, UsageError where it is no
    saddle or the system depends on time.
    """
    if is_forced(system):
        raise UsageError("the system depends on time and has no saddles; give an orbit (find_orbit).")
    p, x = resolved(system, parameters), check_state(near, system)
    signs = _mode(system, x, p, mode)
    part = mode_field(system, signs)
    n, on = system.dimension, [i for i, s in enumerate(signs) if s == 0]
    time = np.zeros(1)
    for _ in range(NEWTON):
        state = x[None, :]
        s = part.multipliers(time, state, p)
        f = part.part("f", time, state, s, p)[0, :, 0]
        h = part.part("h", time, state, s, p)[0, on, 0]
        slope = part.part("hy", time, state, s, p)[0, on, :n]
        rows = np.vstack([part.matrix(time, state, s, p)[0, :n, :n], slope])
        left = np.concatenate([f, h])
        if not (np.all(np.isfinite(rows)) and np.all(np.isfinite(left))):
            break
        change = np.linalg.lstsq(rows, left, rcond=1e-12)[0]
        x = x - change
        if np.max(np.abs(change)) <= 1e-14 * (1.0 + np.max(np.abs(x))):
            break
    state = x[None, :]
    s = part.multipliers(time, state, p)
    A = part.matrix(time, state, s, p)[0, :n, :n]
    f = part.part("f", time, state, s, p)[0, :, 0]
    text = mode_text(signs)
    scale = 1.0 + (float(np.max(np.abs(A))) if np.all(np.isfinite(A)) else 0.0)
    if not np.all(np.isfinite(x)) or not np.max(np.abs(f)) <= 1e-9 * scale:
        raise SolveError(
            f"Newton's method found no equilibrium in mode {text!r} near {np.round(near_text(near), 6)}."
        )
    _check_mode(part, signs, time, x, s, p, system)
    slope = part.part("hy", time, state, s, p)[0, on, :n]
    basis = np.linalg.svd(slope)[2][len(on) :].T if on else np.eye(n)
    values, vectors = np.linalg.eig(basis.T @ A @ basis)
    if np.any(np.abs(values.real) <= ZERO * max(1e-300, float(np.max(np.abs(values))))):
        raise UsageError(
            f"the equilibrium {_at(x)} has eigenvalues {_listed(values)}: one of them does not decide."
        )
    found = Saddle(
        system, dict(zip(system.parameters.names, p.tolist(), strict=True)), x, signs, values.astype(complex),
        (basis @ vectors).astype(complex), _normal(system, signs, on, x, p, slope) if on else "",
    )  # fmt: skip
    if not (found.dimension("stable") and found.dimension("unstable")):
        raise UsageError(
            f"the equilibrium {_at(x)} in mode {text!r} has eigenvalues {_listed(values)}"
            f"{', and its surface ' + found.normal if found.normal else ''}: it is no saddle, there is "
            "no such manifold to be drawn."
        )
    return found


def near_text(near: Any) -> Array:
    """The numbers of a state given in order or by name."""
    return np.array(list(near.values()) if isinstance(near, Mapping) else near, dtype=float)


def _mode(system: System, x: Array, p: Array, given: str | None) -> Mode:
    count = len(system.surfaces)
    if given is not None:
        if len(given) != count or set(given) - set("+0-"):
            raise UsageError(f"mode is {given!r}, expected {count} of the signs +, 0 and -.")
        return tuple({"+": 1, "0": 0, "-": -1}[c] for c in given)
    part = mode_field(system, (1,) * count)
    time, state = np.zeros(1), x[None, :]
    signs = np.ones((1, count))
    h = part.part("h", time, state, signs, p)[0, :, 0] if count else np.zeros(0)
    size = EDGE * (1.0 + float(np.max(np.abs(x))))
    jumps = [surface.kind == "switching" for surface in system.surfaces]
    return tuple(
        0 if abs(v) <= size and jump else (1 if v >= 0 else -1) for v, jump in zip(h, jumps, strict=True)
    )


def _check_mode(part: Any, signs: Mode, time: Array, x: Array, s: Array, p: Array, system: System) -> None:
    """Refuse an equilibrium that lies outside of its mode."""
    h = part.part("h", time, x[None, :], s, p)[0, :, 0] if signs else np.zeros(0)
    for i, sign in enumerate(signs):
        surface = system.surfaces[i]
        if (
            sign == 0
            and isinstance(surface.radius[0], float | int)
            and isinstance(surface.radius[1], float | int)
        ):
            low, high = float(surface.radius[0]), float(surface.radius[1])
            if not low < s[0, i] < high:
                raise SolveError(
                    f"the equilibrium {_at(x)} needs s = {s[0, i]:.6g} on {surface.name!r}, outside of "
                    f"({low:g}, {high:g}): it is not one of the inclusion."
                )
        elif sign and surface.kind != "observer" and sign * h[i] < 0:
            raise SolveError(
                f"the equilibrium {_at(x)} of mode {mode_text(signs)!r} lies on the other side of "
                f"{surface.name!r}: it is virtual."
            )


def _normal(system: System, signs: Mode, on: list[int], x: Array, p: Array, slope: Array) -> str:
    """Whether the fields beside the surface point to it or away from it."""
    if len(on) > 1:
        raise UsageError(
            f"the equilibrium {_at(x)} lies on {len(on)} surfaces; manifolds are drawn of those on one."
        )
    rates = []
    for side in (1, -1):
        beside = tuple(side if i == on[0] else s for i, s in enumerate(signs))
        rates.append(side * float(slope[0] @ velocity_at(system, beside, 0.0, x, p)))
    if max(rates) < 0:
        return "attracts"
    if min(rates) > 0:
        return "repels"
    raise UsageError(
        f"the fields beside {system.surfaces[on[0]].name!r} at {_at(x)} neither both point to it nor "
        "both away."
    )


def _at(x: Array) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in x) + ")"


def _listed(values: Any) -> str:
    return ", ".join(
        f"{v.real:.4g}" if v.imag == 0 else f"{v:.4g}" for v in np.asarray(values, dtype=complex)
    )
