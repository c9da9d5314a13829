"""Equilibria against closed forms, and against the inclusion itself: 0 in F(x)."""

import weakref

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from filippov import Abs, Max, Surface, System, UsageError, exp, parameters, sign, sin, states, t
from filippov.analysis.algebra.budget import Clock, OutOfBudgetError
from filippov.analysis.algebra.deadline import within
from filippov.analysis.steady.branches import DegenerateError, Elimination, UnsolvedError
from filippov.analysis.steady.equilibria import equilibria
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

x, v, z = states("x v z")
quick = settings(max_examples=12, deadline=None)


def hunting() -> tuple[System, object]:
    p = parameters(m=1, P=10, D=1, I=10, Fs=4, Fc=2, vs=0.1, beta=2, b=1)
    u = p.P * (x + p.D * v + p.I * z)
    g = p.Fc + (p.Fs - p.Fc) * exp(-((Abs(v) / p.vs) ** p.beta))
    return System({x: v, v: (-u - g * sign(v) - p.b * v) / p.m, z: x}), p


def residual(system: System, e: EquilibriumPoint, values: dict | None = None) -> float:
    """Largest component of f(x, s) with the multipliers of the point, independent of the search."""
    form = system.symbolic
    put = dict(zip(form.x, e.value, strict=True))
    put |= dict(zip(form.p, system.parameters.resolve(values), strict=True))
    on = iter(e.s_value)
    for s, a, h, c in zip(form.s, form.a, form.h, e.mode, strict=True):
        put[s] = {"+": 1.0, "-": -1.0}.get(c) or next(on)
        put[a] = 0.0 if c == "0" else abs(float(h.subs(put)))
    return max(abs(float(f.subs(put))) for f in form.field)


def test_segment_of_the_hunting_loop() -> None:  # reference: x1 = x2 = 0, |x3| <= Fs/(P I)
    system, p = hunting()
    found = equilibria(system)
    assert len(found) == 1
    assert found.points == ()
    (segment,) = found.sets
    (s,) = segment.free
    assert segment.mode == "0"
    assert segment.x[:2] == (0, 0)
    assert sympy.simplify(segment.x[2] + s * p.Fs / (p.P * p.I)) == 0
    assert segment.domain == ((-1, 1),)
    assert {sympy.simplify(e.x[2] * p.P * p.I / p.Fs) for e in segment.ends} == {-1, 1}
    assert sorted(e.value[2] for e in segment.ends) == pytest.approx([-0.04, 0.04], rel=1e-14)
    assert segment.bounded
    assert segment.dimension == 1
    for end in segment.ends:
        assert residual(system, end) < 1e-14


def test_stiction_wider_than_the_hull_reaches_to_the_static_level() -> None:
    p = parameters(m=1, P=10, I=10, Fs=4, Fc=2)
    u = p.P * (x + v + p.I * z)
    surface = Surface("velocity", v, radius=p.Fs / p.Fc)
    system = System({x: v, v: (-u - p.Fc * sign(v)) / p.m, z: x}, surfaces=[surface])
    (segment,) = equilibria(system).sets
    assert {sympy.simplify(e.x[2] * p.P * p.I / p.Fs) for e in segment.ends} == {-1, 1}


@pytest.mark.parametrize("zero", ["P", "I"])
def test_degenerate_gains_are_named_and_the_set_is_unbounded(zero: str) -> None:
    system, _ = hunting()
    (line,) = equilibria(system, {zero: 0}).sets
    assert line.degenerate == (f"{zero} = 0",)
    assert line.free == (z,)
    assert not line.bounded
    assert line.x == (0, 0, z)
    assert line.multipliers == (("velocity", 0),) or line.multipliers[0][1] == 0


def test_coulomb_oscillator() -> None:  # |x| <= Fc/k
    p = parameters(m=1, c=0.2, k=2, Fc=3)
    system = System({x: v, v: (-p.c * v - p.k * x - p.Fc * sign(v)) / p.m})
    (segment,) = equilibria(system).sets
    assert {sympy.simplify(e.x[0] * p.k / p.Fc) for e in segment.ends} == {-1, 1}
    assert sorted(e.value[0] for e in segment.ends) == pytest.approx([-1.5, 1.5])


def test_pendulum_with_dry_friction_rests_below_and_above() -> None:
    p = parameters(g=9.81, Fc=0.5)
    found = equilibria(System({x: v, v: -p.Fc * sign(v) - p.g * sin(x)}))
    middles = sorted(sum(e.value[0] for e in s.ends) / 2 for s in found.sets)
    assert middles == pytest.approx([0, np.pi])
    for s in found.sets:
        width = abs(s.ends[0].value[0] - s.ends[1].value[0])
        assert width == pytest.approx(2 * np.arcsin(0.5 / 9.81))


