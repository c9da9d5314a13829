"""What a sweep costs beside the bare computing: python tests/benchmarks/sweep.py [POINTS]

The same short points through `solve_many` in this process and through a Sweep with worker processes, its
files written and read back. Wall time, and processor time of all processes, which other work on the machine
does not lengthen.
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
from filippov.ensemble import solve_many  # noqa: E402
from filippov.models import get  # noqa: E402
from filippov.sweep.point import split  # noqa: E402

SPAN = (0.0, 100.0)


def timed(work: Callable[[], Any]) -> tuple[float, float, Any]:
    """Wall seconds, processor seconds with those of ended children, and the result."""
    wall, before = time.perf_counter(), os.times()
    result = work()
    after = os.times()
    return time.perf_counter() - wall, sum(after[:4]) - sum(before[:4]), result


def main(points: int) -> None:
    """Print one line for each way."""
    model = get("hunting")
    vary = {"P": (10.0, 30.0), "x0.x": (-0.3, 0.3)}
    sweep = Sweep(Problem(model.build(), model.x0, SPAN), vary, "sobol", n=points, measure=["end", "events"])
    x0, values = split(sweep.plan, np.arange(points))  # compiles, so that no way below pays for it
    rows: dict[str, tuple[float, float]] = {}
    for jobs in (1, 2):
        wall, processor, ends = timed(
            lambda jobs=jobs: solve_many(
                sweep.system, x0, SPAN, parameters=values, threads=jobs, lanes=sweep.lanes
            )
        )
        print(f"solve_many, threads={jobs}: {wall:7.2f} s wall, {processor:7.2f} s processor")
        rows["bare"] = wall, processor
        with tempfile.TemporaryDirectory() as folder:
            wall, processor, table = timed(lambda jobs=jobs: sweep.run(folder, jobs=jobs))
        same = np.max(np.abs(table.values[:, : ends.x.shape[1]] - ends.x))
        over = [100 * (spent / bare - 1) for spent, bare in zip((wall, processor), rows["bare"], strict=True)]
        print(
            f"Sweep,      jobs={jobs}:    {wall:7.2f} s wall, {processor:7.2f} s processor; over bare "
            f"{over[0]:+.1f} % wall, {over[1]:+.1f} % processor; largest difference {same:.1e}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
