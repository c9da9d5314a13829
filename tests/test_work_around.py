"""What runs leave for one another: nothing of one is seen in the next, in another thread, or inside of it."""

from __future__ import annotations

import contextlib
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from filippov import (
    Problem,
    Solution,
    Stop,
    System,
    TimeEvent,
    UsageError,
    parameters,
    sign,
    solve,
    solve_many,
    states,
)
from filippov.analysis import EventMap, Section
from filippov.models import get, hunting

X, V = states("x v")
OSCILLATOR = System({X: V, V: -X - 0.3 * sign(V)})


def _numbers(run: Solution) -> list[Any]:
    """All that a solution says, as comparable values."""
    arrays = [run.t, run.y, run.x_end, run.end_multipliers, run.events.t, run.events.x]
    if run.sol is not None:
        arrays += [run.sol.start, run.sol.step, run.sol.coef]
    counts = (run.nfev, run.njev, run.nlu, run.steps, run.rejected, run.t_end)
    events = [(str(e), e.group, e.residual) for e in run.events]
    return [*(a.tobytes() for a in arrays), counts, run.status, run.message, run.modes, run.end_mode, events]


def _asked(rng: np.random.Generator) -> dict[str, Any]:
    """A question to the hunting system: start, span, parameters and options."""
    rest = rng.random() < 0.3
    x0 = (float(rng.uniform(0.05, 0.4)), 0.0 if rest else float(rng.normal()), float(rng.normal()))
    end = float(rng.choice([0.0, 1e-9, 0.5, 6.0]))
    asked: dict[str, Any] = {"x0": (0.0, 0.0, 0.0) if rng.random() < 0.1 else x0, "t_span": (0.0, end)}
    if rng.random() < 0.5:
        asked["parameters"] = {"beta": float(rng.uniform(1.0, 2.5)), "P": float(rng.uniform(8.0, 12.0))}
    for name, values in {
        "rtol": (1e-6, 1e-9, 1e-11), "method": ("DOP853", "DP5", "Radau"),
        "dense_output": (True, False), "stop": ((), Stop("velocity", "sliding entry")),
        "atol": (1e-9, [1e-9, 1e-10, 1e-8]), "max_steps": (3, 10_000), "first_step": (1e-12, None),
    }.items():  # fmt: skip
        if rng.random() < 0.3:
            asked[name] = values[int(rng.integers(len(values)))]
    if end == 0.0:
        asked.pop("first_step", None)
    return asked


def _alone(system: System, asked: dict[str, Any]) -> Solution:
    """The answer of arrays that nobody has used."""
    system.runs.clear()
    return solve(system, **asked)


def test_14_3_a_run_knows_nothing_of_the_runs_before() -> None:
    rng, system = np.random.default_rng(143), hunting()
    asked = [_asked(rng) for _ in range(60)]
    expected = [_numbers(_alone(system, one)) for one in asked]
    order = rng.integers(len(asked), size=200).tolist()
    answers = [solve(system, **asked[k]) for k in order]
    assert system.runs
    # Looked at after all of them: nothing of a solution lies in what the later ones used.
    for k, run in zip(order, answers, strict=True):
        assert _numbers(run) == expected[k], asked[k]


def test_14_3_a_clocked_run_knows_nothing_of_the_runs_before() -> None:
    p = parameters(T=0.7)
    reset = TimeEvent("kick", start=0.2, period=p.T, reset={V: -0.8 * V})
    system = System({X: V, V: -X - 0.3 * sign(V)}, time_events=[reset])
    spans = [(0.0, 0.1), (0.0, 3.0), (1.0, 2.5), (0.0, 0.2)]
    asked = [{"x0": (1.0, 0.5), "t_span": s, "parameters": {"T": T}} for s in spans for T in (0.7, 0.3)]
    expected = [_numbers(_alone(system, one)) for one in asked]
    found = [_numbers(solve(system, **one)) for one in reversed(asked)]
    assert system.runs
    assert found[::-1] == expected


