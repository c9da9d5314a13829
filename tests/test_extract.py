"""Extraction of surfaces: off the surfaces the form must equal the expression that it came from."""

from __future__ import annotations

import os
import pickle
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from filippov.base.errors import ModelError
from filippov.model.parameter import Parameter
from filippov.model.parameter_symbol import parameters
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, SymbolicForm
from filippov.model.symbols import states, t
from filippov.model.system import System
from filippov.solving.solver import solve

x, v, z = states("x v z")
p = parameters(m=1, k=Parameter(3, lower=0.5), c=-2, Fs=4, Fc=2, vs=0.1, beta=2)

EXPRESSIONS = [
    sp.sign(v),
    -3 * sp.sign(-2 * v) + sp.Abs(2 * v),
    sp.sign(v) * sp.Abs(v) + sp.Abs(v) ** 2,
    v * sp.sign(v),
    sp.Abs(p.c * v) + sp.sign(p.c * v) * sp.Abs(p.c),
    sp.Heaviside(x - v) + sp.Heaviside(-v, 0) * sp.Heaviside(p.c, 1),
    sp.sign(v * x) + sp.Abs(v * x) + sp.sign(x**3 * v) + sp.sign(v**2 * x) + sp.sign(x / v),
    sp.sign(v - x) - sp.sign(2 * x - 2 * v) + sp.Abs(p.c * x - p.c * v),
    sp.sign(x + z * sp.sign(v)),
    sp.sign(x + sp.sign(v + sp.sign(z))),
    sp.sign(sp.sign(v) + sp.Rational(1, 2)),
    sp.sign(x - sp.Abs(v)) + sp.Abs(sp.Abs(v) - 1),
    sp.sign(sp.Max(x, v) - z),
    sp.Abs(sp.Min(x, v, z) + sp.Heaviside(x) / 3),
    sp.Max(x, v, z, 0) + sp.Min(x, v, z, 1),
    sp.Max(p.m, p.k) + sp.Max(p.m, p.k, x) + sp.Max(sp.sign(v), x),
    sp.Piecewise((1, v > 1), (v, v > -1), (-1, True)),
    sp.Piecewise((x, (v > 0) & (x < 1)), (2, (v < -1) | (z > 0)), (3, True)),
    sp.Piecewise(
        (x, ~((v > 0) & (z > 0))),
        (2, sp.Xor(v > 1, z > x, x > 0)),
        (3, sp.ITE(v > 2, z > 1, x > 2)),
        (4, True),
    ),
    sp.Piecewise((1, v > 0), (-1, v < 0)),
    sp.Piecewise((0, v <= 0), (1, v <= 1), (2, v > 1)),
    sp.Piecewise((x, p.c > 0), (v, p.c >= -2), (z, True)),
    sp.Piecewise((sp.sign(v) * 2, v > 0), (sp.Abs(x), x > v), (sp.Max(x, z), True)),
    sp.sign(sp.Piecewise((v, v > 0), (2 * v, True)) - x),
    sp.sign(sp.Piecewise((v, v > 0), (x, True)) - z),
    sp.Abs(v) ** p.beta * sp.exp(-((sp.Abs(v) / p.vs) ** p.beta)) * sp.sign(v),
    sp.sign(sp.sin(3 * t)) + sp.sign(x - t),
    Select(v - x, z, Select(x, v, 1)),
    sp.sign(sp.exp(x) * v) + sp.sign((1 + x**2) * z) + sp.sign(sp.Abs(x) * v),
    sp.sqrt(v**2) + sp.sqrt((x - v) ** 2),
    sp.sign(x**2 + v**2 - 1) * sp.tanh(v),
]


def values(form: SymbolicForm, point: dict[sp.Symbol, sp.Expr]) -> list[sp.Expr]:
    """The form at a point, s and a taken from its own h, as the definition says."""
    known = dict(point)
    for s, a, h in zip(form.s, form.a, form.h, strict=True):
        at = h.xreplace(known)
        known[s] = sp.Integer(1) if sp.N(at) > 0 else sp.Integer(-1)
        known[a] = sp.Abs(at)
    return [f.xreplace(known) for f in form.field]


