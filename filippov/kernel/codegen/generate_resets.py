"""Kernel source of resets, and of resting contact as a mode of field, guards and gradients."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import sympy
from sympy import Expr, Symbol

from filippov.model.symbolic import Select, SymbolicForm
from filippov.model.symbols import t

OPEN_END = sympy.Float(1e300)


def _resting(mode: Symbol, resting: Expr, free: Expr) -> Expr:
    """One expression where the mode of a surface is 0, another where it is +1 or -1."""
    return Select(sympy.S.Half - mode**2, resting, free)


def contact_field(form: SymbolicForm, modes: Sequence[Symbol]) -> list[Expr]:
    """The field, with what pushes off the surfaces that the state rests on."""
    field = list(form.field)
    for i, contact in enumerate(form.contact):
        if contact is not None:
            for j, push in enumerate(contact.pushed(form.s[i])):
                if push is not sympy.S.Zero and push != 0:
                    field[j] += _resting(modes[i], push, sympy.S.Zero)
    return field


def contact_guards(form: SymbolicForm, modes: Sequence[Symbol]) -> list[Expr]:
    """The switching functions, with the rate dh/dt in place of h where the state rests on the surface."""
    h = list(form.h)
    for i, contact in enumerate(form.contact):
        if contact is not None:
            h[i] = _resting(modes[i], contact.rate, h[i])
    return h


def contact_rows(form: SymbolicForm, rows: list[list[Expr]], modes: Sequence[Symbol]) -> list[list[Expr]]:
    """Derivatives of the guards by the states and by t, to go with `contact_guards`."""
    out = [list(row) for row in rows]
    for i, contact in enumerate(form.contact):
        if contact is not None:
            inside = contact.rate.free_symbols
            for j, q in enumerate((*form.x, t)):
                if q in inside or rows[i][j] is not sympy.S.Zero:
                    out[i][j] = _resting(modes[i], contact.rate.diff(q), rows[i][j])
    return out


def contact_radii(form: SymbolicForm) -> list[list[Expr]]:
    """The sets at h = 0; that of a contact is open towards the surface's other side."""
    ends = [list(pair) for pair in form.radius]
    for i, contact in enumerate(form.contact):
        if contact is not None:
            ends[i][0 if contact.side > 0 else 1] = -contact.side * OPEN_END
    return ends


def reset_source(
    form: SymbolicForm,
    sizes: Callable[[set[Symbol]], list[str]],
    assign: Callable[[Sequence[tuple[str, Expr]]], list[str]],
) -> list[str]:
    """The kernel `resets`: one branch per surface, then one per time event; states not named are kept."""
    lines = [
        "@kernel",
        "def resets(i: int, t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices) -> int:",
        f"    for j in range({len(form.x)}):",
        "        out[j] = x[j]",
    ]
    none = (None,) * len(form.h)
    every = set(form.a)
    for i, after in enumerate((*(form.reset or none), *form.time_reset)):
        if after is None:
            continue
        moved = [(j, e) for j, (x, e) in enumerate(zip(form.x, after, strict=True)) if e is not x and e != x]
        used: set[Symbol] = set().union(*(e.free_symbols for _, e in moved)) & every
        targets = [(f"out[{j}]", e) for j, e in moved]
        if not targets:  # the state stays as it is
            continue
        lines.append(f"    if i == {i}:")
        lines += [f"    {line}" for line in (*sizes(used), *assign(targets))]
    return [*lines, "    return 0", ""]
