"""Speed and accuracy beside other solvers, side by side in one run: python tests/benchmarks/run.py

Processor time on one core, which other work on the machine lengthens less than the clock's; the best of
repeated runs, made in turn, and medians beside it. A ratio is the other solver's time over filippov's. Errors
are the largest over all points against filippov at rtol 1e-13. Two cores against one goes by the clock.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

import peers  # noqa: E402

from filippov import Problem, Solution, solve  # noqa: E402
from filippov.analysis.maps.event_map import EventMap  # noqa: E402
from filippov.analysis.maps.section import Section  # noqa: E402
from filippov.models import get  # noqa: E402
from filippov.solving.ensemble import solve_many  # noqa: E402

COLD = """
import time
from filippov import states, parameters, System, exp, sign, solve
x, v, z = states("x v z")
p = parameters(m=1, P=10, D=1, I=10, Fs=4, Fc=2, vs=0.1, beta=2, b=1)
u = p.P*(x + p.D*v + p.I*z)
g = p.Fc + (p.Fs - p.Fc)*exp(-(abs(v)/p.vs)**p.beta)
system = System({x: v, v: (-u - g*sign(v) - p.b*v)/p.m, z: x})
assert solve(system, x0=(0.1, 0, 0), t_span=(0, 20)).success
print(time.process_time())
"""


def times_of(
    function: Callable[[], object], repeats: int, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Seconds of each of so many calls."""
    times = []
    for _ in range(repeats):
        start = clock()
        function()
        times.append(clock() - start)
    return times


def row(name: str, ours: list[float], other: list[float], error: float, note: str = "") -> None:
    """The other solver's best time, its ratio to ours (best, and medians), its error."""
    best, middle = min(other) / min(ours), statistics.median(other) / statistics.median(ours)
    ratio = f"{best:8.2f} x (medians {middle:.2f})"
    print(f"{name:<54} {min(other) * 1e3:10.2f} ms  {ratio}   error {error:.1e}  {note}")


