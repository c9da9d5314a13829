"""Random problems with oracles by the thousand: `.venv/bin/python tests/campaigns.py linear --draws 10000`.

A kind is a function of a seed that returns what is wrong: None for nothing, "" where its oracle is silent.
"""

import argparse
import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import conftest  # noqa: F401 - what it sets must be set before numpy is imported
import numpy as np
from linear_oracle import Answer, Array, Linear, NotGenericError, Resetting, solve_linear
from linear_systems import END, IMPACTS, JUMPS, RTOL, SIZES, drawn, drawn_impact, drawn_jump, run

from filippov import Solution

Draw = Callable[[np.random.Generator, int, int, bool], tuple[Linear, Array]]


def problem(seed: int, resets: bool) -> tuple[Linear, Array, Answer] | None:
    """A random problem with the oracle's answer; None where that does not judge."""
    rng = np.random.default_rng(seed)
    draws: list[tuple[Draw, list[tuple[int, int]]]] = [(drawn, SIZES)]
    if resets:
        draws = [(drawn_jump, JUMPS), (drawn_impact, IMPACTS)]
    draw, sizes = draws[rng.integers(len(draws))]
    n, m = sizes[rng.integers(len(sizes))]
    a, x0 = draw(rng, n, m, bool(rng.integers(2)))
    try:
        return a, x0, solve_linear(a, x0, END)
    except NotGenericError:
        return None


def compared(a: Linear, got: Solution, answer: Answer) -> str | None:
    """Within 100 rtol of what the motion makes of errors of size 1, by the oracle."""
    if not got.success:
        return f"{got.status.value}: {got.message}"
    sets = [e for i, e in enumerate(got.events) if i == 0 or e.group != got.events[i - 1].group]
    m = len(a.d)
    after = [tuple(e.after)[:m] for e in sets]
    if after != [mode for _, _, mode in answer.events]:
        return f"modes {after}, the oracle has {[mode for _, _, mode in answer.events]}"
    scale = 100 * RTOL * (1 + np.max(np.abs(got.y)))
    late = np.abs([e.t for e in sets] - np.array([time for time, _, _ in answer.events]))
    if np.any(late > scale * np.maximum(answer.times, 1.0)):
        return f"events {np.max(late):.2g} from the oracle's"
    miss = np.abs(got.x_end - answer.final)
    return f"end {np.max(miss):.2g} from the oracle's" if np.any(miss > scale * answer.state) else None


def linear(seed: int, resets: bool = False) -> str | None:
    """Events and the final state against matrix exponentials."""
    case = problem(seed, resets)
    if case is None:
        return ""
    a, x0, answer = case
    return compared(a, run(a, x0), answer)


def resets(seed: int) -> str | None:
    """The same with jumps of the state and with impacts."""
    return linear(seed, resets=True)


def _moved(a: Linear, **changes: Any) -> Linear:
    known = {name: value for name, value in changes.items() if name in a.__dataclass_fields__}
    return replace(a, **known)


@dataclass(frozen=True)
class Told:
    """A motion told otherwise: its first time, the scales of time and states, signs and order of surfaces."""

    run: Solution
    start: float = 0.0
    tempo: float = 1.0
    size: float = 1.0
    signs: Any = 1.0
    order: Any = ...

    def modes(self, m: int) -> list[tuple[int, ...]]:
        """The modes after its events, as the first telling has them."""
        return [tuple((np.array(e.after)[:m] * self.signs)[self.order]) for e in self.run.events]


def _variants(rng: np.random.Generator, a: Linear, x0: Array) -> dict[str, Told]:
    m = len(a.d)
    w, e, r = (a.w, a.e, a.r) if isinstance(a, Resetting) else (np.zeros(0), 0.0, np.zeros(0))
    tempo, size, shift = 10 ** rng.uniform(-6, 4), 10 ** rng.uniform(-6, 3), rng.uniform(-50, 50)
    turned = rng.choice([-1.0, 1.0], m)
    faster = _moved(a, A=a.A / tempo, b=a.b / tempo, B=a.B / tempo)
    larger = _moved(a, b=size * a.b, B=size * a.B, d=size * a.d, e=size * e, r=size * r)
    mirrored = _moved(a, b=-a.b, d=-a.d, w=-w, r=-r)
    factor = 10 ** rng.uniform(-9, 9, m)
    steeper = _moved(a, c=a.c * factor[:, None], d=a.d * factor)
    negated = _moved(a, c=a.c * turned[:, None], d=a.d * turned, B=a.B * turned[:, None])
    order = tuple(int(k) for k in rng.permutation(m))
    return {
        "scale of time": Told(run(faster, x0, (0, tempo * END)), tempo=tempo),
        "scale of states": Told(run(larger, size * x0, atol=1e-13 * size), size=size),
        "shift of time": Told(run(a, x0, (shift, shift + END)), start=shift),
        "mirror": Told(run(mirrored, -x0), size=-1.0, signs=-1.0),
        "scale of surfaces": Told(run(steeper, x0)),
        "negated surfaces": Told(run(negated, x0), signs=turned),
        "order of surfaces": Told(run(a, x0, order=order), order=np.argsort(order)),
    }


