"""Compile a system's units and keep their object code in a per-user cache folder.

A unit is one LLVM module. The unit of a system holds its field, guards and resets, its tables, and its sizes
and the layout of its records (SHAPE). The event loop with the stages of a method reads these at run time, so
that the units of its parts (`parts`) serve all systems and are linked with each. Lanes have a unit of their
own; what they leave to the plain loop goes to one compiled for the system, which takes 0.73 of the time
and a second and a half to make, or to the one that serves all (`own_loop`). A file is named by a digest of
the sources and constants, of the version of llvmlite and of the processor, so that stale code is never found;
`cache` says which files are trusted.
"""

import ast
import gc
import hashlib
import platform
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, cast

from filippov.kernel.codegen import cache as kept
from filippov.kernel.codegen import interpreted
from filippov.kernel.codegen.entries import IN_LANES, OF_SYSTEM, PLAIN, ordered, prototype
from filippov.kernel.codegen.method import method_constants, method_source
from filippov.kernel.codegen.parts import FILES, Part, asked_for, linked, missing, of_others
from filippov.kernel.files import all_files, kernel_file
from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.records import Struct, address_of
from filippov.kernel.language.unit import Constant, Unit, add_kernels, heads, parsed
from filippov.kernel.loop.rules import MOMENTS
from filippov.kernel.loop.state import STRUCTS, Entries, Integers, Scratch, Sizes
from filippov.kernel.tables import codes, layout, radau_tables
from filippov.kernel.tables import root_tables as tables
from filippov.kernel.tables.layout import LANES, MOST_LANES
from filippov.kernel.tables.tableaus import TABLEAUS, Collocation, Series

# A unit of lanes widens plain kernels, and calls those of another unit by their addresses.
_LANE_FILES = (*FILES, "lane_functions", "lane_field", "lane_series", "lane_step", "lane_slot", "lane_run")
# What the loop calls in a system's unit: the kernels written for the system. Then what it calls in lanes (see
# `points`).
_OF_SYSTEM = ("rhs", "pair", "guards", "gradients", "radii", "resets", "derive")
# The rest are small loops over states and surfaces, which are unrolled where their numbers are known.
_OF_SERIES = (
    "jets", "series_end", "series_step", "series_converges", "take_jets", "error_norm", "series_clear",
    "guard_state", "carry_on",
)  # fmt: skip
_OF_WIDE_SERIES = ("look_beside",)
_OF_SYSTEM_IN_LANES = ("pair", "guards", "gradients", "radii")
# The constants for which a loop is compiled; it reads the others at run time.
_MADE_FOR = ("WIDE",)
_lock = threading.Lock()
# Units by the arguments of `build`: computing the digest that names a file takes longer than a short run.
_units: dict[tuple[Any, ...], "Compiled"] = {}


@dataclass(frozen=True)
class Compiled:
    """The machine code of one system with one method: entry points called with addresses, and their records.

    records: by name, with their lengths for this system
    plain: the kernels run under Python and are called with arrays and records (see `interpreted`).
    """

    functions: Mapping[str, Any]
    addresses: Mapping[str, int]
    sizes: Sizes
    records: Mapping[str, type[Struct]]
    engine: object
    lanes: int = 1

    @property
    def plain(self) -> bool:
        """Whether Python runs the kernels."""
        return self.engine is None

    def scratch(self) -> Scratch:
        """Scratch space, filled with zeros."""
        return cast(Scratch, self.records["Scratch"].new())

    def integers(self) -> Integers:
        """Scratch space for integers."""
        return cast(Integers, self.records["Integers"].new())

    def arguments(self, name: str, values: Mapping[str, Any]) -> list[Any]:
        """The arguments of an entry point, from values by name."""
        return ordered(name, values, None if self.plain else address_of)


@cache
def generation() -> bytes:
    """A digest of the loop's and its generator's sources: where it differs, units are compiled anew."""
    parts = [path.read_bytes() for path in all_files()]
    return hashlib.sha256(b"\0".join(hashlib.sha256(part).digest() for part in parts)).digest()


@cache
def _toolchain() -> bytes:
    """All that a unit depends on besides the system."""
    from llvmlite import __version__, binding

    parts = [generation(), __version__.encode(), platform.machine().encode()]
    parts += [binding.get_host_cpu_name().encode(), binding.get_host_cpu_features().flatten().encode()]
    return b"\0".join(hashlib.sha256(part).digest() for part in parts)


@cache
def widest() -> int:
    """The number of lanes for this processor: 16 where it has vectors of 8 numbers (AVX-512), else 8."""
    from llvmlite import binding

    return MOST_LANES if binding.get_host_cpu_features().get("avx512f", False) else LANES


