"""Every named point of a branch against a closed form: maps and orbits of a reset clock, forced sliding with
one state, equilibria with a boundary; curves in two parameters; files and interrupts at special points."""

from collections.abc import Callable
from math import acos, atan, cos, pi, sin, sqrt, tan, tanh
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Surface, System, parameters, sign, states
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.bifurcations.branch import CRITICAL, Branch, BranchPoint
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.orbits.shooting import NoConvergenceError

x, y, z = states("x y z")
COARSE = {"step": 0.1, "max_step": 0.4}


def clock(image: Callable[[Any, Any], Any], **values: float) -> System:
    """x rests between the ticks of z' = 1 and jumps to image(x) at each: the map x -> image(x)."""
    p = parameters(**values)
    tick = Surface("tick", z - 1, reset={x: image(x, p), z: 0 * z}, side="-")
    return System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)


def map_of(system: System, order: int = 1) -> EventMap:
    return EventMap(system, Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5), order=order)


def the(run: Continuation, kind: str) -> BranchPoint:
    """The only special point, of this kind, where multipliers on the border decide nothing."""
    if not run.branch.points:
        run.run()
    found = run.branch.special
    assert [point.special for point in found] == [kind]
    assert found[0].verdict != "stable" or kind not in (*CRITICAL, "boundary equilibrium")
    return found[0]


# -- smooth bifurcations of maps and orbits -----------------------------------------------------------------


def logistic() -> System:
    return clock(lambda u, p: (p.a + p.q) * u * (1 - u), a=2.6, q=0.0)


def test_derivative_of_a_map_goes_through_the_reset_of_its_section():
    jet = map_of(logistic()).jet(0.3, ("a", "q"))
    assert np.allclose(jet, [2.6 * 0.21, 2.6 * 0.4, 0.21, 0.21], rtol=0, atol=1e-14)
    twice = map_of(logistic(), 2).jet(0.3)
    assert abs(twice[1] - 2.6 * (1 - 2 * 2.6 * 0.21) * 2.6 * 0.4) < 1e-13


@pytest.mark.parametrize("kind", ["map", "orbit"])
def test_period_doubling_and_its_curve(kind):
    # x = 1 - 1/A has the multiplier 2 - A, A = a + q.
    system, at = logistic(), 1 - 1 / 2.6
    start = (map_of(system), at) if kind == "map" else find_orbit(system, (at, 0.3))
    run = continuation(system, start, parameter="a", bounds=(2.6, 3.4), direction=1, **COARSE)
    point = the(run, "period doubling")
    assert abs(point.value - 3) < 1e-9
    assert abs(point.coordinates["x" if kind == "map" else "max x"] - 2 / 3) < 1e-9
    assert abs(point.multipliers[0] + 1) < 1e-8
    for q in run.branch.points:
        assert abs(q.multipliers[0] - (2 - q.value)) < 1e-8
        assert point.special == q.special or q.stable == (q.value < 3)
    found = curve(run, point, parameter="q", bounds=(0, 0.4), direction=1, **COARSE).run()
    assert found.values[-1] == 0.4
    assert np.max(np.abs(found.coordinate("a") + found.values - 3)) < 1e-8


def test_period_of_a_resting_state_with_a_clock_is_one_tick():
    assert abs(find_orbit(logistic(), (1 - 1 / 2.6, 0.3)).period - 1) < 1e-12


def test_fold_of_a_map_and_its_curve():
    # x -> x + mu - x^2: x = sqrt(mu), slope 1 - 2 x.
    system = clock(lambda u, p: u + p.mu + p.q - u**2, mu=0.25, q=0.0)
    run = continuation(
        system, (map_of(system), 0.5), parameter="mu", bounds=(-0.5, 0.25), direction=-1, **COARSE
    )
    point = the(run, "fold")
    assert abs(point.value) < 1e-12
    assert abs(point.coordinates["x"]) < 1e-6
    assert run.branch.values[-1] == 0.25
    assert abs(run.branch.d[-1] + 0.5) < 1e-9
    found = curve(run, point, parameter="q", bounds=(0, 0.3), direction=1, **COARSE).run()
    assert np.max(np.abs(found.coordinate("mu") + found.values)) < 1e-10


