"""The state of the event loop: every number it keeps, by name. Python reads and writes the same places.

A trajectory is determined by its `Clock`, its `Count`, its state and mode; its `Scratch` and `Integers` may
serve another one before and after. Lengths follow from the `Sizes` of a system and a method.
"""

from __future__ import annotations

from dataclasses import dataclass

from filippov.kernel.language.primitives import Indices, Vector
from filippov.kernel.language.records import Lanes, Rows, Struct, part
from filippov.kernel.tables.layout import CHECKS, LANES, MOST_ENUMERATED, SPLITS
from filippov.kernel.tables.root_tables import DEPTH, NODES
from filippov.kernel.tables.tableaus import DOP853


@dataclass(frozen=True)
class Sizes:
    """The numbers on which lengths depend.

    colours  field calls for the derivatives by all signs
    largest  surfaces in the largest component
    powers   of the dense output
    jet_room scratch of the recurrences of Taylor's method
    roots    whether guards contain roots of |h|
    band     half the width of the band of an implicit method's matrices, 0 where they are dense
    points   parameters of a field that is sampled in lanes (see `points`), None where it is not
    """

    n: int = 1
    m: int = 1
    affine: bool = True
    colours: int = 1
    largest: int = 1
    moments: bool = False
    points: int | None = None
    stages: int = 13
    extra: int = 3
    powers: int = 8
    implicit: bool = False
    series: bool = False
    jet_room: int = 0
    roots: bool = False
    band: int = 0

    @property
    def side(self) -> int:
        """Rows of the largest matrix of sliding surfaces."""
        return max(self.largest, 1) if self.affine else max(self.m, 1)

    @property
    def vertices(self) -> int:
        """Vertex fields that are kept at a time."""
        return max(self.colours + 1 if self.affine else 2 ** min(self.m, MOST_ENUMERATED) + 1, 2)

    @property
    def weights(self) -> int:
        """Weights of the moments rule."""
        return 2 ** min(self.m, MOST_ENUMERATED) if self.moments and not self.affine else 0

    @property
    def kept(self) -> int:
        """States of which an implicit method keeps something from step to step."""
        return self.n if self.implicit else 0

    @property
    def row(self) -> int:
        """Numbers in a row of an implicit method's matrices."""
        return 3 * self.band + 1 if self.band else self.n

    @property
    def nodes(self) -> int:
        """Samples of a guard, one more than the degree of its polynomial."""
        return self.powers if self.series else NODES


class Clock(Struct):
    """Time and step control: the loop's input and output."""

    t: float
    t_end: float
    step: float
    rtol: float
    max_step: float
    t_start: float
    # Surface + 1 whose guard is followed relative to its own change, negative where relative to itself.
    relative: float
    fast_from: float
    fast_span: float
    start_noise: float
    grow: float
    trend: float
    same_instant: float
    # The end of the run, where `t_end` is the next instant of a time event; that instant, no number where
    # nothing is due; the time of the last event.
    t_final: float
    instant: float
    event_t: float
    # The square of its error where the next step is in the scratch already, taken in a lane; else 0.
    taken: float


class Count(Struct):
    """Work done, room left in the buffers, and the reason why the loop stopped."""

    field_calls: int
    steps: int
    rejected: int
    events: int
    records: int
    step_budget: int
    event_budget: int
    surface: int
    cause: int
    store: int
    event_room: int
    record_room: int
    # Time events that the loop looks after, and how many of them are due at the next instant.
    ticks: int
    due: int
    # 1 while the loop slides on a corner of two that it has decided, 2 where other modes may follow there.
    pair: int
    # The number of the trajectory's past among those of its thread.
    past: int
    # 1 where a state of rest has been taken since the last event; where a call ended within a segment.
    rested: int
    cut: int


class Tick(Struct):
    """A time event: start and period, or so many listed instants from the first on; its next instant.

    gap: a quarter of the least time between two of its instants;
    moves: whether it has a reset; due: whether it is due at the instant that the run is led to.
    """

    start: float
    period: float
    gap: float
    next: float
    first: int
    listed: int
    moves: int
    due: int


