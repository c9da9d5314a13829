"""Branches over a parameter against closed forms, 40-digit figures and the bank."""

from math import cos, sqrt
from pathlib import Path

import numpy as np
import pytest
from command import summary
from hunting_oracle import cycles, set_slope
from scipy.optimize import brentq

from filippov import Surface, System, UsageError, parameters, sign, states
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.bifurcations.branch import Branch
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.models import hunting
from filippov.models.registry import get

x, y, v = states("x y v")
SYSTEM = hunting()
_runs: dict[float, Continuation] = {}
# Largest fixed point of the second iterate at P = 10 (40-digit Taylor integration).
LARGEST = {2.0: 0.252304806412, 1.0: 0.231364108103, 0.5: 0.1785896912487}


def hunting_run(beta: float) -> Continuation:
    if beta not in _runs:
        second = EventMap(SYSTEM, Section.from_model(get("hunting")), order=2, parameters={"beta": beta})
        run = continuation(SYSTEM, (second, LARGEST[beta]), parameter="P", bounds=(10, 31), direction=1)
        run.run()
        _runs[beta] = run
    return _runs[beta]


def kinds(branch: Branch) -> list[str]:
    return [point.special for point in branch.special]


# -- the hunting loop, figure 7 --------------------------------------------------------------------------


def test_hunting_beta_2_passes_the_fold_as_one_branch():
    branch = hunting_run(2.0).branch
    assert kinds(branch) == ["fold"]
    (fold,) = branch.folds
    assert abs(fold.value - 21.0149797699) < 1e-9
    assert abs(fold.coordinates["x"] - 0.0244018140) < 1e-9
    assert abs(branch.d[0] - 0.252304806412) < 1e-10
    assert abs(branch.d[-1] - 0.0033558344700) < 1e-10
    assert np.all(np.diff(branch.d) < 0)
    assert branch.points[0].stable
    assert not branch.points[-1].stable
    assert branch.values[-1] == 10.0


def test_hunting_beta_1_ends_where_the_set_changes_stability():
    branch = hunting_run(1.0).branch
    assert kinds(branch) == ["cycle shrinks into the equilibrium set"]
    assert abs(branch.special[0].value - 26.6019490377) < 1e-8
    assert branch.stable[:-1].all()


def test_hunting_beta_half_exists_at_every_gain():
    branch = hunting_run(0.5).branch
    assert branch.message == "P = 31: bound reached"
    assert branch.stable.all()
    assert not branch.special


@pytest.mark.parametrize("beta", [2.0, 1.0, 0.5])
def test_cycles_at_values_agree_with_a_tighter_tolerance(beta):
    run = hunting_run(beta)
    below, above = (2, 0) if beta == 2 else (1, 1)
    for value, count in ((10.0, below), (17.0, below), (21.5, above)):
        found = run.at(value)
        assert len(found) == count
        section = Section.from_model(get("hunting"))
        values = {"beta": beta, "P": value}
        tight = EventMap(SYSTEM, section, order=2, parameters=values, rtol=1e-13, atol=1e-15)
        for point in found:
            d = point.coordinates["x"]
            assert abs(tight(d) - d) < 1e-10
            assert abs(tight.derivative(d) - point.coordinates["slope"]) < 1e-7


def test_fold_curve_in_gain_and_exponent_ends_where_the_set_changes_stability():
    run = hunting_run(2.0)
    options = {"bounds": (1.0, 2.0), "direction": -1, "max_step": 0.4}
    found = curve(run, run.branch.folds[0], parameter="beta", **options).run()
    assert abs(found.coordinate("P")[0] - 21.0149797699) < 1e-9
    assert found.points[-1].special == "cycle shrinks into the equilibrium set"
    assert 1.0 < found.values[-1] < 1.00001
    # The curve runs into (26.6019490377, 1), where the set changes stability at beta = 1.
    assert abs(found.coordinate("P")[-1] - 26.6019490377) < 2e-3
    assert np.max(np.abs(found.coordinate("slope") - 1)) < 1e-8
    # Between, the least gain without hunting is smaller than at either end.
    assert found.coordinate("P").min() < 20.6


