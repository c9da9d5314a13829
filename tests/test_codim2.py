"""Codimension-2 points on curves in two parameters, each in closed form, and the curves that meet there."""

from math import acos, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from command import summary
from scipy.optimize import brentq
from test_bifurcations import COARSE, SLIDING, clock, forced, map_of

from filippov import Surface, System, UsageError, parameters, sign, states
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.bifurcations.curve_switch import curves_at, switch_curve
from filippov.analysis.orbits.orbit_search import find_orbit

x, y, z = states("x y z")
FAR = {"step": 0.1, "max_step": 0.3}


def first(run: Continuation, kind: str) -> BranchPoint:
    run.run()
    return next(point for point in run.branch.special if point.special == kind)


def found(run: Continuation) -> dict[str, BranchPoint]:
    """The special points of a curve by name; each occurs once."""
    branch = run.run()
    names = [point.special for point in branch.special]
    assert len(set(names)) == len(names), names
    return {point.special: point for point in branch.special}


# -- maps and orbits -------------------------------------------------------------------------------------


def test_12_13_cusp_of_a_map() -> None:
    # mu + q u - u^3 = 0, u = x - 1/2: folds at q = 3 u^2, mu = -2 u^3.
    system = clock(
        lambda x, p: x + p.mu + p.q * (x - 0.5) - (x - 0.5) ** 3, mu=0.3, q=0.3
    )
    start = 0.5 + brentq(lambda u: 0.3 + 0.3 * u - u**3, 0.1, 2)
    begin = (map_of(system), start)
    run = continuation(system, begin, parameter="mu", bounds=(-0.4, 0.3), direction=-1, **COARSE)
    folds = curve(run, first(run, "fold"), parameter="q", bounds=(-0.2, 0.5), **FAR)
    (cusp,) = found(folds).values()
    assert cusp.special == "cusp"
    assert abs(cusp.value) < 1e-7
    assert abs(cusp.coordinates["mu"]) < 1e-9
    assert abs(cusp.coordinates["x"] - 0.5) < 1e-4
    # Both halves end at the bound.
    assert (folds.branch.values[0], folds.branch.values[-1]) == (0.5, 0.5)
    assert abs(folds.branch.coordinate("mu")[0] + folds.branch.coordinate("mu")[-1]) < 1e-9
    with pytest.raises(UsageError, match="no curve of another kind is known at 'cusp'"):
        switch_curve(folds, cusp)


@pytest.mark.parametrize("kind", ["map", "orbit"])
def test_12_13_generalized_period_doubling(kind: str) -> None:
    # u -> -(1 + a) u + (b - 1/2) u^3 + u^5 with u = x - 3/10.
    def image(x: Any, p: Any) -> Any:
        u = x - 0.3
        return 0.3 - (1 + p.a) * u + (p.b - 0.5) * u**3 + u**5

    system = clock(image, a=-0.2, b=0.2)
    start = (map_of(system), 0.3) if kind == "map" else find_orbit(system, (0.3, 0.3))
    run = continuation(system, start, parameter="a", bounds=(-0.2, 0.2), direction=1, **COARSE)
    doubled = curve(run, first(run, "period doubling"), parameter="b", bounds=(0.1, 0.9), **FAR)
    (point,) = found(doubled).values()
    assert point.special == "generalized period doubling"
    assert abs(point.value - 0.5) < 1e-6


def henon(m: float, d: float) -> System:
    """(x, y) -> (y, m - d x - y^2): trace -2 y, determinant d; y^2 + (1 + d) y = m."""
    p = parameters(m=m, d=d)
    tick = Surface("tick", z - 1, reset={x: y, y: p.m - p.d * x - y**2, z: 0 * z}, side="-")
    return System({x: 0 * x, y: 0 * y, z: 1 + 0 * z}, surfaces=[tick], parameters=p)


def henon_run(m: float, d: float, parameter: str, bounds: tuple[float, float], way: int) -> Continuation:
    system = henon(m, d)
    at = (-(1 + d) + sqrt((1 + d) ** 2 + 4 * m)) / 2
    orbit = find_orbit(system, (at, at, 0.3), period=1.0)
    return continuation(system, orbit, parameter=parameter, bounds=bounds, direction=way, **COARSE)


