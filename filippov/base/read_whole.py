"""A file read whole: regular, of a size that is expected, text in UTF-8, JSON that says each thing once.

A folder, a device or a pipe, which nobody may write to, is refused before anything is read of it.
"""

from __future__ import annotations

import errno
import json
import math
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from filippov.base.errors import ModelError, UsageError

# A pipe is opened without waiting for its other end; Windows has neither flag's trouble.
_READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

# What readers raise who take for granted what a file should hold.
_WRONG = (
    KeyError, TypeError, IndexError, AttributeError, ValueError, OverflowError, SyntaxError, RecursionError,
)  # fmt: skip
_WRITE_AGAIN = "Write it again with what made it."


def read_bytes(path: str | Path, most: int) -> bytes:
    """The content of a regular file of at most so many bytes. Raises OSError, UsageError."""
    with open(path, "rb", opener=_opened) as file:  # a Path's own takes no opener
        found = os.fstat(file.fileno())
        # Files of /proc have no size before they are read.
        content = b"" if found.st_size > most else file.read(most + 1)
    if max(len(content), found.st_size) > most:
        raise UsageError(f"{str(path)!r} has over {most} bytes, more than such a file has.")
    return content


def missing(path: str | Path) -> FileNotFoundError:
    """What is raised for a file that is not there."""
    said = f"{os.strerror(errno.ENOENT)}; give its path from the present folder"
    return FileNotFoundError(errno.ENOENT, said, str(path))


def unread(error: OSError) -> str:
    """Why a file cannot be read, and what to give in its place."""
    cure = "" if isinstance(error, FileNotFoundError) else "; give the path of a file that can be read"
    return (error.strerror or str(error)) + cure


def _opened(path: str, _: int) -> int:
    try:
        handle = os.open(path, _READ)
    except FileNotFoundError:
        raise missing(path) from None
    kind = os.fstat(handle).st_mode
    if stat.S_ISREG(kind):
        return handle
    os.close(handle)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
    raise UsageError(f"{path!r} is a pipe or a device, expected a file. Save it as one first.")


def read_text(path: str | Path, most: int) -> str:
    """The same as text in UTF-8, without the mark that some programs put in front. Raises ValueError too."""
    return read_bytes(path, most).decode("utf-8-sig")


def read_json(path: str | Path, most: int) -> Any:
    """The data of a file of JSON. Raises OSError, ValueError (UsageError, UnicodeDecodeError)."""
    return json_data(read_text(path, most))


def json_data(text: str | bytes) -> Any:
    """The data of a JSON text; ValueError for NaN, a name twice in one object, and too deep a nesting."""
    try:
        return json.loads(text, object_pairs_hook=_once, parse_constant=_no_constant, parse_float=_finite)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


@contextmanager
def content_of(path: str | Path) -> Iterator[None]:
    """Whatever is wrong with what a file holds is a UsageError that names the file."""
    name = repr(str(path))
    try:
        yield
    except (ModelError, UsageError) as error:
        if name in str(error):
            raise
        raise UsageError(f"{name} is damaged or was altered: {error} {_WRITE_AGAIN}") from None
    except _WRONG as error:
        why = f"{type(error).__name__}: {error}"
        raise UsageError(f"{name} is incomplete or damaged ({why}). {_WRITE_AGAIN}") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the name {twice!r} stands twice in one object; which one counts is not said")
    return found


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number of JSON")


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"{digits} is beyond the range of numbers")
    return value
