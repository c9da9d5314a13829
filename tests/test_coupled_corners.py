"""Corners of many surfaces and of wider sets in the compiled loop: friction between neighbours."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, lsq_linear

from filippov import Surface, System, parameters, sign, solve, solve_many, states, t
from filippov.kernel.loop import coupled_corner
from filippov.solving import loop
from filippov.solving.selection import attraction
from filippov.solving.selection.ambiguity import point_of
from filippov.solving.selection.modes import successors
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options
from filippov.solving.state.run import Run

K, N = 5, 5
RATES = tuple(f"r{i}{j}" for i in range(K) for j in range(N))
EFFECTS = tuple(f"b{j}{i}" for j in range(N) for i in range(K))
FORCES = tuple(f"{name}{j}" for name in ("a", "w", "q") for j in range(N))
ENDS = tuple(f"e{i}" for i in range(K))
SPAN = (0.0, 6.0)


def affine() -> System:
    """Five states, five planes with any gradients, fields affine in their signs, sets of any width."""
    x = states(" ".join(f"x{j}" for j in range(N)))
    p = parameters(**dict.fromkeys((*RATES, *EFFECTS, *FORCES), 0.0), **dict.fromkeys(ENDS, 1.0))
    h = [sum(getattr(p, f"r{i}{j}") * x[j] for j in range(N)) for i in range(K)]
    field = {
        x[j]: getattr(p, f"a{j}") * sp.cos(getattr(p, f"w{j}") * t + getattr(p, f"q{j}"))
        - x[j]
        + 0.5 * x[(j + 1) % N]
        + sum(getattr(p, f"b{j}{i}") * sign(h[i]) for i in range(K))
        for j in range(N)
    }
    surfaces = [Surface(f"h{i}", h[i], radius=getattr(p, f"e{i}")) for i in range(K)]
    return System(field, surfaces=surfaces, parameters=p)


def member(seed: int) -> dict[str, float]:
    """Friction, near it, rotating or any effects on some of the surfaces; wider sets for a third."""
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(K, N))
    kind, count = seed % 4, int(rng.integers(2, K + 3))
    if kind == 0:
        root = rng.normal(size=(N, N))
        B = -(root @ root.T / N + 0.3 * np.eye(N)) @ G.T @ np.diag(rng.uniform(0.5, 3.0, K))
    elif kind == 1:
        B = -np.linalg.pinv(G) @ (np.eye(K) + 0.3 * rng.normal(size=(K, K))) @ np.diag(rng.uniform(0.3, 2, K))
    elif kind == 2:
        S = rng.normal(size=(K, K))
        B = -np.linalg.pinv(G) @ (np.diag(rng.uniform(0.3, 1.5, K)) + S - S.T)
    else:
        B = rng.normal(size=(N, K)) - 0.5 * G.T
    B[:, count:] = 0.0
    wide = rng.uniform(1.1, 2.0, K) if seed % 3 == 0 else np.ones(K)
    values = dict(zip(RATES, G.ravel().tolist(), strict=True))
    values |= dict(zip(EFFECTS, B.ravel().tolist(), strict=True))
    forces = np.concatenate([2 * rng.normal(size=N), rng.uniform(0.5, 3, N), rng.uniform(0, 6, N)])
    values |= dict(zip(FORCES, forces.tolist(), strict=True))
    return values | dict(zip(ENDS, wide.tolist(), strict=True))


def test_14_1_corners_of_many_surfaces_are_decided_as_the_enumeration_decides() -> None:
    system, seen = affine(), dict.fromkeys(range(2, K + 1), 0)
    for seed in range(80):
        named = member(seed)
        x0 = np.random.default_rng(seed).normal(size=N)
        run = solve(system, x0, SPAN, parameters=named, max_events=80)
        machine = Machine(system, "DOP853", np.array([named[name] for name in system.parameters]))
        groups: dict[int, list[int]] = {}
        for event in run.events:
            groups.setdefault(event.group, []).append(event.index)
        for event in {event.group: event for event in reversed(run.events)}.values():
            slid = [i for i, s in enumerate(event.before) if s == 0]
            arrived = [i for i in groups[event.group] if event.before[i] != 0]
            if len(arrived) != 1 or not slid or "one of" in event.note:
                continue
            at = Run(machine, event.x, (event.t, SPAN[1] + 1.0), Options())
            at.put(event.before, (0,) * K, (0.0,) * K)
            found = successors(point_of(at), event.before, [*slid, *arrived], arrived)
            assert [c.mode for c in found] == [event.after], (seed, event)
            told = {e.index: e.multiplier for e in run.events if e.group == event.group}
            for i, value in enumerate(found[0].multipliers):
                assert event.after[i] != 0 or i not in told or abs(told[i] - value) < 1e-9
            seen[len(slid) + 1] += 1
    assert min(seen.values()) >= 5, seen


@pytest.mark.parametrize("seed", range(40))
def test_14_1_what_tells_one_solution_is_the_same_rule_in_the_loop_and_beside_it(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    k = int(rng.integers(2, 7))
    monkeypatch.setattr(coupled_corner, "SIDE", k)
    root, scale = rng.normal(size=(k, k)), rng.uniform(0.1, 10.0, k)
    matrix = [
        (root @ root.T + 0.1 * np.eye(k)) / scale,
        (k * np.eye(k) + root) * scale[:, None],
        np.eye(k) + root - root.T,
        np.eye(k) + 0.5 * root,
    ][seed % 4]
    w: Any = SimpleNamespace(
        coupling=-matrix.ravel(), mat=np.zeros(k * k), vec=np.zeros(k), slope=np.zeros(k),
    )  # fmt: skip
    rows = attraction._in_rows(matrix)
    assert coupled_corner.like_friction(k, w) == attraction._friction(rows)
    assert coupled_corner.dominant(k, w) == attraction._dominant(rows)
    assert coupled_corner.minors_positive(k, w) == attraction._minors_positive(rows)
    # Where the first two tell, all minors are positive.
    told = attraction._friction(rows) or attraction._dominant(rows)
    assert attraction._minors_positive(rows) or not told


def line(n: int, radius: float = 1.0, seed: int = 1) -> tuple[System, np.ndarray, np.ndarray]:
    """Bodies on springs, driven, with friction between neighbours: system, start, friction forces."""
    rng = np.random.default_rng(seed)
    x, v = (states(" ".join(f"{name}{i}" for i in range(n))) for name in "xv")
    force = np.round(rng.uniform(0.8, 1.6, n - 1), 6)
    field: dict[Any, Any] = dict(zip(x, v, strict=True))
    slip = [v[i + 1] - v[i] for i in range(n - 1)]
    for i in range(n):
        field[v[i]] = -x[i] + 3 * sp.cos(0.7 * t + i)
        if i > 0:
            field[v[i]] += x[i - 1] - x[i] - force[i - 1] * sign(slip[i - 1])
        if i < n - 1:
            field[v[i]] += x[i + 1] - x[i] + force[i] * sign(slip[i])
    surfaces = [Surface(f"slip{i}", h, radius=radius) for i, h in enumerate(slip)]
    return System(field, surfaces=surfaces), rng.normal(size=2 * n), force


def bounded_friction(
    x: np.ndarray, at: float, force: np.ndarray, radius: float, slid: list[int]
) -> np.ndarray:
    """Signs of the contacts that stick, as a bounded least squares problem.

    With h' = r + C s and C D symmetric, s minimises |L^-1 h'|, C D = -L L', in its box (Gauss's principle of
    least constraint).
    """
    n = len(x) // 2
    q, v = x[:n], x[n:]
    G = np.diff(np.eye(n), axis=0)
    free = -q + 3 * np.cos(0.7 * at + np.arange(n))
    free[1:] += q[:-1] - q[1:]
    free[:-1] += q[1:] - q[:-1]
    signs = np.sign(G @ v)
    signs[slid] = 0.0
    free -= G.T @ (force * signs)
    rows, root = G[slid], np.linalg.cholesky(G[slid] @ G[slid].T)
    most = radius * force[slid]
    found = lsq_linear(root.T, np.linalg.solve(root, rows @ free), (-most, most))
    return np.asarray(found.x / force[slid])


@pytest.mark.parametrize(("n", "radius"), [(12, 1.0), (5, 1.4), (12, 1.4)])
def test_14_1_friction_between_neighbours_is_that_of_least_constraint(
    n: int, radius: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def entered(*_: object) -> None:
        raise AssertionError("the general path was entered")

    system, x0, force = line(n, radius)
    monkeypatch.setattr(loop._Loop, "_general", entered)
    run = solve(system, x0, (0, 10))
    assert run.success
    assert len(run.events) > n
    most, checked = 0, 0
    for segment in run.segments:
        slid = [i for i, s in enumerate(segment.mode) if s == 0]
        for at in np.linspace(segment.t0, segment.t1, 5)[1:-1] if slid else ():
            expected = bounded_friction(run.sol(at), at, force, radius, slid)
            told = [run.multiplier(f"slip{i}", at) for i in slid]
            assert np.max(np.abs(told - expected)) < 1e-7
            checked += 1
        most = max(most, len(slid))
    assert most >= 3
    assert checked > 30


def test_14_1_lanes_and_the_loop_in_python_agree_on_friction_between_neighbours() -> None:
    for radius in (1.0, 1.4):
        system, x0, _ = line(6, radius)
        starts = x0 + 0.3 * np.random.default_rng(0).normal(size=(24, 12))
        ends = solve_many(system, starts, (0, 8), lanes=8)
        runs = [solve(system, start, (0, 8)) for start in starts]
        assert ends.success.all()
        assert all(np.max(np.abs(run.x_end - end)) < 1e-9 for run, end in zip(runs, ends.x, strict=True))
        plain = solve(system, starts[0], (0, 2), backend="python")
        same = [e.t for e in runs[0].events if e.t < 2]
        assert len(same) > 2
        assert np.max(np.abs(np.array(same) - [e.t for e in plain.events])) < 1e-12


def test_u4_what_nothing_has_triggered_sticks_on() -> None:
    """Three bodies pulled by t at the last: at t = 2.1 its contact breaks away, the other could as well.

    Before, all move with t/3; the contacts carry 2t/3 of 1.4 and t/3 of 1.4 * 0.7/1.2. After it the last body
    has t - 1, the others 1/2 each; that the other contact slips instead satisfies the inclusion too.
    """
    x = states("v1 v2 v3")
    first, last = sign(x[1] - x[0]), sign(x[2] - x[1])
    weak = 0.7 / 1.2
    field = {x[0]: weak * first, x[1]: last - weak * first, x[2]: t - last}
    surfaces = [Surface("first", x[1] - x[0], radius=1.4), Surface("last", x[2] - x[1], radius=1.4)]
    run = solve(System(field, surfaces=surfaces), (0, 0, 0), (0, 2.5))
    assert run.success
    (event,) = [e for e in run.events if e.t > 0]
    assert (event.surface, event.after) == ("last", (0, 1))
    assert abs(event.t - 2.1) < 1e-12
    pulled = 2.1**2 / 6 + (2.5**2 - 2.1**2) / 2 - 0.4
    assert np.max(np.abs(run.x_end - [2.1**2 / 6 + 0.2, 2.1**2 / 6 + 0.2, pulled])) < 1e-12
    both = solve(System(field, surfaces=surfaces), (0, 0, 0), (0, 2.5), backend="python")
    assert np.max(np.abs(both.x_end - run.x_end)) < 1e-12


@pytest.mark.parametrize("seed", [5, 19, 90, 115, 138, 146])
def test_14_1_the_enumeration_finds_what_breaks_away_where_all_stands_still(seed: int) -> None:
    """Three planes that hold the state at 0, their forces 1.2: one leaves, long before the run ends."""
    rng = np.random.default_rng(seed)
    x, root = states("x1 x2 x3"), rng.normal(size=(3, 3))
    mass = root @ root.T / 3 + 0.3 * np.eye(3)
    A, phase = rng.normal(size=(3, 3)) - 2 * np.eye(3), rng.uniform(0, 6, 3)
    size, pace = rng.uniform(1.3, 2.0, 3), rng.uniform(0.5, 3.0, 3)
    G = rng.normal(size=(3, 3))
    h = [sum(float(G[i, j]) * x[j] for j in range(3)) for i in range(3)]
    push = [float(size[j]) * sp.cos(float(pace[j]) * t + float(phase[j])) - sign(h[j]) for j in range(3)]
    force = mass @ G.T
    field = {
        x[i]: sum(float(A[i, j]) * x[j] + float(force[i, j]) * push[j] for j in range(3)) for i in range(3)
    }
    system = System(field, surfaces=[Surface(f"h{j}", h[j], radius=1.2) for j in range(3)])

    def excess(at: float) -> np.ndarray:
        return np.asarray(np.abs(size * np.cos(pace * at + phase)) - 1.2)

    grid = np.linspace(0, 8, 8001)
    rises = np.array([np.maximum(excess(a), -1e-9) < 0 for a in grid])
    first, leave = -1, np.inf
    for j in range(3):
        found = np.flatnonzero(rises[:-1, j] & ~rises[1:, j])
        if len(found):
            at = brentq(lambda u, j=j: excess(u)[j], grid[found[0]], grid[found[0] + 1], xtol=1e-15)
            first, leave = (j, at) if at < leave else (first, leave)
    run = Run(Machine(system, "DOP853", np.zeros(0)), np.zeros(3), (leave, 8.0), Options())
    run.put((0, 0, 0), (0,) * 3, (0.0,) * 3)
    modes = [c.mode for c in successors(point_of(run), (0, 0, 0), [0, 1, 2], [first])]
    assert len(modes) >= 1
    # Off its surface, to the side of its force, and consistent with the rates at signs that are written out.
    for mode in modes:
        free = [j for j in range(3) if mode[j] != 0]
        slid = [j for j in range(3) if mode[j] == 0]
        C, r = -G @ force, G @ force @ (size * np.cos(pace * leave + phase))
        s = np.array(mode, dtype=float)
        if slid:
            s[slid] = np.linalg.solve(C[np.ix_(slid, slid)], -(r + C[:, free] @ s[free])[slid])
        rates = r + C @ s
        assert np.all(np.abs(s[slid]) < 1.2)
        assert np.all(rates[free] * s[free] > 0)