@pytest.mark.parametrize("name", ["twisting", "fuller", "differentiator"])
def test_14_3_a_run_that_slid_to_second_order_leaves_nothing_to_the_next(name: str) -> None:
    model, rng = get(name), np.random.default_rng(15)
    system, x0 = model.build(), np.array(model.x0)
    end = {"twisting": 20.0, "fuller": 4.0, "differentiator": 4.0}[name]
    asked = [
        {
            "x0": x0 * (1.0 + 0.2 * float(rng.uniform(-1.0, 1.0))), "t_span": (0.0, part * end),
            "zeno": zeno, "nonunique": "stick", "dense_output": bool(rng.random() < 0.5),
        }
        for part in (1e-3, 0.3, 1.0) for zeno in ("continue", "stop") for _ in range(3)
    ]  # fmt: skip
    expected = [_numbers(_alone(system, one)) for one in asked]
    system.runs.clear()
    for k in rng.integers(len(asked), size=60).tolist():
        assert _numbers(solve(system, **asked[k])) == expected[k], asked[k]
    # All of them are runs of one machine, made once.
    assert [len(waiting) for waiting in system.runs.values()] == [1]


def test_14_3_a_run_inside_of_another_has_arrays_of_its_own() -> None:
    system, inside = hunting(), []
    asked = {"x0": (0.1, 0.0, 0.0), "t_span": (0.0, 20.0), "max_events": 30}
    expected = _numbers(_alone(system, asked))

    def look(t: float, end: float) -> None:
        inside.append(_numbers(solve(system, **asked)))

    assert _numbers(solve(system, **asked, progress=look)) == expected
    assert inside
    assert all(one == expected for one in inside)


def test_14_3_threads_do_not_share_a_run() -> None:
    rng, system = np.random.default_rng(7), hunting()
    asked = [_asked(rng) | {"method": "DOP853"} for _ in range(40)]
    expected = [_numbers(_alone(system, one)) for one in asked]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda one: _numbers(solve(system, **one)), asked * 5))
    assert found == expected * 5


def test_14_3_an_exception_or_an_interrupt_leaves_the_next_run_as_it_is() -> None:
    system, asked = hunting(), {"x0": (0.1, 0.0, 0.0), "t_span": (0.0, 20.0)}
    expected = _numbers(_alone(system, asked))
    for error in (KeyboardInterrupt, ValueError):

        def stop(t: float, end: float, error: type[BaseException] = error) -> None:
            raise error

        with contextlib.suppress(ValueError):
            solve(system, **asked, progress=stop)
        assert _numbers(solve(system, **asked)) == expected


def test_14_3_a_waiting_run_does_not_hold_its_system() -> None:
    solve(OSCILLATOR, (1.0, 0.0), (0.0, 1.0))
    before = sys.getrefcount(OSCILLATOR)
    for _ in range(20):
        solve(OSCILLATOR, (1.0, 0.0), (0.0, 1.0))
    assert OSCILLATOR.runs
    assert sys.getrefcount(OSCILLATOR) == before
    assert pickle.loads(pickle.dumps(OSCILLATOR)).runs == {}  # noqa: S301


def test_14_3_batches_in_lanes_know_nothing_of_one_another() -> None:
    system, rng = hunting(), np.random.default_rng(4)
    starts = rng.uniform(-1.0, 1.0, (3, 40, 3))
    found = [solve_many(system, some, (0.0, 3.0)) for some in starts]
    kept = [(f.x.copy(), f.t.copy(), f.mode.copy(), f.counts.copy(), f.nfev.copy()) for f in found]
    for some, ensemble, numbers in zip(starts[::-1], found[::-1], kept[::-1], strict=True):
        again = solve_many(system, some, (0.0, 3.0))
        for one in (again, ensemble):
            now = one.x, one.t, one.mode, one.counts, one.nfev
            assert all(np.array_equal(*pair) for pair in zip(numbers, now, strict=True))
    # Threads share a batch that waits like any other.
    assert np.array_equal(solve_many(system, starts[0], (0.0, 3.0), threads=2, lanes=1).x, found[0].x)


def test_14_3_batches_of_any_size_share_the_scratch_of_lanes() -> None:
    system, rng = hunting(), np.random.default_rng(5)
    starts = rng.uniform(-1.0, 1.0, (200, 3))
    whole = solve_many(system, starts, (0.0, 3.0), threads=1)
    for count in (64, 150, 65, 200, 64):
        part = solve_many(system, starts[:count], (0.0, 3.0), threads=1)
        assert part.lanes > 1
        for one, other in ((part.x, whole.x), (part.mode, whole.mode), (part.counts, whole.counts)):
            assert np.array_equal(one, other[:count])


