"""The study of the hunting loop: the figures and tables of the reference paper, computed from the inclusion.

Source: R.H.A. Hensen, M.J.G. van de Molengraft, "Friction Induced Hunting Limit Cycles: An Event Mapping
Approach", American Control Conference 2002. Beyond it: cycles, borders, tuning, data, LuGre.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filippov.base.arrays import Array
from filippov.model.system import System
from filippov.models.driven import driven_mass
from filippov.models.karnopp import hunting_karnopp
from filippov.models.laws import Stribeck
from filippov.models.lugre import hunting_lugre
from filippov.models.mass import REFERENCE_LAW, SOURCE
from filippov.models.static_cycle import coulomb_ratio, static_cycles
from filippov.models.studies import (
    ConstitutiveCurve,
    Experiment,
    Law,
    Relative,
    Stated,
    StatedPoint,
    Study,
    StudyCase,
    Variant,
    read_rows,
    read_texts,
    register_study,
)
from filippov.models.switch import hunting_switch

FASTEST = 0.5
SLIP = ("m", "P", "D", "I", "b")


def stribeck_curve(values: Mapping[str, float]) -> ConstitutiveCurve:
    """The dry part g(|v|) sign(v) of the friction force [N] over v [m/s], and its set at v = 0."""
    given = {**{k: p.default for k, p in REFERENCE_LAW.parameters().items()}, **values, "b": 0.0}
    law = Stribeck(**{name: given[name] for name in REFERENCE_LAW.parameters()})
    side = np.concatenate([np.geomspace(1e-7, 0.02, 240), np.linspace(0.02, FASTEST, 240)[1:]])
    v = np.concatenate([-side[::-1], [0.0], side])
    return ConstitutiveCurve(v, law.curve(v), (0.0, *law.levels()))


def friction_curve(v: Array, values: Mapping[str, float]) -> Array:
    """F(v) [N] of the Stribeck law off v = 0."""
    known = Stribeck().parameters()
    return Stribeck(**{name: values[name] for name in known if name in values}).curve(v)


def applied_force(states: Array, values: Mapping[str, float]) -> Array:
    """-u = -P (x + D v + I z) [N] of states (3, k)."""
    x, v, z = states
    return np.asarray(-values["P"] * (x + values["D"] * v + values["I"] * z))


def switch_band(width: float, alpha: float) -> System:
    """The Switch model with a band of half-width eta = width."""
    return hunting_switch(eta=width, alpha=alpha)


def karnopp_band(width: float, alpha: float) -> System:
    """Karnopp's model with a band of half-width DV = width."""
    return hunting_karnopp(DV=width, alpha=alpha)


def slip_ratio(values: Mapping[str, float]) -> float | None:
    """`coulomb_ratio` of parameter values."""
    return coulomb_ratio(**{name: values[name] for name in SLIP})


def slip_cycles(values: Mapping[str, float]) -> tuple[float, ...]:
    """Amplitudes of `static_cycles` of parameter values."""
    return tuple(c.d for c in static_cycles(**{name: values[name] for name in (*SLIP, "Fs", "Fc")}))


SYMBOLS = (
    ("t", "time", "s"),
    ("x, v, z", "position error, velocity, integral of the error", "m, m/s, m s"),
    ("u", "force of the controller, P (x + D v + I z); it acts as -u", "N"),
    ("F(v)", "friction force: g(|v|) sgn v + b v in slip, any value in [-Fs, Fs] at v = 0", "N"),
    ("g(|v|)", "Stribeck curve, Fc + (Fs - Fc) exp(-(|v|/vs)^beta)", "N"),
    ("β", "the exponent beta of the Stribeck curve: how it falls beside v = 0", "1"),
    ("d", "rest position: x where the mass comes to stick; d* of a cycle", "m"),
    ("R(d)", "next rest position after d: the event map; R(R(d)) its second iterate", "m"),
    ("T", "period of a cycle", "s"),
    ("equilibrium set", "x = v = 0, |z| ≤ Fs/(P I): where the mass can stay at rest at the target", "-"),
    ("η, α", "half-width of the stick band of the Switch model, and its rate in the band", "m/s, 1/s"),
)
STICK = {"band upper": "-", "band lower": "+", "effort upper": "-", "effort lower": "+"}
SET, CYCLE, TUNED = "equilibrium set", "limit cycle", "hunting can be tuned away"

