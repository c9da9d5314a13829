"""Results for design: settings without cycles, predictions by harmonic balance, parameters from data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from filippov import SolveError
from filippov.analysis import EventMap, Record, Section, find_orbit
from filippov.analysis import gain_map as ratio_map
from filippov.analysis.estimation.identification import Identified, identify
from filippov.analysis.gains.tuning import Tuning, tune
from filippov.analysis.harmonic.describing_function import DescribingFunction, describing_function
from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.app.report.case import StudyRun
from filippov.app.report.context import Context
from filippov.app.report.effort import Effort
from filippov.app.report.part import NONE, Chapter, Picture, TextTable, number, yes
from filippov.models import registry
from filippov.models.studies import Law, Study
from filippov.plot import plot_describing_function, plot_identification
from filippov.plot import plot_gain_maps as plot_ratio_maps
from filippov.solving.uncut import solve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 100


def tuned(study: Study, effort: Effort, k: int) -> Tuning:
    """The search for settings without cycles under law k."""
    item, own, (samples, points) = study.tuned[k], registry.get(study.model), effort.tune
    model = registry.get(item.model)
    assert own.section is not None
    return tune(
        model.build(), Section.from_model(model), study.ranges, own.section.interval,
        parameters=item.parameters, samples=samples, points=points,
    )  # fmt: skip


def settings(run: StudyRun) -> Chapter:
    """The search for settings without cycles under each law, and the ratio map of the first."""
    study, found = run.study, []
    with run.stage("settings", run.until):
        for k, item in enumerate(study.tuned):
            run.tell(k / (len(study.tuned) + 1), f"settings, {item.label}")
            found.append((item, run.aside.value(tuned, k)))
        run.tell(len(study.tuned) / (len(study.tuned) + 1), "ratio map")
        (x, across), (y, up) = list(study.ranges.items())[:2]
        first, grid = found[0], run.effort.grid
        shown = ratio_map(
            run.system, run.section, (x, np.linspace(*across, grid).tolist()),
            (y, np.linspace(*up, grid).tolist()), run.interval, parameters=first[0].parameters, points=POINTS,
        )  # fmt: skip
    rows = []
    for asked, t in found:
        if t.best is None:
            rows.append((asked.label, "none", NONE, NONE, NONE, t.reason))
            continue
        best = ", ".join(f"{name} = {value:.4g}" for name, value in t.best.items())
        lower = "; ".join(f"{i.name} > {i.lower:.5g}" for i in t.limits if i.lower is not None)
        rows.append((
            asked.label, best, f"{t.margin:.3f}", f"{t.best_ratio:.3f}", f"{100 * t.share:.1f} %",
            f"alone, the others at the best: {lower}" if lower else "",
        ))  # fmt: skip
    facts = {f"margin_{k}": t.margin for k, (_, t) in enumerate(found) if t.best}
    facts |= {f"best_{k}_{n}": v for k, (_, t) in enumerate(found) for n, v in (t.best or {}).items()}
    ranges = ", ".join(f"{n} = {a:g} ... {b:g}" for n, (a, b) in study.ranges.items())
    command = f"`filippov tune {run.model.name} --over ...`"

    def draw() -> Figure:
        figure = plot_ratio_maps([shown], tuning=first[1], title=first[0].label)
        figure.axes[0].set(xlabel=run.label("parameter"), ylabel=run.label("plane", y))
        return figure

    title = "Largest ratio of successive excursions, best settings and their margin"
    picture = Picture("settings", title, command, draw)
    return Chapter("settings", "Settings without cycles", [picture, TextTable(
        "Settings without cycles",
        ("law", "best settings", "margin", "ratio", "share", "borders, or why there are none"), tuple(rows),
        f"Searched in {ranges}. Margin: the factor by which every setting may change at once, in any "
        f"combination, up or down. Ratio: the largest |{study.letter}(d)/d| at the best settings. Share: "
        "of the samples that have no cycle.", f"{command}.", "settings",
    )], facts, {"settings": {asked.label: t.to_dict() for asked, t in found}})  # fmt: skip


class Prediction(NamedTuple):
    """Harmonic balance and algebra for one law at its model's own values, and the exact cycles beside them.

    exact     fixed points of the event map that are cycles; inputs: (amplitude of the input, frequency)
    ratio     of successive stick positions by the algebra, and by the event map; None where not asked
    algebraic coordinates of the cycles by the algebra
    """

    law: Law
    harmonic: DescribingFunction
    exact: list[FixedPoint]
    inputs: list[tuple[float, float]]
    ratio: tuple[float, float] | None
    algebraic: list[float]


def _predicted(run: StudyRun, law: Law) -> Prediction:
    model = registry.get(law.model)
    system = model.build()
    once = EventMap(system, Section.from_model(model), lanes=1)
    low, high = run.interval
    cycles = [
        q for q in once.power(run.study.order).fixed_points(low, high, POINTS)
        if q.d > 0 and q.kind == "limit cycle"
    ]  # fmt: skip
    name, inputs = str(system.symbolic.h[0]) if system.symbolic else "", []
    for q in cycles:
        orbit = find_orbit(system, once.bound.start(np.array([q.d]), once.p)[0], symmetry=run.study.symmetry)
        if name in orbit.amplitude:
            inputs.append((orbit.amplitude[name], 2 * np.pi / orbit.period))
    own, middle = law.ratio(once.parameters) if law.ratio else None, 0.5 * (low + high)
    ratio = None if own is None else (own, abs(float(once(middle))) / middle)
    algebraic = list(law.cycles(once.parameters)) if law.cycles else []
    return Prediction(law, describing_function(system), cycles, inputs, ratio, algebraic)


def prediction(run: StudyRun) -> Chapter:
    """Harmonic balance, algebra and exact cycles for each law."""
    laws, found = run.study.laws, []
    with run.stage("predictions", run.until):
        for k, law in enumerate(laws):
            run.tell(k / len(laws), f"harmonic balance, {law.label}")
            found.append(_predicted(run, law))
    rows = []
    facts: dict[str, float] = {}
    for k, p in enumerate(found):
        exact = "; ".join(f"d = {q.d:.12f} ({q.verdict})" for q in p.exact)
        said = "; ".join(f"amplitude {c.amplitude:.6g}, period {c.period:.6g} s" for c in p.harmonic.cycles)
        right = bool(p.harmonic.cycles) == bool(p.exact)
        algebra = "; ".join(f"d = {d:.12f}" for d in p.algebraic) or ("none" if p.law.cycles else NONE)
        if p.ratio is not None:
            algebra = f"none: ratio of successive |d| {p.ratio[0]:.12f} (event map: {p.ratio[1]:.12f})"
        rows.append((p.law.label, said or "no cycle", algebra, exact or "none", yes(right)))
        facts |= {f"ratio_{k}": p.ratio[0]} if p.ratio else {}
        facts |= {f"algebra_{k}": d for d in p.algebraic}
    made = [f for law in laws for f in (law.ratio, law.cycles) if f is not None]
    command = f"`filippov describing-function {run.model.name}`"
    source = ", ".join([command, *(f"{f.__module__}.{f.__name__}" for f in made)])
    title = "Growth rate and frequency by harmonic balance, and the exact cycles"
    return Chapter("prediction", "Harmonic balance and algebra beside the exact cycles", [
        Picture("prediction", title, command, lambda: plot_describing_function(
            found[0].harmonic, exact=found[0].inputs, labels={"amplitude": run.label("input")}
        )),
        TextTable(
            "What is predicted, and what there is",
            ("law", "harmonic balance", "algebra of the slip", f"event map: d [{run.study.unit}]",
             "harmonic balance right"),
            tuple(rows), "", f"{source}.", "prediction",
        ),
    ], facts, {"predictions": {
        p.law.label: {
            "harmonic_balance": p.harmonic.to_dict()["cycles"], "exact": [q.d for q in p.exact],
            "ratio": p.ratio, "algebra": p.algebraic,
        }
        for p in found
    }})  # fmt: skip


class Estimate(NamedTuple):
    """The result of a noisy record: the estimate, and the study's borders for it and for its intervals."""

    found: Identified
    limit: float | None
    safe: float | None


