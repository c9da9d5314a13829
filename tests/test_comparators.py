"""Comparators for each surface: Switch and Karnopp of any sliding surface, shapes, widths as parameters."""

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp

from filippov import (
    Band,
    EventKind,
    Exact,
    Hysteresis,
    Karnopp,
    ModelError,
    Parameter,
    Smooth,
    Surface,
    Switch,
    System,
    parameters,
    sign,
    solve,
    states,
    t,
)  # fmt: skip
from filippov.io.stored_system import system_data, system_of
from filippov.models import get, hunting
from filippov.models.mass import REFERENCE
from filippov.models.switch import hunting_switch

x, v, y, w = states("x v y w")
ETA, ALPHA, DT = 0.3, 7.0, 1e-9
p = parameters(m=2, k=3, c=0.5, F=1.2, S=1.7, vb=0.4)
G = p.F / (1 + abs(v - p.vb))
# A block on a belt whose speed changes, with a static level above the curve; a loop of the first order with
# a moving surface that acts on a second state as well; two blocks that friction holds to the ground.
BELT = System(
    {x: v, v: (-p.k * x - p.c * v - G * sign(v - p.vb)) / p.m},
    surfaces=[Surface("belt", v - p.vb, radius=p.S / p.F)],
)
LOOP = System({x: y - 2 * sign(x - sp.cos(t) / 2), y: -x * y - sign(x - sp.cos(t) / 2) / 3 + abs(y)})
PAIR = System(
    {x: v, v: -3 * x + y - sign(v), y: w, w: x - 2 * y - abs(w) * v * 0.1 - 1.5 * sign(w)},
    surfaces=[Surface("first", v), Surface("second", w)],
)
# The state that h holds with the slope 1, by surface.
REST = {id(BELT): "v", id(LOOP): "x", id(PAIR): "vw"}


def plain_field(system: System, at: dict[str, float], signs: list[float], sizes: list[float]) -> list[float]:
    """f(t, x, s, a) of the exact system, by numbers only."""
    form = system.symbolic
    assert form is not None
    known: dict[Any, Any] = {q: q.parameter.default for q in form.p}
    known |= {q: at[q.name] for q in form.x} | {t: at["t"]}
    known |= dict(zip(form.s, signs, strict=True)) | dict(zip(form.a, sizes, strict=True))
    return [float(f.subs(known)) for f in form.field]


def height(system: System, i: int, at: dict[str, float]) -> float:
    form = system.symbolic
    assert form is not None
    known: dict[Any, Any] = {q: q.parameter.default for q in form.p}
    return float(form.h[i].subs(known | {q: at[q.name] for q in form.x} | {t: at["t"]}))


def rate(system: System, i: int, at: dict[str, float], f: list[float]) -> float:
    """dh/dt by a central difference along the field (h is linear in x here)."""
    def moved(dt: float) -> float:
        there = {name: at[name] + dt * q for name, q in zip(system.states, f, strict=True)}
        return height(system, i, there | {"t": at["t"] + dt})

    return (moved(1e-6) - moved(-1e-6)) / 2e-6


def banded(
    system: System, i: int, at: dict[str, float], levels: tuple[float, float], seen: Any
) -> list[float]:
    """The field of the band models by their definition; seen(at): where Karnopp's model is taken."""
    count = len(system.surfaces)
    heights = [height(system, j, at) for j in range(count)]
    signs, sizes = [math.copysign(1, h) for h in heights], [abs(h) for h in heights]

    def field(s: float, size: float, where: dict[str, float]) -> list[float]:
        return plain_field(
            system, where, [s if j == i else q for j, q in enumerate(signs)],
            [size if j == i else q for j, q in enumerate(sizes)],
        )  # fmt: skip

    h = heights[i]
    if abs(h) > ETA:
        return field(signs[i], abs(h), at)
    own = REST[id(system)][i]
    where, rest = seen(at), at | {own: at[own] - h}  # h has the slope 1 in each of these
    low, high = (rate(system, i, rest, field(s, 0.0, rest)) for s in levels)
    if low < 0 and high < 0:
        return field(levels[0], 0.0, where)
    if low > 0 and high > 0:
        return field(levels[1], 0.0, where)
    assert low >= 0 >= high
    low, high = (rate(system, i, where, field(s, 0.0, where)) for s in levels)
    s = levels[0] + (levels[1] - levels[0]) * (low + ALPHA * h) / (low - high)  # L(s) = -alpha h, L affine
    return field(s, 0.0, where)


