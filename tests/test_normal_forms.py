"""Normal forms of special points: coefficients in closed form, predictions against motions on both sides."""

from math import cos, pi, sqrt

import numpy as np
import pytest
import scipy.linalg
from test_bifurcations import COARSE, SLIDING, forced, logistic, map_of
from test_codim2 import first, henon_run
from test_continuation import belt_oscillator, hunting_run

from filippov import Surface, System, parameters, solve, states
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.bifurcations.branch import Branch
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.bifurcations.switch import switch
from filippov.analysis.orbits.orbit_search import find_orbit

x, y, z, v = states("x y z v")


# -- smooth points -----------------------------------------------------------------------------------------


def test_12_13_a_fold_tells_how_far_its_solutions_part() -> None:
    # x' = a - u^2 - u^3, u = x - 1: u = +-sqrt(a) - a/2 + ...
    p = parameters(a=0.2)
    u = x - 1
    system = System({x: p.a - u**2 - u**3}, parameters=p)
    run = continuation(system, (1.4,), parameter="a", bounds=(-0.2, 0.2), direction=-1, mode="", **COARSE)
    point = first(run, "fold")
    assert abs(point.coefficients["root x"] - 1) < 1e-6
    assert point.predicts == "two solutions for a > 0, none for a < 0"
    errors = []
    for a in (0.02, 0.005):
        # A third solution is at u = -1.
        one, two = (q.coordinates["x"] for q in run.at(a) if q.coordinates["x"] > 0.5)
        errors.append(abs(abs(one - two) / 2 / sqrt(a) - point.coefficients["root x"]))
    assert errors[1] < 0.3 * errors[0] < 0.01


@pytest.mark.parametrize("kind", ["map", "orbit"])
def test_12_13_doubled_orbit_of_the_logistic_map(kind: str) -> None:
    # x = (a + 1 +- sqrt((a - 3)(a + 1)))/(2 a): +- sqrt(a - 3)/3.
    system, at = logistic(), 1 - 1 / 2.6
    start = (map_of(system), at) if kind == "map" else find_orbit(system, (at, 0.3))
    run = continuation(system, start, parameter="a", bounds=(2.6, 3.4), direction=1, **COARSE)
    point = first(run, "period doubling")
    assert abs(point.coefficients["root x"] - 1 / 3) < 1e-5
    assert abs(point.coefficients["rate"] + 1) < 1e-6
    assert point.predicts == "supercritical: a stable doubled orbit for a > 3"


@pytest.mark.parametrize("d", [-0.6, 0.2, 0.7])
def test_12_13_doubled_orbit_of_a_plane_map(d: float) -> None:
    # Henon: y1 + y2 = 1 + d, (y1 - y2)^2 = 4 m - 3 (1 + d)^2: +- sqrt(m - m0), whatever d is.
    m0 = 0.75 * (1 + d) ** 2
    run = henon_run(m0 - 0.1, d, "m", (m0 - 0.1, m0 + 0.1), 1)
    point = first(run, "period doubling")
    assert abs(point.value - m0) < 1e-8
    assert abs(point.coefficients["root y"] - 1) < 1e-4
    assert point.predicts.startswith("supercritical: a stable doubled orbit for m >")


@pytest.mark.parametrize(("angle", "sense"), [(1.1, -1), (0.7, 1), (2.4, -1)])
def test_12_13_invariant_curve_of_a_turning_map(angle: float, sense: int) -> None:
    # w -> q e^(i th) w + s w |w|^2: |q e^(i th) + s r^2| = 1, r^2 = -(q - 1)/(s cos th) + ...
    p = parameters(q=0.8)
    u, w = x - 0.3, y
    r = sense * (u**2 + w**2)
    reset = {
        x: 0.3 + p.q * (cos(angle) * u - np.sin(angle) * w) + r * u,
        y: p.q * (np.sin(angle) * u + cos(angle) * w) + r * w, z: 0 * z,
    }  # fmt: skip
    tick = Surface("tick", z - 1, reset=reset, side="-")
    system = System({x: 0 * x, y: 0 * y, z: 1 + 0 * z}, surfaces=[tick], parameters=p)
    start = find_orbit(system, (0.3, 0, 0.3))
    run = continuation(system, start, parameter="q", bounds=(0.8, 1.2), direction=1, **COARSE)
    point = first(run, "Neimark-Sacker")
    assert abs(point.coefficients["angle"] - angle) < 1e-8
    assert abs(point.coefficients["root x"] - 1 / sqrt(abs(cos(angle)))) < 1e-4
    above = sense * cos(angle) < 0
    kind = "supercritical: a stable" if above else "subcritical: an unstable"
    assert point.predicts == f"{kind} closed invariant curve for q {'>' if above else '<'} 1"


