"""A chunk: some rows in one file that appears whole or not at all, sealed with its sha256.

It holds the text of the sweep's manifest. Its name begins with the sweep's key and goes on with a digest of
the numbers of its points: a file that was renamed, or that someone else put there, is distinguished from a
chunk of this sweep, and no file without such a name is ever replaced or removed.
"""

from __future__ import annotations

import errno
import hashlib
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Whole
from filippov.base.errors import SolveError, UsageError
from filippov.io.archive import Archive, write_arrays
from filippov.sweep.manifest import Manifest, key_of, of_text
from filippov.sweep.rows import Rows

FORMAT, VERSION = "filippov chunk", 2
LARGEST = 1 << 30
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
_PARTS = ("header", "index", "values", "status")
_KEY, _POINTS = 16, 28  # digits in the name, which a temporary file's repeats whole
_NAME = re.compile(rf"[0-9a-f]{{{_KEY}}}-[0-9a-f]{{{_POINTS}}}\.npz")


class FullError(SolveError):
    """No room for a file: the message names path, bytes needed and bytes free."""


def chunk_name(key: str, index: Whole) -> str:
    """Name of the file with the rows of these points."""
    text = key.encode() + np.ascontiguousarray(index, dtype="<i8").tobytes()
    return f"{key[:_KEY]}-{hashlib.sha256(text).hexdigest()[:_POINTS]}.npz"


def chunks_of(folder: Path, key: str | None) -> list[Path]:
    """Files with the name of a chunk of this sweep, in order; None: of any sweep."""
    found = [path for path in folder.glob("*.npz") if _NAME.fullmatch(path.name)]
    return sorted(path for path in found if key is None or path.name.startswith(key[:_KEY]))


def leftovers_of(folder: Path, key: str) -> list[Path]:
    """What writers of this sweep's chunks left behind when they were ended."""
    return [
        path for path in folder.glob(f".{key[:_KEY]}-*.tmp") if _NAME.match(path.name.removeprefix("."))
    ]


def write_chunk(folder: Path, head: str, rows: Rows) -> Path:
    """Write rows into a folder; `head` is the text of the sweep's manifest.

    Raises FullError where there is no room, OSError.
    """
    known = sorted(set(rows.status))
    header = {
        "format": FORMAT, "version": VERSION, "sweep": head, "status": known,
        "message": {str(point): text for point, text in sorted(rows.message.items())},
    }  # fmt: skip
    arrays: dict[str, npt.NDArray[Any]] = {
        "header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8),
        "index": np.asarray(rows.index, dtype=np.int64),
        "values": np.asarray(rows.values, dtype=np.float64),
        "status": np.array([known.index(status) for status in rows.status], dtype=np.int64),
    }
    arrays["seal"] = np.frombuffer(_seal(arrays), dtype=np.uint8)
    path = folder / chunk_name(key_of(head), arrays["index"])
    try:
        return write_arrays(path, arrays)
    except OSError as error:
        raise no_room(path, sum(array.nbytes for array in arrays.values()) + 1024, error) from None


def no_room(path: Path, needed: int, error: OSError) -> Exception:
    """The error that names path, bytes needed and bytes free where a disk is full; else the one given."""
    if error.errno not in FULL:
        return error
    free = shutil.disk_usage(path.parent).free
    return FullError(
        f"no room for {str(path)!r}: {needed} bytes needed, {free} free ({error.strerror}). Chunks written "
        "before are intact: make room (or raise the limit on the size of a file), then resume."
    )


def read_chunk(path: Path) -> tuple[Manifest, Rows]:
    """The sweep and the rows of a chunk, its seal, its name and its numbers checked.

    Raises UsageError for any other file.
    """
    try:
        archive = Archive(path, LARGEST)
    except OSError as error:
        raise UsageError(f"cannot read {str(path)!r}: {error.strerror or error}.") from None
    with archive:
        if archive.names != {*_PARTS, "seal"}:
            raise archive.refuse("does not hold the entries of a chunk")
        arrays = {name: archive.read(name) for name in (*_PARTS, "seal")}
        if arrays["seal"].tobytes() != _seal(arrays):
            raise archive.refuse("is damaged: its sha256 is not the one it was sealed with")
        try:
            header = json.loads(arrays["header"].tobytes())
            index, values, status = arrays["index"], arrays["values"], arrays["status"]
            if (header["format"], header["version"]) != (FORMAT, VERSION):
                raise archive.refuse("is no chunk that this version reads")
            manifest = of_text(header["sweep"])
            if path.name != chunk_name(manifest.key, index):
                raise archive.refuse("does not have the name that its points give it")
            expected = len(index), len(manifest.columns)
            if values.shape != expected or status.shape != index.shape:
                raise archive.refuse(f"has values of shape {values.shape}, expected {expected}")
            if index.size and not 0 <= int(index.min()) <= int(index.max()) < manifest.size:
                raise archive.refuse(f"has points outside 0 ... {manifest.size - 1}")
            known = [str(text) for text in header["status"]]
            message = {int(point): str(text) for point, text in header["message"].items()}
            return manifest, Rows(index, values, tuple(known[k] for k in status.tolist()), message)
        except (KeyError, TypeError, ValueError, IndexError, RecursionError, AttributeError) as error:
            if isinstance(error, UsageError):
                raise
            raise archive.refuse(f"is no chunk ({type(error).__name__}: {error})") from None


def _seal(arrays: dict[str, npt.NDArray[Any]]) -> bytes:
    total = hashlib.sha256()
    for name in _PARTS:
        array = arrays[name]
        total.update(f"{name} {array.shape}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.digest()