def event_map(rounds: int) -> None:
    model = get("hunting")
    exact = EventMap(model.build(), Section.from_model(model), rtol=1e-13, atol=1e-15)
    ours = exact.remake(rtol=1e-10, atol=1e-12)
    d = np.linspace(0.001, 0.5, 500)
    truth = exact(d)
    sample = d[::10]
    starts = ours.bound.start(d, ours.p)
    single = partial(
        solve_many, ours.system, starts, (0.0, ours.section.t_max), parameters=ours.parameters,
        stop=ours.section.stop, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    ways = {
        "one by one": partial(single, lanes=1),
        "by Taylor's method": partial(single, method="Taylor", lanes=16),
        "by Taylor's method one by one": partial(single, method="Taylor", lanes=1),
    }  # fmt: skip
    runs: dict[str, Callable[[], object]] = {"ours": lambda: ours(d), **ways}
    caps, batch = heyoka_cap(d, truth, peers.HeyokaMap), heyoka_cap(d, truth, peers.HeyokaBatch)
    if caps is not None and batch is not None:
        runs |= {"heyoka": lambda: caps(d), "batch": lambda: batch(d)}
    vmap = diffrax_map()
    if vmap is not None:
        vmap(d)
        runs["diffrax"] = lambda: vmap(d)
    times: dict[str, list[float]] = {name: [] for name in [*runs, "scipy"]}
    for _ in range(rounds):
        for name, run in runs.items():
            times[name] += times_of(run, 25)
        times["scipy"] += [10 * t for t in times_of(lambda: peers.scipy_map(sample, 1e-10), 1)]
    own = times["ours"]
    print(
        f"event map, 500 points, rtol 1e-10: filippov {min(own) * 1e3:.2f} ms "
        f"(median {statistics.median(own) * 1e3:.2f}), error {np.max(np.abs(ours(d) - truth)):.1e}"
    )
    for name, way in ways.items():
        worst = float(np.max(np.abs(way().x[:, ours.bound.index] - truth)))
        row(f"  the same {name}", own, times[name], worst)
    worst = float(np.max(np.abs(peers.scipy_map(d, 1e-10) - truth)))
    row("  scipy solve_ivp(DOP853), timed on 50 points x 10", own, times["scipy"], worst)
    titles = {"heyoka": "heyoka, scalar, step capped", "batch": "heyoka, batch of 8, step capped"}
    for name, peer in (("heyoka", caps), ("batch", batch)):
        if peer is not None:
            worst = float(np.max(np.abs(peer(d) - truth)))
            row(f"  {titles[name]}", own, times[name], worst, f"cap {peer.cap} s")
    if vmap is not None:
        worst = float(np.max(np.abs(vmap(d) - truth)))
        row("  diffrax Dopri8, vmap", own, times["diffrax"], worst)


def diffrax_map() -> peers.DiffraxMap | None:
    try:
        return peers.DiffraxMap(1e-10)
    except ImportError:
        print("  diffrax is not installed (pip install 'filippov[bench]')")
    return None


def heyoka_cap(d: np.ndarray, truth: np.ndarray, kind: type[Any]) -> Any:
    """The largest of a few caps with which heyoka gets every point right."""
    try:
        for cap in (np.inf, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01):
            peer = kind(cap)
            worst = float(np.max(np.abs(peer(d) - truth)))
            if worst < 1e-8:
                return peer
            print(f"  heyoka with a step of at most {cap} s: error {worst:.1e}")
    except ImportError:
        print("  heyoka is not installed (pip install 'filippov[bench]')")
    return None


def trajectories(rounds: int, cores: set[int]) -> None:
    """10,000 motions of 20 s from states drawn at random; scipy does 20 of them."""
    system, options = get("hunting").build(), {"rtol": 1e-8, "atol": 1e-11}
    x0 = np.random.default_rng(0).uniform(-0.5, 0.5, (10_000, 3))
    exact = solve_many(system, x0, (0, 20), rtol=1e-12, atol=1e-14, threads=1).x
    own: list[float] = []
    scipy: list[float] = []
    for _ in range(rounds):
        own += times_of(lambda: solve_many(system, x0, (0, 20), threads=1, **options), 3)
        begun = time.process_time()
        ends = np.array([peers.scipy_trajectory(x, 20.0, 1e-8) for x in x0[:20]])
        scipy.append(500 * (time.process_time() - begun))
    error = np.max(np.abs(solve_many(system, x0, (0, 20), threads=1, **options).x - exact))
    print(f"10,000 trajectories of 20 s, rtol 1e-8: filippov {min(own) * 1e3:.0f} ms, error {error:.1e}")
    single = partial(solve_many, system, x0, (0, 20), threads=1, lanes=1, **options)
    worst = float(np.max(np.abs(single().x - exact)))
    row("  the same one by one", own, times_of(single, 2), worst)
    theirs = float(np.max(np.abs(ends - exact[:20])))
    row("  scipy solve_ivp(DOP853), timed on 20 x 500", own, scipy, theirs)
    if len(cores) > 1:
        os.sched_setaffinity(0, cores)
        clocks: dict[int, list[float]] = {1: [], 2: []}
        for _ in range(rounds):
            for threads in clocks:
                run = partial(solve_many, system, x0, (0, 20), threads=threads, **options)
                clocks[threads] += times_of(run, 3, time.perf_counter)
        os.sched_setaffinity(0, {min(cores)})
        print(f"  two cores, by the clock: {min(clocks[1]) / min(clocks[2]):.2f} times one")


def response(rounds: int) -> None:
    system = get("hunting").build()

    def ours(method: str, rtol: float) -> Solution:
        options: dict[str, Any] = {"rtol": rtol, "atol": rtol * 1e-2, "dense_output": False}
        return solve(system, (0.1, 0, 0), (0, 100), method=method, **options)

    truth = ours("Taylor", 1e-13).x_end
    theirs = float(np.max(np.abs(peers.scipy_response(100.0, 1e-10) - truth)))
    for method in ("DOP853", "Taylor"):
        # One trajectory is one draw of the error: go on until it is no larger than the other solver's.
        for rtol in (1e-10, 7e-11, 5e-11, 3e-11, 2e-11, 1e-11):
            error = float(np.max(np.abs(ours(method, rtol).x_end - truth)))
            if error <= theirs:
                break
        own: list[float] = []
        scipy: list[float] = []
        for _ in range(rounds):
            own += times_of(partial(lambda method, rtol: ours(method, rtol).y, method, rtol), 15)
            scipy += times_of(lambda: peers.scipy_response(100.0, 1e-10), 3)
        least = min(own) * 1e3
        print(f"response, 100 s: filippov, {method}, {least:.2f} ms at rtol {rtol:g}, error {error:.1e}")
        row("  scipy solve_ivp(DOP853), phase by phase, rtol 1e-10", own, scipy, theirs)


def small_work() -> None:
    """What is done around the loop: the best of 20 times 200 calls."""
    model = get("hunting")
    system = model.build()
    turn, problem = EventMap(system, Section.from_model(model)), Problem(system, (0.1, 0.05, 0), (0, 1e-9))
    calls: dict[str, Callable[[], object]] = {
        "solve, a span of 1e-9, all arrays read": lambda: solve(problem).y,
        "solve, a span of 1e-9": lambda: solve(problem),
        "the same with parameters made again": lambda: solve(problem.remake(parameters={"beta": 1.9})),
        "problem.remake": lambda: problem.remake(parameters={"beta": 1.9}),
        "event map, one point, its turn included": lambda: turn(0.1),
    }
    for name, call in calls.items():
        best = min(times_of(lambda call=call: [call() for _ in range(200)], 20)) / 200
        print(f"{name:<54} {best * 1e6:10.1f} us")


def first_solve() -> None:
    # As users have it: the modules' own byte code is there.
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    for caches in (("made",), ("cold", "warm", "warm")):
        with tempfile.TemporaryDirectory() as folder:
            for name in caches:
                out = subprocess.run(
                    [sys.executable, "-c", COLD], env=environment | {"FILIPPOV_CACHE": folder},
                    capture_output=True, text=True, check=True,
                )  # fmt: skip
                if name != "made":
                    spent = f"{float(out.stdout):.2f} s of processor time"
                    print(f"first solve of a new model in a fresh process, {name} cache: {spent}")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    everything: set[int] = set()
    if hasattr(os, "sched_setaffinity"):
        everything = set(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {min(everything)})  # every solver on one core
    event_map(count)
    trajectories(count, everything)
    response(count)
    small_work()
    first_solve()
