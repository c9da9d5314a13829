"""Manifolds against closed forms, matrix exponentials, Melnikov's threshold and another map."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm
from scipy.spatial import cKDTree

from filippov import (
    SolveError,
    Surface,
    System,
    TimeEvent,
    UsageError,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)
from filippov.analysis.invariant_sets.manifold import Manifold, manifold
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.orbits.saddle import saddle
from filippov.app.cli.main import main
from filippov.model.symbols import cos

Array = npt.NDArray[np.float64]
X, Y, Z, V = states("x y z v")
P = parameters(d=0.05, g=0.03)
FORCED = System({X: V, V: X - X**3 - P.d * V + P.g * cos(t)})


def points(found: Manifold) -> Array:
    return np.vstack([one.x for one in found.branches])


@pytest.mark.parametrize("side", ["unstable", "stable"])
def test_12_13_separatrices_in_closed_form(side: Any) -> None:
    duffing = System({X: V, V: X - X**3})
    found = manifold(duffing, (0.01, 0.0), side, length=3.0)
    x, v = points(found).T
    np.testing.assert_allclose(v**2, x**2 - x**4 / 2, atol=1e-9)
    assert [one.length for one in found.branches] == pytest.approx([3.0, 3.0])
    gaps = [np.linalg.norm(np.diff(one.x, axis=0), axis=1) for one in found.branches]
    assert all(
        np.max(gap) <= 3.0 / 400 * (1 + 1e-9) and np.sum(gap) == pytest.approx(3.0, rel=1e-4) for gap in gaps
    )
    pendulum = System({X: V, V: -sin(X)})
    x, v = points(manifold(pendulum, {"x": 3.1, "v": 0.0}, side, length=7.0)).T
    np.testing.assert_allclose(np.abs(v), 2 * np.abs(np.cos(x / 2)), atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_12_13_linear_saddle_through_a_switch_by_matrix_exponentials(seed: int) -> None:
    """x' = A x below h = c.x - 1 = 0, x' = B x + b above: the eigenvector up to the switch, then exp(B t)."""
    rng = np.random.default_rng([3, seed])
    while True:
        T = rng.standard_normal((2, 2))
        A = T @ np.diag([rng.uniform(0.3, 1), -rng.uniform(0.3, 1)]) @ np.linalg.inv(T)
        c, B, b = rng.standard_normal(2), rng.standard_normal((2, 2)), rng.standard_normal(2)
        values, vectors = np.linalg.eig(A)
        v = vectors[:, np.argmax(values)]
        edge = v / (c @ v)
        if c @ A @ edge > 0.1 and c @ (B @ edge + b) > 0.1 and np.linalg.norm(edge) < 5:
            break
    below, above, xy = A, B, (X, Y)
    h = float(c[0]) * X + float(c[1]) * Y - 1
    s = sign(h)
    rows = []
    for k in range(2):
        f = sum(float(below[k, j]) * xy[j] for j in range(2))
        g = sum(float(above[k, j]) * xy[j] for j in range(2)) + float(b[k])
        rows.append((f + g) / 2 + s * (g - f) / 2)
    length = float(np.linalg.norm(edge)) + 1.0
    found = manifold(System(dict(zip(xy, rows, strict=True))), (0, 0), length=length)
    branch = max((one.x for one in found.branches), key=lambda x: float(np.max(x @ c)))
    first = branch[branch @ c <= 1]
    np.testing.assert_allclose(first - (first @ edge)[:, None] * edge / (edge @ edge), 0, atol=1e-8)
    M = np.block([[B, b[:, None]], [np.zeros((1, 3))]])
    times = np.linspace(0, 12, 6001)
    step, state, curve = expm(M * times[1]), np.append(edge, 1.0), []
    for _ in times:
        curve.append(state[:2])
        state = step @ state
        if c @ state[:2] < 1 or np.linalg.norm(state[:2] - edge) > 1.5:
            break
    line = np.array(curve)
    along = np.cumsum(np.linalg.norm(np.diff(branch, axis=0, prepend=branch[:1]), axis=1))
    then = branch[(branch @ c > 1) & (along
                                      < np.linalg.norm(edge) + 0.9)]  # fmt: skip
    back = np.flatnonzero(then @ c <= 1)
    then = then[: back[0]] if back.size else then
    assert len(then) > 3
    k = np.clip(cKDTree(line).query(then)[1], 1, len(line) - 2)
    chord = line[k + 1] - line[k - 1]
    off = then - line[k]
    away = np.abs(chord[:, 0] * off[:, 1] - chord[:, 1] * off[:, 0]) / np.linalg.norm(chord, axis=1)
    inside = np.linalg.norm(off, axis=1) < 2 * np.linalg.norm(chord, axis=1)
    assert inside.mean() > 0.5
    assert np.max(away[inside]) < 1e-4


def test_12_13_pseudo_saddles() -> None:
    """y' = -sign(y) + x/5, x' = x: slides out along y = 0 to the fold x = 5, and is reached along x = 0."""
    system = System({X: X, Y: -sign(Y) + X / 5})
    out = manifold(system, (0.0, 0.0), "unstable", length=4.0)
    assert out.of == "pseudo-saddle"
    assert out.value == pytest.approx(1.0)
    np.testing.assert_allclose(points(out)[:, 1], 0.0, atol=1e-12)
    assert sorted(one.x[-1, 0] for one in out.branches) == pytest.approx([-4, 4])
    beyond = max(
        (one.x for one in manifold(system, (0, 0), length=6.0).branches), key=lambda x: float(x[-1, 0])
    )
    assert np.max(beyond[beyond[:, 0] < 5 - 1e-6, 1]) < 1e-9
    assert beyond[-1, 1] > 0.01
    left = beyond[beyond[:, 0] > 5]
    # y = int (x/5 - 1) dt with dt = dx/x from the fold on
    np.testing.assert_allclose(left[:, 1], (left[:, 0] - 5) / 5 - np.log(left[:, 0] / 5), atol=1e-7)
    come = manifold(system, (0.0, 0.0), "stable", length=2.0)
    np.testing.assert_allclose(points(come)[:, 0], 0.0, atol=1e-12)
    assert sorted(one.x[-1, 1] for one in come.branches) == pytest.approx([-2, 2])
    assert np.isnan(come.value)
    # Repelling sliding, backwards: the same with the sides exchanged.
    repels = System({X: -X, Y: sign(Y) + X / 5})
    assert points(manifold(repels, (0, 0), "stable", length=1.0))[:, 1] == pytest.approx(0.0, abs=1e-12)
    assert points(manifold(repels, (0, 0), "unstable", length=1.0))[:, 0] == pytest.approx(0.0, abs=1e-12)
    # A bent arrival: motions from the end of the branch come to the pseudo-saddle.
    bent = System({X: X + Y, Y: -sign(Y) + X / 5})
    for one in manifold(bent, (0.0, 0.0), "stable", length=1.0).branches:
        run = solve(bent, one.x[-1], (0, 3), rtol=1e-11)
        assert np.min(np.linalg.norm(run.y, axis=0)) < 1e-7


@pytest.mark.parametrize("bend", [0.25, 1.0, 1.5])
def test_12_13_a_branch_that_meets_sliding_backwards_stops_there(bend: float) -> None:
    """The stable manifold x = 0 of x' = x, y' = -y touches the surface x = bend (y - 1)^2 at (0, 1).

    Motions that slid on it leave there: they come to the saddle as well, and which it was is not known.
    """
    system = System.from_modes([X - bend * (Y - 1) ** 2], {"-": [X, -Y], "+": [-1, -0.5]}, [X, Y])
    found = manifold(system, (0, 0), "stable", length=3.0)
    (stopped,) = (one for one in found.branches if one.ended)
    assert "not unique from" in stopped.ended
    assert "meets sliding" in stopped.ended
    np.testing.assert_allclose(stopped.x[-1], [0, 1], atol=1e-6)
    assert stopped.length == pytest.approx(1.0, abs=1e-6)
    (whole,) = (one for one in found.branches if not one.ended)
    np.testing.assert_allclose(whole.x[-1], [0, -3], atol=1e-5)
    assert "branch 1: length 1" in str(found)
    # Forwards, slides from further up leave at the same point and go to the saddle.
    for y in (1.2, 1.5):
        run = solve(system, (bend * (y - 1) ** 2, y), (0, 3), rtol=1e-11)
        (exit_,) = (e for e in run.events if str(e.kind) == "sliding exit")
        np.testing.assert_allclose(exit_.x, [0, 1], atol=1e-6)
        assert np.min(np.linalg.norm(run.y, axis=0)) < 0.3


def _meet(a: Array, b: Array) -> int:
    """Number of crossings of two curves."""
    p, r = a[:-1, None], np.diff(a, axis=0)[:, None]
    q, s = b[None, :-1], np.diff(b, axis=0)[None]
    cross = r[..., 0] * s[..., 1] - r[..., 1] * s[..., 0]
    w = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (w[..., 0] * s[..., 1] - w[..., 1] * s[..., 0]) / cross
        v = (w[..., 0] * r[..., 1] - w[..., 1] * r[..., 0]) / cross
    return int(np.sum((u > 0) & (u < 1) & (v > 0) & (v < 1)))


@pytest.mark.parametrize(("share", "meets"), [(0.85, False), (1.15, True)])
def test_12_13_tangle_at_melnikovs_threshold(share: float, meets: bool) -> None:
    """g/d = 4 cosh(pi w/2)/(3 sqrt 2 pi w) at w = 1 (Guckenheimer & Holmes 1983)."""
    d = 0.05
    g = share * d * 4 * np.cosh(np.pi / 2) / (3 * np.sqrt(2) * np.pi)
    # x'' = x - d x' + g cos t has the periodic solution Re c exp(i t).
    c = g / (-2 + 1j * d)
    orbit = find_orbit(FORCED, (c.real, -c.imag), parameters={"d": d, "g": g}, period="2*pi")
    assert np.max(np.abs(orbit.x0)) < 0.2
    out, come = (manifold(FORCED, orbit, side, length=5.0, spacing=0.02) for side in ("unstable", "stable"))
    assert abs(out.value * come.value - np.exp(-2 * np.pi * d)) < 1e-6  # Liouville
    crossings = sum(_meet(a.x, b.x) for a in out.branches for b in come.branches)
    assert (crossings > 0) is meets


def test_12_13_henons_map_by_a_clock() -> None:
    """Points of the curve lie on images of a piece of the eigenvector under Henon's map itself."""
    clock = TimeEvent("clock", period=1.0, start=0.5, reset={X: 1 - 1.4 * X**2 + Y, Y: 0.3 * X})
    system = System({X: 0 * X, Y: 0 * Y}, time_events=[clock])
    x = (-0.7 + np.sqrt(0.49 + 5.6)) / 2.8
    orbit = find_orbit(system, (x, 0.3 * x))
    found = manifold(system, orbit, length=3.0, spacing=0.05)
    values, vectors = np.linalg.eig(np.array([[-2.8 * x, 1], [0.3, 0]]))
    k = int(np.argmax(np.abs(values)))
    assert found.value == pytest.approx(values[k], abs=1e-9)
    line = np.array([x, 0.3 * x]) + np.linspace(-2e-5, 2e-5, 400_001)[:, None] * vectors[:, k]
    for _ in range(21):
        line = np.column_stack([1 - 1.4 * line[:, 0] ** 2 + line[:, 1], 0.3 * line[:, 0]])
    assert np.max(cKDTree(line).query(points(found))[0]) < 2e-3
    with pytest.raises(UsageError, match="resets"):
        manifold(system, orbit, "stable", length=1.0)


