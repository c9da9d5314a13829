"""A command without a flag computes what the function of the same name does without the argument."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest
from command import summary

from filippov import analysis
from filippov.analysis.gains.tuning import tune
from filippov.analysis.maps.section import Section
from filippov.app.cli.catalogue import commands
from filippov.models import get

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "attractors": analysis.attractors, "basin": analysis.basin, "bifurcation": analysis.bifurcation,
    "continue": analysis.continuation, "diagram": analysis.brute_force,
    "homoclinic": analysis.find_homoclinic, "identify": analysis.identify, "lyapunov": analysis.lyapunov,
    "orbit": analysis.find_orbit, "regions": analysis.regions, "tune": analysis.tune,
}  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_7_1_numbers_have_the_same_default_in_the_command_and_in_the_function(name: str) -> None:
    command = commands()[name]
    known = inspect.signature(FUNCTIONS[name]).parameters
    told = {s.name: s.default for s in command.settings if isinstance(s.default, int | float | str)}
    shared = {key: value for key, value in told.items() if key in known}
    assert shared == {key: known[key].default for key in shared}


@pytest.mark.parametrize("low", [8, 12])
def test_7_1_tune_finds_the_same_in_the_command_and_in_the_function(
    low: int, capsys: pytest.CaptureFixture[str]
) -> None:
    model = get("hunting")
    found = tune(model.build(), Section.from_model(model), {"P": (low, 50.0)}, (0, 0.5), samples=16).to_dict()
    words = ["--over", f"P={low}:50", "--interval", "0", "0.5", "--samples", "16", "--grid", "4"]
    data = summary(capsys, "tune", "hunting", *words)
    assert {key: data[key] for key in found} == found
