"""What a sweep costs beside the bare computing: python tests/benchmarks/sweep.py [POINTS]

The same short points through `solve_many` in this process and through a Sweep with worker processes, its
files written and read back, in turns: a single pair says little on a machine that others use. Wall time, and
processor time of all processes.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from filippov import Problem, Sweep  # noqa: E402
from filippov.models import get  # noqa: E402
from filippov.solving.ensemble import solve_many  # noqa: E402
from filippov.sweep.point import split  # noqa: E402

SPAN = (0.0, 100.0)
PAIRS = 5


def timed(work: Callable[[], Any]) -> tuple[float, float, Any]:
    """Wall seconds, processor seconds with those of ended children, and the result."""
    wall, before = time.perf_counter(), os.times()
    result = work()
    after = os.times()
    return time.perf_counter() - wall, sum(after[:4]) - sum(before[:4]), result


def main(points: int) -> None:
    """Print a line for each pair of runs, and the medians."""
    model = get("hunting")
    vary = {"P": (10.0, 30.0), "x0.x": (-0.3, 0.3)}
    sweep = Sweep(Problem(model.build(), model.x0, SPAN), vary, "sobol", n=points, measure=["end", "events"])
    x0, values = split(sweep.plan, np.arange(points))  # compiles, so that no way below pays for it

    def bare(jobs: int) -> Any:
        return solve_many(sweep.system, x0, SPAN, parameters=values, threads=jobs, lanes=sweep.lanes)

    def swept(jobs: int) -> Any:
        with tempfile.TemporaryDirectory() as folder:
            return sweep.run(folder, jobs=jobs)

    for jobs in (1, 2):
        over = []
        for _ in range(PAIRS):
            wall, processor, ends = timed(lambda jobs=jobs: bare(jobs))
            wall_swept, processor_swept, table = timed(lambda jobs=jobs: swept(jobs))
            over.append((100 * (wall_swept / wall - 1), 100 * (processor_swept / processor - 1)))
            same = np.max(np.abs(table.values[:, : ends.x.shape[1]] - ends.x))
            print(
                f"{jobs} at work: solve_many {wall:.2f} s, Sweep {wall_swept:.2f} s ({over[-1][0]:+.1f} %); "
                f"of processors {processor:6.2f} s, {processor_swept:6.2f} s ({over[-1][1]:+.1f} %); "
                f"largest difference {same:.1e}",
                flush=True,
            )
        wall, processor = np.median(over, axis=0)
        print(f"{jobs} at work: a Sweep costs {wall:+.1f} % by the clock, {processor:+.1f} % of processors")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
