"""The version of the installed package."""

from __future__ import annotations

import importlib.metadata


def package_version() -> str:
    """The version of the installed package; "unknown" in a bare checkout."""
    try:
        return importlib.metadata.version("filippov")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
