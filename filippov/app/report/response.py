"""The model, its response, its event map and its modes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.app.report.case import CaseResults, StudyRun
from filippov.app.report.part import NONE, Chapter, Picture, TextTable, Words, number, yes
from filippov.base.status import mode_text
from filippov.graphs.graph import possible_graph
from filippov.plot import plot_graph, plot_iterates, plot_phase, plot_solution
from filippov.plot.style import INK, SERIES, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = 10.5


def model(run: StudyRun) -> Chapter:
    """Symbols, parameters and the constitutive curves."""
    said = run.study.stated.parameters if run.study.stated else {}
    rows = []
    for name in run.system.parameters:
        p, given = run.system.parameters[name], said.get(name, NONE)
        same = NONE if given == NONE else yes(float(given) == p.default)
        rows.append((name, p.description, number(p.default), given, p.unit or "1", same))
    symbols = run.study.symbols
    parts: list[Any] = [
        *([TextTable("Symbols", ("symbol", "what it is", "unit"), symbols, label="symbols")]
          if symbols else []),
        TextTable("Parameters and their values", ("symbol", "what it is", "here", "paper", "unit", "same"),
              tuple(rows), source=f"the model's own defaults, `filippov models describe {run.model.name}`.",
              label="parameters"),
    ]  # fmt: skip
    (name, title), made = run.study.curve_title, run.study.curve
    if made is not None:
        source = f"{made.__module__}.{made.__name__}, curve_*.csv."
        parts.append(Picture(name, title, source, lambda: _curves(run), label=name))
    curves = [(c.slug, c.curve) for c in run.cases if c.curve is not None]
    files = [(f"curve_{slug}.csv", ("x", "y"), zip(c.x, c.y, strict=True)) for slug, c in curves]
    return Chapter("model", "The model and its symbols", parts, files=files)


def response(run: StudyRun) -> Chapter:
    """The response and the phase portrait of the main case."""
    main, states = run.main, run.system.states
    command = f"`filippov simulate {run.given(main.case)} --rtol 1e-10`"
    start = ", ".join(f"{v:g}" for v in run.x0)
    named = {n: run.study.labels[n] for n in ("t", *states, "multiplier") if n in run.study.labels}

    def draw() -> Figure:
        return plot_solution(main.solution, multiplier=run.section.surface, labels=named, points=3000)

    files = [(f"response_{c.slug}.csv", ("t", *states, "mode"), _samples(c)) for c in run.cases]
    columns = ("t", "surface", "kind", "before", "after", *states)
    files += [(f"events_{c.slug}.csv", columns, _events(c)) for c in run.cases]
    return Chapter("response", "Time response and phase portrait", [
        Picture(f"response_{main.slug}", f"Time response from ({start}), {main.label}", command, draw,
                label="response"),
        Picture(f"phase_{main.slug}", f"Phase portraits of the same response, {main.label}", command,
                lambda: _phase(run, main), label="phase"),
    ], files=files)  # fmt: skip


def event_map(run: StudyRun) -> Chapter:
    """The map with the iterates of the response."""
    main, proposed = run.main, run.proposed
    at = ", ".join(f"{k} = {v}" for k, v in proposed.parametrisation.items())
    parts: list[Any] = [Words("p", (
        f"{run.study.letter}(d) is the {proposed.coordinate} of the next {proposed.kind} of a solution that "
        f"starts on the section at d: {at}."
    ))]  # fmt: skip
    if len(main.orbit):
        caption = (
            f"The orbit starts at the first rest of the time response, d = {main.orbit[0]:.6f}; its "
            f"{len(main.orbit) - 1} iterates and the rests of the response differ by at most "
            f"{main.apart:.1e}."
        )
        command = f"`filippov event-map {run.given(main.case)} --start {main.orbit[0]:.12g}`"
        title = f"The event map and the iterates of the response, {main.label}"
        parts.append(Picture(f"map_{main.slug}", title, command, lambda: _iterates(run, main), caption))
    files: list[Any] = []
    for c in run.cases:
        both = [c.wide] if c.small is None else [c.wide, c.small]
        d, once, power = (np.concatenate([getattr(s, n) for s in both]) for n in ("d", "once", "power"))
        order = np.argsort(d, kind="stable")
        columns = ("d", f"{run.study.letter}(d)", run.iterate if run.study.order > 1 else "iterate")
        rows = zip(d[order], once[order], power[order], strict=True)
        files += [(f"map_{c.slug}.csv", columns, rows)]
        files += [(f"iterates_{c.slug}.csv", ("k", "d"), enumerate(c.orbit.tolist()))]
    return Chapter("map", "Event map and iterates", parts, files=files)


def modes(run: StudyRun) -> Chapter:
    """The possible and the observed modes."""
    main, names = run.main, run.study.mode_names
    with run.stage("possible transitions", run.until):
        possible = possible_graph(run.system)
    word = "In a mode: how often it was entered, and the mean time [s] that it lasted."
    word += f" Mode word of the end of the response: {main.word}." if main.word else ""
    return Chapter("graph", "Modes and transitions", [
        Picture("graph", "Transitions that the system can make, with their guards",
                f"`filippov graph {run.model.name}`", lambda: plot_graph(possible, names=names)),
        Picture("modes", f"Transitions that the response made, {main.label}",
                f"`filippov graph {run.given(main.case, '--kind observed')}`",
                lambda: plot_graph(main.graph, names=names), word),
    ])  # fmt: skip


def beside(width: float, height: float, count: int) -> tuple[Figure, Any, list[Any]]:
    """A figure of parts side by side under a strip for their common legend."""
    figure = new_figure(width, height)
    strips: Any = figure.subfigures(2, 1, height_ratios=(0.11, 1.0))
    top, lower = strips
    return figure, top, list(np.atleast_1d(np.asarray(lower.subfigures(1, count), dtype=object)))


def common_legend(top: Any, parts: list[Any]) -> None:
    """One legend for all parts, in place of their own."""
    handles: dict[str, Any] = {}
    for part in parts:
        for handle, name in zip(*part.axes[0].get_legend_handles_labels(), strict=True):
            handles.setdefault(name, handle)
        part.axes[0].get_legend().remove()
    top.legend(
        list(handles.values()), list(handles), loc="center left", ncols=len(handles), handletextpad=0.4,
        columnspacing=1.4,
    )  # fmt: skip


def _curves(run: StudyRun) -> Figure:
    """The constitutive curve of every case, the whole and beside the set."""
    shown = [(c.label, c.curve) for c in run.cases if c.curve is not None]
    with style():
        figure = new_figure(7.2, 3.4)
        whole, near = figure.subplots(1, 2)
        x0, low, high = shown[0][1].at
        for ax in (whole, near):
            for k, (label, curve) in enumerate(shown):
                ax.plot(curve.x, curve.y, color=SERIES[k], label=label)
            ax.plot([x0, x0], [low, high], color=INK, linewidth=3, solid_capstyle="butt", label="set at rest",
                    zorder=1)  # fmt: skip
            ax.set_xlabel(run.label("curve x"))
        reach = 0.04 * float(np.max(np.abs(shown[0][1].x)))
        least = min(float(np.min(c.y[(c.x > 0) & (c.x < reach)])) for _, c in shown)
        margin = 0.06 * (high - least)
        near.set(xlim=(-0.06 * reach, reach), ylim=(least - margin, high + margin))
        near.set_title("beside the set, magnified", loc="left", fontsize=TITLE)
        whole.set_ylabel(run.label("curve y"))
        whole.set_title("whole", loc="left", fontsize=TITLE)
        whole.legend(loc="lower right")
    return figure


def _phase(run: StudyRun, case: CaseResults) -> Figure:
    """The first state against the second, and the last against the first, with the equilibrium set."""
    states, labels = run.system.states, run.study.labels
    named = {name: labels[name] for name in states if name in labels}
    ends = np.array([end.value for end in case.sets[0]], dtype=float) if case.sets else None
    planes = [(states[0], states[1])] + ([(states[2], states[0])] if len(states) > 2 else [])
    with style():
        figure, top, parts = beside(4.0 * len(planes), 4.2, len(planes))
        for part, (x, y) in zip(parts, planes, strict=True):
            shown = ends
            if ends is not None and not np.ptp(ends[:, [states.index(x), states.index(y)]], axis=0).any():
                shown = ends[:1]  # one point in this plane
            plot_phase(case.solution, x, y, equilibrium=shown, labels=named, figure=part)
        common_legend(top, parts)
    return figure


def _iterates(run: StudyRun, case: CaseResults) -> Figure:
    """The map with the cobweb of the response's rest positions."""
    reach = 1.15 * float(np.max(np.abs(case.orbit)))
    return plot_iterates(
        case.event_map, float(case.orbit[0]), len(case.orbit) - 1, lo=-reach, hi=reach, points=600,
        labels={"d": run.label("d"), "image": run.label("image"), "map": f"{run.study.letter}(d)"},
    )  # fmt: skip


def _samples(case: CaseResults) -> Iterator[tuple[Any, ...]]:
    """Dense samples and the ends of every segment, with the mode."""
    solution = case.solution
    assert solution.sol is not None
    span = solution.t_end - solution.problem.t_span[0]
    for segment in solution.segments:
        t = np.linspace(segment.t0, segment.t1, max(4, int(2000 * segment.dwell / span)))
        x = np.column_stack([solution.sol(t[:1], side="+"), solution.sol(t[1:])])
        for a, b in zip(t.tolist(), x.T.tolist(), strict=True):
            yield a, *b, mode_text(segment.mode)


def _events(case: CaseResults) -> Iterator[tuple[Any, ...]]:
    for e in case.solution.events:
        yield e.t, e.surface, str(e.kind), mode_text(e.before), mode_text(e.after), *e.x.tolist()
