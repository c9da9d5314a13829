"""What follows for who designs: settings without cycles, what harmonic balance says, what data tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from filippov.analysis.estimation.identification import Identified, identify
from filippov.analysis.estimation.record import Record
from filippov.analysis.gains.gain_map import gain_map as ratio_map
from filippov.analysis.gains.tuning import tune
from filippov.analysis.harmonic.describing_function import describing_function
from filippov.analysis.harmonic.static_cycle import coulomb_ratio, static_cycles
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.app.report.compute import Subject
from filippov.app.report.effort import Effort
from filippov.app.report.findings import Measured, Prediction, Settings
from filippov.base.errors import SolveError
from filippov.models import registry
from filippov.models.questions import Law
from filippov.solving.solver import solve

Tell = Callable[[float, str], None]
RATIO, CYCLES = ("m", "P", "D", "I", "b"), ("m", "P", "D", "I", "b", "Fs", "Fc")
POINTS = 100


def settings(subject: Subject, effort: Effort, tell: Tell) -> Settings | None:
    """The search for settings without cycles under each law, and the ratio map of the first."""
    asked = subject.study.questions
    if not asked.tuned:
        return None
    samples, points = effort.tune
    found = []
    for k, item in enumerate(asked.tuned):
        tell(k / (len(asked.tuned) + 1), f"settings, {item.label}")
        model = registry.get(item.model)
        found.append((item, tune(
            model.build(), Section.from_model(model), asked.ranges, subject.interval,
            parameters=item.parameters, samples=samples, points=points,
        )))  # fmt: skip
    tell(len(asked.tuned) / (len(asked.tuned) + 1), "ratio map")
    (x, across), (y, up) = list(asked.ranges.items())[:2]
    shown = ratio_map(
        subject.system, subject.section, (x, np.linspace(*across, effort.grid).tolist()),
        (y, np.linspace(*up, effort.grid).tolist()), subject.interval, parameters=asked.tuned[0].parameters,
        points=points,
    )  # fmt: skip
    return Settings(tuple(found), shown)


def prediction(subject: Subject, law: Law) -> Prediction:
    """Harmonic balance, the algebra of the slip and the event map for one law, at the model's own values."""
    model = registry.get(law.model)
    system = model.build()
    once = EventMap(system, Section.from_model(model))
    low, high = subject.interval
    values = once.parameters
    cycles = [q for q in once.power(subject.study.order).fixed_points(low, high, POINTS) if q.d > 0]
    cycles = [q for q in cycles if q.kind == "limit cycle"]
    inputs = []
    for q in cycles:
        orbit = find_orbit(
            system, once.bound.start(np.array([q.d]), once.p)[0], symmetry=subject.study.questions.symmetry
        )
        name = str(system.symbolic.h[0]) if system.symbolic else ""
        if name in orbit.amplitude:
            inputs.append((orbit.amplitude[name], 2 * np.pi / orbit.period))
    ratio = None
    if law.algebra == "ratio":
        own = coulomb_ratio(**{k: values[k] for k in RATIO})
        middle = 0.5 * (low + high)
        ratio = None if own is None else (own, abs(float(once(middle))) / middle)
    algebraic = static_cycles(**{k: values[k] for k in CYCLES}) if law.algebra == "cycles" else ()
    exact = tuple((float(q.d), float(q.period), bool(q.stable)) for q in cycles)
    return Prediction(law, describing_function(system), exact, tuple(inputs), ratio, algebraic)


def measured(subject: Subject, values: Mapping[str, float]) -> Measured | None:
    """The experiment of the study: a record with noise, the estimate, the borders of the settings for it."""
    asked = subject.study.questions.experiment
    if asked is None:
        return None
    system = subject.system
    run = solve(system, subject.study.x0, (0.0, asked.t_end), parameters=values, rtol=1e-11, atol=1e-13)
    if not run.success or run.sol is None:
        raise SolveError(f"the motion of the experiment ended early: {run.message}", run)
    t = np.linspace(0.0, asked.t_end, asked.samples)
    states = run.sol(t)
    noise = asked.noise * np.random.default_rng(asked.seed).standard_normal(t.size)
    record = Record(t, states[0] + noise, force=asked.force(states, values))
    found = identify(
        record, asked.plant(), list(asked.guess), start=dict(asked.guess), fixed=dict(asked.fixed),
        windows=asked.windows,
    )  # fmt: skip
    truth = {name: values[name] for name in found.errors}
    ends = [{name: end} for name, pair in found.intervals.items() for end in pair]
    return Measured(found, truth, _limit(subject, values, found, []), _limit(subject, values, found, ends))


def _limit(
    subject: Subject, values: Mapping[str, float], found: Identified, ends: list[dict[str, float]]
) -> float | None:
    """Lower border of the study's parameter alone, for the estimate and the ends of its intervals."""
    name = subject.study.parameter
    known = {k: v for k, v in found.values.items() if k in subject.system.parameters}
    answer = tune(
        subject.system, subject.section, {name: subject.study.questions.ranges[name]}, subject.interval,
        parameters={k: v for k, v in {**values, **known}.items() if k != name}, band=[{}, *ends], samples=16,
        points=24,
    )  # fmt: skip
    return answer.limits[0].lower if answer.limits else None