def test_12_13_cycle_of_a_hopf_point_by_size() -> None:
    # Averaged: r' = a r - 3 r^3/8.
    p = parameters(a=-1.0)
    system = System({x: p.a * x - y - x**3 + x * y / 2, y: x + p.a * y + y**2 / 3}, parameters=p)
    run = continuation(system, (0, 0), parameter="a", bounds=(-1, 1), mode="", **COARSE)
    point = first(run, "Hopf")
    assert point.predicts == "supercritical: a stable cycle for a > 0"
    errors = []
    for a in (0.02, 0.005):
        size = find_orbit(system, (sqrt(2.6 * a), 0), parameters={"a": a}, transient=20 / a).amplitude["x"]
        errors.append(abs(size / sqrt(a) / point.coefficients["root x"] - 1))
    assert errors[1] < 0.3 * errors[0] < 0.02


def test_12_13_hunting_cycles_part_at_their_fold_as_the_coefficient_says() -> None:
    run = hunting_run(2.0)
    (fold,) = run.branch.folds
    assert fold.predicts.startswith("two solutions for P < 21.015")
    errors = []
    for apart in (1e-2, 1e-3):
        one, two = (q.coordinates["x"] for q in run.at(fold.value - apart))
        errors.append(abs(abs(one - two) / 2 / sqrt(apart) / fold.coefficients["root x"] - 1))
    # The next term is one order on in the distance.
    assert errors[1] < 0.15 * errors[0] < 2e-4


def test_12_13_pair_without_the_symmetry_leaves_as_the_coefficient_says() -> None:
    p = parameters(b=1.0)
    well = System({x: v, v: -0.3 * v - x**3 + p.b * cosine(time)}, parameters=p)
    start = find_orbit(well, (0, 0), parameters={"b": 2.4})
    run = continuation(well, start, parameter="b", bounds=(2.4, 2.7), direction=1)
    point = first(run, "symmetry breaking")
    assert point.predicts.startswith("supercritical: a stable pair without the symmetry for b > 2.608")
    pair = switch(run, point, bounds=(2.4, 2.75), max_points=8).run()
    roots, sizes = [], []
    for q in pair.points[1:4]:
        root = sqrt(abs(q.value - point.value))
        (base,) = run.at(q.value)
        sizes.append(np.abs(np.array(q.u) - base.u) / root)
        roots.append(root)
    # The ratio is linear in the root: at 0 it is the coefficient.
    at = np.polynomial.polynomial.polyfit(roots, np.array(sizes), 2)[0]
    wanted = [point.coefficients["root x"], point.coefficients["root v"]]
    assert np.allclose(at, wanted, rtol=2e-3)


def test_12_13_coefficients_are_kept_in_files(tmp_path) -> None:
    system = logistic()
    run = continuation(system, (map_of(system), 1 - 1 / 2.6), parameter="a", bounds=(2.6, 3.4), **COARSE)
    branch = run.run()
    again = Branch.load(branch.save(tmp_path / "branch.json"))
    assert repr(again.points) == repr(branch.points)
    assert "supercritical" in str(again.special[0])


