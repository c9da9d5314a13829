"""An LLVM module in the making: its kernels as syntax trees and functions, and the constants they share."""

import ast
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from weakref import WeakKeyDictionary

from llvmlite import ir

from filippov.kernel.language.pointer import StructPointer
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.records import Struct
from filippov.kernel.language.strict import check_kernel
from filippov.kernel.tables.layout import LANES

DOUBLE, LONG, BIT, VOID = ir.DoubleType(), ir.IntType(64), ir.IntType(1), ir.VoidType()
VECTOR, INDICES = DOUBLE.as_pointer(), LONG.as_pointer()
_ANNOTATED = {"float": DOUBLE, "int": LONG, "bool": BIT, "Vector": VECTOR, "Indices": INDICES}
_ANNOTATED["Shared"] = VECTOR

Constant = int | float | bool | list[float] | list[int]

_MARKS = {"lanes", "kernel", "contract"}
# Longer texts belong to one system: their trees are not kept.
_LONG = 100_000
# The names bound several times in kernels that have been checked.
_checked: WeakKeyDictionary[ast.FunctionDef, frozenset[str]] = WeakKeyDictionary()


@dataclass
class Kernel:
    """A parsed kernel with its LLVM function, and the names bound several times in it."""

    node: ast.FunctionDef
    function: ir.Function
    flags: tuple[str, ...]
    changing: frozenset[str]
    wide: bool = False


