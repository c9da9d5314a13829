"""A stability analysis as text, Markdown, LaTeX, dict and JSON."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import sympy
from sympy.core.relational import Relational

from filippov.analysis.algebra import routh_text
from filippov.analysis.algebra.number_text import Formula, plain, tex
from filippov.analysis.local_stability.stability_result import (
    EIGENVALUE,
    EquilibriumStability,
    SlipCase,
    Solved,
    StabilityResult,
    Statement,
)
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, Stopped
from filippov.base.escape import latex, markdown, printable
from filippov.base.json_text import json_text
from filippov.base.shown import plain_data


@dataclass(frozen=True)
class Style:
    """How one format writes formulas, headings, items and Routh arrays."""

    formula: Callable[[Any], str]
    heading: Callable[[int, str], str]
    item: Callable[[str], str]
    routh: Callable[[Any], str]
    escape: Callable[[str], str]


def _plain(expression: Any, formula: Formula = str) -> str:
    if isinstance(expression, sympy.Eq):
        return f"{formula(expression.lhs)} = {formula(expression.rhs)}"
    if isinstance(expression, Relational) and expression.lhs.is_number:
        return formula(expression.reversed)
    if isinstance(expression, sympy.And | sympy.Or):
        ordered = sorted(expression.args, key=str)
        parts = [_plain(a, formula) for a in ordered]
        parts = [f"({q})" if isinstance(a, sympy.And) else q for a, q in zip(ordered, parts, strict=True)]
        return (" and " if isinstance(expression, sympy.And) else " or ").join(parts)
    return formula(expression)


def _underlined(level: int, title: str) -> str:
    return f"{title}\n{('=' if level == 1 else '-') * len(title)}" if level < 3 else f"* {title}"


def text_style(decimals: bool) -> Style:
    """Plain text."""
    formula = plain(decimals)
    return Style(
        lambda e: _plain(e, formula),
        _underlined,
        lambda s: f"  - {s}",
        lambda routh: routh_text.text(routh, "    ", formula),
        printable,
    )


def markdown_style(decimals: bool) -> Style:
    """Markdown with formulas between dollar signs."""
    formula = tex(decimals)
    return Style(
        lambda e: f"${formula(e)}$",
        lambda n, s: f"{'#' * (n + 1)} {s}",
        lambda s: f"- {s}",
        lambda routh: routh_text.markdown(routh, formula),
        markdown,
    )


def latex_style(decimals: bool) -> Style:
    """LaTeX, for a document with amsmath."""
    formula = tex(decimals)
    return Style(
        lambda e: f"${formula(e)}$",
        lambda n, s: f"\\{('section', 'subsection', 'paragraph')[n - 1]}{{{s}}}",
        lambda s: s + r"\par",
        lambda routh: routh_text.latex(routh, formula),
        latex,
    )


def latex_document(sections: str) -> str:
    """Sections in a document of their own."""
    head = r"\documentclass{article}", r"\usepackage{amsmath,amssymb}", r"\begin{document}"
    return "\n".join([*head, sections.rstrip(), r"\end{document}", ""])


def render(result: StabilityResult, style: Style) -> str:
    """Return the whole report."""
    values = ", ".join(f"{style.escape(name)} = {value:g}" for name, value in result.parameters)
    head = style.heading(1, "Stability")
    blocks = [head, _summary(result, style), f"Parameter values: {values or 'none'}."]
    if result.assume:
        blocks.append("Assumed in the formulas: " + ", ".join(style.formula(a) for a in result.assume) + ".")
    for item in result.items:
        blocks += _item(item, result, style)
    blocks += [style.item(style.escape(note)) for note in result.notes]
    return "\n\n".join(blocks) + "\n"


def _summary(result: StabilityResult, style: Style) -> str:
    """The verdicts in one line, and whether they are all."""
    cut = any(isinstance(note, Stopped) for note in result.notes)
    left = " The search was stopped before its end." if cut else ""
    if not cut and not result.complete:
        left = " Not complete: see the notes at the end."
    if not result.items:
        return f"Verdict: no equilibrium was found.{left}"
    said = [f"{_title(item, result, style)}: {_verdict(item)}" for item in result.items]
    return "Verdict: " + "; ".join(said) + f".{left}"


def _verdict(item: EquilibriumStability) -> str:
    """The verdict, and of what where it is none of the item alone."""
    return item.answer + (f" together with mode {', '.join(item.together)}" if item.together else "")


def _title(item: EquilibriumStability, result: StabilityResult, style: Style) -> str:
    """What an equilibrium is called; those of one kind and mode are distinguished by their place."""
    named = _kind(item, result, style)
    alike = [other for other in result.items if _kind(other, result, style) == named]
    return named if len(alike) < 2 else f"{named}, {_at(item.equilibrium)}"


def _at(e: EquilibriumPoint | EquilibriumSet) -> str:
    if isinstance(e, EquilibriumPoint):
        return f"at {_values(e.value, 6)}"
    if e.dimension > 1:
        return "around " + ", ".join(f"{q} = {c:.3g}" for q, c in zip(e.free, e.inner, strict=True))
    shown = [_values(end.value, 6) for end in e.ends]
    return f"between {shown[0]} and {shown[1]}" if len(shown) == 2 else f"with {len(shown)} ends"


def _kind(item: EquilibriumStability, result: StabilityResult, style: Style) -> str:
    e = item.equilibrium
    on = ", ".join(name for name, c in zip(result.surfaces, e.mode, strict=True) if c == "0")
    kind = "set of equilibria" if isinstance(e, EquilibriumSet) else e.kind
    where = f", mode {e.mode}" if e.mode else ""
    how = "on" if kind == "resting contact" else "sliding on"
    behind = f", behind {', '.join(e.behind)}" if e.behind else ""
    return style.escape(f"{kind}{where}" + (f", {how} {on}" if on else "") + behind)


def _item(item: EquilibriumStability, result: StabilityResult, style: Style) -> list[str]:
    e = item.equilibrium
    on = "0" in e.mode
    title = _title(item, result, style)
    title = title[0].upper() + title[1:]
    lines = [style.item(line) for line in _place(e, style)]
    verdict = f"Verdict at the parameter values: {_verdict(item)}."
    if e.behind:
        text = f"solutions reach it from starts beyond {', '.join(e.behind)} only, which no solution passes"
        lines.append(style.item(style.escape(text)))
    blocks = [style.heading(2, title), verdict, "\n".join(lines)]
    if item.polynomial is not None and len(item.polynomial) > 1:
        of = "sliding field" if on else "linear part"
        whole = item.routh is not None and len(item.routh.coefficients) == len(item.polynomial)
        formula = "" if whole else f" {style.formula(_polynomial(item.polynomial))}"
        blocks.append(f"Characteristic polynomial of the {of}:{formula}")
        if whole:
            blocks.append(style.routh(item.routh))
    if item.solved is not None:
        blocks.append("\n".join(style.item(line) for line in _solved(item.solved, style)))
    blocks.append("\n".join(style.item(_statement(s, style)) for s in item.statements))
    for case in item.cases:
        blocks += _case(case, bool(getattr(e, "ends", ())), style)
    return [b for b in blocks if b]


def _place(e: EquilibriumPoint | EquilibriumSet, style: Style) -> list[str]:
    formulas = ", ".join(
        f"{_name(n, style)} free" if str(x) == n else f"{_name(n, style)} = {style.formula(x)}"
        for n, x in zip(e.states, e.x, strict=True)
    )
    lines = [formulas]
    on_surface = [(name, s) for name, s in e.multipliers if not s.is_Symbol]
    if on_surface:
        text = ", ".join(f"{style.escape(name)}: {style.formula(s)}" for name, s in on_surface)
        lines.append(f"multiplier of {text}")
    if isinstance(e, EquilibriumSet):
        lines[0] += ", " + ", ".join(
            f"{style.formula(q)} in [{style.formula(low)}, {style.formula(high)}]"
            for q, (low, high) in zip(e.free, e.domain, strict=True)
        )
        lines += _cut_off(e, style)
        lines += ["end: " + _values(end.value) for end in e.ends]
    else:
        lines.append("value: " + _values(e.value))
        if e.conditions:
            lines.append("exists where " + ", ".join(style.formula(c) for c in e.conditions))
    return lines


def _cut_off(e: EquilibriumSet, style: Style) -> list[str]:
    """What bounds a set of more dimensions besides the limits of single symbols."""
    if e.dimension < 2:
        return []
    sides = [c for c in e.conditions if len(c.free_symbols & {*e.free}) > 1 or not _linear(c, e)]
    return ["where " + ", ".join(style.formula(c) for c in sides)] if sides else []


def _linear(condition: Any, e: EquilibriumSet) -> bool:
    g = condition.gts - condition.lts
    return all(g.diff(q).is_number for q in e.free)


def _name(state: str, style: Style) -> str:
    return style.formula(sympy.Symbol(state))


def _values(values: Sequence[float], digits: int = 10) -> str:
    return "(" + ", ".join(f"{v:.{digits}g}" for v in values) + ")"


def _case(case: SlipCase, ends: bool, style: Style) -> list[str]:
    sides = " and ".join("h > 0" if side == "+" else "h < 0" for side in case.sides)
    condition = "" if case.condition == sympy.true else f", case {style.formula(case.condition)}"
    here = (
        ""
        if case.condition == sympy.true
        else " (this is the case here)"
        if case.applies
        else " (not the case here)"
    )
    blocks = [style.heading(3, f"Slip beside the set, {style.escape(sides)}{condition}{here}")]
    linear = case.linearisation
    facts = []
    if linear.jump:
        facts.append(
            "jump part: ("
            + ", ".join(style.formula(j) for j in linear.jump)
            + ")"
            + " at the end" * bool(ends)
        )
    facts.append("validity: " + style.escape(linear.validity))
    if case.polynomial is not None and case.routh is None:
        facts.append(f"characteristic polynomial {style.formula(_polynomial(case.polynomial))}")
    blocks.append("\n".join(style.item(f) for f in facts))
    if case.routh is not None:
        blocks.append(style.routh(case.routh))
    lines = [f"at the parameter values the set is {case.answer} in this case"]
    if case.hurwitz is not None:
        held = "hold" if case.hurwitz else "do not hold"
        meaning = {
            "sufficient": ": they suffice for a stable set, and where they fail they say nothing",
            "necessary and sufficient": ": the set is stable where they hold and only there",
            "none": ": for the set they say nothing",
        }[case.criterion]
        lines.append(f"the Routh-Hurwitz conditions of the slip polynomial {held}{meaning}")
    if case.solved is not None:
        lines += _solved(case.solved, style)
    lines += [_statement(s, style) for s in case.statements]
    return [*blocks, "\n".join(style.item(line) for line in lines)]


def _solved(solved: Solved, style: Style) -> list[str]:
    symbol = style.formula(solved.symbol)
    lines = [
        f"Routh-Hurwitz solved for {symbol}: {style.formula(solved.formula)}",
        f"with the other parameters at their values: {style.formula(solved.numeric)}",
    ]
    ends = {q for q in _ends_of(solved.numeric, solved.symbol) if q.atoms(sympy.Function)}
    lines += [f"{style.formula(q)} = {float(q):.10g}" for q in sorted(ends, key=str)]
    if _stands(solved.formula, solved.symbol) or _stands(solved.numeric, solved.symbol):
        text = f"a condition neither linear in {symbol} nor in one exponential of it is left as it stands"
        lines.append(text)
    if solved.threshold:
        found = ", ".join(f"{v:.10g}" for v in solved.threshold)
        lines.append(
            f"the set itself changes stability at {symbol} = {found} (return map of the linearised inclusion)"
        )
    return lines


def _ends_of(condition: Any, symbol: sympy.Symbol) -> set[Any]:
    """The numbers between which it says that the symbol lies."""
    parts = condition.atoms(Relational) if isinstance(condition, sympy.Basic) else ()
    return {q for r in parts if symbol in (r.lhs, r.rhs) for q in (r.lhs, r.rhs) if q.is_number}


def _stands(condition: Any, symbol: sympy.Symbol) -> bool:
    """Whether an inequality in it holds the symbol and is not solved for it."""
    parts = condition.atoms(Relational) if isinstance(condition, sympy.Basic) else ()
    return any(r.has(symbol) and symbol not in (r.lhs, r.rhs) for r in parts)


def _statement(statement: Statement, style: Style) -> str:
    source = "" if statement.source == "computed" else f" [{statement.source}]"
    return style.escape(statement.text + source)


def _polynomial(coefficients: Sequence[Any]) -> Any:
    n = len(coefficients) - 1
    terms = [c * EIGENVALUE ** (n - k) for k, c in enumerate(coefficients)]
    return sympy.Add(*terms)


def as_dict(result: StabilityResult) -> dict[str, Any]:
    """Expressions as strings, numbers as floats (None for what is not finite)."""
    return {
        "states": list(result.states),
        "surfaces": list(result.surfaces),
        "parameters": dict(result.parameters),
        "assumptions": [str(a) for a in result.assume],
        "equilibria": [_item_dict(item) for item in result.items],
        "complete": result.complete,
        "notes": list(result.notes),
    }


def as_json(result: StabilityResult) -> str:
    """`as_dict` as JSON."""
    return json_text(as_dict(result), indent=2)


def _item_dict(item: EquilibriumStability) -> dict[str, Any]:
    e = item.equilibrium
    out: dict[str, Any] = {
        "kind": "equilibrium set" if isinstance(e, EquilibriumSet) else e.kind,
        "mode": e.mode,
        "dimension": e.dimension,
        "x": dict(zip(e.states, map(str, e.x), strict=True)),
        "multipliers": {name: str(s) for name, s in e.multipliers},
        "conditions": [_plain(c) for c in e.conditions],
        "exact": e.exact,
        "degenerate": list(e.degenerate),
        "behind": list(e.behind),
    }
    if isinstance(e, EquilibriumSet):
        out["domain"] = {str(q): [str(b) for b in pair] for q, pair in zip(e.free, e.domain, strict=True)}
        out["bounds"] = {str(q): [_finite(b) for b in pair] for q, pair in zip(e.free, e.bounds, strict=True)}
        out["ends"] = [list(end.value) for end in e.ends]
    else:
        out["value"] = list(e.value)
    out |= {
        "polynomial": None if item.polynomial is None else [str(c) for c in item.polynomial],
        "drift": item.drift,
        "interior": item.interior,
        "cases": [_case_dict(case) for case in item.cases],
        "solved": None if item.solved is None else _solved_dict(item.solved),
        "stability": item.answer,
        "together": list(item.together),
        "statements": plain_data(item.statements),
    }
    return out


def _case_dict(case: SlipCase) -> dict[str, Any]:
    return {
        "sides": list(case.sides),
        "condition": _plain(case.condition),
        "applies": case.applies,
        "validity": case.linearisation.validity,
        "jump": [str(j) for j in case.linearisation.jump],
        "polynomial": None if case.polynomial is None else [str(c) for c in case.polynomial],
        "routh_hurwitz": None if case.routh is None else routh_text.as_dict(case.routh),
        "criterion": case.criterion,
        "hurwitz": case.hurwitz,
        "return_map": [{"outcome": m.outcome, "kappa": _finite(m.kappa)} for m in case.maps],
        "solved": None if case.solved is None else _solved_dict(case.solved),
        "stability": case.answer,
        "statements": plain_data(case.statements),
    }


def _solved_dict(solved: Solved) -> dict[str, Any]:
    return {
        "parameter": str(solved.symbol),
        "formula": _plain(solved.formula),
        "numeric": _plain(solved.numeric),
        "threshold": list(solved.threshold),
    }


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None
