"""What a user writes: surfaces, systems, comparators."""

from __future__ import annotations

import copy
import pickle
import pkgutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import filippov
from filippov.base.errors import ModelError, NonUniqueError, SolveError, UsageError
from filippov.kernel.codegen.generate import total_gradients
from filippov.model.comparator import Band, Exact, Hysteresis, Smooth
from filippov.model.parameter_symbol import parameters
from filippov.model.surface import Surface
from filippov.model.symbols import states, t
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.solving.ensemble import solve_many
from filippov.solving.state.machine import Machine

x, v, z = states("x v z")


def hunting() -> System:
    p = parameters(m=1, P=10, D=1, I=10, Fs=4, Fc=2, vs=0.1, beta=2, b=1)
    u = p.P * (x + p.D * v + p.I * z)
    g = p.Fc + (p.Fs - p.Fc) * sp.exp(-((abs(v) / p.vs) ** p.beta))
    return System({x: v, v: (-u - g * sp.sign(v) - p.b * v) / p.m, z: x})


def test_the_sample_has_one_surface_named_v() -> None:
    system = hunting()
    assert system.states == ("x", "v", "z")
    assert system.dimension == 3
    assert [(q.name, q.kind, q.radius) for q in system.surfaces] == [("v", "switching", (-1.0, 1.0))]
    assert system.parameters.names == ("m", "P", "D", "I", "Fs", "Fc", "vs", "beta", "b")
    assert list(system.parameters.defaults) == [1, 10, 1, 10, 4, 2, 0.1, 2, 1]
    assert system.comparator == Exact()
    assert system.symbolic is not None
    assert system.symbolic.h == (v,)


def test_sample_field_against_the_formula() -> None:
    form = hunting().symbolic
    assert form is not None
    at = dict(zip(form.p, (1.0, 10, 1, 10, 4, 2, 0.1, 2, 1), strict=True))
    for velocity in (0.07, -0.03):
        mode = "+" if velocity > 0 else "-"
        got = form.at_mode(mode)[1].subs(at).subs({x: 0.1, v: velocity, z: 0.02})
        g = 2 + 2 * np.exp(-((abs(velocity) / 0.1) ** 2))
        u = 10 * (0.1 + velocity + 10 * 0.02)
        assert float(got) == pytest.approx(-u - np.sign(velocity) * g - velocity, rel=1e-14)


def test_jacobian_against_differences() -> None:
    form = hunting().symbolic
    assert form is not None
    at = dict(zip(form.p, map(sp.Float, (1, 10, 1, 10, 4, 2, 0.1, 1.5, 1), [30] * 9), strict=True))
    base = {x: sp.Rational(1, 10), v: sp.Rational(-3, 100), z: sp.Rational(1, 50)}
    exact = form.jacobian("-").subs(at).subs(base)
    step = sp.Rational(1, 10**8)
    for j, q in enumerate(form.x):
        for i, f in enumerate(form.at_mode("-")):
            up, down = (f.subs(at).subs({**base, q: base[q] + d}) for d in (step, -step))
            assert abs(sp.N((up - down) / (2 * step), 25) - exact[i, j]) < 1e-9


def test_jacobian_is_finite_where_slip_begins() -> None:
    form = hunting().symbolic
    assert form is not None
    at = dict(zip(form.p, (1.0, 10, 1, 10, 4, 2, 0.1, 2, 1), strict=True))
    assert float(form.jacobian("+").subs(at).subs({x: 0, v: 0, z: 0})[1, 1]) == pytest.approx(-11)


def test_sliding_keeps_the_sign_and_drops_the_size() -> None:
    form = System(
        {x: v, v: -3 * sp.sign(v) - 2 * abs(v) + sp.Piecewise((x, v > 0), (z, True)), z: 0}
    ).symbolic
    assert form is not None
    s = form.s[0]
    assert sp.expand(form.at_mode("0")[1] - (-3 * s + (1 + s) / 2 * x + (1 - s) / 2 * z)) == 0
    assert form.at_mode((1,))[1] == x - 2 * v - 3
    assert form.at_mode((-1,))[1] == z + 2 * v + 3
    with pytest.raises(UsageError, match="expected 1 entries"):
        form.at_mode("+-")
    with pytest.raises(UsageError, match="mode 'x'"):
        form.at_mode("x")