@pytest.mark.parametrize(("start", "value"), [(0.2, 0.7), (0.2 + sqrt(0.3), 1.3)])
@pytest.mark.parametrize("kind", ["map", "orbit"])
def test_branch_point_from_either_branch_and_its_curve(kind, start, value):
    # (a - q) u = u^3 with u = x - q/5: a pitchfork at a = q, x = q/5.
    system = clock(lambda u, p: u + (p.a - p.q) * (u - p.q / 5) - (u - p.q / 5) ** 3, a=value, q=1.0)
    begin = (map_of(system), start) if kind == "map" else find_orbit(system, (start, 0.3), period=1.0)
    way = 1 if value < 1 else -1
    run = continuation(system, begin, parameter="a", bounds=(0.7, 1.3), direction=way, **COARSE)
    point = the(run, "branch point")
    name = "x" if kind == "map" else "max x"
    assert abs(point.value - 1) < 1e-9
    assert abs(point.coordinates[name] - 0.2) < 1e-9
    # Passed: on the straight branch to the other end, on the parabola back with the other sign.
    last = run.branch.points[-1]
    assert last.value == 1.3
    assert abs(last.coordinates[name] - (0.2 if value < 1 else 0.2 - sqrt(0.3))) < 1e-8
    if kind == "map":
        found = curve(run, point, parameter="q", bounds=(1, 1.2), direction=1, **COARSE).run()
        assert found.values[-1] == 1.2
        assert np.max(np.abs(found.coordinate("a") - found.values)) < 1e-9
        assert np.max(np.abs(found.coordinate("x") - found.values / 5)) < 1e-9
        assert np.max(np.abs(found.coordinate("unfolding"))) < 1e-9


def test_symmetry_breaking_of_an_odd_map():
    # P = -a d + d^3, R(d) = -d for d^2 = a - 1; -P has the slope 3 - 2 a: -1 at a = 2, d = 1.
    system = clock(lambda u, p: -(p.a + p.q) * u + u**3, a=1.5, q=0.0)
    run = continuation(
        system, (map_of(system, 2), sqrt(0.5)), parameter="a", bounds=(1.5, 2.4), direction=1, **COARSE
    )
    point = the(run, "symmetry breaking")
    assert abs(point.value - 2) < 1e-9
    assert abs(point.coordinates["x"] - 1) < 1e-9
    found = curve(run, point, parameter="q", bounds=(0, 0.3), direction=1, **COARSE).run()
    assert np.max(np.abs(found.coordinate("a") + found.values - 2)) < 1e-8


def test_neimark_sacker_and_its_curve():
    # At a tick (x, y) turns by 1.1 and grows by q + r: multipliers (q + r) exp(+- 1.1 i).
    p = parameters(q=0.8, r=0.0)
    u, w, rate = x - 0.3, y, p.q + p.r
    reset = {
        x: 0.3 + rate * (cos(1.1) * u - sin(1.1) * w) - u * (u**2 + w**2),
        y: rate * (sin(1.1) * u + cos(1.1) * w) - w * (u**2 + w**2),
        z: 0 * z,
    }
    tick = Surface("tick", z - 1, reset=reset, side="-")
    system = System({x: 0 * x, y: 0 * y, z: 1 + 0 * z}, surfaces=[tick], parameters=p)
    start = find_orbit(system, (0.3, 0, 0.3))
    run = continuation(system, start, parameter="q", bounds=(0.8, 1.2), direction=1, **COARSE)
    point = the(run, "Neimark-Sacker")
    assert abs(point.value - 1) < 1e-9
    assert abs(point.multipliers[0] - complex(cos(1.1), sin(1.1))) < 1e-8
    found = curve(run, point, parameter="r", bounds=(0, 0.2), direction=1, step=0.3, max_step=0.5).run()
    assert found.values[-1] == 0.2
    assert np.max(np.abs(found.coordinate("q") + found.values - 1)) < 1e-8


# -- sliding bifurcations: x' = f(t) - c x - Sgn(x), which slides on x = 0 while |f| < 1 ------------------


def forced(**values: float) -> System:
    p = parameters(**({"A": 1.0, "b": 0.0, "c": 0.0, "B": 0.0, "w": 1.0} | values))
    force = p.b + p.A * cosine(p.w * time) + p.B * cosine(2 * p.w * time)
    return System({x: force - p.c * x - sign(x)}, parameters=p)


def grazing(b: float = 2.0, c: float = 0.4, w: float = 1.1) -> float:
    # x = (b - 1)/c + A cos(w t - phi)/sqrt(c^2 + w^2) has the least value 0.
    return (b - 1) * sqrt(c * c + w * w) / c


def crossing(c: float = 0.3, w: float = 1.2) -> float:
    # An odd orbit that crosses down at f = -1: x = 0 at t and half a period later.
    return sqrt(1 + (((c * c + w * w) * tanh(c * pi / 2 / w) / c + c) / w) ** 2)


