"""Work counted in machine code: the calls that a trace hook counts, stopped where it stops them."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any

import pytest

from filippov.analysis.algebra import budget
from filippov.analysis.algebra.budget import Clock, OutOfBudgetError, counted


def called(n: int) -> int:
    return n


def work(n: int) -> int:
    for _ in range(n):
        called(n)
    return n


def nested(depth: int) -> int:
    return depth if depth == 0 else nested(depth - 1)


def yields(n: int) -> Iterator[int]:
    for k in range(n):
        yield called(k)


def fails(k: int) -> int:
    raise ValueError(k)


def caught(k: int) -> int:
    try:
        return fails(k)
    except ValueError:
        return called(k)


PROGRAMS: dict[str, Any] = {
    "calls": lambda: work(1000),
    "recursion": lambda: nested(200),
    "generators": lambda: sum(yields(300)),
    "closed generators": lambda: [next(yields(3)) for _ in range(100)],
    "exceptions": lambda: sum(caught(k) for k in range(50)),
}


def calls_of(program: Any) -> int:
    clock = Clock(1e6)
    before = clock.remaining()
    clock.within(program)
    return round((before - clock.remaining()) * budget.CALLS)


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_count_is_that_of_a_trace_hook(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = calls_of(PROGRAMS[name])
    monkeypatch.setattr(budget, "call_counter", lambda: None)
    assert found == pytest.approx(calls_of(PROGRAMS[name]), abs=4)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("limit", [0.001, 0.0371, 0.2])
def test_work_without_end_is_ended(limit: float, native: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not native:
        monkeypatch.setattr(budget, "call_counter", lambda: None)
    clock = Clock(1.0)
    with pytest.raises(OutOfBudgetError, match=f"{limit:.3g}"):
        clock.within(lambda: work(10**9), most=limit)
    assert 1.0 - clock.remaining() == pytest.approx(limit, abs=1e-3)
    assert sys.gettrace() is None
    assert clock.within(lambda: work(10)) == 10


def test_limits_within_limits() -> None:
    found = []

    def inner() -> int:
        with pytest.raises(OutOfBudgetError):
            Clock(10.0).within(lambda: work(10**9), most=0.05)
        found.append("inner")
        return work(10**9)

    with pytest.raises(OutOfBudgetError):
        Clock(0.2).within(inner)
    assert found == ["inner"]
    assert sys.gettrace() is None


def test_threads_are_counted_each_for_itself() -> None:
    found: dict[int, float] = {}

    def run(k: int) -> None:
        clock = Clock(1.0)
        with pytest.raises(OutOfBudgetError):
            clock.within(lambda: work(10**9), most=0.1 * (k + 1))
        found[k] = 1.0 - clock.remaining()

    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[k] for k in range(4)] == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=1e-3)


def test_a_trace_hook_that_is_there_goes_on() -> None:
    seen = []

    def hook(frame: FrameType, event: str, arg: object) -> None:
        seen.append(frame.f_code.co_name)

    before = sys.gettrace()
    sys.settrace(hook)
    try:
        counted(work)(5)
        still = sys.gettrace()
    finally:
        sys.settrace(before)
    assert seen.count("called") == 5
    assert still is hook


def test_exceptions_pass_and_end_the_count() -> None:
    def broken() -> None:
        work(10)
        raise ValueError("as it is")

    clock = Clock(1.0)
    with pytest.raises(ValueError, match="as it is"):
        clock.within(broken)
    before = clock.remaining()
    work(1000)
    assert clock.remaining() == pytest.approx(before, abs=1e-3)
