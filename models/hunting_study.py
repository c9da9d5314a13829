"""The study of the hunting loop: the figures and tables of the reference paper, computed from the inclusion.

Source: R.H.A. Hensen, M.J.G. van de Molengraft, "Friction Induced Hunting Limit Cycles: An Event Mapping
Approach", American Control Conference 2002.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filippov.models.karnopp import hunting_karnopp
from filippov.models.laws import Stribeck
from filippov.models.mass import REFERENCE_LAW, SOURCE
from filippov.models.studies import Curve, StatedPoint, Study, StudyCase, Variant, register_study
from filippov.models.switch import hunting_switch
from filippov.system import System

FASTEST = 0.5


def stribeck_curve(values: Mapping[str, float]) -> Curve:
    """The dry part g(|v|) sign(v) of the friction force [N] over v [m/s], and its set at v = 0."""
    given = {**{k: p.default for k, p in REFERENCE_LAW.parameters().items()}, **values, "b": 0.0}
    law = Stribeck(**{name: given[name] for name in REFERENCE_LAW.parameters()})
    side = np.concatenate([np.geomspace(1e-7, 0.02, 240), np.linspace(0.02, FASTEST, 240)[1:]])
    v = np.concatenate([-side[::-1], [0.0], side])
    return Curve(v, law.curve(v), (0.0, *law.levels()))


def switch_band(width: float, alpha: float) -> System:
    """The Switch model with a band of half-width eta = width."""
    return hunting_switch(eta=width, alpha=alpha)


def karnopp_band(width: float, alpha: float) -> System:
    """Karnopp's model with a band of half-width DV = width."""
    return hunting_karnopp(DV=width, alpha=alpha)


STICK = {"band upper": "-", "band lower": "+", "effort upper": "-", "effort lower": "+"}
SET, CYCLE = "equilibrium set", "limit cycle"

