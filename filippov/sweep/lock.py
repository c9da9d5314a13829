"""One sweep a folder: a lock file with process and host, taken over from a process that is dead."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from filippov.errors import UsageError

NAME = "lock.json"


class Lock:
    """Held from `with Lock(folder)` to its end. Raises UsageError where another run holds the folder."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.owner = {"pid": os.getpid(), "host": socket.gethostname(), "started": _started(os.getpid())}

    def __enter__(self) -> Self:
        with _alone(self.path.parent):
            try:
                self._create()
            except FileExistsError:
                self._take_over()
        return self

    def __exit__(self, *_: object) -> None:
        if _owner(self.path) == self.owner:
            self.path.unlink(missing_ok=True)

    def _create(self) -> None:
        handle = os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(self.owner, file)
            file.flush()
            os.fsync(file.fileno())

    def _take_over(self) -> None:
        owner = _owner(self.path)
        if owner is not None and owner.get("host") != self.owner["host"]:
            raise self._refuse(
                f"process {owner.get('pid')} on host {owner.get('host')!r}, which cannot be asked from here. "
                f"If it is dead, remove {str(self.path)!r}"
            )
        if owner is not None and _alive(owner):
            raise self._refuse(
                f"process {owner.get('pid')} on this host. Wait for it, or name another folder"
            )
        self.path.unlink(missing_ok=True)
        self._create()

    def _refuse(self, holder: str) -> UsageError:
        return UsageError(f"{str(self.path.parent)!r} is in use by {holder}.")


def _owner(path: Path) -> dict[str, Any] | None:
    """What the lock says; None for one that was cut off while it was written."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _alive(owner: dict[str, Any]) -> bool:
    pid = owner.get("pid")
    if not isinstance(pid, int) or pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    # The number may have been given to another process since.
    return owner.get("started") in (None, _started(pid))


def _started(pid: int) -> str | None:
    """When a process began, in ticks since the start of the machine; None where the system does not say."""
    try:
        line = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        return line.rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return None


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep other processes of this host from looking at the lock at the same moment."""
    try:
        import fcntl
    except ImportError:  # not a POSIX system
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks: O_EXCL alone has to do
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
