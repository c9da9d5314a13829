"""Transitions by resets of a symbolic system, as formulas: impacts, resting contact, clocks.

    reset on surface i    h_i = 0 and dh_i/dt < 0 seen from its side; the signs are those of the state after
                          it, on h_i = 0 that of dh_i/dt
    contact begins        h_i = dh_i/dt = 0 and the unpushed d2h_i/dt2 < 0, the limit of ever smaller impacts
    contact ends          the unpushed d2h_i/dt2 reaches 0 and increases
    clock                 at its instants; the signs as they are after its reset

Source: Brogliato 2016, section 5; di Bernardo, Budd, Champneys, Kowalczyk 2008, section 2.2.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.base.status import EventKind
from filippov.graphs.guards import Guards, Transition, formula_text, with_sign
from filippov.model.size import cancelled
from filippov.model.symbolic import rate_along
from filippov.model.table import vanishes
from filippov.solving.state.events import Mode


def reset_transitions(guards: Guards, mode: Mode) -> Iterator[Transition]:
    """The ways out of a mode through surfaces with resets and through time events."""
    for i, surface in enumerate(guards.system.surfaces):
        if surface.kind != "reset":
            continue
        contact = guards.form.contact[i] if guards.form.contact else None
        if mode[i] == 0:
            yield from _lift(guards, mode, i)
        elif surface.side in ("both", "+" if mode[i] > 0 else "-"):
            yield from _reset(guards, mode, i)
            if contact is not None:
                yield from _land(guards, mode, i)
    for k, event in enumerate(guards.system.time_events):
        yield from _tick(guards, mode, k, event.name)


def _reset(guards: Guards, mode: Mode, i: int) -> Iterator[Transition]:
    rate = guards.rate(mode, i)
    row = guards.form.reset[i]
    if rate is None or row is None:
        return
    on = guards.at_surface(mode, i)
    towards = sympy.Lt(guards.settled(rate, on), 0) if mode[i] > 0 else sympy.Gt(guards.settled(rate, on), 0)
    where = sympy.Eq(guards.h(mode)[i], 0)
    if towards == sympy.false or not guards.reached(mode, i, 0):
        return
    name = guards.label(i)
    guard = f"{name} = 0 and d{guards.bracket(i)}/dt {'<' if mode[i] > 0 else '>'} 0"
    for target, conditions in _after(guards, mode, row, on, i):
        kept = tuple(c for c in (where, towards, *conditions) if c != sympy.true)
        yield Transition(mode, target, guards.names[i], EventKind.RESET, guard, kept)


def _land(guards: Guards, mode: Mode, i: int) -> Iterator[Transition]:
    push = _acceleration(guards, mode, i)
    if push is None:
        return
    h, (rate, growth) = guards.h(mode)[i], push
    pressed = sympy.Lt(growth, 0) if mode[i] > 0 else sympy.Gt(growth, 0)
    if pressed == sympy.false or not guards.reached(mode, i, 0, [rate]):
        return
    d = guards.bracket(i)
    guard = f"{guards.label(i)} = 0 and d{d}/dt = 0 and d2{d}/dt2 {'<' if mode[i] > 0 else '>'} 0"
    conditions = (sympy.Eq(h, 0), sympy.Eq(rate, 0), pressed)
    kept = tuple(c for c in conditions if c != sympy.true)
    yield Transition(mode, with_sign(mode, i, 0), guards.names[i], EventKind.ENTRY, guard, kept)


def _lift(guards: Guards, mode: Mode, i: int) -> Iterator[Transition]:
    contact = guards.form.contact[i]
    assert contact is not None
    target = with_sign(mode, i, contact.side)
    push = _acceleration(guards, target, i)
    if push is None:
        return
    growth = push[1]
    further = rate_along(growth, guards.vertex(target), guards.form.x)
    outwards = sympy.Gt(further, 0) if contact.side > 0 else sympy.Lt(further, 0)
    balance = sympy.Eq(growth, 0)
    if sympy.false in (outwards, balance):
        return
    word = "increasing" if contact.side > 0 else "decreasing"
    guard = f"d2{guards.bracket(i)}/dt2 = 0 and {word}"
    kept = tuple(c for c in (balance, outwards) if c != sympy.true)
    yield Transition(mode, target, guards.names[i], EventKind.EXIT, guard, kept)


def _acceleration(guards: Guards, mode: Mode, i: int) -> tuple[Expr, Expr] | None:
    """dh/dt and d2h/dt2 beside the surface, on h = 0; None where other sliding is not determined."""
    rate = guards.rate(mode, i)
    solved = guards.multipliers(mode)
    if rate is None or solved is None:
        return None
    field = [f.xreplace(solved) for f in guards.vertex(mode)]
    growth = rate_along(rate, field, guards.form.x)
    on = guards.at_surface(mode, i)
    return guards.settled(rate, on), guards.settled(growth, on)


def _tick(guards: Guards, mode: Mode, k: int, name: str) -> Iterator[Transition]:
    row = guards.form.time_reset[k] if guards.form.time_reset else None
    instants = ", ".join(formula_text(q) for q in guards.system.time_events[k].instants[:3])
    clock = guards.system.time_events[k].times is None
    guard = f"t = {instants.replace(', ', ' + k ', 1)}" if clock else f"t in {{{instants}}}"
    if row is None:
        yield Transition(mode, mode, name, EventKind.TIME, guard, ())
        return
    on = guards.on([h for h, m in zip(guards.h(mode), mode, strict=True) if m == 0])
    for target, conditions in _after(guards, mode, row, on):
        yield Transition(mode, target, name, EventKind.TIME, guard, conditions)


def _after(
    guards: Guards, mode: Mode, row: Sequence[Expr], on: Mapping[Symbol, Expr], by: int | None = None
) -> Iterator[tuple[Mode, tuple[Any, ...]]]:
    """The modes after a reset, `by` a surface or a clock, with the conditions under which they follow."""
    form = guards.form
    fixed = {s: sympy.Integer(m) for s, m in zip(form.s, mode, strict=True) if m}
    moved = dict(
        zip(form.x, (e.xreplace(fixed).xreplace(form.sizes_at_mode(mode)) for e in row), strict=True)
    )
    choices: list[list[tuple[int, Any]]] = []
    for j, m in enumerate(mode):
        before = guards.settled(guards.plain(mode)[j], on)
        after = guards.settled(guards.plain(mode)[j].xreplace(moved), on)
        rate = guards.rate(mode, j) if j == by and after == 0 else None
        if rate is None:
            choices.append(_signs(m, before, after))
        else:
            # On its surface after the reset: dh/dt tells the side on which the solution goes on.
            turned = _signs(-m, guards.settled(rate, on), guards.settled(rate.xreplace(moved), on))
            choices.append([pair for pair in turned if pair[0]])
    for chosen in itertools.product(*choices):
        conditions = tuple(c for _, c in chosen if c != sympy.true)
        if sympy.false not in conditions:
            yield tuple(sign for sign, _ in chosen), conditions


def _signs(m: int, before: Expr, after: Expr) -> list[tuple[int, Any]]:
    """The signs that h may have after a reset, from its sign and its formulas before and after."""
    if vanishes(before - after):
        return [(m, sympy.true)]
    ratio = cancelled(after / before) if m and before != 0 else sympy.nan
    if ratio.is_nonnegative or ratio.is_nonpositive:
        return [(m if ratio.is_nonnegative else -m, sympy.true)]
    found = [(1, sympy.Gt(after, 0)), (-1, sympy.Lt(after, 0))]
    if m == 0:
        found.append((0, sympy.Eq(after, 0)))
    return found
