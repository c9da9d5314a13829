"""Cycles of an event map by methods that share no step, event or interpolant with the solver.

A return is one smooth segment off the surface, from the point of the section with coordinate d to the next
zero of h. Two methods:

    shooting     scipy's solve_ivp(DOP853) with an event, and brentq on R^order(d) - d
    collocation  Gauss collocation of the whole orbit as one boundary-value problem in (x, T, d), by Newton

Collocation runs in c with t = T c (2 - c), so (T - t)**(1/2) is linear in 1 - c, and Gauss points avoid the
ends: a field with |h|**(1/2) is as smooth as any other. Field and Jacobian are those of the symbolic form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import SolveError, UsageError
from filippov import t as time
from filippov.analysis.algebra import linalg
from filippov.analysis.maps.event_map import EventMap
from filippov.base.arrays import Array
from filippov.model.partials import Partials

NEWTON = 40


@dataclass(frozen=True)
class Side:
    """The smooth field on one side of the surface, as functions of states (k, n).

    jacobian  (k, n, n); slope: the same with |h| held
    """

    sign: int
    field: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    slope: Callable[[Array], Array]


class Orbits:
    """Fixed points of an event map of a symbolic, autonomous system with one surface.

    Raises UsageError for another system, and from a point where the solution stays on the surface.
    """

    def __init__(self, event_map: EventMap) -> None:
        form = event_map.system.symbolic
        if form is None or len(form.s) != 1 or any(f.has(time) for f in (*form.field, *form.h)):
            raise UsageError("independent orbits need an autonomous system of expressions with one surface.")
        self.map, self.form, self.n = event_map, form, len(form.x)
        self.bound = event_map.bound
        numbers = dict(zip(form.p, (sympy.Float(v, 17) for v in event_map.p.tolist()), strict=True))
        self.gradient = np.array([float(form.h[0].diff(x).xreplace(numbers)) for x in form.x])
        self.sides = {sign: self._side(sign, numbers) for sign in (1, -1)}

    def _side(self, sign: int, numbers: dict[Any, Any]) -> Side:
        form = self.form
        put = {**numbers, form.s[0]: sympy.Integer(sign)}
        partials = Partials()
        rows = {
            "f": [f.xreplace(put) for f in form.field],
            "fx": [partials.by(f, x).xreplace(put) for f in form.field for x in form.x],
            "fa": [partials.by(f, form.a[0]).xreplace(put) for f in form.field],
        }
        made = {name: sympy.lambdify((*form.x, form.a[0]), row, "numpy") for name, row in rows.items()}

        def values(name: str, x: Array) -> Array:
            columns = made[name](*x.T, np.abs(x @ self.gradient))
            return np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), len(x)) for c in columns])

        def slope(x: Array) -> Array:
            return values("fx", x).reshape(len(x), self.n, self.n)

        def jacobian(x: Array) -> Array:
            out: Array = slope(x) + values("fa", x)[:, :, None] * (sign * self.gradient)
            return out

        return Side(sign, lambda x: values("f", x), jacobian, slope)

    def side(self, x: Array) -> Side:
        """The side to which the solution leaves the surface from x; UsageError where it stays."""
        for sign, side in self.sides.items():
            f = side.field(x[None, :])[0]
            rate = float(self.gradient @ f) * sign
            later = float(self.gradient @ side.slope(x[None, :])[0] @ f) * sign
            if rate > 1e-9 or (abs(rate) <= 1e-9 and later > 1e-12):
                return side
        raise UsageError(
            f"the solution does not leave the surface at x = {x}; independent orbits need a start that does."
        )

    # -- shooting ----------------------------------------------------------------------------------------

    def one_return(self, d: float, rtol: float) -> Any:
        """scipy's solution of one return from d, with dense output, ending on the surface."""
        x0 = self.bound.start(np.array([d]), self.map.p)[0]
        side = self.side(x0)

        def field(_: float, x: Array) -> Array:
            out: Array = side.field(x[None, :])[0]
            return out

        def height(_: float, x: Array) -> float:
            return float(self.gradient @ x)

        height.terminal, height.direction = True, -side.sign  # type: ignore[attr-defined]
        out = solve_ivp(
            field, (0.0, self.map.section.t_max), x0, "DOP853", events=height, rtol=rtol, atol=rtol * 1e-2,
            dense_output=True,
        )  # fmt: skip
        if out.status != 1:
            raise SolveError(f"scipy's solution from d = {d} did not come back: {out.message}")
        return side, out

    def shooting(self, near: float, order: int, rtol: float) -> float:
        """The fixed point of the order-th iterate next to `near`."""

        def gap(d: float) -> float:
            at = d
            for _ in range(order):
                _, out = self.one_return(at, rtol)
                at = float(out.y[self.bound.index, -1])
            return at - d

        reach = 1e-4 * abs(near)
        return float(brentq(gap, near - reach, near + reach, xtol=1e-14 * abs(near), rtol=1e-14))

    # -- collocation -------------------------------------------------------------------------------------

    def collocation(self, near: float, order: int, stages: int) -> float:
        """The same fixed point from one Newton iteration for the whole orbit."""
        rule = Rule.of(stages)
        sides, unknowns, d = [], [], near
        for _ in range(order):
            side, out = self.one_return(d, 1e-8)
            sides.append(side)
            end = float(out.t[-1])
            slopes = (end * rule.rate)[:, None] * side.field(out.sol(end * rule.time).T)
            unknowns.append(np.concatenate([slopes.ravel(), [end, d]]))
            d = float(out.y[self.bound.index, -1])
        y = np.concatenate(unknowns)
        for _ in range(NEWTON):
            residual, matrix = self._equations(y, sides, rule)
            change = linalg.solve(matrix, -residual)
            y += change
            if np.max(np.abs(change)) < 1e-13 * np.max(np.abs(y)):
                break
        else:
            raise SolveError(f"collocation at d = {near} did not converge in {NEWTON} iterations.")
        return float(y[stages * self.n + 1])

    def _equations(self, y: Array, sides: Sequence[Side], rule: Rule) -> tuple[Array, Array]:
        n, stages = self.n, len(rule.time)
        size = stages * n + 2
        residual, matrix = np.zeros(len(y)), np.zeros((len(y), len(y)))
        place = self.bound.index
        for k, side in enumerate(sides):
            low = k * size
            part = y[low : low + size]
            slopes, end, d = part[:-2].reshape(stages, n), float(part[-2]), float(part[-1])
            x0, x0_d = self.bound.start(np.array([d]), self.map.p)[0], self.bound.start_slope(d, self.map.p)
            x, last = x0 + rule.inner @ slopes, x0 + rule.weights @ slopes
            f, j = side.field(x), side.jacobian(x)
            rows = slice(low, low + stages * n)
            residual[rows] = (slopes - (end * rule.rate)[:, None] * f).ravel()
            chain = -end * np.einsum("i,iab,ij->iajb", rule.rate, j, rule.inner)
            block = chain.reshape(stages * n, stages * n)
            matrix[rows, rows] = block + np.eye(stages * n)
            matrix[rows, low + size - 2] = -(rule.rate[:, None] * f).ravel()
            matrix[rows, low + size - 1] = -(end * rule.rate[:, None] * (j @ x0_d)).ravel()
            at = low + size - 2
            residual[at] = self.gradient @ last
            matrix[at, rows] = np.outer(rule.weights, self.gradient).ravel()
            matrix[at, low + size - 1] = self.gradient @ x0_d
            following = ((k + 1) % len(sides)) * size + size - 1
            residual[at + 1] = last[place] - y[following]
            matrix[at + 1, rows] = np.outer(rule.weights, np.eye(n)[place]).ravel()
            matrix[at + 1, low + size - 1] += x0_d[place]
            matrix[at + 1, following] -= 1.0
        return residual, matrix


@dataclass(frozen=True)
class Rule:
    """Gauss collocation on [0, 1]: graded times and their rates, integrals of the Lagrange basis."""

    time: Array
    rate: Array
    inner: Array
    weights: Array

    @classmethod
    def of(cls, stages: int) -> Rule:
        """The rule with so many stages."""
        node, weight = np.polynomial.legendre.leggauss(stages)
        c = 0.5 * (node + 1.0)
        vander = np.polynomial.legendre.legvander(node, stages)
        degree = np.arange(stages)
        # Legendre coefficients of the Lagrange polynomials, and the integrals of P_k from -1.
        coefficients = (degree + 0.5)[:, None] * vander[:, :stages].T * weight
        integral = np.empty((stages, stages))
        integral[:, 0] = node + 1.0
        integral[:, 1:] = (vander[:, 2:] - vander[:, :-2]) / (2.0 * degree[1:] + 1.0)
        return cls(c * (2.0 - c), 2.0 * (1.0 - c), 0.5 * integral @ coefficients, 0.5 * weight)
