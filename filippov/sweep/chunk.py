"""A chunk: some rows in one file that appears whole or not at all, sealed with its sha256.

The name of the file is a digest of the key of the sweep and the numbers of its points, so that a file
that was renamed, or comes from elsewhere, is told from a chunk of this sweep.
"""

from __future__ import annotations

import errno
import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.archive import Archive, write_arrays
from filippov.errors import SolveError, UsageError
from filippov.sweep.rows import Rows, Whole

FORMAT, VERSION = "filippov chunk", 1
LARGEST = 1 << 30
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
_PARTS = ("header", "index", "values", "status")


class FullError(SolveError):
    """No room for a file: the message names path, bytes needed and bytes free."""


def chunk_name(key: str, index: Whole) -> str:
    """Name of the file with the rows of these points."""
    text = key.encode() + np.ascontiguousarray(index, dtype="<i8").tobytes()
    return hashlib.sha256(text).hexdigest()[:40] + ".npz"


def write_chunk(folder: Path, key: str, rows: Rows) -> Path:
    """Write rows into a folder. Raises FullError where there is no room, OSError."""
    known = sorted(set(rows.status))
    header = {
        "format": FORMAT, "version": VERSION, "key": key, "status": known,
        "message": {str(point): text for point, text in sorted(rows.message.items())},
    }  # fmt: skip
    arrays: dict[str, npt.NDArray[Any]] = {
        "header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8),
        "index": np.asarray(rows.index, dtype=np.int64),
        "values": np.asarray(rows.values, dtype=np.float64),
        "status": np.array([known.index(status) for status in rows.status], dtype=np.int64),
    }
    arrays["seal"] = np.frombuffer(_seal(arrays), dtype=np.uint8)
    path = folder / chunk_name(key, arrays["index"])
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


def read_chunk(path: Path, key: str, points: int, columns: int) -> Rows:
    """The rows of a chunk, its seal, its name and its numbers checked. Raises UsageError for any other file.

    points, columns  of the whole sweep
    """
    with Archive(path, LARGEST) as archive:
        if archive.names != {*_PARTS, "seal"}:
            raise archive.refuse("does not hold the entries of a chunk")
        arrays = {name: archive.read(name) for name in (*_PARTS, "seal")}
        if arrays["seal"].tobytes() != _seal(arrays):
            raise archive.refuse("is damaged: its sha256 is not the one it was sealed with")
        try:
            header = json.loads(arrays["header"].tobytes())
            index, values, status = arrays["index"], arrays["values"], arrays["status"]
            if (header["format"], header["version"], header["key"]) != (FORMAT, VERSION, key):
                raise archive.refuse("is a chunk of another sweep")
            if path.name != chunk_name(key, index):
                raise archive.refuse("does not have the name that its points give it")
            if values.shape != (len(index), columns) or status.shape != index.shape:
                raise archive.refuse(f"has values of shape {values.shape}, expected {(len(index), columns)}")
            if index.size and not 0 <= int(index.min()) <= int(index.max()) < points:
                raise archive.refuse(f"has points outside 0 ... {points - 1}")
            known = [str(text) for text in header["status"]]
            message = {int(point): str(text) for point, text in header["message"].items()}
            return Rows(index, values, tuple(known[k] for k in status.tolist()), message)
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
