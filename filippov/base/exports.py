"""Short names: a package gives what users need most, each name imported when it is first asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from opcode import opmap
from types import FrameType, ModuleType
from typing import Any

from filippov.base.errors import UsageError
from filippov.base.names import closest

PACKAGES = (
    "filippov", "filippov.analysis", "filippov.plot", "filippov.models", "filippov.graphs",
    "filippov.interop", "filippov.app",
)  # fmt: skip
# What a package is called for.
_CALLED = {
    "filippov.plot": "solution.plot() draws a solution, and dir(filippov.plot) has what draws the rest",
    "filippov.models": "filippov.models.get('NAME').build() is the system of a model",
}


class _Package(ModuleType):
    """A package whose short names no module takes: an old path may end with the name of a function."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (isinstance(value, ModuleType) and name in self.__dict__.get("__all__", ())):
            super().__setattr__(name, value)

    def __call__(self, *_: Any, **__: Any) -> Any:
        name = self.__name__
        raise UsageError(f"{name} is a package, no function: {_CALLED.get(name, f'dir({name}) has those')}.")


def _at_home(name: str, package: str) -> str:
    """Which other package exports a name."""
    for other in PACKAGES:
        if other != package and name in getattr(importlib.import_module(other), "EXPORTS", ()):
            return f"write from {other} import {name}"
    return ""


def _imports(frame: FrameType) -> bool:
    """Whether a frame is at `from ... import name`."""
    return frame.f_code.co_code[frame.f_lasti] == opmap["IMPORT_FROM"]


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
            if not name.startswith("_"):
                hint = hint or _at_home(name, package) or closest(name, places)
            # `from package import name` drops what an AttributeError says.
            error = ImportError if hint and _imports(sys._getframe(1)) else AttributeError
            raise error(f"module {package!r} has no attribute {name!r}{'; ' + hint if hint else ''}")
        value = getattr(importlib.import_module(f"{package}.{places[name]}"), name)
        setattr(holder, name, value)
        return value

    return exported, lambda: sorted({*vars(holder), *places})
