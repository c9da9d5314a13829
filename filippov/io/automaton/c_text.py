"""The automaton of a system as one file of C99: its equations, and `runtime.c` behind them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from sympy import Expr

from filippov.io.automaton.equations import Equations, names_of
from filippov.io.automaton.printers import CText, assignments

HEADER = """/* The exact automaton of a system, written by `filippov export`. C99, no library but libm:

       cc -O2 THIS.c -o model -lm && ./model -t 0 10

   or, with -DFILIPPOV_NO_MAIN, the function filippov_run below. The status is "success", or the name of what
   the automaton does not decide (corner, tangency, two-fold, non_unique, zeno, ...); the run ends there. */

#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SWITCHING, KINK, OBSERVER, RESETTING };
static int non_lipschitz; /* a power of |h| below 1 was there */

/* A power of a size |h|, which is negative in stages beyond its surface: held at 0 there. */
static double size_power(double size, double exponent) {
    if (exponent < 1) non_lipschitz = 1;
    return exponent == 2 ? size * size : exponent == 1 ? size : pow(fmax(size, 0), exponent);
}

static double sign_of(double value) { return (value > 0) - (value < 0); }
"""
_ROLES = {"switching": "SWITCHING", "kink": "KINK", "observer": "OBSERVER", "reset": "RESETTING"}
_PLAIN = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 _.,+-*/()<>=")


def c_string(text: str) -> str:
    """A string literal of C; every byte that could end it, or start a trigraph, as an octal escape."""
    return '"' + "".join(chr(b) if chr(b) in _PLAIN else f"\\{b:03o}" for b in text.encode()) + '"'


def c_file(
    eq: Equations, values: Sequence[float], x0: Sequence[float] | None, t_span: Sequence[float] | None
) -> str:
    """The text of the file; values: the parameters' defaults in it."""
    runtime = (Path(__file__).parent / "runtime.c").read_text(encoding="utf-8")
    return f"{HEADER}\n{model_text(eq, values, x0, t_span)}\n\n{runtime}"


