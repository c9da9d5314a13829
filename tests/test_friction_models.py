"""Friction models mapped from one law: steady curves, stiffnesses, orders against the exact motion."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.optimize import brentq

from filippov import ModelError, Parameter, Surface, System, exp, parameters, sign, sin, solve, states, t
from filippov.analysis import compare
from filippov.model.bristles import MODELS, plastic
from filippov.model.friction_model import with_friction_model
from filippov.models import Coulomb, Hyperbolic, StaticCoulomb, Stribeck, friction_models
from filippov.models.belt import belt
from filippov.models.pendulum import pendulum

LAW = Stribeck(Fs=0.6, Fc=0.4, vs=0.1, beta=2, b=0.05)
WIDTH, M, L, G = 1e-4, 1.0, 1.0, 9.81
SYSTEMS = friction_models(LAW, pendulum, WIDTH)


def moment(v: float) -> float:
    return (0.4 + 0.2 * math.exp(-((v / 0.1) ** 2))) * math.copysign(1, v) + 0.05 * v


def rates(system: System, at: dict[str, float]) -> list[float]:
    form = system.symbolic
    assert form is not None
    known: dict[Any, Any] = {q: q.parameter.default for q in form.p}
    known |= {q: at.get(q.name, 0.0) for q in form.x}
    for s, a, h in zip(form.s, form.a, form.h, strict=True):
        value = float(h.subs(known))
        known[s], known[a] = (1 if value > 0 else -1), abs(value)
    return [float(f.subs(known)) for f in form.field]


def test_15_2_one_plant_stands_under_all_of_them() -> None:
    assert set(SYSTEMS) == {"exact", "tanh", *MODELS}
    for system in SYSTEMS.values():
        assert system.states[:2] == ("q", "w")


@pytest.mark.parametrize("v", [-0.7, -0.05, 0.02, 0.3])
def test_15_2_sliding_steadily_each_has_the_curve_of_the_law(v: float) -> None:
    """The deflection rests at w g sgn v (dahl: w sgn v, its level follows the law), the lag at v."""
    g = (0.4 + 0.2 * math.exp(-((v / 0.1) ** 2))) / 0.6
    at = {"dahl": math.copysign(WIDTH, v), "lugre": math.copysign(WIDTH * g, v), "memory": v}
    for name, z in (at | {"elasto-plastic": at["lugre"]}).items():
        system = SYSTEMS[name]
        found = rates(system, {"q": 0.0, "w": v, system.states[2]: z})
        assert found[1] == pytest.approx(-moment(v), rel=1e-12)
        assert found[2] == pytest.approx(0.0, abs=1e-12)
    slips = SYSTEMS["maxwell-slip"].states[2:]
    at = dict(zip(slips, [math.copysign(g / 3, v)] * 3 + [math.copysign(1, v)] * 3, strict=True))
    found = rates(SYSTEMS["maxwell-slip"], {"q": 0.0, "w": v, **at})
    assert found[1] == pytest.approx(-moment(v), rel=1e-12)
    assert found[2:] == pytest.approx([0.0] * 6, abs=1e-12)
    at = dict(zip(SYSTEMS["seven-parameter"].states[2:], [0, math.copysign(1, v), v, 0, 1], strict=True))
    found = rates(SYSTEMS["seven-parameter"], {"q": 0.0, "w": v, **at})
    assert found[1] == pytest.approx(-moment(v), rel=1e-12)
    assert found[2:] == pytest.approx([0.0] * 5, abs=1e-12)
    found = rates(SYSTEMS["bengisu-akay"], {"q": 0.0, "w": v})
    beyond = math.copysign(abs(v) - WIDTH, v)
    assert found[1] == pytest.approx(-moment(beyond) - 0.05 * (v - beyond), rel=1e-12)


def test_15_2_at_rest_a_deflection_is_held_by_the_stiffness() -> None:
    """sigma0 = Fs/w, as a moment over the deflection; w = 0 and w' of the pendulum is that over m l^2."""
    for name in ("dahl", "lugre", "elasto-plastic", "seven-parameter"):
        z = 0.3 if name == "seven-parameter" else 0.3 * WIDTH
        found = rates(SYSTEMS[name], {"q": 0.0, "w": 0.0, SYSTEMS[name].states[2]: z})
        assert found[1] == pytest.approx(-0.6 * 0.3, rel=1e-12)
    # The parabola of Bengisu and Akay rises with the slope 2 Fs/w.
    small = 1e-9
    found = rates(SYSTEMS["bengisu-akay"], {"w": small})
    assert found[1] == pytest.approx(-2 * 0.6 / WIDTH * small, rel=1e-5)


