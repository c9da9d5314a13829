"""The unit of a symbolic system with user events: expressions are compiled, functions called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import UsageError
from filippov.kernel.codegen.generate import generate
from filippov.kernel.codegen.generated import Generated
from filippov.model.extract import NONSMOOTH
from filippov.model.surface import Surface
from filippov.model.symbolic import SymbolicForm
from filippov.model.symbols import t

# The rows of functions come last; FIRST_CALLED is the first of them.
CALLED = """
@kernel
def inside(t: float, ctx: Indices) -> float:
    return min(max(t, from_bits(ctx[5])), from_bits(ctx[6]))

@kernel
def guards(t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    code = symbolic_guards(t, x, p, m, out, ctx)
    return code if code != 0 else call_guard(ctx[1], inside(t, ctx), x, p, m, shift(out, FIRST_CALLED))

@kernel
def gradients(t: float, x: Vector, p: Vector, m: Vector, g: Vector, gt: Vector, ctx: Indices) -> int:
    code = symbolic_gradients(t, x, p, m, g, gt, ctx)
    if code == 0:
        code = call_guard(ctx[2], inside(t, ctx), x, p, m, shift(g, FIRST_CALLED * N))
    if code == 0:
        code = call_guard(ctx[3], inside(t, ctx), x, p, m, shift(gt, FIRST_CALLED))
    return code
"""


def with_expressions(form: SymbolicForm, expressions: Sequence[Expr], functions: int) -> SymbolicForm:
    """The form with rows for user events; those of functions are constants, to be filled in by calls."""
    known = {t, *form.x, *form.p}
    for e in expressions:
        if not e.free_symbols <= known:
            strange = ", ".join(sorted(q.name for q in e.free_symbols - known))
            raise UsageError(f"event {e} holds {strange}, expected t, states and parameters of the system.")
        if e.has(*NONSMOOTH):
            raise UsageError(
                f"event {e} has a kink or a jump, expected a smooth one. Give it as a function g(t, y)."
            )
    rows = [*expressions, *[sympy.S.One] * functions]
    m, k = len(form.h), len(rows)
    none = (None,) * k
    return replace(
        form,
        s=form.s + tuple(Symbol(f"_s{m + i}", real=True) for i in range(k)),
        a=form.a + tuple(Symbol(f"_a{m + i}", nonnegative=True) for i in range(k)),
        h=form.h + tuple(rows),
        radius=form.radius + ((-sympy.S.One, sympy.S.One),) * k,
        reset=form.reset + none if form.reset else (),
        contact=form.contact + none if form.contact else (),
        held=form.held + (False,) * k if form.held else (),
    )


def generate_with_events(
    form: SymbolicForm, surfaces: tuple[Surface, ...], events: tuple[Surface, ...], blended: bool = False
) -> Generated:
    """The unit of a system with user events, those of expressions first; `blended` as in `generate`."""
    expressions = [e.h for e in events if e.symbolic]
    functions = len(events) - len(expressions)
    unit = generate(with_expressions(form, expressions, functions), (*surfaces, *events), blended)
    if not functions:
        return unit
    first = len(surfaces) + len(expressions)
    source = unit.source.replace("def guards(", "def symbolic_guards(").replace(
        "def gradients(", "def symbolic_gradients("
    )
    constants = dict(unit.constants)
    linear = constants["LINEAR"]
    assert isinstance(linear, list)
    constants |= {"LINEAR": [*linear[:first], *[0] * functions], "ALL_LINEAR": False, "FIRST_CALLED": first}
    # A unit that calls a Python function cannot run in lanes.
    constants["WIDE"] = False
    # A function may depend on every state; its row is the last of the gradients.
    starts, columns = constants["G_FIRST"], constants["G_COLUMN"]
    assert isinstance(starts, list)
    assert isinstance(columns, list)
    n, known = len(form.x), int(starts[first])
    constants["G_FIRST"] = [*map(int, starts[: first + 1]), *(known + n * (k + 1) for k in range(functions))]
    constants["G_COLUMN"] = [*map(int, columns[:known]), *list(range(n)) * functions]
    return Generated(source + CALLED, constants)
