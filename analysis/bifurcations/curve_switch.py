"""From a codimension-2 point onto the other curves that meet there."""

from __future__ import annotations

import numpy as np

from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.codim2 import is_boundary
from filippov.analysis.bifurcations.continuation import Continuation
from filippov.analysis.bifurcations.curve import CONTACTS, CurveProblem
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.bifurcations.tangency import Tangency
from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import Count, Interval, Positive
from filippov.base.keywords import keywords

BOUNDARY = "boundary equilibrium"
MEETS: dict[str, tuple[str, ...]] = {
    "resonance 1:1": ("fold", "Neimark-Sacker"),
    "resonance 1:2": ("period doubling", "Neimark-Sacker"),
    "fold-flip": ("fold", "period doubling"),
    "fold-Neimark-Sacker": ("fold", "Neimark-Sacker"),
    "flip-Neimark-Sacker": ("period doubling", "Neimark-Sacker"),
    "Bogdanov-Takens": ("fold", "Hopf"),
    "fold-Hopf": ("fold", "Hopf"),
    "boundary fold": ("fold", BOUNDARY),
    "boundary Hopf": ("Hopf", BOUNDARY),
    "double grazing": ("grazing",),
} | {
    f"{kind}-{end}": (kind, other)
    for kind in CONTACTS
    for end, other in (
        ("fold", "fold"), ("doubling", "period doubling"), ("Neimark-Sacker", "Neimark-Sacker"),
    )
}  # fmt: skip


@keywords()
def curves_at(run: Continuation, special: BranchPoint) -> tuple[str, ...]:
    """The kinds of the other curves that meet the curve of `run` at a codimension-2 point."""
    if not isinstance(run.problem, CurveProblem):
        raise UsageError("the run is no curve in two parameters; begin one with `curve`.")
    meeting = MEETS.get(special.special, ())
    mine = BOUNDARY if is_boundary(run.problem.test) else run.problem.test
    return tuple(kind for kind in meeting if kind != mine or special.special == "double grazing")


@keywords()
def switch_curve(
    run: Continuation,
    special: BranchPoint,
    kind: str = "",
    *,
    bounds: Interval | None = None,
    direction: int = 0,
    step: Positive = 0.02,
    min_step: Positive = 1e-6,
    max_step: Positive = 0.1,
    max_points: Count = 200,
    max_time: Positive = float("inf"),
) -> Continuation:
    """The curve of another kind that meets the one of `run` at a codimension-2 point, not begun.

    run      a curve in two parameters; special: a point of it, see `curves_at`
    kind     "fold", "period doubling", "Neimark-Sacker", "Hopf", "grazing", "boundary equilibrium"; default:
             the only one there is
    bounds   of the second parameter, by default those of `run`

    A fold or period doubling that is followed from a grazing is that of the orbit as if the surface were not
    there: the orbit really has it on one side of the point. Raises UsageError where no other curve is known.
    """
    others = curves_at(run, special)
    if not others:
        known = ", ".join(MEETS)
        what = repr(special.special) if special.special else "an ordinary point"
        raise UsageError(f"no curve of another kind is known at {what}; one is at: {known}.")
    if kind not in (*others, "") or (not kind and len(others) > 1):
        raise UsageError(f"kind is {kind!r}, expected one of {', '.join(map(repr, others))}.")
    kind = kind or others[0]
    old = run.problem
    assert isinstance(old, CurveProblem)
    u, value, at = np.array(special.u[:-1]), float(special.u[-1]), special.value
    inner = old.moved(np.array(special.u), at).inner
    avoid: Tangency | None = None
    if kind == BOUNDARY:
        kind = special.test
    elif is_boundary(old.test) and isinstance(inner, EquilibriumProblem):
        inner, u = _regular(inner, old.test, u)
    if special.special == "double grazing":
        contact = old.moved(np.array(special.u), at).contact
        assert isinstance(contact, Tangency)
        avoid = contact
    grazed = (old.grazed, old.side) if old.test in CONTACTS else (0, 1)
    made = CurveProblem(inner, kind, old.parameter, u, value, at, old.scale[-1], grazed, avoid)
    branch = Branch(old.parameter, f"{kind} curve", dict(run.branch.parameters))
    low, high = run.bounds if bounds is None else bounds
    made.wide = float(high) - float(low)
    out = Continuation(made, at, (float(low), float(high)), branch, direction, step)
    out.min_step, out.max_step, out.max_points, out.max_time = min_step, max_step, max_points, max_time
    out.prepare()
    return out


def _regular(inner: EquilibriumProblem, test: str, u: Array) -> tuple[EquilibriumProblem, Array]:
    """The equilibrium beside the surface."""
    if test.startswith("boundary "):
        return inner, u
    side = 1 if test.startswith("upper ") else -1
    i, n = inner.system.surface_index(test.split(" ", 1)[1]), inner.system.dimension
    mode = (*inner.mode[:i], side, *inner.mode[i + 1 :])
    values = dict(zip(inner.system.parameters.names, inner.base.tolist(), strict=True))
    return EquilibriumProblem(inner.system, mode, inner.parameter, u[:n], values), u[:n]