# -- boundary equilibria -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
def test_12_13_boundary_equilibrium_by_its_coefficient_and_by_its_branch(seed: int) -> None:
    """The branch's own direction beyond the point says which case it is, whatever C A^-1 B is."""
    rng = np.random.default_rng(seed)
    n = 2 + seed % 2
    A, B, M = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
    names = (x, y, z)[:n]
    p = parameters(m=0.4)
    regular = [sum(a * q for a, q in zip(A[k], names, strict=True)) + M[k] * p.m for k in range(n)]
    system = System.from_modes([x], {"+": regular, "-": list(B)}, list(names), parameters=p)
    shift = -np.linalg.solve(A, M)
    value = 0.4 * np.sign(shift[0])
    start = value * shift
    run = continuation(
        system, start, parameter="m", value=value, bounds=(-0.5, 0.5), mode="+",
        direction=-int(np.sign(value)), **COARSE,
    )  # fmt: skip
    point = first(run, "boundary equilibrium")
    assert point.predicts.split(":")[0] == point.note.split(";")[0]
    assert abs(point.coefficients["C A^-1 B"] - np.linalg.solve(A, B)[0]) < 1e-9
    assert abs(point.coefficients["dH/dvalue"] - shift[0]) < 1e-9
    if n == 2:
        det, apart = np.linalg.det(A), np.trace(A) ** 2 - 4 * np.linalg.det(A)
        word = "saddle" if det < 0 else "focus" if apart < 0 else "node"
        assert point.predicts.endswith(f"; a boundary {word}")
    # Eigenvalues of the sliding field beside the point, where the branch has them.
    slides = next(q for q in run.branch.points if q.word == "0")
    found = sorted(number.real for number in map(complex, slides.multipliers))
    names_ = sorted(k for k in point.coefficients if k.startswith("sliding eigenvalue"))
    assert np.allclose(found, [point.coefficients[k] for k in names_], atol=1e-8)


FOCI = (
    # growth, frequency-like entries, B, and whether there is a cycle
    (0.1, (1.0, 2.0)), (0.1, (1.0, -2.0)), (0.05, (1.0, -4.0)), (0.3, (1.0, -1.0)), (0.3, (1.0, 0.5)),
    (0.02, (1.0, -1.0)),
)  # fmt: skip


@pytest.mark.parametrize(("growth", "other"), FOCI)
def test_12_13_sliding_cycle_around_a_repelling_focus(growth: float, other: tuple[float, float]) -> None:
    # A = [[g, -1], [1, g]] about (m, 0), the other field constant.
    p = parameters(m=0.5)
    fields = {"+": [growth * (x - p.m) - y, (x - p.m) + growth * y], "-": list(other)}
    system = System.from_modes([x], fields, [x, y], parameters=p)
    run = continuation(system, (0.5, 0), parameter="m", bounds=(-0.5, 0.5), mode="+", direction=-1, **COARSE)
    point = first(run, "boundary equilibrium")
    m = 0.05
    # From the focus outwards: onto the cycle, or away.
    motion = solve(system, (1.001 * m, 0), (0, 400), parameters={"m": m})
    entries = [e for e in motion.events if str(e.kind) == "sliding entry"]
    cycle = len(entries) > 5 and float(np.max(np.abs(motion.y))) < 1
    assert ("inside a stable sliding cycle" in point.predicts) == cycle
    if cycle:
        # The tangency is at y = -g m; entries are where the motion from there comes back.
        back = abs(entries[-1].x[1] + growth * m) / m
        assert abs(back - point.coefficients["return"]) < 0.02 * back


# -- tangencies ---------------------------------------------------------------------------------------------


def impacting(w: float, c: float, e: float) -> tuple[System, float]:
    """The oscillator below a stop at x = 1, and the force at which it grazes."""
    p = parameters(a=1.0, w=w, c=c)
    stop = Surface("stop", x - 1, reset={v: -e * v}, side="-")
    system = System({x: v, v: -x - p.c * v + p.a * cosine(p.w * time)}, surfaces=[stop], parameters=p)
    return system, sqrt((1 - w * w) ** 2 + (c * w) ** 2)


def speed_of_one_impact(w: float, c: float, e: float, gain: float) -> float:
    """dv/da at grazing of the orbit with one impact a period, v the speed of impact, in closed form.

    With X = 1 - x_p, W = v_p at the impact: (X, v - W) = Phi (X, -e v - W), linear in (X, W); the forced part
    has the amplitude a/gain = sqrt((1 - X)^2 + (W/w)^2).
    """
    phi = scipy.linalg.expm(np.array([[0, 1], [-1, -c]]) * 2 * pi / w)
    # (1 - Phi) (X, -W) = (0, -v) - e v Phi (0, 1).
    right = np.array([0.0, -1.0]) - e * phi @ np.array([0.0, 1.0])
    slope = float(np.linalg.solve(np.eye(2) - phi, right)[0])
    return -1 / (gain * slope)


