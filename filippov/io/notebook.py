"""What a notebook shows of an object: tables in HTML, equations in LaTeX."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import sympy
from sympy.printing.latex import greek_letters_set

from filippov.base.escape import latex as latex_text
from filippov.base.escape import markup
from filippov.base.status import mode_text
from filippov.model.symbolic import Select
from filippov.model.system import System
from filippov.solving.solution import Solution
from filippov.solving.state.events import Events

MOST_ROWS, MOST_TIMES = 40, 8


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], note: str = "") -> str:
    """A table of HTML; every text in it is escaped."""
    top = "".join(f"<th>{markup(name)}</th>" for name in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{markup(item)}</td>" for item in row) + "</tr>" for row in rows
    )
    below = f"<p>{markup(note)}</p>" if note else ""
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>{below}"


def solution_html(solution: Solution) -> str:
    """How a run ended, where, and what happened on the way."""
    system = solution.system
    counted = solution.options.save_events == "count"
    end = ", ".join(f"{n} = {v:.9g}" for n, v in zip(system.states, solution.x_end, strict=True))
    events = [
        f"{number} {kind} of {name}"
        for name, kinds in solution.event_counts.items()
        for kind, number in kinds.items()
    ]
    rows = [
        ("status", f"{solution.status.value}: {solution.message}"),
        ("time", f"{solution.problem.t_span[0]:.9g} to {solution.t_end:.9g}"),
        ("end", f"{end} (mode {mode_text(solution.end_mode)})"),
        ("events", ", ".join(events) or "none"),
    ]
    if not counted:
        dwell = [f"{mode}: {time:.6g}" for mode, time in solution.dwell_times().items()]
        rows.append((f"time in modes ({', '.join(system.surface_names)})", ", ".join(dwell)))
    rows.append(("work", f"{solution.steps} steps, {solution.nfev} field calls"))
    return table(("Solution", ""), rows)


def events_html(events: Events) -> str:
    """The first events, one per row."""
    names = events.states or ()
    rows = [
        (f"{e.t:.9g}", e.surface, e.kind, f"{mode_text(e.before)} → {mode_text(e.after)}",
         *(f"{v:.6g}" for v in (e.x if names else ())), e.note)
        for e in events[:MOST_ROWS]
    ]  # fmt: skip
    left = len(events) - MOST_ROWS
    note = f"and {left} more of {len(events)}" if left > 0 else ""
    return table(("t", "surface", "kind", "mode", *names, "note"), rows, note)


def system_latex(system: System) -> str:
    """The equations, surfaces, resets, clocks, outputs, parameters in LaTeX; of functions their names."""
    form, lines = system.symbolic, []
    write = _Writer(system)
    if form is None:
        names = ", ".join(rf"\mathrm{{{_text(name)}}}" for name in system.states)
        lines.append(rf"\dot x = f(t, x, p, s) \quad ({names})")
        lines += [
            rf"\text{{{_text(s.name)}: }}& h(t, x, p) = 0 \;\text{{({s.kind})}}{write.reset(s.reset)}"
            for s in system.surfaces
        ]
    else:
        for name, f in zip(system.states, form.field, strict=True):
            lines.append(rf"\dot{{{symbol(name)}}} &= {write(f)}")
        rows = zip(system.surfaces, form.plain_h(), form.radius, strict=True)
        lines += [write.surface(i, *row) for i, row in enumerate(rows)]
    lines += [write.clock(i, event) for i, event in enumerate(system.time_events)]
    lines += [rf"\text{{{_text(name)}}} &= {write(e)}" for name, e in system.outputs.items()]
    for name in system.parameters:
        q = system.parameters[name]
        unit = rf"\;{_unit(q.unit)}" if q.unit else ""
        lines.append(rf"{symbol(name)} &= {q.default:.9g}{unit}")
    return "$$\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}$$"


def symbol(name: str) -> str:
    """A name in a formula: v_max with its index, Fs upright, beta in Greek, x1 with the number as index."""
    stem, *below = name.split("_")
    digits = re.fullmatch(r"([^\W\d]+?)(\d+)", stem)
    if digits is not None:
        stem, below = digits[1], [digits[2], *below]
    if not stem or not all(below):
        return rf"\mathrm{{{_text(name)}}}"
    if stem in greek_letters_set:
        head: str = sympy.latex(sympy.Symbol(stem))
    else:
        head = stem if len(stem) == 1 and stem.isascii() else rf"\mathrm{{{_text(stem)}}}"
    index = ",".join(part if part.isdigit() else rf"\mathrm{{{_text(part)}}}" for part in below)
    return f"{head}_{{{index}}}" if below else head


class _Writer:
    """Expressions of one system in LaTeX, with signs and branches written out."""

    def __init__(self, system: System) -> None:
        self.form, self.states = system.symbolic, system.states
        self.values: dict[Any, Any] = {}
        if self.form is not None:
            for s, a, h in zip(self.form.s, self.form.a, self.form.plain_h(), strict=True):
                self.values |= {s: sympy.sign(h), a: sympy.Abs(h)}

    def __call__(self, f: Any) -> str:
        """LaTeX of an expression."""
        shown = f.xreplace(self.values).replace(Select, _branch)
        names = {q: symbol(q.name) for q in shown.free_symbols if hasattr(q, "name")}
        text: str = sympy.latex(shown, symbol_names=names)
        return text

    def surface(self, i: int, surface: Any, h: Any, radius: tuple[Any, Any]) -> str:
        """The line of a surface: where it is, what it is, what happens there."""
        assert self.form is not None
        width = self.form.widths[i] if self.form.widths else None
        low, high = radius
        whole = h if width is None else h * width
        text = rf"\text{{{_text(surface.name)}: }}& {self(whole)} = 0 \;\text{{({surface.kind})}}"
        if width is not None:
            text += rf",\; \text{{hysteresis }} \pm {self(width)}"
        if surface.kind == "switching" and (low, high) != (-1, 1):
            text += rf",\; s \in [{self(low)}, {self(high)}]"
        if surface.kind == "reset" and surface.side != "+":
            text += rf",\; \text{{from {_text(surface.side)}}}"
        return text + self.reset(self.form.reset[i] if self.form.reset else None)

    def clock(self, i: int, event: Any) -> str:
        """The line of a time event: its instants and its reset."""
        if event.times is not None:
            when = ", ".join(_instant(self, q) for q in event.times[:MOST_TIMES])
            when = rf"\{{{when}{', ...' if len(event.times) > MOST_TIMES else ''}\}}"
        else:
            first = _instant(self, event.start)
            first = "" if first == "0" else f"{first} + "
            when = rf"\{{{first}k\, {_instant(self, event.period)}\}}"
        after = event.reset
        if self.form is not None:
            after = self.form.time_reset[i] if self.form.time_reset else None
        return rf"\text{{{_text(event.name)}: }}& t \in {when}{self.reset(after)}"

    def reset(self, after: Any) -> str:
        """The states that a reset changes; of a function only that there is one."""
        if after is None:
            return ""
        if self.form is None:
            return r",\; x \to r(t, x, p)"
        pairs = zip(self.states, self.form.x, after, strict=True)
        moved = [rf"{symbol(name)} \to {self(e)}" for name, x, e in pairs if e != x]
        return "".join(rf",\; {one}" for one in moved)


def _instant(write: _Writer, value: Any) -> str:
    if callable(value) and not hasattr(value, "free_symbols"):
        return r"\mathrm{f}(p)"
    return write(value) if getattr(value, "free_symbols", ()) else f"{float(value):.9g}"


def _unit(unit: str) -> str:
    """A unit, its powers above the line."""
    if not re.search(r"[*^]", unit):
        return rf"\text{{{_text(unit)}}}"
    parts = re.split(r"(?:\*\*|\^)(-?\d+)", unit)
    shown = [_text(part).replace("*", r"\cdot ") for part in parts[::2]]
    powers = [*(f"^{{{power}}}" for power in parts[1::2]), ""]
    return rf"\mathrm{{{''.join(a + b for a, b in zip(shown, powers, strict=True))}}}"


def _branch(c: Any, plus: Any, minus: Any) -> Any:
    positive = c.args[0] if isinstance(c, sympy.sign) else c
    return sympy.Piecewise((plus, sympy.Gt(positive, 0)), (minus, True))


def _text(name: Any) -> str:
    """Text inside a formula: without dollar signs where none are needed."""
    return latex_text(name).replace("$*$", "*").replace("$|$", "|")
