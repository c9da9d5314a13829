"""Conclusions from a study's results: facts by name for its texts, the classification, the summary."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from filippov.app.report.finding_facts import finding_facts, finding_summary
from filippov.app.report.results import CaseResult, Results


class Facts(dict[str, float]):
    """Values by name, for format_map; what was not computed says so."""

    def __missing__(self, key: str) -> _Unknown:
        return _Unknown()


class _Unknown:
    def __format__(self, spec: str) -> str:
        return "(not computed)"


def facts(results: Results) -> Facts:
    """Values that texts may name.

    cycle_<case>_<k>, fold_<case>; change_<case> of the set's stability, change_rest_<case> by the linearised
    return map; bound_<case> of Routh-Hurwitz; jump_<case> of the map at 0
    """
    out = Facts()
    for result in results.cases:
        slug = result.case.slug
        out |= {f"cycle_{slug}_{k}": q.d for k, q in enumerate(result.cycles, start=1)}
        out |= {f"fold_{slug}": value for value, _ in result.diagram.folds}
        out |= {f"change_{slug}": value for value in result.diagram.stability_changes}
        out |= {f"change_rest_{slug}": value for value in result.thresholds}
        out |= {f"jump_{slug}": jump.above for jump in result.jumps if jump.d == 0}
        if result.bound is not None:
            out[f"bound_{slug}"] = result.bound
    out |= finding_facts(results)
    return out


def classification(results: Results) -> dict[str, dict[str, str]]:
    """What the computed diagrams say of each regime, over all values of the parameter that were computed."""
    out = {}
    for result in results.cases:
        found = [points for diagram in (result.diagram, result.beyond) for points in diagram.points]
        sets = [[q.stable for q in points if q.kind == "equilibrium set"] for points in found]
        cycles = [[q.stable for q in points if q.kind == "limit cycle"] for points in found]
        quiet = [all(a) and bool(a) and not any(b) for a, b in zip(sets, cycles, strict=True)]
        out[result.case.regime] = {
            "equilibrium set": _set_words({s for row in sets for s in row}),
            "limit cycles": _cycle_words(cycles),
            results.study.goal: "yes" if any(quiet) else "never",
        }
    return out


def _set_words(seen: set[bool]) -> str:
    return {frozenset({True}): "stable", frozenset({False}): "unstable"}.get(
        frozenset(seen), "stable or unstable"
    )


def _cycle_words(cycles: list[list[bool]]) -> str:
    seen = {stable for row in cycles for stable in row}
    if not seen:
        return "never"
    often = "always" if all(cycles) else "possible"
    if len(seen) == 2:
        return f"{often}, stable and unstable"
    only = " only" if often == "possible" else ""
    return f"{often}, {'stable' if True in seen else 'unstable'}{only}"


def summary(results: Results) -> dict[str, Any]:
    """summary.json: numbers only where they are finite, else null and a note."""
    name, cases = results.study.parameter, results.cases
    return {
        "fixed_points": {c.case.key: [_point(q) for q in c.fixed] for c in cases},
        "folds": {
            c.case.key: [{name: value, "d": d} for value, d in c.diagram.folds]
            for c in cases
            if c.diagram.folds
        },
        "set_stability_change": {
            c.case.key: [{name: value} for value in c.diagram.stability_changes]
            for c in cases
            if c.diagram.stability_changes
        },
        "routh_hurwitz_bound": {c.case.key: c.bound for c in cases if c.bound is not None},
        "cycles": {c.case.key: _cycles(c) for c in cases},
        "classification": classification(results),
        "comparison": _comparison(results),
        **_without_infinities(finding_summary(results)),
        "timing": {k: round(v, 4) for k, v in results.timing.items()},
    }


def _cycles(result: CaseResult) -> dict[str, list[float]]:
    diagram = result.diagram
    return {
        f"{value:g}": [q.d for q in points if q.kind == "limit cycle"]
        for value, points in zip(diagram.values, diagram.points, strict=True)
    }


def _comparison(results: Results) -> list[dict[str, Any]]:
    """Rows with the width as eta, and an alpha in every row."""
    rows = [] if results.comparison is None else results.comparison.rows
    return [
        {"model": row["model"], "eta": row["width"], "alpha": row.get("alpha")}
        | {name: _number(value) for name, value in row.items() if name not in {"model", "width", "alpha"}}
        for row in rows
    ]


def _point(q: Any) -> dict[str, Any]:
    out: dict[str, Any] = {
        "d": float(q.d),
        "kind": q.kind,
        "stable": bool(q.stable),
        "slope": _number(q.slope),
    }
    if q.note or out["slope"] is None:
        out["note"] = q.note or f"the slope is {q.slope}"
    return out


def _without_infinities(data: Any) -> Any:
    """The same with null for what is not finite, at any depth."""
    if isinstance(data, dict):
        return {k: _without_infinities(v) for k, v in data.items()}
    if isinstance(data, list | tuple):
        return [_without_infinities(v) for v in data]
    return _number(data)


def _number(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _number(v) for k, v in value.items()}
    if hasattr(value, "item"):
        value = value.item()
    return value if not isinstance(value, float) or math.isfinite(value) else None
