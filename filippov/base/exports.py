"""Short names: a package gives what users need most, each name imported when it is first asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

from filippov.base.names import closest


class _Package(ModuleType):
    """A package whose short names no module takes: an old path may end with the name of a function."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (isinstance(value, ModuleType) and name in self.__dict__.get("__all__", ())):
            super().__setattr__(name, value)


def short_names(
    package: str, places: Mapping[str, str], answers: Mapping[str, str] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package that exports names; places: name -> module below the package.

    answers: what to write in place of a name that is looked for and is none of them.

    `package.name` stays what `places` lists, also once a module package.name was imported.
    """
    holder = sys.modules[package]
    holder.__class__ = _Package

    def exported(name: str) -> Any:
        if name not in places:
            hint = (answers or {}).get(name.lower(), "")
            hint = hint or ("" if name.startswith("_") else closest(name, places))
            raise AttributeError(f"module {package!r} has no attribute {name!r}{'; ' + hint if hint else ''}")
        value = getattr(importlib.import_module(f"{package}.{places[name]}"), name)
        setattr(holder, name, value)
        return value

    return exported, lambda: sorted({*vars(holder), *places})
