"""The word of a periodic solution: the modes of one period, such as "stick slip- stick slip+"."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.model.system import System
from filippov.solving.solution import Solution

if TYPE_CHECKING:
    import sympy

Item = TypeVar("Item", bound=Hashable)

STICK_SLIP = {"0": "stick", "+": "slip+", "-": "slip-"}
_ORDER = {"0": 0, "-": 1, "+": 2, ".": 3}


def periodic_tail(sequence: Sequence[Item]) -> tuple[Item, ...]:
    """The shortest block that the end of a sequence repeats; () if nothing is repeated.

    For each period p the longest end with q[k] = q[k - p] is measured. The answer is the smallest p whose end
    holds two periods and is at least half as long as the longest such end: a short repetition inside a longer
    word does not count.
    """
    n = len(sequence)
    reach: dict[int, int] = {}
    for p in range(1, n // 2 + 1):
        k = n - 1
        while k >= p and sequence[k] == sequence[k - p]:
            k -= 1
        length = n - 1 - k + p
        if length >= 2 * p:
            reach[p] = length
    if not reach:
        return ()
    longest = max(reach.values())
    period = min(p for p, length in reach.items() if 2 * length >= longest)
    return tuple(sequence[n - period :])


@keywords()
def mode_word(solution: Solution, names: Mapping[str, str] | None = None) -> str:
    """The modes of one period of the solution's end, separated by blanks; "" where the end is not periodic.

    names: words for modes, by mode text; a mode that is not among them keeps its text. Default: stick, slip+
    and slip- where the only surface is a velocity, mode texts else. A word begins where it comes first in the
    order 0, -, +, so that it does not depend on when the run began or ended. Only modes are compared, not
    states.
    """
    return word_of(periodic_tail(solution.modes), solution.system, names)


def word_of(period: Sequence[str], system: System, names: Mapping[str, str] | None = None) -> str:
    """The word of the modes of one period, wherever it begins (see `mode_word`)."""
    if names is None:
        names = STICK_SLIP if is_velocity(system) else {}
    elif not isinstance(names, Mapping):
        raise UsageError(
            f"names is {names!r}, expected a dict from mode text to word, such as {{'0': 'stick'}}."
        )
    items = tuple(period)
    turns = [items[k:] + items[:k] for k in range(len(items))]
    first = min(turns, key=lambda turn: [[_ORDER[c] for c in mode] for mode in turn], default=())
    return " ".join(names.get(mode, mode) for mode in first)


def is_velocity(system: System) -> bool:
    """Whether the only surface is a (relative) velocity: h = c x_j' + function of t, or a function named
    so."""
    if len(system.surfaces) != 1 or system.surfaces[0].kind != "switching":
        return False
    if system.symbolic is None:
        return "velocity" in system.surfaces[0].name.lower()
    form = system.symbolic
    return _is_rate(form.h[0], form.x, form.field)


# It is asked for each point of a branch.
@lru_cache(maxsize=64)
def _is_rate(h: sympy.Expr, x: tuple[sympy.Symbol, ...], field: tuple[sympy.Expr, ...]) -> bool:
    slopes = {state: h.diff(state) for state in x}
    moving = [state for state, slope in slopes.items() if slope != 0]
    if len(moving) != 1 or slopes[moving[0]].free_symbols & set(x):
        return False
    return any(f in (moving[0], h) for f in field)
