"""The folder of compiled units: private to the user, each file authenticated together with its name.

Machine code that is read is run. The folder must therefore belong to the user and be writable by nobody else,
and so must the files, and every file carries an authentication code (HMAC-SHA256, RFC 2104) over its name and
content, made with a secret that is stored apart from it. A file that fails a check is compiled anew, never
run. Where the folder cannot be used, one among the temporary files is, under the same conditions; where that
fails too, nothing is kept.
"""

from __future__ import annotations

import hmac
import os
import secrets
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

_MAGIC = b"filippov unit 2\n"
_SEAL = 32
_LARGEST = 1 << 27
_KEY_FILE = "unit.key"
_KEY_SIZE = 32
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
# Windows has other file permissions, and keeps user profiles apart.
_OWNED = hasattr(os, "getuid")
_keys: dict[Path, bytes] = {}


@dataclass(frozen=True)
class Place:
    """The folder in use, None where nothing is kept, and why it is not the configured one."""

    folder: Path | None
    meant: Path | None
    reason: str = ""


def cache_folder() -> Path | None:
    """The configured folder: $FILIPPOV_CACHE, else `filippov` in the user's cache folder, if any."""
    named = os.environ.get("FILIPPOV_CACHE")
    if named:
        try:
            return Path(named).absolute()
        except OSError:  # relative to a current folder that is gone
            return None
    base = _of_user("XDG_CACHE_HOME", ".cache")
    return None if base is None else base / "filippov"


def place() -> Place:
    """The folder to use now: the configured one, or a private one among the temporary files."""
    meant = cache_folder()
    reason = "there is no home folder; set HOME or FILIPPOV_CACHE" if meant is None else _unfit(meant)
    if not reason:
        return Place(meant, meant)
    spare = _spare()
    return Place(None if spare is None or _unfit(spare, exactly=True) else spare, meant, reason)


def read(name: str) -> bytes | None:
    """The content kept under a name; None where it is missing, damaged, or not written by this user."""
    for folder, exactly in ((cache_folder(), False), (_spare(), True)):
        if folder is None:
            continue
        data = _read_own(folder / f"{name}.unit", _LARGEST)
        if data is None or data[: len(_MAGIC)] != _MAGIC or _unsafe(folder, exactly):
            continue
        key, content = _key(folder), data[len(_MAGIC) + _SEAL :]
        if key is None or not hmac.compare_digest(_seal(key, name, content), data[len(_MAGIC) :][:_SEAL]):
            continue
        return content
    return None


def write(name: str, content: bytes) -> None:
    """Keep content under a name, whole or not at all; a cache that cannot be written is only slower."""
    folder = place().folder
    key = None if folder is None else _key(folder)
    if folder is not None and key is not None:
        _write_own(folder / f"{name}.unit", _MAGIC + _seal(key, name, content) + content)


def _spare() -> Path | None:
    """The private folder among the temporary files."""
    owner = os.geteuid() if _OWNED else os.environ.get("USERNAME", "user")
    try:
        return Path(tempfile.gettempdir()).absolute() / f"filippov-{owner}"
    except OSError:
        return None


def _seal(key: bytes, name: str, content: bytes) -> bytes:
    seal = hmac.new(key, b"%d %s\n" % (len(name), name.encode()), "sha256")
    seal.update(content)
    return seal.digest()


def _of_user(variable: str, under_home: str) -> Path | None:
    """A folder of the user by the XDG base directory specification, None without a home."""
    base = os.environ.get(variable)
    if base and Path(base).is_absolute():
        return Path(base)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    return home / under_home if home.is_absolute() and home != Path(home.anchor) else None