CASES = [(2.0, 0.4, 0.5), (1.3, 0.7, 0.8), (2.8, 0.1, 0.6), (0.7, 0.5, 0.9), (6.0, 3.0, 0.7), (1.6, 2.6, 0.4)]


@pytest.mark.parametrize(("w", "c", "e"), CASES)
def test_12_13_square_root_of_grazing_impacts(w: float, c: float, e: float) -> None:
    system, gain = impacting(w, c, e)
    orbit = find_orbit(system, (0, 0), parameters={"a": 0.97 * gain})
    run = continuation(
        system, orbit, parameter="a", bounds=(0.97 * gain, 1.02 * gain), direction=1, max_points=6, **COARSE
    )
    point = first(run, "C-bifurcation")
    found = point.coefficients
    assert abs(point.value / gain - 1) < 1e-6
    # H = 1 - x = 0 with H'' = w^2; v -> v - (1 + e) sqrt(2) w sqrt(z).
    assert abs(found["bend"] - w * w) < 1e-6
    assert abs(found["vector v"] + (1 + e) * sqrt(2) * w) < 1e-5
    assert abs(found["dH/dvalue"] + 1 / gain) < 1e-6
    exact = speed_of_one_impact(w, c, e, gain)
    speed = sqrt(2 * found["bend"]) * found["root per value"]
    assert abs(speed / abs(exact) - 1) < 1e-4
    # It is there beyond the grazing where its speed grows with a.
    one = point.predicts.rpartition("one contact for a ")[2][0]
    assert one == (">" if exact > 0 else "<")


@pytest.mark.parametrize(
    ("w", "c", "words"),
    [(9.0, 2.5, "chaos at once"), (3.0, 3.0, "with chaos between"), (1.0, 2.5, "period adding"),
     (2.0, 0.4, "no attr")],
)  # fmt: skip
def test_12_13_attractor_beyond_grazing_grows_or_is_far(w: float, c: float, words: str) -> None:
    """Speeds of impact go to 0 with the distance from grazing, or do not."""
    system, gain = impacting(w, c, 0.7)
    orbit = find_orbit(system, (0, 0), parameters={"a": 0.97 * gain})
    run = continuation(
        system, orbit, parameter="a", bounds=(0.97 * gain, 1.02 * gain), direction=1, max_points=6, **COARSE
    )
    point = first(run, "C-bifurcation")
    assert words in point.predicts
    fastest = []
    for beyond in (1e-3, 1e-5):
        motion = solve(
            system, orbit.x0, (0, 2 * pi / w * 250), parameters={"a": gain * (1 + beyond)}, zeno="continue"
        )
        late = [abs(e.x[1]) for e in motion.events if e.surface == "stop" and e.t > 0.5 * motion.t_end]
        fastest.append(max(late))
    assert (fastest[1] < 0.3 * fastest[0]) == ("no attr" not in words)


def test_12_13_multiplier_beyond_a_grazing_sliding() -> None:
    system = belt_oscillator()
    run = continuation(
        system, find_orbit(system, (0, 0)), parameter="a", bounds=(1.45, 1.6), direction=1, max_points=40
    )
    point = first(run, "grazing-sliding")
    assert point.predicts.startswith("persistence: stable orbit for a < 1.50333, stable sliding one for a >")
    beyond = find_orbit(system, (0, 0), parameters={"a": point.value + 1e-5})
    assert "0" in "".join(beyond.modes)
    assert abs(abs(beyond.multipliers[0]) - point.coefficients["multiplier beyond"]) < 5e-3
    assert abs(point.coefficients["dH/dvalue"] + 1 / 1.5033296378372908) < 1e-5


def test_12_13_exponents_of_the_changes_of_sliding() -> None:
    # f = b + A cos t + B cos 2 t: L_F2^2 H is the slope of the force at the arrival, U = 1 for jumps of 2.
    for kind, exponent in (("crossing-sliding", 2.0), ("switching-sliding", 3.0), ("adding-sliding", 2.0)):
        name, exact, others, guess = SLIDING[kind]
        at = exact()
        system = forced(**others, **{name: at - 0.02})
        run = continuation(
            system, find_orbit(system, (guess,)), parameter=name, bounds=(at - 0.02, at + 0.01), direction=1,
            **COARSE,
        )  # fmt: skip
        point = first(run, kind)
        assert point.coefficients["exponent"] == exponent
        assert point.predicts.startswith("persistence")
