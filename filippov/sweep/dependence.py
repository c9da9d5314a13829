"""What functions of the user's depend on: their code and all that it reads, as one digest.

Read are byte code and constants, default arguments, closures, globals by value, the user's own functions,
classes, objects and modules as far as the code names them, and so on from there; of installed packages the
version. What a program reads when it runs (files, the environment, the clock, random numbers, names that are
computed) cannot be known in advance: it is named in `unseen`.
"""

from __future__ import annotations

import builtins
import copyreg
import dataclasses
import dis
import enum
import functools
import hashlib
import importlib.util
import site
import sys
import sysconfig
import types
import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from filippov.model.system import System

_SCALARS = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), type(NotImplemented))
_BUILT_IN = (types.BuiltinFunctionType, types.MethodDescriptorType, types.WrapperDescriptorType,
             types.MethodWrapperType, types.ClassMethodDescriptorType, types.GetSetDescriptorType,
             types.MemberDescriptorType, np.ufunc)  # fmt: skip
# Modules of the standard library whose results follow from their arguments; and harmless ones of the others.
_PURE = frozenset((
    "__future__", "_abc", "_bisect", "_collections", "_collections_abc", "_decimal", "_functools", "_heapq",
    "_json", "_operator", "_struct", "abc", "array", "bisect", "builtins", "cmath", "collections",
    "collections.abc", "contextlib", "copy", "copyreg", "dataclasses", "decimal", "enum", "fractions",
    "functools", "heapq", "itertools", "json", "json.decoder", "json.encoder", "logging", "math", "numbers",
    "operator", "re", "statistics", "string", "struct", "textwrap", "types", "typing", "warnings",
))  # fmt: skip
_HARMLESS = frozenset((
    "time.sleep", "os._exit", "os.kill", "os.getpid", "posix._exit", "posix.kill", "posix.getpid", "sys.exit",
    "sys.float_info", "sys.maxsize", "sys.stderr", "sys.stdout", "signal.SIGKILL", "signal.SIGTERM",
    "signal.SIGINT", "signal.raise_signal",
))  # fmt: skip
_OUTSIDE = frozenset((
    "open", "input", "eval", "exec", "compile", "globals", "locals", "vars", "getattr", "__import__", "id",
    "hash", "breakpoint",
))  # fmt: skip
# Packages and functions of others that read files or draw numbers.
_DRAWN, _READERS = ("numpy.random", "scipy.io"), ("read", "load", "open", "fromfile", "genfromtxt", "memmap")
_NOT_CONTENT = frozenset((
    "__abstractmethods__", "__annotate__", "__annotate_func__", "__annotations__", "__annotations_cache__",
    "__dataclass_fields__", "__dict__", "__doc__", "__firstlineno__", "__module__", "__qualname__",
    "__slotnames__", "__static_attributes__", "__weakref__", "_abc_impl",
))  # fmt: skip
_MOST, _DEEPEST = 200_000, 80
_NOTHING = object()


@dataclass(frozen=True)
class Dependence:
    """digest: sha256 of what was read; unseen: what cannot be read beforehand, in words."""

    digest: str
    unseen: tuple[str, ...] = ()


def dependence(*values: Any) -> Dependence:
    """What these functions, objects and numbers depend on."""
    reader = _Reader()
    for value in values:
        reader.value(value)
    reader.modules()
    return Dependence(reader.total.hexdigest(), tuple(sorted(reader.unseen)))


def plain_system(system: System) -> tuple[Any, ...]:
    """All that a system of plain functions is made of."""
    return (
        system.field, system.states, system.parameters.names, system.surfaces, system.time_events,
        repr(system.comparator), system.compile,
    )  # fmt: skip