def points(count: int, seed: int = 7) -> list[dict[sp.Symbol, sp.Expr]]:
    source = random.Random(seed)  # noqa: S311  (test points, not secrets)

    def number() -> sp.Rational:
        return sp.Rational(source.randint(-30011, 30011), 10007)

    return [
        {q: number() for q in (x, v, z, t)} | {q: sp.Float(q.parameter.default) for q in p}
        for _ in range(count)
    ]


def assert_equal_off_surfaces(expr: sp.Expr, system: System, count: int = 25) -> None:
    assert system.symbolic is not None
    for point in points(count):
        expected = sp.N(expr.xreplace(point))
        assert abs(sp.N(values(system.symbolic, point)[0]) - expected) < 1e-12 * (1 + abs(expected)), point


@pytest.mark.parametrize("expr", EXPRESSIONS, ids=str)
def test_form_equals_expression_off_the_surfaces(expr: sp.Expr) -> None:
    system = System({x: expr, v: 0, z: 0})
    form = system.symbolic
    assert form is not None
    assert_equal_off_surfaces(expr, system)
    allowed = {*form.x, *form.p, t}
    for i, h in enumerate(form.h):
        assert h.free_symbols <= allowed | set(form.a[:i])
    for f in form.field:
        assert f.free_symbols <= allowed | set(form.s) | set(form.a)
        assert not f.has(sp.Piecewise, sp.Heaviside, sp.Max, sp.Min)
        for node in f.atoms(sp.sign, sp.Abs):
            assert node.free_symbols <= set(form.p)
    assert len({surface.name for surface in system.surfaces}) == len(system.surfaces)


FLAT = [
    (sp.Max(0, -x) > 0, x < 0),
    (sp.Max(0, -x) <= 0, x >= 0),
    (sp.Max(0, x, v) > 0, (x > 0) | (v > 0)),
    (sp.Max(0, x) + sp.Max(0, v) > 0, (x > 0) | (v > 0)),
    (sp.Max(0, x) * v > 0, (x > 0) & (v > 0)),
    (sp.Min(sp.Max(0, x), 1) >= 1, x >= 1),
    (sp.Min(sp.Max(-p.k, x), p.k) < p.k, x < p.k),
    (sp.Abs(x - v) > v - x, x > v),
    (sp.Abs(x - v) + sp.Abs(v - z) > sp.Abs(x - z) + sp.Rational(1, 10**6), None),
    (sp.Max(x, v) > sp.Max(x, z), (v > sp.Max(x, z))),
]


@pytest.mark.parametrize(("condition", "plain"), FLAT, ids=str)
def test_a_condition_on_what_is_0_in_whole_regions_is_that_of_its_border(condition: Any, plain: Any) -> None:
    """Max(0, u) > 0 is u > 0: no surface has a switching function that is 0 off it."""
    expr = sp.Piecewise((x + v, condition), (z, True))
    system = System({x: expr, v: 0, z: 0})
    assert_equal_off_surfaces(expr, system)
    if plain is not None:
        assert_equal_off_surfaces(sp.Piecewise((x + v, plain), (z, True)), system)


def test_a_fall_onto_a_damped_spring_is_the_same_however_its_contact_is_asked_for() -> None:
    """Off the spring a condition on its length, which is 0 there, slid and ended as non_unique."""
    ends = []
    for touches in (x < 0, sp.Max(0, -x) > 0):
        force = sp.Max(0, -x) * 1e4 - 10 * v * sp.Piecewise((1, touches), (0, True))
        run = solve(System({x: v, v: force - sp.Float("9.81"), z: 0}), (1, 0, 0), (0, 3))
        assert run.success
        ends.append(run.x_end)
    assert ends[1] == pytest.approx(ends[0], rel=1e-12)


@pytest.mark.parametrize("u", [sp.Max(0, -x), sp.Abs(x) - x, sp.Max(0, x) + sp.Max(0, v)], ids=str)
def test_the_sign_of_what_is_0_in_whole_regions_is_refused(u: sp.Expr) -> None:
    with pytest.raises(ModelError, match=r"the equation of 'x'.*0 everywhere on one side of a surface"):
        System({x: sp.sign(u), v: 0, z: 0})


atoms = st.sampled_from([x, v, z, x - v, v + z - 1, p.c * v, sp.Integer(1), p.k])


