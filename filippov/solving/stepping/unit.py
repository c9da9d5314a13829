"""The compiled steps of a system: its generated field and the kernels of this package, kept in the cache."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from filippov.kernel.codegen import interpreted
from filippov.kernel.codegen.build import generation, kept_code
from filippov.kernel.codegen.generate import generate
from filippov.kernel.codegen.generated import Generated
from filippov.kernel.files import kernel_file
from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.records import address_of
from filippov.kernel.language.unit import Constant, Unit, add_kernels
from filippov.kernel.tables import root_tables
from filippov.model.system import System

_OWN = ("box_kernels", "step_kernels")
_SHARED = ("elementary", "dense_lu")
# Arguments of the entry points: d a double, i an integer, v an array of doubles, k one of integers.
_ARGUMENTS = {"march": "iiddd" + "v" * 11 + "kk", "derive": "v", "guards": "dvvvvk", "gradients": "dvvvvvk"}
# What the steps take of the unit of a system: kernels and tables.
_FOREIGN = ("rhs", "guards", "gradients", "radii", "resets", "derive")
_TABLES = ("COLOUR", "OWNER", "ROLE", "CONTACT", "SIZES")
_KINDS: dict[str, Any] = {"d": ctypes.c_double, "i": ctypes.c_int64}
_KINDS |= dict.fromkeys("vk", ctypes.c_void_p)
_made: dict[tuple[str, bool], Steps] = {}


@dataclass(frozen=True)
class Steps:
    """The entry points `march`, `derive`, `guards`, `gradients` of one system; engine holds their code."""

    functions: Mapping[str, Callable[..., int]]
    engine: Any

    def __call__(self, name: str, *values: Any) -> int:
        """Call an entry point with numbers and arrays."""
        given = values
        if self.engine is not None:
            given = tuple(address_of(v) if isinstance(v, np.ndarray) else v for v in values)
        return int(self.functions[name](*given))


def generated(system: System) -> Generated:
    """The kernel source of a system of expressions, which the loop of events shares."""
    key = generation(), False
    if key not in system.units:
        assert system.symbolic is not None
        system.units[key] = generate(system.symbolic, system.surfaces, False)
    unit: Generated = system.units[key]
    return unit


def steps(system: System) -> Steps:
    """The compiled steps of a system; run by Python where that is the backend."""
    unit, plain = generated(system), interpreted.current() == "python"
    key = unit.source, plain
    if key not in _made:
        _made[key] = _plain(unit) if plain else _compiled(unit)
    return _made[key]


def _files() -> list[Path]:
    here = Path(__file__).parent
    return [*map(kernel_file, _SHARED), *(here / f"{name}.py" for name in _OWN)]


@cache
def _constants() -> dict[str, Constant]:
    """Numbers and tables by the names that the kernels give them."""
    from filippov.solving.stepping import box_kernels, step_kernels

    found: dict[str, Constant] = {"NAN": float("nan"), "INF": float("inf")}
    modules = [box_kernels, step_kernels, root_tables]
    from filippov.kernel.loop import elementary

    for module in (*modules, elementary):
        for name, value in vars(module).items():
            if name.isupper() and isinstance(value, int | float | list):
                found.setdefault(name, value)
    return found


@cache
def _sources() -> bytes:
    return b"\0".join(path.read_bytes() for path in _files())


def _numbers(unit: Generated) -> dict[str, Any]:
    """All constants: those of the language, of these kernels, and of the system."""
    sizes = [unit.constants[name] for name in ("N", "M", "COLOURS")]
    return {**_constants(), **unit.constants, "SIZES": sizes}


def _compiled(generated_unit: Generated) -> Steps:
    engine = load_objects(_steps_code(), _system_code(generated_unit))
    functions = {}
    for entry, text in _ARGUMENTS.items():
        kind = ctypes.CFUNCTYPE(ctypes.c_int64, *[_KINDS[c] for c in text])
        functions[entry] = kind(engine.get_function_address(entry))
    return Steps(functions, engine)


def _steps_code() -> bytes:
    """The kernels of this package, which are the same for every system."""
    def make() -> bytes:
        unit = Unit(foreign=frozenset(_FOREIGN), outside=frozenset(_TABLES))
        unit.constants.update(_constants() | {name: [0] for name in _TABLES})
        for path in (kernel_file("model"), *_files()):
            add_kernels(unit, path.read_text(encoding="utf-8"), path.name)
        return compile_unit(unit, {}, ("march",))

    return kept_code(("steps",), make, _sources())


def _system_code(generated_unit: Generated) -> bytes:
    def make() -> bytes:
        unit, numbers = Unit(), _numbers(generated_unit)
        unit.constants.update(numbers)
        add_kernels(unit, generated_unit.source, "system")
        add_kernels(unit, kernel_file("elementary").read_text(encoding="utf-8"), "elementary.py")
        return compile_unit(unit, {}, _FOREIGN, given={name: numbers[name] for name in _TABLES})

    what = "stepped system", generated_unit.source, sorted(generated_unit.constants.items())
    return kept_code(what, make, _sources())


def _plain(generated_unit: Generated) -> Steps:
    numbers = _numbers(generated_unit)
    texts = {"system": generated_unit.source}
    return Steps(interpreted.interpret(texts, tuple(_files()), numbers, tuple(_ARGUMENTS)), None)
