"""Processor time of two checkouts in turn: python tests/benchmarks/before_after.py BEFORE AFTER [REPEATS]

The hunting loop: a process with its first solve (code cached, and with nothing cached), a response of 100 s
at rtol 1e-10, an event map of 500 points, 1,000 trajectories of 20 s at rtol 1e-8 on one core. Milliseconds,
the least of all processes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

NAMES = ("first solve", "response", "event map", "trajectories", "first solve, nothing cached")
WORK = """if True:
    import sys, time
    begun = time.process_time()
    import numpy as np
    from filippov import solve, solve_many
    from filippov.models import get
    model = get("hunting")
    system = model.build()
    solve(system, model.x0, (0, 20))
    times = [time.process_time() - begun]

    def least(work, count=9):
        for k in range(count + 1):
            start = time.process_time()
            work()
            spent = time.process_time() - start
            best = min(best, spent) if k > 1 else spent
        times.append(best)

    if len(sys.argv) == 1:
        try:
            from filippov.analysis import EventMap, Section
        except ImportError:  # before the rooms
            from filippov.analysis.event_map import EventMap
            from filippov.analysis.section import Section
        once, d = EventMap(system, Section.from_model(model)), np.linspace(0.05, 1, 500)
        starts = np.array(model.x0) * np.linspace(0.2, 1.5, 1000)[:, None]
        least(lambda: solve(system, model.x0, (0, 100), rtol=1e-10, atol=1e-12))
        least(lambda: once(d))
        least(lambda: solve_many(system, starts, (0, 20), rtol=1e-8, threads=1), 5)
    print(*times)
"""


def measured(tree: Path) -> list[float]:
    """Milliseconds of one process, and of one with nothing cached."""
    with tempfile.TemporaryDirectory() as empty:
        out = []
        for given, cache in (((), None), (("cold",), empty)):
            environment = {**os.environ, "PYTHONPATH": str(tree)}
            if cache:
                environment["FILIPPOV_CACHE"] = cache
            command = [sys.executable, "-c", WORK, *given]
            done = subprocess.run(
                command, env=environment, cwd=empty, capture_output=True, text=True, check=True
            )
            out += [1e3 * float(word) for word in done.stdout.split()]
    return out


def main(before: Path, after: Path, repeats: int) -> None:
    runs: dict[Path, list[list[float]]] = {before: [], after: []}
    for _ in range(repeats):
        for tree, rows in runs.items():
            rows.append(measured(tree))
    old, new = ([min(column) for column in zip(*runs[tree], strict=True)] for tree in (before, after))
    for name, a, b in zip(NAMES, old, new, strict=True):
        print(f"{name:<28}{a:>10.2f}{b:>10.2f}{b / a:>8.3f}")


if __name__ == "__main__":
    folders = [Path(folder).resolve() for folder in sys.argv[1:3]]
    main(folders[0], folders[1], int(sys.argv[3]) if len(sys.argv) > 3 else 5)
