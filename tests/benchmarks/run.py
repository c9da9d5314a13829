"""Speed and accuracy beside other solvers, side by side in one run: python tests/benchmarks/run.py

Medians over repeated runs; a ratio is the other solver's time over filippov's. Errors are the largest over
all points against filippov at rtol 1e-13.
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

from filippov import Solution, solve  # noqa: E402
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
    print(f"{name:<54} {other * 1e3:10.2f} ms  {other / ours:8.1f} x   error {error:.1e}  {note}")


def event_map(rounds: int) -> None:
    model = get("hunting")
    exact = EventMap(model.build(), Section.from_model(model), rtol=1e-13, atol=1e-15)
    ours = exact.remake(rtol=1e-10, atol=1e-12)
    d = np.linspace(0.001, 0.5, 500)
    truth = exact(d)
    times = {"ours": [], "scipy": [], "heyoka": []}
    sample = d[::10]
    caps = heyoka_cap(d, truth)
    for _ in range(rounds):
        times["ours"].append(median_time(lambda: ours(d), 9))
        times["scipy"].append(10 * median_time(lambda: peers.scipy_map(sample, 1e-10), 1))
        if caps is not None:
            times["heyoka"].append(median_time(lambda: caps(d), 5))
    own = statistics.median(times["ours"])
    print(
        f"event map, 500 points, rtol 1e-10: filippov {own * 1e3:.2f} ms, "
        f"error {np.max(np.abs(ours(d) - truth)):.1e}"
    )
    worst = float(np.max(np.abs(peers.scipy_map(d, 1e-10) - truth)))
    row("  scipy solve_ivp(DOP853), timed on 50 points x 10", own, statistics.median(times["scipy"]), worst)
    if caps is not None:
        worst = float(np.max(np.abs(caps(d) - truth)))
        row(
            "  heyoka, scalar, step capped",
            own,
            statistics.median(times["heyoka"]),
            worst,
            f"cap {caps.cap} s",
        )


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

    def ours(rtol: float) -> Solution:
        return solve(system, (0.1, 0, 0), (0, 100), rtol=rtol, atol=rtol * 1e-2, dense_output=False)

    truth = ours(1e-13).x_end
    theirs = float(np.max(np.abs(peers.scipy_response(100.0, 1e-10) - truth)))
    # One trajectory is one draw of the error: go on until it is no larger than the other solver's.
    for rtol in (1e-10, 7e-11, 5e-11, 3e-11, 2e-11, 1e-11):
        error = float(np.max(np.abs(ours(rtol).x_end - truth)))
        if error <= theirs:
            break
    own, scipy = [], []
    for _ in range(rounds):
        own.append(median_time(lambda: ours(rtol), 15))
        scipy.append(median_time(lambda: peers.scipy_response(100.0, 1e-10), 3))
    mine = statistics.median(own)
    print(f"response, 100 s: filippov {mine * 1e3:.2f} ms at rtol {rtol:g}, error {error:.1e}")
    row("  scipy solve_ivp(DOP853), phase by phase, rtol 1e-10", mine, statistics.median(scipy), theirs)


def first_solve() -> None:
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"FILIPPOV_CACHE": folder, "PYTHONPATH": str(Path(__file__).parents[2])}
        for name in ("cold", "warm", "warm"):
            out = subprocess.run(
                [sys.executable, "-c", COLD], env=environment, capture_output=True, text=True, check=True
            )
            print(f"first solve of a new model in a fresh process, {name} cache: {float(out.stdout):.2f} s")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # every solver on one core
    event_map(count)
    response(count)
    first_solve()
