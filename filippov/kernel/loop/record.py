"""What the event loop leaves behind: events, and the dense output of accepted steps."""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, shift_indices, truncate
from filippov.kernel.loop.model import DEGREE_DENSE, EVENT_SIZE, RESETS, W_BEFORE, W_COEF, W_JUMP, M, N
from filippov.kernel.tables.codes import (
    CROSSING_DOWN,
    CROSSING_EITHER,
    CROSSING_UP,
    EVENTS,
    EXIT_DOWN,
    EXIT_EITHER,
    EXIT_UP,
    RECORDS,
    RESET,
)


@kernel
def record_event(
    events: Vector, marks: Indices, count: Indices, t: float, x: Vector, i: int, kind: int, m: Vector,
    multiplier: float, residual: float, w: Vector,
) -> None:  # fmt: skip
    """Append one event: floats (t, multiplier, |h|, x, x after) and integers (surface, kind, both modes)."""
    event = shift(events, count[EVENTS] * EVENT_SIZE)
    mark = shift_indices(marks, count[EVENTS] * (2 + 2 * M))
    event[0], event[1], event[2] = t, multiplier, residual
    for j in range(N):
        event[3 + j] = x[j]
    if RESETS:
        for j in range(N):
            event[3 + N + j] = w[W_JUMP + j] if kind == RESET else x[j]
    mark[0], mark[1] = i, kind
    for j in range(M):
        mark[2 + j] = truncate(w[W_BEFORE + j])
        mark[2 + M + j] = truncate(m[j])
    count[EVENTS] += 1


@kernel
def store_step(count: Indices, t: float, step: float, rec: Vector, rec_coef: Vector, w: Vector) -> None:
    """Keep the dense output of the step that starts at t."""
    n = count[RECORDS]
    rec[2 * n], rec[2 * n + 1] = t, step
    size = (DEGREE_DENSE + 1) * N
    for a in range(size):
        rec_coef[n * size + a] = w[W_COEF + a]
    count[RECORDS] = n + 1


@kernel
def count_down(stop: Indices, kind: int) -> int:
    """Count an event against the terminal ones of its surface; 1 where the run is to end."""
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