def test_14_3_small_batches_know_nothing_of_one_another() -> None:
    system, rng = hunting(), np.random.default_rng(3)
    section = Section.from_model(get("hunting"))
    turn = EventMap(system, section)
    d = rng.uniform(-0.3, 0.3, 60)
    at_once = turn(d)
    one_by_one = np.array([turn(value) for value in rng.permutation(d)])
    assert np.array_equal(np.sort(at_once), np.sort(one_by_one))
    assert np.array_equal([EventMap(system, section)(value) for value in d[:5]], at_once[:5])
    starts = rng.uniform(-1.0, 1.0, (6, 3))
    many = solve_many(system, starts, (0.0, 3.0))
    kept = many.x.copy(), many.t.copy(), many.mode.copy(), many.counts.copy(), many.nfev.copy()
    for start, x in zip(starts, many.x, strict=True):
        single = solve_many(system, [start], (0.0, 3.0))
        assert np.array_equal(single.x[0], x)
    now = many.x, many.t, many.mode, many.counts, many.nfev
    assert all(np.array_equal(*pair) for pair in zip(kept, now, strict=True))


@pytest.mark.parametrize("untouched", [True, False])
def test_14_3_what_is_made_when_asked_for_is_what_was_solved(untouched: bool) -> None:
    run = solve(OSCILLATOR, (1.0, 0.0), (0.0, 4.0))
    expected = _numbers(solve(OSCILLATOR, (1.0, 0.0), (0.0, 4.0)))
    if not untouched:
        assert run.sol is not None
    changed = solve(OSCILLATOR, (1.0, 0.0), (0.0, 4.0))
    read = pickle.loads(pickle.dumps(run))  # noqa: S301
    # What a user writes into the end state stays out of the rest.
    end = changed.x_end.copy()
    changed.x_end[:] = 17.0
    assert np.array_equal(changed.y[:, -1], end)
    assert _numbers(read) == _numbers(run) == expected
    with pytest.raises(AttributeError, match="no attribute 'message_'"):
        run.message_  # noqa: B018
    assert "_course" not in vars(run)


def test_14_3_options_that_were_checked_are_told_from_those_that_are_equal_to_them() -> None:
    for good, bad in ((1, True), (1.0, "1.0"), ((1.0, 1.0), (True, True))):
        name = {int: "max_steps", float: "max_step", tuple: "atol"}[type(good)]
        solve(OSCILLATOR, (1.0, 0.0), (0.0, 1.0), **{name: good})
        with pytest.raises(UsageError, match=f"{name} is"):
            solve(OSCILLATOR, (1.0, 0.0), (0.0, 1.0), **{name: bad})
    with pytest.raises(UsageError, match="stop holds"):
        solve(OSCILLATOR, (1.0, 0.0), (0.0, 1.0), stop=[["v"]])


def test_14_3_a_problem_made_again_is_one_made_anew() -> None:
    system = hunting()
    problem = Problem(system, (0.1, 0.05, 0.0), (0.0, 2.0), {"beta": 1.7})
    for changes in (
        {"parameters": {"P": 11}}, {"x0": [1, 2, 3]}, {"t_span": (1, 3)},
        {"t_span": (2, 0), "backward": True},
        {"x0": {"x": 1, "v": 0, "z": 2.5}, "parameters": {"m": 2.0, "beta": 2}}, {},
    ):  # fmt: skip
        old = {"x0": problem.x0, "t_span": problem.t_span, "parameters": dict(problem.parameters)}
        values = {**old, **changes, "parameters": old["parameters"] | changes.get("parameters", {})}
        made, anew = problem.remake(**changes), Problem(system, **values)
        for name in ("x0", "p"):
            assert np.array_equal(getattr(made, name), getattr(anew, name))
            assert not getattr(made, name).flags.writeable
        assert (made.t_span, made.parameters) == (anew.t_span, anew.parameters)
    for changes, said in (
        ({"x0": (1, np.nan, 0)}, "state 'v' is nan"), ({"x0": (1, 10**400, 0)}, "x0"),
        ({"t_span": (2, 0)}, "runs backwards"), ({"backward": True}, "runs forwards"),
        ({"parameters": {"P": np.nan}}, "'P' is nan"), ({"parameters": {"m": -1.0}}, "outside its bounds"),
        ({"parameters": {"Q": 1.0}}, "unknown parameter 'Q'"), ({"x0": (True, "0", 1)}, "x0"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            problem.remake(**changes)
