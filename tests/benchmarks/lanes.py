"""Every registered model one by one and in lanes, 200 starts: python tests/benchmarks/lanes.py [name ...]

Processor time of one core, units compiled before, the least of a few calls. `solve` is called anew for some
of the starts, without dense output; the plain compiled loop (lanes=1) and lanes take all of them. "left":
trajectories that Python decides, which cost what a `solve` does; the error is the largest difference of lanes
from `solve` over the largest value of a state.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from filippov import Problem, solve, solve_many
from filippov.models import get, names
from filippov.solving import ensemble

COUNT, SINGLE, SPREAD = 200, 25, 1e-2
OPTIONS: dict[str, Any] = {"zeno": "continue", "nonunique": "stick"}
# Models whose own span ends before their events accumulate, once more up to a time after that.
SETTLED = {"bouncing_ball": 4.0, "twisting": 20.0, "fuller": 4.0, "differentiator": 4.0}


def least(call: Callable[[], Any], most: float = 0.4, calls: int = 5) -> float:
    """Least processor time of a call [s], within a time for all."""
    times: list[float] = []
    while len(times) < calls and sum(times) < most:
        begun = time.process_time()
        call()
        times.append(time.process_time() - begun)
    return min(times)


def starts_of(problem: Problem) -> np.ndarray:
    """Starts off a model's own by up to a hundredth of what each state reaches, the same in every run."""
    run = solve(problem, **OPTIONS)
    size = np.max(np.abs(run.y), axis=1)
    return run.y[:, 0] + SPREAD * size * np.random.default_rng(0).uniform(-1, 1, (COUNT, size.size))


def measured(name: str, end: float | None) -> tuple[float, float, float, int, float]:
    """Time of a trajectory by `solve`, by the plain loop and in lanes; how many Python decides; the error.

    end: of the span, where that is not the model's own
    """
    model = get(name)
    system, span = model.build(), (model.t_span[0], end or model.t_span[1])
    problem = Problem(system, model.x0, span)
    starts, left = starts_of(problem), 0

    def one_by_one() -> list[Any]:
        return [solve(problem.remake(x0=tuple(x)), dense_output=False, **OPTIONS) for x in starts[:SINGLE]]

    def together(lanes: int | None) -> ensemble.Ensemble:
        return solve_many(system, starts, span, lanes=lanes, threads=1, **OPTIONS)

    inner = ensemble._statuses

    def counted(codes: Any) -> Any:
        nonlocal left
        found = inner(codes)
        left += sum(status is None for status in found)
        return found

    ends = np.array([run.x_end for run in one_by_one()])
    together(1)
    ensemble._statuses = counted
    many = together(None)
    ensemble._statuses = inner
    scale = np.max(np.abs(many.x), axis=0) + 1e-300
    return (
        least(one_by_one) / SINGLE, least(lambda: together(1)) / COUNT, least(lambda: together(None)) / COUNT,
        left, float(np.max(np.abs(many.x[:SINGLE] - ends) / scale)),
    )  # fmt: skip


def main(asked: list[str]) -> None:
    """Print a table, and how many ratios are what."""
    print("| model | one `solve` | plain loop | lanes | to `solve` | to the loop | left | error |")
    print("|---|---|---|---|---|---|---|---|")
    ratios = []
    chosen = asked or names()
    for name, end in [(q, None) for q in chosen] + [(q, SETTLED[q]) for q in chosen if q in SETTLED]:
        single, plain, lanes, left, error = measured(name, end)
        if end is None:
            ratios.append((single / lanes, plain / lanes))
        shown = name if end is None else f"{name} to {end:g}"
        print(
            f"| {shown} | {single * 1e6:.0f} us | {plain * 1e6:.1f} us | {lanes * 1e6:.1f} us | "
            f"{single / lanes:.1f} | {plain / lanes:.2f} | {left} | {error:.0e} |", flush=True,
        )  # fmt: skip
    for k, what in enumerate(("one solve each", "the plain loop")):
        column = np.array([row[k] for row in ratios])
        print(
            f"lanes against {what}: at least 3 on {np.sum(column >= 3)} of {len(column)}, least "
            f"{column.min():.2f}, median {np.median(column):.1f}"
        )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(sys.argv[1:])