def _grow(inner: st.SearchStrategy[sp.Expr]) -> st.SearchStrategy[sp.Expr]:
    pair = st.tuples(inner, inner)
    return st.one_of(
        inner.map(sp.sign),
        inner.map(sp.Abs),
        inner.map(sp.Heaviside),
        pair.map(lambda q: q[0] + q[1]),
        pair.map(lambda q: q[0] * q[1]),
        pair.map(lambda q: sp.Max(*q)),
        pair.map(lambda q: sp.Min(*q)),
        st.tuples(inner, inner, inner).map(
            lambda q: sp.Piecewise((q[0], x - v > 0), (q[1], z < q[2]), (2, True))
        ),
    )


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.recursive(atoms, _grow, max_leaves=5))
def test_random_expressions(expr: sp.Expr) -> None:
    try:
        system = System({x: expr, v: 0, z: 0})
    except ModelError as error:
        if "0 everywhere" in str(error):  # a sign whose argument vanishes identically is refused
            return
        raise
    assert system.symbolic is not None
    for point in points(6):
        inside = [sp.N(h.xreplace(point)) for h in system.symbolic.plain_h()]
        if any(h == 0 for h in inside):
            continue
        expected = sp.N(expr.xreplace(point))
        assert abs(sp.N(values(system.symbolic, point)[0]) - expected) < 1e-12 * (1 + abs(expected))


def kinds(expr: sp.Expr, *surfaces: Surface) -> dict[str, str]:
    return {q.name: q.kind for q in System({x: expr, v: 0, z: 0}, surfaces=surfaces).surfaces}


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (sp.sign(v), {"v": "switching"}),
        (sp.Abs(v), {"v": "kink"}),
        (sp.sign(v) * sp.Abs(v), {"v": "kink"}),
        (v * sp.sign(v), {"v": "kink"}),
        (sp.sign(v) * sp.Abs(v) ** p.beta, {"v": "kink"}),
        (sp.sign(v) * sp.exp(-sp.Abs(v)), {"v": "switching"}),
        (sp.Max(x, v), {"v - x": "kink"}),
        (sp.Piecewise((1, v > 1), (v, v > -1), (-1, True)), {"v - 1": "kink", "v + 1": "kink"}),
        (sp.Piecewise((2, v > 1), (v, v > -1), (-1, True)), {"v - 1": "switching", "v + 1": "kink"}),
        (sp.Piecewise((sp.Integer(1), v > 0.1), (10 * v, True)), {"v - 0.1": "kink"}),
        (sp.sign(x - sp.Abs(v)), {"v": "kink", "x - Abs(v)": "switching"}),
        (sp.sign(v) ** 2 + x, {"v": "kink"}),
        (1e-14 * sp.sign(v) + x, {"v": "switching"}),
        (sp.sign(v) * (x - v) * sp.Heaviside(z), {"v": "switching", "z": "switching"}),
        (sp.sign(v) * v * sp.Heaviside(z), {"v": "kink", "z": "switching"}),
        (sp.sign(x**2 + v**2 - 1), {"v**2 + x**2 - 1": "switching"}),
        (sp.sign(x**2 + v**2 - 1) * (x**2 + v**2 - 1), {"v**2 + x**2 - 1": "kink"}),
        (sp.Abs(p.c) * v + sp.sign(p.m), {}),
    ],
    ids=str,
)
def test_kinds_and_names(expr: sp.Expr, expected: dict[str, str]) -> None:
    assert kinds(expr) == expected


def test_max_of_three_has_only_kinks() -> None:
    assert set(kinds(sp.Max(x, v, z) - sp.Min(x, v, z)).values()) == {"kink"}
    assert set(kinds(sp.Max(x**2, v**2, z)).values()) == {"kink"}


def test_piecewise_maximum_has_only_kinks() -> None:
    largest = sp.Piecewise((x, (x > v) & (x > z)), (v, v > z), (z, True))
    assert set(kinds(largest).values()) == {"kink"}


def test_every_boundary_of_boxes_is_found() -> None:
    boxes = sp.Piecewise(
        (1, (x > 0) & (v > 0) & (z > 0)), (2, (x < 1) & (v < 1) & (z < 1)), (3, (x > 2) | (v > 2)), (4, True)
    )
    found = kinds(boxes * (2 + sp.sign(x + v + z)))
    assert len(found) == 9
    assert set(found.values()) == {"switching"}


