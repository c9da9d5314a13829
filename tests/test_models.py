"""Models: friction laws against closed forms, fields against formulas written out by hand, the registry."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from filippov import ModelError, System, UsageError, models
from filippov.model.parameter_symbol import parameters
from filippov.models import (
    PD,
    PID,
    ControlledMass,
    Coulomb,
    FrictionLaw,
    Hyperbolic,
    Karnopp,
    LuGre,
    Model,
    P,
    StaticCoulomb,
    Stribeck,
    Switch,
    Viscous,
    controlled_mass,
    degeneracies,
    hunting,
    registry,
)

ROOT = Path(__file__).resolve().parent.parent
TABLE_1 = {"m": 1.0, "P": 10.0, "D": 1.0, "I": 10.0, "Fs": 4.0, "Fc": 2.0, "vs": 0.1, "beta": 2.0, "b": 1.0}


def at(system: System, mode: str, values: dict[str, float], s: dict[str, float] | None = None) -> list[float]:
    """The field of a mode at numbers for states and parameters; `s` are multipliers by surface name."""
    form = system.symbolic
    assert form is not None
    numbers = {q: values.get(q.name, q.parameter.default) for q in form.p}
    numbers |= {q: values[q.name] for q in form.x}
    numbers |= {form.s[system.surface_index(name)]: value for name, value in (s or {}).items()}
    return [float(f.subs(numbers)) for f in form.at_mode(mode)]


def stribeck(v: float, Fs: float = 4, Fc: float = 2, vs: float = 0.1, beta: float = 2) -> float:
    return Fc + (Fs - Fc) * math.exp(-((abs(v) / vs) ** beta))


LAWS: list[tuple[FrictionLaw, Callable[[float], float], tuple[float, float]]] = [
    (Viscous(1.5), lambda v: 1.5 * v, (0, 0)),
    (Viscous((1.5, 0.5)), lambda v: (1.5 if v > 0 else 0.5) * v, (0, 0)),
    (Coulomb(2, b=0.5), lambda v: math.copysign(2, v) + 0.5 * v, (-2, 2)),
    (Coulomb((3, 1)), lambda v: 3 if v > 0 else -1, (-1, 3)),
    (StaticCoulomb(4, 2), lambda v: math.copysign(2, v), (-4, 4)),
    (StaticCoulomb((5, 3), (2, 1), (0.1, 0.2)), lambda v: 2 + 0.1 * v if v > 0 else -1 + 0.2 * v, (-3, 5)),
    (Stribeck(), lambda v: math.copysign(stribeck(v), v) + v, (-4, 4)),
    (Stribeck(beta=0.5, vs=1e-6, b=0), lambda v: math.copysign(stribeck(v, vs=1e-6, beta=0.5), v), (-4, 4)),
    (Stribeck(beta=1.0001), lambda v: math.copysign(stribeck(v, beta=1.0001), v) + v, (-4, 4)),
    (
        Stribeck((4, 3), (2, 1), (0.1, 0.2), (2, 1)),
        lambda v: v + (stribeck(v) if v > 0 else -stribeck(v, 3, 1, 0.2, 1)),
        (-3, 4),
    ),
    (Hyperbolic(1, gamma=3), lambda v: math.copysign(1 / (1 + 3 * abs(v)), v), (-1, 1)),
    (
        Hyperbolic(2, 0.5, 4, 0.1),
        lambda v: math.copysign(0.5 + 1.5 / (1 + 4 * abs(v)) + 0.1 * v * v, v),
        (-2, 2),
    ),
]
EVERY_LAW = pytest.mark.parametrize(
    ("law", "force", "levels"), LAWS, ids=lambda q: "" if callable(q) else repr(q)[:60]
)
SPEEDS = [-3.0, -0.4, -0.1, -1e-3, -1e-9, 1e-9, 1e-3, 0.07, 0.1, 0.5, 2.0]


@EVERY_LAW
def test_curve_equals_the_closed_form(law: FrictionLaw, force: object, levels: tuple[float, float]) -> None:
    assert callable(force)
    np.testing.assert_allclose(law.curve(SPEEDS), [force(v) for v in SPEEDS], rtol=1e-14)
    assert np.isnan(law.curve([0.0])).all()
    assert law.levels() == pytest.approx(levels, rel=1e-15)


@EVERY_LAW
def test_force_is_the_curve_off_the_surface(law: FrictionLaw, force: object, levels: object) -> None:
    assert callable(force)
    system = controlled_mass(law, PD(P=7, D=0.3), m=2)
    for v in SPEEDS:
        mode = ("+" if v > 0 else "-") * len(system.surfaces)
        x_rate, v_rate = at(system, mode, {"x": 0.2, "v": v})
        assert x_rate == v
        assert v_rate == pytest.approx((-7 * (0.2 + 0.3 * v) - force(v)) / 2, rel=1e-13)


@EVERY_LAW
def test_ends_of_the_set_are_the_static_levels(
    law: FrictionLaw, force: object, levels: tuple[float, float]
) -> None:
    """At v = 0 the blend with the multipliers lo and hi is -Fs- and Fs+."""
    system = controlled_mass(law, PD(P=7, D=0.3), m=2)
    if isinstance(law, Viscous):
        assert all(surface.kind == "kink" for surface in system.surfaces)
        return
    (surface,) = system.surfaces
    assert (surface.name, surface.kind) == ("velocity", "switching")
    assert surface.wide == isinstance(law, StaticCoulomb)
    form = system.symbolic
    assert form is not None
    defaults = {q: q.parameter.default for q in form.p}
    for bound, level in zip(form.radius[0], levels, strict=True):
        multiplier = float(bound.subs(defaults))
        _, v_rate = at(system, "0", {"x": 0.2, "v": 0.0}, {"velocity": multiplier})
        assert v_rate == pytest.approx((-7 * 0.2 - level) / 2, rel=1e-13)


def test_static_friction_above_coulomb_gives_the_ratio_as_radius() -> None:
    law = StaticCoulomb(4, 2)
    p = parameters(**law.parameters())
    assert law.radius(p) == (-p.Fs / p.Fc, p.Fs / p.Fc)


def test_force_follows_other_parameter_values() -> None:
    law = Stribeck()
    values = {"Fs": 9.0, "beta": 0.1, "b": 0.0}
    assert law.curve(0.02, values) == pytest.approx(stribeck(0.02, Fs=9, beta=0.1), rel=1e-14)
    assert law.levels(values) == (-9, 9)
    with pytest.raises(ModelError, match="did you mean 'vs'"):
        law.curve(0.02, {"v_s": 1})


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Coulomb(-1), "Fc is -1.0, expected at least 0"),
        (lambda: Coulomb((1, 2, 3)), "Fc has 3 entries"),
        (lambda: Stribeck(beta=0), "beta is 0.0"),
        (lambda: Stribeck(vs=(0.1, 0)), "vs_minus is 0.0"),
        (lambda: Stribeck(Fs=math.nan), "Fs is nan"),
        (lambda: StaticCoulomb(1, 2), "expected Fs >= Fc"),
        (lambda: StaticCoulomb((3, 1), 2), "expected Fs >= Fc"),
        (lambda: PID(P=-1), "P is -1.0"),
        (lambda: controlled_mass(m=0), "m is 0.0"),
        (lambda: LuGre().system(ControlledMass(Viscous())), "no dry friction, which the LuGre model"),
        (lambda: Switch().system(ControlledMass(Viscous())), "no dry friction, which the Switch model"),
        (lambda: Karnopp().system(ControlledMass(Viscous())), "no dry friction, which the Karnopp model"),
    ],
)
def test_impossible_values_are_refused(build: Callable[[], object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        build()


# -- the controlled mass -------------------------------------------------------------------------------


def points(count: int, *names: str) -> list[dict[str, float]]:
    rng = np.random.default_rng(7)
    return [{name: float(rng.uniform(-1, 1)) for name in names} for _ in range(count)]


def effort(q: dict[str, float]) -> float:
    return 10 * (q["x"] + 1 * q["v"] + 10 * q["z"])


def slip(q: dict[str, float]) -> float:
    return -effort(q) - math.copysign(stribeck(q["v"]), q["v"]) - q["v"]


def test_hunting_has_the_parameters_of_table_1() -> None:
    system = hunting()
    assert system.states == ("x", "v", "z")
    assert dict(zip(system.parameters.names, system.parameters.defaults, strict=True)) == TABLE_1
    assert [system.parameters[name].unit for name in ("m", "P", "D", "I", "vs", "beta", "b")] == [
        "kg", "N/m", "s", "1/s", "m/s", "", "N s/m",
    ]  # fmt: skip
    assert all(system.parameters[name].description for name in system.parameters)


@pytest.mark.parametrize("q", points(10, "x", "v", "z"))
def test_hunting_equals_the_formulas(q: dict[str, float]) -> None:
    system = hunting()
    forward, backward = {**q, "v": abs(q["v"])}, {**q, "v": -abs(q["v"])}
    assert at(system, "+", forward) == pytest.approx([forward["v"], slip(forward), q["x"]], rel=1e-13)
    assert at(system, "-", backward) == pytest.approx([backward["v"], slip(backward), q["x"]], rel=1e-13)
    rest = {**q, "v": 0.0}
    multiplier = -effort(rest) / 4  # friction cancels u
    assert at(system, "0", rest, {"velocity": multiplier}) == pytest.approx([0, 0, q["x"]], abs=1e-12)


def test_controllers_share_one_form() -> None:
    q = {"x": 0.3, "v": -0.2, "z": 0.7}
    friction = 4 - 0.2 * -1
    for controller, u in ((P(5), 1.5), (PD(5, 2), 5 * (0.3 - 0.4)), (PID(5, 2, 3), 5 * (0.3 - 0.4 + 2.1))):
        system = controlled_mass(Coulomb(4, b=1), controller)
        assert system.states == (("x", "v", "z") if controller.integral else ("x", "v"))
        assert at(system, "-", q)[1] == pytest.approx(-u + friction, rel=1e-14)


def test_degenerate_conditions_are_named() -> None:
    system = hunting()
    assert degeneracies(system) == ()
    assert [q.split(":")[0] for q in degeneracies(system, {"P": 0})] == ["P = 0"]
    assert [q.split(":")[0] for q in degeneracies(system, {"I": 0, "P": 0})] == ["P = 0", "I = 0"]
    assert [q.split(":")[0] for q in degeneracies({**TABLE_1, "I": 0})] == ["I = 0"]
    assert [q.split(":")[0] for q in degeneracies(controlled_mass(Viscous(), PD()))] == ["no dry friction"]
    assert degeneracies(controlled_mass(Stribeck(Fc=(0, 1)), P())) == ()
    assert degeneracies(controlled_mass(controller=PD())) == ()


# -- the band models of the same plant -----------------------------------------------------------------


def region(v: float, u: float, width: float, up: float = 4, down: float = 4) -> str:
    """Signs of v - width, v + width, u - Fs-, u + Fs+."""
    return "".join("+" if h > 0 else "-" for h in (v - width, v + width, u - down, u + up))


@pytest.mark.parametrize("q", points(40, "x", "v", "z"))
def test_switch_equals_the_three_equations(q: dict[str, float]) -> None:
    q = {**q, "x": q["x"] * 0.3, "z": q["z"] * 0.03}
    system, u, v = Switch(eta=0.4, alpha=30).system(), effort(q), q["v"]
    assert [surface.name for surface in system.surfaces] == [
        "band upper", "band lower", "effort upper", "effort lower",
    ]  # fmt: skip
    if abs(v) > 0.4:
        expected = slip(q)
    elif abs(u) <= 4:
        expected = -30 * v
    else:
        expected = -u + math.copysign(4, u)
    assert at(system, region(v, u, 0.4), q) == pytest.approx([v, expected, q["x"]], rel=1e-12)


@pytest.mark.parametrize("q", points(40, "x", "v", "z"))
def test_karnopp_equals_its_equations(q: dict[str, float]) -> None:
    q = {**q, "x": q["x"] * 0.3, "z": q["z"] * 0.1}
    system, v = Karnopp(DV=0.4, alpha=20).system(), q["v"]
    rest = effort({**q, "v": 0.0})
    if abs(v) > 0.4:
        expected = [v, slip(q), q["x"]]
    elif abs(rest) <= 4:
        expected = [0, -20 * v, q["x"]]
    else:
        expected = [0, -rest + math.copysign(4, rest), q["x"]]
    assert at(system, region(v, rest, 0.4), q) == pytest.approx(expected, rel=1e-12)


def test_band_models_use_unequal_levels_on_their_sides() -> None:
    """m v' = -u - F with F in [-3, 5]: u > 3 breaks away backwards, u < -5 forwards."""
    plant = ControlledMass(StaticCoulomb((5, 3), (2, 1)), P(10), m=2)
    for system, stick in ((Switch(0.1, 30).system(plant), -30 * 0.05), (Karnopp(0.1, 0).system(plant), 0.0)):
        for x, expected in ((0.31, (-3.1 + 3) / 2), (-0.51, (5.1 - 5) / 2), (0.2, stick), (-0.45, stick)):
            mode = region(0.05, 10 * x, 0.1, 5, 3)
            assert at(system, mode, {"x": x, "v": 0.05})[1] == pytest.approx(expected, rel=1e-12)
        assert at(system, "++-+", {"x": 0.1, "v": 0.5})[1] == pytest.approx((-1 - 2) / 2)
        assert at(system, "---+", {"x": 0.1, "v": -0.5})[1] == pytest.approx((-1 + 1) / 2)


