"""Corners of two surfaces in the compiled loop: the modes that the enumeration finds, in every backend."""

from __future__ import annotations

import numpy as np
import pytest

from filippov import Surface, System, parameters, sign, solve, solve_many, states
from filippov.kernel.loop.event_cycle import cycle_limit
from filippov.models import get
from filippov.solving import loop
from filippov.solving.selection.ambiguity import ambiguity_at, point_of
from filippov.solving.selection.modes import successors
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options
from filippov.solving.state.run import Run

NAMES = tuple(f"a{i}" for i in range(27))
LINEAR = [4, 5, 6, 13, 14, 15, 22, 23, 24]


def bilinear() -> System:
    """Three states, two surfaces, every rate a product of signs and states with any coefficients."""
    x, y, z = states("x y z")
    p = parameters(**dict.fromkeys(NAMES, 0.0))
    a = [getattr(p, name) for name in NAMES]
    s, r = sign(x - 0.3 * z), sign(y + 0.2 * z)

    def rate(k: int) -> object:
        b = a[9 * k : 9 * k + 9]
        return b[0] + b[1] * s + b[2] * r + b[3] * s * r + b[4] * x + b[5] * y + b[6] * z + b[7] * z * s

    surfaces = [Surface("X", x - 0.3 * z), Surface("Y", y + 0.2 * z)]
    return System({x: rate(0), y: rate(1), z: rate(2)}, surfaces=surfaces, parameters=p)  # type: ignore[dict-item]


def members(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients, and starts; every third pulls onto both surfaces."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((count, len(NAMES)))
    values[:, LINEAR] *= 0.3
    values[::3, 1] = -np.abs(values[::3, 1]) - 1.0
    values[::3, 11] = -np.abs(values[::3, 11]) - 1.0
    return values, rng.standard_normal((count, 3))


SYSTEM = bilinear()
SPAN = (0.0, 6.0)


def test_14_1_corners_are_decided_as_the_enumeration_of_all_modes_decides() -> None:
    seen = dict.fromkeys(("both", "one", "none"), 0)
    for values, x0 in zip(*members(120, 1), strict=True):
        named = dict(zip(NAMES, values.tolist(), strict=True))
        run = solve(SYSTEM, x0, SPAN, parameters=named, max_events=100)
        machine = Machine(SYSTEM, "DOP853", values)
        groups: dict[int, list[int]] = {}
        for event in run.events:
            groups.setdefault(event.group, []).append(event.index)
        first = {event.group: event for event in reversed(run.events)}
        for group, event in first.items():
            reached = [i for i in groups[group] if event.before[i] != 0]
            if event.before.count(0) != 1 or not reached:
                continue  # off the surfaces, or a multiplier at the end of its set
            at = Run(machine, event.x, (event.t, SPAN[1] + 1.0), Options())
            at.put(event.before, (0, 0), (0.0, 0.0))
            found = successors(point_of(at), event.before, [0, 1], reached)
            assert [c.mode for c in found] == [event.after]
            slid = [c for c in found[0].multipliers if c != 0.0]
            told = [e.multiplier for e in run.events if e.group == group and e.after[e.index] == 0]
            assert all(min(abs(m - c) for c in slid) < 1e-9 for m in told)
            seen[("none", "one", "both")[event.after.count(0)]] += 1
    assert min(seen.values()) >= 3, seen


def test_14_1_rows_of_a_batch_end_as_single_runs_do_in_lanes_too() -> None:
    values, starts = members(130, 2)
    named = dict(zip(NAMES, values.T, strict=True))
    plain, wide = (
        solve_many(SYSTEM, starts, SPAN, parameters=named, lanes=lanes, max_events=100) for lanes in (1, 8)
    )
    assert plain.status == wide.status
    assert np.array_equal(plain.mode, wide.mode)
    assert np.array_equal(plain.counts, wide.counts)
    assert np.max(np.abs(plain.x - wide.x) / (1.0 + np.abs(plain.x))) < 1e-10
    for q in range(0, 130, 6):
        own = dict(zip(NAMES, values[q].tolist(), strict=True))
        one = solve(SYSTEM, starts[q], SPAN, parameters=own, max_events=100)
        assert (one.status, one.end_mode) == (plain.status[q], tuple(plain.mode[q].tolist()))
        assert np.max(np.abs(one.x_end - plain.x[q])) < 1e-8 * (1.0 + np.max(np.abs(one.x_end)))


def test_14_1_a_slide_on_a_corner_stays_the_only_motion_as_long_as_the_loop_goes_on() -> None:
    pairs = 0
    for values, x0 in zip(*members(40, 3), strict=True):
        named = dict(zip(NAMES, values.tolist(), strict=True))
        run = solve(SYSTEM, x0, SPAN, parameters=named, max_events=100)
        for k, event in enumerate(run.events):
            if event.after != (0, 0) or "one of" in event.note:
                continue
            end = run.events[k + 1].t if k + 1 < len(run.events) else run.t_end
            for t in np.linspace(event.t, end, 5)[1:-1]:
                lam = np.array([run.multiplier(name, t) for name in ("X", "Y")])
                there = ambiguity_at(run.problem, Options(), t, run.sol(t), (0, 0), lam)
                assert there is None
            pairs += 1
    assert pairs >= 5


def test_14_1_two_genes_are_caught_without_the_general_path(monkeypatch: pytest.MonkeyPatch) -> None:
    def entered(*_: object) -> None:
        raise AssertionError("the general path was entered")

    monkeypatch.setattr(loop._Loop, "_general", entered)
    model = get("two_gene")
    run = solve(model.build(), model.x0, model.t_span)
    assert run.success
    assert (run.end_mode.count(0), len(run.events)) == (2, 3)


@pytest.mark.parametrize("cycle", [1, 2, 3])
@pytest.mark.parametrize("ratio", [0.3, 0.7, 0.95])
def test_14_1_geometric_cycles_have_the_limit_of_their_series(cycle: int, ratio: float) -> None:
    rng = np.random.default_rng(cycle)
    parts = rng.uniform(0.5, 1.5, cycle)
    lengths = np.array([parts[n % cycle] * ratio ** (n // cycle) for n in range(12 * cycle)])
    times, out = 2.0 + np.cumsum(lengths), np.zeros(10)
    limit = 2.0 + float(np.sum(parts)) / (1.0 - ratio)
    assert cycle_limit(times, len(times), len(times), 1.0, 0.0, 1e-12, out) == 1
    assert abs(out[0] - limit) <= out[1] < 1e-6
    assert abs(out[2] - ratio) < 1e-9
    # Time may run backwards, from another origin.
    assert cycle_limit(-times, len(times), len(times), -1.0, 0.0, 1e-12, out) == 1
    assert abs(out[0] + limit) <= out[1]


@pytest.mark.parametrize(
    "lengths", [np.ones(30), np.arange(1.0, 31.0), 1.0 + 0.5 ** np.arange(60.0), 0.5 ** np.arange(3.0)]
)
def test_14_1_cycles_that_do_not_shrink_by_a_law_have_no_limit(lengths: np.ndarray) -> None:
    times = np.cumsum(lengths)
    assert cycle_limit(times, len(times), len(times), 1.0, 0.0, 1e-12, np.zeros(10)) == 0