def test_12_13_fold_flip_and_resonance_1_1_on_a_fold_curve() -> None:
    # Folds y = -(1 + d)/2, m = -(1 + d)^2/4; the other multiplier is d.
    run = henon_run(0.3, 0.3, "m", (-0.6, 0.3), -1)
    folds = curve(run, first(run, "fold"), parameter="d", bounds=(-1.3, 1.4), **FAR)
    names = found(folds)
    assert set(names) == {"resonance 1:1", "fold-flip"}
    assert abs(names["resonance 1:1"].value - 1) < 1e-6
    assert abs(names["fold-flip"].value + 1) < 1e-6
    assert curves_at(folds, names["resonance 1:1"]) == ("Neimark-Sacker",)
    # The Neimark-Sacker curve d = 1 that begins there.
    ring = switch_curve(folds, names["resonance 1:1"], max_points=8, **FAR).run()
    assert len(ring.points) == 8
    assert np.max(np.abs(ring.values - 1)) < 1e-7
    flip = switch_curve(folds, names["fold-flip"], max_points=8, **FAR).run()
    d, at = flip.values, flip.coordinate("m")
    # 1 + tr + d = 0: y = (1 + d)/2, m = 3 (1 + d)^2/4.
    assert np.max(np.abs(at - 0.75 * (1 + d) ** 2)) < 1e-7


def test_12_13_strong_resonances_on_a_neimark_sacker_curve() -> None:
    run = henon_run(0.5, 0.8, "d", (0.8, 1.1), 1)
    point = first(run, "Neimark-Sacker")
    assert abs(point.value - 1) < 1e-8
    ring = curve(run, point, parameter="m", bounds=(-0.8, 3.5), **FAR)
    names = found(ring)
    # y = m - y^2 - y and the trace -2 y = 2 cos(angle).
    for name, half in (("1:2", -1.0), ("1:3", -0.5), ("1:4", 0.0)):
        at = names[f"resonance {name}"]
        assert abs(at.value - (half**2 - 2 * half)) < 1e-6
    assert set(names) == {"resonance 1:2", "resonance 1:3", "resonance 1:4"}
    assert ring.branch.points[-1].note == "neutral saddle"
    doubled = switch_curve(ring, names["resonance 1:2"], bounds=(1.0, 6.0), max_points=6, **FAR).run()
    d, m = doubled.coordinate("d"), doubled.values
    assert np.max(np.abs(m - 0.75 * (1 + d) ** 2)) < 1e-7
    assert np.ptp(m) > 0.1


# -- equilibria ----------------------------------------------------------------------------------------------


def test_12_13_bogdanov_takens_from_either_curve() -> None:
    # x' = y, y' = a + b x + x^2 + x y: folds a = b^2/4 at x = -b/2; Hopf a = 0 at x = 0, b < 0.
    p = parameters(a=-0.5, b=-1.0)
    system = System({x: y, y: p.a + p.b * x + x**2 + x * y}, parameters=p)
    start = ((1 - sqrt(3)) / 2, 0.0)
    run = continuation(system, start, parameter="a", bounds=(-0.5, 0.4), direction=1, mode="", **COARSE)
    branch = run.run()
    assert [q.special for q in branch.special] == ["Hopf", "fold"]
    hopf, fold = branch.special
    folds = curve(run, fold, parameter="b", bounds=(-1.5, 1.0), **FAR)
    hopfs = curve(run, hopf, parameter="b", bounds=(-1.5, 1.0), **FAR)
    for run_, other in ((folds, hopfs), (hopfs, folds)):
        (point,) = found(run_).values()
        assert point.special == "Bogdanov-Takens"
        assert abs(point.value) < 1e-6
        assert abs(point.coordinates["a"]) < 1e-9
        # The other curve from there is the one that was followed from its own point.
        again = switch_curve(run_, point, **FAR).run()
        assert again.kind == other.branch.kind
        b, a = again.values, again.coordinate("a")
        assert np.max(np.abs(a - (b**2 / 4 if other is folds else 0))) < 1e-9
        assert np.ptp(b) > 2
    assert {q.note for q in hopfs.branch.points if q.value > 0.01} == {"neutral saddle"}