@pytest.mark.parametrize("width", [1e-2, 1e-8])
def test_slip_outside_a_band_is_that_of_the_inclusion(width: float) -> None:
    for beta in (0.5, 2.0):
        plant = ControlledMass(Stribeck(beta=beta))
        exact = plant.system()
        for system in (Switch(width).system(plant), Karnopp(width).system(plant)):
            for v in (-0.3, 0.3):
                q = {"x": 0.1, "v": v, "z": 0.01}
                mode = "++" if v > 0 else "--"
                assert at(system, mode + "--", q) == pytest.approx(at(exact, mode[0], q), rel=1e-9)


def test_lugre_slides_steadily_with_the_force_of_the_law() -> None:
    """With w = sgn(v) g(v)/sigma0 the bristles rest, w' = 0, and the friction is g sgn(v) + b v."""
    system = LuGre(1e4, 100).system()
    assert system.states == ("x", "v", "z", "w")
    for v in (-0.2, -0.03, 0.05, 1.0):
        q = {"x": 0.1, "v": v, "z": 0.02, "w": math.copysign(stribeck(v), v) / 1e4}
        mode = "+" if v > 0 else "-"
        assert at(system, mode, q) == pytest.approx([v, slip(q), 0.1, 0], rel=1e-12, abs=1e-12)


