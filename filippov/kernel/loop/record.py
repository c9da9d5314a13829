"""The record of a run: events, and the dense output of accepted steps."""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, shift_indices, truncate
from filippov.kernel.loop.model import DEGREE_DENSE, EVENT_SIZE, M, N
from filippov.kernel.loop.state import Count, Scratch, Trajectory
from filippov.kernel.tables.codes import (
    CROSSING_DOWN,
    CROSSING_EITHER,
    CROSSING_UP,
    EXIT_DOWN,
    EXIT_EITHER,
    EXIT_UP,
    RESET,
    TIME_RESET,
)


@kernel
def record_event(run: Trajectory, kind: int) -> None:
    """Append an event: floats (t, multiplier, |h|, x, x after) and integers (surface, kind, both modes, 0).

    The last is 1 for an event of the same set as the previous one.
    """
    count, m, w, now = run.count, run.m, run.w, run.now
    event = shift(run.events, count.events * EVENT_SIZE)
    mark = shift_indices(run.marks, count.events * (3 + 2 * M))
    event[0], event[1], event[2] = now.t_end, now.multiplier, now.residual
    for j in range(N):
        event[3 + j] = run.x[j]
    if EVENT_SIZE > 3 + N:
        jumps = kind == RESET or kind == TIME_RESET  # noqa: PLR1714 - the kernel language has no `in`
        for j in range(N):
            event[3 + N + j] = w.jump[j] if jumps else run.x[j]
    mark[0], mark[1] = now.surface, kind
    for j in range(M):
        mark[2 + j] = truncate(w.before[j])
        mark[2 + M + j] = truncate(m[j])
    mark[2 + 2 * M] = 0
    run.clock.event_t = now.t_end
    count.events += 1


@kernel
def store_step(count: Count, t: float, step: float, rec: Vector, rec_coef: Vector, w: Scratch) -> None:
    """Store the dense output of the step that starts at t."""
    n = count.records
    rec[2 * n], rec[2 * n + 1] = t, step
    size = (DEGREE_DENSE + 1) * N
    for a in range(size):
        rec_coef[n * size + a] = w.coef[a]
    count.records = n + 1


@kernel
def count_down(stop: Indices, kind: int) -> int:
    """Count down the terminal events of a surface; 1 where the run is to end."""
    either = kind
    if kind == CROSSING_UP or kind == CROSSING_DOWN:  # noqa: PLR1714, SIM109 - the kernel language has no `in`
        either = CROSSING_EITHER
    if kind == EXIT_UP or kind == EXIT_DOWN:  # noqa: PLR1714, SIM109 - as above
        either = EXIT_EITHER
    ended = 0
    if stop[kind] > 0:
        stop[kind] -= 1
        if stop[kind] == 0:
            ended = 1
    if either != kind and stop[either] > 0:
        stop[either] -= 1
        if stop[either] == 0:
            ended = 1
    return ended
