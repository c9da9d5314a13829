"""Time events beside equilibria: which equilibria their resets keep, and the phases of one period of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from sympy import Expr

from filippov import System
from filippov import t as time
from filippov.analysis.algebra.exact_form import exact_form
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.base.arrays import Array
from filippov.model.symbolic import Select

KEPT = 1e-9
MOST_TURNS = 64


@dataclass(frozen=True)
class Phases:
    """One common period of all clocks that reset: (phase, index of the time event), in order."""

    period: float
    instants: tuple[tuple[float, int], ...]


def resetting(system: System) -> list[int]:
    """The clocks that reset forever; a list of instants ends, and the system after its last one decides."""
    return [k for k, e in enumerate(system.time_events) if e.reset is not None and e.period is not None]


def phases(system: System, values: Array) -> Phases | None:
    """The common period of the clocks with resets; None where no small multiple of the shortest is one."""
    record = None if system.symbolic is not None else system.parameters.record(values)
    named = dict(zip(system.parameters.names, values.tolist(), strict=True))
    clocks: list[tuple[int, float, float]] = []
    for k in resetting(system):
        start, period = system.time_events[k].numbers(record, named)
        clocks.append((k, start, period))
    shortest = min(period for _, _, period in clocks)
    for turns in range(1, MOST_TURNS + 1):
        whole = turns * shortest
        if all(abs(whole / q - round(whole / q)) <= 1e-12 * whole / q for _, _, q in clocks):
            break
    else:
        return None
    instants: list[tuple[float, int]] = [
        (float(math.fmod(start + n * q, whole) % whole), k)
        for k, start, q in clocks
        for n in range(round(whole / q))
    ]
    return Phases(whole, tuple(sorted(instants)))


def after(system: System, k: int, mode: str) -> tuple[Expr, ...]:
    """The states after time event k, from a state in this mode."""
    form = exact_form(system)
    assert form is not None
    row = form.time_reset[k]
    assert row is not None
    fixed = {s: sympy.Integer(m) for s, m in zip(form.s, form.signs(mode), strict=True)}
    return tuple(e.xreplace(fixed).xreplace(form.sizes_at_mode(mode)) for e in row)


def branch_points(
    row: Sequence[Expr], put: Mapping[Any, Expr], values: Mapping[Any, Expr]
) -> list[Expr]:  # fmt: skip
    """The u = 0 at which |u|, Max or Min of a reset change their branch at a point: it has no derivative."""
    out = []
    for select in set().union(*(sympy.S(e).atoms(Select) for e in row)):
        at = select.args[0].subs(put).subs(values)
        if not at.is_number or abs(complex(at)) <= KEPT:
            out.append(select.args[0])
    return out


def mover(
    system: System, found: EquilibriumPoint | EquilibriumSet, values: Array, numbers: Mapping[Any, Expr]
) -> str | None:
    """Name of a time event whose reset moves the state away from the equilibrium; None where all keep it."""
    for k, event in enumerate(system.time_events):
        if event.reset is None:
            continue
        if system.symbolic is None:
            x = np.array(found.value if isinstance(found, EquilibriumPoint) else found.ends[0].value)
            moved = np.asarray(event.reset(0.0, x.copy(), system.parameters.record(values)), dtype=float)
            if np.max(np.abs(moved - x)) > KEPT * (1.0 + np.max(np.abs(x))):
                return event.name
            continue
        form = exact_form(system)
        assert form is not None
        put = dict(zip(form.x, found.x, strict=True))
        # Points of a set at two places that are nothing special.
        free = found.free if isinstance(found, EquilibriumSet) else ()
        for number in (sympy.Rational(3, 11), sympy.Rational(7, 13))[: 2 if free else 1]:
            at = {**numbers, **dict.fromkeys(free, number), time: sympy.Rational(5, 17)}
            for x, e in zip(form.x, after(system, k, found.mode), strict=True):
                change = (e - x).subs(put).subs(at).evalf(25)
                if not change.is_number or abs(change) > KEPT:
                    return event.name
    return None
