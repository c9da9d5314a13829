"""What was made from the sources as they are now need not be made again by a test.

    python tests/made.py FOLDER    after `make study` and `make docs`: FOLDER was made from these sources

A stamp in the folder holds a digest of every source, of the pages and of the versions it ran with; another
digest, or none, and the test makes its own.
"""

from __future__ import annotations

import hashlib
import platform
import sys
from importlib.metadata import distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("filippov", "models", "analysis", "docs")
STAMP = "made-from.txt"


def digest() -> str:
    """Of all files of the sources but what is built among them, and of all that is installed."""
    whole = hashlib.sha256(platform.python_version().encode())
    for item in sorted({f"{item.name} {item.version}" for item in distributions()}):
        whole.update(item.encode())
    for path in sorted(path for name in SOURCES for path in (ROOT / name).rglob("*") if path.is_file()):
        place = path.relative_to(ROOT)
        if not {"__pycache__", "_build", "jupyter_execute"} & set(place.parts):
            whole.update(place.as_posix().encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def is_current(folder: Path) -> bool:
    """Whether a folder holds what the sources make now."""
    try:
        return (folder / STAMP).read_text(encoding="ascii") == digest()
    except OSError:
        return False


if __name__ == "__main__":
    (Path(sys.argv[1]) / STAMP).write_text(digest(), encoding="ascii")
