"""A file of the user's own, imported by its path: `path/to/file.py:name`."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType

from filippov.base.errors import ModelError, UsageError
from filippov.base.names import closest


def load_file(path: Path) -> ModuleType:
    """Run the user's file, as `python file.py` would find its neighbours. Raises UsageError, ModelError."""
    if not path.is_file():
        # By their stems: what two names have in common is not the ".py".
        beside = [p.stem for p in path.parent.glob("*.py")] if path.parent.is_dir() else []
        near = closest(path.stem, beside).replace("'?", ".py'?")
        raise UsageError(f"there is no file {str(path)!r}; {near or 'give a path from the present folder'}")
    full = path.resolve()
    spec = importlib.util.spec_from_file_location(full.stem, full)
    if spec is None or spec.loader is None:
        raise UsageError(f"{str(path)!r} cannot be imported.")
    if str(full.parent) not in sys.path:
        sys.path.append(str(full.parent))
    module = importlib.util.module_from_spec(spec)
    # Registered for dataclasses and pickle, but never in place of a module that something else has imported.
    sys.modules.setdefault(full.stem, module)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        cure = ""
        if not isinstance(error, ModelError | SyntaxError | ImportError):
            cure = (
                " The file is run to read the model; what is no part of it goes under "
                "if __name__ == '__main__':"
            )
        place = place_of(error, str(path))
        raise ModelError(f"{str(path)!r} could not be imported: {place}{cure}") from error
    return module


def place_of(error: BaseException, name: str) -> str:
    """The error with the last line of the user's file that led to it; name: path or path:attribute."""
    file = Path(name.rpartition(":")[0] if name.rpartition(":")[0].endswith(".py") else name).name
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).name == file]
    where = f" (line {lines[-1]})" if lines else ""
    return f"{type(error).__name__}: {error}{where}"
