"""Seconds for 60 s of motion of a chain of n blocks, and what a step costs: python tests/benchmarks/chain.py.

Prints a row for each n and writes the plot of cost against n to the file given by --plot. With --between the
friction acts between neighbours, so that every contact acts on every other while they stick.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from filippov import System, cos, sign, solve, states, t
from filippov.models.chain import chain, start

SIZES = (1, 2, 5, 10, 20, 50, 100)


def between(n: int) -> System:
    """Driven bodies on springs, coupled by springs and by friction between neighbours."""
    x, v = (states(" ".join(f"{name}{i}" for i in range(n + 1))) for name in "xv")
    force = np.random.default_rng(1).uniform(0.8, 1.6, n).round(6)
    field = dict(zip(x, v, strict=True))
    for i in range(n + 1):
        field[v[i]] = 3 * cos(0.7 * t + i) - x[i]
        for j, own in ((i - 1, i - 1), (i + 1, i)):
            if 0 <= j <= n:
                field[v[i]] += x[j] - x[i] + float(force[own]) * sign(v[j] - v[i])
    return System(field)


def measure(n: int, coupled: bool = False, repeats: int = 3) -> tuple[float, float, float, float, int, int]:
    """(short solve with compiling, first run, run, a step, steps, events): processor time in seconds.

    What a first run finds out about the system later ones are spared.
    """
    begun = time.process_time()
    system = between(n) if coupled else chain(n)
    x0 = np.random.default_rng(2).normal(size=2 * n + 2) if coupled else start(n)
    solve(system, x0, (0, 0.01), dense_output=False)
    first = time.process_time() - begun
    spent = []
    for _ in range(repeats):
        begun = time.process_time()
        run = solve(system, x0, (0, 60), dense_output=False)
        spent.append(time.process_time() - begun)
        assert run.success, run.message
    steps = run.steps + run.rejected
    return first, spent[0], min(spent), min(spent) / steps, steps, len(run.events)


def plot(path: str, rows: list[tuple[int, float, float]]) -> None:
    """Cost of a step and of the run against the number of blocks, on logarithmic axes."""
    from matplotlib import pyplot as plt

    n, whole, step = np.array(rows).T
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    left.loglog(n, 1e6 * step, "o-", label="measured")
    left.loglog(n, 1e6 * step[-1] * n / n[-1], "--", color="0.6", label="proportional to n")
    left.set(xlabel="blocks", ylabel="time a step [µs]")
    left.legend(frameon=False)
    right.loglog(n, whole, "o-")
    right.set(xlabel="blocks", ylabel="time for 60 s of motion [s]")
    figure.savefig(path)
    plt.close(figure)


def main() -> None:
    """Measure all sizes and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot", help="file of the plot")
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--between", action="store_true", help="friction between neighbours")
    arguments = parser.parse_args()
    heads = ("build s", "first s", "run s", "us/step", "steps", "events")
    print(f"{'sets' if arguments.between else 'blocks':>6}", *(f"{head:>8}" for head in heads))
    rows = []
    for n in arguments.sizes:
        build, first, whole, step, steps, events = measure(n, arguments.between)
        rows.append((n, whole, step))
        times = f"{build:>8.2f} {first:>8.3f} {whole:>8.3f} {1e6 * step:>8.1f}"
        print(f"{n:>6} {times} {steps:>8} {events:>8}", flush=True)
    if arguments.plot:
        plot(arguments.plot, rows)


if __name__ == "__main__":
    main()
