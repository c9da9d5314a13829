"""How often the intervals of `identify` hold the parameters that a record was made with.

    python tests/benchmarks/intervals.py --draws 200 --workers 16 -o coverage.csv

A draw is a record of the page on identification (the reference loop from x = 0.1 over 5 s) or a variation of
it with new noise; its seed is its number. The coverage asked for is 90 to 98 %; where the law is not the one
that is fitted, a refusal by name.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

# Before numpy comes: each draw has one core.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
TRUE = {"Fs": 4.0, "Fc": 2.0, "vs": 0.1, "b": 1.0}
START = {"Fs": 3.4, "Fc": 2.5, "vs": 0.16, "b": 0.5}
NOISE, T_END = 1e-5, 5.0
COLUMNS = (
    "kind", "seed", "success", "message",
    *(column for name in TRUE for column in (name, f"{name} low", f"{name} high", f"{name} held")),
)  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """A kind of record.

    law   "stribeck", "beta" (1.5, not 2) or "lugre"; with another force "held" (a sampled controller),
          "saturated" (the controller's effort has bounds) or "open" (a force without feedback)
    """

    name: str
    step: float = 0.01
    force: float = 0.0  # standard deviation of the noise on the force, in parts of its largest size
    rho: float = 0.0  # correlation of the position's noise from sample to sample
    law: str = "stribeck"
    hold: str = "cubic"
    refused: bool = False  # the law is not the true one: a refusal is right


KINDS = (
    Kind("page, 5 ms", step=0.005),
    Kind("page, 10 ms"),
    Kind("page, 20 ms", step=0.02),
    Kind("force 0.1 %", force=0.001),
    Kind("force 0.5 %", force=0.005),
    Kind("force 2 %", force=0.02),
    Kind("AR 0.5", rho=0.5),
    Kind("AR 0.8", rho=0.8),
    Kind("AR 0.95", rho=0.95),
    Kind("held force", law="held", hold="zero"),
    Kind("saturated", law="saturated"),
    Kind("open loop", law="open"),
    Kind("beta 1.5", law="beta", refused=True),
    Kind("LuGre", law="lugre", refused=True),
)


@lru_cache(maxsize=32)
def motion(law: str, step: float) -> tuple[Array, Array, Array]:
    """Exact t, x and force of the loop without noise."""
    from filippov import solve
    from filippov.models import get

    t = np.linspace(0.0, T_END, round(T_END / step) + 1)
    if law == "held":
        return held(t)
    if law in ("saturated", "open"):
        return under_force(t, law)
    name, start = ("hunting_lugre", (0.1, 0, 0, 0)) if law == "lugre" else ("hunting", (0.1, 0, 0))
    values = {"beta": 1.5} if law == "beta" else {}
    options: dict[str, Any] = {"method": "Radau"} if law == "lugre" else {}
    rtol = 1e-9 if law == "lugre" else 1e-11
    run = solve(get(name).build(), start, (0, T_END), parameters=values, rtol=rtol, atol=1e-13, **options)
    if not run.success or run.sol is None:
        raise RuntimeError(run.message)
    x, v, z = run.sol(t)[:3]
    return t, np.asarray(x), np.asarray(-10 * (x + v + 10 * z))


def under_force(t: Array, law: str) -> tuple[Array, Array, Array]:
    """The mass under the loop's effort, cut off at 4.2 N, or under a sum of sines."""
    from sympy import Abs, sin

    from filippov import solve
    from filippov.model.parameter_symbol import parameters
    from filippov.model.symbols import states
    from filippov.model.symbols import t as time
    from filippov.model.system import System
    from filippov.models.mass import REFERENCE_LAW

    p = parameters(**REFERENCE_LAW.parameters())
    x, v, z = states("x v z")
    effort = -10 * (x + v + 10 * z)
    force = 5 * sin(2.2 * time) + 2 * sin(5.1 * time + 1)
    if law == "saturated":
        force = (Abs(effort + 4.2) - Abs(effort - 4.2)) / 2
    system = System(
        {x: v, v: force - REFERENCE_LAW.force(v, p), z: x}, surfaces=REFERENCE_LAW.surfaces(v, p),
        parameters=p,
    )  # fmt: skip
    run = solve(system, (0.1, 0, 0), (0, T_END), rtol=1e-11, atol=1e-13)
    if not run.success or run.sol is None:
        raise RuntimeError(run.message)
    x, v, z = run.sol(t)
    if law == "saturated":
        return t, x, np.clip(-10 * (x + v + 10 * z), -4.2, 4.2)
    return t, x, 5 * np.sin(2.2 * t) + 2 * np.sin(5.1 * t + 1)


def held(t: Array) -> tuple[Array, Array, Array]:
    """The loop with a controller that reads x and v at the samples and holds its effort between them."""
    from filippov import solve
    from filippov.models.driven import driven_mass

    system, state, z = driven_mass(), np.array([0.1, 0.0]), 0.0
    x, force = [], []
    for k, now in enumerate(t):
        x.append(state[0])
        force.append(-10 * (state[0] + state[1] + 10 * z))
        if k + 1 < len(t):
            step = float(t[k + 1] - now)
            z += step * state[0]
            inputs = {"force": force[-1], "interval": step}
            state = solve(system, state, (0, 1), parameters=inputs, rtol=1e-11, atol=1e-13).x_end
    return t, np.array(x), np.array(force)


def record(kind: Kind, seed: int) -> Any:
    """The record of one draw."""
    from filippov.analysis.estimation.record import Record

    t, x, force = motion(kind.law, kind.step)
    random = np.random.default_rng([seed, KINDS.index(kind)])
    noise = random.standard_normal(len(t))
    for k in range(1, len(t)):
        noise[k] = kind.rho * noise[k - 1] + np.sqrt(1 - kind.rho**2) * noise[k]
    error = kind.force * np.max(np.abs(force)) * random.standard_normal(len(t))
    return Record(t, x + NOISE * noise, force + error)


def draw(task: tuple[str, int]) -> dict[str, Any]:
    """One draw: estimate and interval of each parameter, and what was said."""
    from filippov.analysis.estimation.identification import identify
    from filippov.models.driven import driven_mass

    kind = next(kind for kind in KINDS if kind.name == task[0])
    found = identify(
        record(kind, task[1]), driven_mass(), list(START), start=START, fixed={"m": 1, "beta": 2}, windows=2,
        hold=kind.hold,
    )  # fmt: skip
    row: dict[str, Any] = {
        "kind": kind.name,
        "seed": task[1],
        "success": found.success,
        "message": found.message,
    }
    for name, value in TRUE.items():
        low, high = found.intervals[name]
        row |= {name: found.values[name], f"{name} low": low, f"{name} high": high}
        row[f"{name} held"] = bool(low <= value <= high)
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """Coverage in % of each kind and parameter among the draws that gave intervals, and the share refused."""
    lines = [
        f"{'kind':14s} {'draws':>5s} {'refused':>7s} " + " ".join(f"{n:>6s}" for n in TRUE) + "  median width"
    ]
    for kind in KINDS:
        mine = [row for row in rows if row["kind"] == kind.name]
        if not mine:
            continue
        given = [row for row in mine if row["success"]]
        share = [100 * np.mean([row[f"{n} held"] for row in given]) if given else np.nan for n in TRUE]
        width = [
            np.median([r[f"{n} high"] - r[f"{n} low"] for r in given]) if given else np.nan for n in TRUE
        ]
        lines.append(
            f"{kind.name:14s} {len(mine):5d} {len(mine) - len(given):7d} "
            + " ".join(f"{q:6.1f}" for q in share)
            + "  " + " ".join(f"{q:.1e}" for q in width)
        )  # fmt: skip
    return "\n".join(lines)


def _alone(cores: Any) -> None:
    """Keep a worker on a core of its own, so that its compiled loops start no threads."""
    if hasattr(os, "sched_setaffinity"):
        every = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {every[cores.get() % len(every)]})