def model_text(
    eq: Equations, values: Sequence[float], x0: Sequence[float] | None, t_span: Sequence[float] | None
) -> str:
    """Sizes, names, constants and the functions of the equations."""
    system = eq.system
    n, m, count, clocks = len(eq.form.x), len(eq.form.h), len(eq.form.p), len(system.time_events)
    own = [system.parameters[name] for name in system.parameters.names]
    lists = [0 if q.times is None else len(q.times) for q in system.time_events]
    room = max(2, *lists, 2)
    span = t_span if t_span is not None else (0.0, math.nan)
    lines = [
        "/* ---- the equations: x states, p parameters, s signs, m the mode; a sizes |h|, c common parts */",
        "",
        f"enum {{ N = {n}, SURFACES = {m}, M = {max(m, 1)}, PARAMETERS = {count}, P = {max(count, 1)},",
        f"       CLOCK_COUNT = {clocks}, CLOCKS = {max(clocks, 1)}, TIMES = {room},",
        f"       AFFINE = {int(eq.affine)}, OUTPUTS = {len(eq.outputs)} }};",
        _array("char *const", "STATE_NAMES[N]", map(c_string, system.states)),
        _array("char *const", "SURFACE_NAMES[M]", map(c_string, system.surface_names), '""'),
        _array(
            "char *const", f"OUTPUT_NAMES[{max(len(eq.outputs), 1)}]", map(c_string, system.outputs), '""'
        ),
        _array("char *const", "PARAMETER_NAMES[P]", map(c_string, system.parameters.names), '""'),
        _array("char *const", "CLOCK_NAMES[CLOCKS]", (c_string(q.name) for q in system.time_events), '""'),
        _array("double", "X0[N]", map(_number, x0 if x0 is not None else [math.nan] * n)),
        f"static const double T0 = {_number(span[0])}, T1 = {_number(span[1])};",
        _array("double", "DEFAULTS[P]", map(_number, values)),
        _array("double", "LOWER[P]", (_number(-math.inf if q.lower is None else q.lower) for q in own)),
        _array("double", "UPPER[P]", (_number(math.inf if q.upper is None else q.upper) for q in own)),
        _array("int", "ROLE[M]", (_ROLES[str(q.kind)] for q in system.surfaces)),
        _array("double", "WIDTH[M]", map(_number, eq.widths)),
        _array("int", "RESET_FROM[M]", map(str, eq.reset_from)),
        _array("int", "CONTACT[M]", map(str, eq.contact)),
        _array("int", "COMPONENT[M]", map(str, eq.component)),
        _array("int", f"ORDER[{max(m + clocks, 1)}]", map(str, eq.order)),
        _array("int", "TIMES_OF[CLOCKS]", map(str, lists)),
    ]
    state = "double t, const double *x, const double *p"
    lines += _function(eq, f"field({state}, const double *s, const int *m, double *out)", "out[{}]", eq.field)
    lines += _function(eq, f"guards({state}, const int *m, double *out)", "out[{}]", eq.guards)
    rows = [e for row in eq.gradients for e in row]
    lines += _function(
        eq, f"gradients({state}, const int *m, double out[M][N + 1])", "out[0][{}]", rows, n + 1
    )
    lines += _function(
        eq, f"output_values({state}, const double *s, const int *m, double *out)", "out[{}]", eq.outputs
    )
    lines += _function(
        eq, f"ends({state}, double out[M][2])", "out[0][{}]", [e for q in eq.ends for e in q], 2
    )
    signs = dict(zip(eq.form.s, eq.modes, strict=True))
    for name, tables in (("reset", eq.resets), ("strike", eq.strikes)):
        lines += ["", f"static void {name}(int i, {state}, const int *m, double *out) {{", *_UNUSED]
        lines.append("    for (int j = 0; j < N; j++) out[j] = x[j];")
        for i, after in enumerate(tables):
            if after is not None:
                body = _lines(eq, [(f"out[{j}]", e.xreplace(signs)) for j, e in enumerate(after)])
                lines += [f"    if (i == {i}) {{", *(f"    {line}" for line in body), "    }"]
        lines.append("}")
    lines += ["", "static void clock_numbers(const double *p, double out[CLOCKS][TIMES]) {", "    (void)p;"]
    printer = CText().name(names_of(eq.form, eq.modes), eq.form.a)
    for k, event in enumerate(system.time_events):
        for i, q in enumerate(event.instants):
            lines.append(f"    out[{k}][{i}] = {_number(q) if isinstance(q, float) else printer(q)};")
    return "\n".join([*lines, "    (void)out;", "}"])


_UNUSED = ["    (void)t, (void)x, (void)p, (void)m, (void)out, (void)i;"]


def _number(value: float) -> str:
    if math.isfinite(value):
        return repr(float(value))
    return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"


def _array(kind: str, name: str, items: object, empty: str = "0") -> str:
    values: list[str] = list(items)  # type: ignore[call-overload]
    return f"static const {kind} {name} = {{{', '.join(values or [empty])}}};"


def _function(eq: Equations, head: str, target: str, flat: Sequence[Expr], width: int = 0) -> list[str]:
    """A function that stores expressions; width: in rows of this length."""
    names = [
        f"out[{k // width}][{k % width}]" if width else target.format(k) for k in range(len(flat))
    ]  # fmt: skip
    unused = [word for word in ("t", "x", "p", "s", "m", "out") if f" *{word}" in head or f" {word}" in head]
    first = "    " + ", ".join(f"(void){word}" for word in unused) + ";"
    return ["", f"static void {head} {{", first, *_lines(eq, list(zip(names, flat, strict=True))), "}"]


def _lines(eq: Equations, targets: Sequence[tuple[str, Expr]]) -> list[str]:
    printer = CText().name(names_of(eq.form, eq.modes), eq.form.a)
    sizes = eq.sizes([e for _, e in targets])
    lines = assignments(printer, targets, sizes, "double {name} = {value}")
    return [f"    {line};" for line in lines]
