"""Arrays in an uncompressed npz, written in one piece or not at all, and read with suspicion.

Reading never unpickles, takes memory of at most the size of the file, and compares the CRC of every entry.
"""

from __future__ import annotations

import ast
import io
import math
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Self

import numpy as np
import numpy.typing as npt

from filippov.base.errors import UsageError
from filippov.base.read_whole import missing
from filippov.base.whole_file import write_whole

DTYPES = ("<f8", "<i8", "|u1")
LONGEST_HEADER = 10_000
MOST_ENTRIES = 64
_TABLE = "A table is {{what}}.to_pandas().{0}(path)."
OTHER_ENDINGS = {
    ".csv": _TABLE.format("to_csv"), ".txt": _TABLE.format("to_csv"), ".xlsx": _TABLE.format("to_excel"),
    ".parquet": _TABLE.format("to_parquet"), ".json": _TABLE.format("to_json"),
    **dict.fromkeys((".h5", ".hdf5", ".nc"), "Such a file is {what}.to_xarray().to_netcdf(path)."),
    ".mat": "For MATLAB: scipy.io.savemat(path, {{'t': {what}.t, 'y': {what}.y}}).",
    ".pkl": "Files that run code when they are read are not written.",
    ".pickle": "Files that run code when they are read are not written.",
}  # fmt: skip


def write_arrays(path: str | Path, arrays: Mapping[str, npt.NDArray[Any]]) -> Path:
    """Write float64, int64 and uint8 arrays, whole or not at all."""

    def fill(file: BinaryIO) -> None:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            for key, array in arrays.items():
                with archive.open(f"{key}.npy", "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, _little(array), version=(1, 0), allow_pickle=False)

    return write_whole(path, fill)


def refuse_other_ending(path: str | Path, what: str) -> None:
    """Raise UsageError for a file name that says another format than npz."""
    cure = OTHER_ENDINGS.get(Path(path).suffix.lower())
    if cure is not None:
        raise UsageError(
            f"save was given {str(path)!r} and writes npz, expected a file name that ends in .npz. "
            f"{cure.format(what=what)}"
        )


class Archive:
    """An npz open for reading. Raises UsageError for anything but a sound one of plain arrays."""

    def __init__(self, path: str | Path, max_bytes: int) -> None:
        self.path = Path(path)
        if not self.path.exists():
            raise missing(path)
        found = self.path.stat()
        size = found.st_size
        if not stat.S_ISREG(found.st_mode):
            raise self.refuse("is a folder, a pipe or a device, expected a file")
        if size > max_bytes:
            raise self.refuse(
                f"has {size} bytes, more than max_bytes = {max_bytes}; raise max_bytes if you trust it"
            )
        with self.path.open("rb") as file:
            first = file.read(4)
        if first[:1] == b"\x80" or first[:2] in (b"(l", b"(d", b"]q", b"}q"):
            raise self.refuse(
                "is a pickle (joblib writes these too); it can run code when read and is not opened"
            )
        if first != b"PK\x03\x04":
            raise self.refuse(
                f"begins with {first!r}, expected a zip archive written by save(solution, path)"
            )
        try:
            self.zip = zipfile.ZipFile(self.path)
        except (zipfile.BadZipFile, NotImplementedError, OSError, ValueError) as error:
            raise self.refuse(f"is damaged or cut off ({error})") from None
        self.entries = {entry.filename: entry for entry in self.zip.infolist()}
        try:
            self._check(size)
        except UsageError:
            self.zip.close()
            raise

    def _check(self, size: int) -> None:
        entries = self.zip.infolist()
        if len(entries) != len(self.entries) or len(entries) > MOST_ENTRIES:
            raise self.refuse(f"has {len(entries)} entries, some of one name or too many")
        if any(e.compress_type != zipfile.ZIP_STORED or e.flag_bits & 1 for e in entries):
            raise self.refuse(
                "has compressed or encrypted entries, which save(solution, path) does not write"
            )
        if sum(e.file_size for e in entries) > size:
            raise self.refuse("promises more data than it holds")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.zip.close()

    def refuse(self, why: str) -> UsageError:
        """The error for this file."""
        return UsageError(f"{str(self.path)!r} {why}.")

    @property
    def names(self) -> set[str]:
        """Names of the arrays."""
        return {name.removesuffix(".npy") for name in self.entries}

    def read(self, name: str) -> npt.NDArray[Any]:
        """One array, its own copy, CRC checked."""
        if f"{name}.npy" not in self.entries:
            raise self.refuse(f"holds no {name!r}: it is no solution written by save(solution, path)")
        try:
            content = self.zip.read(f"{name}.npy")
        except (
            zipfile.BadZipFile,
            EOFError,
            OSError,
            ValueError,
            NotImplementedError,
            RuntimeError,
        ) as error:
            raise self.refuse(f"is damaged: {error}") from None
        try:
            return _array(content)
        except (ValueError, SyntaxError, KeyError, TypeError, RecursionError, MemoryError) as error:
            raise self.refuse(f"holds in {name!r} no plain array ({error})") from None


def _array(content: bytes) -> npt.NDArray[Any]:
    stream = io.BytesIO(content)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("unknown version of the npy format")
    length = int.from_bytes(stream.read(2), "little")
    if length > LONGEST_HEADER:
        raise ValueError("its header is too long")
    head = ast.literal_eval(stream.read(length).decode("latin-1"))
    kind, shape = head["descr"], head["shape"]
    if kind not in DTYPES or head["fortran_order"] is not False:
        raise ValueError(f"type {kind!r}; expected one of {', '.join(DTYPES)}, in C order")
    if not isinstance(shape, tuple) or not all(type(v) is int and v >= 0 for v in shape):
        raise ValueError(f"shape {shape!r}")
    rest = content[stream.tell() :]
    if math.prod(shape) * np.dtype(kind).itemsize != len(rest):
        raise ValueError(f"shape {shape} does not fit its {len(rest)} bytes")
    return np.frombuffer(rest, dtype=kind).reshape(shape).astype(np.dtype(kind).newbyteorder("="))


def _little(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    kind = {"f": "<f8", "i": "<i8", "u": "|u1"}[array.dtype.kind]
    return np.ascontiguousarray(array, dtype=kind)
