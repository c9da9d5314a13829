"""The saddle of a homoclinic orbit: place, eigenvalues, row of its stable manifold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.status import mode_text
from filippov.model.system import System
from filippov.solving.state.events import Mode

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HomoclinicSaddle:
    """An equilibrium x of the field of a mode, in sliding modes of the sliding field on its surfaces.

    eigenvalues  along the surfaces that it slides on (all of them without any), largest real part first
    unstable     unit eigenvector of the one eigenvalue with positive real part, along the surfaces, its
                 largest entry positive: (n,)
    left         row with left (x1 - x) = 0 on the linearised stable manifold, 1 at `unstable`: (n,)
    matrix       of the linearised field (n, n); normals: gradients of the surfaces it slides on (k, n)
    """

    x: Array
    mode: Mode
    eigenvalues: npt.NDArray[np.complex128]
    unstable: Array
    left: Array
    matrix: Array
    normals: Array

    @property
    def stable(self) -> int:
        """The number of directions along which motions come in for ever."""
        return len(self.eigenvalues) - 1


def find_saddle(system: System, mode: Mode, near: Array, p: Array, jacobian: Any = None) -> HomoclinicSaddle:
    """The saddle of a mode near a state, with one unstable direction. Raises NoConvergenceError."""
    field, n, t = mode_field(system, mode, (), jacobian), system.dimension, np.zeros(1)
    x = np.asarray(near, dtype=float).copy()
    size = float(np.max(np.abs(x))) + 1.0
    for _ in range(40):
        s = field.multipliers(t, x[None, :], p)
        f = field.velocity(t, x[None, :], s, p)[0, :n]
        matrix = field.matrix(t, x[None, :], s, p)[0, :n, :n]
        h = field.part("h", t, x[None, :], s, p)[0, field.sliding, 0]
        normals = field.part("hy", t, x[None, :], s, p)[0, field.sliding, :n]
        change = np.linalg.lstsq(np.vstack([matrix, normals]), -np.append(f, h), rcond=None)[0]
        x = x + change
        if not np.all(np.isfinite(x)):
            break
        if np.max(np.abs(change)) < 1e-14 * size:
            break
    text = f"mode {mode_text(mode)} near {np.asarray(near).tolist()}"
    if not (np.all(np.isfinite(x)) and np.max(np.abs(change)) < 1e-10 * size):
        raise NoConvergenceError(f"no equilibrium was found in {text}. Give another state or mode.")
    basis = scipy.linalg.null_space(normals) if len(field.sliding) else np.eye(n)
    inner = basis.T @ matrix @ basis
    values, right = np.linalg.eig(inner)
    growing = np.flatnonzero(values.real > 0)
    if len(growing) != 1 or np.any(np.abs(values.real) < 1e-9 * np.max(np.abs(values))):
        listed = ", ".join(f"{v:.6g}" for v in values)
        raise NoConvergenceError(
            f"the equilibrium {x.tolist()} in {text} has the eigenvalues {listed}; expected a saddle with "
            "one positive eigenvalue. Several unstable directions are not followed."
        )
    k = int(growing[0])
    unstable = np.real(right[:, k])
    row = np.real(np.linalg.inv(right)[k])
    row = row / (row @ unstable)
    out = basis @ unstable
    largest = int(np.argmax(np.abs(out)))
    scale = float(np.linalg.norm(out)) * float(np.sign(out[largest]))
    order = np.argsort(-values.real)
    return HomoclinicSaddle(
        x, mode, values[order].astype(complex), out / scale, basis @ row * scale, matrix, normals
    )
