"""The folder of a sweep: manifest, points, chunks, what is set aside; a lock while a run works in it.

    manifest.json     what was asked for, field by field
    points.npz        the points
    chunks/*.npz      the rows, in files named by their sweep and their points
    quarantine.json   points that ended their worker, with the cause
    lock.json         the process at work

No file name is ever read from a file. A file is replaced or removed only where it proves to be this sweep's:
by its name (chunks), by its key (manifest, quarantine) or by its sha256 (points). What does not stays as it
is, and where it is in the way the sweep is refused before its first point.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from filippov.base.arrays import Whole
from filippov.base.errors import UsageError
from filippov.base.json_text import json_text
from filippov.base.read_whole import read_json
from filippov.base.whole_file import leftovers, write_whole
from filippov.io.archive import Archive, write_arrays
from filippov.sweep.chunk import chunk_name, chunks_of, leftovers_of, no_room, read_chunk, write_chunk
from filippov.sweep.manifest import NAME as MANIFEST
from filippov.sweep.manifest import Manifest, read_manifest
from filippov.sweep.points import Points, digest_of, restored, stored
from filippov.sweep.rows import Rows, Work
from filippov.sweep.table import SweepTable

POINTS, CHUNKS, QUARANTINE = "points.npz", "chunks", "quarantine.json"
PROBE = "try"
ASIDE = "filippov quarantine"
LARGEST = 1 << 33
LARGEST_ASIDE = 1 << 26
_ROW_BYTES, _ROOM = 40, 1 << 16


class Store:
    """The folder of one sweep, ready to be written. Raises UsageError, OSError.

    damaged   names of the chunks that could not be trusted and were taken away
    """

    def __init__(self, folder: Path, work: Work) -> None:
        self.folder, self.chunks = folder, folder / CHUNKS
        self.manifest = Manifest.of(work)
        self.size, self.columns = self.manifest.size, work.columns
        self.work = work
        self.damaged: list[str] = []

    def begin(self, resume: bool, fresh: bool, trust: bool = False) -> None:
        """Make the folder this sweep's: a new one, the same one again, or what it held removed."""
        if self.chunks.exists() and not self.chunks.is_dir():
            raise UsageError(f"{str(self.chunks)!r} is no folder, expected the chunks of the sweep.")
        found = held_by(self.folder)
        if found is not None and not fresh:
            self._same(found, resume, trust)
        self._check(found)
        if fresh and found is not None:
            self._clear(found)
        if fresh or found is None:
            self._room()
        self.chunks.mkdir(exist_ok=True)
        self._write()
        own = leftovers(self.folder, (MANIFEST, POINTS, QUARANTINE, PROBE))
        for left in (*leftovers_of(self.chunks, self.manifest.key), *own):
            left.unlink(missing_ok=True)

    def read(self) -> SweepTable:
        """All rows there are, each point once; chunks of this sweep that cannot be trusted are removed."""
        table = SweepTable.empty(self.work)
        self.damaged += fill(table, self.chunks, self.manifest, remove=True)
        return table

    def has(self, point: int) -> bool:
        """Whether a point has a chunk of its own."""
        return (self.chunks / chunk_name(self.manifest.key, np.array([point]))).exists()

    def quarantine(self, rows: Rows) -> None:
        """Keep a point that is set aside, and say so in a file for people."""
        write_chunk(self.chunks, self.manifest.text, rows)
        path, point = self.folder / QUARANTINE, int(rows.index[0])
        known = [row for row in _set_aside(path, {self.manifest.key}) or [] if row["point"] != point]
        values = dict(zip(self.work.names, self.work.points[point].tolist(), strict=True))
        listed = [*known, {"point": point, "values": values, "cause": rows.message[point]}]
        seal = hashlib.sha256(_plain(listed)).hexdigest()
        write_json(path, {"format": ASIDE, "sweep": self.manifest.key, "sha256": seal, "points": listed})

    def _same(self, found: Manifest, resume: bool, trust: bool) -> None:
        changed = found.changes(self.manifest)
        if changed:
            raise UsageError(
                f"{str(self.folder)!r} holds another sweep, whose results do not mix with this one: "
                f"{changed}. Name another folder, or begin afresh (fresh=True, --fresh), which removes what "
                "that sweep wrote."
            )
        if not resume:
            raise UsageError(
                f"{str(self.folder)!r} holds this sweep already, whole or in part. Go on with it "
                "(resume=True, --resume), or begin afresh (fresh=True, --fresh)."
            )
        if self.manifest.unseen and not trust:
            raise UsageError(
                f"whether what {str(self.folder)!r} holds still fits cannot be told: "
                f"{'; '.join(self.manifest.unseen)}. If nothing of that has changed, say so (trust=True, "
                "--trust), or begin afresh (fresh=True, --fresh)."
            )

    def _check(self, found: Manifest | None) -> None:
        """Refuse files in the way that neither this sweep nor the one found has written."""
        path, digests = self.folder / POINTS, {self.manifest.points}
        if found is not None:
            digests.add(found.points)
        if _there(path) and digest_of(read_points(path)) not in digests:
            raise UsageError(f"{str(path)!r} does not hold the points of this sweep. {away(path)}")
        path, keys = self.folder / QUARANTINE, {self.manifest.key}
        if found is not None:
            keys.add(found.key)
        if _there(path) and _set_aside(path, keys) is None:
            raise UsageError(f"{str(path)!r} was not written by this sweep, or is damaged. {away(path)}")

    def _clear(self, found: Manifest) -> None:
        """Remove what the sweep found has written; its files were checked."""
        for path in (*chunks_of(self.chunks, found.key), *leftovers_of(self.chunks, found.key)):
            path.unlink(missing_ok=True)
        for name in (QUARANTINE, POINTS, MANIFEST):
            (self.folder / name).unlink(missing_ok=True)

    def _write(self) -> None:
        """Write what is missing of manifest and points."""
        path, own = self.folder / MANIFEST, False
        if not path.exists():
            write_json(path, self.manifest.data())
            own = True
        path = self.folder / POINTS
        if path.exists():
            return
        arrays = stored(self.work.points)
        try:
            write_arrays(path, arrays)
        except OSError as error:
            if own:
                (self.folder / MANIFEST).unlink(missing_ok=True)
            raise no_room(path, sum(array.nbytes for array in arrays.values()), error) from None

    def _room(self) -> None:
        needed = self.size * (_ROW_BYTES + 8 * (len(self.columns) + len(self.work.names))) + _ROOM
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise UsageError(
                f"{str(self.folder)!r} has {free} bytes free, about {needed} are needed for {self.size} "
                "points. Make room, or name another folder."
            )