def test_12_13_bautin_and_cusp_of_equilibria() -> None:
    p = parameters(a=-0.5, b=-1.0)
    r = x**2 + y**2
    ring = p.a + p.b * r - r**2
    system = System({x: ring * x - y, y: x + ring * y}, parameters=p)
    run = continuation(system, (0, 0), parameter="a", bounds=(-0.5, 0.5), direction=1, mode="", **COARSE)
    (point,) = found(curve(run, first(run, "Hopf"), parameter="b", bounds=(-1, 1), **FAR)).values()
    assert point.special == "Bautin"
    assert abs(point.value) < 1e-8
    q = parameters(a=0.8, b=0.6)
    cubic = System({x: q.a + q.b * x - x**3, y: -y}, parameters=q)
    start = brentq(lambda u: 0.8 + 0.6 * u - u**3, 0.5, 2)
    run = continuation(cubic, (start, 0), parameter="a", bounds=(-1, 0.8), direction=-1, mode="", **COARSE)
    (point,) = found(curve(run, first(run, "fold"), parameter="b", bounds=(-1, 1), **FAR)).values()
    assert point.special == "cusp"
    assert max(abs(point.value), abs(point.coordinates["a"])) < 1e-7


def test_12_13_points_on_a_curve_of_boundary_equilibria() -> None:
    # Beside x = 0: A = [[k, -1], [1, k - 1/2]], B = (1, -1), so det A = k^2 - k/2 + 1 > 0,
    # tr A = 2 k - 1/2, det A C A^-1 B = k - 1/2 - 1.
    p = parameters(m=0.5, k=-1.0)
    u = x - p.m
    fields = {"+": [p.k * u - y, u + (p.k - sympy.Rational(1, 2)) * y], "-": [1, -1]}
    system = System.from_modes([x], fields, [x, y], parameters=p)
    run = continuation(system, (0.5, 0), parameter="m", bounds=(-0.5, 0.5), mode="+", direction=-1, **COARSE)
    along = curve(run, first(run, "boundary equilibrium"), parameter="k", bounds=(-1, 2), **FAR)
    names = found(along)
    assert set(names) == {"boundary Hopf", "degenerate boundary equilibrium"}
    assert abs(names["boundary Hopf"].value - 0.25) < 1e-8
    assert abs(names["degenerate boundary equilibrium"].value - 1.5) < 1e-8
    hopf = switch_curve(along, names["boundary Hopf"], max_points=5, **FAR).run()
    assert hopf.kind == "Hopf curve"
    assert np.max(np.abs(hopf.values - 0.25)) < 1e-9
    assert np.ptp(hopf.coordinate("m")) > 0.1


@pytest.mark.parametrize("way", ["fold", "boundary"])
def test_12_13_a_fold_that_meets_a_surface(way: str) -> None:
    # x' = m - (x - k)^2 on x > 0: folds m = 0 at x = k; equilibria reach x = 0 at m = k^2.
    p = parameters(m=0.25, k=0.3)
    fields = {"+": [p.m - (x - p.k) ** 2, -y], "-": [1, -y]}
    system = System.from_modes([x], fields, [x, y], parameters=p)
    run = continuation(system, (0.8, 0), parameter="m", bounds=(-0.3, 0.25), mode="+", direction=-1, **COARSE)
    kind = "fold" if way == "fold" else "boundary equilibrium"
    along = curve(run, first(run, kind), parameter="k", bounds=(-0.4, 0.4), **FAR)
    point = found(along)["boundary fold"]
    assert max(abs(point.value), abs(point.coordinates["m"])) < 1e-7
    other = switch_curve(along, point, **FAR).run()
    k, m = other.values, other.coordinate("m")
    assert np.max(np.abs(m - (k**2 if way == "fold" else 0))) < 1e-7
    assert np.ptp(k) > 0.5


# -- borders of orbits -----------------------------------------------------------------------------------


