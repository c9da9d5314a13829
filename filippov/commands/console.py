"""Where a command's words go: text for people to stderr, one JSON document to stdout."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any

from filippov.progress import Progress


class Console:
    """The two streams of a command.

    json   write the result to stdout
    quiet  no text for people but errors
    """

    def __init__(self, json: bool = False, quiet: bool = False) -> None:
        self.json, self.quiet = json, quiet

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
        """Text for other programs, as it is, to stdout."""
        sys.stdout.write(text)
        sys.stdout.flush()

    def progress(self, title: str) -> Progress:
        """How far a computation is."""
        return Progress(title, shown=not self.quiet)


def write_error(text: str) -> None:
    """A line to stderr."""
    sys.stderr.write(text.rstrip("\n") + "\n")
    sys.stderr.flush()


def json_text(data: Any) -> str:
    """JSON with null for NaN and infinities, which JSON does not have."""
    return json.dumps(plain(data), ensure_ascii=False, indent=1, allow_nan=False) + "\n"


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