# -- other models --------------------------------------------------------------------------------------


def test_other_models_equal_their_formulas() -> None:
    for v, mode, sign in ((0.5, "+", 1), (-0.1, "-", -1)):
        q = {"x": 0.3, "v": v}
        force = sign / (1 + 3 * abs(v - 0.2))
        assert at(models.get("belt").build(), mode, q) == pytest.approx([v, -0.3 - force])
    q = {"q": 0.7, "w": -0.2}
    assert at(models.get("pendulum").build(), "-", q) == pytest.approx([-0.2, -9.81 * math.sin(0.7) + 0.5])
    q = {"x1": 0.2, "x2": 0.3, "x3": -0.4}
    aperiodic = [
        -(2 * -0.07 * 10 + 0.05) * 0.2 + 0.3 - 1,
        -(2 * -0.07 * 0.5 + 100) * 0.2 - 0.4 + 2,
        -0.05 * 100 * 0.2 - 1,
    ]
    assert at(models.get("relay_aperiodic").build(), "+", q) == pytest.approx(aperiodic)
    q = {"R1": 1.2, "R2": 0.8, "C": 0.9}
    predator = models.get("switching_predator").build()
    assert at(predator, "+", q) == pytest.approx([1.8 - 1.08, 0.4, 0.9 * (0.24 - 0.1)])
    assert at(predator, "-", q) == pytest.approx([1.8, 0.4 - 0.72, 0.9 * (0.08 - 0.1)])
    q = {"x1": 9.0, "x2": 3.0}
    gene = models.get("two_gene").build()
    assert at(gene, "+---", q) == pytest.approx([-4.5 * 9, -1.5 * 3 + 40])
    assert at(gene, "+-+-", q) == pytest.approx([-4.5 * 9 + 40, -1.5 * 3 + 40])
    room = models.get("thermostat").build()
    assert at(room, "-", {"T": 15.0}) == pytest.approx([2.3])
    assert at(room, "+", {"T": 23.0}) == pytest.approx([-0.5])
    assert room.surfaces[0].width == 0.75
    q = {"y": 5.0, "i": 1.0}
    assert at(models.get("buck").build(), "-", q) == pytest.approx([5000, 15000])
    q = {"x1": 0.1, "v1": 0.0, "x2": 0.4, "v2": 0.5}
    blocks = [0, -0.1 + 1.2 * 0.3 + 1 / 1.6, 0.5, -0.4 - 1.2 * 0.3 - 1.3 / 1.9]
    assert at(models.get("two_blocks").build(), "-+", q) == pytest.approx(blocks)