@cache
def _shared() -> tuple[dict[str, Constant], tuple[str, ...]]:
    """Constants and texts that are the same in every unit."""
    constants: dict[str, Constant] = {"NAN": float("nan"), "INF": float("inf")}
    for module in (codes, tables, radau_tables, layout):
        constants |= {
            name: value
            for name, value in vars(module).items()
            if name.isupper() and isinstance(value, int | float | list)
        }
    texts = []
    for name in _LANE_FILES:
        text = kernel_file(name).read_text(encoding="utf-8")
        texts.append(text)
        for node in parsed(text).body:
            if isinstance(node, ast.Assign):
                names = node.targets[0].elts if isinstance(node.targets[0], ast.Tuple) else node.targets
                values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
                for target, value in zip(names, values, strict=True):
                    number = _number(value)
                    if not isinstance(target, ast.Name) or number is None:
                        continue
                    if constants.setdefault(target.id, number) != number:
                        raise KernelError(f"{name}: the constant {target.id} has another value elsewhere")
    return constants, tuple(texts)


def _number(node: ast.expr) -> int | float | bool | None:
    """A number that stands in a source text, with its sign."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = _number(node.operand)
        return None if inner is None else -inner
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return node.value
    return None


def _unit(source: str, constants: Mapping[str, Constant], method: str, sizes: Sizes, lanes: int = 1) -> Unit:
    """A unit with all kernels that a system may have, none of them compiled."""
    tableau = TABLEAUS[method]
    shared, texts = _shared()
    files = ("system", "method", *(f"{name}.py" for name in _LANE_FILES))
    unit = Unit(width=max(lanes, LANES), records=_sized(sizes))
    numbers = {**shared, "LANES": unit.width, "SIDE": sizes.side, **method_constants(tableau), **constants}
    unit.constants.update(numbers | {"VECTORS": unit.width})
    for file, text in zip(files, (source, method_source(tableau), *texts), strict=True):
        add_kernels(unit, text, file)
    return unit


def _tables(constants: Mapping[str, Constant]) -> dict[str, Sequence[float]]:
    """The tables among a system's constants, which the loop reads."""
    return {k: v for k, v in constants.items() if isinstance(v, list)}


def _shape(constants: Mapping[str, Constant], sizes: Sizes) -> dict[str, int]:
    """The numbers that the loop reads: sizes of the system, its features, offsets in its records."""
    found = {k: int(v) for k, v in constants.items() if isinstance(v, int) and k not in _MADE_FOR}
    found["SIDE"] = sizes.side
    for name, record in _sized(sizes).items():
        if record.varies:
            found |= {f"{name}.{word}": place.offset for word, place in record.places.items() if place.varies}
            found[name] = record.size
    return dict(sorted(found.items()))


def _interface(constants: Mapping[str, Constant], method: str) -> tuple[str, ...]:
    if not isinstance(TABLEAUS[method], Series):
        return _OF_SYSTEM
    return (*_OF_SYSTEM, *_OF_SERIES, *(_OF_WIDE_SERIES if constants["WIDE"] else ()))


def _compile_loop(
    source: str, constants: Mapping[str, Constant], method: str, sizes: Sizes, part: Part
) -> bytes:  # fmt: skip
    own = _interface(constants, method)
    # No kernel of this system may enter a unit that other systems will use.
    unit = _unit(heads(source, own), constants, method, sizes)
    unit.foreign, unit.foreign_lanes = of_others(part).union(own), frozenset(_OF_SYSTEM_IN_LANES)
    unit.outside = frozenset((*_tables(constants), "SHAPE"))
    unit.shape = {name: place for place, name in enumerate(_shape(constants, sizes))}
    return compile_unit(unit, {}, tuple(dict.fromkeys((*part.offers, *part.entries))))


def _compile_whole(
    source: str, constants: Mapping[str, Constant], method: str, sizes: Sizes, lanes: int,
    exported: tuple[str, ...],
) -> bytes:  # fmt: skip
    return compile_unit(_unit(source, constants, method, sizes, lanes), {}, exported)


def _compile_system(source: str, constants: Mapping[str, Constant], method: str, sizes: Sizes) -> bytes:
    unit, own = _unit(source, constants, method, sizes), _interface(constants, method)
    in_lanes = _OF_SYSTEM_IN_LANES if constants["WIDE"] else ()
    given = _tables(constants) | {"SHAPE": list(_shape(constants, sizes).values())}
    return compile_unit(unit, {}, own, in_lanes, given, missing(constants))


def build(
    source: str, constants: Mapping[str, Constant], method: str, lanes: int = 1, own_loop: bool = False
) -> Compiled:
    """The compiled unit of a system: its kernel source, its constants (N, M, ROLE ...) and a method.

    lanes     trajectories side by side: 1, 8 or 16
    own_loop  beside lanes, a plain loop compiled for the system
    """
    plain = interpreted.current() == "python" and lanes == 1
    asked = source, method, lanes, own_loop, plain, tuple((k, _fixed(v)) for k, v in constants.items())
    if asked not in _units:
        with _lock:
            if asked not in _units:
                _units[asked] = (
                    _plain(source, constants, method)
                    if plain
                    else _built(source, constants, method, lanes, own_loop)
                )
    return _units[asked]


