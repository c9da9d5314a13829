"""The effect of a tangency of a surface on a solution: the zero-time discontinuity map x -> x + c z^q + ...

z > 0 measures how far beyond the border the solution is, c is the coefficient, q the leading exponent. With
H = side h >= 0 where the solution is, F1 its field and F2 that of the other side, v2 = L_F2 H, a = L_F1^2 H,
a2 = L_F2^2 H, c3 = L_F2^3 H and U = (F2 - F1)/(v1 - v2) = (F1 - F2)/(v2 - v1):

    tangency, z = -min H of the solution that goes on as if the surface were not there
        reset x+ = R(x)              q = 1/2   -sqrt(2 a) (R_x F1 - F1)/a
        F1 != F2, both tangent       q = 1/2   2 sqrt(2/a) (L_F1 L_F2 H/a2) (F2 - F1)
        F2 points back (sliding)     q = 1     (F2 - F1)/v2
        F1 = F2 on the surface       q = 3/2   -(4 sqrt(2)/3) K/sqrt(a),  (F2 - F1)_x = K H_x
    crossing-sliding, z = v2 at the arrival       q = 2    U/(2 |a2|)
    switching-sliding, z = -v2 at the arrival     q = 3    -(2/3) w/a2^2
    adding-sliding, z = -min v2 of the sliding    q = 2    -(9/2) w/c3

with w = [F2 + v2 U, U] = U_x F2 - F2_x U - U (v2_x U), the Lie bracket of the sliding field and U. Where time
counts the formulas hold with t as a state.
Source: di Bernardo, Budd, Champneys & Kowalczyk 2008; Nordmark 1991 for the
square root; the coefficients of switching- and adding-sliding are derived by variation of constants along the
sliding flow, d/dt phi_s(-t) phi_2(t) x = -phi_s(-t)' v2 U, as tests/test_discontinuity_map.py checks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from filippov import System, UsageError
from filippov import t as time
from filippov.base.arrays import Array
from filippov.model.symbolic import lie_derivative

GRAZING = "grazing"
# Speeds and jumps below this, relative to their scales, count as 0.
_ZERO = 1e-5


@dataclass(frozen=True)
class DiscontinuityMap:
    """x -> x + vector z^exponent + higher terms.

    kind      "impact", "jump of the field", "grazing-sliding", "kink", "crossing-sliding",
              "switching-sliding" or "adding-sliding"
    exponent  q; vector: c (n,), by states
    slope     H_x (n,), the gradient of H by the states
    bend      the second derivative of H along the solution: a, a2 or c3
    """

    kind: str
    exponent: float
    vector: Array
    slope: Array
    bend: float


class _Beside:
    """Fields, H and its Lie derivatives beside one surface, in y = (x, t)."""

    def __init__(self, system: System, mode: tuple[int, ...], i: int, side: int) -> None:
        form = system.symbolic
        if form is None:
            raise UsageError("the coefficients of a grazing need a system written in expressions.")
        if any(sign == 0 for k, sign in enumerate(mode) if k != i):
            raise UsageError("another surface is slid on at the grazing; its coefficients are not known.")
        names = system.surfaces
        low, high = form.radius[i]
        self.wide = (low + 1).is_zero is not True or (high - 1).is_zero is not True
        self.reset = bool(form.reset) and form.reset[i] is not None
        y = (*form.x, time)
        first, second = ((*mode[:i], sign, *mode[i + 1 :]) for sign in (side, -side))
        self.free = form.at_mode((*mode[:i], 0, *mode[i + 1 :])) if names[i].kind == "switching" else ()
        f1, f2 = (sympy.Matrix([*form.at_mode(m), 1]) for m in (first, second))
        H = side * form.h_at_mode(first)[i]
        g = sympy.Matrix([H]).jacobian(y)
        v1, v2 = (g * f1)[0], (g * f2)[0]
        a1, a2 = lie_derivative(v1, f1, y), lie_derivative(v2, f2, y)
        self.affine = all(sympy.diff(f, form.s[i], 2) == 0 for f in self.free)
        arguments = (time, form.x, form.p)
        parts: dict[str, Any] = {
            "f1": f1, "f2": f2, "H": H, "g": g, "v1": v1, "v2": v2, "a1": a1, "a2": a2,
            "a12": lie_derivative(v2, f1, y),
        }  # fmt: skip
        self._late = {"a3": lambda: lie_derivative(a2, f2, y), "w": lambda: _bracket(f1, f2, g, v2, y),
                      "K": lambda: (f2 - f1).jacobian(y)}  # fmt: skip
        if self.reset:
            after = form.reset[i]
            assert after is not None
            signs = {s: sympy.Integer(sign) for s, sign in zip(form.s, first, strict=True)}
            states = sympy.Matrix([e.xreplace(signs).xreplace(form.sizes_at_mode(first)) for e in after])
            parts |= {"R": states, "Ry": states.jacobian(y), "v1y": sympy.Matrix([v1]).jacobian(y)}
        self._arguments, self._parts = arguments, parts
        self._functions: dict[str, Any] = {}

    def value(self, name: str, t: float, x: Array, p: Array) -> Array:
        """One part at a point, at least a row."""
        if name not in self._functions:
            part = self._parts[name] if name in self._parts else self._late[name]()
            self._functions[name] = sympy.lambdify(self._arguments, part, "numpy", cse=True)
        with np.errstate(all="ignore"):
            return np.asarray(self._functions[name](t, x, p), dtype=float)

    def number(self, name: str, t: float, x: Array, p: Array) -> float:
        """One part that is a number."""
        return float(self.value(name, t, x, p))


def _bracket(f1: Any, f2: Any, g: Any, v2: Any, y: Sequence[Any]) -> Any:
    """w, a column."""
    jump = f1 - f2
    u = -jump / (g * jump)[0]
    along = (sympy.Matrix([v2]).jacobian(y) * u)[0]
    return u.jacobian(y) * f2 - f2.jacobian(y) * u - u * along


@lru_cache(maxsize=64)
def _beside(system: System, mode: tuple[int, ...], i: int, side: int) -> _Beside:
    return _Beside(system, mode, i, side)


def discontinuity_map(
    system: System, kind: str, x: Array, t: float, p: Array, mode: tuple[int, ...], i: int, side: int
) -> DiscontinuityMap:
    """The leading term at a tangency.

    kind   "grazing" (what it is follows from the fields), "crossing-sliding", "switching-sliding",
           "adding-sliding"
    x, t   the state of the tangency and its time; p: one row of parameter values
    mode   signs of the other surfaces; i: the surface; side: +1 or -1, the side on which the solution is (for
           adding-sliding the one it does not leave to)

    Raises UsageError where the fields do not allow it, with the reason.
    """
    at = _beside(system, tuple(mode), i, side)
    f1, f2 = at.value("f1", t, x, p)[:-1, 0], at.value("f2", t, x, p)[:-1, 0]
    g = at.value("g", t, x, p).ravel()
    slope = g[:-1]
    sizes = [float(np.abs(g) @ np.abs(np.append(f, 1.0))) for f in (f1, f2)]
    if kind == GRAZING:
        return _grazing(at, (t, x, p), f1, f2, slope, max(sizes))
    name = system.surfaces[i].name
    if at.wide or not at.affine:
        what = "a set wider than the hull of its fields" if at.wide else "a field that is not affine in s"
        raise UsageError(f"surface {name!r} has {what}: the coefficients of sliding are not known for it.")
    jump, v2 = f1 - f2, at.number("v2", t, x, p)
    v1, a2 = at.number("v1", t, x, p), at.number("a2", t, x, p)
    if not v2 - v1 > _ZERO * max(sizes):
        raise UsageError(f"the solution arrives at surface {name!r} without speed: no leading term is known.")
    if kind == "crossing-sliding":
        return DiscontinuityMap(kind, 2.0, jump / (v2 - v1) / (2 * abs(a2)), slope, a2)
    w = at.value("w", t, x, p).ravel()[:-1]
    if kind == "switching-sliding":
        return DiscontinuityMap(kind, 3.0, -2 / 3 * w / a2**2, slope, a2)
    if kind == "adding-sliding":
        a3 = at.number("a3", t, x, p)
        return DiscontinuityMap(kind, 2.0, -4.5 * w / a3, slope, a3)
    raise UsageError(f"no grazing is called {kind!r}.")


def second_rate(
    system: System, x: Array, t: float, p: Array, mode: tuple[int, ...], i: int, side: int
) -> float:
    """L_F2^2 H at a point of the surface; arguments as for `discontinuity_map`."""
    return _beside(system, tuple(mode), i, side).number("a2", t, x, p)


def _grazing(at: _Beside, here: Any, f1: Array, f2: Array, slope: Array, size: float) -> DiscontinuityMap:
    a1, v2 = at.number("a1", *here), at.number("v2", *here)
    if not a1 > 0:
        raise UsageError("the solution grazes the surface to higher order (L_F1^2 H = 0): degenerate.")
    if at.reset:
        x = here[1]
        after, by = at.value("R", *here)[:, 0], at.value("Ry", *here)
        # The speed left at the tangency explains a part of what is reset.
        towards = at.value("v1y", *here).ravel()
        off = towards * at.number("v1", *here) / (towards @ towards)
        explained = by @ off - off[:-1]
        scale = np.abs(x) + np.abs(after) + np.abs(explained)
        if np.any(np.abs(after - x - explained) > _ZERO * scale):
            raise UsageError("the reset moves the state also where it is reached without speed: a jump.")
        full = np.append(f1, 1.0)
        return DiscontinuityMap("impact", 0.5, -np.sqrt(2 * a1) * (by @ full - f1) / a1, slope, a1)
    jump = f2 - f1
    if np.all(np.abs(jump) <= _ZERO * np.maximum(np.abs(f1), np.abs(f2))):
        g = at.value("g", *here).ravel()
        k = at.value("K", *here)[:-1] @ g / (g @ g)
        return DiscontinuityMap("kink", 1.5, -4 * np.sqrt(2.0) / 3 * k / np.sqrt(a1), slope, a1)
    if v2 > _ZERO * size:
        return DiscontinuityMap("grazing-sliding", 1.0, jump / v2, slope, a1)
    a2, mixed = at.number("a2", *here), at.number("a12", *here)
    if abs(v2) <= _ZERO * size and a2 > 0 and mixed > 0:
        factor = 2 * np.sqrt(2 / a1) * mixed / a2
        return DiscontinuityMap("jump of the field", 0.5, factor * jump, slope, a1)
    raise UsageError("beyond the surface the solution is carried away from it: it changes by a jump.")