def _unfit(folder: Path, exactly: bool = False) -> str:
    """Why files cannot be kept in a folder, empty where they can. Makes it where it is missing."""
    try:
        _make(folder)
        if _OWNED and folder.stat().st_mode & _OTHERS and (exactly or _ours_alone(folder)):
            folder.chmod(0o700)
        unsafe = _unsafe(folder, exactly)
        return unsafe or ("" if os.access(folder, os.W_OK | os.X_OK) else f"{folder} cannot be written")
    except (OSError, ValueError) as error:
        return f"{folder}: {getattr(error, 'strerror', None) or error}"


def _unsafe(folder: Path, exactly: bool) -> str:
    """Why a folder is not to be trusted, empty where it is.

    exactly: no link is followed, and others may not even look into it.
    """
    try:
        found = folder.lstat() if exactly else folder.stat()
    except OSError as error:
        return f"{folder}: {error.strerror}"
    if not stat.S_ISDIR(found.st_mode):
        return f"{folder} is no folder"
    if _OWNED and found.st_uid != os.geteuid():
        return f"{folder} belongs to another user"
    if _OWNED and found.st_mode & (_OTHERS if exactly else _OTHERS_WRITE):
        return f"others may write to {folder}; chmod go-w it"
    return ""


def _make(folder: Path) -> None:
    """Create a folder and its missing parents, private to the user."""
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    for path in reversed(missing):
        path.mkdir(0o700, exist_ok=True)


def _ours_alone(folder: Path) -> bool:
    """Whether a folder holds only units and their secret, so that its permissions may be set."""
    with os.scandir(folder) as found:
        return all(item.name.endswith((".unit", ".tmp")) or item.name == _KEY_FILE for item in found)


def _key(folder: Path) -> bytes | None:
    """The secret of the user: in the folder for states, in the cache where that cannot be."""
    base = _of_user("XDG_STATE_HOME", ".local/state")
    for home in (folder,) if base is None else (base / "filippov", folder):
        if home not in _keys:
            key = _read_own(home / _KEY_FILE, _KEY_SIZE, secret=True)
            if key is None or len(key) != _KEY_SIZE:
                key = None if _unfit(home) else _new_key(home / _KEY_FILE, missing=key is None)
            if key is None:
                continue
            _keys[home] = key
        return _keys[home]
    return None


def _new_key(path: Path, missing: bool) -> bytes | None:
    """A new secret in a file, replacing a damaged or readable one; or another process's, if earlier."""
    _write_own(path, secrets.token_bytes(_KEY_SIZE), keep=missing)
    return _read_own(path, _KEY_SIZE, secret=True)


def _read_own(path: Path, largest: int, secret: bool = False) -> bytes | None:
    """The content of a plain file of this user that nobody else may write to (or read, a secret)."""
    flags = os.O_RDONLY
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"):  # not every platform has all of these
        flags |= getattr(os, name, 0)
    forbidden = _OTHERS if secret else _OTHERS_WRITE
    try:
        with os.fdopen(os.open(path, flags), "rb") as stream:
            found = os.fstat(stream.fileno())
            if not stat.S_ISREG(found.st_mode) or found.st_size > largest:
                return None
            if _OWNED and (found.st_uid != os.geteuid() or found.st_mode & forbidden):
                return None
            return stream.read(largest)
    except (OSError, ValueError):
        return None


def _write_own(path: Path, content: bytes, keep: bool = False) -> None:
    """Write a file for the user alone, whole or not at all; silently where that fails.

    Not by `filippov.base.whole_file`: nobody else may read this file, a lost unit is only compiled again (so
    there is no waiting for the disk), and a secret must not replace an earlier one.
    keep: a file that another process has written meanwhile stays.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
            if not (keep and _linked(temporary, path, len(content))):
                Path(temporary).replace(path)
        finally:
            Path(temporary).unlink(missing_ok=True)
    except (OSError, ValueError):
        return


def _linked(temporary: str, path: Path, size: int) -> bool:
    """Whether a file got its name, or a good one had it before."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        return _read_own(path, size, secret=True) is not None
    except OSError:  # no links on this file system: the last writer wins
        return False
    return True
