"""Equilibria that a continuation carries across kinks, against closed forms of piecewise-linear systems.

x' = A x + c |h| + b m, h = g.x + e m - d, has x = -(A + s c g^T)^-1 (b m + s c (e m - d)) on the side s h > 0
where that has this sign: which sides exist for which m, and their eigenvalues, say what happens at h = 0.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import Abs, Max, Min, Piecewise, System, UsageError, exp, parameters, sign, sin, states
from filippov.analysis import continuation
from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.curve import curve

x, y, z = states("x y z")
NAMES = (x, y, z)
DRAWS = range({"nightly": 120}.get(os.environ.get("FILIPPOV_PROFILE", ""), 12))
SPELLINGS = ("Abs", "Max", "Min", "Piecewise", "nested")
TERMS = ("none", "exp", "sine", "cubic")
COARSE = {"step": 0.1, "max_step": 0.4}


@pytest.fixture(autouse=True)
def _no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@dataclass
class Draw:
    """One system with its equilibria in closed form."""

    A: Any
    c: Any
    g: Any
    b: Any
    e: float
    d: float
    terms: str

    @property
    def corner(self) -> tuple[Any, float]:
        """The state and the value of m at the kink: A x + b m = 0, h = 0."""
        n = len(self.c)
        block = np.block([[self.A, self.b[:, None]], [self.g[None, :], np.array([[self.e]])]])
        found = np.linalg.solve(block, np.append(np.zeros(n), self.d))
        return found[:n], float(found[n])

    def slope(self, side: int) -> Any:
        return self.A + side * np.outer(self.c, self.g)

    def linear(self, side: int, m: float) -> tuple[Any, bool]:
        """The zero of one side's field, and whether it lies on that side."""
        at = np.linalg.solve(self.slope(side), -self.b * m - side * self.c * (self.e * m - self.d))
        return at, bool(side * (self.g @ at + self.e * m - self.d) > 0)

    def state(self, side: int, m: float) -> Any:
        at, _ = self.linear(side, m)
        # q + q^3 = at has one real root.
        return at if self.terms != "cubic" else np.array(
            [next(float(r.real) for r in np.roots([1, 0, 1, -v]) if abs(r.imag) < 1e-9) for v in at]
        )  # fmt: skip

    def eigenvalues(self, side: int, m: float) -> Any:
        at = self.state(side, m)
        factor = np.ones(len(at))
        if self.terms == "cubic":
            factor = 1 + 3 * at**2
        if self.terms == "exp":
            factor = factor * np.exp(-at[0] / 4)
        if self.terms == "sine":
            factor = factor * (2 + np.sin(at[0])) / 2
        return np.linalg.eigvals(self.slope(side) * factor)

    def system(self, spelling: str) -> System:
        n = len(self.c)
        p = parameters(m=0.0)
        names = NAMES[:n]
        inner = [q + q**3 for q in names] if self.terms == "cubic" else list(names)
        h = sum(float(self.g[k]) * inner[k] for k in range(n)) + self.e * p.m - self.d
        fields = []
        for k in range(n):
            line = sum(float(self.A[k, j]) * inner[j] for j in range(n)) + float(self.b[k]) * p.m
            c = float(self.c[k])
            if spelling == "Abs":
                f = line + c * Abs(h)
            elif spelling == "Max":
                f = line + 2 * c * Max(h, 0) - c * h
            elif spelling == "Min":
                f = line + c * h - 2 * c * Min(0, h)
            elif spelling == "nested":
                f = line + c * Max(h, -h) if k % 2 else line + c * (Max(0, h) - Min(h, 0))
            else:
                f = Piecewise((line - c * h, h < 0), (line + c * h, True))
            fields.append(f)
        if self.terms == "exp":
            fields = [f * exp(-x / 4) for f in fields]
        if self.terms == "sine":
            fields = [f * (2 + sin(x)) / 2 for f in fields]
        return System(dict(zip(names, fields, strict=True)), parameters=p)


