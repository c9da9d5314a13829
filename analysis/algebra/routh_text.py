"""A Routh-Hurwitz analysis as text, Markdown, LaTeX, dict and JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import sympy

from filippov.analysis.algebra.number_text import LONGEST, Printer
from filippov.analysis.algebra.routh_array import Special
from filippov.analysis.algebra.routh_result import RouthResult
from filippov.base.shown import plain_data

Formula = Callable[[Any], str]
WIDEST_TABLE = 140


def text(result: RouthResult, indent: str = "", formula: Formula = str) -> str:
    """Plain text, the array aligned in columns as long as it is not too wide."""
    power = f"{result.s}^"
    cells = [[formula(x) for x in row] for row in result.array]
    widths = [max(len(row[j]) for row in cells if j < len(row)) for j in range(max(map(len, cells)))]
    if sum(widths) > WIDEST_TABLE:
        widths = [0] * len(widths)
    margin = len(f"{power}{result.degree}")
    lines = [f"p({result.s}) = {_polynomial(result, formula, '*')}"]
    for k, row in enumerate(cells):
        entries = "  ".join(x.rjust(width) for x, width in zip(row, widths, strict=False))
        lines.append(f"{power}{result.degree - k}".ljust(margin) + " | " + entries)
    lines += _sentences(result, formula, False)
    rendered = "\n".join(indent + line for line in lines)
    for case in result.cases:
        rendered += f"\n{indent}case {_relation(case.condition, formula, False)}:"
        rendered += (
            " as above" if case.reduced is None else "\n" + text(case.reduced, indent + "    ", formula)
        )
    return rendered


def markdown(result: RouthResult, tex: Formula = sympy.latex) -> str:
    """Markdown: the polynomial, a table and a list."""
    width = max(len(row) for row in result.array)
    lines = [f"$p({tex(result.s)}) = {_polynomial(result, tex, ' ')}$", ""]
    lines += ["| |" + " |" * width, "|---|" + "---|" * width]
    for k, row in enumerate(result.array):
        cells = [_dollars(tex)(x) for x in row] + [""] * (width - len(row))
        lines.append(f"| ${tex(result.s)}^{{{result.degree - k}}}$ | " + " | ".join(cells) + " |")
    lines += ["", *(f"- {line}" for line in _sentences(result, tex, True))]
    for case in result.cases:
        head = f"Case {_dollars(tex)(case.condition)}:"
        reduced = case.reduced
        lines += ["", head + " as above."] if reduced is None else ["", head, "", markdown(reduced, tex)]
    return "\n".join(lines)


def latex(result: RouthResult, tex: Formula = sympy.latex) -> str:
    """LaTeX: the array in display mode, then what follows from it."""
    width = max(len(row) for row in result.array)
    rows = []
    for k, row in enumerate(result.array):
        cells = [tex(x) for x in row] + [""] * (width - len(row))
        rows.append(f"{tex(result.s)}^{{{result.degree - k}}} & " + " & ".join(cells))
    body = " \\\\\n".join(rows)
    parts = [
        f"$p({tex(result.s)}) = {_polynomial(result, tex, ' ')}$",
        f"\\[\n\\begin{{array}}{{c|{'c' * width}}}\n{body}\n\\end{{array}}\n\\]",
        *_sentences(result, tex, True),
    ]
    for case in result.cases:
        head = f"Case {_dollars(tex)(case.condition)}:"
        parts += [head + " as above."] if case.reduced is None else [head, latex(case.reduced, tex)]
    return "\n\n".join(parts)


def as_dict(result: RouthResult) -> dict[str, Any]:
    """Expressions as strings, counts as numbers."""
    return {
        "variable": str(result.s),
        "coefficients": [str(c) for c in result.coefficients],
        "array": [[str(x) for x in row] for row in result.array],
        "first_column": [str(x) for x in result.first_column],
        "assumptions": [str(a) for a in result.assume],
        "conditions": [_relation(c) for c in result.conditions],
        "special": [
            {"kind": x.kind, "power": x.power, "auxiliary": None if x.auxiliary is None else str(x.auxiliary)}
            for x in result.special
        ],
        "counts": plain_data(result.counts),
        "verdict": result.verdict.value if result.verdict else None,
        "cases": [
            {"condition": _relation(c.condition), "reduced": as_dict(c.reduced) if c.reduced else None}
            for c in result.cases
        ],
        "status": result.status,
        "message": result.message,
    }


def as_json(result: RouthResult) -> str:
    """`as_dict` as JSON."""
    return json.dumps(as_dict(result), indent=2, ensure_ascii=False)


def _dollars(tex: Formula) -> Formula:
    return lambda e: f"${tex(e)}$"


def _relation(condition: Any, formula: Formula = str, tex: bool = False) -> str:
    """Formula of a condition; as text K = 0 and K != 0 rather than sympy's Eq(K, 0) and Ne(K, 0)."""
    if not tex and isinstance(condition, sympy.Eq | sympy.Ne):
        sign = "=" if isinstance(condition, sympy.Eq) else "!="
        return f"{formula(condition.lhs)} {sign} {formula(condition.rhs)}"
    return formula(condition)