# -- the registry --------------------------------------------------------------------------------------


def test_names_do_not_import_the_models() -> None:
    code = (
        "import sys, filippov.models as m; assert 'hunting' in m.names();"
        "assert not {'sympy', 'numpy', 'filippov.model.system'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_built_in_table_is_what_the_modules_register() -> None:
    for name, module in registry.BUILT_IN.items():
        model = models.get(name)
        assert model.name == name
        assert (ROOT / "models" / f"{module.replace('.', '/')}.py").is_file()
        assert model.description.endswith(".")
        assert model.source


def test_unknown_name_is_refused_with_a_suggestion() -> None:
    with pytest.raises(UsageError, match="unknown model 'huntign'; did you mean 'hunting'"):
        models.get("huntign")


def test_a_taken_name_is_refused() -> None:
    mine = Model("hunting", hunting, (0.0,) * 3, (0.0, 1.0), "Mine.", "here")
    with pytest.raises(ModelError, match="'hunting' is registered already"):
        models.register(mine)
    assert models.register(models.get("hunting")) is models.get("hunting")


PLUG_INS = {
    "good_module": """
        from filippov import System, states, sign
        from filippov.models import Model
        def relay():
            'A relay of one state.'
            (x,) = states("x")
            return System({x: -sign(x)})
        model = Model("other", relay, (1.0,), (0.0, 2.0), "A relay.", "here")
        number = 3
        """,
    "bad_import": "import a_module_that_nobody_has",
    "bad_exit": "raise SystemExit(3)",
}
ENTRIES = """
[filippov.models]
good = good_module:relay
ready = good_module:model
missing = bad_import:relay
leaving = bad_exit:relay
absent = good_module:nothing
number = good_module:number
hunting = good_module:relay
"""


def test_a_broken_plug_in_does_not_hide_the_others(tmp_path: Path) -> None:
    for name, text in PLUG_INS.items():
        lines = [line[8:] if line.startswith(" " * 8) else line for line in text.strip("\n").splitlines()]
        (tmp_path / f"{name}.py").write_text("\n".join(lines), encoding="utf-8")
    info = tmp_path / "plugs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugs\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(ENTRIES, encoding="utf-8")
    code = f"""
import sys
sys.path.insert(0, {str(tmp_path)!r})
from filippov import ModelError, models
assert {{"good", "ready", "missing", "hunting"}} <= set(models.names())
assert "good_module" not in sys.modules
assert models.get("good").build().states == ("x",)
assert models.get("good").description == "A relay of one state."
assert models.get("good").x0 == (0.0,)
assert models.get("ready").name == "ready" and models.get("ready").x0 == (1.0,)
assert models.get("hunting").build().dimension == 3
try:
    models.get("missing")
except ModelError as error:
    assert "a_module_that_nobody_has" in str(error) and "missing" in str(error)
else:
    raise AssertionError
broken = models.broken()
assert set(broken) == {{"missing", "leaving", "absent", "number", "hunting (good_module:relay)"}}, broken
assert "Traceback" in broken["missing"] and "ModuleNotFoundError" in broken["missing"]
assert "SystemExit" in broken["leaving"]
assert "missing" not in models.names() and "good" in models.names()
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", models.registry.BUILT_IN)
def test_every_axis_has_a_label_with_its_unit(name: str) -> None:
    """Time has a unit wherever a parameter has one with a time in it."""
    system = models.get(name).build()
    assert set(system.labels) >= {"t", *system.states, *system.outputs}
    units = " ".join(system.parameters[q].unit for q in system.parameters.names)
    timed = re.search(r"\b(s|ms|h|Hz|V|N)\b", units)
    assert ("[" in system.labels["t"]) == bool(timed), units
