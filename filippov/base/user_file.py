"""A file of the user's own, imported by its path: `path/to/file.py:name`."""

from __future__ import annotations

import importlib.util
import os
import sys
import sysconfig
import traceback
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from filippov.base.errors import ModelError, UsageError
from filippov.base.names import closest
from filippov.base.read_whole import unread

_INSTALLED = tuple(
    sysconfig.get_path(name) + os.sep for name in ("stdlib", "platstdlib", "purelib", "platlib")
)  # fmt: skip


class _Present(SourceFileLoader):
    """Runs this text: byte code kept beside a file may be that of another text of its size and second."""

    def __init__(self, name: str, path: str, content: bytes) -> None:
        super().__init__(name, path)
        self.content = content

    def get_code(self, fullname: str) -> CodeType:
        """The code of the text."""
        code: CodeType = self.source_to_code(self.content, self.path)
        return code


def read_file(path: Path) -> bytes:
    """The text of the user's file. Raises UsageError."""
    if not path.is_file():
        # By their stems: what two names have in common is not the ".py".
        beside = [p.stem for p in path.parent.glob("*.py")] if path.parent.is_dir() else []
        near = closest(path.stem, beside).replace("'?", ".py'?")
        raise UsageError(f"there is no file {str(path)!r}; {near or 'give a path from the present folder'}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"{str(path)!r} cannot be read: {unread(error)}.") from None


def load_file(path: Path, content: bytes | None = None) -> ModuleType:
    """Run the user's file, as `python file.py` would find its neighbours. Raises UsageError, ModelError.

    content     what was read of it before, and is run again whatever it holds by now
    """
    content = read_file(path) if content is None else content
    full = path.resolve()
    loader = _Present(full.stem, str(full), content)
    spec = importlib.util.spec_from_file_location(full.stem, full, loader=loader)
    if spec is None:
        raise UsageError(f"{str(path)!r} cannot be imported.")
    if str(full.parent) not in sys.path:
        sys.path.append(str(full.parent))
    module = importlib.util.module_from_spec(spec)
    # Registered for dataclasses and pickle, but never in place of a module that something else has imported.
    sys.modules.setdefault(full.stem, module)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as error:
        cure = ""
        if not isinstance(error, ModelError | UsageError | SyntaxError | ImportError):
            cure = (
                " The file is run to read the model; what is no part of it goes under "
                "if __name__ == '__main__':"
            )
        place = place_of(error, str(path))
        raise ModelError(f"{str(path)!r} could not be imported: {place}{cure}") from error
    return module


def place_of(error: BaseException, name: str) -> str:
    """The error with the last line of the user's file that led to it, and with that of another file of
    theirs where it arose; name: path or path:attribute."""
    file = Path(name.rpartition(":")[0] if name.rpartition(":")[0].endswith(".py") else name).name
    own = own_lines(error)
    lines = [line for path, line in own if path.name == file]
    where = [f"line {lines[-1]}"] if lines else []
    if own and own[-1][0].name != file:
        where.append(f"line {own[-1][1]} of {own[-1][0].name}")
    return named(error) + (f" ({', '.join(where)})" if where else "")


def named(error: BaseException) -> str:
    """The error by its name, with what it says."""
    return f"{type(error).__name__}: {error}".removesuffix(": ")


def placed(error: BaseException) -> str:
    """The error with the line of the user's own files where it arose, if it did so there."""
    return named(error) + "".join(f" (line {line} of {path.name})" for path, line in own_lines(error)[-1:])


def own_lines(error: BaseException) -> list[tuple[Path, int]]:
    """Files and lines of the user's own that led to an error, the last one last."""
    out = []
    for frame, line in traceback.walk_tb(error.__traceback__):
        file, module = frame.f_code.co_filename, str(frame.f_globals.get("__name__", ""))
        if module.partition(".")[0] != "filippov" and not file.startswith(("<", *_INSTALLED)):
            out.append((Path(file), line))
    return out