def _polynomial(result: RouthResult, formula: Formula, times: str) -> str:
    """a_0 s^n + ... + a_n, highest power first."""
    terms: list[str] = []
    for k, c in enumerate(result.coefficients):
        power = result.degree - k
        if c == 0:
            continue
        head = formula(c)
        # Printing multiplies a number into a sum.
        head = f"({head})" if c.is_Add or _is_sum(head) else head
        tail = formula(result.s**power)
        joined = head if power == 0 else tail if c == 1 else f"{head}{times}{tail}"
        terms.append(f" - {joined[1:]}" if joined.startswith("-") and terms else f" + {joined}")
    return "".join(terms).removeprefix(" + ")


def _is_sum(text: str) -> bool:
    """Whether a plus or minus stands in it outside parentheses, beside a sign in front."""
    depth = 0
    for at, c in enumerate(text):
        depth += (c in "({") - (c in ")}")
        if c in "+-" and not depth and text[:at].endswith(" "):
            return True
    return False


def _sentences(result: RouthResult, formula: Formula, tex: bool) -> list[str]:
    """What was found in the array and what follows from it, one sentence an item."""
    digits = _digits(result.conditions, formula)
    formula = _dollars(formula) if tex else formula
    lines = [_found(special, result.s, formula) for special in result.special]
    counts, conditions = result.counts, result.conditions
    if counts is not None:
        lines.append(f"roots: {counts.rhp} right, {counts.axis} on the axis, {counts.lhp} left")
        for multiplicity, number in counts.axis_multiplicities:
            if multiplicity > 1:
                lines.append(f"{number} different roots on the axis have multiplicity {multiplicity}")
        lines.append(f"verdict: {counts.verdict.value}")
    elif conditions in {(), (sympy.true,)}:
        lines.append("no condition found" if result.message else "asymptotically stable for all values")
    elif conditions == (sympy.false,):
        lines.append("asymptotically stable for no values")
    else:
        relations = " and ".join(_relation(c, formula, tex) for c in conditions) + digits
        if result.message:
            lines.append(f"necessary for asymptotic stability: {relations}")
        else:
            lines.append(f"asymptotically stable if and only if {relations}")
    return [*lines, result.message] if result.message else lines


def _digits(conditions: tuple[Any, ...], formula: Formula) -> str:
    """What is said where the numbers of a condition are not printed as they are."""
    rounded = isinstance(formula, Printer) and any(map(formula.rounds, conditions))
    return f" (numbers to {LONGEST} digits)" if rounded else ""


def _found(special: Special, s: sympy.Symbol, formula: Formula) -> str:
    row = formula(sympy.Pow(s, special.power, evaluate=special.power != 0))
    if special.auxiliary is None:
        return f"the first entry of row {row} is zero; replaced by an infinitesimal epsilon > 0"
    auxiliary = formula(special.auxiliary)
    return f"row {row} is zero; replaced by the derivative of the auxiliary polynomial {auxiliary}"