def test_pseudo_equilibrium_of_a_relay() -> None:
    p = parameters(k=1, r=0.5)
    system = System({x: v - p.k * sign(x), v: p.r - p.k * sign(x)})
    found = equilibria(system)
    (point,) = found.points
    assert point.kind == "pseudo-equilibrium"
    assert sympy.simplify(point.multipliers[0][1] - p.r / p.k) == 0
    assert sympy.simplify(point.x[1] - p.r) == 0
    assert len(equilibria(system, {"r": 2})) == 0  # the multiplier would be 2
    assert equilibria(system, {"r": 1}).points[0].kind == "boundary equilibrium"


def test_smooth_equilibria_exist_on_their_own_side_only() -> None:
    p = parameters(c=1)
    system = System({x: -x + p.c * sign(x - 0.5)})  # +1 and -1
    places = {e.mode: e for e in equilibria(system)}
    assert {m: e.value for m, e in places.items() if m != "0"} == {"+": (1.0,), "-": (-1.0,)}
    assert places["0"].value == (0.5,)
    assert equilibria(system, {"c": 0.25}, modes=["+"]).points == ()


def test_two_surfaces_give_a_set_of_dimension_two() -> None:
    y, w = states("y w")
    equations = {x: v, v: -2 * x + y - sign(v), y: w, w: x - 2 * y - sign(w)}
    (area,) = (s for s in equilibria(System(equations)).sets if s.mode == "00")
    assert area.dimension == 2
    assert len(area.ends) == 4
    stiffness = np.array([[2, -1], [-1, 2]])
    corners = {tuple(np.round(np.linalg.solve(stiffness, [a, b]), 12)) for a in (1, -1) for b in (1, -1)}
    assert {tuple(np.round([e.value[0], e.value[2]], 12)) for e in area.ends} == corners


def test_set_in_a_smooth_mode_ends_where_the_mode_does() -> None:
    system = System({x: -x * 0, v: -v + sign(x - 2)})
    ends = {s.mode: s.bounds[0] for s in equilibria(system).sets if s.free == (x,)}
    assert ends == {"+": (2.0, float("inf")), "-": (-float("inf"), 2.0)}


def test_a_kink_is_met_from_its_sides() -> None:
    found = equilibria(System({x: 1 - Abs(x), v: -v + Max(x, 0)}))
    assert sorted(e.value for e in found.points) == [(-1.0, 0.0), (1.0, 1.0)]


def test_time_dependent_balance_is_no_equilibrium() -> None:
    system = System({x: v, v: -x - 0.4 * sign(v) + sympy.cos(t)})
    found = equilibria(system)
    assert len(found) == 0
    assert any("time" in note for note in found.notes)
    (segment,) = equilibria(system, t=0).sets
    assert sorted(e.value[0] for e in segment.ends) == pytest.approx([0.6, 1.4])


def test_plain_functions_are_searched_numerically() -> None:
    def field(time, y, p, s):
        u = p.P * (y[0] + p.D * y[1] + p.I * y[2])
        return [y[1], -u - 4 * s[0] - y[1], y[0]]

    surface = Surface("velocity", lambda time, y, p: y[1])
    gains = {"P": 10, "D": 1, "I": 10}
    found = equilibria(System(field=field, surfaces=[surface], states="x v z", parameters=gains))
    (segment,) = found.sets
    assert not segment.exact
    assert sorted(e.value[2] for e in segment.ends) == pytest.approx([-0.04, 0.04], rel=1e-8)
    assert found.notes


def test_unsolvable_formulas_are_searched_numerically() -> None:
    system = System({x: -x + sympy.cos(x) + 0.1 * sympy.sin(3 * x) + 0.01 * sign(v), v: 1 - v - x * v**5})
    found = equilibria(system)
    assert found.points
    assert any("numerically" in note for note in found.notes)
    for point in found.points:
        assert residual(system, point) < 1e-8


def test_wrong_modes_and_boxes_are_refused() -> None:
    system, _ = hunting()
    with pytest.raises(UsageError, match="1 characters"):
        equilibria(system, modes=["+-"])
    with pytest.raises(UsageError, match=r"expected \(lowest, highest\)"):
        equilibria(system, box={"x": (1, 0)})


def test_budget_ends_with_a_note() -> None:
    system, _ = hunting()
    found = equilibria(system, budget=1e-9)
    assert len(found) == 0
    assert "budget" in found.notes[0]