def estimated(study: Study, effort: Effort, k: int) -> Estimate:
    """The estimate from the study's record, made in its case k."""
    asked, about = study.experiment, Context(study, effort)
    assert asked is not None
    values = EventMap(about.system, about.section, parameters=study.cases[k].parameters).parameters
    made = solve(about.system, about.x0, (0.0, asked.t_end), parameters=values, rtol=1e-11, atol=1e-13)
    if not made.success or made.sol is None:
        raise SolveError(f"the solution of the experiment ended early: {made.message}", made)
    t = np.linspace(0.0, asked.t_end, asked.samples)
    states = made.sol(t)
    noise = asked.noise * np.random.default_rng(asked.seed).standard_normal(t.size)
    record = Record(t, states[0] + noise, force=asked.force(states, values))
    found = identify(
        record, asked.plant(), list(asked.guess), start=dict(asked.guess), fixed=dict(asked.fixed),
        windows=asked.windows,
    )  # fmt: skip
    ends = [{key: end} for key, pair in found.intervals.items() for end in pair]
    return Estimate(found, _limit(about, values, found, []), _limit(about, values, found, ends))


def experiment(run: StudyRun) -> Chapter:
    """A record with noise, the estimate from it, and the borders of the settings for it."""
    asked, values, name = run.study.experiment, run.main.parameters, run.study.parameter
    assert asked is not None
    with run.stage("experiment", run.until):
        found, limit, safe = run.aside.value(estimated, 0)
    truth, unit = {key: values[key] for key in found.errors}, run.study.unit
    rows = tuple(
        (run.headed(key), number(truth[key], 8), f"{found.values[key]:.7g}", f"{error:.2g}",
         f"{found.intervals[key][0]:.6g} ... {found.intervals[key][1]:.6g}",
         f"{(found.values[key] - truth[key]) / error:+.2f}")
        for key, error in found.errors.items()
    )  # fmt: skip
    return Chapter("experiment", "Parameters from a record", [
        Picture("experiment", "Record, fit, residual and the estimated curve",
                "`filippov identify record.csv ...`", lambda: plot_identification(
            found, lambda x, given: asked.curve(x, {**asked.fixed, **given})
        )),
        TextTable(
            "Estimated from the record",
            ("parameter", "made with", "estimate", "standard error", f"{100 * found.level:g} % interval",
             "off, in errors"),
            rows,
            f"{asked.samples} samples over {asked.t_end:g} s, noise {asked.noise:g} {unit} (seed "
            f"{asked.seed}); residual standard deviation {found.sigma:.3g} {unit} with {found.degrees} "
            f"degrees of freedom. No cycles above {name} = {number(limit, 7)} for the estimate, above "
            f"{number(safe, 7)} for the ends of every interval as well.",
            "filippov.analysis.estimation.identification; `filippov identify record.csv ...`; record.csv.",
            "experiment",
        ),
    ], {} if safe is None else {"safe": safe},
    {"experiment": found.to_dict() | {"truth": truth, "limit": limit, "safe": safe}},
    [("record.csv", ("t", "measured", "fitted"), zip(found.t, found.measured, found.fitted, strict=True))],
    )  # fmt: skip


def _limit(
    about: Context, values: Mapping[str, float], found: Identified, ends: list[dict[str, float]]
) -> float | None:
    """Lower border of the study's parameter alone, for the estimate and the ends of its intervals."""
    name = about.study.parameter
    known = {k: v for k, v in found.values.items() if k in about.system.parameters}
    answer = tune(
        about.system, about.section, {name: about.study.ranges[name]}, about.interval,
        parameters={k: v for k, v in {**values, **known}.items() if k != name}, band=[{}, *ends], samples=16,
        points=24,
    )  # fmt: skip
    return answer.limits[0].lower if answer.limits else None