def drawn(seed: int, n: int) -> Draw:
    """A draw whose sides are far from singular and from Hopf points, within reach of the bounds."""
    rng = np.random.default_rng([seed, n])
    while True:
        A = rng.normal(size=(n, n)) - rng.choice([0.0, 1.0]) * np.eye(n)
        c, g, b = rng.normal(size=n), rng.normal(size=n), rng.normal(size=n)
        moves = rng.random() < 0.5
        found = Draw(
            A.round(3), (c * rng.choice([0.3, 1.0, 2.0])).round(3), g.round(3), b.round(3),
            *(round(float(size * rng.normal()), 3) if moves else 0.0 for size in (1, 0.25)),
            str(rng.choice(TERMS)),
        )  # fmt: skip
        if min(abs(np.linalg.det(J)) for J in (found.slope(1), found.slope(-1), found.A)) < 0.1:
            continue
        block = np.block([[found.A, found.b[:, None]], [found.g[None, :], np.array([[found.e]])]])
        if abs(np.linalg.det(block)) < 0.1 or abs(found.corner[1]) > 0.5:
            continue
        ends = [found.linear(s, m)[0] for s in (1, -1) for m in (-1, 1)]
        if np.max(np.abs(ends)) > 4:
            continue
        here = found.corner[1]
        values = np.concatenate([found.eigenvalues(s, here) for s in (1, -1)])
        if np.min(np.abs(values.real)) > 0.03 and (n != 2 or np.min(np.abs(turns(found))) > 0.03):
            return found


def turns(found: Draw) -> Any:
    return [np.trace(found.slope(s)) ** 2 - 4 * np.linalg.det(found.slope(s)) for s in (1, -1)]


def word(values: Any) -> str:
    """An equilibrium by its eigenvalues."""
    stable = np.all(values.real < 0)
    what = "equilibrium"
    if len(values) == 2:
        if values[0].real * values[1].real < 0:
            return "a saddle"
        what = "focus" if abs(values[0].imag) > 0 else "node"
    return f"{'a stable' if stable else 'an unstable'} {what}"


def orientation(found: Draw, system: System) -> int:
    """The sign that the system's own switching function has where h > 0."""
    form = system.symbolic
    assert form is not None
    m = next(m for m in (found.corner[1] + 0.1, found.corner[1] - 0.1) if found.linear(1, m)[1])
    at = dict(zip((*form.x, *form.p), (*found.state(1, m), m), strict=True))
    return 1 if float(form.h[0].subs(at)) > 0 else -1


def test_files_of_before_have_the_facts_in_notes(tmp_path: Path) -> None:
    p = parameters(a=-1.0)
    system = System({x: p.a + Max(x, 0) + 0.5 * Min(x, 0)})
    branch = continuation(system, [1.0], parameter="a", bounds=(-1.0, 1.0), value=-1.0, mode="+").run()
    (point,) = kinks(branch)
    assert (point.test, point.onto) == ("boundary x", ("-",))
    path = branch.save(tmp_path / "branch.json")
    data = json.loads(path.read_text())
    del data["sha256"]
    for row in data["points"]:
        for name in ("surface", "test", "onto"):
            del row[name]
    path.write_text(json.dumps(data))
    assert kinks(Branch.load(path)) == [point]


def kinks(branch: Branch) -> list[BranchPoint]:
    return [q for q in branch.special if q.special == "boundary equilibrium"]


