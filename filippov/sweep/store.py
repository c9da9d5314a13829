"""The folder of a sweep: manifest, points, chunks, what is set aside; a lock while a run works in it.

    manifest.json     what was asked for, field by field
    points.npz        the points
    chunks/*.npz      the rows, in files named by their content
    quarantine.json   points that ended their worker, with the cause
    lock.json         the process at work

No file name is ever read from a file.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from filippov.archive import Archive, write_arrays
from filippov.errors import UsageError
from filippov.sweep.chunk import chunk_name, no_room, read_chunk, write_chunk
from filippov.sweep.rows import Array, Rows, Whole, Work
from filippov.sweep.table import Table

FORMAT, VERSION = "filippov sweep", 1
MANIFEST, POINTS, CHUNKS, QUARANTINE = "manifest.json", "points.npz", "chunks", "quarantine.json"
_KEYS = {"format", "version", "key", "fields", "names", "columns", "units", "size"}
LARGEST = 1 << 33
_ROW_BYTES, _ROOM = 40, 1 << 16


def key_of(fields: Mapping[str, str]) -> str:
    """The digest of all that decides the results."""
    return hashlib.sha256(json.dumps(dict(sorted(fields.items()))).encode()).hexdigest()


class Store:
    """The folder of one sweep, ready to be written. Raises UsageError, OSError.

    damaged   names of the chunks that could not be trusted and were taken away
    """

    def __init__(self, folder: Path, work: Work) -> None:
        self.folder, self.chunks = folder, folder / CHUNKS
        self.key, self.size, self.columns = key_of(work.fields), len(work.points), work.columns
        self.work = work
        self.damaged: list[str] = []

    def begin(self, resume: bool, fresh: bool) -> None:
        """Make the folder this sweep's: a new one, the same one again, or what it held removed."""
        if (self.folder / MANIFEST).exists() and not fresh:
            self._same(read_manifest(self.folder), resume)
        else:
            self._clear()
            self._room()
            self.chunks.mkdir(exist_ok=True)
            points = np.asarray(self.work.points)
            try:
                write_arrays(self.folder / POINTS, {"points": points})
            except OSError as error:
                raise no_room(self.folder / POINTS, points.nbytes, error) from None
            write_json(self.folder / MANIFEST, self._manifest())
        self.chunks.mkdir(exist_ok=True)
        for left in self.chunks.glob(".*.tmp"):
            left.unlink(missing_ok=True)

    def read(self) -> Table:
        """All rows there are, each point once; chunks that cannot be trusted are removed."""
        table = Table.empty(self.work)
        for path in sorted(self.chunks.glob("*.npz")):
            try:
                table.add(read_chunk(path, self.key, self.size, len(self.columns)))
            except UsageError:
                self.damaged.append(path.name)
                path.unlink(missing_ok=True)
        return table

    def has(self, point: int) -> bool:
        """Whether a point has a chunk of its own."""
        return (self.chunks / chunk_name(self.key, np.array([point]))).exists()

    def quarantine(self, rows: Rows) -> None:
        """Keep a point that is set aside, and say so in a file for people."""
        write_chunk(self.chunks, self.key, rows)
        path, point = self.folder / QUARANTINE, int(rows.index[0])
        known: list[Any] = []
        if path.exists():
            try:
                known = json.loads(path.read_text(encoding="utf-8"))
            except ValueError:
                known = []
        values = dict(zip(self.work.names, self.work.points[point].tolist(), strict=True))
        known = [row for row in known if row.get("point") != point]
        write_json(path, [*known, {"point": point, "values": values, "cause": rows.message[point]}])

    def _manifest(self) -> dict[str, Any]:
        work = self.work
        return {
            "format": FORMAT, "version": VERSION, "key": self.key, "fields": dict(work.fields),
            "names": list(work.names), "columns": list(work.columns), "units": dict(work.units),
            "size": self.size,
        }  # fmt: skip

    def _same(self, found: Mapping[str, Any], resume: bool) -> None:
        before, wanted = found["fields"], dict(self.work.fields)
        changed = [name for name in sorted({*before, *wanted}) if before.get(name) != wanted.get(name)]
        if changed:
            said = "; ".join(f"{n} was {_short(before.get(n))}, is {_short(wanted.get(n))}" for n in changed)
            raise UsageError(
                f"{str(self.folder)!r} holds another sweep, whose results do not mix with this one: {said}. "
                "Name another folder, or begin afresh (fresh=True, --fresh), which removes what it holds."
            )
        if not resume:
            raise UsageError(
                f"{str(self.folder)!r} holds this sweep already, whole or in part. Go on with it "
                "(resume=True, --resume), or begin afresh (fresh=True, --fresh)."
            )

    def _clear(self) -> None:
        for name in (MANIFEST, POINTS, QUARANTINE):
            (self.folder / name).unlink(missing_ok=True)
        for path in self.chunks.glob("*.npz"):
            path.unlink(missing_ok=True)

    def _room(self) -> None:
        needed = self.size * (_ROW_BYTES + 8 * (len(self.columns) + len(self.work.names))) + _ROOM
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise UsageError(
                f"{str(self.folder)!r} has {free} bytes free, about {needed} are needed for {self.size} "
                "points. Make room, or name another folder."
            )


def try_folder(folder: Path) -> None:
    """Make a folder and write, rename and read a file in it. Raises UsageError with the cause."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{str(folder)!r} is a file, expected a folder for the sweep.")
    content = os.urandom(16)
    name = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".try.", suffix=".tmp", dir=folder)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(f"{name}2")
        name = f"{name}2"
        if Path(name).read_bytes() != content:
            raise OSError("a file written there reads back differently")
    except OSError as error:
        raise UsageError(
            f"{str(folder)!r} cannot be written: {error.strerror or error}. Name a folder on a file system "
            "that this process may write to."
        ) from None
    finally:
        if name is not None:
            Path(name).unlink(missing_ok=True)


def read_manifest(folder: Path) -> dict[str, Any]:
    """What the folder says it holds, checked. Raises UsageError."""
    path = folder / MANIFEST
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found, dict) or found["format"] != FORMAT:
            raise UsageError(f"{str(path)!r} is no manifest of a sweep.")
        if found["version"] != VERSION:
            raise UsageError(f"{str(path)!r} has format version {found['version']!r}, expected {VERSION}.")
        if set(found) != _KEYS or key_of(found["fields"]) != found["key"]:
            raise UsageError(f"{str(path)!r} was changed: its content does not fit its key.")
    except OSError as error:
        raise UsageError(f"cannot read {str(path)!r}: {error.strerror or error}.") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(f"{str(path)!r} is damaged ({type(error).__name__}: {error}).") from None
    return found


def read_points(folder: Path) -> Array:
    """The points of a sweep. Raises UsageError."""
    with Archive(folder / POINTS, LARGEST) as archive:
        return np.asarray(archive.read("points"), dtype=float)


def write_json(path: Path, data: Any) -> None:
    """Write a JSON file whole or not at all. Raises FullError where there is no room."""
    content = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except OSError as error:
        raise no_room(path, len(content), error) from None
    finally:
        Path(name).unlink(missing_ok=True)


def missing(table: Table) -> Whole:
    """Numbers of the points without a row."""
    return np.nonzero(~table.known)[0]


def _short(value: object) -> str:
    text = "absent" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