class EventCycles(Struct):
    """Of a surface: its last event, the last three intervals, and for lags of 1, 2 and 3 events how many
    intervals in a row were shorter than the one so many events before.
    """

    last: float
    interval: Vector = part(3)
    streak: Vector = part(3)
    # The largest difference of the rates on both sides since sliding on the surface began.
    widest: float
    # 1 where cycles shrink as a power of their number: they are followed, however faint.
    slow: float
    # How many events in a row were faint, and at which of them it is asked whether the solution has settled.
    faint: float
    ask: float


class Past(Struct):
    """The last events of a trajectory, and the limit that they accumulate at (see `limit`).

    count, room  number of events kept, and the largest number; 0 where none are kept
    most         number of the last events that are searched for a law; earlier ones may give a better limit
    stops        whether a trajectory ends at an accumulation and reports its limit
    times        of each; reached: its surface i (time events follow), -1 - i where that was grazed
    same         the times of those on one surface, `alike` of them; law: as `cycle_limit` leaves it
    t, error     time of the limit and its error; x_error: error of its state; bend: how far the solution up
                 to it deviates from a straight line
    """

    count: int
    room: int
    most: int
    stops: int
    alike: int
    times: Vector
    reached: Indices
    same: Vector
    law: Vector = part(10)
    t: float
    error: float
    x_error: float
    bend: Vector = part(lambda of: of.n)


class Multiplier(Struct):
    """Of a sliding surface: its multiplier, its range over a step, the rates at +1 and -1, their excess."""

    value: float
    least: float
    most: float
    rate_plus: float
    rate_minus: float
    slope: float


class Memory(Struct):
    """What an implicit method remembers: of its LU factors, of Newton's iteration, of the steps before."""

    factored: float
    rate: float
    last_end: float
    last_step: float
    past_end: float
    past_step: float


class Origin(Struct):
    """Where Taylor coefficients were taken: t is no number where there are none."""

    t: float
    x: Vector = part(lambda of: of.n if of.series else 0)
    m: Vector = part(lambda of: of.m if of.series else 0)


class Tally(Struct):
    """What every lane counts: steps it may still try, field calls, steps done and refused."""

    left: float
    calls: float
    done: float
    refused: float


