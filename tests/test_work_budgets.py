"""Budgets of formulas count work: a slow machine, or a clock that jumps, changes no answer."""

import sys
import time
from contextlib import suppress

import pytest
import sympy

from filippov.analysis.algebra.budget import Clock, OutOfBudgetError, counted
from filippov.analysis.algebra.routh_hurwitz import routh_hurwitz
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.steady.equilibria import equilibria
from filippov.model.symbols import states
from filippov.model.system import System
from filippov.models import hunting, registry

x, y = sympy.symbols("x y", real=True)


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every look at a clock finds an hour gone."""
    hours = iter(range(1, 10**9))
    for name in ("monotonic", "perf_counter", "time", "process_time", "thread_time"):
        monkeypatch.setattr(time, name, lambda: 3600.0 * next(hours))


@pytest.mark.parametrize("name", ["hunting", "relay", "thermostat"])
def test_12_9_answers_do_not_depend_on_the_clock(name: str, request: pytest.FixtureRequest) -> None:
    system = registry.get(name).build()
    quiet = stability_report(system)
    request.getfixturevalue("slow")
    loaded = stability_report(system)
    assert loaded.notes == quiet.notes
    assert [item.answer for item in loaded.items] == [item.answer for item in quiet.items]
    assert loaded.to_text() == quiet.to_text()


def test_12_9_a_small_budget_ends_at_the_same_place(slow: None) -> None:
    long = [sympy.Add(x, y, k) ** (3 + k % 2) for k in range(9)]
    rows = {len(routh_hurwitz(long, budget=0.3).array) for _ in range(3)}
    assert len(rows) <= 2  # what sympy has cached is not computed again
    assert routh_hurwitz(long, budget=0.3).status == "timeout"
    found = equilibria(hunting(), budget=1e-9)
    assert len(found) == 0
    assert "Give a larger budget" in found.notes[0]


def test_12_9_what_never_asks_is_stopped_by_its_calls() -> None:
    def endless() -> None:
        def again() -> int:
            return 1

        while True:
            with suppress(Exception):
                again()

    clock = Clock(0.5)
    with pytest.raises(OutOfBudgetError, match="budget"):
        clock.within(endless, 0.01)
    assert 0.4 < clock.remaining() < 0.5
    with pytest.raises(OutOfBudgetError, match=r"budget of 0\.5"):
        clock.within(endless)
    assert sys.gettrace() is None or sys.gettrace().__module__ != "filippov.analysis.algebra.budget"


def test_12_9_a_trace_hook_that_is_there_goes_on() -> None:
    seen: list[str] = []

    def trace(frame: object, event: str, arg: object) -> None:
        seen.append(event)

    @counted
    def work() -> int:
        return sum(q() for q in (lambda: 1, lambda: 2))

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        assert work() == 3
        assert sys.gettrace() is trace
    finally:
        sys.settrace(before)
    assert seen.count("call") >= 3


def test_14_5_a_system_takes_calls_in_proportion_to_its_size() -> None:
    """A line of cells with one relay: twice the states, twice the calls of functions."""

    def calls(n: int) -> int:
        x = states(" ".join(f"x{i}" for i in range(n)))
        right = [-3 * x[i] + (x[i - 1] if i else -sympy.sign(x[0])) + x[(i + 1) % n] for i in range(n)]
        count = 0

        def hook(frame: object, event: str, arg: object) -> None:
            nonlocal count
            count += event == "call"

        sys.setprofile(hook)
        try:
            System(dict(zip(x, right, strict=True)))
        finally:
            sys.setprofile(None)
        return count

    calls(10)
    assert calls(800) < 2.2 * calls(400)
