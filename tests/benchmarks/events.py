"""A million events in one run, and a period to 1e-10: python tests/benchmarks/events.py

x' = 0.3 cos(t) - s with a relay s of sgn(x) that switches at |x| = 1e-3; processor time of one core. heyoka
switches a parameter from callbacks in Python. Memory: the most that the process has held, before and after.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from filippov import Solution, Stop, System, cos, sign, solve, states, t
from filippov.model.comparator import Hysteresis
from filippov.models import get

(x,) = states("x")
WIDTH = 1e-3
# Of the cycle of x' = v, v' = -x + 1/(1 + 3 |v - 0.2|), |x| <= 1 in stick (mpmath, 30 digits; bank F06).
PERIOD = 12.0010312948305787


def memory() -> float:
    """The most memory so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def relay(end: float, method: str) -> tuple[float, Solution]:
    """Processor time and the run."""
    system = System({x: 0.3 * cos(t) - sign(x)}).with_comparator(Hysteresis(WIDTH))
    options = {"max_events": 10**8, "max_steps": 10**9, "dense_output": False, "save_events": "count"}
    begun = time.process_time()
    run = solve(system, (0.0,), (0, end), method=method, **options)  # type: ignore[arg-type]
    return time.process_time() - begun, run


def by_heyoka(end: float) -> tuple[float, int, float]:
    """Processor time, events and the state at the end."""
    import heyoka as hy

    q = hy.make_vars("q")
    count = 0

    def turn(ta: object, _: int) -> bool:
        nonlocal count
        count += 1
        ta.pars[0] = -ta.pars[0]  # type: ignore[attr-defined]
        return True

    up = hy.t_event(q - WIDTH, callback=turn, direction=hy.event_direction.positive)
    down = hy.t_event(q + WIDTH, callback=turn, direction=hy.event_direction.negative)
    field = [(q, 0.3 * hy.cos(hy.time) - hy.par[0])]
    ta = hy.taylor_adaptive(field, [0.0], tol=1e-8, pars=[1.0], t_events=[up, down])
    begun = time.process_time()
    ta.propagate_until(end)
    return time.process_time() - begun, count, float(ta.state[0])


def million() -> None:
    """Events a second of each."""
    for method in ("DOP853", "Taylor"):
        relay(1.0, method)
        for end in (200.0, 2100.0):
            before = memory()
            spent, run = relay(end, method)
            total = run.events.total  # type: ignore[attr-defined]
            print(f"filippov, {method}: {total} events, {total / spent / 1e3:.0f} thousand a second, "
                  f"memory {before:.0f} -> {memory():.0f} MiB, {run.status}")  # fmt: skip
    try:
        by_heyoka(1.0)
        spent, count, _ = by_heyoka(2100.0)
    except ImportError:
        print("heyoka is not installed")
        return
    print(f"heyoka: {count} events, {count / spent / 1e3:.0f} thousand a second")


def period() -> None:
    """Field calls for the period of Leine's block on a belt, from one break-away to the next."""
    for method in ("DOP853", "Taylor"):
        run = solve(get("belt").build(), (1.0, 0.2), (0, 30), method=method, rtol=1e-11, atol=1e-13,
                    stop=Stop("belt", "sliding exit"))  # fmt: skip
        print(f"filippov, {method}: period {run.t_end:.12f}, error {abs(run.t_end - PERIOD):.0e}, "
              f"{run.nfev} field calls")  # fmt: skip


if __name__ == "__main__":
    million()
    period()