class Scratch(Struct):
    """Intermediate numbers; functions of the user write derivatives by t after g."""

    s: Vector = part(lambda of: of.m)
    s2: Vector = part(lambda of: of.m)
    g: Vector = part(lambda of: of.m * (of.n + 1))
    gt: Vector = part(lambda of: of.m)
    # Gradients of guards with roots in them, where these vanish.
    rooted: Vector = part(lambda of: of.m * (of.n + 1) if of.roots else 0)
    vert: Vector = part(lambda of: of.vertices * of.n)
    rate: Vector = part(lambda of: 0 if of.affine else of.vertices * of.side)
    mat: Vector = part(lambda of: 2 * of.side * of.side)
    vec: Vector = part(lambda of: of.side)
    moments: Vector = part(lambda of: of.weights * (of.weights + 1))
    slope: Vector = part(lambda of: of.side)
    residual: Vector = part(lambda of: of.m)
    mult: Rows[Multiplier] = part(lambda of: of.m)
    k: Vector = part(lambda of: (of.stages + of.extra) * of.n)
    coef: Vector = part(lambda of: of.powers * of.n)
    y: Vector = part(lambda of: of.n)
    stage: Vector = part(lambda of: of.n)
    xe: Vector = part(lambda of: of.n)
    xd: Vector = part(lambda of: of.n)
    f: Vector = part(lambda of: of.n)
    xm: Vector = part(lambda of: of.n)
    h: Vector = part(lambda of: of.m)
    before: Vector = part(lambda of: of.m)
    kept: Vector = part(lambda of: of.m)
    # Rows of all guards at two points.
    row: Vector = part(lambda of: 4 * of.m)
    # Guards and their rates, in turn, at both ends of the step.
    start: Vector = part(lambda of: 2 * of.m)
    end: Vector = part(lambda of: 2 * of.m)
    radius: Vector = part(lambda of: 2 * of.m)
    touch: Vector = part(lambda of: of.m)
    grazed: Vector = part(lambda of: of.m)
    fall: Vector = part(lambda of: of.m)
    attract: Vector = part(lambda of: of.m)
    direction: float
    collocation: Vector = part(lambda of: 6 * of.n)
    jump: Vector = part(lambda of: of.n)
    # Rates of two surfaces in the four quadrants around their corner, and the scales of both.
    corner: Vector = part(10)
    # Rates of the surfaces of a corner that are affine in their signs: how these act on them, their values at
    # signs 0, their scales; the signs that follow, and the sides (see `coupled_corner`).
    coupling: Vector = part(lambda of: of.side * of.side if of.affine else 0)
    coupled_rate: Vector = part(lambda of: of.side if of.affine else 0)
    coupled_size: Vector = part(lambda of: of.side if of.affine else 0)
    coupled_sign: Vector = part(lambda of: of.side if of.affine else 0)
    coupled_side: Vector = part(lambda of: of.side if of.affine else 0)
    # Guards at the Chebyshev points of a piece and where it is checked: 2 m rows each.
    node: Vector = part(lambda of: of.nodes * 2 * of.m)
    check: Vector = part(lambda of: CHECKS * 2 * of.m)
    c: Vector = part(lambda of: of.nodes)
    work: Vector = part(lambda of: of.nodes)
    stack: Vector = part(lambda of: (DEPTH + 3) * of.nodes)
    bounds: Vector = part((DEPTH + 3) * 2)
    pieces: Vector = part((4 * SPLITS + 8) * 3)
    atol: Vector = part(lambda of: of.kept)
    rtol: float
    scale: Vector = part(lambda of: of.kept)
    jac: Vector = part(lambda of: of.kept * of.row)
    jac_x: Vector = part(lambda of: of.kept)
    jac_mode: Vector = part(lambda of: of.m if of.implicit else 0)
    lu: Vector = part(lambda of: of.kept * of.row)
    real: Vector = part(lambda of: of.kept * of.row)
    imag: Vector = part(lambda of: of.kept * of.row)
    # Right-hand sides in the order of the band, or the steps of differences.
    in_band: Vector = part(lambda of: 2 * of.kept if of.band else 0)
    z: Vector = part(lambda of: 3 * of.kept)
    zw: Vector = part(lambda of: 3 * of.kept)
    past: Vector = part(lambda of: 3 * of.kept)
    reached: Vector = part(lambda of: of.kept)
    diff: Vector = part(lambda of: 3 * of.kept)
    error: Vector = part(lambda of: of.kept)
    memory: Memory = part()
    # Of Taylor's method: coefficients and where they were taken, the polynomial's rate at the end of the
    # step, by how much it misses the field inside the step and the length of that step; whether there are
    # no coefficients, and the stages that replace them.
    jet: Vector = part(lambda of: of.stages * (of.n + 2 * of.m) if of.series else 0)
    origin: Origin = part()
    jet_end: Vector = part(lambda of: of.n if of.series else 0)
    miss: Vector = part(lambda of: of.n if of.series else 0)
    checked: float
    inside: Vector = part(lambda of: LANES * 3 * of.n if of.series else 0)
    explicit: float
    # Coefficients of another surface's slides, for lanes.
    spare: Vector = part(
        lambda of: of.stages * (of.n + 2 * of.m) + of.jet_room if of.series and of.m > 1 else 0
    )
    rk: Vector = part(lambda of: (DOP853.stages + len(DOP853.extra)) * of.n if of.series else 0)
    jet_room: Vector = part(lambda of: of.jet_room)
    wide: Vector = part(
        lambda of: 0 if of.points is None else LANES * (1 + 3 * of.n + of.points + 9 * of.m + of.m * of.n)
    )