def test_12_9_a_small_cycle_is_followed_to_the_bound_and_named_where_rounding_ends_it():
    """beta = 1.2: the unstable cycle is at 5e-7 where P = 10 ends the range; the set changes at 7.9."""
    section = Section.from_model(get("hunting"))
    second = EventMap(SYSTEM, section, order=2, parameters={"beta": 1.2})
    for low, last in ((10.0, ""), (7.0, "cycle below rounding")):
        run = continuation(SYSTEM, (second, 5.0666160e-7), parameter="P", bounds=(low, 21.0), direction=-1)
        branch = run.run()
        assert np.all((branch.values >= low) & (branch.values <= 21.0))
        assert branch.points[-1].special == last
        assert kinds(branch) == ([last] if last else [])
        inner = [point for point in branch.points if point.coordinates["x"] > 1e-9]
        for point in inner[:: max(len(inner) // 3, 1)]:
            law = np.array([1, point.value, 1, 10, 4, 2, 0.1, 1.2, 1.0])
            d = cycles(law, 1e-11, 0.02, 200)[0][0]
            assert point.coordinates["x"] == pytest.approx(d, rel=1e-5)
    # Where the slope of the set in closed form is 1.
    changes = brentq(lambda gain: set_slope(np.array([1, gain, 1, 10, 4, 2, 0.1, 1.2, 1.0])) - 1, 7, 9)
    assert f"changes stability at {changes:.6g}" in branch.points[-1].note


@pytest.mark.parametrize("top", [1.0, 1.0004, 1.00049999])
def test_12_9_a_fold_beyond_the_bounds_is_not_reported(top):
    """value = 1.0005 - u^2 leaves the bounds before it folds."""
    run = continuation(
        lambda u, value: value - (1.0005 - u**2), [-0.8], value=0.3605, bounds=(0, top), direction=1
    )
    branch = run.run()
    assert branch.message == "parameter = " + f"{top:.9g}: bound reached"
    assert not branch.special
    assert branch.points[-1].u[0] == pytest.approx(-sqrt(1.0005 - top), abs=1e-9)


def test_orbits_and_map_have_the_same_fold():
    orbit = find_orbit(SYSTEM, (0.1, 0, 0), parameters={"P": 19.0})
    branch = continuation(SYSTEM, orbit, parameter="P", bounds=(19, 22), direction=1).run()
    (fold,) = branch.folds
    assert abs(fold.value - 21.0149797699) < 1e-7
    assert abs(fold.coordinates["amplitude x"] - 0.0244018140) < 1e-7
    assert {point.word for point in branch.points} == {"stick slip- stick slip+"}
    assert branch.values[-1] == 19.0


def test_derivative_of_the_map_by_parameters():
    turn = EventMap(SYSTEM, Section.from_model(get("hunting")), order=2, rtol=1e-12, atol=1e-14)
    jet = turn.jet(0.1, ("P", "beta"))
    for k, name in enumerate(("P", "beta")):
        f = {j: turn.remake(parameters={name: turn.parameters[name] + 1e-3 * j})(0.1) for j in (-2, -1, 1, 2)}
        numeric = (8 * (f[1] - f[-1]) - f[2] + f[-2]) / 12e-3
        assert abs(jet[2 + k] - numeric) < 1e-8


# -- special points of smooth problems ---------------------------------------------------------------------


def test_symmetry_breaking_of_a_forced_double_well_is_found():
    # x'' + 0.3 x' + x^3 = b cos t (Ueda's equation): the symmetric orbit loses its symmetry.
    p = parameters(b=0.1, c=0.3)
    system = System({x: v, v: -p.c * v - x**3 + p.b * cosine(time)}, parameters=p)
    orbit = find_orbit(system, (0, 0))
    assert orbit.symmetric
    branch = continuation(system, orbit, parameter="b", bounds=(0.1, 3), direction=1).run()
    found = [point for point in branch.special if point.special == "symmetry breaking"]
    assert found
    for point in found:
        assert min(abs(np.array(point.multipliers) - 1)) < 1e-5


# -- sliding bifurcations ------------------------------------------------------------------------------------


def belt_oscillator():
    p = parameters(a=1.5, mu=0.3, zeta=0.05, w=0.5, v0=1.0)
    force = -x - 2 * p.zeta * v + p.a * cosine(p.w * time) - p.mu * sign(v - p.v0)
    return System({x: v, v: force}, parameters=p)


def critical(w: float) -> float:
    """Amplitude of the forcing at which the motion's speed reaches that of the belt (bank case B05)."""
    return sqrt((1 - w * w) ** 2 + (2 * 0.05 * w) ** 2) / w


def test_grazing_sliding_is_named_and_passed():
    system = belt_oscillator()
    branch = continuation(
        system, find_orbit(system, (0, 0)), parameter="a", bounds=(1.45, 1.7), direction=1, max_points=60
    ).run()
    (special,) = branch.special
    assert special.special == "grazing-sliding"
    assert abs(special.value - 1.5033296378372908) < 1e-8
    assert branch.values[-1] == 1.7
    assert len({point.word for point in branch.points}) == 2


def test_grazing_curve_in_two_parameters():
    system = belt_oscillator()
    run = continuation(system, find_orbit(system, (0, 0)), parameter="a", bounds=(1.45, 1.55), direction=1)
    branch = run.run()
    options = {"bounds": (0.45, 0.52), "direction": 1, "step": 0.2, "max_step": 0.4}
    found = curve(run, branch.special[0], parameter="w", **options).run()
    assert found.values[-1] == 0.52
    for point in found.points:
        assert abs(point.coordinates["a"] - critical(point.value)) < 1e-6


def test_grazing_of_an_impact_is_a_c_bifurcation():
    p = parameters(a=1.0, w=2.0)
    # The linear motion has amplitude a/sqrt((1 - w^2)^2 + (0.4 w)^2); the stop is at x = 1.
    stop = Surface("stop", x - 1, reset={v: -v / 2}, side="-")
    system = System({x: v, v: -x - 0.4 * v + p.a * cosine(p.w * time)}, surfaces=[stop], parameters=p)
    orbit = find_orbit(system, (0, 0))
    options = {"bounds": (1.0, 3.3), "direction": 1, "max_points": 30}
    branch = continuation(system, orbit, parameter="a", **options).run()
    special = next(point for point in branch.special if point.special != "branch point")
    assert special.special == "C-bifurcation"
    assert abs(special.value - sqrt(9 + 0.64)) < 1e-6


def test_pseudo_hopf_of_the_bank_and_its_cycle():
    p = parameters(c=-1.0, al=-0.05)
    fields = {"+": [1, -x + p.c * x**2], "-": [-1, -(x - p.al)]}
    system = System.from_modes([y], fields, [x, y], parameters=p)
    run = continuation(system, (-0.025, 0), parameter="al", bounds=(-0.1, 0.1), mode="0")
    assert kinds(run.run()) == ["pseudo-Hopf"]
    assert abs(run.branch.special[0].value) < 1e-10
    orbit = find_orbit(system, (0.2, -0.01))
    branch = continuation(system, orbit, parameter="al", bounds=(-0.1, -0.01)).run()
    for point in branch.points:
        # b = al + sqrt(3 al/c - 3 al^2), a = 2 al - b, period 2 (b - a), as the bank has them.
        b = point.value + sqrt(-3 * point.value - 3 * point.value**2)
        assert abs(point.period - 2 * (2 * b - 2 * point.value)) < 1e-8
        a = 2 * point.value - b
        assert abs(point.multipliers[0] - (-(-a - a * a) / (-b - b * b))) < 1e-7


@pytest.mark.parametrize(
    ("other", "kind", "last"), [(1.0, "persistence", -1.0), (-1.0, "non-smooth fold", 1.0)]
)
def test_boundary_equilibrium(other, kind, last):
    p = parameters(m=1.0)
    # x' = m - x for x > 0, x' = other for x < 0: equilibrium x = m, pseudo-equilibrium with
    # (1 + s)/2 m + (1 - s)/2 other = 0.
    system = System.from_modes([x], {"+": [p.m - x, -y], "-": [other, -y]}, [x, y], parameters=p)
    branch = continuation(system, (1.0, 0), parameter="m", bounds=(-1, 1), mode="+").run()
    found = [point for point in branch.special if point.special == "boundary equilibrium"]
    assert len(found) == 1
    assert abs(found[0].value) < 1e-10
    assert found[0].note.startswith(kind)
    away = branch.points[0] if branch.points[0].word == "0" else branch.points[-1]
    assert away.word == "0"
    assert away.value == last
    s = away.coordinates["multiplier x"]
    assert abs((1 + s) / 2 * away.value + (1 - s) / 2 * other) < 1e-9


# -- iterator, files, command --------------------------------------------------------------------------------


def circle(u, q):
    return [u[0] ** 2 + q**2 - 1 + 0 * u[1], u[1] - cos(q)]


def test_watched_stopped_saved_resumed(tmp_path: Path):
    options = {"value": 0.0, "bounds": (-0.95, 0.95), "direction": 1}
    whole = continuation(circle, [1.0, 1.0], **options).run()
    run = continuation(circle, [1.0, 1.0], **options)
    for count, _ in enumerate(run):
        if count == 4:
            run.stop()
    assert run.branch.message.endswith("stopped")
    assert len(run.branch.points) == 5
    stored = Branch.load(run.branch.save(tmp_path / "branch.json"))
    assert repr(stored.points) == repr(run.branch.points)
    rest = continuation(circle, [1.0, 1.0], **options, resume=stored).run()
    assert rest.points[:5] == stored.points
    assert rest.values[-1] == whole.values[-1] == 0.95
    assert abs(rest.d[-1] - whole.d[-1]) < 1e-12


def test_both_ways_give_one_ordered_branch():
    branch = continuation(lambda u, q: u - q, [0.0], value=0.0, bounds=(-1, 1)).run()
    assert np.all(np.diff(branch.values) > 0)
    assert (branch.values[0], branch.values[-1]) == (-1.0, 1.0)


def test_budgets_keep_what_was_found():
    branch = continuation(lambda u, q: u - q, [0.0], value=0.0, bounds=(-100, 100), max_points=7).run()
    assert len(branch.points) == 7
    assert branch.message.endswith("cut off by max_points = 7")


def test_interrupted_run_keeps_its_points():
    seen = []

    def watch(done, everything, note):
        seen.append(note)
        if len(seen) == 3:
            raise KeyboardInterrupt

    branch = continuation(lambda u, q: u - q, [0.0], value=0.0, bounds=(-1, 1)).run(watch)
    assert len(branch.points) == 3
    assert "interrupted" in branch.message


def test_wrong_arguments_are_named(tmp_path: Path):
    system = belt_oscillator()
    for options, words in (
        ({"bounds": (1, 0)}, r"expected \(lowest, highest\)"),
        ({"bounds": (0, 1), "direction": 2}, "direction"),
        ({"bounds": (0, 1), "step": 1.0}, "steps"),
        ({"bounds": (0, 1)}, "value"),
        ({"bounds": (0, 1), "value": 3.0}, "outside"),
    ):
        with pytest.raises(UsageError, match=words):
            continuation(lambda u, q: u - q, [0.0], **options)
    with pytest.raises(UsageError, match="unknown parameter"):
        continuation(system, (0, 0), parameter="A", bounds=(0, 1))
    with pytest.raises(UsageError, match="mode"):
        continuation(hunting(), (0, 0, 0), parameter="P", bounds=(0, 20))
    with pytest.raises(UsageError, match="depends on time"):
        continuation(system, (0, 0), parameter="a", bounds=(0, 2), mode="+")
    branch = continuation(lambda u, q: u - q, [0.0], value=0.0, bounds=(-1, 1)).run()
    with pytest.raises(UsageError, match="resume"):
        continuation(circle, [1.0, 1.0], value=0.0, bounds=(-1, 1), parameter="r", resume=branch)
    (tmp_path / "x.json").write_text('{"format": "filippov branch", "version": 1, "points": 3}')
    with pytest.raises(UsageError, match="is incomplete or damaged"):
        Branch.load(tmp_path / "x.json")


def test_picture_and_coordinates(tmp_path: Path):
    branch = hunting_run(2.0).branch
    branch.plot(labels={"coordinate": "d [m]"}).savefig(tmp_path / "branch.png")
    with pytest.raises(UsageError, match="unknown coordinate"):
        branch.coordinate("y")
    assert "fold" in repr(branch)


def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = str(tmp_path)
    data = summary(capsys, "orbit", "belt", "-o", folder)
    assert abs(data["period"] - 12.0010312948305787) < 1e-9
    assert isinstance(Orbit.load(tmp_path / "orbit.json"), Orbit)
    words = ["continue", "hunting", "--parameter", "P", "--from", "10", "--to", "31", "--start", "0.25"]
    data = summary(capsys, *words, "-o", folder, "--max-points", "4")
    assert data["message"] == "cut off by max_points = 4"
    data = summary(capsys, *words, "-o", folder, "--resume", str(tmp_path / "branch.json"))
    assert [q["special"] for q in data["special"]] == ["fold"]
    assert {"branch.csv", "branch.json", "branch.png", "orbit.png", "orbit.csv"} <= {
        path.name for path in tmp_path.iterdir()
    }
