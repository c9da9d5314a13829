"""The automaton of a system as one Python module that needs no other: method, event loop, equations."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from pathlib import Path

from sympy import Expr, Symbol

from filippov.base.escape import printable
from filippov.io.automaton.equations import Equations, names_of
from filippov.io.automaton.printers import PythonText, assignments

PARTS = ("method", "values", "decisions", "runtime")

HEADER = '''"""The exact automaton of a system, written by `filippov export`. It needs Python 3.11 only.

    result = run(x0, (t0, t1), parameters={"NAME": value})

gives `result.t`, `result.x`, `result.modes`, `result.outputs` (a list a name), `result.events`, and
`result.status`: "success", or the name of what the automaton does not decide (corner, tangency, two-fold,
non_unique, zeno, ...); the run ends there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple
'''

FOOTER = '''

def run(
    x0: Sequence[float] | None = None, t_span: Sequence[float] | None = None,
    parameters: Mapping[str, float] | None = None, rtol: float = 1e-10, atol: float = 1e-12,
    max_steps: int = 1_000_000,
) -> Result:
    """Run the automaton from x0 over t_span; see `simulate`."""
    x0, t_span = Model.X0 if x0 is None else x0, Model.T_SPAN if t_span is None else t_span
    if x0 is None or t_span is None:
        raise ValueError("x0 and t_span are needed: the model was written without them.")
    return simulate(Model, x0, t_span, parameters, rtol, atol, max_steps)


if __name__ == "__main__":
    done = run()
    for event in done.events:
        print(repr(event.t), event.surface, event.kind, *map(repr, event.x), sep=",")
    print(repr(done.t[-1]), "", done.status, *map(repr, done.x[-1]), sep=",")
'''


def runtime_text() -> str:
    """The runtime's files one behind the other, without what they import."""
    folder = Path(__file__).parent
    return "\n\n".join(_body((folder / f"{part}.py").read_text(encoding="utf-8")) for part in PARTS)


def _body(source: str) -> str:
    """A file from behind its imports on."""
    last = max(
        node.end_lineno or 0 for node in ast.parse(source).body
        if isinstance(node, ast.Import | ast.ImportFrom)
    )  # fmt: skip
    return "\n".join(source.splitlines()[last:]).strip()


def python_module(
    eq: Equations, values: Sequence[float], x0: Sequence[float] | None, t_span: Sequence[float] | None
) -> str:
    """The text of the module; values: the parameters' defaults in it."""
    return f"{HEADER}\n\n{runtime_text()}\n\n\n{model_text(eq, values, x0, t_span)}{FOOTER}"


def model_text(
    eq: Equations, values: Sequence[float], x0: Sequence[float] | None, t_span: Sequence[float] | None
) -> str:
    """The class `Model`: names, constants and the functions of the equations."""
    system, form = eq.system, eq.form
    bounds = {}
    for name, value in zip(system.parameters.names, values, strict=True):
        own = system.parameters[name]
        low, high = (v if v is not None else w for v, w in ((own.lower, -math.inf), (own.upper, math.inf)))
        bounds[name] = (float(value), float(low), float(high))
    lines = [
        "class Model:",
        '    """The equations: x states, p parameters, s signs, m the mode; a sizes |h|, c common parts."""',
        "",
        *(f"    # x[{i}] {printable(name)}" for i, name in enumerate(system.states)),
        *(f"    # p[{i}] {_described(eq, i)}" for i in range(len(form.p))),
        f"    STATES = {tuple(system.states)!r}",
        f"    PARAMETERS = {bounds!r}".replace("inf", "math.inf"),
        f"    SURFACES = {tuple(system.surface_names)!r}",
        f"    OUTPUTS = {tuple(system.outputs)!r}",
        f"    ROLE = {tuple(str(q.kind) for q in system.surfaces)!r}",
        f"    WIDTH = {eq.widths!r}",
        f"    RESET_FROM = {eq.reset_from!r}",
        f"    CONTACT = {eq.contact!r}",
        f"    COMPONENT = {eq.component!r}",
        f"    ORDER = {eq.order!r}",
        f"    AFFINE = {eq.affine!r}",
        f"    X0 = {None if x0 is None else [float(v) for v in x0]!r}",
        f"    T_SPAN = {None if t_span is None else tuple(float(v) for v in t_span)!r}",
    ]
    state = "t: float, x: Sequence[float], p: Sequence[float]"
    lines += _function(eq, "field", f"{state}, s: Sequence[float], m: Sequence[int]", eq.field)
    lines += _function(eq, "guards", f"{state}, m: Sequence[int]", eq.guards)
    lines += _function(eq, "gradients", f"{state}, m: Sequence[int]", *eq.gradients, rows=True)
    lines += _function(eq, "ends", state, *eq.ends, rows=True)
    lines += _function(eq, "outputs", f"{state}, s: Sequence[float], m: Sequence[int]", eq.outputs)
    signs = dict(zip(eq.form.s, eq.modes, strict=True))
    for name, tables in (("reset", eq.resets), ("strike", eq.strikes)):
        lines += _head(name, f"i: int, {state}, m: Sequence[int]", "list[float]")
        for i, after in enumerate(tables):
            if after is not None:
                body = _lines(eq, [e.xreplace(signs) for e in after])
                lines += [f"        if i == {i}:", *(f"    {line}" for line in body)]
        lines.append("        return list(x)")
    lines += _head("clocks", "p: Sequence[float]", "list[Clock]")
    printer = PythonText().name(names_of(form, eq.modes), form.a)
    made = []
    for event in system.time_events:
        numbers = [repr(q) if isinstance(q, float) else printer(q) for q in event.instants]
        if event.times is None:
            made.append(f"Clock({event.name!r}, {numbers[0]}, {numbers[1]})")
        else:
            made.append(f"Clock({event.name!r}, times=[{', '.join(numbers)}])")
    return "\n".join([*lines, f"        return [{', '.join(made)}]"])


def _described(eq: Equations, i: int) -> str:
    name = eq.system.parameters.names[i]
    own = eq.system.parameters[name]
    unit = f" [{own.unit}]" if own.unit else ""
    return printable(f"{name}{unit} {own.description}".strip())


def _head(name: str, arguments: str, gives: str) -> list[str]:
    return ["", "    @staticmethod", f"    def {name}({arguments}) -> {gives}:"]


def _function(
    eq: Equations, name: str, arguments: str, *expressions: Sequence[Expr], rows: bool = False
) -> list[str]:
    """A function that returns a list, or with `rows` a list of lists."""
    flat = [e for row in expressions for e in row]
    head = _head(name, arguments, "list[list[float]]" if rows else "list[float]")
    return head + _lines(eq, flat, [len(row) for row in expressions] if rows else None)


def _lines(eq: Equations, flat: Sequence[Expr], shape: Sequence[int] | None = None) -> list[str]:
    """The lines of a function that returns expressions, in rows of a shape."""
    form = eq.form
    printer = PythonText().name(names_of(form, eq.modes), form.a)
    sizes: list[tuple[Symbol, Expr]] = eq.sizes(flat)
    lines = assignments(printer, [("", e) for e in flat], sizes, "{name} = {value}")
    texts = [line.removeprefix(" = ") for line in lines[len(lines) - len(flat) :]]
    lines = lines[: len(lines) - len(flat)]
    if shape is None:
        value = "[" + ", ".join(texts) + "]"
    else:
        value, rest = "", list(texts)
        for count in shape:
            value += "[" + ", ".join(rest[:count]) + "], "
            rest = rest[count:]
        value = f"[{value.removesuffix(', ')}]"
    return [f"        {line}" for line in (*lines, f"return {value}")]