class Integers(Struct):
    """The sliding surfaces component by component: their number, the list, the end of each one's group in it,
    its place there, how many slide in every component, the surfaces of a corner; what is counted; the pivots
    of an implicit method.
    """

    sliding: int
    listed: Indices = part(lambda of: of.m)
    calls: int
    jacobians: int
    factors: int
    known: int
    pieces: int
    unresolved: int
    group: Indices = part(lambda of: of.m)
    place: Indices = part(lambda of: of.m)
    coupled: Indices = part(lambda of: max(of.m, 1))
    corner: Indices = part(lambda of: of.side)
    pivots: Indices = part(lambda of: of.kept)
    twins: Indices = part(lambda of: of.kept)


class Attempt(Struct):
    """The step under way, from its choice to its event.

    cause, surface  what was found in it; theta: where, in parts of the step; slope: of a guard by theta
    length, dense_length  the step to the event, and that of its dense output; residual: |guard| left there
    """

    t: float
    step: float
    t_end: float
    error: float
    slack: float
    theta: float
    slope: float
    length: float
    dense_length: float
    residual: float
    multiplier: float
    # As in `Clock`: the error of a step that was taken in a lane.
    taken: float
    # The last step of the run; along a straight line; the surface of `Clock.relative`, -1 for none, and
    # whether it is followed relative to itself.
    last: int
    line: int
    relative: int
    kept: int
    cause: int
    surface: int
    # At the event under way: observers that follow the surface that they observe (see `simultaneous`).
    observers: int
    # A segment is to be opened; steps left.
    renew: int
    steps_left: int


class Trajectory(Struct):
    """One trajectory: references to its data, and the step under way.

    x, mode m, multipliers lam of the sliding surfaces; order[i]: how often guard i vanishes at the start,
    ALONG where others hold the solution on it; trigger: the surfaces that are active where the classification
    is needed; stop: events until a terminal one, a row of STOPS per surface; ticks, instants: time events,
    and the times of those that list them; rec, rec_coef: steps with their dense output; events, marks:
    what is kept of events; kinds: how many of each kind a surface had, where events are only counted; past:
    the events by which accumulations are recognised; limit: the last accumulation, with its error, that of
    its state, and the state; number: in its batch.
    """

    clock: Clock
    count: Count
    x: Vector
    m: Vector
    order: Indices
    trigger: Indices
    lam: Vector
    p: Vector
    atol: Vector
    stop: Indices
    zeno: Rows[EventCycles]
    ticks: Rows[Tick]
    instants: Vector
    rec: Vector
    rec_coef: Vector
    events: Vector
    marks: Indices
    kinds: Indices
    past: Past
    limit: Vector
    w: Scratch
    iw: Integers
    ctx: Indices
    number: int
    now: Attempt = part()


class Trajectories(Struct):
    """Trajectories by number: the data that a `Trajectory` has once, here for each, one after the other.

    queue  what has been taken, how many are done, how many are taken at a time: threads share it
    codes  how each ended
    """

    clocks: Rows[Clock]
    counts: Rows[Count]
    xs: Vector
    ms: Vector
    orders: Indices
    triggers: Indices
    lams: Vector
    ps: Vector
    stops: Indices
    zenos: Rows[EventCycles]
    ticks: Rows[Tick]
    kinds: Indices
    limits: Vector
    codes: Indices
    queue: Indices


class Entries(Struct):
    """Addresses of plain kernels, which are in another unit."""

    launch: int
    time_slice: int
    open_segment: int


class Group(Struct):
    """The lanes of trajectories that slide, or of those that do not."""

    clock: Lanes[Clock]
    tally: Lanes[Tally]
    x: Vector
    m: Vector
    order: Vector
    p: Vector
    atol: Vector
    w: Lanes[Scratch]


STRUCTS: tuple[type[Struct], ...] = (
    Clock, Count, Tick, EventCycles, Past, Multiplier, Memory, Origin, Tally, Scratch, Integers, Attempt,
    Trajectory, Trajectories, Entries, Group,
)  # fmt: skip
