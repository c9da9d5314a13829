"""Measured data: time with position and force, or velocity with friction force; read from CSV and checked."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.keywords import constructor, keywords
from filippov.base.names import closest
from filippov.base.read_whole import read_text
from filippov.model.signals.columns import refuse_other_marks

LARGEST = 5_000_000
LARGEST_FILE = 1 << 30
LEAST = 8
# Column -> other names it goes by.
NAMES = {
    "t": ("time",),
    "x": ("position",),
    "v": ("velocity",),
    "u": ("effort", "control"),
    "force": (),
    "friction": ("F",),
}


@constructor()
@dataclass(frozen=True)
class Record:
    """A measured motion: t [s] increasing, x [m], the applied force [N], v [m/s] where it is known.

    The force acts on the mass: m v' = force - friction. A column u of control effort is taken as -force, as
    in m v' = -u - F(v) of the reference system.
    """

    t: Array
    x: Array
    force: Array
    v: Array | None = None

    def __post_init__(self) -> None:
        _check("Record", t=self.t, x=self.x, force=self.force, v=self.v)
        late = np.flatnonzero(np.diff(self.t) <= 0)
        if late.size:
            k = int(late[0])
            raise UsageError(
                f"Record: t[{k + 1}] = {self.t[k + 1]:g} does not come after t[{k}] = {self.t[k]:g}, "
                "expected times that increase. Sort the samples, and keep one of those with the same time."
            )


@constructor()
@dataclass(frozen=True)
class Curve:
    """Points of a friction curve: v [m/s] and the friction force [N] that opposes it."""

    v: Array
    friction: Array

    def __post_init__(self) -> None:
        _check("Curve", v=self.v, friction=self.friction)


def _check(kind: str, **columns: Array | None) -> None:
    """Raise UsageError where the columns are not of one length, or hold what is no finite number."""
    shapes = {name: np.shape(column) for name, column in columns.items() if column is not None}
    if len(set(shapes.values())) > 1:
        told = ", ".join(f"{name} has shape {shape}" for name, shape in shapes.items())
        raise UsageError(f"{kind}: {told}, expected one length. Leave out the samples that lack a value.")
    for name, column in columns.items():
        gone = np.flatnonzero(~np.isfinite(np.asarray(() if column is None else column, dtype=float)))
        if gone.size:
            raise UsageError(
                f"{kind}: {name}[{gone[0]}] is {np.asarray(column)[gone[0]]}, expected finite numbers. Leave "
                "out the samples that lack a value."
            )


@keywords()
def read_record(path: str | Path) -> Record | Curve:
    """Read a CSV file with a header: t, x and u (or force), and v if there is one; or v and friction.

    Raises UsageError, which names the line and the column, for a missing column, a value that is no finite
    number, times that do not increase, or too few rows.
    """
    columns = _columns(Path(path))
    where = f"{path}"
    if "friction" in columns and "v" in columns:
        return Curve(columns["v"], columns["friction"])
    missing = [name for name in ("t", "x") if name not in columns]
    if not {"u", "force"} & columns.keys():
        missing.append("u (or force)")
    if missing:
        raise UsageError(
            f"{where}: no column {', '.join(missing)}; found {', '.join(columns) or 'none'}. Give t, x and u "
            "(control effort) or force, or v and friction."
        )
    t = columns["t"]
    late = np.nonzero(np.diff(t) <= 0)[0]
    if late.size:
        k = int(late[0])
        raise UsageError(
            f"{where}, line {k + 3}: t = {t[k + 1]:g} does not come after {t[k]:g}. Sort the rows."
        )
    force = columns["force"] if "force" in columns else -columns["u"]
    return Record(t, columns["x"], force, columns.get("v"))


def _columns(path: Path) -> dict[str, Array]:
    try:
        file = io.StringIO(read_text(path, LARGEST_FILE), newline="")
        lines = [line for line in file if not line.startswith("#")]
        refuse_other_marks(path, list(csv.reader(lines[:3])), UsageError)
        rows = csv.reader(lines)
        header = [_name(cell, path) for cell in next(rows, [])]
        if len(set(header)) != len(header):
            raise UsageError(
                f"{path}: a column is there twice: {', '.join(header)}. Leave one out, or rename it."
            )
        table: list[list[float]] = []
        for number, row in enumerate(rows, 2):
            if not row:
                continue
            if len(row) != len(header):
                raise UsageError(
                    f"{path}, line {number}: {len(row)} values, expected {len(header)} "
                    f"({', '.join(header)})."
                )
            cells = zip(row, header, strict=True)
            table.append([_value(cell, path, number, name) for cell, name in cells])
            if len(table) > LARGEST:
                raise UsageError(f"{path}: more than {LARGEST} rows; give fewer samples.")
    except FileNotFoundError:
        raise UsageError(f"there is no file {str(path)!r}: give its path from the present folder.") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{path}: cannot be read as CSV ({error}). Save it as CSV in UTF-8.") from None
    if len(table) < LEAST:
        raise UsageError(f"{path}: {len(table)} rows of numbers, expected at least {LEAST} below a header.")
    return dict(zip(header, np.array(table).T, strict=True))


def _name(cell: str, path: Path) -> str:
    """The column a heading stands for: 'position [m]' is x."""
    text = cell.partition("[")[0].partition("(")[0].strip()[:60]
    for name, others in NAMES.items():
        if text == name or text in others or text.lower() in (name, *others):
            return name
    hint = closest(text, [*NAMES, *(other for others in NAMES.values() for other in others)])
    raise UsageError(
        f"{path}: unknown column {text!r}; {hint + ' ' if hint else ''}known: {', '.join(NAMES)}. (The first "
        "line holds the names.)"
    )


def _value(cell: str, path: Path, line: int, name: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise UsageError(f"{path}, line {line}: {name} is {cell!r}, expected a number.") from None
    if not math.isfinite(value):
        raise UsageError(f"{path}, line {line}: {name} is {cell}, expected a finite number.")
    return value
