"""The study of the hunting loop: the figures and tables of the reference paper, computed from the inclusion.

Source: R.H.A. Hensen, M.J.G. van de Molengraft, "Friction Induced Hunting Limit Cycles: An Event Mapping
Approach", American Control Conference 2002.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filippov.model.system import System
from filippov.models.hunting_questions import QUESTIONS
from filippov.models.hunting_text import CAPTIONS, DIFFERENCES, SUMMARY
from filippov.models.karnopp import hunting_karnopp
from filippov.models.laws import Stribeck
from filippov.models.mass import REFERENCE_LAW, SOURCE
from filippov.models.studies import Curve, StatedPoint, Study, StudyCase, Variant, register_study
from filippov.models.switch import hunting_switch

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
SET, CYCLE, TUNED = "equilibrium set", "limit cycle", "hunting can be tuned away"

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
        curve_title=("friction", "Friction curves"),
        goal=TUNED,
        variants=(
            Variant("switch", switch_band, STICK, {"alpha": (100.0, 10.0, 1000.0)}),
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
            "plane": "integral rate I [1/s]",
            "ending": "exponent β [-]",
            "fold": "controller gain P at the fold [N/m]",
            "amplitude": "amplitude of x: rest position [m]",
            "input": "amplitude of the velocity [m/s]",
            "curve x": "velocity v [m/s]",
            "curve y": "dry friction g(|v|) sgn v [N]",
        },
        mode_names={"0": "stick", "+": "slip+", "-": "slip-"},
        stated_parameters={
            "m": "1",
            "P": "10",
            "D": "1",
            "I": "10",
            "Fs": "4",
            "Fc": "2",
            "vs": "0.1",
            "beta": "2",
            "b": "1",
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
                SET: "stable",
                "limit cycles": "possible, stable and unstable",
                TUNED: "yes",
            },
            "beta = 1": {
                SET: "stable or unstable",
                "limit cycles": "possible, stable only",
                TUNED: "yes",
            },
            "0 < beta < 1": {
                SET: "unstable",
                "limit cycles": "always, stable",
                TUNED: "never",
            },
        },
        summary=SUMMARY,
        differences=DIFFERENCES,
        captions=CAPTIONS,
        questions=QUESTIONS,
    )
)
