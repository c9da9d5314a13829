"""The mode graph: nodes are modes, edges are transitions (networkx MultiDiGraph).

Every node is the text of a mode ("+0-"), every edge has the key "surface kind". Attributes, all of plain
types but `conditions`:

    possible   node  sliding (names of the sliding surfaces), field (text), multipliers (text), expanded
               edge  surface, kind, guard (text), formula (text), conditions (sympy relations)
    observed   node  sliding, visits, complete, dwell_total, dwell_mean, dwell_min, dwell_max
               edge  surface, kind, count, times (list of event times)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any

import networkx as nx
import numpy as np
import sympy

from filippov.base.errors import UsageError
from filippov.base.given import Count, as_float, several
from filippov.base.keywords import keywords
from filippov.base.label import unit_of
from filippov.base.status import mode_text
from filippov.graphs.guards import Guards, formula_text
from filippov.graphs.reset_guards import reset_transitions
from filippov.model.symbols import t
from filippov.model.system import System
from filippov.solving.solution import Solution
from filippov.solving.state.events import Event, Mode

LARGEST = 81
SAMPLES = 48
_SIGNS = {"+": 1, "0": 0, "-": -1}


@keywords()
def possible_graph(
    system: System,
    start: str | Mode | Iterable[str | Mode] | None = None,
    *,
    modes: Iterable[str | Mode] | None = None,
    parameters: Any = None,
    limit: Count = LARGEST,
    progress: Callable[[int, int], None] | None = None,
) -> nx.MultiDiGraph:
    """The transitions that a symbolic system can make, one surface at a time, with their guards as formulas.

    start       modes from which the others are found one after the other; default: the mode at one arbitrary
                state
    modes       only these modes and what leads from one to another
    parameters  values by name to put into the formulas; the others stay symbols
    limit       largest number of modes that are expanded; graph.graph["complete"] tells whether all were
    progress    called with (modes expanded, modes that are known to be)

    Transitions on several surfaces at the same instant are not listed. A guard that cannot hold (a number of
    the wrong sign, r > 0 with r < 0) makes no edge; other guards may exclude each other for reasons that are
    not examined. Raises ModelError for a system of plain functions, UsageError for a mode that does not fit.
    """
    if limit < 1:
        raise UsageError(f"limit is {limit!r}, expected a whole number of at least 1.")
    guards = Guards(system, parameters)
    kept = None if modes is None else _modes(modes, system)
    if kept is not None and len(kept) > limit:
        raise UsageError(f"{len(kept)} modes were given and limit is {limit}; raise limit.")
    queue: deque[Mode] = deque(kept or _modes(start, system))
    graph = _empty(system, "possible")
    expanded = 0
    for mode in queue:
        _place(graph, guards, mode)
    while queue and expanded < limit:
        mode = queue.popleft()
        expanded += 1
        if progress is not None:
            progress(expanded, min(limit, expanded + len(queue)))
        graph.nodes[mode_text(mode)]["expanded"] = True
        for item in (*guards.transitions(mode), *reset_transitions(guards, mode)):
            if kept is not None and item.target not in kept:
                continue
            if mode_text(item.target) not in graph:
                _place(graph, guards, item.target)
                queue.append(item.target)
            graph.add_edge(
                mode_text(item.source), mode_text(item.target), key=f"{item.surface} {item.kind}",
                surface=item.surface, kind=str(item.kind), guard=item.guard, formula=item.formula,
                conditions=item.conditions,
            )  # fmt: skip
    graph.graph["complete"] = not queue
    return graph


@keywords()
def observed_graph(solution: Solution) -> nx.MultiDiGraph:
    """The transitions that a solution made: how often and when, and how long it stayed in each mode.

    dwell_total counts every visit, so the totals add up to the span. Mean, least and largest dwell time are
    over the visits seen from entry to exit (`complete` of them), and over all where there is none. Events of
    one instant are one edge, with their surfaces and kinds joined by ", "; a tangency or a reset within a
    mode is an edge from it to itself.
    """
    graph = _empty(solution.system, "observed")
    graph.graph |= {
        "t0": float(solution.problem.t_span[0]), "t1": float(solution.t_end),
        "start": mode_text(solution.start_mode), "end": mode_text(solution.end_mode),
        "status": str(solution.status), "time_unit": unit_of(str(solution.system.labels.get("t", ""))),
    }  # fmt: skip
    visits: dict[Mode, list[float]] = {}
    whole: dict[Mode, list[float]] = {}
    mode, since, first = solution.start_mode, solution.problem.t_span[0], True
    graph.add_node(mode_text(mode))
    for _, members in groupby(solution.events, key=lambda event: event.group):
        events = list(members)
        _count(graph, events)
        if events[-1].after != mode:
            dwell = abs(events[0].t - since)
            visits.setdefault(mode, []).append(dwell)
            if not first:
                whole.setdefault(mode, []).append(dwell)
            mode, since, first = events[-1].after, events[0].t, False
    visits.setdefault(mode, []).append(abs(solution.t_end - since))
    for visited, times in visits.items():
        complete = whole.get(visited, [])
        used = complete or times
        graph.nodes[mode_text(visited)].update(
            sliding=_sliding(solution.system, visited), visits=len(times), complete=len(complete),
            dwell_total=sum(times), dwell_mean=sum(used) / len(used), dwell_min=min(used),
            dwell_max=max(used),
        )  # fmt: skip
    return graph


@keywords()
def recurrent_part(graph: nx.MultiDiGraph) -> nx.MultiDiGraph:
    """The strongly connected components without a way out: where solutions end.

    graph.graph["components"] lists their modes. In an observed graph there is one, and it holds the last
    mode; in a possible graph there is one for every set of modes that can trap the solution.
    """
    components = sorted(tuple(sorted(part)) for part in nx.attracting_components(graph))
    out = graph.subgraph([mode for part in components for mode in part]).copy()
    out.graph["components"] = [list(part) for part in components]
    return out


def _empty(system: System, kind: str) -> nx.MultiDiGraph:
    return nx.MultiDiGraph(
        kind=kind, surfaces=list(system.surface_names), states=list(system.states)
    )


def _sliding(system: System, mode: Mode) -> str:
    return ", ".join(s.name for s, m in zip(system.surfaces, mode, strict=True) if m == 0)


def _place(graph: nx.MultiDiGraph, guards: Guards, mode: Mode) -> None:
    system = guards.system
    field = guards.field(mode)
    solved = guards.multipliers(mode) or {}
    graph.add_node(
        mode_text(mode),
        sliding=_sliding(system, mode),
        field=", ".join(f"{x}' = {formula_text(f)}" for x, f in zip(system.states, field, strict=True)),
        multipliers=", ".join(
            f"{guards.labels[s]} = {formula_text(value)}"
            for s, value in solved.items()
            if value != guards.labels[s]
        ),
        expanded=False,
    )


def _count(graph: nx.MultiDiGraph, events: list[Event]) -> None:
    surfaces = ", ".join(dict.fromkeys(event.surface for event in events))
    kinds = ", ".join(dict.fromkeys(str(event.kind) for event in events))
    ends = mode_text(events[0].before), mode_text(events[-1].after)
    key = f"{surfaces} {kinds}"
    if not graph.has_edge(*ends, key=key):
        graph.add_edge(*ends, key=key, surface=surfaces, kind=kinds, count=0, times=[])
    edge = graph.edges[*ends, key]
    edge["count"] += 1
    edge["times"].append(float(events[0].t))


def _modes(given: str | Mode | Iterable[str | Mode] | None, system: System) -> list[Mode]:
    """Checked modes, each once, from one mode or several."""
    m = len(system.surfaces)
    if given is None:
        return _scattered(system)
    if isinstance(given, str) or (isinstance(given, tuple) and all(isinstance(v, int) for v in given)):
        given = [given]
    return list(dict.fromkeys(_mode(item, m) for item in several("modes", given)))


def _mode(given: Any, m: int) -> Mode:
    entries: list[Any] = [None]
    if isinstance(given, str):
        entries = [_SIGNS.get(c) for c in ("" if given == "." else given)]
    elif isinstance(given, tuple | list | np.ndarray):
        entries = [as_float(v) for v in np.ravel(given)] if isinstance(given, np.ndarray) else list(given)
    if len(entries) != m or any(as_float(v) not in (-1, 0, 1) for v in entries):
        raise UsageError(
            f"mode {given!r} does not fit: expected {m} signs, one per surface, such as "
            f"{mode_text((1,) * m)!r} or {mode_text((0,) * m)!r}."
        )
    return tuple(int(v) for v in entries if v is not None)


def _scattered(system: System) -> list[Mode]:
    """The modes at some scattered states, with the default parameters at t = 0: modes that exist."""
    form = system.symbolic
    if form is None:
        return []
    fixed = {q: sympy.Float(q.parameter.default) for q in form.p} | {t: sympy.S.Zero}
    h = [g.xreplace(fixed) for g in form.plain_h()]
    random = np.random.default_rng(0)
    found: list[Mode] = []
    for k in range(SAMPLES):
        point = random.normal(scale=(1.0, 0.1, 10.0)[k % 3], size=len(form.x))
        values = [sympy.N(g.xreplace(dict(zip(form.x, map(sympy.Float, point), strict=True)))) for g in h]
        mode = tuple(-1 if v.is_negative else 1 for v in values)
        if mode not in found and all(v.is_finite for v in values):
            found.append(mode)
    return found or [(1,) * len(h)]
