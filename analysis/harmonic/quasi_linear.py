"""A system as a linear part and functions of one scalar input: x' = A x + phi(y), y = c . x + c0.

The form every describing function starts from (Lur'e form). All surfaces must be functions of y alone.
Source: Gelb & Vander Velde 1968; Khalil 2002.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Symbol

from filippov import ModelError, System, UsageError, t
from filippov.base.arrays import Array
from filippov.model.symbolic import Select

ComplexArray = npt.NDArray[np.complex128]

PANELS, SHARPER, POINTS = 9, 5.0, 16
# Denominators beyond it are those of doubles, not of a formula.
LARGEST_FRACTION = 2**20
_NODE, _WEIGHT = np.polynomial.legendre.leggauss(POINTS)
# Ends of the panels of an interval, closer to each other towards both of its ends.
_HALF = 0.5 * SHARPER ** -np.arange(PANELS - 1, -1, -1.0)
_CUTS = np.concatenate(([0.0], _HALF, 1.0 - _HALF[-2::-1], [1.0]))


@dataclass(frozen=True)
class Lure:
    """x' = A x + phi(y, s), y = c . x + offset, s_i the sign of h_i, a piecewise affine function of y.

    matrix   A, shape (n, n); row: c, shape (n,)
    phi      function (y, s) -> (n, k) of inputs y, shape (k,), and of signs s, shape (m, k)
    h        function y -> (m, k): the switching functions
    cuts     the inputs at which one of them is 0, or at an edge of its hysteresis
    widths   half width of the hysteresis of every surface
    """

    states: tuple[str, ...]
    matrix: Array
    row: Array
    offset: float
    phi: Callable[[Array, Array], Array]
    h: Callable[[Array], Array]
    cuts: tuple[float, ...]
    widths: Array

    def signs(self, y: Array) -> Array:
        """The signs along one period of inputs in order of time, shape (m, k).

        Inside its hysteresis a surface keeps the sign it had last; NaN where the period never leaves it.
        """
        h = self.h(y)
        signs = np.where(h > 0, 1.0, -1.0)
        for i in np.flatnonzero(self.widths):
            (outside,) = np.nonzero(np.abs(h[i]) > self.widths[i])
            last = np.searchsorted(outside, np.arange(y.size), side="right") - 1
            signs[i] = signs[i, outside[last]] if outside.size else np.nan
        return signs

    def least(self) -> float:
        """The amplitude about the offset from which on every surface leaves its hysteresis."""
        away = np.unique(np.abs(np.append(self.cuts, self.offset) - self.offset))
        sizes = np.maximum(np.abs(self.h(self.offset + away)), np.abs(self.h(self.offset - away)))
        left = sizes >= self.widths[:, None] * (1 - 1e-9)
        return float(np.max(away[np.argmax(np.maximum.accumulate(left, axis=1), axis=1)], initial=0.0))

    def harmonic(self, mean: float, amplitude: float, order: int = 1) -> ComplexArray:
        """Harmonic `order` of phi along y = mean + amplitude sin(theta), as a multiple of sin: shape (n,).

        Order 0 is the mean. The angle is split where a surface is reached and refined towards those places,
        because friction curves are steep there.
        """
        edges = self._edges(mean, amplitude)
        theta, weight = _nodes(edges)
        y = mean + amplitude * np.sin(theta)
        values = self.phi(y, self.signs(y))
        if order == 0:
            return (values @ weight / (2 * np.pi)).astype(complex)
        wave = np.sin(order * theta) + 1j * np.cos(order * theta)
        return np.asarray(values @ (weight * wave) / np.pi)

    def _edges(self, mean: float, amplitude: float) -> Array:
        edges = {-np.pi / 2, np.pi / 2, 3 * np.pi / 2}
        for cut in self.cuts:
            ratio = (cut - mean) / amplitude
            if abs(ratio) < 1:
                angle = float(np.arcsin(ratio))
                edges |= {angle, np.pi - angle}
        return np.array(sorted(edges))


def _nodes(edges: Array) -> tuple[Array, Array]:
    """Gauss points and weights on the intervals between edges, each split towards both of its ends."""
    points = edges[:-1, None] + np.diff(edges)[:, None] * _CUTS
    low, high = points[:, :-1, None], points[:, 1:, None]
    theta, weight = 0.5 * (low + high) + 0.5 * (high - low) * _NODE, 0.5 * (high - low) * _WEIGHT
    return theta.ravel(), weight.ravel()


def lure(system: System, surface: str, parameters: Mapping[str, float] | None = None) -> Lure:
    """Split a system whose nonlinear terms depend on the states through one surface's h alone.

    surface   the surface whose h, affine in the states, is the input y

    Raises ModelError for plain functions, explicit time, an h that is not affine, terms of other inputs, and
    states that jump.
    """
    form = system.symbolic
    if form is None:
        raise ModelError("a describing function needs a system written as expressions, not plain functions.")
    jumps = [f"surface {q.name!r}" for q in system.surfaces if q.reset is not None]
    jumps += [f"time event {q.name!r}" for q in system.time_events]
    if jumps:
        raise ModelError(
            f"the state jumps at {' and '.join(jumps)}, so it is no sine, and no describing function "
            "is defined. Find its cycles with find_orbit."
        )
    values = dict(zip(form.p, (sympy.Float(v) for v in system.parameters.resolve(parameters)), strict=True))
    index = system.surface_index(surface)
    h = [e.xreplace(values) for e in form.h]
    field = [e.xreplace(values) for e in form.field]
    if any(e.has(t) for e in (*h, *field)):
        raise ModelError("a describing function needs an autonomous system; this one depends on t.")
    gradient = [h[index].diff(x) for x in form.x]
    if any(not g.is_number for g in gradient):
        raise ModelError(
            f"surface {surface!r}: h = {h[index]} is not affine in the states, so it is no input of a "
            "describing function. Name a surface with an affine h."
        )
    row = np.array([float(g) for g in gradient])
    offset = float(h[index].xreplace(dict.fromkeys(form.x, sympy.S.Zero)))
    j = int(np.argmax(np.abs(row)))
    y = sympy.Dummy("y", real=True)
    # In fractions, so that no rounding of a coefficient remains as a second input.
    exact = [sympy.Rational(q) for q in row.tolist()]
    others = sum((exact[k] * x for k, x in enumerate(form.x) if k != j), sympy.S.Zero)
    inside = {form.x[j]: (y - sympy.Rational(offset) - others) / exact[j]}
    matrix = np.zeros((len(form.x), len(form.x)))
    rest: list[Expr] = []
    for i, f in enumerate(field):
        g = _replaced(f, inside)
        for k, x in enumerate(form.x):
            slope = sympy.simplify(g.diff(x)) if k != j else sympy.S.Zero
            if not slope.is_number:
                raise ModelError(
                    f"the equation of {x.name!r} or of others is nonlinear in {x.name!r} by itself "
                    f"(d/d{x.name} = {slope}), not only through the surface {surface!r}: no describing "
                    "function with this one input."
                )
            matrix[i, k] = float(slope)
        bare = g.xreplace(dict.fromkeys(form.x, sympy.S.Zero))
        slope = sympy.simplify(bare.diff(y))
        if slope.is_number:
            matrix[i] += float(slope) * row
            bare = sympy.expand(bare - slope * (y - offset))
        rest.append(bare)
    guard, cuts = _switches(system, [_replaced(g, inside) for g in h], y)
    function = sympy.lambdify([y, form.s, form.a], [_closed(e) for e in rest], "numpy")

    def evaluate(inputs: Array, signs: Array) -> Array:
        # Both branches of a Piecewise are computed; what is not taken may be undefined.
        with np.errstate(all="ignore"):
            rows = function(inputs, signs, np.abs(guard(inputs)))
        return np.array([np.broadcast_to(np.asarray(r, dtype=float), inputs.shape) for r in rows])

    widths = np.array([surface.width for surface in system.surfaces])
    return Lure(system.states, matrix, row, offset, evaluate, guard, cuts, widths)


def _replaced(e: Expr, inside: Mapping[Symbol, Expr]) -> Expr:
    """The expression with a state replaced, computed in fractions, its coefficients as numbers again."""
    fractions = e.xreplace({q: sympy.Rational(q) for q in e.atoms(sympy.Float) if q.is_finite})
    new = sympy.expand(fractions.xreplace(inside))
    return new.xreplace({q: sympy.Float(q) for q in new.atoms(sympy.Rational) if q.q > LARGEST_FRACTION})


def shared_input(system: System, parameters: Mapping[str, float] | None) -> str:
    """The first surface, where the h of all others differ from its own by a sign and a constant alone.

    Raises UsageError where they do not, or there is none.
    """
    names = [item.name for item in system.surfaces]
    if not names:
        raise UsageError(
            "the system has no surface, so there is no sign to describe. Write what jumps with sign: "
            "System({x: v, v: -x - sign(x)})."
        )
    form = system.symbolic
    if len(names) > 1 and form is not None:
        values = dict(zip(form.p, system.parameters.resolve(parameters).tolist(), strict=True))
        h = [e.xreplace(values) for e in form.h]
        constant = [any((e - way * h[0]).expand().is_number for way in (1, -1)) for e in h]
        if all(constant):
            return names[0]
    if len(names) != 1:
        raise UsageError(f"name the input's surface with surface=...; known: {', '.join(names)}")
    return names[0]


def width_unit(system: System, surface: str, parameters: Mapping[str, float] | None) -> float:
    """The width by which the h of a surface is divided in the system, 1 where it is not."""
    form = system.symbolic
    width = None if form is None or not form.widths else form.widths[system.surface_index(surface)]
    if form is None or width is None:
        return 1.0
    values = dict(zip(form.p, system.parameters.resolve(parameters).tolist(), strict=True))
    return float(width.xreplace(values))


def _switches(
    system: System, h: list[Expr], y: Symbol
) -> tuple[Callable[[Array], Array], tuple[float, ...]]:
    """The switching functions of the input, and the inputs at which one switches."""
    assert system.symbolic is not None
    sizes = system.symbolic.a
    functions = []
    for surface, g in zip(system.surfaces, h, strict=True):
        if g.free_symbols - {y, *sizes}:
            raise ModelError(
                f"surface {surface.name!r}: its h depends on more than the one input ({g}). A describing "
                "function has one input."
            )
        functions.append(sympy.lambdify([y, sizes], g, "numpy"))

    def guard(inputs: Array) -> Array:
        values = np.zeros((len(h), *np.shape(inputs)))
        for i, function in enumerate(functions):
            values[i] = function(inputs, np.abs(values))
        return values

    cuts: list[float] = []
    for i, surface in enumerate(system.surfaces):
        ends = [min(cuts, default=0.0) - 1.0, *sorted(cuts), max(cuts, default=0.0) + 1.0]
        found = []
        for k, (low, high) in enumerate(itertools.pairwise(ends)):
            points = low + (high - low) * np.array([0.25, 0.5, 0.75])
            first, middle, last = guard(points)[i]
            slope = (last - first) / (points[2] - points[0])
            if abs(first + last - 2 * middle) > 1e-9 * (abs(first) + abs(last)):
                raise ModelError(
                    f"surface {surface.name!r}: h = {h[i]} is no piecewise affine function of the input."
                )
            for level in {surface.width, -surface.width}:
                at = points[1] + (level - middle) / slope if slope else np.nan
                inside = (at > low or k == 0) and (at < high or k == len(ends) - 2)
                found += [float(at)] if inside and np.isfinite(at) else []
        cuts += found
    return guard, tuple(sorted(set(cuts)))


def _closed(e: Expr) -> Expr:
    """Select written as Piecewise, which evaluates on arrays."""
    if not e.args:
        return e
    args = [_closed(arg) for arg in e.args]
    if isinstance(e, Select):
        return sympy.Piecewise((args[1], args[0] > 0), (args[2], True))
    return e.func(*args)
