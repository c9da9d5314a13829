"""What a notebook shows of an object: tables in HTML, equations in LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy

from filippov.base.escape import latex as latex_text
from filippov.base.escape import markup
from filippov.base.status import mode_text
from filippov.model.symbolic import Select
from filippov.model.system import System
from filippov.solving.solution import Solution
from filippov.solving.state.events import Events

MOST_ROWS = 40


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
    """The equations, surfaces, outputs and parameters in LaTeX; of functions only their names."""
    lines = []
    form = system.symbolic
    if form is None:
        names = ", ".join(rf"\mathrm{{{latex_text(name)}}}" for name in system.states)
        lines.append(rf"\dot x = f(t, x, p, s) \quad ({names})")
    else:
        values: dict[Any, Any] = {}
        for s, a, h in zip(form.s, form.a, form.plain_h(), strict=True):
            values |= {s: sympy.sign(h), a: sympy.Abs(h)}
        for x, f in zip(form.x, form.field, strict=True):
            lines.append(rf"\dot{{{sympy.latex(x)}}} &= {_shown(f, values)}")
        for surface, h, (low, high) in zip(system.surfaces, form.plain_h(), form.radius, strict=True):
            text = rf"\text{{{latex_text(surface.name)}: }}& {sympy.latex(h)} = 0 \;\text{{({surface.kind})}}"
            if surface.kind == "switching" and (low, high) != (-1, 1):
                text += rf",\; s \in [{_shown(low, values)}, {_shown(high, values)}]"
            lines.append(text)
        for name, e in system.outputs.items():
            lines.append(rf"\text{{{latex_text(name)}}} &= {sympy.latex(e)}")
    for name in system.parameters:
        q = system.parameters[name]
        unit = rf"\;\text{{{latex_text(q.unit)}}}" if q.unit else ""
        lines.append(rf"{sympy.latex(sympy.Symbol(name))} &= {q.default:.9g}{unit}")
    return "$$\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}$$"


def _shown(f: Any, values: dict[Any, Any]) -> str:
    """LaTeX of an expression with its signs and branches written out."""

    def branch(c: Any, plus: Any, minus: Any) -> Any:
        positive = c.args[0] if isinstance(c, sympy.sign) else c
        return sympy.Piecewise((plus, sympy.Gt(positive, 0)), (minus, True))

    text: str = sympy.latex(f.xreplace(values).replace(Select, branch))
    return text
