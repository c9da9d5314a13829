"""Short names: a package gives what users need most, each name imported when it is first asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any


class _Package(ModuleType):
    """A package whose short names no module takes: an old path may end with the name of a function."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (isinstance(value, ModuleType) and name in self.__dict__.get("__all__", ())):
            super().__setattr__(name, value)


def keep_names(package: str) -> None:
    """Have `package.name` stay what `__all__` lists, also once the module package.name was imported."""
    sys.modules[package].__class__ = _Package


def exported(package: str, places: Mapping[str, str], name: str) -> Any:
    """What a package exports under a name; places: name -> room.module below the package.

    Raises AttributeError for a name that it does not export.
    """
    if name not in places:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{package}.{places[name]}"), name)
    setattr(sys.modules[package], name, value)
    return value