def test_nested_sizes_in_modes_gradients_and_rates() -> None:
    form = System({x: sp.sign(z - abs(v)) + abs(v) ** 3, v: x + t, z: sp.Integer(1)}).symbolic
    assert form is not None
    assert form.h[0] == v
    for mode, h in (((1, 1), z - v), ((-1, 1), z + v)):
        outer = form.h_at_mode(mode)[1]
        assert outer in {h, -h}
        m = mode[0]
        fixed = dict(zip(form.s, mode, strict=True)) | {form.a[0]: m * v}
        slopes = [row[:3] for row in total_gradients(form, tuple(map(sp.Integer, mode)))]
        assert sp.Matrix(slopes).subs(fixed) == form.gradients(mode)
        f, sizes = sp.Matrix(form.field), sp.Matrix(form.a)
        fx = f.jacobian(form.x) + f.jacobian(sizes) * sp.diag(*mode) * form.gradients(mode)
        assert sp.simplify(fx.subs(fixed) - form.jacobian(mode)) == sp.zeros(3, 3)
        field = form.at_mode(mode)
        expected = outer.diff(v) * field[1] + outer.diff(z) * field[2]
        assert sp.expand(form.rates(mode)[1] - expected) == 0


def test_time_dependent_surface() -> None:
    system = System({x: sp.sign(x - sp.sin(t))})
    assert system.symbolic is not None
    assert sp.expand(system.symbolic.rates("+")[0].subs(x, 0)) in {1 - sp.cos(t), sp.cos(t) - 1}


def test_from_modes() -> None:
    fields = {"++": [1, v], "+-": (-1, x), "-*": {x: t, v: 3}}
    system = System.from_modes([v, Surface("place", x, radius=2)], fields, (x, v))
    form = system.symbolic
    assert form is not None
    assert [q.name for q in system.surfaces] == ["v", "place"]
    assert form.at_mode("++") == (1, v)
    assert form.at_mode("+-") == (-1, x)
    assert form.at_mode("-+") == form.at_mode("--") == (t, 3)


