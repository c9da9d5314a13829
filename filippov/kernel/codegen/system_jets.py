"""The kernel `jets` of a symbolic system: Taylor coefficients of field and guards, mode by mode.

Off all sliding surfaces the signs are constants. On one surface the field is c + s d, c and d half the sum
and half the difference of the fields on both sides, and s = -(rate of c) / (rate of d) is one more quotient
of the graph, so that field and multiplier come as series together. Several sliding at once have none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy
from sympy import Expr, Symbol

from filippov.kernel.codegen.generate import KernelPrinter, symbol_names, total_gradients
from filippov.kernel.codegen.generated import Generated
from filippov.kernel.codegen.jet_graph import JetGraph
from filippov.kernel.codegen.jets import chosen_exponents, endless, exponentials, heavy, jet_lines, last_terms
from filippov.kernel.language.unit import Constant
from filippov.model.size import expanded
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, SymbolicForm, convex
from filippov.model.symbols import t

_ARGUMENTS = "t: float, x: Vector, p: Vector, s: Vector, m: Vector, work: Vector, out: Vector"
# The most surfaces whose sliding has coefficients: each needs a kernel.
MOST_SLIDING = 6
# The most coefficients of the state whose sums are written out.
WRITTEN_OUT = 200


def system_jets(
    form: SymbolicForm, surfaces: Sequence[Surface], rows: int, order: int, free_only: bool = False
) -> Generated:
    """Source and constants of `jets` (see `filippov.kernel.loop.model`) for a series of this order.

    rows: surfaces with user events, of which there is no series.
    """
    can = [i for i, q in enumerate(surfaces) if (q.kind == "switching" and not q.width) or q.contact]
    sliding = [] if free_only else [i for i in can if i < len(form.h)][:MOST_SLIDING]
    lines: list[str] = []
    chosen: dict[int, str] = {}
    room, n = 0, len(form.x)
    graphs = {i: _graph(form, i, rows) for i in (-1, *sliding)}
    own = {i: endless(graph, results[:n]) for i, (graph, results) in graphs.items()}
    tails = max(map(len, own.values()))
    if any(own[i] and heavy(graph, order) for i, (graph, _) in graphs.items()):
        tails = -1
    decaying = max(exponentials(graph, own[i]) for i, (graph, _) in graphs.items()) if tails > 0 else 0
    for i, (graph, results) in graphs.items():
        kept = [*own[i], *[-1] * (tails - len(own[i]))] if tails > 0 else []
        exponents = [] if heavy(graph, order) else chosen_exponents(graph, results)
        for squares in (True, False) if exponents else (False,):
            lines += ["", "@contract", f"def {_name(i, squares)}({_ARGUMENTS}) -> int:"]
            text, used = jet_lines(graph, results, order, kept, decaying, squares)
            lines += [*text, "    return 0", ""]
            room = max(room, used)
        if exponents:
            chosen[i] = " and ".join(f"{exponent} == 2.0" for exponent in exponents)
    lines += [
        "", "@kernel",
        "def jets(",
        "    t: float, x: Vector, p: Vector, m: Vector, work: Vector, out: Vector, iw: Integers",
        ") -> int:",
        "    if iw.sliding == 0:",
        "        return free_jets(t, x, p, m, m, work, out)",
        "    if iw.sliding == 1:",
        "        i = iw.listed[0]",
    ]  # fmt: skip
    for i in sliding:
        lines += [f"        if i == {i}:", f"            return sliding_jets_{i}(t, x, p, m, m, work, out)"]
    lines += ["        return 1", "    return 1", "", *_end_lines(n, n + 2 * rows, order)]
    beside = len(sliding) == len(can) and not any(heavy(graph, order) for graph, _ in graphs.values())
    if beside:
        lines += _beside_each_other(sliding, (n + 2 * rows) * order, room, chosen)
    constants: dict[str, Constant] = {
        "JETS": n + 2 * rows, "JET_ROOM": room, "TAILS": tails, "LAST": last_terms(order),
        "IN_LANES": beside, "DECAYING": decaying,
    }  # fmt: skip
    return Generated("\n".join(lines), constants)


def _name(sliding: int, squares: bool) -> str:
    """The kernel of a mode; of one whose exponents are 2."""
    return ("free_jets" if sliding < 0 else f"sliding_jets_{sliding}") + ("_of_squares" if squares else "")


def _indented(levels: int, lines: Sequence[str]) -> list[str]:
    return ["    " * levels + line for line in lines]


def _called_beside(i: int, chosen: Mapping[int, str], out: str = "work, out") -> list[str]:
    """The call of a mode in lanes, which cannot branch by one: of squares where all have exponents of 2."""
    calls = [f"{_name(i, squares)}(t, x, p, m, m, {out})" for squares in (True, False)]
    if i not in chosen:
        return calls[1:]
    return [f"if everywhere({chosen[i]}):", f"    {calls[0]}", "else:", f"    {calls[1]}"]


def _beside_each_other(
    sliding: Sequence[int], size: int, room: int, chosen: Mapping[int, str]
) -> list[str]:
    """The kernel `lane_jets`: lanes that slide may do so on different surfaces."""
    lines = [
        "@lanes",
        "def lane_jets(",
        "    t: float, x: Vector, p: Vector, m: Vector, work: Vector, out: Vector, spare: Vector,",
        "    iw: Integers",
        ") -> None:",
        "    if iw.sliding == 0:",
        *_indented(2, _called_beside(-1, chosen)),
        "        return",
    ]
    for i in sliding[:1]:
        lines += _indented(1, _called_beside(i, chosen))
    for i in sliding[1:]:
        lines += [
            f"    if anywhere(m[{i}] == 0.0):",
            *_indented(2, _called_beside(i, chosen, f"shift(spare, {size}), spare")),
            f"        for a in range({size}):",
            f"            out[a] = spare[a] if m[{i}] == 0.0 else out[a]",
            f"        for a in range({room}):",
            f"            work[a] = spare[{size} + a] if m[{i}] == 0.0 else work[a]",
        ]
    return [*lines, ""]


def _end_lines(n: int, width: int, order: int) -> list[str]:
    """The kernel `series_end`: written out for few states, so that its sums do not wait for each other."""
    lines = [
        "@contract",
        "def series_end(step: float, x: Vector, jet: Vector, k: Vector, y: Vector, rate: Vector) -> None:",
        "    h1 = step",
    ]
    lines += [f"    h{j} = h{j // 2} * h{j - j // 2}" for j in range(2, order)]
    if n * order > WRITTEN_OUT:
        for j in range(1, order):
            lines += [f"    for i in range({n}):", f"        k[{j * n} + i] = jet[{j * width} + i] * h{j}"]
        lines += [f"    for i in range({n}):", ""]
        lines[-1:] = [f"        r = k[{(order - 1) * n} + i]", f"        s = r * {1.0 / order!r}"]
        for j in range(order - 2, -1, -1):
            lines += [f"        s += k[{j * n} + i] * {1.0 / (j + 1)!r}", f"        r += k[{j * n} + i]"]
        return [*lines, "        y[i] = x[i] + step * s", "        rate[i] = r", ""]
    # State beside state, so that neighbours share a vector; two chains of sums, small terms first.
    for j in range(order - 1, -1, -1):
        for i in range(n):
            lines.append(f"    c{j}_{i} = jet[{j * width + i}] * h{j}" if j else f"    c0_{i} = k[{i}]")
        for name, weight in (("s", 1.0 / (j + 1)), ("r", 1.0)):
            for i in range(n):
                term = f"c{j}_{i} * {weight!r}" if weight != 1.0 else f"c{j}_{i}"
                before = f"{name}{j % 2}_{i} + " if j < order - 2 else ""
                lines.append(f"    {name}{j % 2}_{i} = {before}{term}")
        if j:
            lines += [f"    k[{j * n + i}] = c{j}_{i}" for i in range(n)]
    lines += [f"    y[{i}] = x[{i}] + step * (s0_{i} + s1_{i})" for i in range(n)]
    lines += [f"    rate[{i}] = r0_{i} + r1_{i}" for i in range(n)]
    return [*lines, ""]


def _graph(form: SymbolicForm, sliding: int, rows: int) -> tuple[JetGraph, list[int]]:
    """The graph of a mode, and its results: the field, h of every surface, and the guards of what slides."""
    modes = tuple(sympy.Dummy(f"m{i}") for i in range(len(form.h)))
    names = {q: f"m[{i}]" for i, q in enumerate(modes)}
    printer = KernelPrinter(symbol_names(form) | names, set(form.a))
    scaled: dict[Symbol, tuple[str, Expr]] = {
        a: (f"m[{i}]", h) for i, (a, h) in enumerate(zip(form.a, form.h, strict=True)) if i != sliding
    }
    given: dict[Symbol, Expr] = {} if sliding < 0 else {form.a[sliding]: sympy.S.Zero}
    graph = JetGraph(printer._print, {x: i for i, x in enumerate(form.x)}, t, given, scaled)
    zero = graph.number(0.0)
    second = [zero] * rows
    first = [graph(h) for h in form.h] + [zero] * (rows - len(form.h))
    if sliding < 0:
        return graph, [*(graph(f) for f in form.field), *first, *second]
    middle, half = _halves(form, sliding)
    gradient = _gradient(form, sliding, modes)
    rate_c, rate_d = (sympy.Add(*(g * q for g, q in zip(gradient, f, strict=False))) for f in (middle, half))
    rate_c += gradient[-1]
    weight = graph(-rate_c / rate_d) if rate_d != 0 else zero
    field = [
        graph(c) if d == 0 else graph.total([("1.0", graph(c)), ("1.0", graph.times([weight, graph(d)]))])
        for c, d in zip(middle, half, strict=True)
    ]
    low, high = form.radius[sliding]
    contact = bool(form.contact) and form.contact[sliding] is not None
    if not contact:
        first[sliding] = graph(-(rate_c + high * rate_d))
        second[sliding] = graph(rate_c + low * rate_d)
    return graph, [*field, *first, *second]


def _halves(form: SymbolicForm, i: int) -> tuple[list[Expr], list[Expr]]:
    """Half the sum and half the difference of the fields at s_i = 1 and -1."""
    s, field = form.s[i], [f.xreplace({form.a[i]: sympy.S.Zero}) for f in form.field]
    contact = form.contact[i] if form.contact else None
    if contact is not None:
        field = [f + q for f, q in zip(field, contact.pushed(s), strict=True)]
    middle, half = [], []
    for f in field:
        whole = convex(f, {s})
        slope = whole.diff(s) if s in whole.free_symbols else sympy.S.Zero
        if s in slope.free_symbols and s not in expanded(slope).free_symbols:
            slope = expanded(slope)
        if s not in slope.free_symbols:
            middle.append(whole.xreplace({s: sympy.S.Zero}))
            half.append(slope)
            continue
        up, down = (f.xreplace({s: sympy.Integer(side)}) for side in (1, -1))
        middle.append((up + down) / 2)
        half.append((up - down) / 2)
    return middle, half


def _gradient(form: SymbolicForm, i: int, modes: tuple[Symbol, ...]) -> list[Expr]:
    """Derivatives of h_i by the states and by t, with the modes of its sizes; of a contact its rate's."""
    contact = form.contact[i] if form.contact else None
    if contact is not None:
        return [contact.rate.diff(q) for q in (*form.x, t)]
    return [_beside(e, modes) for e in total_gradients(form, modes)[i]]


def _beside(e: Expr, modes: Sequence[Symbol]) -> Expr:
    """A gradient off the surfaces of its sizes: nothing else slides."""
    own = [q for q in e.atoms(Select) if q.args[0].free_symbols & {*modes}]
    return e.xreplace({q: q.args[1] for q in own}) if own else e
