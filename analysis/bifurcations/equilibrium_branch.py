"""Branches of equilibria and pseudo-equilibria, through the surfaces that bound them.

An equilibrium of a mode is a zero of its field; with sliding surfaces (a pseudo-equilibrium) the multipliers
are unknowns too and the surfaces are equations: f(x, s) = 0, h(x) = 0. A boundary equilibrium, where h = 0 or
a multiplier reaches the end of its set, is one of both kinds; the branch goes on as the other (di Bernardo et
al. 2008): on the other side of the parameter (persistence) or back on the same (non-smooth
fold). Nothing slides on a kink, where the field is continuous: there the branch goes on in the mode of its
other side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.attraction import attraction
from filippov.analysis.algebra.growth import Growth, by_eigenvalues, by_excess
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.equilibrium_units import branch_units
from filippov.analysis.sensitivity.variation import mode_field
from filippov.analysis.steady.forcing import depends_on_time
from filippov.base.arrays import Array
from filippov.base.changed import changed
from filippov.base.status import mode_text
from filippov.solving.state.events import Mode

# What is this near to a kink, in units of the unknowns and the parameter, lies on it.
_ON = 1e-11
# Of a multiplier: what is this near to an end of its set is there.
_AT_END = 1e-9


def is_kink(system: System, i: int) -> bool:
    """Whether the field is continuous across surface i, and its derivative is not."""
    surface = system.surfaces[i]
    return surface.kind == "kink" and surface.width == 0


class EquilibriumProblem:
    """Equilibria of one mode.

    mode   signs, 0 on sliding surfaces; start: a state near the equilibrium

    Raises UsageError for a system that depends on time and for a mode that slides on a kink.
    """

    kind = "equilibrium"
    # Whether the equations have the units of the states and of the time.
    of_units = True

    def __init__(
        self, system: System, mode: Mode, parameter: str, start: Any, parameters: Any = None,
        multipliers: Array | None = None,
    ) -> None:  # fmt: skip
        if depends_on_time(system):
            raise UsageError("the system depends on time and has no equilibria; follow its orbits.")
        for i, sign in enumerate(mode):
            if sign == 0 and is_kink(system, i):
                raise UsageError(
                    f"surface {system.surface_names[i]!r} is a kink: the field is continuous there, so that "
                    "nothing slides on it. Give the equilibrium's side of it, + or -."
                )
        self.system, self.mode, self.parameter = system, tuple(mode), parameter
        self.base = system.parameters.resolve(parameters)
        self.index = system.parameters.index(parameter)
        self.field = mode_field(system, self.mode, (parameter,))
        self.sliding = self.field.sliding
        x = np.asarray(start, dtype=float)
        s = np.zeros(len(self.sliding)) if multipliers is None else multipliers
        self.start = np.concatenate((x, s))
        self.scale = np.concatenate((np.maximum(np.abs(x), 1.0), np.ones(len(self.sliding))))
        self.rate = self._usual_sum()

    def _usual_sum(self) -> float:
        """The middle size of sums of two eigenvalues at the start: the product of all sums leaves the range
        of numbers in other units of time, or of many states."""
        at = self._at(self.start, float(self.base[self.index]))
        if not np.all(np.isfinite(self.field.part("fy", *at))):
            return 1.0
        sizes = np.abs(_sums(self._eigenvalues(at)[0]))
        sizes = sizes[sizes > 1e-12 * np.max(sizes, initial=0.0)]
        return float(np.exp(np.mean(np.log(sizes)))) if sizes.size else 1.0

    def in_units(self, value: float, width: float) -> EquilibriumProblem:
        """The same with units of the states by its equations at the start; width: of the bounds."""
        n = self.system.dimension
        units = branch_units(self.evaluate(self.start, value)[1], self.start[:n], width)
        return self._with_units(units)

    def _with_units(self, units: Array) -> EquilibriumProblem:
        return changed(self, scale=np.append(units, np.ones(len(self.sliding))))

    def p(self, value: float) -> Array:
        """Parameter values, checked against their bounds."""
        values = dict(zip(self.system.parameters.names, self.base.tolist(), strict=True))
        return np.asarray(self.system.parameters.resolve({**values, self.parameter: value}))

    def with_parameter(self, name: str, value: float) -> EquilibriumProblem:
        """The same at another value of another parameter."""
        base = self.base.copy()
        base[self.system.parameters.index(name)] = value
        return changed(self, base=base)

    def _at(self, u: Array, value: float) -> tuple[Array, Array, Array, Array]:
        n = self.system.dimension
        s = np.array(self.mode, dtype=float)[None, :]
        s[0, self.sliding] = u[n:]
        return np.zeros(1), u[None, :n], s, self.p(value)

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        at, n, k = self._at(u, value), self.system.dimension, len(self.sliding)
        part = self.field.part
        residual = np.concatenate((part("f", *at)[0, :, 0], part("h", *at)[0, self.sliding, 0]))
        matrix = np.zeros((n + k, n + k + 1))
        by, slope = part("fy", *at)[0], part("hy", *at)[0, self.sliding]
        matrix[:n, :n], matrix[:n, -1] = by[:, :n], by[:, n]
        matrix[:n, n : n + k] = part("fs", *at)[0]
        matrix[n:, :n], matrix[n:, -1] = slope[:, :n], slope[:, n]
        return residual, matrix

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        at, n = self._at(u, value), self.system.dimension
        names = self.system.surface_names
        data = dict(zip(self.system.states, u[:n].tolist(), strict=True))
        data |= {f"multiplier {names[i]}": float(u[n + k]) for k, i in enumerate(self.sliding)}
        tests: dict[str, float] = {}
        h, radius = self.field.part("h", *at)[0, :, 0], self.field.part("radius", *at)[0]
        inside = True
        for i, name in enumerate(names):
            if self.system.surfaces[i].kind == "observer":
                continue
            if self.mode[i] != 0:
                tests[f"boundary {name}"] = float(h[i]) * self.mode[i]
                inside &= tests[f"boundary {name}"] >= -1e-12
            else:
                s = u[n + self.sliding.index(i)]
                tests[f"upper {name}"] = float(radius[i, 1] - s)
                tests[f"lower {name}"] = float(s - radius[i, 0])
                inside &= bool(radius[i, 0] - 1e-12 <= s <= radius[i, 1] + 1e-12)
        values, attracts = self._eigenvalues(at)
        if self.sliding:
            tests["pseudo-Hopf"] = attracts
        if len(values) > 1:
            with np.errstate(over="ignore", invalid="ignore"):
                tests["Hopf"] = float(np.prod(_sums(values) / self.rate).real)
        told = {by_eigenvalues(values), *self._across(at, u, attracts)}
        verdict = next(word for word in ("unstable", "undecided", "stable") if word in told)
        left = float(np.max(np.abs(self.evaluate(u, value)[0])))
        return BranchPoint(
            value, tuple(u.tolist()), data, tuple(complex(v) for v in values), verdict, mode_text(self.mode),
            (mode_text(self.mode),), 0.0, tests, left, note="" if inside else "virtual",
        )  # fmt: skip

    def gradient(self, i: int, x: Array, value: float) -> Array:
        """dh/dx of surface i at a state."""
        at = (np.zeros(1), x[None, :], np.array(self.mode, dtype=float)[None, :], self.p(value))
        return np.asarray(self.field.part("hy", *at)[0, i, : len(x)])

    def _eigenvalues(self, at: tuple[Array, Array, Array, Array]) -> tuple[npt.NDArray[np.complex128], float]:
        """Eigenvalues of the linearisation along the sliding surfaces, and whether these attract (> 0)."""
        n = self.system.dimension
        if not self.sliding:
            return linalg.eigvals(self.field.part("fy", *at)[0, :, :n]).astype(complex), 1.0
        rs = self.field.part("rs", *at)[0, self.sliding]
        attracts = -float(rs[0, 0]) if len(self.sliding) == 1 else float(np.linalg.det(-rs))
        slope = self.field.part("hy", *at)[0, self.sliding, :n]
        basis = linalg.null_space(slope)
        if abs(np.linalg.det(rs)) < 1e-300 or basis.shape[1] == 0:
            return np.zeros(0, dtype=complex), attracts
        matrix = self.field.matrix(*at)[0, :n, :n]
        return linalg.eigvals(basis.T @ matrix @ basis).astype(complex), attracts

    def _across(
        self, at: tuple[Array, Array, Array, Array], u: Array, attracts: float
    ) -> tuple[Growth, ...]:
        """Whether the sliding surfaces attract, by their rates beside the point (autonomous: grad h . f)."""
        on, surfaces, n = self.sliding, self.system.surfaces, self.system.dimension
        if any(surfaces[i].reset is not None or surfaces[i].width for i in on):
            return (by_excess(-attracts, 0.0),)
        if not on:
            return ()

        def rates(s: Array) -> Array:
            signs = at[2].copy()
            signs[0, on] = s
            slope = self.field.part("hy", *at)[0, on, :n]
            return np.asarray(slope @ self.field.part("f", at[0], at[1], signs, at[3])[0, :, 0])

        middle = np.zeros(len(on))
        c = rates(middle)
        G = np.column_stack([rates(middle + e) - c for e in np.eye(len(on))])
        if len(on) == 1:
            above, below = rates(middle + 1.0), rates(middle - 1.0)
            c, G = 0.5 * (above + below), 0.5 * (above - below)[:, None]
        told = attraction(c, G, u[n:], self.field.part("radius", *at)[0][on])
        return (told, "unstable") if attracts < 0.0 else (told,)

    def ending(self, u: Array, value: float, bounds: object = None) -> BranchPoint | None:
        """The end of the branch where a multiplier is at an end beyond [-1, 1] of its set, None before it.

        At break-away the field jumps there, so that no equilibrium of the side goes on.
        """
        n, names = self.system.dimension, self.system.surface_names
        radius = self.field.part("radius", *self._at(u, value))[0]
        for s, i in zip(u[n:], self.sliding, strict=True):
            for end, side, usual in zip(radius[i], ("lower", "upper"), (-1.0, 1.0), strict=True):
                if abs(s - end) <= _AT_END and abs(end - usual) > _AT_END:
                    note = f"break-away from {names[i]}, where the field jumps: no equilibrium goes on"
                    named = self.point(u, value).named("boundary equilibrium", self.kind)
                    return replace(named, note=note, test=f"{side} {names[i]}")
        return None

    def moved(self, u: Array, value: float) -> EquilibriumProblem:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        return self

    def in_mode(self, text: str, u: Array) -> EquilibriumProblem:
        """The problem of another mode, as `mode_text` writes it, at its unknowns."""
        if text == mode_text(self.mode):
            return self
        n = self.system.dimension
        values = dict(zip(self.system.parameters.names, self.base.tolist(), strict=True))
        mode = tuple({"+": 1, "0": 0, "-": -1}[sign] for sign in text)
        new = EquilibriumProblem(self.system, mode, self.parameter, u[:n], values, u[n:])
        # The units of one branch: it may cross a kink at 0.
        return new._with_units(self.scale[:n])

    def beyond(self, kinks: Sequence[int], u: Array) -> EquilibriumProblem:
        """The problem on the other side of kinks, starting at a solution of this one that lies on them."""
        mode = tuple(-m if i in kinks else m for i, m in enumerate(self.mode))
        return self.in_mode(mode_text(mode), u)

    def inwards(self, i: int, u: Array, value: float) -> tuple[float, Array]:
        """The switching function of surface i, positive on the side of the mode, and its derivatives by the
        unknowns and the parameter."""
        at, n = self._at(u, value), self.system.dimension
        by = self.field.part("hy", *at)[0, i]
        slope = np.concatenate((by[:n], np.zeros(len(self.sliding)), by[n : n + 1]))
        return self.mode[i] * float(self.field.part("h", *at)[0, i, 0]), self.mode[i] * slope

    def lies_on(self, i: int, u: Array, value: float, width: float) -> bool:
        """Whether a solution lies on a kink; width: the unit of the parameter."""
        if self.mode[i] == 0 or not is_kink(self.system, i):
            return False
        h, slope = self.inwards(i, u, value)
        return abs(h) <= _ON * float(np.linalg.norm(slope * np.append(self.scale, width)))

    def across(self, test: str, u: Array) -> tuple[EquilibriumProblem, str]:
        """The problem on the other side of a boundary, starting there, and the test that then has to grow."""
        side, _, name = test.partition(" ")
        i = self.system.surface_index(name)
        n = self.system.dimension
        mode = list(self.mode)
        s = dict(zip(self.sliding, u[n:].tolist(), strict=True))
        if side == "boundary":
            s[i] = float(self.mode[i])
            mode[i] = 0
        else:
            mode[i] = 1 if side == "upper" else -1
            s.pop(i)
        values = dict(zip(self.system.parameters.names, self.base.tolist(), strict=True))
        new = EquilibriumProblem(
            self.system, tuple(mode), self.parameter, u[:n], values, np.array([s[j] for j in sorted(s)])
        )
        new = new._with_units(self.scale[:n])
        if mode[i] != 0:
            return new, f"boundary {name}"
        return new, f"upper {name}" if s[i] > 0 else f"lower {name}"


def _sums(values: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """a + b of all pairs."""
    i, j = np.triu_indices(len(values), 1)
    return np.asarray(values[i] + values[j])