def expected(found: Draw, first: int, flip: int) -> tuple[str, str]:
    """What happens at the kink, and in words.

    first  the side on which a branch begins; flip: the sign of the system's mode where h > 0
    """
    m = found.corner[1]
    there = {s: [w for w in (-1, 1) if found.linear(s, m + 0.1 * w)[1]] for s in (1, -1)}
    assert all(len(ways) == 1 for ways in there.values())
    a, b = there[first][0], there[-first][0]
    kind = "persistence" if a != b else "non-smooth fold"
    mine, other = (
        f"{word(found.eigenvalues(s, m))} in mode {'+' if s * flip > 0 else '-'}" for s in (first, -first)
    )
    sides = ("<", ">") if a < 0 else (">", "<")
    here, away = (f"for m {s} {round(m, 10) + 0.0:.6g}" for s in sides)
    if kind == "persistence":
        text = f"persistence: {mine} {here}, {other} {away}"
        stable = [np.all(found.eigenvalues(s, m).real < 0) for s in (1, -1)]
        return kind, text + ("; the stability changes there" if stable[0] != stable[1] else "")
    return kind, f"non-smooth fold: {mine} and {other} {here}, neither {away}"


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("seed", DRAWS)
def test_12_4_an_equilibrium_goes_on_beyond_a_kink_as_in_closed_form(seed: int, n: int) -> None:
    found = drawn(seed, n)
    _, m = found.corner
    system = found.system(SPELLINGS[seed % len(SPELLINGS)])
    assert [s.kind for s in system.surfaces] == ["kink"]
    flip = orientation(found, system)
    for first in (1, -1):
        way = 1 if found.linear(first, m - 0.1)[1] else -1
        start = m - 0.37 * way
        kind, text = expected(found, first, flip)
        branch = continuation(
            system, found.state(first, start), parameter="m", value=start, bounds=(-1, 1),
            mode="+" if first * flip > 0 else "-", direction=way, **COARSE,
        ).run()  # fmt: skip
        (point,) = kinks(branch)
        assert abs(point.value - m) < 1e-9
        assert {q.special for q in branch.special} <= {"boundary equilibrium", "Hopf"}
        assert point.note.split(";")[0] == kind
        if abs(m) > 1e-3:
            assert point.predicts == text
        assert point.predicts.split(":")[0] == kind
        # The branch: from the side where it begins to the other one, up to the end of the bounds.
        sides = [flip * (1 if q.word == "+" else -1) for q in branch.points]
        assert sides == sorted(sides, reverse=first > 0)
        assert set(sides) == {1, -1}
        assert {q.word for q in branch.points} == {"+", "-"}
        assert branch.values[-1] == (way if kind == "persistence" else -way)
        for q, side in zip(branch.points, sides, strict=True):
            assert np.max(np.abs(np.array(q.u) - found.state(side, q.value))) < 1e-8
            assert q.note != "virtual"
            if not q.special:
                stable = max(found.eigenvalues(side, q.value).real) < 0
                assert q.verdict == ("stable" if stable else "unstable")


# -- where the branch begins and goes ------------------------------------------------------------------------


def one(m: float, plus: float, minus: float, **more: Any) -> tuple[System, Any]:
    """x' = m + (plus or minus) x, the equilibrium x = -m/slope on each side."""
    p = parameters(m=m, **more)
    return System({x: p.m + (plus + minus) / 2 * x + (plus - minus) / 2 * Abs(x)}, parameters=p), p


def mode_at(system: System, at: dict[Any, float]) -> str:
    """The signs at a state."""
    form = system.symbolic
    assert form is not None
    put = {**{q: at.get(q.name, 0.0) for q in form.p}, **at}
    return "".join("+" if float(h.subs(put)) > 0 else "-" for h in form.h)


def exact(point: BranchPoint, plus: float, minus: float) -> None:
    slope = plus if point.word == "+" else minus
    assert abs(point.u[0] + point.value / slope) < 1e-10
    assert point.u[0] * slope * point.value <= 0


@pytest.mark.parametrize("mode", ["+", "-"])
@pytest.mark.parametrize(("plus", "minus"), [(-2.0, -1.0), (1.0, -1.0), (-1.0, 2.0), (3.0, 0.5)])
def test_12_4_a_branch_that_begins_on_the_kink_goes_to_both_sides(
    plus: float, minus: float, mode: str
) -> None:
    system, _ = one(0.0, plus, minus)
    branch = continuation(system, (0.0,), parameter="m", bounds=(-1, 1), mode=mode, **COARSE).run()
    (point,) = kinks(branch)
    assert point.predicts.startswith("persistence" if plus * minus > 0 else "non-smooth fold")
    assert point.note.startswith(point.predicts.split(":")[0])
    assert {q.word for q in branch.points} == {"+", "-"}
    away = {q.word: q.value for q in (branch.points[0], branch.points[-1])}
    assert away == {"+": -np.sign(plus), "-": np.sign(minus)}
    for q in branch.points:
        exact(q, plus, minus)
        assert q.note != "virtual"


