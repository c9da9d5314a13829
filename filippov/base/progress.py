"""How far a long computation is, on stderr: a bar of rich on a terminal, else a line now and then.

Nothing appears for work that is done within `PATIENCE` seconds, so short commands stay silent.
"""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any, Self

from filippov.base.escape import printable

PATIENCE = 1.0
EVERY = 5.0  # seconds between two lines where stderr is no terminal


class Progress:
    """A context manager that is called with how much is done.

        with Progress("event map") as progress:
            progress(20, 100)
            progress(40, 100, "second half")

    shown   False for silence

    Call it with (done, total), with (done, total, note), or with a note alone.
    """

    def __init__(self, title: str, shown: bool = True) -> None:
        self.title, self.shown = printable(title), shown
        self.started, self.last = time.monotonic(), -EVERY
        self.fraction, self.note = 0.0, ""
        self.counted = False  # whether it is known how much there is to do
        self._bar: Any = None
        self._task: Any = None
        self._line = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __call__(self, done: float | str, total: float = 1.0, note: str = "", *_: object) -> None:
        """Tell that `done` of `total` is done, or what is being done."""
        if isinstance(done, str):
            self.note = printable(done)
        else:
            self.fraction, self.counted = min(1.0, max(0.0, done / total)) if total else 1.0, True
            self.note = printable(note) if note else self.note
        now = time.monotonic()
        if not self.shown or now - self.started < PATIENCE:
            return
        if sys.stderr.isatty():
            self._draw(now)
        elif now - self.last >= EVERY:
            self.last = now
            _write(f"{self._text()}\n")

    def close(self) -> None:
        """Take the bar away; what was written as lines stays."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        elif self._line:
            _write("\r\x1b[K")
            self._line = False

    def _text(self) -> str:
        spent = time.monotonic() - self.started
        note = f" - {self.note}" if self.note else ""
        left = f", about {spent / self.fraction - spent:.0f} s left" if 0.0 < self.fraction < 1.0 else ""
        share = f"{100 * self.fraction:3.0f} %, " if self.counted else ""
        return f"{self.title}: {share}{spent:.0f} s{left}{note}"

    def _draw(self, now: float) -> None:
        if self._bar is None and not self._line:
            self._bar = self._rich()
        if self._bar is not None:
            self._bar.update(self._task, completed=self.fraction, description=self._label())
        elif now - self.last >= 0.1:
            self.last, self._line = now, True
            _write(f"\r\x1b[K{self._text()}"[:200])

    def _label(self) -> str:
        return f"{self.title} {self.note}".strip()

    def _rich(self) -> Any:
        """A running bar of rich, None where rich is not installed."""
        try:
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                TaskProgressColumn,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )
            from rich.progress import Progress as Bar
        except ImportError:
            return None
        label = TextColumn("{task.description}", markup=False)
        times = (TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
        columns = (label, BarColumn(), TaskProgressColumn(), *times)
        bar = Bar(*columns, console=Console(file=sys.stderr), transient=True)
        self._task = bar.add_task(self._label(), total=1.0)
        bar.start()
        return bar


def _write(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()