STUDY = register_study(
    Study(
        name="hunting",
        title="Friction-induced hunting, solved as a differential inclusion",
        source=SOURCE,
        model="hunting",
        cases=(
            StudyCase("2", {"beta": 2.0}, "β = 2", "beta > 1", 0.006),
            StudyCase("1", {"beta": 1.0}, "β = 1", "beta = 1", 0.002),
            StudyCase("0.5", {"beta": 0.5}, "β = 0.5", "0 < beta < 1", 0.002),
        ),
        x0=(0.1, 0.0, 0.0),
        t_span=(0.0, 20.0),
        order=2,
        parameter="P",
        values=tuple(float(P) for P in range(10, 32)),
        beyond=(50.0, 100.0),
        curve=stribeck_curve,
        variants=(
            Variant("switch", switch_band, STICK, {"alpha": (10.0, 100.0, 1000.0)}),
            Variant("karnopp", karnopp_band, STICK, {"alpha": (100.0,)}),
        ),
        widths=(1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
        labels={
            "t": "time t [s]",
            "x": "position error x [m]",
            "v": "velocity v [m/s]",
            "z": "integral z [m s]",
            "multiplier": "dry friction / g(|v|) [-]",
            "d": "rest position d [m]",
            "P(d)": "next rest position P(d) [m]",
            "P(P(d))": "P(P(d)) [m]",
            "fixed points": "fixed points d* of P(P(d)) [m]",
            "parameter": "controller gain P [N/m]",
            "curve x": "velocity v [m/s]",
            "curve y": "dry friction g(|v|) sgn v [N]",
        },
        mode_names={"0": "stick", "+": "slip+", "-": "slip-"},
        stated_parameters={
            "m": "1", "P": "10", "D": "1", "I": "10", "Fs": "4", "Fc": "2", "vs": "0.1", "beta": "2", "b": "1",
        },
        stated_points={
            "2": (
                StatedPoint("0", SET, True),
                StatedPoint("0.0034", CYCLE, False, "0.003355834470"),
                StatedPoint("0.2523", CYCLE, True, "0.252304806412"),
            ),
            "1": (StatedPoint("0", SET, False), StatedPoint("0.2314", CYCLE, True, "0.231364108104")),
            "0.5": (StatedPoint("0", SET, False), StatedPoint("0.1786", CYCLE, True)),
        },
        stated_places={
            "2": {
                "fold of the two cycles": "near P = 21",
                "the set changes stability": "never, stable for every P",
            },
            "1": {
                "fold of the two cycles": "none",
                "the set changes stability": "near P = 27",
            },
            "0.5": {
                "fold of the two cycles": "none",
                "the set changes stability": "never, unstable at every P computed",
            },
        },
        stated_bounds={"1": "P > 29", "0.5": "undefined"},
        stated_classification={
            "beta > 1": {
                SET: "stable", "limit cycles": "possible, stable and unstable", "hunting can be tuned away": "yes",
            },
            "beta = 1": {
                SET: "stable or unstable", "limit cycles": "possible, stable only",
                "hunting can be tuned away": "yes",
            },
            "0 < beta < 1": {
                SET: "unstable", "limit cycles": "always, stable", "hunting can be tuned away": "never",
            },
        },
        summary=(
            "A mass under dry Stribeck friction is held at 0 by a PID controller: m v' ∈ −u − F(v), x' = v, "
            "z' = x, u = P (x + D v + I z). Friction at rest is a set, so the loop is a differential inclusion. "
            "It is solved as one: stick is a sliding mode on the surface v = 0, slip is a smooth equation on "
            "each side, and every change between them is an event that is located and landed on. There is no "
            "band around v = 0.",
            "With β = 2 the loop has two limit cycles at P = 10 N/m, an unstable one at d = {cycle_2_1:.10f} m "
            "and a stable one at d = {cycle_2_2:.10f} m: which of hunting and rest is reached depends on the start. "
            "Both vanish in a fold at P = {fold_2:.8f} N/m. With β = 1 the stable cycle shrinks into the "
            "equilibrium set at P = {change_1:.8f} N/m, below the Routh-Hurwitz bound of {bound_1:g} N/m. With "
            "β = 0.5 the set is unstable and the loop hunts at every gain that was computed.",
        ),
        differences=(
            (
                "The stick force",
                "Equation 1 of the paper prints the stick force with the sign that doubles u in place of "
                "cancelling it. Its equation 2, the inclusion, is right and is what is solved here.",
            ),
            (
                "The simulation model",
                "The paper integrates the Switch model, three ordinary differential equations with a band of "
                "half-width 1e-8 m/s around v = 0. Here the inclusion itself is integrated: in stick the position is "
                "constant to the last bit and v is exactly on the surface. The comparison below tells how far the "
                "band models are from it.",
            ),
            (
                "Stability of the equilibrium set for β > 1",
                "The paper's table 4 says stable. That is so on its range of gains, and for every P above "
                "{change_rest_2:.8f} N/m; below it the linearised return map at the ends of the set repels. The "
                "Routh-Hurwitz condition asks for P > {bound_2:g} N/m. Both values are below the range of the diagrams.",
            ),
            (
                "Where the set changes stability for β = 1",
                "The paper reads it off the diagram, near P = 27 N/m. Here it is the root of |slope| = 1 of the "
                "second iterate at the set, {change_1:.8f} N/m, and it agrees with the closed return map of the "
                "linearised slip, {change_rest_1:.8f} N/m. Routh-Hurwitz, {bound_1:g} N/m, is sufficient and not "
                "necessary, as the paper says: slip ends before an unstable root can act for long.",
            ),
            (
                "The map at the origin for β = 0.5",
                "The friction curve has an infinite slope at v = 0, so the map does not pass through the "
                "origin: P(0+) = {jump_0_5:.10f} m. A motion that leaves the set, from however near, comes to rest "
                "that far away. The slope of the second iterate at d = 0 is infinite, not a large number; "
                "summary.json has null and a note in its place.",
            ),
            (
                "Figures of the paper",
                "The scan of the paper that was at hand has lost many digits. The figures in the columns \u2018paper\u2019 are "
                "those that survive or were restored by computing them; the reference values in brackets are from "
                "a 40-digit Taylor integration. Of the acceleration coefficient of the Switch model one digit "
                "survives, 1; 100 1/s is taken. The length of the paper's time axis is not known; 20 s are shown. "
                "Tables 1 and 4 carry the paper's numbers; tables 2 and 3 gather figures of its text and diagrams.",
            ),
            (
                "Table 4 is a statement about a range",
                "\u2018Always\u2019 and \u2018never\u2019 in the computed column mean: at every gain that was computed, which are named "
                "below the table. For β < 1 the instability of the set is proved for every gain (see the stability "
                "report); that a cycle exists is a computation.",
            ),
        ),
        captions={
            "friction": "The force is a set at v = 0, the thick bar. The slope beside it is 0 for β = 2, finite for "
            "β = 1 and infinite for β = 0.5; that decides what a linearisation can say.",
            "response": "Shaded: stick. In stick the friction takes any value between -1 and 1 times Fs and cancels u; "
            "slip begins where it reaches ±1.",
            "phase": "The equilibrium set is the segment x = v = 0, |z| ≤ Fs/(P I): a point in the left plane, a segment "
            "in the right one.",
        },
    )
)  # fmt: skip
