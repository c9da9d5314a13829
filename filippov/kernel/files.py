"""The source files of this package: kernels are compiled from their text, by the names of their files."""

from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parent


@cache
def kernel_file(name: str) -> Path:
    """The file of a kernel module, by the module's last name, which no two have in common."""
    (path,) = _FOLDER.rglob(f"{name}.py")
    return path


def all_files() -> list[Path]:
    """Every source file, in the order of their paths."""
    return sorted(_FOLDER.rglob("*.py"))
