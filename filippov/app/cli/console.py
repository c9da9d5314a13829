"""Where a command's words go: text for people to stderr, one JSON document to stdout."""

from __future__ import annotations

import io
import math
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from filippov.base import json_text as documents
from filippov.base.errors import UsageError
from filippov.base.escape import LINES, printable
from filippov.base.progress import Progress


class Console:
    """The two streams of a command.

    json   write the result to stdout
    quiet  no text for people but errors
    """

    def __init__(self, json: bool = False, quiet: bool = False) -> None:
        self.json, self.quiet = json, quiet
        self._stream: Any = None  # where results go, once stdout is for nothing else
        self._handle: int | None = None

    @contextmanager
    def alone(self, for_good: bool) -> Iterator[None]:
        """With --json nothing but the result reaches stdout meanwhile: what a model prints goes to stderr.

        That is also true of what compiled code and worker processes print. for_good: stdout is not given
        back, as a program may print to its very end.
        """
        if not self.json:
            yield
            return
        if sys.stdout is None:
            raise UsageError("stdout is closed, so there is no place for the result that --json asks for.")
        self._stream = sys.stdout
        if _descriptor(self._stream) == 1:
            self._stream.flush()
            self._handle = os.dup(1)
            _send_to_stderr(1)
        sys.stdout = sys.stderr
        try:
            yield
        finally:
            if not for_good:
                sys.stdout = self._stream
                if self._handle is not None:
                    os.dup2(self._handle, 1)
            if self._handle is not None:
                os.close(self._handle)
            self._stream = self._handle = None

    def say(self, text: str = "") -> None:
        """Text for people."""
        if not self.quiet:
            write_error(text)

    def warn(self, text: str) -> None:
        """Text that also a quiet command writes."""
        write_error(f"filippov: {text}")

    def result(self, data: Any) -> None:
        """The machine's result, where it was asked for."""
        if self.json:
            self.raw(json_text(data))

    def raw(self, text: str) -> None:
        """Text for other programs, as it is, to stdout: in UTF-8 whatever the locale."""
        content = text.encode("utf-8", "backslashreplace")
        if self._handle is not None:
            while content:
                content = content[os.write(self._handle, content) :]
            return
        stream = self._stream or sys.stdout
        try:
            stream.flush()
            stream.buffer.write(content)
        except (AttributeError, io.UnsupportedOperation):  # it takes text only
            stream.write(content.decode())
        stream.flush()

    def progress(self, title: str) -> Progress:
        """How far a computation is."""
        return Progress(title, shown=not self.quiet)


def _descriptor(stream: Any) -> int | None:
    try:
        return int(stream.fileno())
    except (AttributeError, OSError, ValueError):
        return None


def _send_to_stderr(descriptor: int) -> None:
    try:
        os.dup2(2, descriptor)
    except OSError:  # stderr is closed
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)


def write_error(text: str) -> None:
    """A line to stderr, without characters that a terminal would obey."""
    if sys.stderr is not None:
        sys.stderr.write(printable(text.rstrip("\n"), LINES) + "\n")
        sys.stderr.flush()


def json_text(data: Any) -> str:
    """JSON with null for NaN and infinities, which JSON does not have."""
    return documents.json_text(plain(data))


def plain(data: Any) -> Any:
    """Dicts, lists, texts, numbers and None only."""
    if data is None or isinstance(data, bool | int):
        return data
    if isinstance(data, str):
        return str(data)
    if isinstance(data, float):
        return float(data) if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(key): plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple | set | frozenset):
        return [plain(value) for value in data]
    if hasattr(data, "tolist"):  # numpy scalars and arrays
        return plain(data.tolist())
    return str(data)
