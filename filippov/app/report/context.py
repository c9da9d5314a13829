"""The context of a study: its system and section; progress and time of the work."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from filippov.analysis import EventMap, Section
from filippov.app.report.aside import Aside
from filippov.app.report.effort import Effort
from filippov.base.errors import UsageError
from filippov.base.label import unit_of
from filippov.models import registry
from filippov.models.studies import Study, StudyCase
from filippov.plot.style import axis_label

Progress = Callable[..., object]


class Context:
    """The context of a study.

    surface, index   of the section and its coordinate; timing: seconds by stage
    until            fraction of the whole that is done after the present section
    aside            parts computed in other processes

    Raises UsageError for a model without a section, or with one of several surfaces or of a formula.
    """

    def __init__(
        self, study: Study, effort: Effort, progress: Progress | None = None, aside: Aside | None = None
    ) -> None:
        model = registry.get(study.model)
        if model.section is None:
            raise UsageError(f"study {study.name!r}: the model {model.name!r} has no section; register one.")
        self.study, self.effort, self.model, self.proposed = study, effort, model, model.section
        self.section, self.interval = Section.from_model(model), model.section.interval
        self.system = model.build()
        bound = EventMap(self.system, self.section).bound
        self.surface, self.index = bound.surface, bound.index
        self.x0, self.t_span = study.x0 or model.x0, study.t_span or model.t_span
        self.aside = aside or Aside(study, effort)
        self.until = 0.0
        self.timing: dict[str, float] = {}
        self._progress, self._low, self._high = progress, 0.0, 0.0

    @contextmanager
    def stage(self, name: str, until: float, what: str = "") -> Iterator[None]:
        """A part of the work whose time is taken; `until`: the fraction of the whole that is done then."""
        self._high = until
        self.tell(0.0, what or name)
        since = time.perf_counter()
        yield
        self.timing[name] = self.timing.get(name, 0.0) + time.perf_counter() - since
        self._low = until

    def tell(self, fraction: float, what: str) -> None:
        """Report the fraction of the stage that is done."""
        if self._progress is not None:
            self._progress(self._low + (self._high - self._low) * fraction, 1.0, what)

    def label(self, name: str, default: str = "") -> str:
        """An axis label by its name."""
        unit, x = self.study.unit, self.section.coordinate
        own = {"d": f"{x} [{unit}]", "image": f"{self.study.letter}(d) [{unit}]",
               "iterate": f"{self.iterate} [{unit}]", "fixed points": f"fixed points {x} [{unit}]",
               "parameter": self.study.parameter}  # fmt: skip
        return self.study.labels.get(name, default or own.get(name, name))

    def headed(self, name: str, shown: str = "") -> str:
        """The head of a column: a state, a parameter, or `shown` of it, with its unit."""
        unit = unit_of(axis_label(self.system, name))
        return f"{shown or name} [{unit}]" if unit else shown or name

    @property
    def iterate(self) -> str:
        """The iterate of the map that is studied, as it is written."""
        letter, order = self.study.letter, self.study.order
        return {1: f"{letter}(d)", 2: f"{letter}({letter}(d))"}.get(order, f"{letter}^{order}(d)")

    def lettered(self, text: str) -> str:
        """A text of an analysis, which calls the map R, with the study's letter."""
        return text.replace("R(d)", f"{self.study.letter}(d)").replace("R(0+)", f"{self.study.letter}(0+)")

    def given(self, case: StudyCase, *words: str) -> str:
        """The command's words for the model and a case's parameters."""
        return " ".join((self.model.name, *words, *(f"-p {k}={v:g}" for k, v in case.parameters.items())))