def held_by(folder: Path) -> Manifest | None:
    """The sweep of a folder by its manifest; where that is missing, by its chunks; None where there is none.

    Raises UsageError for a manifest that is damaged or someone else's, and for chunks of several sweeps.
    """
    if _there(folder / MANIFEST):
        return read_manifest(folder)
    found: dict[str, Manifest] = {}
    prefixes: set[str] = set()
    for path in chunks_of(folder / CHUNKS, None):
        prefix = path.name.partition("-")[0]
        if prefix not in prefixes:
            try:
                manifest, _ = read_chunk(path)
            except UsageError:
                continue
            prefixes.add(prefix)
            found[manifest.key] = manifest
    if len(found) > 1:
        raise UsageError(
            f"{str(folder)!r} has no {MANIFEST} and chunks of {len(found)} sweeps. Move those away that do "
            "not belong there."
        )
    return next(iter(found.values()), None)


def fill(table: SweepTable, chunks: Path, manifest: Manifest, remove: bool) -> list[str]:
    """Put the rows of a sweep's chunks into its table; the names of those that cannot be trusted."""
    bad = []
    for path in chunks_of(chunks, manifest.key):
        try:
            of, rows = read_chunk(path)
            if of.key != manifest.key:
                raise UsageError(f"{str(path)!r} is a chunk of another sweep.")
            table.add(rows)
        except UsageError:
            bad.append(path.name)
            if remove:
                path.unlink(missing_ok=True)
    return bad


def try_folder(folder: Path) -> None:
    """Make a folder and write, rename and read a file in it. Raises UsageError with the cause."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{str(folder)!r} is a file, expected a folder for the sweep.")
    content, probe = os.urandom(16), folder / f".{PROBE}.{secrets.token_hex(8)}.tmp"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            if write_whole(probe, content).read_bytes() != content:
                raise OSError("a file written there reads back differently")
        finally:
            probe.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(
            f"{str(folder)!r} cannot be written: {error.strerror or error}. Name a folder on a file system "
            "that this process may write to."
        ) from None


def read_points(path: Path) -> Points:
    """The points in a file. Raises UsageError."""
    try:
        with Archive(path, LARGEST) as archive:
            return restored(archive)
    except OSError as error:
        raise UsageError(f"cannot read {str(path)!r}: {error.strerror or error}. {away(path)}") from None
    except UsageError as error:
        raise UsageError(f"{error} {away(path)}") from None


def away(path: Path) -> str:
    """What to do about a file that is in the way, or is not what it should be."""
    return f"Nothing of it is changed: move it away; with resume=True (--resume) {path.name} is made again."


def write_json(path: Path, data: Any) -> None:
    """Write a JSON file whole or not at all. Raises FullError where there is no room."""
    content = json_text(data)
    try:
        write_whole(path, content)
    except OSError as error:
        raise no_room(path, len(content), error) from None


def missing(table: SweepTable) -> Whole:
    """Numbers of the points without a row."""
    return np.nonzero(~table.known)[0]


def _there(path: Path) -> bool:
    """Whether something has this name, a link to nothing included."""
    return os.path.lexists(path)


def _set_aside(path: Path, keys: set[str]) -> list[dict[str, Any]] | None:
    """The points that a quarantine file of one of these sweeps lists; None for any other file."""
    try:
        found = read_json(path, LARGEST_ASIDE)
        sound = found["format"] == ASIDE and found["sweep"] in keys
        listed: list[dict[str, Any]] = found["points"]
        return listed if sound and hashlib.sha256(_plain(listed)).hexdigest() == found["sha256"] else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _plain(data: Any) -> bytes:
    return json.dumps(data, sort_keys=True, separators=(",", ":")).encode()
