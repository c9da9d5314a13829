"""Ctrl-C in a solution of a map ends the analysis: it is no return that is missing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from filippov import Status, solve, solve_many
from filippov.analysis.maps import first_return
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.models import registry


def test_an_interrupted_return_is_no_missing_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `solve` and `solve_many` answer where Ctrl-C was pressed meanwhile."""
    model: Any = registry.get("hunting")
    made = EventMap(model.build(), Section.from_model(model))
    assert abs(made.jet(0.2)[0]) > 0
    assert abs(made(0.2)) > 0

    def cut(*given: Any, **options: Any) -> Any:
        return replace(solve(*given, **options), status=Status.INTERRUPTED)

    def many_cut(*given: Any, **options: Any) -> Any:
        return replace(solve_many(*given, **options), complete=False)

    monkeypatch.setattr(first_return, "solve", cut)
    monkeypatch.setattr(first_return, "solve_many", many_cut)
    with pytest.raises(KeyboardInterrupt):
        made.jet(0.2)

    class Cut:
        complete = False

    prepared = next(iter(made._prepared.values()))
    monkeypatch.setattr(type(prepared), "run", lambda *_, **__: Cut())
    monkeypatch.setattr(prepared, "_few", False)
    with pytest.raises(KeyboardInterrupt):
        made(0.21)
