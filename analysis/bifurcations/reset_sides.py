"""On which side of its kinks each reset of a period is: x > 0 or not where a reset holds Abs(x) or Max(0, x).

Where the state at a reset passes such a side along a branch, the map over a period changes its derivative
there: a border collision. Source: di Bernardo, Budd, Champneys, Kowalczyk 2008, Piecewise-smooth Dynamical
Systems, ch. 3.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import sympy
from sympy import Expr

from filippov import EventKind, Solution, System
from filippov import t as time
from filippov.base.arrays import Array
from filippov.model.symbolic import Select

_RESETS = (EventKind.RESET, EventKind.TIME)


def reset_sides(solutions: Sequence[Solution], p: Array) -> str:
    """The sides in a period, such as "tick: x > 0, 2 times"; "" where no reset has a kink."""
    kinks = _kinks(solutions[0].system)
    if not kinks:
        return ""
    seen: Counter[str] = Counter()
    for event in itertools.chain(*(one.events for one in solutions)):
        if event.kind not in _RESETS or event.x_after is None:
            continue
        for g, at in kinks.get(event.index, ()):
            seen[f"{event.surface}: {g} {'>' if at(event.t, event.x, p) > 0 else '<='} 0"] += 1
    return ", ".join(f"{side}, {count} times" if count > 1 else side for side, count in sorted(seen.items()))


@lru_cache(maxsize=64)
def _kinks(system: System) -> dict[int, tuple[tuple[Expr, Callable[..., Any]], ...]]:
    """By the number of the event: what a reset asks the sign of, with its function of t, x, p."""
    form = system.symbolic
    if form is None:
        return {}
    rows = [*(form.reset or [None] * len(form.h)), *form.time_reset]
    out = {}
    for i, row in enumerate(rows):
        asked = dict.fromkeys(itertools.chain(*(_asked(e) for e in row or ())))
        plain = [g for g in asked if not g.free_symbols & {*form.s, *form.a}]
        if plain:
            out[i] = tuple((g, sympy.lambdify((time, form.x, form.p), g, "numpy")) for g in plain)
    return out


def _asked(expression: Expr) -> list[Expr]:
    """The expressions at whose zeros another one has a kink or a jump."""
    out = [e.args[0] for e in expression.atoms(sympy.Abs, sympy.sign)]
    # Max, Min and Piecewise are these in the form of a system.
    out += [e.args[0] for e in expression.atoms(Select) if not e.args[0].has(Select)]
    return [g if not g.could_extract_minus_sign() else -g for g in sorted(out, key=sympy.default_sort_key)]
