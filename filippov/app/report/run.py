"""A study under way: its context, and the results so far."""

from __future__ import annotations

from filippov.app.report.aside import Aside
from filippov.app.report.case import CaseCycles, CaseResults
from filippov.app.report.context import Context, Progress
from filippov.app.report.effort import Effort
from filippov.models.studies import Study


class StudyRun(Context):
    """The data of the sections: computed cases, the main one first, and the cycles of each."""

    def __init__(
        self, study: Study, effort: Effort, progress: Progress | None = None, aside: Aside | None = None
    ) -> None:
        super().__init__(study, effort, progress, aside)
        self.cases: list[CaseResults] = []
        self.cycles: list[CaseCycles] = []

    @property
    def main(self) -> CaseResults:
        """The case that is shown in most detail."""
        return self.cases[0]
