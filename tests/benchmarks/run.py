"""Speed and accuracy beside other solvers, side by side in one run: python tests/benchmarks/run.py

Medians over repeated runs; a ratio is the other solver's time over filippov's. Errors are the largest over all points
against filippov at rtol 1e-13.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

import peers  # noqa: E402

from filippov import solve  # noqa: E402
from filippov.analysis.event_map import EventMap  # noqa: E402
from filippov.analysis.section import Section  # noqa: E402
from filippov.models import get  # noqa: E402

COLD = """
import time; t0 = time.perf_counter()
from filippov import states, parameters, System, exp, sign, solve
x, v, z = states("x v z")
p = parameters(m=1, P=10, D=1, I=10, Fs=4, Fc=2, vs=0.1, beta=2, b=1)
u = p.P*(x + p.D*v + p.I*z)
g = p.Fc + (p.Fs - p.Fc)*exp(-(abs(v)/p.vs)**p.beta)
system = System({x: v, v: (-u - g*sign(v) - p.b*v)/p.m, z: x})
assert solve(system, x0=(0.1, 0, 0), t_span=(0, 20)).success
print(time.perf_counter() - t0)
"""


def median_time(function: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def row(name: str, ours: float, other: float, error: float, note: str = "") -> None:
    print(f"{name:<46} {other * 1e3:10.2f} ms  {other / ours:8.1f} x   error {error:.1e}  {note}")


def event_map(rounds: int) -> None:
    model = get("hunting")
    exact = EventMap(model.build(), Section.from_model(model), rtol=1e-13, atol=1e-15)
    ours = exact.remake(rtol=1e-10, atol=1e-12)
    d = np.linspace(0.001, 0.5, 500)
    truth = exact(d)
    times = {"ours": [], "scipy": [], "heyoka": []}
    sample = d[::10]
    caps = heyoka_cap(sample, truth[::10])
    for _ in range(rounds):
        times["ours"].append(median_time(lambda: ours(d), 9))
        times["scipy"].append(10 * median_time(lambda: peers.scipy_map(sample, 1e-10), 1))
        if caps is not None:
            times["heyoka"].append(median_time(lambda: caps(d), 5))
    own = statistics.median(times["ours"])
    print(f"event map, 500 points, rtol 1e-10: filippov {own * 1e3:.2f} ms, error {np.max(np.abs(ours(d) - truth)):.1e}")
    worst = float(np.max(np.abs(peers.scipy_map(sample, 1e-10) - truth[::10])))
    row("  scipy solve_ivp(DOP853), 50 points x 10", own, statistics.median(times["scipy"]), worst)
    if caps is not None:
        worst = float(np.max(np.abs(caps(d) - truth)))
        row("  heyoka, scalar, step capped", own, statistics.median(times["heyoka"]), worst, f"cap {caps.cap} s")


def heyoka_cap(d: np.ndarray, truth: np.ndarray) -> peers.HeyokaMap | None:
    """The largest of a few caps with which heyoka gets every point right."""
    try:
        for cap in (np.inf, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01):
            peer = peers.HeyokaMap(cap)
            worst = float(np.max(np.abs(peer(d) - truth)))
            if worst < 1e-8:
                return peer
            print(f"  heyoka with a step of at most {cap} s: error {worst:.1e}")
    except ImportError:
        print("  heyoka is not installed (pip install 'filippov[bench]')")
    return None


def response(rounds: int) -> None:
    system = get("hunting").build()
    run = {"rtol": 1e-10, "atol": 1e-12, "dense_output": False}
    truth = solve(system, (0.1, 0, 0), (0, 100), rtol=1e-13, atol=1e-15, dense_output=False).x_end
    ours, scipy = [], []
    for _ in range(rounds):
        ours.append(median_time(lambda: solve(system, (0.1, 0, 0), (0, 100), **run), 9))
        scipy.append(median_time(lambda: peers.scipy_response(100.0, 1e-10), 3))
    own = statistics.median(ours)
    error = float(np.max(np.abs(solve(system, (0.1, 0, 0), (0, 100), **run).x_end - truth)))
    print(f"response, 100 s, rtol 1e-10: filippov {own * 1e3:.2f} ms, error {error:.1e}")
    worst = float(np.max(np.abs(peers.scipy_response(100.0, 1e-10) - truth)))
    row("  scipy solve_ivp(DOP853), phase by phase", own, statistics.median(scipy), worst)


def first_solve() -> None:
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"FILIPPOV_CACHE": folder, "PYTHONPATH": str(Path(__file__).parents[2])}
        for name in ("cold", "warm", "warm"):
            out = subprocess.run([sys.executable, "-c", COLD], env=environment, capture_output=True, text=True, check=True)
            print(f"first solve of a new model in a fresh process, {name} cache: {float(out.stdout):.2f} s")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # every solver on one core
    event_map(count)
    response(count)
    first_solve()