def test_from_modes_is_filippovs_convex_combination() -> None:
    system = System.from_modes([v], {"+": [x, -2], "-": [v, 1]}, (x, v))
    assert system.symbolic is not None
    s = system.symbolic.s[0]
    lam = (1 + s) / 2
    expected = (lam * x + (1 - lam) * v, -2 * lam + (1 - lam))
    assert all(sp.expand(f - e) == 0 for f, e in zip(system.symbolic.at_mode("0"), expected, strict=True))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"+": [1, 2]}, "no entry for -"),
        ({"+": [1], "-": [1, 2]}, "expected 2 expressions"),
        ({"+": [1, 2], "?": [1, 2]}, "expected 1 entries"),
        ({"+": [1, 2], "*": [1, 2]}, "twice"),
        ([1, 2], "expected a dict"),
        ({"+": {x: 1}, "-": [1, 2]}, "expected one equation"),
        ({"+": ["x", 2], "-": [1, 2]}, "never parsed"),
    ],
)
def test_from_modes_refuses(fields: Any, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        System.from_modes([v], fields, (x, v))


# -- errors in models ----------------------------------------------------------------------------------


def friction(*surfaces: Surface, **more: Any) -> System:
    return System({x: v, v: -sp.sign(v) - x}, surfaces=surfaces, **more)


@pytest.mark.parametrize(
    ("surfaces", "words"),
    [
        ([Surface("a", v), Surface("b", 2 * v)], "surfaces 'a' and 'b' are the same set"),
        ([Surface("a", v), Surface("b", -v)], "same set"),
        ([Surface("a", v), Surface("a", x)], "two surfaces are named 'a'"),
        ([Surface("a", x + 1)], "does not occur in the equations"),
        ([Surface("a", sp.sign(v))], "continuous"),
        ([Surface("a", v**2)], "never changes its sign"),
        ([Surface("a", v**3)], "no slope where v is 0"),
        ([Surface("a", -2 * (v - x) ** 5 / (1 + x**2))], "no slope where v - x is 0"),
        ([Surface("a", v * x**2, kind="observer")], "no slope where x is 0"),
        ([Surface("a", sp.Integer(3))], "no state and no time"),
        ([Surface("a", sp.floor(v))], "infinitely often"),
        ([Surface("a", lambda t, x, p: 0.0)], "h is a function"),
        ([Surface("a", v, kind="kink")], "declared as 'kink'"),
        ([Surface("a", v, kind="observer")], "declared as 'observer'"),
        ([v], "expected Surface"),
    ],
)
def test_surfaces_refused(surfaces: Any, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        friction(*surfaces)


def test_observer_and_radius() -> None:
    system = friction(Surface("wall", x - 1, kind="observer"), Surface("velocity", v, radius=(-2, 3)))
    assert [(q.name, q.kind) for q in system.surfaces] == [("wall", "observer"), ("velocity", "switching")]
    assert system.symbolic is not None
    assert system.symbolic.radius == ((-1, 1), (-2, 3))
    p = parameters(Fs=1, Fc=2)
    with pytest.raises(
        ModelError, match=r"is 0\.5.* at the default parameters, expected at least 1|at most -1"
    ):
        friction(Surface("velocity", v, radius=p.Fs / p.Fc))
    with pytest.raises(ModelError, match="do not jump"):
        System({x: abs(x)}, surfaces=[Surface("a", x, radius=2)])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"radius": 0.5}, "does not contain"),
        ({"radius": (1, 2, 3)}, "3 entries"),
        ({"radius": "2"}, "expected a real number"),
        ({"radius": float("nan")}, "finite"),
        ({"kind": "swtiching"}, "expected one of"),
        ({"name": ""}, "non-empty"),
        ({"name": 3}, "non-empty"),
        ({"h": 3}, "expected a sympy expression"),
        ({"h": v > 0}, "is a condition"),
        ({"width": -1}, ">= 0"),
        ({"gradient": 3}, "expected a function"),
        ({"linear": True}, "are for functions"),
    ],
)
def test_surface_arguments(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Surface(**{"name": "a", "h": v, **arguments})


def test_equations_refused() -> None:
    mu = sp.Symbol("mu")
    with pytest.raises(ModelError, match=r"symbol 'mu'.*parameters\(mu=...\)"):
        System({x: -mu * x})
    with pytest.raises(ModelError, match=r"symbol 'z'.*if it is a state, add its equation"):
        System({x: v, v: z})
    with pytest.raises(ModelError, match="assumptions differ"):
        System({x: sp.Symbol("x")})
    with pytest.raises(ModelError, match="not the real symbol"):
        System({sp.Symbol("x"): sp.Integer(1)})
    with pytest.raises(ModelError, match=r"filippov\.t"):
        System({x: sp.Symbol("t")})
    with pytest.raises(ModelError, match="state 'z' has no equation"):
        System({x: v, v: x}, states="x v z")
    with pytest.raises(ModelError, match="does not name"):
        System({x: v, v: x}, states="x")
    with pytest.raises(ModelError, match="at least one"):
        System({})
    with pytest.raises(ModelError, match="expected a dict"):
        System([v, x])  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="expected a state"):
        System({"x": 1})
    with pytest.raises(ModelError, match="neither was"):
        System()
    with pytest.raises(ModelError, match="both were"):
        System({x: 1}, field=lambda t, x, p, s: x)
    one, two = parameters(m=1), parameters(m=2)
    with pytest.raises(ModelError, match="two declarations"):
        System({x: one.m * two.m})
    with pytest.raises(ModelError, match="both a state and a parameter"):
        System({x: parameters(x=1).x})
    with pytest.raises(ModelError, match="unknown keyword 'surface'; did you mean 'surfaces'"):
        System({x: 1}, surface=[])  # type: ignore[call-arg]


def test_states_give_the_order_and_unused_parameters_are_kept() -> None:
    p = parameters(a=1, unused=2, b=3)
    system = System({x: p.b * v, v: p.a}, states="v x", parameters=p)
    assert system.states == ("v", "x")
    assert system.parameters.names == ("a", "unused", "b")


# -- plain functions -----------------------------------------------------------------------------------


def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
    return [x[1], -p.Fc * s[0] - x[0]]


def velocity(t: float, x: Any, p: Any) -> float:
    return float(x[1])


def plain(**more: Any) -> System:
    arguments: dict[str, Any] = {
        "field": field,
        "surfaces": [Surface("velocity", velocity, radius=2)],
        "states": "x v",
        "parameters": {"Fc": 2},
    }
    return System(**{**arguments, **more})


