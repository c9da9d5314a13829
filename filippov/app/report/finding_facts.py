"""The findings as numbers: facts by name for the study's texts, entries of summary.json, CSV files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from filippov.analysis.bifurcations.branch import Branch
from filippov.app.report.results import Results

Rows = Iterable[Iterable[Any]]


def finding_facts(results: Results) -> dict[str, float]:
    """end_value, end_parameter, least_value, least_parameter of the fold curve; relative_fold_<case>,
    relative_change_<case> [%]; ratio_<k>, algebra_<k>, exact_<k> of the k-th law."""
    found, name, out = results.findings, results.study.parameter, {}
    if found.ending is not None and found.ending.points:
        height = found.ending.coordinate(name)
        least = int(np.argmin(height))
        out["end_value"], out["end_parameter"] = float(height[-1]), float(found.ending.values[-1])
        out["least_value"], out["least_parameter"] = float(height[least]), float(found.ending.values[least])
    for item in found.relative:
        slug = results.case(item.key).case.slug
        if item.fold is not None:
            out[f"relative_fold_{slug}"] = item.fold.value
    for k, p in enumerate(found.predictions):
        if p.ratio is not None:
            out[f"ratio_{k}"] = p.ratio[0]
        for cycle in p.algebraic:
            out[f"algebra_{k}"] = cycle.d
    if found.measured is not None and found.measured.safe is not None:
        out["safe"] = found.measured.safe
    return out


def finding_summary(results: Results) -> dict[str, Any]:
    """Entries of summary.json; null where something was not found."""
    found, name = results.findings, results.study.parameter
    out: dict[str, Any] = {
        "orbits": {c.key: [_orbit(orbit) for orbit in c.orbits] for c in found.cycles},
        "branches": {
            c.key: {
                "special": [{"what": q.special, name: q.value, "d": _first(q)} for q in c.special],
                "cycles": {f"{v:g}": sorted(_first(p) for p in points) for v, points in c.at},
                "largest_difference": c.spread,
            }
            for c in found.cycles
        },
    }
    if found.ending is not None and found.ending.points:
        other = found.ending.parameter
        out["fold_curve"] = {
            other: found.ending.values.tolist(), name: found.ending.coordinate(name).tolist(),
            "end": found.ending.message,
        }  # fmt: skip
    if found.regions is not None:
        out["regions"] = found.regions.to_dict()
    if found.settings is not None:
        out["settings"] = {asked.label: t.to_dict() for asked, t in found.settings.tunings}
    out["predictions"] = {
        p.law.label: {
            "harmonic_balance": p.harmonic.to_dict()["cycles"], "exact": [d for d, _, _ in p.exact],
            "ratio": p.ratio, "algebra": [c.d for c in p.algebraic],
        }
        for p in found.predictions
    }  # fmt: skip
    if found.measured is not None:
        out["experiment"] = found.measured.found.to_dict() | {
            "truth": dict(found.measured.truth), "limit": found.measured.limit, "safe": found.measured.safe,
        }  # fmt: skip
    size = f"amplitude {results.system.states[0]}"
    out["relative"] = {
        r.key: {
            "amplitude": r.branch.points[0].coordinates[size],
            "fold": None if r.fold is None else {name: r.fold.value, "amplitude": r.fold.coordinates[size]},
            "small": [{"start": s, "rests": rests, "exact_ratio": ratio} for s, rests, ratio in r.small],
        }
        for r in found.relative
    }
    return out


def finding_files(results: Results) -> Iterator[tuple[str, Sequence[str], Rows]]:
    """(name, columns, rows) of the CSV files."""
    found, name = results.findings, results.study.parameter
    states = results.system.states
    yield (
        "cycles.csv",
        ("case", "stable", "period", *(f"amplitude {s}" for s in states), "largest multiplier", "word"),
        [
            (c.key, o.stable, o.period, *o.amplitude.values(), float(np.abs(o.multipliers[0])), o.word)
            for c in found.cycles
            for o in c.orbits
        ],
    )
    columns = ("d", "multiplier", "stable", "special")
    yield (
        "branches.csv",
        ("case", "branch", name, *columns),
        [(c.key, k, *row) for c in found.cycles for k, b in enumerate(c.branches) for row in _rows(b, "")],
    )
    if found.ending is not None and found.ending.points:
        ending = found.ending
        yield (
            "fold_curve.csv", (ending.parameter, name, "d"),
            [(p.value, p.coordinates[name], p.coordinates[results.model.section.coordinate])
             for p in ending.points if results.model.section],
        )  # fmt: skip
    if found.measured is not None:
        f = found.measured.found
        yield "record.csv", ("t", "measured", "fitted"), zip(f.t, f.measured, f.fitted, strict=True)
    if found.relative:
        yield (
            "relative.csv",
            ("case", name, "amplitude", *columns[1:]),
            [
                (r.key, *row)
                for r in found.relative
                for b in (r.branch, r.beyond)
                if b is not None
                for row in _rows(b, f"amplitude {states[0]}")
            ],
        )


def _rows(branch: Branch, size: str) -> list[tuple[Any, ...]]:
    heights = branch.coordinate(size) if size else branch.d
    return [
        (p.value, height, float(np.abs(p.multipliers[0])), p.stable, p.special)
        for p, height in zip(branch.points, heights.tolist(), strict=True)
    ]


def _first(point: Any) -> float:
    return float(next(iter(point.coordinates.values())))


def _orbit(orbit: Any) -> dict[str, Any]:
    return {
        "period": orbit.period, "amplitude": orbit.amplitude, "stable": orbit.stable, "word": orbit.word,
        "multipliers": [[float(v.real), float(v.imag)] for v in orbit.multipliers],
        "margin": {
            "distance": orbit.margin.distance, "sliding": orbit.margin.sliding,
            "transversality": orbit.margin.transversality,
        },
    }  # fmt: skip