def touching(image: Any, height: Any, **values: float) -> System:
    """x rests between ticks and jumps to image(x); beyond height(z) + k - x = 0 it is pushed back."""
    p = parameters(**values)
    tick = Surface("tick", z - 1, reset={x: image(x, p), z: 0 * z}, side="-")
    wall = Surface("wall", height(z, p) + p.k - x)
    return System({x: sign(wall.h) - 1, z: 1 + 0 * z}, surfaces=[tick, wall], parameters=p)


def test_12_13_grazing_fold_and_the_fold_from_there() -> None:
    # Circles of radius r with (r - c)^2 = a and a wall at x = 1: grazed where a = (1 - c)^2, folds at a = 0.
    p = parameters(a=0.03, c=0.8)
    r = (x**2 + y**2) ** sympy.Rational(1, 2)
    rate = p.a - (r - p.c) ** 2
    system = System({x: rate * x - y - 1 - sign(x - 1), y: rate * y + x}, parameters=p)
    orbit = find_orbit(system, (0.8 + sqrt(0.03), 0))
    run = continuation(system, orbit, parameter="a", bounds=(0.02, 0.05), direction=1, **COARSE)
    point = first(run, "grazing-sliding")
    assert abs(point.value - 0.04) < 1e-8
    along = curve(run, point, parameter="c", bounds=(0.8, 1.2), direction=1, **FAR)
    at = found(along)["grazing-fold"]
    assert abs(at.value - 1) < 1e-6
    assert abs(at.coordinates["a"]) < 1e-9
    for q in along.branch.points:
        assert abs(q.coordinates["a"] - (1 - q.value) ** 2) < 1e-8
    folds = switch_curve(along, at, max_points=6, **FAR).run()
    assert folds.kind == "fold curve"
    assert np.max(np.abs(folds.coordinate("a"))) < 1e-8
    assert np.ptp(folds.values) > 0.02


def test_12_13_grazing_doubling_of_the_logistic_map() -> None:
    # x = 1 - 1/a touches the wall at x = k; the multiplier is 2 - a.
    system = touching(lambda u, p: p.a * u * (1 - u), lambda z, p: (z - 0.5) ** 2, a=2.4, k=0.6)
    orbit = find_orbit(system, (1 - 1 / 2.4, 0.1))
    run = continuation(system, orbit, parameter="a", bounds=(2.4, 2.6), direction=1, **COARSE)
    point = first(run, "grazing-sliding")
    assert abs(point.value - 2.5) < 1e-7
    along = curve(run, point, parameter="k", bounds=(0.6, 0.7), direction=1, **FAR)
    (at,) = found(along).values()
    assert at.special == "grazing-doubling"
    assert abs(at.value - 2 / 3) < 1e-7
    doubled = switch_curve(along, at, max_points=6, **FAR).run()
    assert np.max(np.abs(doubled.coordinate("a") - 3)) < 1e-7


def test_12_13_double_grazing_and_the_other_touching() -> None:
    # Least heights near z = 1/3 and z = 2/3 exchange their order at q = 0, where both are k - x, x = m.
    system = touching(
        lambda u, p: p.m + (u - p.m) / 3,
        lambda z, p: 20 * (z - 0.35) ** 2 * (z - 0.65) ** 2 + p.q * (z - 0.35), m=0.3, k=0.5, q=0.02,
    )  # fmt: skip
    run = continuation(
        system, find_orbit(system, (0.3, 0.1)), parameter="m", bounds=(0.3, 0.6), direction=1, **COARSE
    )
    along = curve(run, first(run, "grazing-sliding"), parameter="q", bounds=(-0.02, 0.02), **FAR)
    (at,) = found(along).values()
    assert at.special == "double grazing"
    assert abs(at.value) < 1e-8
    assert abs(at.coordinates["m"] - 0.5) < 1e-8
    other = switch_curve(along, at, **FAR).run()

    def height(q: float, near: float) -> float:
        roots = np.roots(np.polyder(np.polyadd(20 * np.poly([0.35, 0.35, 0.65, 0.65]), [q, -0.35 * q])))
        s = float(roots[np.argmin(np.abs(roots - near))].real)
        return 20 * (s - 0.35) ** 2 * (s - 0.65) ** 2 + q * (s - 0.35)

    for branch, near in ((along.branch, 0.35), (other, 0.65)):
        assert np.ptp(branch.values) > 0.03
        for q in branch.points:
            assert abs(q.coordinates["m"] - 0.5 - height(q.value, near)) < 1e-8


