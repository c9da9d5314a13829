"""Equilibria in the plane by their leading homogeneous part: invariant rays, and the growth of one turn.

With the weights r and the dilation x -> l^r x, a homogeneous field is f = k nu + g tau on the unit
circle, nu = (r1 x1, r2 x2), tau = (-x2, x1). Where g = 0 a ray is invariant and the sign of k on it
decides; on a surface that the fields beside it point at, the ray slides with the convex combination that
makes g vanish. Without rays the solution turns, and the logarithm of l grows over a turn by the integral of
k/g and by what resets add. Where that is 0 and the field is reversible, the orbits are closed.
Source: Filippov 1988; Bernuau, Efimov, Perruquetti, Polyakov 2014, J. Franklin Inst.
351, 1866; reversibility: Lamb & Roberts 1998, Physica D 112, 1.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sympy
from sympy import Rational

from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.homogeneous import EPSILON, Leading, leading, lowest
from filippov.analysis.local_stability.certificates.local import Local, Signs
from filippov.base.arrays import Array

WEIGHTS = ((1, 1), (2, 1), (1, 2), (3, 2), (2, 3), (3, 1), (1, 3))
SAMPLES, CLEAR, TURN, MOST_WALKS = 720, 1e-7, 1e-7, 64
FILIPPOV = "Filippov 1988"
LEADING = "Bernuau, Efimov, Perruquetti, Polyakov 2014, J. Franklin Inst. 351, 1866"
REVERSIBLE = "Lamb & Roberts 1998, Physica D 112, 1"


def unit(angle: float) -> Array:
    """(cos, sin), with what is 0 to rounding set to 0."""
    e = np.array([math.cos(angle), math.sin(angle)])
    e[np.abs(e) < 1e-13] = 0.0
    return e


@dataclass(frozen=True)
class Arc:
    """The directions between two angles, with one field: low < high."""

    low: float
    high: float
    signs: Signs
    field: Callable[[Array], Array]
    weights: Array

    def rates(self, angle: float) -> tuple[float, float]:
        """(g, k) of a direction."""
        e = unit(angle)
        f = self.field(e)
        nu = self.weights * e
        across = nu[0] * f[1] - nu[1] * f[0]
        return float(across / (nu @ e)), float(f @ e / (nu @ e))

    @property
    def turn(self) -> float:
        """The sign of g in the middle."""
        return math.copysign(1.0, self.rates(0.5 * (self.low + self.high))[0])

    def growth(self, start: float | None = None) -> float:
        """The integral of k/|g| over the arc, from an angle inside it on where one is given."""
        from scipy.integrate import quad

        low, high = self.low, self.high
        if start is not None:
            low, high = (start, high) if self.turn > 0 else (low, start)
        marks = np.linspace(low, high, 5)

        def ratio(angle: float) -> float:
            g, k = self.rates(angle)
            return k / abs(g)

        return sum(float(quad(ratio, a, b, limit=200)[0]) for a, b in itertools.pairwise(marks))


class _UnclearError(Exception):
    """The leading part does not decide."""


def planar(found: Local) -> Certificate | None:
    """The verdict by the first weights whose leading part decides; None where none does."""
    if len(found.x) != 2:
        return None
    for weights in WEIGHTS:
        part = leading(found, [Rational(r) for r in weights])
        if part is None:
            continue
        try:
            return _decided(found, part)
        except _UnclearError:
            continue
    return None


def _arcs(found: Local, part: Leading) -> list[Arc]:
    """The arcs between the rays on which a surface lies."""
    from scipy.optimize import brentq

    x = found.x
    functions = [sympy.lambdify(x, g, "numpy") for g in part.h]
    grid = np.linspace(0.0, 2 * np.pi, 361)[:-1] + 0.0123
    edges: set[float] = set()
    for function in functions:
        values = [float(function(*unit(a))) for a in grid]
        count = 0
        for j, a in enumerate(grid):
            b = a + 2 * np.pi / 360
            if values[j] * values[(j + 1) % 360] < 0:
                root = brentq(lambda q, h=function: float(h(math.cos(q), math.sin(q))), a, b, xtol=1e-15)
                near = round(root / (np.pi / 4)) * np.pi / 4
                edges.add(float((near if abs(root - near) < 1e-12 else root) % (2 * np.pi)))
                count += 1
        if count != 2:
            raise _UnclearError
    ordered = sorted(edges)
    ordered = [a for j, a in enumerate(ordered) if j == 0 or a - ordered[j - 1] > 1e-9]
    if not ordered:
        ordered = [0.0123]
    arcs = []
    for low, high in zip(ordered, [*ordered[1:], ordered[0] + 2 * np.pi], strict=True):
        middle = unit(0.5 * (low + high))
        signs = tuple(1 if float(h(*middle)) > 0 else -1 for h in functions)
        raw = sympy.lambdify(x, [sympy.S(f) for f in part.fields[signs]], "numpy")

        def field(e: Array, raw: Callable[..., list[float]] = raw) -> Array:
            with np.errstate(all="ignore"):
                return np.array(raw(*e), dtype=float)

        arcs.append(Arc(low, high, signs, field, np.array(part.weights, dtype=float)))
    return arcs


def _decided(found: Local, part: Leading) -> Certificate:
    arcs = [arc for arc in _arcs(found, part) if _admitted(found, arc)]
    rays, size = [], 0.0
    for arc in arcs:
        more, largest = _inside(arc)
        rays += more
        size = max(size, largest)
    blocked = set(found.resets)
    whole = len(arcs) == len(_arcs(found, part))
    if whole and not blocked and len(found.h):
        rays += _edges(arcs, size)
    head = f"the leading part has the weights ({part.weights[0]}, {part.weights[1]}) and degree {part.degree}"
    if rays:
        if blocked:
            raise _UnclearError
        return _by_rays(rays, size, head)
    growth, passed = _turn(found, part, arcs) if blocked else (sum(a.growth() for a in arcs), len(arcs))
    if not blocked and len({a.turn for a in arcs}) != 1:
        raise _UnclearError
    if abs(growth) <= TURN or math.isnan(growth):
        if not blocked and _reversible(found):
            return Certificate(
                "stable", "solutions turn round it and the field is reversible: orbits beside it are closed",
                REVERSIBLE,
                (head, "no ray is invariant", "a reflection turns the field into its negative"),
            )  # fmt: skip
        raise _UnclearError
    ratio = "0" if growth == -math.inf else f"{math.exp(min(growth, 700.0)):.6g}"
    text = "solutions turn round it and come nearer" if growth < 0 else "solutions turn round it and go away"
    return Certificate(
        "asymptotically stable" if growth < 0 else "unstable",
        f"{text}: a turn multiplies the distance by {ratio}",
        LEADING,
        (head, f"no ray is invariant, {passed} sectors are passed in a turn"),
    )


def _admitted(found: Local, arc: Arc) -> bool:
    """Whether the sector is on the side of every wall from which it is reached."""
    return all(
        found.sides[k] == "both" or arc.signs[k] == (1 if found.sides[k] == "+" else -1) for k in found.resets
    )


def _inside(arc: Arc) -> tuple[list[tuple[float, bool]], float]:
    """(k, whether g changes its sign there) of the rays inside an arc, and the size of the field."""
    from scipy.optimize import brentq

    count = max(16, int(SAMPLES * (arc.high - arc.low) / (2 * np.pi)))
    angles = np.linspace(arc.low, arc.high, count + 1)
    rates = np.array([arc.rates(float(a)) for a in angles])
    if not np.all(np.isfinite(rates)):
        raise _UnclearError
    size = float(np.max(np.abs(rates)))
    if size == 0.0:
        raise _UnclearError
    g = rates[:, 0]
    rays = []
    for j in range(count):
        if g[j] * g[j + 1] < 0:
            root = brentq(lambda q: arc.rates(q)[0], angles[j], angles[j + 1], xtol=1e-14)
            rays.append((arc.rates(root)[1], True))
    for j in range(1, count):
        if abs(g[j]) <= CLEAR * size:
            rays.append((float(rates[j, 1]), bool(g[j - 1] * g[j + 1] < 0)))
        elif 0 < abs(g[j]) <= min(abs(g[j - 1]), abs(g[j + 1])) and abs(g[j]) < 1e-3 * size:
            # g may touch 0 between the samples.
            rays.append((float(rates[j, 1]), False))
    return rays, size


def _edges(arcs: list[Arc], size: float) -> list[tuple[float, bool]]:
    """(k, True) of the rays on surfaces that slide, by attraction or repulsion."""
    rays = []
    for before, after in zip(arcs, [*arcs[1:], arcs[0]], strict=True):
        (g0, k0), (g1, k1) = before.rates(before.high), after.rates(after.low)
        still = [abs(g) <= CLEAR * size for g in (g0, g1)]
        if all(still) and abs(k0 - k1) <= CLEAR * size:
            rays.append((k0, False))
            continue
        if any(still):
            raise _UnclearError
        if g0 * g1 < 0:
            rays.append(((k1 * g0 - k0 * g1) / (g0 - g1), True))
    return rays


def _by_rays(rays: list[tuple[float, bool]], size: float, head: str) -> Certificate:
    largest = max(k for k, _ in rays)
    if largest < -CLEAR * size:
        text = f"all {len(rays)} invariant rays lead to it, and every solution comes along one of them"
        return Certificate("asymptotically stable", text, FILIPPOV, (head, f"largest rate {largest:.6g} < 0"))
    away = max((k for k, simple in rays if simple), default=0.0)
    if away > CLEAR * size:
        return Certificate(
            "unstable", "an invariant ray leads away", FILIPPOV, (head, f"rate {away:.6g} > 0")
        )
    raise _UnclearError


def _turn(found: Local, part: Leading, arcs: list[Arc]) -> tuple[float, int]:
    """The growth of one turn through the sectors with the resets between them, and how many are passed."""
    resets = {k: _leading_reset(found, part, k) for k in found.resets}
    start = arcs[0]
    arc, total, seen = start, 0.0, []
    for _ in range(MOST_WALKS):
        seen.append(arc)
        total += arc.growth()
        angle = arc.high if arc.turn > 0 else arc.low
        e = unit(angle)
        on = [
            k for k in found.resets if abs(float(part.h[k].subs(dict(zip(found.x, e, strict=True))))) < 1e-12
        ]
        arc, more = _next(arcs, arc, angle, [resets[k] for k in on])
        total += more
        if more == -math.inf or arc is start:
            if len(seen) != len(arcs):
                raise _UnclearError
            return total, len(seen)
    raise _UnclearError


def _leading_reset(found: Local, part: Leading, k: int) -> Callable[[Array], Array]:
    """The part of a reset that is homogeneous for the weights."""
    scale = {x: EPSILON**r * x for x, r in zip(found.x, part.weights, strict=True)}
    rows = []
    for e, r in zip(found.resets[k], part.weights, strict=True):
        low = lowest(e.xreplace(scale))
        if low is None or (low[1] != 0 and low[0] < r):
            raise _UnclearError
        rows.append(low[1] if low[0] == r else sympy.S.Zero)
    raw = sympy.lambdify(found.x, rows, "numpy")
    return lambda e: np.array(raw(*e), dtype=float)


def _next(
    arcs: list[Arc], arc: Arc, angle: float, resets: list[Callable[[Array], Array]]
) -> tuple[Arc, float]:
    """The arc that follows, and the logarithm by which a reset multiplies the distance."""
    if len(resets) > 1:
        raise _UnclearError
    place, growth = angle % (2 * np.pi), 0.0
    if resets:
        z = resets[0](unit(angle))
        if np.all(np.abs(z) < 1e-13):
            return arc, -math.inf
        growth, e = _polar(z, arc.weights)
        place = math.atan2(e[1], e[0]) % (2 * np.pi)
    for other in arcs:
        starts = other.low if other.turn > 0 else other.high
        if abs((starts - place + np.pi) % (2 * np.pi) - np.pi) < 1e-9:
            return other, growth
    raise _UnclearError


def _polar(z: Array, weights: Array) -> tuple[float, Array]:
    """(log l, e) with z = l^r e and |e| = 1."""
    from scipy.optimize import brentq

    def off(q: float) -> float:
        return float(np.sum((z * np.exp(-weights * q)) ** 2) - 1.0)

    q = float(brentq(off, -60.0, 60.0, xtol=1e-14))
    return q, z * np.exp(-weights * q)


def _reversible(found: Local) -> bool:
    """Whether R f(R x) = -f(x) for a reflection R of one state, on all sides."""
    if found.resets:
        return False
    for j in (0, 1):
        put = {found.x[j]: -found.x[j]}
        turned = []
        for h in found.h:
            g = h.subs(put)
            turned.append(1 if sympy.expand(g - h) == 0 else (-1 if sympy.expand(g + h) == 0 else 0))
        if 0 in turned:
            continue
        if all(
            sympy.simplify(f.subs(put) * (-1 if i == j else 1) + g) == 0
            for signs, row in found.fields.items()
            for i, (f, g) in enumerate(
                zip(found.fields[tuple(a * b for a, b in zip(signs, turned, strict=True))], row, strict=True)
            )
        ):
            return True
    return False