def test_functions_are_kept_untouched() -> None:
    system = plain()
    assert system.field is field
    assert system.surfaces[0].h is velocity
    assert system.surfaces[0].radius == (-2.0, 2.0)
    assert system.symbolic is None
    assert system.digest is None
    again = pickle.loads(pickle.dumps(system))  # noqa: S301
    assert again == system
    assert again.field is field
    with pytest.raises(ModelError, match="plain function"):
        system.jacobian("+")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"field": 3}, "expected a function"),
        ({"states": None}, "states are missing"),
        ({"surfaces": [Surface("a", v)]}, "is an expression"),
        ({"surfaces": [Surface("a", velocity), Surface("b", velocity)]}, "same set"),
        ({"surfaces": [Surface("a", velocity), Surface("a", field)]}, "two surfaces"),
        ({"surfaces": ["a"]}, "expected Surface"),
        ({"parameters": {"x": 1}}, "both a state and a parameter"),
        ({"parameters": [1, 2]}, "expected parameters"),
    ],
)
def test_functions_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        plain(**arguments)


# -- identity and comparators --------------------------------------------------------------------------


def test_system_is_immutable_picklable_and_has_a_digest() -> None:
    system = hunting()
    with pytest.raises(AttributeError, match="immutable"):
        system.states = ("a",)
    again = pickle.loads(pickle.dumps(system))  # noqa: S301
    assert again == system
    assert hash(again) == hash(system)
    assert again.digest == system.digest == hunting().digest
    assert len(system.digest or "") == 64
    others = [friction(), friction(Surface("velocity", v)), friction(Surface("velocity", v, radius=2))]
    others += [system.with_comparator(c) for c in (Band(1e-3), Band(1e-4), Smooth(1e-3), Hysteresis(1e-3))]
    assert len({q.digest for q in [system, *others]}) == len(others) + 1
    assert system.state_index("v") == system.state_index(v) == 1
    assert system.surface_index("v") == 0
    with pytest.raises(ModelError, match="unknown state 'V'; did you mean 'v'"):
        system.state_index("V")
    with pytest.raises(ModelError, match="unknown surface"):
        system.surface_index("w")


def _value(system: System, at: dict[sp.Symbol, float]) -> list[float]:
    form = system.symbolic
    assert form is not None
    known: dict[sp.Symbol, Any] = {**at, **{q: q.parameter.default for q in form.p}}
    for s, a, h in zip(form.s, form.a, form.h, strict=True):
        value = h.subs(known)
        known[s], known[a] = (1 if value > 0 else -1), abs(value)
    return [float(f.subs(known)) for f in form.field]


@pytest.mark.parametrize(
    ("comparator", "sign"),
    [(Band(0.01), lambda h: np.clip(h / 0.01, -1, 1)), (Smooth(0.01), lambda h: np.tanh(h / 0.01))],
)
def test_regularised_field(comparator: Any, sign: Any) -> None:
    system = hunting().with_comparator(comparator)
    assert all(q.kind == "kink" for q in system.surfaces)
    for w in (-0.3, -0.02, -0.006, 0.003, 0.009, 0.011, 0.5):
        g = 2 + 2 * np.exp(-((abs(w) / 0.1) ** 2))
        expected = -10 * (0.1 + w + 10 * 0.2) - g * sign(w) - w
        assert _value(system, {x: 0.1, v: w, z: 0.2})[1] == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("comparator", [Band(0.01), Smooth(0.01)])
def test_regularised_functions_agree_with_expressions(comparator: Any) -> None:
    p = parameters(Fc=2)
    symbolic = System({x: v, v: -p.Fc * sp.sign(v) - x}).with_comparator(comparator)
    system = plain().with_comparator(comparator)
    assert system.field is not None
    assert len(system.surfaces) == len(symbolic.surfaces)
    record = system.parameters.record(system.parameters.defaults)
    for w in (-0.02, -0.004, 0.007, 0.3):
        point = np.array([0.5, w])
        s = [1.0 if q.h(0.0, point, record) > 0 else -1.0 for q in system.surfaces]
        got = system.field(0.0, point, record, np.array(s))
        assert got == pytest.approx(_value(symbolic, {x: 0.5, v: w}), rel=1e-13)
    assert pickle.loads(pickle.dumps(system)) == system  # noqa: S301


def test_hysteresis_sets_a_width_and_keeps_the_size_apart() -> None:
    (surface,) = friction().with_comparator(Hysteresis(0.1)).surfaces
    assert (surface.kind, surface.width) == ("switching", 0.1)
    system = hunting().with_comparator(Hysteresis(0.1))
    assert [(q.name, q.kind, q.width) for q in system.surfaces] == [
        ("|v|", "kink", 0),
        ("v", "switching", 0.1),
    ]
    assert plain().with_comparator(Hysteresis(0.1)).surfaces[0].width == 0.1


