"""The folder that -o names: files that appear whole or not at all, pictures where matplotlib is there."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from filippov.app.cli.console import Console, json_text
from filippov.base.csv_text import csv_text
from filippov.base.errors import UsageError
from filippov.base.escape import printable
from filippov.base.whole_file import Content, write_whole


class Folder:
    """An output folder, made and tried before the work begins; `path` is None where nothing is to be written.

    Raises UsageError where the path is a file or cannot be written.
    """

    def __init__(self, path: str | None, console: Console) -> None:
        self.path = None if path is None else Path(path)
        self.console = console
        self.written: list[str] = []
        self.replaced: list[str] = []
        if self.path is not None:
            if self.path.exists() and not self.path.is_dir():
                raise UsageError(f"-o is {str(self.path)!r}, which is a file; name a folder.")
            try:
                self.path.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=self.path):
                    pass
            except OSError as error:
                raise UsageError(
                    f"-o is {str(self.path)!r}, where nothing can be written "
                    f"({error.strerror or error}); name a folder that you can write."
                ) from None

    def content(self, name: str, content: Content) -> None:
        """Write a file, whole or not at all: text, bytes, or what a function writes into an open file."""
        if self.path is None:
            return
        self._about_to_write(name)
        write_whole(self.path / name, content)
        self.written.append(name)

    def json(self, name: str, data: Any) -> None:
        """Write a JSON file."""
        if self.path is not None:
            self.content(name, json_text(data))

    def csv(self, name: str, columns: Sequence[str], rows: Iterable[Iterable[Any]]) -> None:
        """Write a table; floats in the shortest form that reads back equal."""
        if self.path is not None:
            self.content(name, csv_text(columns, rows))

    def file(self, name: str, write: Callable[[Path], object]) -> None:
        """Have `write` make a file; it is to write it whole or not at all."""
        if self.path is not None:
            self._about_to_write(name)
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

        form = Path(name).suffix[1:]
        try:
            with warnings.catch_warnings():
                # A letter that the font does not have is drawn as a box; the tables have it.
                warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
                self.content(name, lambda file: figure.savefig(file, format=form, dpi=160))
        finally:
            plt.close(figure)

    def _about_to_write(self, name: str) -> None:
        if self.path is not None and os.path.lexists(self.path / name):
            self.replaced.append(name)

    def report(self) -> None:
        """Say what was written, and which of it stands in place of a file that was there before."""
        if self.path is not None and self.written:
            again = [name for name in self.replaced if name in self.written]
            told = f", in place of the {', '.join(again)} that was there" if again else ""
            self.console.say(f"wrote {', '.join(self.written)} into {printable(self.path)}{told}")