def test_15_2_the_damping_of_lugre_is_the_published_one() -> None:
    """sigma1 = sqrt(sigma0 m) by default: at rest z' = v adds sigma1 v, here per m l^2 = 1."""
    v = 1e-12
    found = rates(SYSTEMS["lugre"], {"w": v})[1]
    assert found == pytest.approx(-(math.sqrt(0.6 / WIDTH) + 0.05) * v, rel=1e-5)


x, v_ = states("x v")
BLOCK = System({x: v_, v_: -x - parameters(mu=0.2).mu * sign(v_)}, surfaces=[Surface("slip", v_)])


def test_15_2_they_go_to_the_exact_motion() -> None:
    """Bristles are a spring of the stiffness mu/w: of order 1/2, its period; the parabola is of order 1."""
    names = ["lugre", "elasto-plastic", "maxwell-slip", "seven-parameter", "bengisu-akay"]
    found = compare(BLOCK, (0.7, 0), (0, 5), against=names, widths=(1e-3, 1e-4, 1e-5))
    for name in names[:4]:
        assert found.trend(name, "error_state").order == pytest.approx(0.5, abs=0.15), name
    assert found.trend("bengisu-akay", "error_state").order == pytest.approx(1.0, abs=0.1)
    assert {tuple(row["entries"]) for row in found.of("lugre")} == {(None,)}
    assert not any("stick" in fault for fault in found.faults)


@pytest.mark.parametrize("law", [Hyperbolic(Fs=1, gamma=3), Hyperbolic(Fs=(1, 2), Fc=0.5, eta=0.1)])
@pytest.mark.parametrize("plant", [pendulum, belt])
def test_15_2_a_curve_that_rises_with_the_square_of_the_velocity_has_them(law: Any, plant: Any) -> None:
    """sympy writes |v|^2 as v^2: the static level, and with it tau, is that of v = 0 all the same."""
    exact = plant(law)
    damped = with_friction_model(exact, "lugre", WIDTH)
    at = {"v": 1.0} if plant is belt else {}  # the belt moves at 1
    one = with_friction_model(exact, "lugre", WIDTH, tau=math.sqrt(WIDTH / (1.5 if law.eta else 1.0)))
    assert rates(damped, at) == pytest.approx(rates(one, at), rel=1e-12)


# The velocity of h moves by itself: its friction is of no account. A deflection of 2 w back and forth.
MU, W = 1e-13, 1e-3
SHAKEN = System({x: v_, v_: -x - parameters(mu=MU).mu * sign(v_)}, surfaces=[Surface("slip", v_)])


VS = 0.6 * W
AGED_LAW = parameters(Fs=2 * MU, Fc=MU, vs=VS)
AGED_TIMES = parameters(lag=Parameter(1.0, lower=1e-6), dwell=Parameter(1.0, lower=1e-6))
LEVEL = AGED_LAW.Fc + (AGED_LAW.Fs - AGED_LAW.Fc) * exp(-((abs(v_) / AGED_LAW.vs) ** 2))
AGED = System({x: v_, v_: -x - LEVEL * sign(v_)}, surfaces=[Surface("slip", v_)])


def test_15_2_elements_of_maxwell_slip_are_those_of_an_elastic_plastic_chain() -> None:
    """z_i = clip(z_i + dx/(i w), -1/3, 1/3) from one turning point to the next, under Coulomb's law."""
    system = with_friction_model(SHAKEN, "maxwell-slip", W)
    run = solve(system, [0.8 * W] + [0] * 7, (0, 9))
    assert run.success, run.message
    z = np.zeros(3)
    for (_, before), (after, at) in itertools.pairwise([(0.0, 0.8 * W)] + [
        (k * math.pi, 0.8 * W * (-1) ** k) for k in (1, 2)
    ]):  # fmt: skip
        z = np.clip(z + (at - before) / (W * np.arange(1, 4)), -1 / 3, 1 / 3)
        assert run.sol(after)[2:5] == pytest.approx(z, abs=1e-8)


