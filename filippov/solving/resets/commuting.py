"""Whether the resets that are due at one instant come to the same state in every order, and to which.

Two resets commute as maps where neither reads what the other writes, and a state that both write is moved by
both (x + a, x + b) or put on one value by both. Those that do not are applied in every order, at the state
there is: every set of them has to come to one state, whichever of them was the last.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.resets.in_turn import reads_signs, signs_after
from filippov.solving.state.run import Run

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from filippov.model.symbolic import SymbolicForm
    from filippov.model.system import System

SAME = 1e-9  # states are one state, relative to the largest that an order passed through
# So many resets that may not commute are applied in every order, n! of few and 2**n states of more; beyond
# that a sample of orders.
MOST_ORDERS, MOST_TOGETHER, ORDERS = 6, 8, 64

_At = tuple[Array, Array]  # a state, and the signs there
_Reset = Callable[[int, Array, Array], _At]


def composed(run: Run, x: Array, size: Array, mode: Array, due: Sequence[int]) -> Array | None:
    """The state after all the resets that are due, shape (n,); None where it depends on their order.

    size: per state the magnitude of which differences are rounding.
    """
    machine, reads = run.machine, len(due) > 1 and reads_signs(run.machine.system)

    def reset(i: int, at: Array, signs: Array) -> _At:
        after = machine.reset(i, run.t, at, signs)
        return after, (signs_after(machine, run.t, at, after, signs) if reads else signs)

    if len(due) == 1:
        return machine.reset(due[0], run.t, x, mode)
    after: _At | None = (x, mode)
    for group in groups(machine.system, tuple(due)):
        if after is not None:
            every = _every_order if len(group) <= MOST_TOGETHER else _some_orders
            after = every(reset, after, size + run.atol, group)
    return None if after is None else after[0]


def _every_order(reset: _Reset, start: _At, scale: Array, due: Sequence[int]) -> _At | None:
    reached: dict[frozenset[int], _At] = {frozenset(): start}
    for count in range(1, len(due) + 1):
        for chosen in itertools.combinations(due, count):
            ends = [reset(i, *reached[frozenset(chosen) - {i}]) for i in chosen]
            scale = np.fmax(scale, np.max(np.abs([x for x, _ in ends]), axis=0))
            if not (_one(ends, scale) and all(np.array_equal(signs, ends[0][1]) for _, signs in ends)):
                if len(due) > MOST_ORDERS:
                    return None
                return _agreeing(reset, start, scale, itertools.permutations(due))  # they may meet again
            reached[frozenset(chosen)] = ends[0]
    return reached[frozenset(due)]


def _some_orders(reset: _Reset, start: _At, scale: Array, due: Sequence[int]) -> _At | None:
    rng = np.random.default_rng(0)
    orders = [due, due[::-1], *(rng.permutation(due).tolist() for _ in range(ORDERS))]
    return _agreeing(reset, start, scale, orders)


def _agreeing(reset: _Reset, start: _At, scale: Array, orders: Iterable[Sequence[int]]) -> _At | None:
    ends: list[_At] = []
    for order in orders:
        after = start
        for i in order:
            after = reset(i, *after)
            scale = np.fmax(scale, np.abs(after[0]))
        ends.append(after)
    return ends[0] if _one(ends, scale) else None


def _one(ends: Sequence[_At], scale: Array) -> bool:
    return all(bool(np.all(np.abs(end[0] - ends[0][0]) <= SAME * scale)) for end in ends[1:])


@lru_cache(maxsize=256)
def groups(system: System, due: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
    """The resets that are due, in groups that commute with each other; one where they are plain functions."""
    form = system.symbolic
    if form is None:
        return (due,)
    rows = [*(form.reset or [None] * len(form.h)), *form.time_reset]
    known = {i: _effect(form, rows[i]) for i in due if i < len(rows)}
    pairs = [
        (i, j) for i, j in itertools.combinations(known, 2) if not _commute(known[i], known[j], form)
    ]
    if not pairs:
        return tuple((i,) for i in due)
    import networkx as nx  # takes longer to import than most runs

    graph = nx.Graph(pairs)
    graph.add_nodes_from(due)
    return tuple(tuple(sorted(group)) for group in nx.connected_components(graph))


def _effect(form: SymbolicForm, row: Sequence[Expr] | None) -> dict[Symbol, Expr]:
    """What a reset puts each of the states on that it changes."""
    if row is None:
        return {}
    return {x: after for x, after in zip(form.x, row, strict=True) if after != x}


def _commute(one: dict[Symbol, Expr], other: dict[Symbol, Expr], form: SymbolicForm) -> bool:
    """Whether two resets come to the same in both orders at every state."""
    for mine, theirs in ((one, other), (other, one)):
        for x, after in mine.items():
            if x not in theirs:
                read = after
            elif after == theirs[x] and not _states(after, form) & {*mine, *theirs}:
                continue
            else:
                read = after - x
            if _states(read, form) & set(theirs):
                return False
    return True


def _states(expression: Expr, form: SymbolicForm) -> set[Symbol]:
    """The states that an expression reads, also by the signs and the sizes |h| in it."""
    found = set(expression.free_symbols)
    for s, a, h in zip(reversed(form.s), reversed(form.a), reversed(form.h), strict=True):
        if a in found or s in found:
            found |= h.free_symbols
    return found & set(form.x)