def campaign(
    kinds: list[str],
    draws: int,
    workers: int,
    first: int = 0,
    each: Callable[[dict[str, Any]], None] | None = None,
) -> list[dict[str, Any]]:
    """The rows of all draws; `each` is called with every row as it comes."""
    # Seed after seed, so that what an interruption leaves has as many draws of each kind.
    tasks = [(kind, seed) for seed in range(first, first + draws) for kind in kinds]
    rows = []
    context = get_context("spawn")
    cores = context.Queue()
    for k in range(workers):
        cores.put(k)
    made = ProcessPoolExecutor(workers, context, _alone, (cores,)) if workers > 1 else nullcontext()
    with made as pool:
        for row in pool.map(draw, tasks) if pool is not None else map(draw, tasks):
            rows.append(row)
            if each is not None:
                each(row)
    return rows


def main() -> int:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first draw")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--kinds", help="names of kinds, with semicolons; default: all")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("coverage.csv"), help="CSV file of the draws"
    )
    asked = parser.parse_args()
    kinds = asked.kinds.split(";") if asked.kinds else [kind.name for kind in KINDS]
    with asked.output.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()

        def write(row: dict[str, Any]) -> None:
            writer.writerow(row)
            file.flush()

        rows = campaign(kinds, asked.draws, asked.workers, asked.first, write)
    print(table(rows))
    with asked.output.with_suffix(".txt").open("w", encoding="utf-8") as file:
        file.write(table(rows) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
