"""Kernel source of a symbolic system: field, guards, gradients, bounds of multipliers."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from typing import Any, NamedTuple

import sympy
from sympy import Expr, Symbol
from sympy.printing.str import StrPrinter

from filippov.base.elementary import ELEMENTARY
from filippov.base.errors import ModelError
from filippov.base.pattern import pattern
from filippov.kernel.codegen.generate_resets import (
    contact_field,
    contact_guards,
    contact_radii,
    contact_rows,
    reset_source,
)
from filippov.kernel.codegen.generated import PAIR, TWICE, Generated, unit_constants
from filippov.kernel.codegen.hoist import Hoisted
from filippov.kernel.codegen.input_slots import input_text, places
from filippov.kernel.codegen.pieces import pieces
from filippov.kernel.codegen.repeated import Repeated, repeated
from filippov.kernel.codegen.structure import Structure, same_as
from filippov.model.partials import Partials
from filippov.model.signals.input import Sampled
from filippov.model.size import expanded
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, SymbolicForm, convex
from filippov.model.symbols import t

INLINED = 2500
# Operands in a row, and nesting levels in one statement: the translation recurses as deep as both.
LONGEST_ROW, DEEPEST = 50, 25
_FUNCTIONS = {getattr(sympy, f.symbolic): f.library for f in ELEMENTARY}
_FUNCTIONS |= {sympy.Abs: "fabs", sympy.sign: "sign_of"}


class KernelPrinter(StrPrinter):
    """Prints expressions in the kernel language, powers in their cheapest form."""

    def __init__(self, names: dict[Symbol, str], sizes: set[Symbol]) -> None:
        super().__init__()
        self.names, self.sizes = names, set(sizes)
        self.inputs: dict[str, int] = {}
        # The field is evaluated at signs between -1 and 1, where a branch becomes the mean of both.
        self.blended = False

    def _print(self, e: Any, **options: Any) -> str:
        if isinstance(e, Sampled):
            return input_text(self.inputs[e.samples.name], e.samples.kind, e.order)
        return str(super()._print(e, **options))

    def _print_Symbol(self, e: Symbol) -> str:
        return str(self.names.get(e, e.name))

    _print_Dummy = _print_Symbol

    def _print_Integer(self, e: sympy.Integer) -> str:
        return f"{float(int(e))!r}" if abs(int(e)) < 2**53 else repr(float(e))

    def _print_Rational(self, e: sympy.Rational) -> str:
        return f"({float(int(e.p))!r} / {float(int(e.q))!r})"

    def _print_Float(self, e: sympy.Float) -> str:
        return f"({float(e)!r})"

    def _print_NumberSymbol(self, e: Expr) -> str:
        return f"({float(e)!r})"

    _print_Pi = _print_Exp1 = _print_NumberSymbol

    def _print_Add(self, e: Expr, order: str | None = None) -> str:
        return joined(" + ", [self._print(a) for a in e.as_ordered_terms()])

    def _print_Mul(self, e: Expr) -> str:
        above, below = [], []
        for factor in e.as_ordered_factors():
            if factor.is_Pow and factor.exp.is_Integer and factor.exp < 0:
                below.append(self._print(sympy.Pow(factor.base, -factor.exp)))
            elif factor.is_Pow and factor.exp == -sympy.S.Half and not factor.free_symbols & self.sizes:
                below.append(self._print(sympy.sqrt(factor.base)))
            else:
                above.append(self._print(factor))
        text = joined(" * ", above or ["1.0"])
        return f"({text} / {joined(' * ', below)})" if below else text

    def _print_Pow(self, e: Expr) -> str:
        base, exponent = self._print(e.base), e.exp
        if e.base.free_symbols & self.sizes and not exponent.is_Integer:
            return f"size_power({base}, {self._print(exponent)})"
        if exponent.is_Integer and 0 < abs(int(exponent)) <= 4:
            if not e.base.is_Symbol and abs(int(exponent)) > 2:
                return f"power({base}, {float(int(exponent))!r})"
            product = "(" + " * ".join([base] * abs(int(exponent))) + ")"
            return product if exponent > 0 else f"(1.0 / {product})"
        if exponent == sympy.S.Half:
            return f"sqrt({base})"
        if exponent == -sympy.S.Half:
            return f"(1.0 / sqrt({base}))"
        if exponent.is_number and abs(float(exponent)) == 1.5:
            return f"({base} * sqrt({base}))" if exponent > 0 else f"(1.0 / ({base} * sqrt({base})))"
        if e.base == sympy.E:
            return f"exp({self._print(exponent)})"
        kind = "power" if exponent.is_number else "power_of"
        return f"{kind}({base}, {self._print(exponent)})"

    def _print_Select(self, e: Expr) -> str:
        c, plus, minus = (self._print(a) for a in e.args)
        if self.blended:
            between = f"(0.5 * ((1.0 + {c}) * {plus} + (1.0 - {c}) * {minus}))"
            return f"({plus} if {c} == 1.0 else ({minus} if {c} == -1.0 else {between}))"
        return f"({plus} if {c} > 0.0 else {minus})"

    def _print_Min(self, e: Expr) -> str:
        return f"min({', '.join(self._print(a) for a in e.args)})"

    def _print_Max(self, e: Expr) -> str:
        return f"max({', '.join(self._print(a) for a in e.args)})"

    def _print_Heaviside(self, e: Expr) -> str:
        return f"(0.5 + 0.5 * sign_of({self._print(e.args[0])}))"

    def _print_Function(self, e: Expr) -> str:
        name = _FUNCTIONS.get(e.func)
        if name is None:
            raise ModelError(
                f"the function {e.func} is not known to the compiled loop. Known: "
                f"{', '.join(sorted(set(_FUNCTIONS.values())))}, sqrt, powers, Min, Max. Write it with "
                "these, or give the system as plain functions."
            )
        return f"{name}({', '.join(self._print(a) for a in e.args)})"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_print_") and any(name == f"_print_{f.__name__}" for f in _FUNCTIONS):
            return self._print_Function
        raise AttributeError(name)


def joined(operator: str, parts: Sequence[str]) -> str:
    """Operands with an operator between them, in groups: a long row would be nested just as deeply."""
    while len(parts) > LONGEST_ROW:
        groups = [parts[k : k + LONGEST_ROW] for k in range(0, len(parts), LONGEST_ROW)]
        parts = [f"({operator.join(group)})" for group in groups]
    return f"({operator.join(parts)})"


def _shallow(printer: KernelPrinter, e: Expr, prefix: str, lines: list[str]) -> tuple[Expr, int]:
    """The expression with its parts at every DEEPEST-th level named in lines of their own, and its depth."""
    if not e.args:
        return e, 0
    parts = [_shallow(printer, arg, prefix, lines) for arg in e.args]
    if 1 + max(depth for _, depth in parts) > DEEPEST:
        named = []
        for part, depth in parts:
            if depth < DEEPEST:
                named.append((part, depth))
                continue
            symbol = sympy.Dummy("d", real=True)
            printer.names[symbol] = f"{prefix}d{len(lines)}"
            if part.free_symbols & printer.sizes:
                printer.sizes.add(symbol)
            lines.append(f"    {prefix}d{len(lines)} = {printer._print(part)}")
            named.append((symbol, 0))
        parts = named
    if all(part is arg for (part, _), arg in zip(parts, e.args, strict=True)):
        return e, 1 + max(depth for _, depth in parts)
    return e.func(*(part for part, _ in parts)), 1 + max(depth for _, depth in parts)


def _assign(printer: KernelPrinter, results: Sequence[tuple[str, Expr]], prefix: str) -> list[str]:
    """Statements that store the expressions, their common parts named once."""
    names = sympy.numbered_symbols(prefix, cls=sympy.Dummy)
    shared, reduced = sympy.cse([e for _, e in results], symbols=names)
    lines: list[str] = []
    for number, (symbol, whole) in enumerate(shared):
        expression, _ = _shallow(printer, whole, prefix, lines)
        printer.names[symbol] = f"{prefix}{number}"
        if expression.free_symbols & printer.sizes:
            printer.sizes.add(symbol)
        lines.append(f"    {prefix}{number} = {printer._print(expression)}")
    for (target, _), whole in zip(results, reduced, strict=True):
        expression, _ = _shallow(printer, whole, prefix, lines)
        lines.append(f"    {target} = {printer._print(expression)}")
    return lines


def symbol_names(form: SymbolicForm) -> dict[Symbol, str]:
    """What the symbols of a system are called in its kernels."""
    names: dict[Symbol, str] = {t: "t"}
    names |= {x: f"x[{i}]" for i, x in enumerate(form.x)}
    names |= {p: f"p[{i}]" for i, p in enumerate(form.p)}
    names |= {s: f"s[{i}]" for i, s in enumerate(form.s)}
    names |= {a: f"a{i}" for i, a in enumerate(form.a)}
    return names


def sizes_used(form: SymbolicForm, used: set[Symbol]) -> list[int]:
    """The surfaces whose sizes |h_i| stand among these symbols, or in the h of such a surface; in order."""
    needed, every = set(used), set(form.a)
    for a, h in reversed(list(zip(form.a, form.h, strict=True))):
        if a in needed:
            needed |= h.free_symbols & every
    return [i for i, a in enumerate(form.a) if a in needed]


def _sizes(form: SymbolicForm, printer: KernelPrinter, used: set[Symbol]) -> list[str]:
    """|h_i| = mode_i h_i of the surfaces whose size is used: smooth across the surface, 0 while sliding."""
    places = sizes_used(form, used) if used else ()
    return [f"    a{i} = m[{i}] * {printer._print(form.h[i])}" for i in places]


def total_gradients(form: SymbolicForm, modes: tuple[Symbol, ...]) -> list[list[Expr]]:
    """Total derivatives of each h by the states and by t, through the sizes of earlier surfaces.

    |h_k| has slope 0 while the solution slides on its surface, also inside a root; so has a root of states
    where these are 0, as a distance sqrt(x**2 + y**2), whose slope is 0/0 there.
    """
    place = {q: j for j, q in enumerate((*form.x, t))}
    number = {a: k for k, a in enumerate(form.a)}
    partials = Partials()
    rows: list[list[Expr]] = []
    for h in form.h:
        inside = partials.symbols(h)
        row = [sympy.S.Zero] * len(place)
        for q in inside & place.keys():
            row[place[q]] = _ended(partials.by(h, q), place.keys())
        for k in sorted(number[a] for a in inside & number.keys()):
            slope = partials.by(h, form.a[k]) * modes[k]
            if _roots(slope, {form.a[k]}):
                slope = Select(2 * modes[k] ** 2 - 1, slope, 0)
            row = [total + slope * inner for total, inner in zip(row, rows[k], strict=True)]
        rows.append(row)
    return rows


def _ended(slope: Expr, moving: Collection[Symbol]) -> Expr:
    """The slope with 0 in place of what is infinite where the base of a power is 0."""
    steep = {
        power: Select(power.base, power, 0)
        for power in slope.atoms(sympy.Pow)
        if power.base.free_symbols & moving
        and not (power.exp.is_Integer or (power.exp.is_number and power.exp >= 0))
    }
    return slope.xreplace(steep) if steep else slope


def jointly_affine(form: SymbolicForm) -> bool:
    """Whether the field is a constant plus a sum of terms in one sign each."""
    free, partials = set(form.s), Partials()
    if any(contact is not None and free & contact.symbols() for contact in form.contact):
        return False
    for f in form.field:
        g = convex(f, free) if partials.symbols(f) & free else f
        for s in partials.symbols(g) & free if not _written_affine(g, free, partials) else ():
            slope = partials.by(g, s)
            if partials.symbols(slope) & free and expanded(slope).free_symbols & free:
                return False
    return True


def non_lipschitz(form: SymbolicForm) -> bool:
    """Whether the field contains a power of a size |h| with an exponent that may be below 1."""
    sizes = set(form.a)
    return any(_roots(f, sizes) for f in form.field)


def rooted(form: SymbolicForm) -> list[bool]:
    """Which guards contain a power of a size |h| with an exponent that may be below 1 (infinitely steep)."""
    number = {a: k for k, a in enumerate(form.a)}
    own: list[bool] = []
    for h in form.h:
        inside = h.free_symbols & number.keys()
        own.append(any(own[number[a]] for a in inside) or _roots(h, inside))
    return own


def _roots(e: Expr, sizes: set[Symbol]) -> bool:
    """Whether an expression contains a power of these sizes with an exponent that may be below 1."""
    return any(
        power.base.free_symbols & sizes
        and not (power.exp.is_Integer or (power.exp.is_number and power.exp >= 1))
        for power in e.atoms(sympy.Pow)
    )


def straight_rates(
    form: SymbolicForm, rows: Sequence[Mapping[int, Expr]], linear: Sequence[bool], varying: set[Symbol]
) -> list[bool]:
    """Which surfaces have a rate that is affine in all that varies while the solution slides on them."""
    roles: dict[Symbol, Hashable] = dict.fromkeys(form.x, "x") | dict.fromkeys(form.s, "s")
    roles |= {a: f"size {bent}" for a, bent in zip(form.a, linear, strict=True)}
    # Most blocks of a long chain have the same form.
    known: dict[Hashable, bool] = {}
    partials, out = Partials(), []
    for a, row, straight in zip(form.a, rows, linear, strict=True):
        terms = [(slope, form.field[j] if j < len(form.x) else sympy.S.One) for j, slope in row.items()]
        key = straight and pattern([a, *(e for pair in terms for e in pair)], roles)
        if key not in known:
            known[key] = straight and _straight(form, a, terms, linear, varying, partials)
        out.append(known[key])
    return out


def _straight(
    form: SymbolicForm, size: Symbol, terms: Sequence[tuple[Expr, Expr]], linear: Sequence[bool],
    varying: set[Symbol], partials: Partials,
) -> bool:  # fmt: skip
    """Whether a rate, a sum of slopes times components of the field, is affine where its own size is 0."""
    rate = sympy.Add(*(slope * f for slope, f in terms))
    if size in partials.symbols(rate):
        rate = rate.subs(size, 0)
    free = partials.symbols(rate)
    return all(linear[k] for k, a in enumerate(form.a) if a in free) and _affine(rate, varying, partials)


def _counts(e: Expr) -> bool:
    """Whether an expression is not 0; quick for the shared zero that fills most rows."""
    return e is not sympy.S.Zero and e != 0


def _affine(e: Expr, varying: set[Symbol], partials: Partials) -> bool:
    """Whether an expression is affine in some symbols: as written, or by its derivatives."""
    e = _bent(e, varying, partials)
    moving = partials.symbols(e) & varying
    return not any(partials.symbols(partials.by(e, q)) & varying for q in moving)


def _bent(e: Expr, varying: set[Symbol], partials: Partials) -> Expr:
    """The part of an expression that is not affine as written, without constant factors; 0 for none."""
    while True:
        moving = [arg for arg in e.args if partials.symbols(arg) & varying]
        if e.is_Mul and len(moving) == 1:
            e = moving[0]
            continue
        left = [arg for arg in moving if not _written_affine(arg, varying, partials)] if e.is_Add else moving
        if not e.is_Add or len(left) == len(e.args):
            return e
        e = sympy.Add(*left)


def _written_affine(e: Expr, varying: set[Symbol], partials: Partials) -> bool:
    """Whether an expression is affine in some symbols as written, by sums and multiples."""
    if not e.args:
        return True
    moving = [arg for arg in e.args if partials.symbols(arg) & varying]
    one = e.is_Add or (e.is_Mul and len(moving) == 1)
    return not moving or (one and all(_written_affine(arg, varying, partials) for arg in moving))


def filled(rows: Sequence[Sequence[Expr]]) -> list[dict[int, Expr]]:
    """The nonzero entries of sparse rows, by column."""
    return [{j: e for j, e in enumerate(row) if _counts(e)} for row in rows]


def structure(form: SymbolicForm, field: Sequence[Expr], rows: Sequence[Mapping[int, Expr]]) -> Structure:
    """Which gradients, field components and signs depend on each other."""
    sign, size = {s: i for i, s in enumerate(form.s)}, {a: i for i, a in enumerate(form.a)}
    return Structure(
        tuple(tuple(j for j in row if j < len(form.x)) for row in rows),
        tuple(frozenset(sign[s] for s in f.free_symbols if s in sign) for f in field),
        tuple(frozenset(size[a] for a in h.free_symbols if a in size) for h in form.h),
    )


def generate(form: SymbolicForm, surfaces: tuple[Surface, ...], blended: bool = False) -> Generated:
    """Kernel source of a symbolic system; see `filippov.kernel.loop.model` for the interface.

    blended: a branch on a sign between -1 and 1 is the mean of both (Utkin's rule), not one of them.
    """
    n, m = len(form.x), len(form.h)
    modes = tuple(sympy.Dummy(f"m{i}") for i in range(m))
    printer = KernelPrinter(symbol_names(form) | {q: f"m[{i}]" for i, q in enumerate(modes)}, set(form.a))
    printer.blended, printer.inputs = blended, places(form.inputs)
    gradients = total_gradients(form, modes)
    plain_rows, radius = filled(gradients), contact_radii(form)
    rows = filled(contact_rows(form, gradients, modes)) if any(form.contact) else plain_rows
    hoisted = Hoisted(form.p)
    field = [hoisted(f) for f in contact_field(form, modes)]
    derived = list(hoisted.derived.items())
    printer.names |= {symbol: f"p[{len(form.p) + k}]" for k, (_, symbol) in enumerate(derived)}
    lines, inlined = field_source(printer, form, field)
    targets = [(f"out[{i}]", h) for i, h in enumerate(contact_guards(form, modes))]
    head = "guards(t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices)"
    lines += ["", *_kernel(printer, "@kernel", head, form, targets).lines]
    # The other entries are 0 and remain so.
    pattern = structure(form, field, rows)
    targets = [(f"g[{i * n + j}]", rows[i][j]) for i in range(m) for j in pattern.columns[i]]
    targets += [(f"gt[{i}]", rows[i].get(n, sympy.S.Zero)) for i in range(m)]
    head = "gradients(t: float, x: Vector, p: Vector, m: Vector, g: Vector, gt: Vector, ctx: Indices)"
    lines += _kernel(printer, "@kernel", head, form, targets).lines
    ends = [(f"out[{2 * i + side}]", radius[i][side]) for i in range(m) for side in (0, 1)]
    head = "radii(t: float, x: Vector, p: Vector, out: Vector, ctx: Indices)"
    lines += _kernel(printer, "@kernel", head, form, ends).lines
    lines += ["@kernel", "def derive(p: Vector) -> int:"]
    targets = [(f"p[{len(form.p) + k}]", e) for k, (e, _) in enumerate(derived)]
    lines += [*_assign(printer, targets, "c"), "    return 0", ""]
    # A reset is evaluated with the signs before it.
    printer.names |= {s: f"m[{i}]" for i, s in enumerate(form.s)}
    lines += reset_source(
        form, lambda used: _sizes(form, printer, used), lambda pairs: _assign(printer, pairs, "c")
    )
    varying = {t, *form.x, *form.a}
    linear = [not any(e.free_symbols & varying for e in row.values()) for row in plain_rows]
    constants = unit_constants(
        n, len(form.p) + len(derived), surfaces, linear, jointly_affine(form), non_lipschitz(form), pattern,
        moving=[any(e.free_symbols & varying for e in ends) for ends in form.radius],
        straight=straight_rates(form, plain_rows, linear, varying),
        wide=inlined and m > 0 and not form.inputs, held=form.held, ticks=form.time_reset,
        roots=rooted(form), same_as=same_as(form.h, surfaces),
    )  # fmt: skip
    return Generated("\n".join(lines), constants)


class _Kernel(NamedTuple):
    """The lines of a kernel, and whether it has loops."""

    lines: list[str]
    loops: bool


def _kernel(
    printer: KernelPrinter, mark: str, head: str, form: SymbolicForm, results: Sequence[tuple[str, Expr]]
) -> _Kernel:
    """A kernel that stores the expressions; a long one is divided into kernels that it calls.

    Rows that differ in their places alone are loops.
    """
    name, _, arguments = head.removesuffix(")").partition("(")
    sizes = {a: (i, h) for i, (a, h) in enumerate(zip(form.a, form.h, strict=True))}
    loops, left = repeated(results, printer.names, sizes)
    bodies = [_loop(printer, loop, sizes) for loop in loops]
    for part in pieces(left) if left or not loops else ():
        used = set().union(*(e.free_symbols for _, e in part)) & set(form.a)
        bodies.append([*_sizes(form, printer, used), *_assign(printer, part, "c")])
    lines: list[str] = []
    for k, body in enumerate(bodies):
        called = head if len(bodies) == 1 else f"{name}{k}({arguments})"
        lines += [mark, f"def {called} -> int:", *body, "    return 0", ""]
    if len(bodies) == 1:
        return _Kernel(lines, bool(loops))
    given = ", ".join(argument.partition(":")[0] for argument in arguments.split(", "))
    calls = [f"    {name}{k}({given})" for k in range(len(bodies))]
    return _Kernel([*lines, mark, f"def {head} -> int:", *calls, "    return 0", ""], bool(loops))


def _loop(printer: KernelPrinter, loop: Repeated, sizes: Mapping[Symbol, tuple[int, Expr]]) -> list[str]:
    """A loop over rows of one form; sizes: the number and h of each."""
    before = {symbol: printer.names[symbol] for symbol in loop.names}
    printer.names |= loop.names
    inner = [f"    {printer.names[a]} = {mode} * {printer._print(sizes[a][1])}" for a, mode in loop.sizes]
    inner += _assign(printer, [loop.row], "c")
    printer.names |= before
    return [f"    for b in range({loop.count}):", *(f"    {line}" for line in inner)]


def field_source(
    printer: KernelPrinter, form: SymbolicForm, field: Sequence[Expr]
) -> tuple[list[str], bool]:
    """The kernels `rhs` and `pair` of a field, and whether they are inlined."""
    arguments = "t: float, x: Vector, p: Vector, s: Vector, m: Vector, out: Vector, ctx: Indices"
    results = [(f"out[{i}]", f) for i, f in enumerate(field)]
    single = _kernel(printer, "@contract", f"rhs({arguments})", form, results)
    # Small fields are inlined in every stage, which saves loads and stores; large ones would bloat the unit.
    if single.loops or sum(map(len, single.lines)) >= INLINED:
        return [*single.lines, "@contract", *TWICE], False
    others = {s: sympy.Dummy(f"s{i}", real=True) for i, s in enumerate(form.s)}
    printer.names |= {other: f"s2[{i}]" for i, other in enumerate(others.values())}
    results += [(f"out2[{i}]", f.xreplace(others)) for i, f in enumerate(field)]
    used = set().union(*(f.free_symbols for f in field)) & set(form.a)
    both = ["@contract", PAIR, *_sizes(form, printer, used), *_assign(printer, results, "c"), "    return 0"]
    return ["@inline", *single.lines, "@inline", *both], True
