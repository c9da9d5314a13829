"""0 in F(x; p): equilibria of smooth modes, pseudo-equilibria of sliding modes, and sets of both.

In a mode the signs are numbers, except s_i in [lo_i, hi_i] where the mode slides on surface i. There f(x, s)
= 0 and h_i(x) = 0 are solved for x AND s; what remains free parametrises a set. Source: Filippov 1988.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov import System, UsageError
from filippov.analysis.algebra.budget import Clock, OutOfBudgetError, counted
from filippov.analysis.algebra.exact_form import exact_form
from filippov.analysis.algebra.polynomial import exact, in_exponents
from filippov.analysis.algebra.time_bounds import bounds
from filippov.analysis.steady.branches import DegenerateError, Elimination, Family, UnsolvedError, short
from filippov.analysis.steady.clocks import after, mover
from filippov.analysis.steady.equilibria_numeric import NumericMode, numeric_equilibria
from filippov.analysis.steady.equilibrium import (
    Equilibria,
    EquilibriumPoint,
    EquilibriumSet,
    Missing,
    Stopped,
)
from filippov.analysis.steady.existence import FAR, Existence, ModeProblem
from filippov.analysis.steady.mode_order import at_rest_only, existing_modes
from filippov.analysis.steady.stops import with_stops
from filippov.analysis.steady.time_signs import (
    SOON,
    modes_without,
    time_surfaces,
    with_time_surfaces,
    without_time_surfaces,
)
from filippov.base.given import Positive, interval
from filippov.base.keywords import keywords
from filippov.model import symbols
from filippov.model.contact import not_derived
from filippov.model.symbolic import SymbolicForm

MOST_MODES = 243
# Up to so many are searched without asking which can hold an equilibrium.
FEW_MODES = 27
FORMULAS = 3.0  # seconds a mode, before it is searched numerically


@keywords(answers=dict.fromkeys(
    ("bounds", "ranges", "region", "limits"), "the region that is searched is box={'x': (-1, 1)}."
))  # fmt: skip
@counted
def equilibria(
    system: System,
    parameters: Mapping[Any, float] | None = None,
    *,
    modes: Sequence[str] | None = None,
    t: float | None = None,
    box: Mapping[str, tuple[float, float]] | None = None,
    budget: Positive = 10.0,
) -> Equilibria:
    """Return the points and sets with 0 in F(x; p).

    parameters  values that decide which exist, default: those of the system; formulas keep the symbols
    modes       those to search, such as ["0"]; every mode by default (at most 243, else up to one sliding)
    t           the time at which a system that depends on it is frozen
    box         (least, greatest) by state where a numerical search is needed, +-10 by default
    budget      work, in millions of calls of Python functions (about 0.3 s each)

    A mode whose equations cannot be solved in formulas is searched numerically from many starts, which may
    miss equilibria and is noted. A system of plain functions is always searched so. A zero of several
    equations at once is one point; equilibria a millionth of the box apart are told apart where the box is as
    small as they are. Raises UsageError, ModelError.
    """
    p = system.parameters.resolve(parameters)
    numbers = tuple(zip(system.parameters.names, p.tolist(), strict=True))
    if t is None and time_surfaces(system):
        still = without_time_surfaces(system)
        return _with_every_surface(system, still, parameters, modes, box, budget)
    clock = Clock(budget)
    ranges = _ranges(system, box)
    chosen, notes = _modes(system, modes)
    found: list[EquilibriumPoint | EquilibriumSet] = []
    for k, mode in enumerate(chosen):
        try:
            if system.symbolic is None:
                search = NumericMode.of_functions(system, mode, p, 0.0 if t is None else t)
                more, said = numeric_equilibria(search, ranges, clock)
            else:
                form = exact_form(system)
                assert form is not None
                more, said = _symbolic(system, form, mode, numbers, t, ranges, clock)
        except OutOfBudgetError as error:
            text = f"stopped after {k} of {len(chosen)} modes: {error}. Give a larger budget."
            notes.append(Stopped(text))
            break
        notes += [note for note in said if note not in notes]
        found += more
    found, moved = _kept(system, found, p)
    notes += moved
    found = with_stops(system, _without_doubles(found, system, p), _numbers(system, p))
    if system.symbolic is None and t is None and chosen:
        notes.append("plain functions were searched numerically, at t = 0.")
    notes += _unsearched(system)
    return Equilibria(
        tuple(e for e in found if isinstance(e, EquilibriumPoint)),
        tuple(e for e in found if isinstance(e, EquilibriumSet)),
        numbers,
        tuple(notes),
    )


def _with_every_surface(
    system: System,
    still: System,
    parameters: Mapping[Any, float] | None,
    modes: Sequence[str] | None,
    box: Mapping[str, tuple[float, float]] | None,
    budget: float,
) -> Equilibria:
    """The equilibria of a system without surfaces of the time alone, with the signs of these added."""
    gone = time_surfaces(system)
    for mode in modes or ():
        mode_signs(system, mode)
    left = modes_without(system, modes)
    found = equilibria(still, parameters, modes=left, box=box, budget=budget)
    names = [repr(system.surfaces[i].name) for i in gone]
    rest = f"on either side of {', '.join(names)}, of the time alone: the mode shows one sign."

    values = _numbers(system, system.parameters.resolve(parameters))
    every = [with_time_surfaces(system, e, values) for e in found]
    points = tuple(e for e in every if isinstance(e, EquilibriumPoint))
    sets = tuple(e for e in every if isinstance(e, EquilibriumSet))
    notes = (*found.notes, rest) if points or sets else found.notes
    return Equilibria(points, sets, found.parameters, notes)


def mode_signs(system: System, mode: str) -> tuple[int, ...]:
    """Return a mode text as integers; UsageError if it does not fit."""
    table = {"+": 1, "-": -1, "0": 0}
    if len(mode) != len(system.surfaces) or any(c not in table for c in mode):
        raise UsageError(f"mode {mode!r}: expected {len(system.surfaces)} characters, each of + - 0.")
    return tuple(table[c] for c in mode)


def mode_options(system: System) -> list[str]:
    """The signs of each surface in the modes that are searched."""
    # The field does not jump on a kink, so what lies on it is found in the modes beside it.
    signs = {"switching": "+0-", "kink": "+-", "reset": "+-", "observer": "+"}
    options = [signs[s.kind] if s.width == 0 else "+-" for s in system.surfaces]
    form = exact_form(system)
    for i, contact in enumerate(form.contact if form is not None else ()):
        options[i] = "+0-" if contact is not None else options[i]
    return options


def _modes(system: System, modes: Sequence[str] | None) -> tuple[list[str], list[str]]:
    if modes is not None:
        for mode in modes:
            mode_signs(system, mode)
        return list(dict.fromkeys(modes)), []
    options = mode_options(system)
    every = list(itertools.islice(existing_modes(system, options), MOST_MODES + 1))
    if len(every) > FEW_MODES:
        options = at_rest_only(system, options)
        every = list(itertools.islice(existing_modes(system, options), MOST_MODES + 1))
    if len(every) <= MOST_MODES:
        return sorted(every, key=lambda m: m.count("0")), []
    note = Missing(
        f"more than {MOST_MODES} modes are too many: those that slide on several surfaces, and all beyond "
        "this number, were left out. Give modes=[...]."
    )
    some = itertools.islice(existing_modes(system, options), 100_000)
    return list(itertools.islice((m for m in some if m.count("0") <= 1), MOST_MODES)), [note]


def _unsearched(system: System) -> list[str]:
    """Notes on surfaces with a reset that the state may rest on, where that is not searched."""
    form = exact_form(system)
    out: list[str] = []
    for i, surface in enumerate(system.surfaces):
        if form is not None:
            reason = not_derived(form, surface, i)
            why = f"no resting contact is derived, for {reason}" if reason else ""
        else:
            why = "its contact is not searched where the field is a plain function" if surface.contact else ""
        if why:
            out.append(Missing(f"states at rest on {surface.name!r} are not among these: {why}."))
    return out


def _ranges(system: System, box: Mapping[str, tuple[float, float]] | None) -> list[tuple[float, float]]:
    ranges = [(-10.0, 10.0)] * system.dimension
    for name, ends in (box or {}).items():
        ranges[system.state_index(name)] = interval(f"box of {name!r}", ends)
    return ranges


def _symbolic(
    system: System,
    form: SymbolicForm,
    mode: str,
    numbers: tuple[tuple[str, float], ...],
    t: float | None,
    ranges: list[tuple[float, float]],
    clock: Clock,
) -> tuple[list[EquilibriumPoint | EquilibriumSet], list[str]]:
    problem = ModeProblem.of(system, form, mode)
    values = in_exponents(
        form.expressions(), {q: exact(v) for q, (_, v) in zip(form.p, numbers, strict=True)}
    )
    put: dict[Symbol, Expr] = {} if t is None else {symbols.t: exact(t)}
    degenerate: tuple[str, ...] = ()
    if t is None and problem.has(symbols.t):
        zero = {q: v for q, v in values.items() if v == 0 and not problem.put({q: v}).has(symbols.t)}
        put |= zero
        degenerate = tuple(f"{q} = 0" for q in zero)
    notes: list[str] = []
    # Without parameters there is nothing that formulas could keep.
    numeric = plain = not any(problem.has(q) for q in form.p)
    branches: list[Family] = []
    # A coefficient that is 0 at one time, such as 1 + sign(sin(t)), may divide at others.
    times = [k * SOON for k in (1, 3, 5, 7, 11)]
    for _ in range(len(form.p) + 2 + len(times)):
        current = problem.put(put)
        part = Clock(min(FORMULAS, clock.remaining() / 2))
        now = {**values, symbols.t: times[0]}
        search = Elimination(current.x, current.sliding, now, part, numeric)
        try:
            branches = search.solve(current.equations)
            break
        except DegenerateError as error:
            names = {q: v for q, v in values.items() if error.expression.has(q)}
            zero = {q: v for q, v in names.items() if v == 0} or names
            if error.expression.has(symbols.t) and len(times) > 1:
                times.pop(0)
                continue
            if error.expression.has(symbols.t) or not zero:
                notes.append(Missing(f"mode {mode!r} is not solved: {error.expression} is 0."))
                break
            degenerate += tuple(f"{q} = {v}" for q, v in zero.items())
            put |= zero
        except (UnsolvedError, OutOfBudgetError):
            clock.check()
            if numeric:
                fallback = NumericMode.of_expressions(current.put(values).put({symbols.t: exact(t or 0.0)}))
                more, said = numeric_equilibria(fallback, ranges, clock)
                return more, said
            numeric = True
            put |= values
    still, moving = _apart(branches)
    held: list[EquilibriumPoint | EquilibriumSet] = []
    held += [point for branch in moving for point in _held(current, branch, {**values, **put})]
    if moving and len(held) < len(moving):
        notes.append(
            f"mode {mode!r}: what balances the field moves with the time t and is no equilibrium. "
            "Give t=... to freeze the system."
        )
    notes += _turns(current, still)
    box = dict(zip(form.x, ranges, strict=True))
    existence = Existence(current, {**values, **put}, degenerate, ranges=box)
    if any(existence.folded(branch) for branch in still):
        part = Clock(min(FORMULAS, clock.remaining() / 2))
        search = replace(search, by_state=True, clock=part)
        try:
            still = _apart(search.solve(current.equations))[0]
        except (DegenerateError, UnsolvedError, OutOfBudgetError):
            clock.check()
            notes.append(Missing(f"mode {mode!r}: the borders of a set are those of its formula."))
    for branch in still:
        rounded = any(q.has(sympy.Float) for q in branch.values())
        held += replace(existence, exact=not numeric or (plain and not rounded)).of(branch)
    for q in sorted(existence.searched, key=str):
        low, high = box.get(q, (-FAR, FAR))
        text = f"the borders of a set were searched numerically in {q} in [{low:g}, {high:g}]"
        notes.append(Missing(f"mode {mode!r}: {text}; some may be missed."))
    return held, notes


def _turns(problem: ModeProblem, branches: Sequence[Family]) -> list[str]:
    """Notes on the states that stand in sines, cosines and tangents: only roots of one turn are listed."""
    notes = []
    for x in problem.x:
        waves = {
            q
            for e in problem.equations
            for q in e.atoms(sympy.sin, sympy.cos, sympy.tan)
            if q.has(x) and q.args[0].diff(x).is_number
        }
        if not waves or not any(x in b for b in branches):
            continue
        periods = {2 * sympy.pi / abs(q.args[0].diff(x)) for q in waves}
        period = max(periods, key=float)
        expressions = [*problem.equations, *(b.g for b in problem.bounds)]
        same = all(sympy.simplify(e.subs(x, x + period) - e) == 0 for e in expressions if e.has(x))
        if same:
            turns = f"{x} + k ({period}), k a whole number"
            text = f"with each equilibrium {turns}, gives one too; those of one turn are listed."
        else:
            text = Missing(
                f"{x} stands in sines or cosines: roots further than one turn of {period} may be missing."
            )
        notes.append(text)
    return notes


def _held(problem: ModeProblem, branch: Family, values: Mapping[Symbol, Expr]) -> list[EquilibriumPoint]:
    """A point that stays while its multipliers move with time, clear of their bounds at all times."""
    if any(q not in branch or branch[q].has(symbols.t) for q in problem.x):
        return []
    for q, limits in zip(problem.sliding, problem.limits, strict=True):
        found = bounds(exact(sympy.S(branch.get(q, q)).subs(values)))
        low, high = (sympy.S(e).subs(values) for e in limits)
        if found is None or not (low.is_number and high.is_number and low < found[0] and found[1] < high):
            return []
    now = {symbols.t: SOON}
    frozen = {q: e.subs(now) for q, e in branch.items()}
    point = Existence(problem.put(now), values).point(frozen)
    others = [b.g.subs(branch) for b in problem.bounds if b.surface not in problem.names]
    if point is None or any(g.has(symbols.t) for g in others):
        return []
    multipliers = tuple((name, branch[q]) for name, q in zip(problem.names, problem.sliding, strict=True))
    return [replace(point, multipliers=multipliers, conditions=())]


def _apart(branches: list[Family]) -> tuple[list[Family], list[Family]]:
    moving = [b for b in branches if any(e.has(symbols.t) for e in b.values())]
    return [b for b in branches if b not in moving], moving


def _kept(
    system: System, found: list[EquilibriumPoint | EquilibriumSet], p: Any
) -> tuple[list[EquilibriumPoint | EquilibriumSet], list[str]]:
    """Leave out what the reset of a time event moves, with a note each."""
    numbers = _numbers(system, p)
    kept, notes = list[EquilibriumPoint | EquilibriumSet](), []
    for e in found:
        name = mover(system, e, p, numbers)
        parts = _unmoved(system, e, numbers) if name is not None else [e]
        kept += parts
        if not parts:
            notes.append(f"mode {e.mode!r}: what balances the field is moved by {name!r}, no equilibrium.")
    return kept, list(dict.fromkeys(notes))


def _unmoved(
    system: System, found: EquilibriumPoint | EquilibriumSet, numbers: Mapping[Symbol, Expr]
) -> list[EquilibriumPoint | EquilibriumSet]:
    """The isolated points of a set that all resets of time events keep, where polynomials say them."""
    form = exact_form(system)
    if form is None or not isinstance(found, EquilibriumSet):
        return []
    place = dict(zip(form.x, found.x, strict=True))
    changes = [
        short((e - x).subs(place, simultaneous=True))
        for k, event in enumerate(system.time_events)
        if event.reset is not None
        for x, e in zip(form.x, after(system, k, found.mode), strict=True)
    ]
    changes = [e for e in changes if e != 0]
    if any(e.has(symbols.t) or not e.is_polynomial(*found.free) for e in changes):
        return []
    try:
        solved = [tuple(c) for c in sympy.linsolve(changes, *found.free)]
    except (ValueError, NotImplementedError):
        solved = _roots(changes, found.free, numbers)
    out: list[EquilibriumPoint | EquilibriumSet] = []
    for c in solved:
        if any(e.has(*found.free) for e in c):
            return []
        at = dict(zip(found.free, c, strict=True))
        inside = [
            float(low) < float(at[q].subs(numbers)) < float(high)
            for q, (low, high) in zip(found.free, found.bounds, strict=True)
        ]
        poles = (sympy.zoo, sympy.nan, sympy.oo, -sympy.oo)
        ends = any(e.subs(at).subs(numbers).has(*poles) for e in found.x)
        if all(inside) and not ends:  # the set may go to infinity there
            out.append(_one_of(found, at, numbers))
    return out


def _roots(
    changes: Sequence[Expr], free: Sequence[Symbol], numbers: Mapping[Symbol, Expr]
) -> list[tuple[Expr, ...]]:
    """The common real roots of polynomials in one symbol, at the parameter values; [] for more symbols."""
    if len(free) != 1:
        return []
    common = sympy.S.Zero
    for e in changes:
        common = sympy.gcd(common, sympy.numer(sympy.together(e.subs(numbers))))
    if not common.has(free[0]) or common.free_symbols - {free[0]}:
        return []
    return [(root,) for root in sympy.Poly(common, free[0]).sqf_part().real_roots()]


def _one_of(
    found: EquilibriumSet, at: Mapping[Symbol, Expr], numbers: Mapping[Symbol, Expr]
) -> EquilibriumPoint:
    """The point of a set at values of its free symbols."""
    x = tuple(e.subs(at) for e in found.x)
    multipliers = tuple((name, e.subs(at)) for name, e in found.multipliers)
    return EquilibriumPoint(
        found.mode, found.states, x, multipliers, tuple(float(e.subs(numbers)) for e in x),
        tuple(float(e.subs(numbers)) for _, e in multipliers),
        "pseudo-equilibrium" if "0" in found.mode else "equilibrium", (), found.exact, found.degenerate,
    )  # fmt: skip


def _numbers(system: System, p: Any) -> dict[Symbol, Expr]:
    form = exact_form(system)
    if form is None:
        return {}
    return in_exponents(form.expressions(), {q: exact(v) for q, v in zip(form.p, p.tolist(), strict=True)})


def _without_doubles(
    found: list[EquilibriumPoint | EquilibriumSet], system: System, p: Any
) -> list[EquilibriumPoint | EquilibriumSet]:
    """Leave out a point that is an end of a set, and what the two sides of a kink or a surface both have."""
    kept: list[EquilibriumPoint | EquilibriumSet] = []
    places: list[tuple[float, ...]] = []
    half: list[EquilibriumPoint] = []
    formulas = set()
    numbers = _numbers(system, p)
    near = _Nearness.of(found)
    for e in found:
        # In the plane what cuts two halves off is in the conditions only.
        if isinstance(e, EquilibriumSet) and (what := _described(e)) not in formulas:
            formulas.add(what)
            if e.bounded:
                places += [end.value for end in e.ends]
            half += () if e.bounded else e.ends
            kept.append(e)
    for e in found:
        if isinstance(e, EquilibriumPoint) and not any(near(e.value, place) for place in places):
            # A point that slides where a half line ends has a verdict of its own.
            if any(near(e.value, end.value) and _slides(e) == _slides(end) for end in half):
                continue
            places.append(e.value)
            if not any(_inside(e, s, numbers, near) for s in kept if isinstance(s, EquilibriumSet)):
                kept.append(e)
    return kept


def _described(e: EquilibriumSet) -> tuple[object, ...]:
    return e.x, e.domain, frozenset(e.conditions) if e.dimension > 1 else None


def _slides(point: EquilibriumPoint) -> list[bool]:
    return [m == "0" for m in point.mode]


def _inside(
    point: EquilibriumPoint, found: EquilibriumSet, numbers: Mapping[Symbol, Expr], near: _Nearness
) -> bool:
    """Whether a point of the same mode lies in a set whose free symbols are states."""
    at = dict(zip(point.states, point.value, strict=True))
    if point.mode != found.mode or any(q.name not in at for q in found.free):
        return False
    put = {q: sympy.Float(at[q.name], 20) for q in found.free}
    within = all(a <= at[q.name] <= b for q, (a, b) in zip(found.free, found.bounds, strict=True))
    values = [e.subs(put).subs(numbers).evalf(20) for e in found.x]
    return within and all(v.is_number for v in values) and near([float(v) for v in values], point.value)


# What is left of a formula's digits in a float.
_ROUNDING = 1e-15


@dataclass(frozen=True)
class _Nearness:
    """Whether two places are one: formulas to rounding, what was searched to the accuracy of the search.

    part   of the places, and known of each state, up to which they are one
    """

    known: tuple[float, ...]
    part: float = 1e-9

    @classmethod
    def of(cls, found: Sequence[EquilibriumPoint | EquilibriumSet]) -> _Nearness:
        """By the sizes of the places found."""
        places = [e.value for e in found if isinstance(e, EquilibriumPoint)]
        places += [end.value for e in found if isinstance(e, EquilibriumSet) for end in e.ends]
        exact = all(e.exact for e in found)
        least, part = (1e-60, _ROUNDING) if exact else (1e-9, 1e-9)
        known = (max(least, 1e-15 * max(map(abs, column))) for column in zip(*places, strict=True))
        return cls(tuple(known), part)

    def __call__(self, x: Sequence[float], y: Sequence[float]) -> bool:
        return all(
            abs(a - b) <= max(self.part * max(abs(a), abs(b)), known)
            for a, b, known in zip(x, y, self.known, strict=True)
        )
