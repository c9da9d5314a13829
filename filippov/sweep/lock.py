"""One sweep per folder: a file that its process holds locked, and says in it who that is.

The system gives a lock (flock, on Windows LockFileEx) back when the process ends, however it ends, and knows
it in every container that shares the folder, where the number of the process means nothing. Where the file
system has no locks, or the lock may not be seen (another host), what the file says decides: host, start of
the system, container, number and start of the process. Only who is certainly gone is taken over from.
"""

from __future__ import annotations

import json
import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from filelock import lock_descriptor

from filippov.base.errors import UsageError

NAME = "lock.json"
_LARGEST = 10_000
_BEGIN = b'{"pid": '
_OPEN = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
_MAY_ASK = os.name == "posix"  # where signal 0 asks for a process; on Windows os.kill ends it
Owner = dict[str, Any]


class Lock:
    """Held from `with Lock(folder)` to its end. Raises UsageError where another run holds the folder."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.owner: Owner = {
            "pid": os.getpid(), "host": socket.gethostname(), "boot": _boot(), "space": _space(),
            "started": _started(os.getpid()),
        }  # fmt: skip
        self._handle: int | None = None

    def __enter__(self) -> Self:
        while self._handle is None:
            try:
                self._handle = os.open(self.path, _OPEN | os.O_CREAT | os.O_EXCL, 0o644)
                new = True
            except FileExistsError:
                self._handle, new = self._open(), False
            try:
                self._take(new)
            except BaseException:
                self._close()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._handle is not None and _read(self._handle) == self.owner and self._is_there():
            if os.name != "posix":
                self._close()  # Windows removes no file that is open
            with suppress(PermissionError):  # nor one that another run has opened since
                self.path.unlink(missing_ok=True)
        self._close()

    def _open(self) -> int | None:
        """The file that is there; None for one that has gone since."""
        try:
            return os.open(self.path, _OPEN)
        except FileNotFoundError:
            return None
        except OSError as error:  # a link, a folder, a file of someone else's
            raise UsageError(f"{str(self.path)!r} cannot be used as a lock: {error.strerror}.") from None

    def _take(self, new: bool) -> None:
        """Make the open file this run's; leave nothing open where it is to be tried again."""
        if self._handle is None:
            return
        locked = _hold(self._handle)
        if locked is not None and not self._is_there():
            self._close()  # its owner removed it between our opening and locking it
            return
        found = _read(self._handle)
        if not new and not _is_lock(found, self._handle):
            raise UsageError(
                f"{str(self.path)!r} is no lock of a sweep. Nothing of it is changed: move it away, or name "
                "another folder."
            )
        holder = self._holder(found, locked)
        if holder and not (new and locked is None):
            raise UsageError(f"{str(self.path.parent)!r} is in use by {holder}.")
        self.owner["locked"] = locked is True
        content = json.dumps(self.owner).encode()
        os.ftruncate(self._handle, 0)
        os.lseek(self._handle, 0, os.SEEK_SET)
        os.write(self._handle, content)
        os.fsync(self._handle)

    def _holder(self, found: Owner | None, locked: bool | None) -> str:
        """Who holds the folder; "" where that is certainly nobody."""
        wait, mine = ". Wait for it, or name another folder", self.owner
        cannot = f", which cannot be asked from here. If it is dead, remove {str(self.path)!r}"
        if found is None:  # cut off while it was written; where nobody has it locked, that may be going on
            return "" if locked else f"another process{cannot if locked is None else wait}"
        pid, host = found.get("pid"), found.get("host")
        same_kernel = found.get("boot") is not None and found.get("boot") == mine["boot"]
        here = same_kernel or host == mine["host"]
        same_space = found.get("space") in (None, mine["space"])
        who = f"process {pid} on host {host!r}"
        if here:
            who = f"process {pid} {'on' if same_space else 'in a container of'} this host"
        if locked is False:
            return who + wait
        if locked and found.get("locked") and here:
            return ""
        if not here or (same_kernel and not same_space):
            return who + cannot
        started_again = None not in (found.get("boot"), mine["boot"]) and not same_kernel
        return "" if started_again or not _alive(found) else who + wait

    def _is_there(self) -> bool:
        """Whether the open file is the one that has the name."""
        assert self._handle is not None
        try:
            return os.path.samestat(os.fstat(self._handle), self.path.lstat())
        except FileNotFoundError:
            return False

    def _close(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


def _hold(handle: int) -> bool | None:
    """Whether the file is locked by us from now on; False: by another; None: there are no locks here."""
    try:
        return lock_descriptor(handle, blocking=False)
    except OSError:
        return None


def _read(handle: int) -> Owner | None:
    """What the lock says; None for one that was cut off while it was written."""
    try:
        os.lseek(handle, 0, os.SEEK_SET)
        found = json.loads(os.read(handle, _LARGEST))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _is_lock(found: Owner | None, handle: int) -> bool:
    """Whether a lock, or the beginning of one that was cut off, and not a file of someone else's."""
    if found is not None and "pid" in found:
        return "host" in found
    os.lseek(handle, 0, os.SEEK_SET)
    try:
        text = os.read(handle, _LARGEST)
    except PermissionError:  # Windows lets nobody read what another process has locked
        return True
    written = text.rstrip(b"\0")  # what a system that broke down has not written reads as zeros
    return found is None and (_BEGIN.startswith(written) or written.startswith(_BEGIN))


def _alive(owner: Owner) -> bool:
    """Whether the process may be alive; on systems where asking would end it (Windows) it may."""
    pid = owner.get("pid")
    if not isinstance(pid, int) or pid <= 0:
        return False
    if not _MAY_ASK:
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
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


def _boot() -> str | None:
    """Which run of the system this is, the same in all its containers; None where it does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return None


def _space() -> str | None:
    """Within what the numbers of processes are counted; None where the system does not say."""
    try:
        return str(Path("/proc/self/ns/pid").readlink())
    except (OSError, NotImplementedError):
        return None