STATED = Stated(
    parameters={
        "m": "1", "P": "10", "D": "1", "I": "10", "Fs": "4", "Fc": "2", "vs": "0.1", "beta": "2", "b": "1",
    },
    points={
        "2": (
            StatedPoint("0", SET, True),
            StatedPoint("0.0034", CYCLE, False, "0.003355834470"),
            StatedPoint("0.2523", CYCLE, True, "0.252304806412"),
        ),
        "1": (StatedPoint("0", SET, False), StatedPoint("0.2314", CYCLE, True, "0.231364108104")),
        "0.5": (StatedPoint("0", SET, False), StatedPoint("0.1786", CYCLE, True)),
    },
    places={
        "2": ("near P = 21", "never, stable for every P"),
        "1": ("none", "near P = 27"),
        "0.5": ("none", "never, unstable at every P computed"),
    },
    bounds={"1": "P > 29", "0.5": "undefined"},
    classification={
        "beta > 1": {SET: "stable", "limit cycles": "possible, stable and unstable", TUNED: "yes"},
        "beta = 1": {SET: "stable or unstable", "limit cycles": "possible, stable only", TUNED: "yes"},
        "0 < beta < 1": {SET: "unstable", "limit cycles": "always, stable", TUNED: "never"},
    },
)  # fmt: skip

STUDY = register_study(Study(
    name="hunting", title="Friction-induced hunting, solved as a differential inclusion", source=SOURCE,
    model="hunting",
    cases=(
        StudyCase("2", {"beta": 2.0}, "β = 2", "beta > 1", 0.006),
        StudyCase("1", {"beta": 1.0}, "β = 1", "beta = 1", 0.002),
        StudyCase("0.5", {"beta": 0.5}, "β = 0.5", "0 < beta < 1", 0.002),
    ),
    parameter="P", values=tuple(float(P) for P in range(10, 32)), beyond=(50.0, 100.0),
    texts=read_texts("hunting.md"), symbols=SYMBOLS, order=2, symmetry="odd",
    labels={
        "t": "time t [s]", "x": "position error x [m]", "v": "velocity v [m/s]", "z": "integral z [m s]",
        "multiplier": "dry friction / g(|v|) [-]", "d": "rest position d [m]",
        "image": "next rest position R(d) [m]", "iterate": "R(R(d)) [m]",
        "fixed points": "fixed points d* of R(R(d)) [m]", "parameter": "controller gain P [N/m]",
        "plane": "integral rate I [1/s]", "ending": "exponent β [-]",
        "fold": "controller gain P at the fold [N/m]", "amplitude": "amplitude of x: rest position [m]",
        "input": "amplitude of the velocity [m/s]", "curve x": "velocity v [m/s]",
        "curve y": "dry friction g(|v|) sgn v [N]", "width": "half-width [m/s]",
    },
    mode_names={"0": "stick", "+": "slip+", "-": "slip-"},
    curve=stribeck_curve, curve_title=("friction", "Friction curves"), goal=TUNED, stated=STATED,
    variants=(
        Variant("switch", switch_band, STICK, {"alpha": (100.0, 10.0, 1000.0)}),
        Variant("karnopp", karnopp_band, STICK, {"alpha": (100.0,)}),
    ),
    widths=(1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
    ending=("beta", (1.0, 2.0)), plane=("I", (4.0, 31.0), (4.0, 20.0)),
    ranges={"P": (8.0, 40.0), "I": (4.0, 20.0)},
    tuned=(
        *(Law(f"β = {beta:g}", "hunting", {"beta": beta}) for beta in (2.0, 1.0, 0.5)),
        Law("static + Coulomb", "hunting_static"),
    ),
    laws=(
        Law("Stribeck, β = 2", "hunting"),
        Law("Coulomb", "hunting_coulomb", ratio=slip_ratio),
        Law("static + Coulomb", "hunting_static", cycles=slip_cycles),
    ),
    experiment=Experiment(
        t_end=5.0, samples=501, noise=1e-5, seed=7, force=applied_force, plant=driven_mass,
        guess={"Fs": 3.4, "Fc": 2.5, "vs": 0.16, "b": 0.5}, fixed={"m": 1.0, "beta": 2.0}, windows=2,
        curve=friction_curve,
    ),
    relative=Relative(
        "LuGre", hunting_lugre, x0=(0.3, 0.0, 0.0, 0.0), transient=100.0, method="Radau",
        beyond=(60.0, (0.05, 0.0, 0.0, 0.0)), small=(1e-4,), settle=200.0, threshold=1e-6,
    ),
    approximated=read_rows("approximations.csv"),
))  # fmt: skip