@dataclass
class Unit:
    """One LLVM module: its source texts by the names of their kernels, and the constants they share.

    A kernel is checked and declared at its first use, and translated later. `width` is the number of lanes;
    `wide`, `wide_vector` ... are the types of a number and an array of numbers in a lane kernel. addresses,
    referred: types made so far; places: of numbers of the shape.
    records: the records by name, with their lengths. foreign, foreign_lanes: kernels, plain
    and in lanes, that another unit holds, with which this one is linked; outside: constants that it holds;
    shape: numbers that are read there, by name, with their places in the table SHAPE.
    """

    constants: dict[str, Constant] = field(default_factory=dict)
    texts: dict[str, ast.FunctionDef] = field(default_factory=dict)
    lane_texts: dict[str, ast.FunctionDef] = field(default_factory=dict)
    kernels: dict[str, Kernel] = field(default_factory=dict)
    lanes: dict[str, Kernel] = field(default_factory=dict)
    waiting: list[Kernel] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    tables: dict[str, ir.GlobalVariable] = field(default_factory=dict)
    addresses: dict[ir.Type, ir.Type] = field(default_factory=dict)
    referred: dict[tuple[type[Struct], bool, str], StructPointer] = field(default_factory=dict)
    places: dict[str, ir.Constant] = field(default_factory=dict)
    records: Mapping[str, type[Struct]] = field(default_factory=dict)
    module: ir.Module = field(default_factory=lambda: ir.Module("filippov"))
    width: int = LANES
    foreign: frozenset[str] = frozenset()
    foreign_lanes: frozenset[str] = frozenset()
    outside: frozenset[str] = frozenset()
    shape: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.constants["LANES"] = self.width
        self.wide = ir.VectorType(DOUBLE, self.width)
        self.wide_long, self.wide_bit = ir.VectorType(LONG, self.width), ir.VectorType(BIT, self.width)
        self.wide_vector = self.wide.as_pointer()
        self.in_lanes = {
            "float": self.wide, "int": LONG, "bool": self.wide_bit, "Vector": self.wide_vector,
            "Indices": INDICES, "Shared": VECTOR,
        }  # fmt: skip

    @cached_property
    def fixed(self) -> Mapping[str, Constant]:
        """The constants shared by every system with this unit."""
        read = self.outside | self.shape.keys()
        return {name: value for name, value in self.constants.items() if name not in read}

    def external(self, name: str, count: int) -> ir.Function:
        """A function of the C library on doubles."""
        known = self.module.globals.get(name)
        if isinstance(known, ir.Function):
            return known
        return ir.Function(self.module, ir.FunctionType(DOUBLE, [DOUBLE] * count), name)

    def intrinsic(self, name: str, kind: ir.FunctionType, suffix: str) -> ir.Function:
        """An intrinsic function of LLVM."""
        full = f"{name}.{suffix}"
        known = self.module.globals.get(full)
        return known if isinstance(known, ir.Function) else ir.Function(self.module, kind, full)

    def table(self, name: str, values: Sequence[float]) -> ir.Constant:
        """The address of a constant's numbers, in the unit that holds them."""
        if name not in self.tables:
            kind = DOUBLE if any(isinstance(value, float) for value in values) else LONG
            here = name not in self.outside
            length = len(values) if here or name == "SHAPE" else 0
            table = ir.GlobalVariable(self.module, ir.ArrayType(kind, length), f"table_{name}")
            table.global_constant = True
            if here:
                table.initializer, table.linkage = ir.Constant(table.value_type, list(values)), "internal"
            self.tables[name] = table
        zero = ir.Constant(LONG, 0)
        return self.tables[name].gep([zero, zero])

    def length(self, builder: ir.IRBuilder, name: str) -> ir.Value:
        """A number of the shape, read from the unit that holds it."""
        if name not in self.places:
            self.table("SHAPE", [0] * len(self.shape))
            place = [ir.Constant(LONG, 0), ir.Constant(LONG, self.shape[name])]
            self.places[name] = self.tables["SHAPE"].gep(place)
        return builder.load(self.places[name])

    def address(self, of: ir.Type) -> ir.Type:
        """The type of the address of a value."""
        if of not in self.addresses:
            self.addresses[of] = of.as_pointer()
        return self.addresses[of]

    def annotated(self, node: ast.expr | None, where: str, wide: bool) -> ir.Type:
        """The type that an annotation stands for, in a plain kernel or in one of lanes.

        Raises KernelError for one that the language does not have.
        """
        if isinstance(node, ast.Name) and node.id in _ANNOTATED:
            return (self.in_lanes if wide else _ANNOTATED)[node.id]
        shape, inner = "Struct", node
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            shape, inner = node.value.id, node.slice
        if shape in ("Struct", "Rows", "Lanes") and isinstance(inner, ast.Name) and inner.id in self.records:
            return self.record(self.records[inner.id], wide, shape)
        known = ", ".join(("float, int, bool, Vector, Indices, Shared", *self.records))
        raise KernelError(f"{where}: annotate with {known}; or Rows or Lanes of a record")

    def record(self, of: type[Struct], wide: bool, shape: str = "Struct") -> StructPointer:
        """The type of a record, of rows or of lanes of it; one not of doubles is common to all lanes."""
        asked = of, wide, shape
        if asked not in self.referred:
            element = self.wide if wide and of.doubles else DOUBLE
            apart = shape == "Lanes" and not wide
            stride = self.width if apart else 1
            self.referred[asked] = StructPointer(of, element, stride, shape == "Rows" and not apart)
        return self.referred[asked]

    def plain(self, name: str) -> Kernel:
        """The plain kernel of this name."""
        if name not in self.kernels:
            self.kernels[name] = _declare(self, self.texts[name], wide=False)
        return self.kernels[name]

    def trap(self, name: str) -> None:
        """A kernel that ends the process when it is called, under this name."""
        self.foreign |= {name}
        builder = ir.IRBuilder(self.plain(name).function.append_basic_block())
        builder.call(self.intrinsic("llvm", ir.FunctionType(VOID, []), "trap"), [])
        builder.unreachable()

    def widened(self, name: str) -> Kernel:
        """The lane kernel of this name: as written, or the plain one widened."""
        if name not in self.lanes:
            self.lanes[name] = _declare(self, self.lane_texts.get(name) or self.texts[name], wide=True)
        return self.lanes[name]