def switching(A: float = 3.0) -> float:
    # Off at f = 1 rising, back on x = 0 at f = -1 rising: (b - 1)(t1 - t0) + A (sin t1 - sin t0) = 0.
    def left(b: float) -> float:
        off, on = acos((1 - b) / A), acos((-1 - b) / A)
        return (b - 1) * (2 * pi - on + off) + A * (sin(off) - sin(on))

    return float(brentq(left, 0.5, 1.2, xtol=1e-15))


def adding(b: float = 0.3, B: float = 1.0) -> float:
    # The lower maximum of f, at t = pi, is b - A + B = 1.
    return b + B - 1


SLIDING: dict[str, tuple[str, Callable[..., float], dict[str, float], float]] = {
    "grazing-sliding": ("A", grazing, {"b": 2.0, "c": 0.4, "w": 1.1}, 2.0),
    "crossing-sliding": ("A", crossing, {"c": 0.3, "w": 1.2}, 0.1),
    "switching-sliding": ("b", switching, {"A": 3.0}, 0.3),
    "adding-sliding": ("A", adding, {"b": 0.3, "B": 1.0}, 0.3),
}


@pytest.mark.parametrize("way", [1, -1], ids=["up", "down"])
@pytest.mark.parametrize("kind", list(SLIDING))
def test_sliding_bifurcation_is_named_located_and_passed(kind, way):
    name, exact, others, guess = SLIDING[kind]
    at = exact()
    system = forced(**others, **{name: at - 0.05 * way})
    start = find_orbit(system, (guess,))
    run = continuation(
        system, start, parameter=name, bounds=(at - 0.05, at + 0.05), direction=way, **COARSE
    )
    point = the(run, kind)
    assert abs(point.value - at) < 1e-8
    assert "surface 'x'" in point.note
    assert abs(run.branch.values[-1] - (at + 0.05 * way)) < 1e-12
    assert len({q.word for q in run.branch.points}) == 2
    # Every orbit that slides forgets where it came from.
    assert all((q.multipliers[0] == 0) == ("0" in q.word) for q in run.branch.points if not q.special)


CURVES: dict[str, tuple[str, float]] = {
    "grazing-sliding": ("b", 2.3), "crossing-sliding": ("c", 0.5), "switching-sliding": ("A", 3.5),
    "adding-sliding": ("B", 1.15),
}  # fmt: skip


@pytest.mark.parametrize("way", [1, -1], ids=["up", "down"])
@pytest.mark.parametrize("kind", list(CURVES))
def test_curve_of_a_sliding_bifurcation_in_two_parameters(kind: str, way: int) -> None:
    (name, exact, others, guess), (second, last) = SLIDING[kind], CURVES[kind]
    at = exact()
    system = forced(**others, **{name: at - 0.05 * way})
    run = continuation(
        system, find_orbit(system, (guess,)), parameter=name, bounds=(at - 0.05, at + 0.05), direction=way,
        **COARSE,
    )  # fmt: skip
    bounds = (others.get(second, 1.0), last)
    options = {"bounds": bounds, "direction": 1, "step": 0.3, "max_step": 1.0}
    found = curve(run, the(run, kind), parameter=second, **options).run()
    assert found.values[-1] == last
    assert len(found.points) > 3
    for point in found.points:
        assert abs(point.coordinates[name] - exact(**{second: point.value})) < 2e-8


def den_hartog(w: float) -> float:
    """Friction above which the mass in x'' + x + S Sgn(x') = cos(w t) stops at its turning points.

    Den Hartog 1931, for an odd motion that turns twice in a period: after the turn at t = phi/w the
    acceleration is 0. Between turns x = S + a cos t + b sin t + g cos(w t), g = 1/(1 - w^2).
    """
    g, half = 1 / (1 - w * w), pi / w
    phi = atan(-w * tan(half / 2))
    return abs((1 - g) * cos(phi) * (1 + cos(half)) + w * g * sin(phi) * sin(half)) / 2


def test_den_hartogs_border_of_motions_without_stops() -> None:
    p = parameters(S=0.75, w=0.8)
    system = System({x: y, y: -x + cosine(p.w * time) - p.S * sign(y)}, parameters=p)
    start = find_orbit(system, (1.5, 0.0), transient=40)
    run = continuation(system, start, parameter="S", bounds=(0.75, 0.85), direction=1, **COARSE)
    point = the(run, "crossing-sliding")
    assert abs(point.value - den_hartog(0.8)) < 1e-8
    found = curve(run, point, parameter="w", bounds=(0.7, 0.95), step=0.2, max_step=0.5).run()
    assert tuple(found.values[[0, -1]]) == (0.7, 0.95)
    for q in found.points:
        assert abs(q.coordinates["S"] - den_hartog(q.value)) < 1e-8