@pytest.mark.parametrize(("plus", "minus"), [(-2.0, -1.0), (1.0, -1.0), (-1.0, 2.0), (3.0, 0.5)])
def test_12_4_a_branch_from_beyond_the_kink_becomes_real_there(plus: float, minus: float) -> None:
    """In mode + at x < 0, which is no equilibrium: it is one after the kink, and stays in its mode."""
    system, _ = one(0.0, plus, minus)
    m = np.sign(plus) * 0.6
    branch = continuation(
        system, (-m / plus,), parameter="m", value=m, bounds=(-1, 1), mode="+", direction=-int(m / 0.6),
        **COARSE,
    ).run()  # fmt: skip
    (point,) = kinks(branch)
    kind = "persistence" if plus * minus > 0 else "non-smooth fold"
    assert point.note.startswith(kind)
    assert point.predicts.startswith(kind)
    assert {q.word for q in branch.points} == {"+"}
    assert [q.note == "virtual" for q in branch.points if not q.special] == [
        q.u[0] < 0 for q in branch.points if not q.special
    ]


def test_12_4_nothing_slides_on_a_kink() -> None:
    system, _ = one(-0.5, -2.0, -1.0)
    with pytest.raises(UsageError, match="kink"):
        continuation(system, (0.0,), parameter="m", bounds=(-1, 1), mode="0")


@pytest.mark.parametrize("seed", range(4))
def test_12_4_a_saturated_feedback_has_two_kinks(seed: int) -> None:
    """x' = v, v' = m - k x - v - c clip(x, -1, 1): x = (m + c)/k, m/(k + c), (m - c)/k."""
    k, c = [(1.0, 2.0), (2.0, -1.0), (1.0, -1.6), (0.5, 0.5)][seed]
    p = parameters(m=-4.0)
    clip = [Max(-1, Min(x, 1)), Min(1, Max(-1, x)), Piecewise((-1, x < -1), (x, x < 1), (1, True)),
            (Abs(x + 1) - Abs(x - 1)) / 2][seed]  # fmt: skip
    system = System({x: y, y: p.m - k * x - y - c * clip}, parameters=p)
    names = [float(-s.h.subs(x, 0)) for s in system.surfaces]
    assert sorted(names) == [-1.0, 1.0]
    mode = mode_at(system, {x: (c - 4) / k, y: 0.0})
    start = ((c - 4) / k, 0)
    run = continuation(system, start, parameter="m", bounds=(-4, 4), mode=mode, direction=1, **COARSE)
    branch = run.run()
    points = kinks(branch)
    assert [round(q.u[0], 9) for q in points] == [-1.0, 1.0]
    assert np.allclose([q.value for q in points], [-k - c, k + c], rtol=0, atol=1e-9)
    kind = "persistence" if k + c > 0 else "non-smooth fold"
    assert all(q.note.startswith(kind) and q.predicts.startswith(kind) for q in points)
    assert branch.values[-1] == 4.0
    for q in branch.points:
        at = q.u[0]
        assert abs(q.value - k * at - c * np.clip(at, -1, 1)) < 1e-8
    # The solutions at one value, each in its own mode.
    m = -3.1 if kind == "persistence" else 0.2
    found = sorted(q.u[0] for q in run.at(m))
    inner, outer = m / (k + c), [(m + c) / k, (m - c) / k]
    truth = [u for u in (inner, *outer) if abs(m - k * u - c * np.clip(u, -1, 1)) < 1e-9]
    assert np.allclose(found, sorted(truth), atol=1e-9)


def test_12_4_a_stopped_branch_is_resumed_beyond_a_kink() -> None:
    system, _ = one(-0.5, -2.0, -1.0)
    options: dict[str, Any] = {"parameter": "m", "bounds": (-1, 1), "mode": "-", "direction": 1}
    whole = continuation(system, (-0.5,), **options).run()
    for count in range(1, len(whole.points)):
        run = continuation(system, (-0.5,), **options, max_points=count)
        rest = continuation(system, (-0.5,), **options, resume=run.run()).run()
        assert len(kinks(rest)) == 1
        assert rest.values[-1] == 1.0
        for q in rest.points:
            exact(q, -2.0, -1.0)


