"""Versions of installed packages."""

from __future__ import annotations

import importlib.metadata

CHECKOUT = "(a checkout, not installed)"


def installed(name: str) -> str | None:
    """The version of a package, None where it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def package_version() -> str:
    """The version of this package; "unknown" in a bare checkout."""
    return installed("filippov") or "unknown"
