"""The versions of all that computes: another one may round otherwise."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("numpy", "scipy", "sympy", "numba", "llvmlite")


def toolchain() -> dict[str, str]:
    """Versions by name, of Python too, and the kind of processor."""
    return {"python": platform.python_version(), "machine": platform.machine()} | {
        name: _version(name) for name in PACKAGES
    }


@cache
def own_sources() -> str:
    """A digest of this package's own files: a version under development changes without its number."""
    total = hashlib.sha256()
    folders = [str(Path(__file__).resolve().parent.parent)]
    for name in ("filippov.models", "filippov.analysis"):
        spec = find_spec(name)
        folders += (spec.submodule_search_locations or ()) if spec is not None else ()
    for folder in folders:
        for path in sorted(Path(folder).rglob("*.py")):
            name = path.relative_to(folder).as_posix()
            total.update(name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()[:12]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"