def test_within_stops_what_spends_its_time_in_callbacks() -> None:
    class Thing:
        pass

    def forever() -> None:
        while True:
            thing = Thing()
            weakref.finalize(thing, lambda: sum(range(300)))
            del thing

    # An exception that arrives in such a callback is dropped by Python, with a warning that fails this test.
    for _ in range(5):
        with pytest.raises(OutOfBudgetError):
            within(0.02, forever)


def test_within_stops_what_never_asks() -> None:
    def forever() -> None:
        while True:
            pass

    with pytest.raises(OutOfBudgetError):
        within(0.2, forever)
    assert within(10, lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        within(10, lambda: 1 / 0)


def test_elimination_names_what_it_would_divide_by() -> None:
    a = sympy.Symbol("a", real=True)
    with pytest.raises(DegenerateError) as caught:
        Elimination([x], [], {a: sympy.S.Zero}, Clock(10)).solve([a * x - 1])
    assert caught.value.expression == a
    with pytest.raises(UnsolvedError):
        Elimination([x], [], {}, Clock(10)).solve([sympy.cos(x) - x])


def test_14_5_affine_equations_have_the_branch_of_one_elimination_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of random rank, some of them without a solution: the same unknowns stay free."""
    random = np.random.default_rng(14)
    x, s = sympy.symbols("x1:4"), sympy.symbols("s1:3")
    cases = []
    for k, count in enumerate(random.integers(1, 6, 12)):
        rows = random.choice([0, 0, 1, -2, sympy.Rational(1, 3)], (count, 6))
        rows[-1, k % 2 :] = rows[0, k % 2 :]
        rows[-1, 5] += k % 3
        cases.append([sum(c * q for c, q in zip(row, (*x, *s, 1), strict=True)) for row in rows])
    found = [Elimination(x, s, {}, Clock(60.0)).solve(equations) for equations in cases]
    monkeypatch.setattr(Elimination, "_affine", lambda *_: None)
    assert found == [Elimination(x, s, {}, Clock(60.0)).solve(equations) for equations in cases]
    assert [] in found
    assert any(len(branch) < 5 for (branch,) in filter(None, found))


def test_elimination_follows_every_factor() -> None:
    found = Elimination([x, v], [], {}, Clock(10)).solve([x * (1 - v), v * (x - 2)])
    assert {(b[x], b[v]) for b in found} == {(0, 0), (2, 1)}


numbers = st.floats(-3, 3).filter(lambda q: abs(q) > 0.05)


p = parameters(a0=1, a1=1, a2=1, a3=1, b0=1, b1=1, c=1)
FEEDBACK, AT_0 = (
    System({x: p.a0 * x + p.a1 * v - p.b0 * sign(h), v: p.a2 * x + p.a3 * v - p.b1 * sign(h) + 1})
    for h in (x + p.c * v - 0.3, x)
)


@quick
@given(a=st.lists(numbers, min_size=4, max_size=4), b=st.lists(numbers, min_size=2, max_size=2), c=numbers)
def test_every_equilibrium_of_a_relay_feedback_balances_the_inclusion(a: list, b: list, c: float) -> None:
    values = {**{f"a{k}": q for k, q in enumerate(a)}, "b0": b[0], "b1": b[1], "c": c}
    for e in equilibria(FEEDBACK, values):
        points = e.ends if isinstance(e, EquilibriumSet) else (e,)
        for point in points:
            scale = 1 + max(map(abs, point.value))
            assert residual(FEEDBACK, point, values) < 1e-8 * scale
            value = point.value[0] + c * point.value[1] - 0.3
            if point.mode == "0":
                assert abs(value) < 1e-8 * scale
                assert abs(point.s_value[0]) <= 1 + 1e-8
            else:
                assert value * (1 if point.mode == "+" else -1) > 0


@quick
@given(a=st.lists(numbers, min_size=4, max_size=4), b=st.lists(numbers, min_size=2, max_size=2))
def test_no_smooth_equilibrium_is_missed(a: list, b: list) -> None:
    matrix = np.array(a).reshape(2, 2)
    if abs(np.linalg.det(matrix)) < 1e-3:
        return
    values = {**{f"a{k}": q for k, q in enumerate(a)}, "b0": b[0], "b1": b[1]}
    found = {e.mode: e.value for e in equilibria(AT_0, values).points}
    for mode, s in (("+", 1.0), ("-", -1.0)):
        place = np.linalg.solve(matrix, [b[0] * s, b[1] * s - 1])
        if abs(place[0]) > 1e-6:
            assert (mode in found) == (place[0] * s > 0)
            if mode in found:
                assert found[mode] == pytest.approx(tuple(place), rel=1e-9, abs=1e-9)