# -- other surfaces at the same time -------------------------------------------------------------------------


@pytest.mark.parametrize(("a", "b"), [(0.4, 0.3), (-0.4, 0.5), (1.8, 0.2), (-2.5, -0.3), (2.2, -3.0)])
def test_12_4_two_kinks_that_meet_are_passed_to_the_mode_in_which_there_is_an_equilibrium(
    a: float, b: float
) -> None:
    """Not coupled: x = m/(1 -+ a), y = m/(1 -+ b) on the sides where they have the right signs."""
    p = parameters(m=-0.5)
    system = System({x: p.m - x + a * Abs(x), y: p.m - y + b * Abs(y)}, parameters=p)
    ways = {
        (s, r): [w for w in (-1, 1) if w * s / (1 - a * s) > 0 and w * r / (1 - b * r) > 0]
        for s in (1, -1)
        for r in (1, -1)
    }
    rays = {sides: way[0] for sides, way in ways.items() if way}
    for (s, r), way in rays.items():
        m = 0.5 * way
        start = (m / (1 - a * s), m / (1 - b * r))
        mode = "".join("+" if q > 0 else "-" for q in (s, r))
        branch = continuation(
            system, start, parameter="m", value=m, bounds=(-1, 1), mode=mode, direction=-way, **COARSE
        ).run()
        (point,) = kinks(branch)
        assert abs(point.value) < 1e-9
        last = branch.points[-1]
        sides = tuple(1 if sign == "+" else -1 for sign in last.word)
        assert rays[sides] == last.value
        assert point.note.startswith("persistence" if last.value != way else "non-smooth fold")
        assert point.note.count("another branch") == len(rays) - 2
        assert point.predicts.startswith(point.note.split(";")[0] if len(rays) == 2 else "no normal form")
        for q in branch.points:
            s_, r_ = (1 if sign == "+" else -1 for sign in q.word)
            assert abs(q.u[0] - q.value / (1 - a * s_)) < 1e-9
            assert abs(q.u[1] - q.value / (1 - b * r_)) < 1e-9
            assert q.u[0] * s_ >= -1e-12
            assert q.u[1] * r_ >= -1e-12


@pytest.mark.parametrize(("c", "kind"), [(0.5, "persistence"), (2.0, "non-smooth fold")])
def test_12_4_a_pseudo_equilibrium_crosses_the_kink_of_another_surface(c: float, kind: str) -> None:
    """On x = 0 with s: x' = y/2 - s, y' = m - y + c |y|: y = m/(1 -+ c), s = y/2."""
    p = parameters(m=-0.4)
    system = System({x: y / 2 - sign(x), y: p.m - y + c * Abs(y)}, parameters=p)
    order = {s.name: k for k, s in enumerate(system.surfaces)}
    mode = ["", ""]
    mode[order["x"]], mode[order["y"]] = "0", "-"
    branch = continuation(
        system, (0.0, -0.4 / (1 + c)), parameter="m", bounds=(-1, 1), mode="".join(mode), direction=1,
        **COARSE,
    ).run()  # fmt: skip
    (point,) = [q for q in kinks(branch) if q.note.split("; ")[1].startswith("boundary y")]
    assert abs(point.value) < 1e-9
    assert point.note.startswith(kind)
    partner = "a stable" if kind == "persistence" else "an unstable"
    assert point.predicts.startswith(f"{kind}: a stable pseudo-equilibrium in mode ")
    assert f"{partner} pseudo-equilibrium in mode " in point.predicts[len(kind) + 3 :]
    beyond = [q for q in branch.points if q.word[order["y"]] == "+"]
    assert beyond
    for q in beyond:
        if q.word[order["x"]] == "0":
            assert abs(q.u[1] - q.value / (1 - c)) < 1e-9
            assert abs(q.u[2] - q.u[1] / 2) < 1e-9


# -- over a second parameter ---------------------------------------------------------------------------------