def value(system: System, at: dict[str, float]) -> list[float]:
    """The field of a system at a state, its signs those of its own h."""
    form = system.symbolic
    assert form is not None
    known: dict[Any, Any] = {q: q.parameter.default for q in form.p}
    known |= {q: at[q.name] for q in form.x} | {t: at["t"]}
    for s, a, h in zip(form.s, form.a, form.h, strict=True):
        number = float(h.subs(known))
        known[s], known[a] = (1 if number > 0 else -1), abs(number)
    return [float(f.subs(known)) for f in form.field]


@pytest.mark.parametrize(
    ("system", "i", "levels", "seen"),
    [
        (BELT, 0, (-1.7 / 1.2, 1.7 / 1.2), None),
        (BELT, 0, (-1.7 / 1.2, 1.7 / 1.2), lambda at: at | {"v": 0.4}),
        (LOOP, 0, (-1.0, 1.0), None),
        (PAIR, 0, (-1.0, 1.0), None),
        (PAIR, 1, (-1.0, 1.0), lambda at: at | {"w": 0.0}),
    ],
    ids=["switch-belt", "karnopp-belt", "switch-loop", "switch-pair", "karnopp-pair"],
)
def test_15_1_a_stick_band_is_its_definition(system: System, i: int, levels: Any, seen: Any) -> None:
    own = Switch(ETA, ALPHA) if seen is None else Karnopp(ETA, ALPHA)
    made = system.with_comparator({system.surfaces[i].name: own})
    rng = np.random.default_rng(15)
    regions = set()
    for _ in range(30):
        at = dict(zip(system.states, rng.uniform(-0.9, 0.9, len(system.states)).tolist(), strict=True))
        at["t"] = float(rng.uniform(0, 3))
        expected = banded(system, i, at, levels, seen or (lambda q: q))
        got = value(made, at)
        if seen is not None and abs(height(system, i, at)) <= ETA:
            # The hidden state has dh/dt of the model, or relaxes: compared with L and -alpha h.
            k = system.state_index({"belt": "v", "second": "w"}[system.surfaces[i].name])
            h = height(system, i, at)
            balance = [plain_field(system, seen(at), *q)[k] for q in _ends(system, i, at, levels)]
            if balance[0] >= 0 >= balance[1]:
                expected[k] = -ALPHA * h
        assert got == pytest.approx(expected, rel=1e-7, abs=1e-7)
        regions.add(abs(height(system, i, at)) <= ETA)
    assert regions == {True, False}


def _ends(system: System, i: int, at: dict[str, float], levels: tuple[float, float]) -> list[Any]:
    heights = [height(system, j, at) for j in range(len(system.surfaces))]
    out = []
    for s in levels:
        signs, sizes = [math.copysign(1, h) for h in heights], [abs(h) for h in heights]
        signs[i], sizes[i] = s, 0.0
        out.append((signs, sizes))
    return out


def test_15_1_a_block_that_stops_beside_its_static_level_does_not_slide_on_it() -> None:
    """k x is near Fs at the stop: with the damping c v in the balance the level was slid on forever."""
    q = parameters(k=2.368654505549652, c=0.2122632580155881, Fs=0.7135446509397123, Fc=0.1087, vs=0.1159)
    level = q.Fc + (q.Fs - q.Fc) * sp.exp(-abs(v) / q.vs)
    block = System({x: v, v: -q.k * x - q.c * v - level * sign(v)}, surfaces=[Surface("slip", v)])
    for eta in (0.1, 0.01):
        run = solve(block.with_comparator(Switch(eta)), (-0.4966861754680514, 0.07218472547425137), (0, 25))
        assert run.success, run.message
        assert run.nfev < 20_000
        assert not any(event.kind is EventKind.ENTRY for event in run.events)


