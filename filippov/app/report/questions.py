"""The questions of a study answered one after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from filippov.app.report.answers import measured, prediction, settings
from filippov.app.report.compute import Subject
from filippov.app.report.cycles import case_cycles, end_curve, region_map
from filippov.app.report.effort import Effort
from filippov.app.report.findings import Findings
from filippov.app.report.relative import relative_cases
from filippov.app.report.results import CaseResult

Tell = Callable[[float, str], None]
# How long each takes, in parts of the whole.
SHARES = {
    "cycles and branches": 0.06, "fold curve": 0.12, "regions": 0.1, "settings": 0.2, "predictions": 0.06,
    "experiment": 0.06, "smoother model": 0.4,
}  # fmt: skip


def findings(
    subject: Subject, cases: Sequence[CaseResult], effort: Effort, tell: Tell, timing: dict[str, float]
) -> Findings:
    """All that the study asks; `tell` gets the fraction done, `timing` the seconds of each question."""
    clock = _Clock(tell, timing)
    main, questions = cases[0], subject.study.questions
    clock.begin("cycles and branches")
    found = []
    for k, case in enumerate(cases):
        clock.tell(k / len(cases), f"cycles and branches, {case.case.label}")
        found.append(case_cycles(subject, case))
    runs = found[0][1]
    clock.begin("fold curve")
    ending = end_curve(subject, runs)
    clock.begin("regions")
    cells = region_map(subject, main, runs, effort, clock.tell)
    clock.begin("settings")
    tuned = settings(subject, effort, clock.tell)
    clock.begin("predictions")
    predictions = []
    for k, law in enumerate(questions.laws):
        clock.tell(k / len(questions.laws), f"harmonic balance, {law.label}")
        predictions.append(prediction(subject, law))
    clock.begin("experiment")
    experiment = measured(subject, main.parameters)
    clock.begin("smoother model")
    relative = relative_cases(subject, cases, effort, clock.tell)
    clock.end()
    return Findings(
        tuple(c for c, _ in found), ending, cells, tuned, tuple(predictions), experiment, relative
    )


class _Clock:
    """Progress and time of the question at hand."""

    def __init__(self, tell: Tell, timing: dict[str, float]) -> None:
        self._tell, self._timing = tell, timing
        self._name, self._begun, self._low = "", 0.0, 0.0

    def begin(self, name: str) -> None:
        self.end()
        self._name, self._begun = name, time.perf_counter()
        self.tell(0.0, name)

    def tell(self, fraction: float, what: str) -> None:
        self._tell(self._low + SHARES[self._name] * fraction, what)

    def end(self) -> None:
        if self._name:
            self._timing[self._name] = time.perf_counter() - self._begun
            self._low += SHARES[self._name]
        self._name = ""
