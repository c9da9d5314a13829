"""What the exact automaton of a system is made of, as expressions that name the states, signs and modes.

Signs s and modes m stand for what the runtime hands over: in a mode s_i = m_i = +1 or -1; on a surface that
the solution slides on m_i = 0, and the runtime asks for the field at s_i = +1 and -1 and combines both.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.kernel.codegen.generate import filled, jointly_affine, sizes_used, structure, total_gradients
from filippov.kernel.codegen.generate_resets import contact_field, contact_guards, contact_rows
from filippov.model.symbolic import Select, SymbolicForm, convex
from filippov.model.symbols import t
from filippov.model.system import System
from filippov.solving.expressions import read_with_signs
from filippov.solving.resets.commuting import groups

_SIDES = {"+": 1, "-": -1, "both": 2}


@dataclass(frozen=True)
class Equations:
    """The expressions of a system by purpose, in t, states, parameters, signs s, sizes a = |h|, modes m.

    modes       one symbol per surface: +1, -1 or 0
    field       one per state; guards: one per surface, dh/dt where the state rests on it
    gradients   a row per surface: by every state, then by t
    ends        lower and upper end of the set of signs at h = 0
    resets      per surface the states after its reset, or None; strikes: per time event likewise
    component   the number of its group of coupled surfaces, for every surface
    order       the number of its group of resets that may not commute, for every surface, then every clock
    affine      the field is a constant plus a sum of terms in one sign each
    outputs     one per output of the system; a sign in it is the multiplier where the mode is 0
    """

    system: System
    form: SymbolicForm
    modes: tuple[Symbol, ...]
    field: tuple[Expr, ...]
    guards: tuple[Expr, ...]
    gradients: tuple[tuple[Expr, ...], ...]
    ends: tuple[tuple[Expr, Expr], ...]
    resets: tuple[tuple[Expr, ...] | None, ...]
    strikes: tuple[tuple[Expr, ...] | None, ...]
    component: tuple[int, ...]
    order: tuple[int, ...]
    affine: bool
    outputs: tuple[Expr, ...]

    @property
    def widths(self) -> tuple[float, ...]:
        """Half-width of the hysteresis of every surface, 0 for none."""
        return tuple(float(q.width) for q in self.system.surfaces)

    @property
    def reset_from(self) -> tuple[int, ...]:
        """The side from which a surface resets the state: +1, -1, 2 for both, 0 for none."""
        return tuple(_SIDES[q.side] if q.reset is not None else 0 for q in self.system.surfaces)

    @property
    def contact(self) -> tuple[int, ...]:
        """The side on which the state may rest on a surface, 0 for none."""
        return tuple(_SIDES[q.side] if q.contact else 0 for q in self.system.surfaces)

    def sizes(self, expressions: Iterable[Expr]) -> list[tuple[Symbol, Expr]]:
        """(a_i, m_i h_i) for the sizes that stand in expressions, in an order to compute them in."""
        used: set[Symbol] = set().union(*(e.free_symbols for e in expressions))
        form = self.form
        return [(form.a[i], self.modes[i] * form.h[i]) for i in sizes_used(form, used)]


def equations(system: System) -> Equations:
    """The automaton of a system. Raises ModelError for one that has none that can be exported."""
    form = system.symbolic
    if form is None:
        raise ModelError(
            "the field is a plain function, expected expressions: only these can be written in another "
            "language. Give the system as System({x: ...})."
        )
    for surface, held in zip(system.surfaces, form.held, strict=False):
        if held:
            raise ModelError(
                f"surface {surface.name!r} is slid on by a derivative of its h (sliding of higher order), "
                "which an exported automaton does not decide. Export a form of the model without it."
            )
    modes = tuple(sympy.Dummy(f"m{i}", real=True) for i in range(len(form.h)))
    plain = total_gradients(form, modes)
    rows = contact_rows(form, plain, modes)
    field = contact_field(form, modes)
    none = (None,) * len(form.h)
    return Equations(
        system, form, modes, tuple(field), tuple(contact_guards(form, modes)),
        tuple(tuple(row) for row in rows), form.radius, form.reset or none, form.time_reset,
        tuple(structure(form, field, filled(rows)).components()), _orders(system, form), jointly_affine(form),
        tuple(_at_any_sign(read_with_signs(system, e), form, modes) for e in system.outputs.values()),
    )  # fmt: skip


def _orders(system: System, form: SymbolicForm) -> tuple[int, ...]:
    """The groups of resets whose order may matter at one instant."""
    count = len(form.h) + len(form.time_reset)
    number = {i: k for k, group in enumerate(groups(system, tuple(range(count)))) for i in group}
    return tuple(number[i] for i in range(count))


def _at_any_sign(f: Expr, form: SymbolicForm, modes: Sequence[Symbol]) -> Expr:
    """An expression whose choices by a sign are the mean of both where that sign is a multiplier, in mode 0.

    Elsewhere the other branch is not evaluated: it may have no value there.
    """
    if not f.has(Select):
        return f
    f = f.func(*(_at_any_sign(arg, form, modes) for arg in f.args))
    if isinstance(f, Select) and f.args[0] in form.s:
        return Select(modes[form.s.index(f.args[0])] ** 2, f, convex(f, {f.args[0]}))
    return f


def names_of(form: SymbolicForm, modes: Sequence[Symbol], first: int = 0) -> dict[Symbol, str]:
    """What stands for a symbol in the text: x[0], p[0], s[0], m[0], a0; first: the number of the first."""
    names: dict[Symbol, str] = {t: "t"}
    for letter, symbols in (("x", form.x), ("p", form.p), ("s", form.s), ("m", modes)):
        names |= {symbol: f"{letter}[{i + first}]" for i, symbol in enumerate(symbols)}
    return names | {a: f"a{i}" for i, a in enumerate(form.a)}