def test_comparators_apply_to_the_exact_system_and_spare_kinks() -> None:
    system = System({x: abs(x) - sp.sign(v), v: sp.sign(x - abs(v))})
    kinks = [q for q in system.surfaces if q.kind == "kink"]
    smooth = system.with_comparator(Band(1e-3)).with_comparator(Smooth(1e-3))
    assert smooth == system.with_comparator(Smooth(1e-3))
    assert smooth.exact is system
    assert smooth.with_comparator(Exact()) is system
    assert [q for q in smooth.surfaces if q.name in {k.name for k in kinks}] == kinks
    for c in (Band(0.1), Smooth(0.1), Hysteresis(0.1)):
        form = system.with_comparator(c).symbolic
        assert form is not None
        for i, h in enumerate(form.h):
            assert h.free_symbols <= {*form.x, *form.a[:i]}


@pytest.mark.parametrize("wrong", [Band, "band", None, 0.1, []])
def test_comparator_refused(wrong: Any) -> None:
    with pytest.raises(ModelError, match="comparator is"):
        friction().with_comparator(wrong)
    for bad in (0, -1, float("nan"), "1"):
        with pytest.raises(ModelError, match="width of"):
            Band(bad)  # type: ignore[arg-type]


# -- package -------------------------------------------------------------------------------------------


def test_import_is_lazy_and_exports_exist() -> None:
    root = Path(__file__).resolve().parent.parent
    code = (
        "import sys, filippov; print([m for m in ('numpy', 'scipy', 'sympy', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    with pytest.raises(AttributeError, match="no attribute 'sovle'"):
        _ = filippov.sovle
    for name in ("t", "states", "parameters", "System", "Surface", "sign", "exp", "Abs", "Band"):
        assert getattr(filippov, name) is not None


def test_no_export_is_named_like_a_module() -> None:
    """Importing filippov.solve would put the module in place of the function."""
    assert not {m.name for m in pkgutil.iter_modules(filippov.__path__)} & set(filippov.__all__)


def test_errors_carry_the_solution_through_pickle() -> None:
    error = pickle.loads(pickle.dumps(NonUniqueError("two", solution=[1])))  # noqa: S301
    assert isinstance(error, SolveError)
    assert (str(error), error.solution) == ("two", [1])


def test_a_system_that_was_sent_is_the_one_it_was() -> None:
    p = parameters(k=2.0, T=0.5)
    clock = TimeEvent("clock", period=p.T, reset={v: 0})
    system = System({x: v, v: -p.k * x - sp.sign(v)}, time_events=[clock]).with_comparator(Band(0.1))
    for again in (pickle.loads(pickle.dumps(system)), copy.deepcopy(system)):  # noqa: S301
        twice = pickle.loads(pickle.dumps(again))  # noqa: S301  # sent on before anyone has looked into it
        for other in (twice, again):
            assert other.clocked
            assert other.surface_names == system.surface_names
            assert other == system
            assert hash(other) == hash(system)
            assert other.symbolic == system.symbolic
            assert other.surfaces == system.surfaces
            assert other.time_events == system.time_events
            assert other.exact == system.exact != system
            with pytest.raises(AttributeError, match="no attribute 'surface'"):
                other.surface  # noqa: B018
            with pytest.raises(AttributeError, match="immutable"):
                other.symbolic = None  # type: ignore[misc]


def test_a_system_from_another_version_has_its_loop_made_anew() -> None:
    system = hunting()
    solve_many(system, [0.1, 0.0, 0.0], (0, 1), threads=1)
    (key,) = system.units
    # As if another version had sent it, with a unit that this one cannot use.
    other = pickle.loads(pickle.dumps(system))  # noqa: S301
    other.units.clear()
    other.units[b"older", False] = None
    assert Machine(other, "DOP853", other.parameters.defaults).unit == system.units[key]


def test_functions_need_no_sympy() -> None:
    code = """
import sys
from filippov import Problem, Surface, System, solve_many
from filippov.solving.solver import solve
system = System(
    field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("x", lambda t, x, p: x[0])], states="x"
)
assert abs(solve(Problem(system, [1.0], (0, 2))).x_end[0]) < 1e-12
assert abs(solve_many(system, [[1.0], [0.5]], (0, 2)).x).max() < 1e-12
assert "sympy" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)