def test_12_13_orbit_of_an_autonomous_system_on_a_section() -> None:
    """r' = r (1 - r^2)/4, z' = (2 z + r^2 - 1)/10 about r = 1, z = 0: r = 1 on the unstable curve."""
    r2 = X**2 + Y**2
    system = System(
        {X: X * (1 - r2) / 4 - Y, Y: Y * (1 - r2) / 4 + X, Z: 0.2 * Z + 0.1 * (r2 - 1)},
        surfaces=[Surface("cut", Y, kind="observer")],
    )
    orbit = find_orbit(system, (1.0, 0.0, 0.0), period=6.28)
    section = Section("cut", "crossing up", "x", {"x": "d", "y": "0", "z": "0"}, t_max=20)
    out = manifold(system, orbit, "unstable", length=0.5, spacing=0.02, section=section)
    assert out.value == pytest.approx(np.exp(0.2 * 2 * np.pi), rel=1e-8)
    assert points(out)[:, 0] == pytest.approx(1.0, abs=1e-7)
    come = manifold(system, orbit, "stable", length=0.2, spacing=0.02, section=section)
    assert come.value == pytest.approx(np.exp(-np.pi), rel=1e-6)
    for x in points(come)[::6]:
        end = solve(system, x, (0, 25), rtol=1e-12, atol=1e-14).x_end
        assert abs(np.hypot(*end[:2]) - 1) < 1e-4
        assert abs(end[2]) < 1e-5
    with pytest.raises(UsageError, match="section="):
        manifold(system, orbit, length=1.0)