def test_12_13_grazing_curve_of_impacts_in_the_other_half_of_a_symmetric_orbit() -> None:
    # x'' + c x' + x = a cos w t reaches the stop at 1 for a^2 = (1 - w^2)^2 + c^2 w^2.
    p = parameters(a=3.0, w=2.0, c=0.4)
    stop = Surface("stop", x - 1, reset={y: -y / 2}, side="-")
    system = System({x: y, y: -x - p.c * y + p.a * cosine(p.w * time)}, surfaces=[stop], parameters=p)
    run = continuation(
        system, find_orbit(system, (0, 0)), parameter="a", bounds=(3.0, 3.2), direction=1, max_points=5,
        **COARSE,
    )  # fmt: skip
    along = curve(run, first(run, "C-bifurcation"), parameter="w", bounds=(1.85, 2.2), **FAR).run()
    assert (along.values[0], along.values[-1]) == (1.85, 2.2)
    for q in along.points:
        assert abs(q.coordinates["a"] - sqrt((1 - q.value**2) ** 2 + (0.4 * q.value) ** 2)) < 1e-8


def test_12_13_degenerate_switching_sliding() -> None:
    # x' = f - Sgn x, f = b + A cos t: the entry at f = -1 is at the minimum of f where b = A - 1. With
    # c = (2 - A)/A, off at acos c: c (pi + acos c) = sqrt(1 - c^2).
    name, exact, others, guess = SLIDING["switching-sliding"]
    system = forced(**{**others, name: exact() - 0.05})
    run = continuation(
        system, find_orbit(system, (guess,)), parameter=name, bounds=(exact() - 0.05, exact() + 0.05),
        direction=1, **COARSE,
    )  # fmt: skip
    begin = first(run, "switching-sliding")
    along = curve(run, begin, parameter="A", bounds=(1.62, 3.0), direction=-1, **FAR)
    along.run()
    c = float(brentq(lambda c: c * (np.pi + acos(c)) - sqrt(1 - c * c), 0.0, 1.0))
    at = next(q for q in along.branch.special if q.special == "degenerate switching-sliding")
    assert abs(at.value - 2 / (1 + c)) < 1e-5


# -- the command ---------------------------------------------------------------------------------------------


def test_12_13_command_tells_what_points_predict_and_follows_from_where_curves_meet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "plane.py"
    model.write_text(
        "from filippov import System, parameters, sign, states\n"
        "x, y = states('x y')\n"
        "p = parameters(a=0.2, b=-1.0)\n"
        "system = System({x: y, y: p.a + p.b*x + x**2 + x*y + sign(x + 9) - 1}, parameters=p)\n",
        encoding="utf-8",
    )
    begin = (1 - sqrt(0.2)) / 2
    words = ["continue", f"{model}:system", "--parameter", "a", "--from", "0.2", "--to", "0.4", "--mode", "+"]
    words += ["--x0", f"x={begin},y=0", "--switch", "--curve", "b=-1.5:1", "-o", str(tmp_path)]
    data = summary(capsys, *words)
    (fold,) = data["special"]
    assert fold["predicts"] == "two solutions for a < 0.25, none for a > 0.25"
    # x = 1/2 -+ sqrt(1/4 - a).
    assert abs(fold["coefficients"]["root x"] - 1) < 1e-6
    assert [found["kind"] for found in data["curves"]] == ["fold curve", "Hopf curve"]
    assert [q["special"] for q in data["curves"][0]["points"] if q["special"]] == ["Bogdanov-Takens"]
    assert max(abs(q["a"]) for q in data["curves"][1]["points"]) < 1e-9
    assert (tmp_path / "curves.png").stat().st_size > 5000
