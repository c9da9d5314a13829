"""Methods that a module of a floor above carries out: the package names who does, a class asks by name.

`Solution.plot` belongs to a solution, and pictures are made above it. So the class does not import who draws;
the package, which stands above all, registers "Solution.plot" with the place of the function (see
`filippov/__init__.py`), and it is imported when the method is first called.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

_PLACES: dict[str, str] = {}


def register(places: Mapping[str, str]) -> None:
    """Register functions for methods: "Class.method" -> "module:function"."""
    _PLACES.update(places)


def delegate(method: str) -> Callable[..., Any]:
    """The function that carries out a method, "Class.method"; it takes the object as its first argument."""
    module, _, name = _PLACES[method].partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function