def test_12_13_what_is_no_curve_or_no_saddle_is_named() -> None:
    with pytest.raises(UsageError, match="no saddle"):
        manifold(System({X: V, V: -X - V}), (0, 0), length=1)
    three = System({X: X, Y: -Y, Z: -2 * Z})
    with pytest.raises(UsageError, match="has dimension 2"):
        manifold(three, (0, 0, 0), "stable", length=1)
    assert len(manifold(three, (0, 0, 0), "unstable", length=1).branches) == 2
    with pytest.raises(UsageError, match="depends on time"):
        manifold(FORCED, (0, 0), length=1)
    with pytest.raises(SolveError, match="virtual"):
        saddle(System({X: X + 2 + sign(X), Y: -Y}), (1.0, 0.0))
    with pytest.raises(UsageError, match="spacing"):
        manifold(three, (0, 0, 0), length=1, spacing=2)
    with pytest.raises(UsageError, match="does not decide"):
        manifold(System({X: X**2, Y: -Y}), (0.0, 0.0), length=1)


def test_12_13_manifold_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text(
        "from filippov import System, states\nx, v = states('x v')\nduffing = System({x: v, v: x - x**3})\n"
    )
    run = ["manifold", f"{tmp_path}/mine.py:duffing", "--x0", "x=0,v=0", "--length", "2", "--json", "--quiet",
           "--side", "both"]  # fmt: skip
    assert main([*run, "-o", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)["manifolds"]
    assert [one["side"] for one in found] == ["unstable", "stable"]
    x, v = np.array(found[0]["branches"][0]["x"]).T
    assert np.max(np.abs(v**2 - x**2 + x**4 / 2)) < 1e-9
    names = {f"manifold.{end}" for end in ("json", "csv", "png")}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    assert main(run[:4]) == 2


@pytest.mark.parametrize("dimension", [2, 3, 4, 6])
def test_13_4_one_saddle_serves_manifolds_and_homoclinic_orbits(dimension: int) -> None:
    """Random matrices with one unstable direction: eigenvalues, direction and row against their equations."""
    names = states(" ".join(f"y{k}" for k in range(dimension)))
    for seed in range(5):
        draw = np.random.default_rng(seed)
        base = draw.normal(size=(dimension, dimension)) + 3 * np.eye(dimension)
        values = np.append(draw.uniform(0.2, 2), -draw.uniform(0.2, 2, dimension - 1))
        matrix = base @ np.diag(values) @ np.linalg.inv(base)
        place = draw.normal(size=dimension)
        rows = matrix @ (np.array(names, dtype=object) - place)
        found = saddle(System(dict(zip(names, rows, strict=True))), place + 0.1)
        assert found.x == pytest.approx(place, abs=1e-12)
        assert found.eigenvalues == pytest.approx(np.sort(values)[::-1], rel=1e-9)
        assert matrix @ found.unstable == pytest.approx(values[0] * found.unstable, abs=1e-9)
        assert found.left @ matrix == pytest.approx(values[0] * found.left, abs=1e-9)
        assert found.left @ found.unstable == pytest.approx(1)
        assert (found.dimension("unstable"), found.dimension("stable"), found.stable) == (
            1, dimension - 1, dimension - 1,
        )  # fmt: skip


def test_13_4_a_rest_state_without_directions_along_its_surface_is_no_saddle() -> None:
    with pytest.raises(UsageError, match="no saddle"):
        saddle(System({X: -sign(X)}), (0.0,))
    with pytest.raises(SolveError, match="found no equilibrium"):
        saddle(System({X: 1 + X**2, Y: -Y}), (0.3, 0.0))