class _Reader:
    def __init__(self) -> None:
        self.total = hashlib.sha256()
        self.unseen: set[str] = set()
        self.seen: dict[int, int] = {}
        self.kept: list[Any] = []  # an address is given again to another object once its own is gone
        self.named: dict[str, types.ModuleType] = {}
        self.attributes: set[str] = set()
        self.read: set[tuple[str, str]] = set()
        self.depth, self.count, self.where = 0, 0, ""

    def put(self, *texts: str | bytes) -> None:
        for text in texts:
            data = text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")
            self.total.update(f"{len(data)}:".encode())
            self.total.update(data)

    def miss(self, what: str) -> None:
        self.put("unseen", what)
        self.unseen.add(f"{self.where} {what}" if self.where else f"a function {what}")

    def value(self, value: Any) -> None:
        """Read anything."""
        self.count += 1
        if self.count > _MOST or self.depth > _DEEPEST:
            if self.count == _MOST + 1 or self.depth > _DEEPEST:
                self.miss(f"reads more than {_MOST} objects, or objects nested deeper than {_DEEPEST}")
            return
        self.depth += 1
        try:
            self._value(value)
        finally:
            self.depth -= 1

    def _value(self, value: Any) -> None:
        kind = type(value)
        if kind in _SCALARS:
            self.put(kind.__name__, repr(value) if kind is not bytes else value)
        elif kind is tuple:
            self.put("tuple", str(len(value)))
            self.values(value)
        elif kind in (set, frozenset):
            self._set(value)
        elif kind is types.CodeType:
            self._code(value, {})
        elif isinstance(value, types.ModuleType):
            self._module(value)
        elif isinstance(value, np.generic) or (kind is np.ndarray and not value.dtype.hasobject):
            array = np.asarray(value)
            self.put("array", array.dtype.str, str(array.shape), np.ascontiguousarray(array).tobytes())
        elif isinstance(value, enum.Enum):
            self.put("enum", kind.__qualname__, value.name)
            self.value(value.value)
        elif id(value) in self.seen:
            self.put("seen", str(self.seen[id(value)]))
        else:
            self.seen[id(value)] = len(self.seen)
            self.kept.append(value)
            self._content(value, kind)

    def values(self, values: Iterable[Any]) -> None:
        """Read one after the other."""
        for value in values:
            self.value(value)

    def _content(self, value: Any, kind: type) -> None:
        if kind is list:
            self.put("list", str(len(value)))
            self.values(value)
        elif kind in (dict, types.MappingProxyType):
            self.put("dict", str(len(value)))
            for name, item in value.items():
                self.values((name, item))
        elif isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.MethodType):
            self.put("method")
            self.values((value.__func__, value.__self__))
        elif isinstance(value, _BUILT_IN):
            self._built_in(value)
        elif isinstance(value, type):
            self._class(value)
        elif isinstance(value, property):
            self.values((value.fget, value.fset, value.fdel))
        elif isinstance(value, staticmethod | classmethod):
            self.put(kind.__name__)
            self.value(value.__func__)
        elif isinstance(value, System):
            self.values(plain_system(value) if value.field is not None else (value.digest,))
            self.value(value.parameters)
        elif callable(value) and hasattr(value, "__wrapped__"):
            # What functools.lru_cache and compilers of functions leave of them.
            self.put("wrapped", kind.__module__, kind.__qualname__)
            self.value(value.__wrapped__)
        else:
            self._object(value, kind)

    def _set(self, value: Any) -> None:
        parts = []
        for item in value:
            part = dependence(item)
            self.unseen |= set(part.unseen)
            parts.append(part.digest)
        self.put("set", *sorted(parts))

    # -- functions -------------------------------------------------------------------------------------

    def _function(self, function: types.FunctionType) -> None:
        before = self.where
        if not _installed(function.__module__):
            self.where = f"{function.__qualname__!r}"
        self.put("function", function.__qualname__)
        cells = function.__closure__ or ()
        for name, cell in zip(function.__code__.co_freevars, cells, strict=True):
            self.put("closure", name)
            try:
                self.value(cell.cell_contents)
            except ValueError:
                self.put("empty")
        if _installed(function.__module__):
            self._named(function.__module__, function.__qualname__)
        else:
            self._code(function.__code__, function.__globals__)
        self.values((function.__defaults__, function.__kwdefaults__, vars(function) or None))
        self.where = before

    def _code(self, code: types.CodeType, known: Mapping[str, Any]) -> None:
        self.put("code", code.co_code, code.co_exceptiontable, str(code.co_argcount), str(code.co_flags))
        self.put(str(code.co_kwonlyargcount), str(code.co_posonlyargcount))
        self.put(*code.co_names, "", *code.co_varnames, "", *code.co_freevars, "", *code.co_cellvars)
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self._code(constant, known)
            else:
                self.value(constant)
        names: dict[str, None] = {}
        for step in dis.get_instructions(code):
            if step.opname.startswith(("LOAD_GLOBAL", "LOAD_NAME")):
                names[step.argval] = None
            elif step.opname.startswith(("LOAD_ATTR", "LOAD_METHOD", "LOAD_SUPER_ATTR", "IMPORT_FROM")):
                self.attributes.add(step.argval)
            elif step.opname.startswith("IMPORT_NAME"):
                self._imported(step.argval, known)
            elif step.opname.startswith("STORE_GLOBAL"):
                self.miss(f"changes the global {step.argval!r} when it runs")
        for name in names:
            self.put("global", name)
            if name in known:
                self.value(known[name])
            elif name in _OUTSIDE:
                self.miss(f"calls {name}")
            elif not hasattr(builtins, name):
                self.put("undefined")

    def _imported(self, name: str, known: Mapping[str, Any]) -> None:
        package = known.get("__package__") or ""
        for full in (name, f"{package}.{name}" if name else package):
            if full in sys.modules:
                self.value(sys.modules[full])
                return
        if _spec(name) is None:
            self.miss(f"imports {name!r} when it runs")
        elif _installed(name):
            self._named(name, "")
        else:
            try:
                self.value(importlib.import_module(name))
            except Exception:  # noqa: BLE001  # a module may fail in any way
                self.miss(f"imports {name!r} when it runs")

    # -- objects ---------------------------------------------------------------------------------------

    def _class(self, kind: type) -> None:
        if _installed(kind.__module__):
            self._named(kind.__module__, kind.__qualname__)
            return
        before, self.where = self.where, f"class {kind.__qualname__!r}"
        self.put("class", kind.__qualname__)
        self.values(kind.__bases__)
        for name, value in vars(kind).items():
            if name not in _NOT_CONTENT and not (name in ("__repr__", "__hash__") and _generated(value)):
                self.put(name)
                self.value(value)
        self.where = before

    def _built_in(self, value: Any) -> None:
        owner = getattr(value, "__self__", None)
        kind = getattr(value, "__objclass__", None)
        module = getattr(value, "__module__", None) or getattr(kind, "__module__", None) or "numpy"
        self._named(module, getattr(value, "__qualname__", value.__name__))
        if owner is not None and not isinstance(owner, types.ModuleType | type):
            self.value(owner)

    def _object(self, value: Any, kind: type) -> None:
        self.put("object", kind.__qualname__)
        self.value(kind)
        try:
            made = value.__reduce_ex__(4)
        except Exception:  # noqa: BLE001  # an object may refuse in any way
            self.miss(f"reads an object of type {kind.__qualname__!r}, whose content cannot be read")
            return
        self.kept.append(made)
        if isinstance(made, str):
            self.put(made)
            return
        function, arguments, *rest = made
        if function not in (copyreg.__newobj__, getattr(copyreg, "__newobj_ex__", None)):  # type: ignore[attr-defined]
            self.value(function)
        self.values(arguments)
        for part in rest:
            self.value(part if part is None or isinstance(part, tuple | dict | list) else _listed(part))

    # -- modules ---------------------------------------------------------------------------------------

    def _module(self, module: types.ModuleType) -> None:
        self.put("module", module.__name__, _version(module.__name__) if _installed(module.__name__) else "")
        self.named.setdefault(module.__name__, module)

    def modules(self) -> None:
        """What the code reads of the modules that it names: every attribute that any of it asks for."""
        self.where = ""
        while True:
            asked = [(name, a) for name in self.named for a in self.attributes if (name, a) not in self.read]
            for name, attribute in sorted(asked):
                self.read.add((name, attribute))
                value = _attribute(self.named[name], attribute)
                if value is _NOTHING:
                    continue
                self.put("attribute", name, attribute)
                if not _installed(name):
                    self.value(value)
                elif isinstance(value, types.ModuleType):
                    self._module(value)
                else:
                    self._named(name, attribute)
            if not asked:
                return

    def _named(self, module: str, name: str) -> None:
        """Something of an installed package, by its name and the version of the package."""
        top = module.partition(".")[0]
        self.put("installed", module, name, _version(module))
        full = f"{module}.{name}"
        if top == "filippov" or full in _HARMLESS:
            return
        if top in sys.stdlib_module_names:
            outside = module not in _PURE or (module == "builtins" and name in _OUTSIDE)
        else:
            drawn = any(full == d or full.startswith(f"{d}.") for d in _DRAWN)
            outside = drawn or name.rpartition(".")[2].startswith(_READERS)
        if outside:
            self.miss(f"reads {full.rstrip('.')}")


