"""The interface that every compiled system provides to the loop, implemented by a trivial system.

The kernel files import these names so that they read, check and run as ordinary modules. A compiled unit
takes the same names from the generated source of one system and from its method (`method`) instead. The
trivial system is x' = 0 with h = 1.

N, M, P: numbers of states, surfaces, and parameters with what is derived from them.
ROLE[i], LINEAR[i], WIDTH[i]: what surface i is, whether its guard is linear in (t, x), and the half width of
its hysteresis. MOVING[i]: the ends of its set of signs depend on t or x. STRAIGHT[i]: its rates on
both sides are affine in t and x on it.
AFFINE: the field is jointly affine in the signs. COUPLED: so it is, and three or more surfaces are coupled,
or two with a set other than [-1, 1] among theirs. NON_LIPSCHITZ: it may contain a power of |h| with an
exponent below 1; CLAMPED: such a power is 0 in stages beyond its surface. KINKED: it has kinks, of which
guards may be made too. WIDE: it is small enough to be sampled in lanes. VECTORS: the numbers of a vector, 1
in Python.
ROOTED[i]: guard i may contain such a power too, and is infinitely steep where it vanishes; ROOTS: one does.
RESET_FROM[i]: the side from which surface i resets the state, 2 for both, 0 for none; CONTACT[i]: the side on
which the state may rest on it, 0 for none; RESETS, CONTACTS: whether there are any; TICKS: whether there are
time events. EVENT_SIZE: doubles of an event. HELD[i]: guard i is a derivative of h_i, and only the
classification of corners leaves it. SAME_AS[i]: where i is an observer, k + 1 if its function is h_k times a
positive number, -k - 1 if times a negative one, 0 if neither; OBSERVED: whether one is.
RULE: the rule of sliding, see `rules`. ORDER: the power of the step with which the error estimate scales.
IMPLICIT: the stages are solved for. SERIES: they are the coefficients of a series (see `taylor`).
PER_NODE: 1 / theta of every main stage.
DENSE: powers of the dense output, one row per stage; DENSE_BERNSTEIN: the same in Bernstein form; WEIGHTED:
the stages that have weights there.
"""

from filippov.kernel.language.primitives import Indices, Vector, entry, kernel, lanes
from filippov.kernel.loop.state import Integers, Scratch, Sizes
from filippov.kernel.tables.root_tables import to_bernstein
from filippov.kernel.tables.tableaus import DOP853, weighted

N, M, P = 1, 1, 1
AFFINE, NON_LIPSCHITZ, CLAMPED, ALL_LINEAR, WIDE, ROOTS = True, False, False, True, False, False
KINKED, COUPLED = False, False
VECTORS = 1
STAGES, EXTRA, DEGREE_DENSE = 13, 3, 7
RULE = 0
ORDER, END_IN_ERROR, IMPLICIT, SERIES = 8, False, False, False
# Of Taylor's method: coefficients per order (field, two rows per surface), the series behind the field whose
# ends are stored (-1: not known), half the coefficients of each, how many, the first, are exponentials whose
# exponents are stored behind; stages of the interpolant of DOP853.
JETS, TAILS, LAST, DECAYING, STAND_IN_STAGES = 3, 0, 4, 0, 16
ROLE: list[int] = [0]
LINEAR: list[int] = [1]
ROOTED: list[int] = [0]
MOVING: list[int] = [0]
STRAIGHT: list[int] = [0]
WIDTH: list[float] = [0.0]
RESET_FROM: list[int] = [0]
CONTACT: list[int] = [0]
HELD: list[int] = [0]
RESETS, CONTACTS, TICKS, EVENT_SIZE = False, False, False, 4
OBSERVED, SAME_AS = False, [0]
PER_NODE: list[float] = [1.0, *[1.0 / node for node in DOP853.main_nodes], 1.0]
DENSE: list[float] = [value for row in DOP853.dense for value in row]
PER_POWER: list[float] = [1.0]
STAND_IN: list[float] = DENSE
DENSE_BERNSTEIN: list[float] = to_bernstein(DOP853.dense)
WEIGHTED: list[int] = weighted(DOP853.dense)
WEIGHTED_STAGES = len(WEIGHTED)
# Structure: nonzero columns of every gradient, components of coupled surfaces, colours of signs and their
# owners (see `structure`).
G_FIRST: list[int] = [0, 1]
G_COLUMN: list[int] = [0]
COMPONENT: list[int] = [0]
BY_COMPONENT: list[int] = [0]
COLOUR: list[int] = [0]
OWNER: list[int] = [0]
COLOURS, LARGEST = 1, 1
# Half the width of the band of Newton's matrices, 0 where they are dense; the states in its order.
BAND = 0
IN_BAND: list[int] = [0]
SIDE = Sizes().side


