"""The event loop: one trajectory, mode by mode, until its end or until something needs the classification.

Contract (clauses E1-E9 of docs/event-loop): the field of a segment is smooth, the mode is the memory; an
accepted step is searched for its first event; the event is landed on by a real step; simple ones are decided
in `resolve`, everything else returns GENERAL with the state at the event and the surfaces that triggered it.

Each part works on a trajectory and its step under way (`Trajectory.now`), and returns GO_ON to the next part,
AGAIN for another step, ARRIVED at an event, or a code of `advance`.
"""

from filippov.kernel.language.primitives import entry, inline, kernel
from filippov.kernel.loop.attempt import choose_step, try_step
from filippov.kernel.loop.corner_event import look_at_corner
from filippov.kernel.loop.decide import decide
from filippov.kernel.loop.field import set_mode
from filippov.kernel.loop.model import IMPLICIT, SERIES, TICKS, M, N
from filippov.kernel.loop.search import arrive, search
from filippov.kernel.loop.segment import first_length, open_segment
from filippov.kernel.loop.series import series_step
from filippov.kernel.loop.state import Trajectory
from filippov.kernel.loop.ticks import tick
from filippov.kernel.tables.codes import (
    AGAIN,
    ARRIVED,
    CHUNK_DONE,
    EVENTS_FULL,
    GO_ON,
    REACHED,
    RECORDS_FULL,
)


@kernel
def take_up(run: Trajectory) -> None:
    """Restore the state that the previous call left. Steps must not depend on how a run is cut into calls."""
    clock, w, iw, now = run.clock, run.w, run.iw, run.now
    w.direction = 1.0 if clock.t_end >= clock.t else -1.0
    now.steps_left = run.count.step_budget
    now.taken = clock.taken
    clock.taken = 0.0
    now.renew = 1 if now.taken == 0.0 else 0
    if now.taken > 0.0:
        set_mode(run.m, iw)
    clock.grow = clock.grow if clock.grow > 0.0 else 10.0
    clock.trend = clock.trend if clock.trend > 0.0 else 1e-300
    for i in range(M):
        w.mult[i].value = run.lam[i]
    iw.calls = 0
    if IMPLICIT:
        w.rtol = clock.rtol
        for j in range(N):
            w.atol[j] = run.atol[j]


@kernel
def hand_back(run: Trajectory, code: int) -> None:
    """Save what the next call needs besides the state."""
    full = code == CHUNK_DONE or code == EVENTS_FULL or code == RECORDS_FULL  # noqa: PLR1714 - no `in`
    run.count.cut = 1 if full and run.now.renew == 0 else 0
    if not full:
        run.count.rested = 0
    run.count.field_calls += run.iw.calls
    for i in range(M):
        run.lam[i] = run.w.mult[i].value


@inline
@kernel
def make_ready(run: Trajectory) -> int:
    """Check for work and room in the buffers, and open the segment if one begins."""
    clock, count, now = run.clock, run.count, run.now
    now.t = clock.t
    if (clock.t_end - now.t) * run.w.direction <= clock.same_instant:
        if TICKS and count.ticks > 0 and clock.instant == clock.t_end:
            return tick(run)
        return REACHED
    if count.events + M >= count.event_room:
        return EVENTS_FULL
    if count.store != 0 and count.records >= count.record_room:
        return RECORDS_FULL
    if now.steps_left <= 0:
        return CHUNK_DONE
    now.steps_left -= 1
    code = GO_ON
    if now.renew != 0:
        code = open_segment(run)
        now.renew = 1 if code == AGAIN else 0
    elif clock.step <= 0.0:
        code = first_length(run)
    if SERIES and code == GO_ON:
        clock.step = series_step(now.t, run.x, run.p, run.m, clock.rtol, run.atol, clock.step, run.w, run.iw)
    return code


@entry
@kernel
def advance(run: Trajectory) -> int:
    """Run one trajectory from (clock.t, x, m) towards clock.t_end; returns why it stopped (see `codes`).

    Everything is updated in place.
    """
    take_up(run)
    code = AGAIN
    while code < 0:
        code = make_ready(run)
        if code == GO_ON:
            code = choose_step(run)
        if code == GO_ON:
            code = try_step(run)
        if code == GO_ON and M > 1 and run.count.pair != 0:
            code = look_at_corner(run)
        if code == GO_ON:
            code = search(run)
        if code == GO_ON:
            code = arrive(run)
        if code == ARRIVED:
            code = decide(run)
    hand_back(run, code)
    return code