@pytest.mark.parametrize(("lag", "dwell"), [(0.3, 0.4), (0.05, 1.0), (2.0, 0.1)])
def test_15_2_the_seven_parameter_model_breaks_away_at_the_level_of_its_dwell_time(
    lag: float, dwell: float
) -> None:
    """x = a cos t by itself: spring, level and lagged velocity are closed forms from each turning point on.

    In stick z = z0 +- a (1 - cos T)/w, which breaks at G + S0 + (1 - G - S0) T/(T + dwell); the next stop
    begins at G + S exp(-(l/vs)^2), G + S the level at which it broke away, l the velocity lagged since.
    """
    a, share, values, q = 1.3 * W, 0.5, {"lag": lag, "dwell": dwell}, AGED_TIMES
    system = with_friction_model(AGED, "seven-parameter", W, tau=W, lag=q.lag, dwell=q.dwell)
    run = solve(system, [a] + [0] * 6, (0, 9), parameters=values, rtol=1e-11, atol=1e-14)
    assert run.success, run.message

    def steady(at: float) -> float:
        return -a / (1 + lag**2) * (math.sin(at) - lag * math.cos(at))

    z, missing = 0.0, 0.0
    for n, found in enumerate(run.events.of("slip:breaks").t):
        way = -((-1) ** n)

        def over(T: float, z: float = z, missing: float = missing, way: int = way) -> float:
            return way * z + a / W * (1 - math.cos(T)) - (1 - missing * dwell / (T + dwell))

        T = brentq(over, 1e-3, math.pi)
        assert found == pytest.approx(n * math.pi + T, abs=1e-9)
        stop = (n + 1) * math.pi
        lagged = steady(stop) - steady(found) * math.exp(-(stop - found) / lag)
        left = (1 - missing * dwell / (T + dwell) - share) * math.exp(-((lagged / VS) ** 2))
        z, missing = way * (share + left), 1 - share - left
        if stop < 9:
            at = run.sol(stop + 1e-9)
            assert [at[2], at[3], at[5]] == pytest.approx([z, 0, missing], abs=1e-8)
    assert n == 2


def test_15_2_below_its_level_the_elasto_plastic_deflection_does_not_creep() -> None:
    """A load of 0.4 mu that swings by 0.2 mu: x moves with the deflection alone; LuGre creeps."""
    load = 0.2 * (0.4 + 0.2 * sin(3 * t))
    block = System({x: v_, v_: load - parameters(mu=0.2).mu * sign(v_)}, surfaces=[Surface("slip", v_)])
    crept = {}
    for name in ("elasto-plastic", "lugre"):
        system = with_friction_model(block, name, W)
        run = solve(system, [0, 0, 0.4 * W], (0, 30), method="Radau")
        assert run.success, run.message
        crept[name] = abs((run.x_end[0] - run.x_end[2]) / W + 0.4)
    assert crept["elasto-plastic"] < 1e-9
    assert crept["lugre"] > 0.1


def test_15_2_plastic_flow_begins_and_is_complete_where_the_published_one_does() -> None:
    """0 up to z_ba = 0.7 z_max, 1 from z_max on, half-way between, and nowhere falling."""
    values = [float(plastic(sympy.Float(r))) for r in (-1, 0, 0.7, 0.85, 1, 1.2)]
    assert values == pytest.approx([0, 0, 0, 0.5, 1, 1], abs=1e-16)
    between = [float(plastic(sympy.Float(r))) for r in np.linspace(0.7, 1, 31)]
    assert between == sorted(between)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: friction_models(StaticCoulomb(2, 1), pendulum), "wider than the hull"),
        (lambda: with_friction_model(BLOCK, "dall", 1e-3), "did you mean 'dahl'"),
        (lambda: with_friction_model(BLOCK, "dahl", 0), "a number > 0"),
        (lambda: with_friction_model(BLOCK, "dahl", 1e-3, surface="x"), "unknown surface 'x'"),
        (
            lambda: with_friction_model(System({x: sign(x) + v_, v_: -sign(v_ + 1)}), "dahl", 1),
            "say surface=",
        ),
        (lambda: with_friction_model(System({x: v_, v_: -x}), "dahl", 1), "no switching surface"),
        (lambda: with_friction_model(BLOCK, "lugre", 1e-3, dwell=1), "times of seven-parameter"),
        (lambda: with_friction_model(BLOCK, "seven-parameter", 1e-3, lag=-1), "lag is -1"),
    ],
)
def test_15_2_what_does_not_fit_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        make()


def test_15_2_coulomb_friction_has_them_too() -> None:
    assert friction_models(Coulomb(Fc=1), pendulum)["dahl"].states == ("q", "w", "pivot_d1")


def test_15_2_a_plant_whose_outputs_have_labels_stands_under_all_of_them() -> None:
    q, w = states("q w")
    friction = 0.2 * sign(w)
    labels = {"t": "time [s]", "q": "position [m]", "friction": "friction [N]"}
    plant = System({q: w, w: -q - friction}, outputs={"friction": friction}, labels=labels)
    for model in MODELS:
        made = with_friction_model(plant, model, 1e-3)
        assert {name: made.labels[name] for name in ("t", "q")} == {"t": "time [s]", "q": "position [m]"}