def test_12_4_the_curve_of_a_kink_over_a_second_parameter() -> None:
    """x' = m + k - 2 x + c |x|, with c also a function of k: persistence becomes a fold at c = 2."""
    p = parameters(m=-0.5, k=0.0)
    system = System({x: p.m + p.k - 2 * x + (1 + p.k) * Abs(x), y: -y + x}, parameters=p)
    run = continuation(system, (-0.5 / 3, -0.5 / 3), parameter="m", bounds=(-2, 2), mode="-", direction=1,
                       **COARSE)  # fmt: skip
    (point,) = kinks(run.run())
    assert point.note.startswith("persistence")
    found = curve(run, point, parameter="k", bounds=(-0.5, 1.5), **COARSE).run()
    assert (found.values[0], found.values[-1]) == (-0.5, 1.5)
    assert np.max(np.abs(found.coordinate("m") + found.values)) < 1e-9
    (special,) = found.special
    assert special.special == "degenerate boundary equilibrium"
    assert abs(special.value - 1.0) < 1e-8


def test_12_4_the_curve_of_a_second_kink_is_that_of_its_own_mode() -> None:
    p = parameters(m=-3.0, k=0.0)
    system = System({x: p.m - x - Max(-1, Min(x - p.k, 1))}, parameters=p)
    mode = mode_at(system, {x: -2.0, "m": -3.0, "k": 0.0})
    run = continuation(system, (-2.0,), parameter="m", bounds=(-3, 3), mode=mode, direction=1, **COARSE)
    points = kinks(run.run())
    for end, point in zip((-1, 1), points, strict=True):
        found = curve(run, point, parameter="k", bounds=(-0.5, 0.5), **COARSE).run()
        assert np.max(np.abs(found.coordinate("m") - (found.values + 2 * end))) < 1e-9


@pytest.mark.parametrize("size", [1e-5, 1e5])
def test_12_4_a_branch_keeps_its_units_beyond_a_kink_at_0(size: float) -> None:
    p = parameters(m=-0.5)
    system = System({x: y, y: p.m * size - x - 0.3 * y - Abs(x) / 2}, parameters=p)
    options: dict[str, Any] = {"parameter": "m", "bounds": (-1, 1), "mode": "-", "direction": 1}
    branch = continuation(system, (-size, 0), **options).run()
    assert branch.values[-1] == 1.0
    assert len(branch.points) < 60
    rest = continuation(system, (-size, 0), **options, resume=continuation(
        system, (-size, 0), **options, max_points=len(branch.points) - 3).run()).run()  # fmt: skip
    for found in (branch, rest):
        assert len(kinks(found)) == 1
        assert abs(found.points[-1].u[0] / size - 1 / 1.5) < 1e-9


# -- degenerate sides ----------------------------------------------------------------------------------------


def test_12_4_a_side_without_a_derivative_ends_the_branch_and_one_with_a_zero_is_degenerate() -> None:
    p = parameters(m=-0.5)
    root = System({x: p.m - x + sympy.sqrt(Max(x, 0))}, parameters=p)
    branch = continuation(root, (-0.5,), parameter="m", bounds=(-1, 1), mode="-", direction=1).run()
    assert abs(branch.values[-1]) < 0.1
    assert "no further point" in branch.message
    hertz = System({x: p.m - x + Max(x, 0) ** 1.5 / 2}, parameters=p)
    for start, mode in ((-0.5, "-"), (0.25, "+")):
        m = start - max(start, 0.0) ** 1.5 / 2
        branch = continuation(
            hertz, (start,), parameter="m", value=m, bounds=(-0.5, 0.5), mode=mode, direction=-int(np.sign(m))
        ).run()
        (point,) = kinks(branch)
        assert abs(point.value) < 1e-9
        assert branch.values[-1] == -0.5 * np.sign(m)
        assert point.note.startswith("persistence")
        assert point.predicts.startswith("persistence: a stable equilibrium in mode ")
    flat = System({x: p.m - x + Max(x, 0)}, parameters=p)
    run = continuation(flat, (-0.5,), parameter="m", bounds=(-1, 1), mode="-", direction=1, max_points=40)
    branch = run.run()
    assert kinks(branch)[0].predicts.startswith("degenerate")
