"""The event loop in plain Python, from the sources that are compiled: for pdb, print and coverage in kernels.

Every kernel file is loaded once more for each system, with the constants, the field and the guards of that
system in place of those of `model`. Numbers are those of compiled code but for products that it fuses with
sums; a run takes some thousand times as long. Chosen by `solve(..., backend="python")`, or for a whole
process by FILIPPOV_PYTHON=1.
"""

from __future__ import annotations

import ctypes
import itertools
import math
import os
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from functools import partial
from importlib.abc import SourceLoader
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np

from filippov.base.elementary import LIBRARY
from filippov.kernel.language import primitives as language
from filippov.kernel.language.records import Struct
from filippov.kernel.language.unit import Constant

BACKENDS = ("compiled", "python")
_WHOLE_PROCESS = os.environ.get("FILIPPOV_PYTHON", "0") not in ("", "0")
_chosen: ContextVar[str] = ContextVar("backend", default="compiled")
_numbers = itertools.count()
# Functions of the language that give a double.
_DOUBLES = ("sqrt", "rint", "two_to", "from_bits", "fma", "power")


def current() -> str:
    """What runs the loop: "compiled" or "python"."""
    return "python" if _WHOLE_PROCESS else _chosen.get()


class using:  # noqa: N801  # a context manager
    """Machines that are made inside run by this backend."""

    def __init__(self, backend: str) -> None:
        self.backend = backend

    def __enter__(self) -> None:
        self.token = _chosen.set(self.backend)

    def __exit__(self, *error: object) -> None:
        _chosen.reset(self.token)


class _Text(SourceLoader):
    """A source text that stands in no file; tracebacks and debuggers show it all the same."""

    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text

    def get_filename(self, fullname: str) -> str:
        return f"{self.name}.py"

    def get_data(self, path: str | bytes) -> bytes:
        return self.text.encode()


def _loaded(name: str, loader: Any, names: Mapping[str, Any]) -> ModuleType:
    spec = spec_from_loader(name, loader)
    assert isinstance(spec, ModuleSpec)
    assert spec.loader is not None
    module = module_from_spec(spec)
    vars(module).update(names)
    spec.loader.exec_module(module)
    return module


def _call(address: int, t: float, *arrays: Any) -> int:
    """Call a function of the user by its C address."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, *[ctypes.c_void_p] * len(arrays))
    return int(kind(int(address))(t, *[array.ctypes.data for array in arrays]))


def _double(function: Callable[..., float]) -> Callable[..., Any]:
    # Numbers of numpy divide by 0 as those of C do.
    return lambda *values: np.float64(function(*values))


def _language() -> dict[str, Any]:
    names: dict[str, Any] = {k: v for k, v in vars(language).items() if callable(v) and not k.startswith("_")}
    names |= {name: _double(getattr(language, name)) for name in _DOUBLES}
    names |= {name: _double(partial(language.each, name)) for name in LIBRARY}
    names |= {"float": np.float64, "fabs": abs, "call_field": _call, "call_guard": _call}
    return names | {"NAN": np.float64(math.nan), "INF": np.float64(math.inf)}


def _constant(value: Constant) -> Any:
    if isinstance(value, list):
        return np.array(value, dtype=float if any(isinstance(v, float) for v in value) else np.int64)
    return np.float64(value) if isinstance(value, float) else value


def interpret(
    texts: Mapping[str, str], files: tuple[Path, ...], constants: Mapping[str, Constant],
    entries: tuple[str, ...], records: Mapping[str, type[Struct]] = MappingProxyType({}),
) -> dict[str, Callable[..., int]]:  # fmt: skip
    """The entry points of a unit as functions of arrays and numbers.

    texts: what is written for the system and the method, by name; files: the kernels that all share; records:
    by name, with the lengths that they have here.
    """
    number = next(_numbers)
    names = _language() | {k: _constant(v) for k, v in constants.items()} | dict(records)
    modules = [
        _loaded(f"filippov_{k}_{number}", _Text(f"{k}_{number}", text), names) for k, text in texts.items()
    ]
    for path in files:
        name = f"filippov_{path.stem}_{number}"
        modules.append(_loaded(name, SourceFileLoader(name, str(path)), {}))
    kernels: dict[str, Any] = {}
    for module in modules:
        own = {k: v for k, v in vars(module).items() if getattr(v, "__module__", "") == module.__name__}
        kernels |= {k: v for k, v in own.items() if callable(v)}
    if "exponential" in kernels:
        kernels["exp"] = kernels["exponential"]
    for module in modules:
        vars(module).update(names | kernels)
    return {name: partial(_enter, kernels[name]) for name in entries}


def _enter(kernel: Callable[..., Any], *given: Any) -> int:
    flat = [
        value.reshape(-1) if isinstance(value, np.ndarray)
        else np.float64(value) if isinstance(value, float) else value
        for value in given
    ]  # fmt: skip
    with np.errstate(all="ignore"):
        return int(kernel(*flat) or 0)
