"""A file written whole or not at all: what stands at its path is the old content or all of the new one.

The content goes into a file beside it, whose name nobody can know beforehand and which must be new, and
takes its place in one step. So a link that someone planted, at the path or at a name like a temporary one, is
never written through: at the path the link is replaced, not what it points to. Permissions are those that the
system gives to a new file; the process's umask, which other threads share, is not touched.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import stat
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

Content = str | bytes | Callable[[BinaryIO], object]
# Names here stand for what is open in a process, not for files: nothing can take their place.
_STREAMS = {Path("/dev"), Path("/dev/fd"), Path("/proc/self/fd")}
# Of these only POSIX systems have the second and only Windows the third; O_EXCL follows no link anywhere.
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_LONGEST = 50  # characters of the name that a temporary one repeats; a name has at most 255 bytes


def write_whole(path: str | Path, content: Content) -> Path:
    """Write text (UTF-8), bytes, or what `content` writes into the file that it is given; returns the path.

    A pipe or a terminal is written to as it is. Lone surrogates in text, which UTF-8 does not have, are
    written as \\udcff. Raises OSError; whatever `content` raises, the path is as it was.
    """
    target = Path(path)
    if _is_stream(target):
        with target.open("wb") as stream:
            _fill(stream, content)
        return target
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder, expected the name of a file in it", str(path))
    temporary = target.parent / f".{target.name[:_LONGEST]}.{secrets.token_hex(8)}.tmp"
    try:
        handle = os.open(temporary, _NEW, 0o666)
    except OSError as error:  # told of the path that was given
        said = f"cannot be written: {error.strerror}"
        if isinstance(error, FileNotFoundError) and not target.parent.is_dir():
            said = f"cannot be written: there is no folder {str(target.parent)!r}; make it first"
        raise OSError(error.errno, said, str(path)) from None
    try:
        with os.fdopen(handle, "wb") as file:
            _fill(file, content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename in (None, str(temporary)):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from None
        raise
    _sync_folder(target.parent)
    return target


def leftovers(folder: Path, names: Iterable[str]) -> list[Path]:
    """What writers of these files left half written when they were killed."""
    any_of = "|".join(re.escape(name[:_LONGEST]) for name in names)
    mine = re.compile(rf"\.+({any_of})(\.[0-9a-f]{{16}}\.tmp)+")  # of a file that was temporary itself, too
    return [path for path in folder.glob(".*.tmp") if mine.fullmatch(path.name)]


def _fill(file: BinaryIO, content: Content) -> None:
    if isinstance(content, str):
        content = content.encode("utf-8", "backslashreplace")
    if isinstance(content, bytes):
        file.write(content)
    else:
        content(file)


def _is_stream(target: Path) -> bool:
    """Whether something that no file can take the place of stands there. Raises OSError for a device."""
    try:
        kind = target.lstat().st_mode
    except OSError:
        return False
    if stat.S_ISFIFO(kind) or stat.S_ISCHR(kind) or target.parent in _STREAMS:
        return True
    if stat.S_ISBLK(kind) or stat.S_ISSOCK(kind):
        raise OSError(errno.EINVAL, "is a device, not a place for a file", str(target))
    return False


def _sync_folder(folder: Path) -> None:
    """Make the new name last, where the system can (not on Windows, nor on every network's file system)."""
    if os.name != "posix":
        return
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
