"""The parts of a section of a report, and the text of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NONE = "—"
Draw = Callable[[], "Figure"]
File = tuple[str, Sequence[str], Iterable[Iterable[Any]]]


@dataclass(frozen=True)
class TextTable:
    """Rows of text under columns, with a note and the command or method that produced them.

    label   by which texts refer to it: [[label]]; long: it is put in the appendix
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    source: str = ""
    label: str = ""
    long: bool = False

    def unstated(self) -> TextTable:
        """The same table without the columns of the source's values."""
        kept = [k for k, name in enumerate(self.columns) if name != "same" and not name.startswith("paper")]
        rows = tuple(tuple(row[k] for k in kept) for row in self.rows)
        return replace(self, columns=tuple(self.columns[k] for k in kept), rows=rows)


@dataclass(frozen=True)
class Picture:
    """A figure: its file name, its title, the command or method that gives it; `label` of its caption."""

    name: str
    title: str
    source: str
    draw: Draw
    caption: str = ""
    label: str = ""


@dataclass(frozen=True)
class Words:
    """Text: a paragraph "p", a "source", preformatted "pre", or definitions "dl" of (title, text)."""

    kind: str
    content: Any


@dataclass(frozen=True)
class Chapter:
    """A chapter of the report; without parts it only provides facts, entries of summary.json and CSV files.

    facts   values by name, for the texts; summary: entries of summary.json; files: (name, columns, rows)
    """

    anchor: str
    title: str
    parts: Sequence[TextTable | Picture | Words] = ()
    facts: Mapping[str, float] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)
    files: Sequence[File] = ()


def number(value: Any, digits: int = 6) -> str:
    """A number as text: infinities as a sign, nothing as a dash."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NONE
    if isinstance(value, str):
        return value
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    return f"{value:.{digits}g}"


def yes(value: bool) -> str:
    """yes or no."""
    return "yes" if value else "no"


def answer(verdict: str) -> str:
    """Whether it is stable: yes, no, or undecided."""
    return {"stable": "yes", "unstable": "no"}.get(verdict, verdict)


def first(point: Any) -> float:
    """The first coordinate of a point of a branch."""
    return float(next(iter(point.coordinates.values())))