def test_a_jump_that_needs_a_rare_combination_is_found() -> None:
    narrow = sp.Piecewise((sp.sign(v), (x > 5) & (x < sp.Rational(5001, 1000))), (0, True))
    assert kinds(narrow)["v"] == "switching"


def test_close_thresholds_stay_two_surfaces() -> None:
    assert len(kinds(sp.sign(v - 1e-14) + sp.sign(v + 1e-14))) == 2


def test_equal_surfaces_are_merged_with_the_declared_one() -> None:
    system = System(
        {x: sp.sign(v) + sp.Abs(v), v: sp.sign(2 * v), z: sp.sign(-p.k * v)},
        surfaces=[Surface("velocity", -2 * v, radius=p.Fs / p.Fc)],
    )
    form = system.symbolic
    assert form is not None
    (s,), (a,) = form.s, form.a
    assert form.field == (-s + a / 2, -s, s)
    assert form.h == (-2 * v,)
    assert form.radius == ((-p.Fs / p.Fc, p.Fs / p.Fc),)
    assert [q.name for q in system.surfaces] == ["velocity"]


def test_expanded_and_factored_forms_are_one_surface() -> None:
    assert len(kinds(sp.sign(p.c * (x - v)) + sp.sign(p.c * x - p.c * v) + sp.sign(0.1 * x - 0.1 * v))) == 1


def test_order_declared_first_dependencies_earlier() -> None:
    def names(*surfaces: Surface) -> list[str]:
        return list(kinds(sp.sign(z - sp.Abs(v)) + sp.sign(x), *surfaces))

    assert names(Surface("b", x)) == ["b", "v", "z - Abs(v)"]
    assert names(Surface("b", z - sp.Abs(v)), Surface("a", x)) == ["v", "b", "a"]
    assert names(Surface("b", z - sp.Abs(v)), Surface("a", v)) == ["a", "b", "x"]


def test_nested_sizes_are_written_with_a() -> None:
    form = System({x: sp.sign(z - sp.Max(x, v)), v: 0, z: 0}).symbolic
    assert form is not None
    assert form.plain_h()[1].equals(z - sp.Max(x, v).rewrite(sp.Abs)) or form.plain_h()[1].equals(
        sp.Max(x, v).rewrite(sp.Abs) - z
    )
    assert form.a[0] in form.h[1].free_symbols


@pytest.mark.parametrize(
    ("expr", "words"),
    [
        (sp.Piecewise((1, sp.Eq(v, 0)), (2, True)), "equality"),
        (sp.Piecewise((1, sp.Ne(v, 0)), (2, True)), "equality"),
        (sp.Piecewise((1, v > 1), (2, v < 0)), "no branch"),
        (sp.sign(sp.sign(v) - 1), "0 everywhere"),
        (sp.floor(v), "infinitely often"),
        (sp.Mod(v, 2), "infinitely often"),
        (sp.I * v, "complex"),
        (sp.sqrt(-1 - v**2), "complex"),
        (sp.nan, "not finite"),
        (sp.oo, "not finite"),
        (sp.Function("f")(v), "undefined function"),
        (sp.Derivative(sp.exp(v) * v, v), "doit"),
        (sp.DiracDelta(v), "impulse"),
        (v > 0, "condition"),
        ("v", "never parsed"),
        (True, "expected a sympy expression"),
        (1j, "expected a sympy expression"),
        (float("nan"), "not finite"),
        (None, "NoneType"),
    ],
    ids=str,
)
def test_refused_expressions(expr: object, words: str) -> None:
    with pytest.raises(ModelError, match=words) as caught:
        System({x: v, v: expr, z: 0})
    assert "'v'" in str(caught.value)


def test_select_resolves_and_differentiates() -> None:
    s = sp.Symbol("s", real=True)
    f = Select(s, v**3, 1 / v)
    assert f.subs(s, 1) == v**3
    assert f.subs(s, -1) == 1 / v
    assert f.subs({s: 1, v: 0}) == 0
    assert f.xreplace({s: sp.Integer(-1), v: sp.Integer(2)}) == sp.Rational(1, 2)
    assert f.diff(v) == Select(s, 3 * v**2, -1 / v**2)
    assert f.diff(s) == 0
    assert f.diff(v).doit() == f.diff(v)
    assert (x * f).diff(x) == f
    assert Select(s, v, v) == v
    assert Select(s, 1.5, 2.5).evalf() == Select(s, 1.5, 2.5)
    assert pickle.loads(pickle.dumps(f)) == f  # noqa: S301
    assert sp.lambdify([s, v], f, "math")(1, 0) == 0
    assert list(sp.lambdify([s, v], Select(s, v, -v))(np.array([1, -1]), 2)) == [2, -2]
    assert f.rewrite(sp.Piecewise) == sp.Piecewise((v**3, s > 0), (1 / v, True))