# -- equilibria --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", ["equilibrium", "pseudo-equilibrium"])
@pytest.mark.parametrize(("other", "kind"), [(1.0, "persistence"), (-1.0, "non-smooth fold")])
def test_boundary_equilibrium_from_either_side_and_its_curve(other, kind, start):
    # x' = M - x for x > 0, other for x < 0; M = m + k. x = M for M > 0; on x = 0
    # (1 + s) M + (1 - s) other = 0.
    p = parameters(m=0.5, k=0.0)
    system = System.from_modes([x], {"+": [p.m + p.k - x, -y], "-": [other, -y]}, [x, y], parameters=p)
    begin, mode, value = ((0.5, 0), "+", 0.5) if start == "equilibrium" else ((0, 0), "0", -0.5 * other)
    run = continuation(
        system, begin, parameter="m", value=value, bounds=(-0.6, 0.6), mode=mode,
        direction=-1 if value > 0 else 1, **COARSE,
    )  # fmt: skip
    point = the(run, "boundary equilibrium")
    assert abs(point.value) < 1e-10
    assert point.note.startswith(kind)
    assert {q.word for q in run.branch.points} == {"+", "0"}
    for q in run.branch.points:
        if q.word == "+":
            assert abs(q.coordinates["x"] - q.value) < 1e-10
        else:
            s = q.coordinates["multiplier x"]
            assert abs((1 + s) * q.value + (1 - s) * other) < 1e-9
    found = curve(run, point, parameter="k", bounds=(0, 0.5), direction=1, **COARSE).run()
    assert found.values[-1] == 0.5
    assert np.max(np.abs(found.coordinate("m") + found.values)) < 1e-10


def pseudo_hopf() -> System:
    p = parameters(c=-1.0, al=-0.05, d=0.0)
    fields = {"+": [1, -x + p.c * x**2], "-": [-1, -(x - p.al - p.d)]}
    return System.from_modes([y], fields, [x, y], parameters=p)


def test_pseudo_hopf_its_curve_and_the_growth_of_the_cycle():
    # Bank case B02: at al + d = 0; the cycle's half width is sqrt(3 al/c - 3 al^2).
    system = pseudo_hopf()
    run = continuation(system, (-0.025, 0), parameter="al", bounds=(-0.1, 0.1), mode="0", **COARSE)
    point = the(run, "pseudo-Hopf")
    assert abs(point.value) < 1e-10
    found = curve(run, point, parameter="d", bounds=(0, 0.05), direction=1, **COARSE).run()
    assert found.values[-1] == 0.05
    assert np.max(np.abs(found.coordinate("al") + found.values)) < 1e-10
    # Towards the point al = 0 the cycle shrinks as sqrt(3 al/c).
    for al in (-0.02, -0.005, -0.00125):
        size = find_orbit(system, (0.9 * sqrt(-3 * al), -0.01), parameters={"al": al}).amplitude["x"]
        assert abs(size - sqrt(-3 * al - 3 * al**2)) < 1e-10
        assert abs(size / sqrt(-3 * al) - 1) < -0.6 * al


def test_hopf_and_its_curve():
    p = parameters(a=-1.0, b=0.0)
    system = System({x: (p.a + p.b) * x - y - x**3, y: x + (p.a + p.b) * y}, parameters=p)
    run = continuation(system, (0, 0), parameter="a", bounds=(-1, 1), mode="", **COARSE)
    point = the(run, "Hopf")
    assert abs(point.value) < 1e-10
    found = curve(run, point, parameter="b", bounds=(0, 0.5), direction=1, **COARSE).run()
    assert np.max(np.abs(found.coordinate("a") + found.values)) < 1e-10


# -- adversarial rows --------------------------------------------------------------------------------------


def test_c08_fold_pitchfork_and_transcritical_are_passed():
    fold = continuation(lambda u, q: q - u**2, [1.0], value=1.0, bounds=(-1, 2), direction=-1)
    assert abs(the(fold, "fold").value) < 1e-12
    assert abs(fold.branch.d[-1] + sqrt(2)) < 1e-9
    for start, value, way in ((0.0, -0.5, 1), (sqrt(0.3), 0.3, -1)):
        pitchfork = continuation(
            lambda u, q: q * u - u**3, [start], value=value, bounds=(-0.5, 0.5), direction=way
        )
        assert abs(the(pitchfork, "branch point").value) < 1e-9
        assert abs(pitchfork.branch.d[-1] + (0.0 if start == 0 else sqrt(0.5))) < 1e-9
    both = continuation(lambda u, q: (q - 0.1) * u - u**2, [-0.2], value=-0.1, bounds=(-0.5, 0.5))
    assert abs(the(both, "branch point").value - 0.1) < 1e-9
    assert abs(both.branch.d[-1] - 0.4) < 1e-9