def test_15_1_where_a_surface_repels_the_sign_is_that_of_h() -> None:
    away = System({x: sign(x) + y / 4, y: -y}).with_comparator(Switch(0.1, 5))
    for h, s in ((0.05, 0.5), (-0.02, -0.2), (0.3, 1), (-0.3, -1)):
        assert value(away, {"x": h, "y": 0.4, "t": 0.0})[0] == pytest.approx(s + 0.1)


def test_15_1_comparators_are_chosen_for_each_surface() -> None:
    made = PAIR.with_comparator({"second": Smooth(0.1, "sqrt"), "first": Switch(0.1)})
    assert [q.name for q in made.surfaces if q.kind == "switching"] == [
        "first:upper", "first:lower", "first:down", "first:up",
    ]  # fmt: skip
    assert repr(made.comparator).startswith("PerSurface")
    assert made.exact is PAIR
    assert PAIR.with_comparator({"first": Exact()}) is PAIR
    assert PAIR.with_comparator({"first": Band(0.1), "second": Band(0.1)}) == PAIR.with_comparator(Band(0.1))
    assert PAIR.with_comparator({"w": Hysteresis(0.1)}).surfaces[-1].width == 0.1
    stored = system_of(system_data(made))
    assert stored == made
    assert stored.digest != PAIR.with_comparator({"first": Switch(0.1)}).digest


@pytest.mark.parametrize(
    ("shape", "formula"),
    [
        ("tanh", math.tanh), ("arctan", lambda q: 2 / math.pi * math.atan(math.pi * q / 2)),
        ("sqrt", lambda q: q / math.sqrt(1 + q * q)),
    ],
)  # fmt: skip
def test_15_1_shapes_of_the_smooth_sign(shape: str, formula: Any) -> None:
    width = parameters(eps=Parameter(0.2, lower=1e-12)).eps
    systems = [LOOP.with_comparator(Smooth(q, shape)) for q in (0.2, width)]
    plain = System(
        field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("h", lambda t, x, p: x[0])], states="x"
    ).with_comparator(Smooth(0.2, shape))
    for h in (-0.7, -0.01, 0.0, 0.3):
        s = formula(h / 0.2)
        at = {"x": 0.5 + h, "y": -0.2, "t": 0.0}
        for system in systems:
            assert value(system, at)[0] == pytest.approx(-0.2 - 2 * s, abs=1e-14)
        assert plain.field is not None
        assert plain.field(0.0, np.array([h]), None, np.zeros(0))[0] == pytest.approx(-s, abs=1e-15)
    assert systems[1].parameters.names == ("eps",)


WIDTH = parameters(eta=Parameter(1e-3, lower=1e-12), alpha=Parameter(100, lower=0))


@pytest.mark.parametrize("kind", [Switch, Karnopp])
def test_15_1_a_pendulum_under_a_stick_band_goes_to_the_exact_one(kind: Any) -> None:
    """The Switch model creeps by eta/alpha in its last stick, Karnopp's not at all.

    Karnopp's pendulum turns with w = +-DV in place of 0, the same kinetic energy at each turn: its
    turning points obey g (cos b - cos a) = M |b - a| as those of the exact one do, for every DV.
    """
    exact = get("pendulum").build()
    made = exact.with_comparator(kind(WIDTH.eta, WIDTH.alpha))
    rest = solve(exact, (1, 0), (0, 12), rtol=1e-11).x_end[0]
    errors = []
    for eta in (1e-3, 1e-5, 1e-7):
        run = solve(made, (1, 0), (0, 12), parameters={"eta": eta}, rtol=1e-11)
        assert run.success
        assert run.sol is not None
        errors.append(abs(run.x_end[0] - rest))
        drift = abs(run.x_end[0] - run.sol(run.segments[-1].t0)[0])
        assert drift == pytest.approx(eta / 100 if kind is Switch else 0.0, rel=1e-3, abs=1e-15)
    orders = -np.diff(np.log10(errors)) / 2
    assert max(errors) < 1e-10 if kind is Karnopp else np.all(orders > 0.9), errors
    assert errors[-1] < 1e-6


