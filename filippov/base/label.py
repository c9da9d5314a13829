"""Labels of axes: a name and, in brackets, its unit."""

from __future__ import annotations


def unit_of(label: str) -> str:
    """The unit that a label ends with: "s" of "time [s]", "" where there is none."""
    _, bracket, rest = label.rpartition("[")
    return rest.partition("]")[0] if bracket else ""