def test_c08_branches_that_pass_without_meeting_have_no_branch_point():
    run = continuation(lambda u, q: q * u - u**2 + 1e-3, [0.002], value=-0.5, bounds=(-0.5, 0.5), direction=1)
    assert run.run().special == []
    assert abs(run.branch.d[-1] - (0.25 + sqrt(0.0625 + 1e-3))) < 1e-9


def test_c08_grazing_with_a_square_root_is_a_c_bifurcation():
    # A force that jumps at x = 1; the linear motion has the amplitude a/sqrt((1 - w^2)^2 + (c w)^2).
    p = parameters(a=3.0, k=1.0, w=2.0, c=0.4)
    stop = -x - p.c * y + p.a * cosine(p.w * time) - p.k * (1 + sign(x - 1)) / 2
    system = System({x: y, y: stop}, parameters=p)
    run = continuation(
        system, find_orbit(system, (0, 0)), parameter="a", bounds=(3.0, 3.6), direction=1, max_points=22
    )
    special = run.run().special[0]
    assert special.special == "C-bifurcation"
    assert abs(special.value - sqrt(9 + 0.64)) < 1e-7
    assert len({point.word for point in run.branch.points}) == 2
    assert max(point.residual for point in run.branch.points) < 1e-8


@pytest.mark.parametrize(
    "function", [lambda u, q: 0 * u, lambda u, q: 0 * u + 1, lambda u, q: 0 * u + q - 1], ids=["0", "1", "q"]
)
def test_c09_constant_residual_is_an_error_at_the_start(function):
    with pytest.raises(NoConvergenceError, match="start is"):
        continuation(function, [1.0], value=0.5, bounds=(0, 1))


def test_c09_start_on_a_branch_point_is_an_error():
    with pytest.raises(NoConvergenceError, match="singular"):
        continuation(lambda u, q: q * u - u**3, [0.0], value=0.0, bounds=(-1, 1))
    system = clock(lambda u, p: p.a * u - u**3, a=1.0)
    with pytest.raises(NoConvergenceError, match="singular"):
        continuation(system, (map_of(system), 0.0), parameter="a", bounds=(0.5, 1.5))


# -- stopped anywhere, a special point included -------------------------------------------------------------


def boundary(**more: Any) -> Continuation:
    p = parameters(m=0.5)
    system = System.from_modes([x], {"+": [p.m - x, -y], "-": [-1, -y]}, [x, y], parameters=p)
    return continuation(
        system, (0.5, 0), parameter="m", value=0.5, bounds=(-1, 1), mode="+", **COARSE, **more
    )


def parabola(**more: Any) -> Continuation:
    return continuation(lambda u, q: q - u**2, [1.0], value=1.0, bounds=(-1, 1.5), **COARSE, **more)


def fork(**more: Any) -> Continuation:
    return continuation(lambda u, q: q * u - u**3, [0.6], value=0.36, bounds=(-0.5, 0.5), **COARSE, **more)


@pytest.mark.parametrize("make", [boundary, parabola, fork])
def test_resumed_both_ways_from_every_point(make, tmp_path: Path):
    whole = make().run()
    assert len(whole.special) == 1
    for count in range(1, len(whole.points)):
        run = make()
        for _ in range(count):
            next(run)
        run.stop()
        list(run)
        stored = Branch.load(run.branch.save(tmp_path / "branch.json"))
        assert repr(stored) == repr(run.branch)
        assert stored.points == run.branch.points
        rest = make(resume=stored).run()
        assert [q.special for q in rest.special] == [q.special for q in whole.special]
        assert abs(rest.special[0].value - whole.special[0].value) < 1e-9
        assert np.allclose(rest.values[[0, -1]], whole.values[[0, -1]], rtol=0, atol=1e-12)
        assert np.allclose(rest.d[[0, -1]], whole.d[[0, -1]], rtol=0, atol=1e-9)


def test_interrupt_at_a_special_point_keeps_the_branch_and_goes_on():
    def at_special(done: float, everything: float, note: str) -> None:
        if run.branch.special:
            raise KeyboardInterrupt

    run = boundary()
    branch = run.run(at_special)
    assert "interrupted" in branch.message
    assert branch.special[0].special == "boundary equilibrium"
    count = len(branch.points)
    assert boundary(resume=branch).run().values[-1] == 1.0
    assert count > 2