def metamorphic(seed: int) -> str | None:
    """The same motion in other units, at another time, with turned, permuted and scaled surfaces."""
    case = problem(seed, resets=bool(seed % 2))
    if case is None:
        return ""
    a, x0, answer = case
    m, one, rng = len(a.d), run(a, x0), np.random.default_rng(seed + 10**6)
    if not one.success:
        return f"{one.status.value}: {one.message}"
    near = 200 * RTOL * (1 + np.max(np.abs(one.y)))
    modes = Told(one).modes(m)
    for name, told in _variants(rng, a, x0).items():
        two = told.run
        if not two.success:
            return f"{name}: {two.status.value}: {two.message}"
        if told.modes(m) != modes:
            return f"{name}: {two.modes} for {one.modes}"
        grows = np.max(answer.times, initial=1.0)
        times = (np.array([e.t for e in two.events]) - told.start) / told.tempo
        late = np.abs(times - [e.t for e in one.events])
        if np.any(late > near * grows):
            return f"{name}: events {np.max(late):.2g} apart"
        apart = np.abs(two.x_end / told.size - one.x_end)
        if np.any(apart > near * answer.state):
            return f"{name}: ends {np.max(apart):.2g} apart"
    return None


def whole(seed: int) -> str | None:
    """Small whole coefficients, where corners are degenerate (tests/test_whole_coefficients.py)."""
    from test_whole_coefficients import examine

    n, m = [(2, 1), (3, 1), (2, 2), (3, 2), (4, 3)][seed % 5]
    return "; ".join(examine(n, m, seed // 5)) or None


def networks(seed: int) -> str | None:
    """Friction between bodies in rows, trees and rings against the principle of least constraint."""
    from test_redundant import NETWORKS, miss

    names = tuple(NETWORKS)
    worst = miss(names[seed % len(names)], seed // len(names))
    return None if worst < 1e-6 else f"{names[seed % len(names)]} {seed // len(names)}: {worst:.2g}"


def twisting(seed: int) -> str | None:
    """Super-twisting over the plane of gains (tests/test_second_order_sliding.py)."""
    from test_second_order_sliding import twisting_fault

    return twisting_fault(seed)


def trees(seed: int) -> str | None:
    """Random networks with friction, belts and walls (tests/friction_trees.py)."""
    from friction_trees import examine

    return "; ".join(examine(seed)) or None


def shares(seed: int) -> str | None:
    """Bodies at rest whose contacts share loads in many ways (tests/friction_trees.py)."""
    from friction_trees import examine, shared

    return "; ".join(examine(seed, shared)) or None


def verdicts(seed: int) -> str | None:
    """Stability verdicts of random small systems against motions (tests/verdict_draws.py)."""
    from verdict_draws import examine

    faults, sure = examine(seed)
    return "; ".join(faults) or (None if sure else "")


def maps(seed: int) -> str | None:
    """Basins, regions, exponents, multipliers and gains in closed form (tests/map_draws.py)."""
    import map_draws

    kinds = (map_draws.basins, map_draws.cells, map_draws.exponents, map_draws.multipliers, map_draws.gains)
    return kinds[seed % len(kinds)](seed // len(kinds)) or None


def forced(seed: int) -> str | None:
    """Floquet multipliers of forced piecewise linear oscillators (tests/forced_draws.py)."""
    from forced_draws import multipliers

    fault = multipliers(seed)
    return "" if fault is None else fault or None


def planes(seed: int) -> str | None:
    """Basins of planar piecewise linear systems with known borders (tests/basin_draws.py)."""
    from basin_draws import KINDS, basins

    kinds = sorted(KINDS)
    return basins(kinds[seed % len(kinds)], seed // len(kinds)) or None


EVERY = (
    linear, resets, metamorphic, whole, networks, twisting, trees, shares, verdicts, maps, forced, planes,
)  # fmt: skip
KINDS = {f.__name__: f for f in EVERY}


def part(kind: str, seeds: range) -> list[tuple[int, str | None]]:
    """What is wrong with each of these."""
    out: list[tuple[int, str | None]] = []
    for seed in seeds:
        try:
            out.append((seed, KINDS[kind](seed)))
        except Exception as error:  # noqa: BLE001 - a draw that breaks is a finding, not the end of it all
            out.append((seed, f"{type(error).__name__}: {error}"))
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="+", choices=sorted(KINDS))
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    wrong = 0
    with ProcessPoolExecutor(given.workers) as pool:
        for kind in given.kinds:
            last = given.first + given.draws
            chunk = max(1, min(200, given.draws // (8 * given.workers)))
            starts = range(given.first, last, chunk)
            jobs = [pool.submit(part, kind, range(k, min(k + chunk, last))) for k in starts]
            found: Counter[str] = Counter()
            for job in jobs:
                for seed, fault in job.result():
                    found["right" if fault is None else "not judged" if fault == "" else "wrong"] += 1
                    if fault:
                        print(f"{kind} {seed}: {fault[:400]}", flush=True)
            wrong += found["wrong"]
            print(f"{kind}: {dict(found)}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