def _plain(source: str, constants: Mapping[str, Constant], method: str) -> Compiled:
    sizes, tableau = _sizes(constants, method), TABLEAUS[method]
    records = _sized(sizes)
    texts = {"system": source, "method": method_source(tableau)}
    files = tuple(kernel_file(name) for name in FILES)
    # Python has no lanes: the points of a sample are evaluated one after the other.
    numbers = {**_shared()[0], "SIDE": sizes.side, **method_constants(tableau), **constants}
    numbers |= {"WIDE": False, "VECTORS": 1}
    entries = tuple(name for name in PLAIN if name not in Entries.places and name != "ensemble")
    return Compiled(interpreted.interpret(texts, files, numbers, entries, records), {}, sizes, records, None)


def _fixed(value: Constant) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _sizes(constants: Mapping[str, Constant], method: str) -> Sizes:
    n, m, points, band = (int(constants[q]) for q in ("N", "M", "P", "BAND"))  # type: ignore[arg-type]
    colours, largest = int(constants["COLOURS"]), int(constants["LARGEST"])  # type: ignore[arg-type]
    tableau, room = TABLEAUS[method], int(constants.get("JET_ROOM", 0))  # type: ignore[arg-type]
    return Sizes(
        n, m, bool(constants["AFFINE"]), colours, largest, constants["RULE"] == MOMENTS,
        points if constants["WIDE"] else None, tableau.stages, len(tableau.extra), len(tableau.dense[0]),
        isinstance(tableau, Collocation), isinstance(tableau, Series), room,
        bool(constants["ROOTS"]), band,
    )  # fmt: skip


def _sized(sizes: Sizes) -> dict[str, type[Struct]]:
    """The records with their lengths, by name."""
    return {record.__name__: record.sized(sizes) for record in STRUCTS}


def _built(
    source: str, constants: Mapping[str, Constant], method: str, lanes: int, own_loop: bool
) -> Compiled:  # fmt: skip
    sizes = _sizes(constants, method)
    everything = source, sorted(constants.items()), method

    def whole(what: object, width: int, names: tuple[str, ...]) -> bytes:
        make = partial(_compile_whole, source, constants, method, sizes, width, names)
        return kept_code((*everything, what), make)

    tables = _tables(constants)
    kinds = [(name, any(isinstance(v, float) for v in values)) for name, values in sorted(tables.items())]
    shape = sorted(_shape(constants, sizes))
    made_for = sorted((k, v) for k, v in constants.items() if k not in tables and k not in shape)

    def codes_of(parts: Sequence[Part]) -> list[bytes]:
        system = kept_code((*everything, 1), lambda: _compile_system(source, constants, method, sizes))
        return [system] + [
            kept_code(
                (made_for, shape, kinds, method, part.files),
                partial(_compile_loop, source, constants, method, sizes, part),
            )
            for part in parts
        ]

    def ask(name: str) -> tuple[Any, object]:
        part = asked_for(name)
        if part is None:
            raise KeyError(name)
        with _lock:
            functions, _, engine = _entered(codes_of((*parts, part)), (name,))
        return functions[name], engine

    parts = linked(constants)
    if lanes > 1:
        beside = tuple(Entries.places)
        # The loop beside the lanes is compiled for one trajectory, with its own vector width.
        used = (*parts, *filter(None, [asked_for("launch")]))
        loop = [whole("alone", 1, beside)] if own_loop else codes_of(used)
        codes = [whole(lanes, lanes, IN_LANES), *loop]
        functions, addresses, engine = _entered(codes, (*IN_LANES, *beside))
        return Compiled(functions, addresses, sizes, _sized(sizes), engine, lanes)
    names = [*OF_SYSTEM, *(name for part in parts for name in part.entries)]
    functions, addresses, engine = _entered(codes_of(parts), names)
    return Compiled(_Asked(functions, ask), addresses, sizes, _sized(sizes), engine)


class _Asked(dict[str, Any]):
    """Entry points by name; parts that few runs call are linked at the first call."""

    def __init__(self, known: Mapping[str, Any], ask: Callable[[str], tuple[Any, object]]) -> None:
        super().__init__(known)
        self.ask, self.engines = ask, list[object]()

    def __missing__(self, name: str) -> Any:
        function, engine = self.ask(name)
        self.engines.append(engine)
        self[name] = function
        return function


def _entered(codes: Sequence[bytes], names: Sequence[str]) -> tuple[dict[str, Any], dict[str, int], object]:
    """Entry points as functions and their addresses, and the engine that holds them."""
    engine = load_objects(*codes)
    addresses = {name: engine.get_function_address(name) for name in names}
    return {name: prototype(name)(address) for name, address in addresses.items()}, addresses, engine


def kept_code(what: tuple[Any, ...], make: Callable[[], bytes], sources: bytes = b"") -> bytes:
    """Object code from the cache, compiled where it is missing; sources: those that are not the loop's."""
    name = hashlib.sha256(_toolchain() + sources + repr(what).encode()).hexdigest()[:32]
    code = kept.read(name)
    if code is None:
        with _uncollected():
            code = make()
        kept.write(name, code)
    return code


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without the cyclic garbage collector, which would traverse growing trees and modules in vain."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
