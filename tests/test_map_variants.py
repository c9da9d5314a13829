"""Event maps of random systems do not change with units, time, mirrors, the order of states, or a surface
that is never reached; their slopes are those of differences. Kinks, forcing, moving surfaces, tables, inputs,
resets, clocks, friction and two relays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import Abs, Input, Surface, System, Table, TimeEvent, cos, exp, sign, sin, states, t
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section

X = states("x y z")
KINDS = ("plain", "kink", "forced", "moving", "table", "input", "floor", "clock", "friction", "two")
OTHER = sympy.Rational(3, 10)


@dataclass
class Member:
    """x' = rows; returns to the section h = 0; floor and clock: what is reached and the states after it."""

    rows: list[Any]
    h: Any
    d: float
    floor: tuple[Any, dict[Any, Any]] | None = None
    clock: tuple[Any, dict[Any, Any]] | None = None


def member(kind: str, rng: np.random.Generator) -> Member:
    def draw(low: float, high: float) -> Any:
        return sympy.Rational(round(10 * rng.uniform(low, high)), 10)

    n = 2 if rng.random() < 0.6 else 3
    x, y, *more = X[:n]
    rows = [y, -draw(0.8, 3) * x - draw(-0.5, 0.15) * y]
    if more:
        rows[0] += draw(-0.3, 0.3) * more[0]
        rows.append(draw(-1, 1) * x - draw(0.3, 1.5) * more[0])
    h = y + draw(-0.3, 0.3) * x
    if kind == "moving":
        h -= draw(0.2, 0.8) * sin(draw(0.6, 2) * t + draw(0, 1))
    rows[1] -= draw(0.1, 0.5) * sign(h)
    out = Member(rows, h, float(rng.uniform(0.4, 2.5) * rng.choice([-1, 1])))
    if kind == "kink":
        rows[1] += draw(-0.6, 0.6) * Abs(x - draw(0.1, 0.6))
    if kind == "forced":
        rows[1] += draw(0.3, 1.2) * cos(draw(0.6, 2) * t + draw(0, 3))
    if kind == "table":
        rows[1] -= Table(np.linspace(-20, 20, 9), rng.uniform(-0.5, 0.5, 9))(x)
    if kind == "input":
        order = str(rng.choice(["linear", "cubic", "hold"]))
        rows[1] += Input("road", np.linspace(0, 40, 61), 0.6 * rng.normal(size=61), kind=order)
    if kind == "floor":
        out.floor = (x + draw(0.3, 1.2), {y: -draw(0.3, 0.95) * y})
    if kind == "clock":
        out.clock = (draw(0.4, 1.7), {x: x * draw(0.7, 1.1) + draw(-0.1, 0.1), y: y * draw(0.6, 1.2)})
    if kind == "friction":
        rows[1] -= draw(0.1, 0.2) * sign(h) * draw(0.2, 1) * exp(-3 * Abs(h))
    if kind == "two":
        rows[1] -= draw(0.2, 0.8) * sign(x - draw(-0.5, 0.5))
        rows[0] -= draw(-0.2, 0.4) * sign(x + draw(-0.4, 0.4) * y)
    return out


def variant(a: Member, scales: Any, k: Any = 1, far: bool = False, order: Any = None) -> EventMap:
    """The second return in the states scales * x and time t/k; far: with a surface that is not reached."""
    n = len(a.rows)
    back = {e: e / s for e, s in zip(X, scales, strict=False)} | {t: t * k}

    def moved(e: Any) -> Any:
        return sympy.sympify(e).subs(back, simultaneous=True)

    def after(jump: dict[Any, Any]) -> dict[Any, Any]:
        return {e: scales[X.index(e)] * moved(v) for e, v in jump.items()}

    rows = [k * s * moved(e) for e, s in zip(a.rows, scales, strict=True)]
    if far:
        rows[0] += sign(X[1] + X[0] + 100003) - 1
    h = moved(a.h)
    surfaces = [Surface("section", h)]
    if a.floor is not None:
        surfaces.append(Surface("floor", moved(a.floor[0]), reset=after(a.floor[1])))
    clocks = []
    if a.clock is not None:
        clocks = [TimeEvent("clock", period=a.clock[0] / k, start=a.clock[0] / k, reset=after(a.clock[1]))]
    at = {X[0]: sympy.Symbol("d")} | ({X[2]: OTHER * scales[2]} if n == 3 else {})
    (y,) = sympy.solve(h.subs(t, 0).subs(at), X[1])
    start = {e.name: str({**at, X[1]: y}[e]) for e in X[:n]}
    system = System({X[i]: rows[i] for i in order or range(n)}, surfaces=surfaces, time_events=clocks)
    section = Section("section", "crossing", X[0].name, start, t_max=float(25 / k))
    return EventMap(system, section, order=2, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_maps_and_slopes_do_not_change_with_units_order_or_surfaces_far_away(kind: str) -> None:
    rng = np.random.default_rng([7, KINDS.index(kind)])
    for _ in range(2):
        a = member(kind, rng)
        n, ten = len(a.rows), sympy.Integer(10)
        one = [sympy.Integer(1)] * n
        base = variant(a, one)
        value, slope = base.jet(a.d)
        assert base(a.d) == pytest.approx(value, rel=1e-9, abs=1e-9, nan_ok=True)
        fine = base.remake(rtol=1e-13, atol=1e-15)
        reach = 1e-4
        one_up, one_down, two_up, two_down = (fine(a.d + e * reach) for e in (1, -1, 2, -2))
        rough, better = one_up - one_down, (8 * (one_up - one_down) - (two_up - two_down)) / 6
        if abs(better - rough) < 1e-4 * abs(better):
            assert slope == pytest.approx(better / (2 * reach), rel=1e-5, abs=1e-6)
        scales = [[ten ** int(e) for e in rng.integers(-3, 4, n)], [int(s) for s in rng.choice([-1, 1], n)]]
        variants = [(variant(a, [sympy.sympify(s) for s in row]), row[0]) for row in scales]
        variants += [(variant(a, one, far=True), 1), (variant(a, one, order=rng.permutation(n).tolist()), 1)]
        if kind != "input":
            variants.append((variant(a, one, k=ten ** int(rng.integers(-3, 4))), 1))
        for other, scale in variants:
            image, change = other.jet(a.d * float(scale))
            assert image / float(scale) == pytest.approx(value, rel=1e-7, abs=1e-7, nan_ok=True)
            assert change == pytest.approx(slope, rel=1e-6, abs=1e-6, nan_ok=True)