def _result(unit: Unit, node: ast.expr | None, where: str, wide: bool) -> ir.Type:
    if node is None or (isinstance(node, ast.Constant) and node.value is None):
        return VOID
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
        return ir.LiteralStructType([unit.annotated(item, where, wide) for item in node.slice.elts])
    return unit.annotated(node, where, wide)


def marks(node: ast.FunctionDef) -> set[str]:
    """The decorators of a kernel."""
    return {mark.id for mark in node.decorator_list if isinstance(mark, ast.Name)}


def _declare(unit: Unit, node: ast.FunctionDef, wide: bool) -> Kernel:
    file = unit.files.get(node.name, "kernels")
    where = f"{file}:{node.lineno}: kernel {node.name}"
    foreign = node.name in (unit.foreign_lanes if wide else unit.foreign)
    changing = frozenset[str]() if foreign else _check(node, file)
    arguments = [unit.annotated(a.annotation, f"{where}({a.arg})", wide) for a in node.args.args]
    said, kind = marks(node), ir.FunctionType(_result(unit, node.returns, where, wide), arguments)
    function = ir.Function(unit.module, kind, f"{node.name}.lanes" if wide else node.name)
    function.attributes.add("nounwind")
    if foreign:
        return Kernel(node, function, (), changing, wide)
    function.linkage = "internal"
    if unit.lane_texts:
        # Vectors spilled to the stack must not cross cache lines.
        function.attributes.alignstack = 64
    if "apart" in said or "seldom" in said:
        function.attributes.add("noinline")
    if "seldom" in said and unit.foreign:
        function.attributes.add("optnone")
    if "inline" in said:
        function.attributes.add("alwaysinline")
    for argument, value in zip(node.args.args, function.args, strict=True):
        # Not aliased: what depends on them alone is computed once.
        pointer = value.type in (VECTOR, unit.wide_vector)
        if pointer and "contract" in said and argument.arg in ("x", "p", "m", "jet"):
            value.add_attribute("noalias")
    kernel = Kernel(node, function, ("contract",) if "contract" in said else (), changing, wide)
    unit.waiting.append(kernel)
    return kernel


def add_kernels(unit: Unit, text: str, file: str = "kernels") -> None:
    """Add every decorated function of a source text; its constants may come later.

    Raises KernelError, with the file and the line, for a name that is taken. What is outside the language
    is refused at the first use: most kernels of the loop are not part of a system's unit.
    """
    for node in _kernels_of(text):
        texts = unit.lane_texts if "lanes" in marks(node) else unit.texts
        if texts.get(node.name, node) is not node:
            raise KernelError(f"{file}:{node.lineno}: kernel {node.name}: there is another of this name")
        texts[node.name] = node
        unit.files[node.name] = file


def heads(text: str, names: Collection[str]) -> str:
    """The kernels of these names in a text without their bodies: all that units know which name them."""
    lines, kept = text.split("\n"), list[str]()
    for first, line in enumerate(lines):
        if line.startswith("def ") and line[4:].partition("(")[0] in names:
            marked = first
            while lines[marked - 1].startswith("@"):
                marked -= 1
            last = next(k for k in range(first, len(lines)) if lines[k].endswith(":"))
            kept += [*lines[marked : last + 1], "    pass"]
    return "\n".join(kept)


def _kernels_of(text: str) -> tuple[ast.FunctionDef, ...]:
    nodes = parsed(text).body if len(text) < _LONG else ast.parse(text).body
    return tuple(n for n in nodes if isinstance(n, ast.FunctionDef) and marks(n) & _MARKS)


@lru_cache(maxsize=128)
def parsed(text: str) -> ast.Module:
    """The syntax tree of a file of kernels, shared by units and never modified."""
    return ast.parse(text)


def _check(node: ast.FunctionDef, file: str) -> frozenset[str]:
    """Refuse a kernel outside the language; one used in several units is checked once."""
    if node not in _checked:
        _checked[node] = check_kernel(node, file)
    return _checked[node]
