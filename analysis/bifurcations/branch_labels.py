"""The labels of a branch's axes, with units: those of the system that its problem is about."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from filippov.plot.style import axis_labels, coordinate_labels


def labels_of(problem: Any, names: Iterable[str]) -> dict[str, str]:
    """Labels of the parameter and the coordinates of a branch; none for a plain function."""
    while hasattr(problem, "inner"):  # a curve of special points
        problem = problem.inner
    event_map = getattr(problem, "event_map", None)
    if event_map is not None:
        read = coordinate_labels(event_map.system, event_map.section)
        return axis_labels(event_map.system, *names) | ({"d": read["d"]} if "d" in names else {})
    owner = getattr(problem, "shooting", problem)
    return axis_labels(getattr(owner, "system", None), *names)
