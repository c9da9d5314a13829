"""The folder that -o names: files that appear whole or not at all, pictures where matplotlib is there."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from filippov.commands.console import Console, json_text
from filippov.errors import UsageError


class Folder:
    """An output folder, made and tried before the work begins; `path` is None where nothing is to be written.

    Raises UsageError where the path is a file, OSError where it cannot be written.
    """

    def __init__(self, path: str | None, console: Console) -> None:
        self.path = None if path is None else Path(path)
        self.console = console
        self.written: list[str] = []
        if self.path is not None:
            if self.path.exists() and not self.path.is_dir():
                raise UsageError(f"-o is {str(self.path)!r}, which is a file; name a folder.")
            self.path.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=self.path):
                pass

    def text(self, name: str, content: str) -> None:
        """Write a text file."""
        if self.path is None:
            return
        handle, temporary = tempfile.mkstemp(prefix=f".{name}.", suffix=".tmp", dir=self.path)
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(content)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(self.path / name)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        self.written.append(name)

    def json(self, name: str, data: Any) -> None:
        """Write a JSON file."""
        if self.path is not None:
            self.text(name, json_text(data))

    def csv(self, name: str, columns: Sequence[str], rows: Iterable[Iterable[Any]]) -> None:
        """Write a table; floats in the shortest form that reads back equal."""
        if self.path is None:
            return
        table = io.StringIO()
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_cell(value) for value in row] for row in rows)
        self.text(name, table.getvalue())

    def file(self, name: str, write: Callable[[Path], object]) -> None:
        """Have `write` make a file."""
        if self.path is not None:
            write(self.path / name)
            self.written.append(name)

    def picture(self, name: str, draw: Callable[[], Any]) -> None:
        """Save the figure that `draw` returns; without matplotlib say so and go on."""
        if self.path is None:
            return
        os.environ.setdefault("MPLBACKEND", "Agg")
        try:
            figure = draw()
        except ImportError as error:
            self.console.warn(f"no {name}: {error}")
            return
        from matplotlib import pyplot as plt

        temporary = self.path / f".{name}.tmp"
        try:
            figure.savefig(temporary, format=Path(name).suffix[1:], dpi=160)
            temporary.replace(self.path / name)
        finally:
            plt.close(figure)
            temporary.unlink(missing_ok=True)
        self.written.append(name)

    def report(self) -> None:
        """Say what was written."""
        if self.path is not None and self.written:
            self.console.say(f"wrote {', '.join(self.written)} into {self.path}")


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(float(value))
    return "" if value is None else value
