"""The results of a sweep in its folder: replaced by those of its next run, and no file of anyone else's."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from filippov.base.errors import UsageError
from filippov.base.json_text import json_text
from filippov.base.read_whole import read_json
from filippov.base.whole_file import leftovers, write_whole
from filippov.sweep.chunk import FullError

NAME = "written.json"
FORMAT = "filippov outputs"
LARGEST = 1 << 24
_BLOCK = 1 << 20


class Outputs:
    """Files that one run after the other writes into a folder; `written.json` there has their sha256.

    A digest is noted before its file takes its name, so that a run that is killed in between leaves nothing
    that the next one does not know.

    Raises UsageError, before anything is computed, where one of these names is taken by a file that no run
    has written, or that was changed since.
    """

    def __init__(self, folder: Path | None, names: Sequence[str]) -> None:
        self.folder, self.names, self.begun = folder, names, False
        self.files: dict[str, str] = {}
        if folder is None:
            return
        known, coming = self._known(folder / NAME)
        for name in names:
            path = folder / name
            if os.path.lexists(path):
                self.files[name] = _digest(path)
                if not self.files[name] or self.files[name] not in (known.get(name), coming.get(name)):
                    raise _left(path, "was not written by this sweep, or was changed since")

    def remove(self) -> None:
        """Remove them once, for a run that begins afresh."""
        if self.folder is not None and not self.begun:
            self.begun = True
            for name in (*self.names, NAME):
                (self.folder / name).unlink(missing_ok=True)

    def write(self, path: Path, write: Callable[[Path], object]) -> None:
        """Have `write` make one of the files."""
        made = path.with_name(f".{path.name}.{secrets.token_hex(8)}.tmp")
        try:
            write(made)
            digest = _digest(made)
            self._note({path.name: digest})
            made.replace(path)
        except FullError as error:
            raise FullError(str(error).replace(made.name, path.name)) from None
        finally:
            made.unlink(missing_ok=True)
        self.files[path.name] = digest

    def keep(self) -> None:
        """Note what stands there now as written; what runs that were killed left half written goes."""
        if self.folder is not None:
            files = {name: _digest(self.folder / name) for name in self.names}
            self.files = {name: digest for name, digest in files.items() if digest}
            self._note({})
            for left in leftovers(self.folder, (*self.names, NAME)):
                left.unlink(missing_ok=True)

    def _note(self, coming: Mapping[str, str]) -> None:
        assert self.folder is not None
        data = {"format": FORMAT, "files": self.files} | ({"coming": coming} if coming else {})
        write_whole(self.folder / NAME, json_text(data))

    def _known(self, path: Path) -> list[dict[str, str]]:
        if not os.path.lexists(path):
            return [{}, {}]
        try:
            found = read_json(path, LARGEST)
            if found["format"] != FORMAT:
                raise ValueError
            parts = found["files"], found.get("coming", {})
            return [{str(name): str(digest) for name, digest in part.items()} for part in parts]
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise _left(path, "does not say which results a sweep has written") from None


def _left(path: Path, why: str) -> UsageError:
    return UsageError(f"{str(path)!r} {why}: it is left as it is. Move it away, or name another folder.")


def _digest(path: Path) -> str:
    """sha256 of a file, "" where there is none that can be read."""
    if path.is_symlink() or not path.is_file():
        return ""
    total = hashlib.sha256()
    with path.open("rb") as file:
        while part := file.read(_BLOCK):
            total.update(part)
    return total.hexdigest()
