"""Taylor's method beside DOP853 and heyoka, in ms of processor time: python -m tests.benchmarks.taylor."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from filippov import Surface, System, cos, sign, sin, solve, states, t

x, y, u, v = states("x y u v")
ENERGY_START = (0.1, 0.2, 0.3, 0.1)


class Case(NamedTuple):
    """A run and the measure of its error."""

    name: str
    system: System
    x0: tuple[float, ...]
    end: float
    rtol: float
    error: Callable[[Any], float]


def energy(q: Any) -> float:
    """Of Henon and Heiles."""
    return float((q @ q) / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3)


def impacts(restitution: float, count: int) -> np.ndarray:
    """Times of the impacts of a ball that falls from 1 m."""
    first = math.sqrt(2 / 9.81)
    return first + np.concatenate([[0], np.cumsum(2 * first * restitution ** np.arange(1, count))])


def cases() -> Iterator[Case]:
    """All runs."""
    henon = System({x: u, y: v, u: -x - 2 * x * y, v: -y - x * x + y * y})
    start = energy(np.array(ENERGY_START))
    yield Case(
        "Hénon-Heiles, T = 5000", henon, ENERGY_START, 5000, 1e-13, lambda r: abs(energy(r.x_end) / start - 1)
    )
    ball = System(
        {y: v, v: -9.81 + 0 * y}, surfaces=[Surface("floor", y, kind="reset", side="+", reset={v: -0.97 * v})]
    )
    times = impacts(0.97, 157)
    yield Case(
        "bouncing ball, 157 impacts", ball, (1.0, 0.0), float(times[-1]) + 1e-3, 1e-10,
        lambda r: float(np.max(abs(r.events.t - times))),
    )  # fmt: skip
    for name, field, x0, end in (
        ("driven dry friction, T = 600", -x - v / 10 + cos(t) / 2 - 0.3 * sign(v), (1.0, 0.0), 600.0),
        ("crossings, T = 600", -x + cos(0.7 * t) - 0.3 * sign(x), (1.0, 0.0), 600.0),
        ("pendulum, T = 1000", -sin(x), (1.0, 0.3), 1000.0),
    ):
        system = System({x: v, v: field})
        known = solve(system, x0, (0, end), rtol=3e-14, atol=1e-16, dense_output=False).x_end
        yield Case(name, system, x0, end, 1e-10, lambda r, known=known: float(np.max(abs(r.x_end - known))))


def best(run: Callable[[], Any], tries: int = 15) -> tuple[float, Any]:
    """Least time in ms, and the last result."""
    least, result = math.inf, run()
    for _ in range(tries):
        start = time.process_time()
        result = run()
        least = min(least, time.process_time() - start)
    return 1e3 * least, result


def heyoka_runs() -> dict[str, Callable[[], float]]:
    """Runs of heyoka that return their errors; none where it is not installed."""
    try:
        import heyoka as hy
    except ImportError:
        return {}
    a, b, c, d = hy.make_vars("a", "b", "c", "d")
    henon = hy.taylor_adaptive(
        [(a, c), (b, d), (c, -a - 2 * a * b), (d, -b - a * a + b * b)], list(ENERGY_START), tol=1e-13
    )
    start = energy(np.array(ENERGY_START))

    def smooth() -> float:
        henon.time, henon.state[:] = 0.0, ENERGY_START
        henon.propagate_until(5000.0)
        return abs(energy(henon.state) / start - 1)

    found: list[float] = []

    def turn(integrator: Any, _: int) -> bool:
        found.append(integrator.time)
        integrator.state[1] *= -0.97
        return True

    event = hy.t_event(a, callback=turn, direction=hy.event_direction.negative)
    ball = hy.taylor_adaptive([(a, b), (b, hy.expression(-9.81))], [1.0, 0.0], tol=1e-10, t_events=[event])
    times = impacts(0.97, 157)

    def bounces() -> float:
        found.clear()
        ball.time, ball.state[:] = 0.0, (1.0, 0.0)
        ball.reset_cooldowns()
        ball.propagate_until(float(times[-1]) + 1e-3)
        return float(np.max(abs(np.array(found) - times)))

    return {"Hénon-Heiles, T = 5000": smooth, "bouncing ball, 157 impacts": bounces}


def main() -> None:
    """Print a table."""
    peers = heyoka_runs()
    print("| run | DOP853 | Taylor | heyoka |\n|---|---|---|---|")
    for case in cases():
        cells = []
        for method in ("DOP853", "Taylor"):
            spent, run = best(
                lambda case=case, method=method: solve(
                    case.system, case.x0, (0, case.end), method=method, rtol=case.rtol, atol=case.rtol / 100,
                    dense_output=False,
                )
            )  # fmt: skip
            cells.append(f"{spent:.2f} ms, {run.steps} steps, {case.error(run):.0e}")
        if case.name in peers:
            spent, error = best(peers[case.name])
            cells.append(f"{spent:.2f} ms, {error:.0e}")
        print(f"| {case.name} | {' | '.join(cells)}{' |' * (4 - len(cells))}", flush=True)


if __name__ == "__main__":
    main()