def _generated(function: Any) -> bool:
    """Whether a dataclass has written it."""
    code = getattr(function, "__code__", None)
    return code is not None and code.co_filename in ("<string>", dataclasses.__file__)


def _attribute(module: types.ModuleType, name: str) -> Any:
    """An attribute of a module; some import their parts, warn or fail when they are asked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return getattr(module, name, _NOTHING)
        except Exception:  # noqa: BLE001
            return _NOTHING


def _listed(part: Any) -> Any:
    return list(part) if hasattr(part, "__next__") else part


@functools.cache
def _folders() -> tuple[Path, ...]:
    names = {sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")}
    with suppress(AttributeError):
        names |= {*site.getsitepackages(), site.getusersitepackages()}
    return tuple(Path(name).resolve() for name in names if name)


@functools.cache
def _library(file: str | None) -> bool:
    """Whether a file belongs to what is installed, not to the user."""
    return file is not None and any(Path(file).resolve().is_relative_to(folder) for folder in _folders())


def _installed(module: str | None) -> bool:
    """Whether a module is of the standard library, of an installed package or of this one."""
    if module is None:
        return False
    top = module.partition(".")[0]
    if top in ("filippov", "builtins") or top in sys.builtin_module_names:
        return True
    found = sys.modules.get(module)
    file = getattr(found, "__file__", None) or getattr(_spec(module), "origin", None)
    return file == "frozen" or _library(file)


def _spec(module: str) -> Any:
    """Where a module comes from, None where that is not known."""
    with suppress(ImportError, ValueError, AttributeError):
        found = getattr(sys.modules.get(module), "__spec__", None)
        return found or importlib.util.find_spec(module)
    return None


@functools.cache
def _version(module: str) -> str:
    """The version of an installed package, and the digest of the module's file: not all raise the former."""
    top = module.partition(".")[0]
    if top in sys.stdlib_module_names or top == "filippov":
        return ""  # those of Python and of this package stand beside
    version = getattr(sys.modules.get(top), "__version__", None)
    file = getattr(sys.modules.get(module), "__file__", None)
    text = b""
    if file is not None and file.endswith(".py") and Path(file).is_file():
        text = Path(file).read_bytes()
    return f"{version} {hashlib.sha256(text).hexdigest()}"