def _digest(seed: str) -> str:
    root = Path(__file__).resolve().parent.parent
    lines = [
        "import sympy as sp",
        "from filippov.model.symbols import states",
        "from filippov.model.system import System",
        "x, v, z = states('x v z')",
        "first = sp.Max(x, v, z, 1) + sp.sign(x + sp.Abs(v))",
        "second = sp.Piecewise((1, (x > 0) & (v < z)), (2, True))",
        "print(System({x: first, v: second, z: sp.sign(z - v)}).digest)",
    ]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)],
        cwd=root,
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_digest_does_not_depend_on_the_hash_seed() -> None:
    assert _digest("1") == _digest("2")


def test_16_6_a_saturation_has_one_surface_a_bound() -> None:
    """Max(a, Min(b, u)): u meets each bound by itself; written either way round, and with a > b."""
    bound = parameters(lo=-1.0, hi=0.5)
    lo, hi = bound.lo, bound.hi
    u = -3 * x - v
    named = {"hi + v + 3*x", "lo + v + 3*x"}
    for h in (sp.Max(lo, sp.Min(hi, u)), sp.Min(hi, sp.Max(lo, u))):
        system = System({x: v, v: h})
        assert set(system.surface_names) == named
        assert {surface.kind for surface in system.surfaces} == {"kink"}
        exact = sp.lambdify((x, v, lo, hi), h, "math")
        for bounds in ((-1.0, 0.5), (0.5, -1.0)):
            values = dict(zip(("lo", "hi"), bounds, strict=True))
            for at in ((2.0, 0.3), (0.1, -0.2), (-1.0, 0.5)):
                run = solve(system, at, (0, 1e-3), parameters=values)
                assert run.sol is not None
                assert run.sol.rate(0.0, "+")[1] == pytest.approx(exact(*at, *bounds), abs=1e-6)
    assert set(System({x: np.clip(-x, -1, 1)}).surface_names) == {"x - 1", "x + 1"}
    assert System({x: sp.Max(-1.5, sp.Min(v - 2 * x, 9)), v: -x}).surface_names[1] == "v - 2*x + 1.5"


@pytest.mark.parametrize("level", [0.5, 10, 1e5])
@pytest.mark.parametrize("form", ["Max", "Min", "Abs", "product"])
def test_a_jump_that_a_continuous_function_hides_near_the_origin(level: float, form: str) -> None:
    """x' = 1 - sign(x) max(y - c, 0), y' = 1 from y = c - 1: x is 0 at t = 4 and stays there."""
    load = {
        "Max": sp.Max(v - level, 0),
        "Min": -sp.Min(level - v, 0),
        "Abs": (v - level + abs(v - level)) / 2,
        "product": sp.Max(v * z - level, 0),
    }[form]
    system = System({x: 1 - sp.sign(x) * load, v: 1 + 0 * v, z: 0 * z})
    assert next(surface.kind for surface in system.surfaces if surface.name == "x") == "switching"
    run = solve(system, (0.5, level - 1, 1), (0, 6))
    assert run.status == "success"
    assert run.events.t == pytest.approx([1, 4], abs=1e-8)
    assert run.multiplier("x", 5.0) == pytest.approx(1 / 4, rel=1e-8)


def test_what_continuous_functions_make_of_a_sign_may_be_a_kink() -> None:
    """sign(x) max(|x| - y^2 - 1, 0) is 0 next to x = 0, and |x| max(y, 0) is continuous."""
    field = sp.sign(x) * sp.Max(abs(x) - v**2 - 1, 0) + abs(x) * sp.Max(v - 10, 0)
    system = System({x: field, v: 0 * v})
    assert next(surface.kind for surface in system.surfaces if surface.name == "x") == "kink"