@entry
@kernel
def rhs(t: float, x: Vector, p: Vector, s: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    """The field at signs s (every entry +1 or -1) with |h_i| = m_i h_i; nonzero: the user's code failed."""
    out[0] = 0.0
    return 0


@kernel
def pair(
    t: float, x: Vector, p: Vector, s: Vector, s2: Vector, m: Vector, out: Vector, out2: Vector, ctx: Indices
) -> int:  # fmt: skip
    """The field at two vectors of signs, s and s2; what does not depend on them is computed once."""
    out[0], out2[0] = 0.0, 0.0
    return 0


@entry
@kernel
def guards(t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    """The switching functions h_i."""
    out[0] = 1.0
    return 0


@entry
@kernel
def gradients(t: float, x: Vector, p: Vector, m: Vector, g: Vector, gt: Vector, ctx: Indices) -> int:
    """Partial derivatives of every h_i by x (rows of g) and by t."""
    g[0], gt[0] = 0.0, 0.0
    return 0


@entry
@kernel
def radii(t: float, x: Vector, p: Vector, out: Vector, ctx: Indices) -> int:
    """Lower and upper end of the set of s_i at h_i = 0, in turn."""
    out[0], out[1] = -1.0, 1.0
    return 0


@entry
@kernel
def derive(p: Vector) -> int:
    """Quantities of the field that depend on the parameters alone, computed once, stored after them in p."""
    return 0


@entry
@kernel
def resets(i: int, t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    """The state after the reset at surface i."""
    out[0] = x[0]
    return 0


@kernel
def stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """All stages but the one at the end of the step; leaves that end in y.

    Returns 0, a code of `field`, or 3 where an implicit method does not converge.
    """
    y[0] = x[0]
    return 0


@kernel
def free_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The same for lanes none of which slides."""
    y[0] = x[0]
    return 0


@kernel
def sliding_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The same for lanes some of which slide."""
    y[0] = x[0]
    return 0


@kernel
def unsolved(
    t: float, y: Vector, p: Vector, m: Vector, step: float, last_k: Vector, w: Scratch, iw: Integers,
    ctx: Indices,
) -> bool:  # fmt: skip
    """Whether the stages of an implicit method are not solved at the end of its step."""
    return False


@kernel
def extra_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The stages that only the dense output needs."""
    return 0


@kernel
def error_terms(i: int, w: Scratch) -> tuple[float, float]:
    """The two embedded error estimates of component i, before the factor of the step."""
    return 0.0, 0.0

@kernel
def jets(t: float, x: Vector, p: Vector, m: Vector, work: Vector, out: Vector, iw: Integers) -> int:
    """Taylor coefficients along the solution, JETS per order: field, guards; nonzero where there are none.

    Row N + i: h_i, and row N + M + i nothing. Of a sliding surface the rates of its two guards, as
    `sliding_guards` has them.
    """
    return 1


@lanes
def lane_jets(
    t: float, x: Vector, p: Vector, m: Vector, work: Vector, out: Vector, spare: Vector, iw: Integers
) -> None:
    """The same for lanes, each off all surfaces or sliding on one."""


@kernel
def series_end(step: float, x: Vector, jet: Vector, k: Vector, y: Vector, rate: Vector) -> None:
    """Coefficients of the field times powers of the step in k, the polynomial's end in y, its rate there."""


@kernel
def explicit_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The stages of DOP853, for modes without coefficients."""
    return 0


@kernel
def explicit_extra_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Those that only its dense output needs."""
    return 0


@kernel
def explicit_error_terms(i: int, w: Scratch) -> tuple[float, float]:
    """Its error estimates."""
    return 0.0, 0.0


@kernel
def taken_here(t: float, x: Vector, m: Vector, w: Scratch) -> bool:
    """Whether the coefficients in the scratch are those at (t, x) in mode m."""
    return False


@kernel
def take_jets(t: float, x: Vector, p: Vector, m: Vector, w: Scratch, iw: Integers) -> None:
    """The coefficients at (t, x), unless they are there already; notes whether there are any."""