def test_15_1_the_model_of_the_hunting_loop_is_the_comparator_of_its_inclusion() -> None:
    """The published model has no viscous part within the band: with b = 0 both are one."""
    built = get("hunting_switch").build()
    made = hunting().with_comparator(Switch(1e-8, 100, "in motion"))
    zero = {"b": 0.0}
    ends = [solve(q, (0.1, 0, 0), (0, 5), parameters=zero).x_end for q in (built, made)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)
    ends = [solve(q, (0.1, 0, 0), (0, 5)).x_end for q in (built, made)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-7)


COUPLED = System({x: v, v: -x - sign(v) - sign(v - w), y: w, w: -y + sign(v - w)})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LOOP.with_comparator(Karnopp(0.1)), "acts on other equations"),
        (lambda: System({x: -sign(x)}).with_comparator(Karnopp(0.1)), "no velocity"),
        (lambda: COUPLED.with_comparator({"v - w": Karnopp(0.1)}), "dh/dt depends on the sign of"),
        (lambda: COUPLED.with_comparator({"v": Switch(0.1)}), "dh/dt depends on the sign of"),
        (lambda: System({x: y, y: -sign(x)}).with_comparator(Switch(0.1)), "does not depend on its sign"),
        (lambda: PAIR.with_comparator({"third": Band(1)}), "unknown surface 'third'"),
        (lambda: PAIR.with_comparator({"first": 1}), "comparator is 1"),
        (lambda: PAIR.with_comparator({}), "empty mapping"),
        (lambda: LOOP.with_comparator({"y": Band(1)}), "does not switch the field"),
        (lambda: LOOP.with_comparator(Band(parameters(w=1).w)), "their bounds keep positive"),
        (lambda: BELT.with_comparator(Band(parameters(k=Parameter(1, lower=1)).k)), "another one than that"),
        (lambda: Smooth(0.1, "tan"), "did you mean 'tanh'"),
        (lambda: Switch(0.1, -1), "a rate >= 0"),
        (lambda: Switch(0.1, 1, "rest"), "did you mean 'at rest'"),
        (lambda: Switch(0), "a number > 0"),
        (
            lambda: System(
                field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("h", lambda t, x, p: x[0])], states="x"
            ).with_comparator(Switch(0.1)),
            "takes dh/dt apart",
        ),
    ],
)
def test_15_1_what_no_comparator_can_stand_for_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        make()


def _leine(state: Any, eta: float, alpha: float, in_motion: bool) -> Any:
    """The Switch model of the reference system (reference table 1), as its three equations are printed."""
    x, v, z = state
    u = 10 * (x + v + 10 * z)
    if abs(v) > eta:
        return np.array([v, -u - math.copysign(2 + 2 * math.exp(-((v / 0.1) ** 2)), v) - v, x])
    tested = u if in_motion else u - 10 * v
    return np.array([v, -alpha * v if abs(tested) <= 4 else -u + math.copysign(4, tested), x])


@pytest.mark.parametrize("in_motion", [True, False])
def test_15_1_the_switch_model_tests_its_levels_as_it_is_asked_to(in_motion: bool) -> None:
    """Against fixed steps of 5e-5; the two balances are 8 % apart in what they return."""
    eta, d, step = 0.01, 0.005, 5e-5
    state = np.array([d, 0.0, (0.4 - d) / 10])
    for _ in range(round(0.6 / step)):
        k1 = _leine(state, eta, 100.0, in_motion)
        k2 = _leine(state + step / 2 * k1, eta, 100.0, in_motion)
        state = state + step * _leine(state + step / 2 * k2, eta, 100.0, in_motion)
    model = hunting_switch(eta) if in_motion else REFERENCE.band_system(Switch(eta))
    run = solve(model, (d, 0, (0.4 - d) / 10), (0, 0.6))
    assert run.success
    np.testing.assert_allclose(run.x_end, state, rtol=0, atol=2e-5)
