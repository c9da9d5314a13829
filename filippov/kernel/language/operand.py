"""Operands of the kernel language as LLVM values: numbers, masks and arrays, single or in lanes."""

import ast
from collections.abc import Sequence

from llvmlite import binding, ir

from filippov.kernel.language.pointer import StructPointer, spelt
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.records import Place
from filippov.kernel.language.unit import (
    BIT,
    DOUBLE,
    INDICES,
    LONG,
    VECTOR,
    Constant,
    Kernel,
    Unit,
)

# Whether LLVM has typed pointers, as it had until version 17.
_TYPED = binding.llvm_version_info[0] < 17


class _Seen(ir.Value):
    """An address as one of another type."""

    def __init__(self, of: ir.Value, kind: ir.Type) -> None:
        self.of, self.type = of, kind

    def get_reference(self) -> str:
        """How instructions name it."""
        return str(self.of.get_reference())


class Operands:
    """Conversions between operands, and the functions on them, in the kernel that is being translated."""

    def __init__(self, unit: Unit, kernel: Kernel) -> None:
        self.unit, self.kernel = unit, kernel
        self.wide, self.wide_long, self.wide_bit = unit.wide, unit.wide_long, unit.wide_bit
        self.entry = ir.IRBuilder(kernel.function.append_basic_block("entry"))
        self.b = ir.IRBuilder(kernel.function.append_basic_block("body"))
        # Numbers of the shape read in this block.
        self.here, self.lengths = self.b.block, dict[str, ir.Value]()

    def fail(self, node: ast.AST, why: str) -> KernelError:
        """The error to raise for a node of the syntax tree."""
        name = self.kernel.node.name
        file = self.unit.files.get(name, "kernels")
        return KernelError(f"{file}:{getattr(node, 'lineno', '?')}: kernel {name}: {why}")

    def seen(self, at: ir.Value, kind: ir.Type) -> ir.Value:
        """An address as one of another type."""
        return self.b.bitcast(at, kind) if _TYPED else _Seen(at, kind)

    def double(self, value: ir.Value) -> ir.Value:
        """A value as a double."""
        if value.type == LONG:
            return self.b.sitofp(value, DOUBLE)
        if value.type == BIT:
            return self.b.uitofp(value, DOUBLE)
        if value.type == self.wide_long:
            return self.b.sitofp(value, self.wide)
        if value.type == self.wide_bit:
            return self.b.uitofp(value, self.wide)
        return value

    def splat(self, value: ir.Value) -> ir.Value:
        """The same number in every lane."""
        kind = ir.VectorType(value.type, self.unit.width)
        if isinstance(value, ir.Constant):
            return ir.Constant(kind, [value.constant] * self.unit.width)
        whole = self.b.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(LONG, 0))
        places = ir.Constant(ir.VectorType(ir.IntType(32), self.unit.width), [0] * self.unit.width)
        return self.b.shuffle_vector(whole, ir.Constant(kind, ir.Undefined), places)

    def alike(self, left: ir.Value, right: ir.Value) -> tuple[ir.Value, ir.Value]:
        """Both as lanes if one of them is, both as doubles if one of them is."""
        kinds = (DOUBLE, self.wide)
        if (left.type in kinds) != (right.type in kinds):
            left, right = self.double(left), self.double(right)
        wide = [isinstance(value.type, ir.VectorType) for value in (left, right)]
        if wide[0] and not wide[1]:
            right = self.splat(right)
        elif wide[1] and not wide[0]:
            left = self.splat(left)
        return left, right

    def bit(self, value: ir.Value) -> ir.Value:
        """A value as a condition: whether it differs from 0."""
        if value.type in (BIT, self.wide_bit):
            return value
        if value.type == LONG:
            return self.b.icmp_signed("!=", value, ir.Constant(LONG, 0))
        return self.b.fcmp_unordered("!=", value, ir.Constant(DOUBLE, 0.0))

    def cast(self, value: ir.Value, kind: ir.Type, node: ast.AST) -> ir.Value:
        """A value converted to another type. Raises KernelError where that is impossible."""
        if value.type == kind:
            return value
        if kind == DOUBLE:
            return self.double(value)
        if kind == LONG and value.type == BIT:
            return self.b.zext(value, LONG)
        if kind == self.unit.wide_vector and value.type == VECTOR:
            return self.seen(value, self.unit.wide_vector)
        lanes = isinstance(value.type, StructPointer) and value.type.stride == self.unit.width
        if lanes and kind == self.unit.record(value.type.of, True):
            return self.seen(value, kind)
        if kind == self.wide and value.type in (DOUBLE, LONG):
            return self.splat(self.double(value))
        if kind == self.wide_bit and value.type == BIT:
            return self.splat(value)
        raise self.fail(node, f"a {spelt(value.type)} where a {spelt(kind)} is needed")

    def word(self, base: ir.Value, name: str) -> ir.Value:
        """The address of the first word of a record's member, typed as its element."""
        record: StructPointer = base.type
        offset = self.length(f"{record.of.__name__}.{name}", record.of.places[name].offset)
        at = self.moved(base, self.times(offset, record.stride))
        return self.seen(at, self.unit.address(record.pointee))

    def moved(self, base: ir.Value, words: ir.Value) -> ir.Value:
        """An address moved by a number of words of a record."""
        if isinstance(words, ir.Constant) and words.constant == 0:
            return base
        return self.b.gep(base, [words], inbounds=True, source_etype=base.type.pointee)

    def length(self, name: str, value: int) -> ir.Value:
        """A length, either a constant of the unit or read from the table of the shape."""
        if name not in self.unit.shape:
            return ir.Constant(LONG, value)
        if self.here is not self.b.block:
            self.here, self.lengths = self.b.block, {}
        if name not in self.lengths:
            self.lengths[name] = self.unit.length(self.b, name)
        return self.lengths[name]

    def times(self, value: ir.Value, factor: int) -> ir.Value:
        """A length times a number."""
        if isinstance(value, ir.Constant):
            return ir.Constant(LONG, value.constant * factor)
        return value if factor == 1 else self.b.mul(value, ir.Constant(LONG, factor))

    def row(self, base: ir.Value, number: ir.Value) -> ir.Value:
        """The address of a row, as rows."""
        rows: StructPointer = base.type
        size = self.times(self.length(rows.of.__name__, rows.of.size), rows.stride)
        return self.moved(base, self.b.mul(number, size))

    def one_of(self, rows: StructPointer) -> StructPointer:
        """The type of one record of rows."""
        return StructPointer(rows.of, rows.pointee, rows.stride)

    def referred(self, place: Place) -> ir.Type:
        """The type of a reference's target."""
        if place.of is not None:
            return self.unit.record(self.unit.records[place.of.__name__], self.kernel.wide, place.kind)
        return INDICES if place.kind == "Indices" else self.unit.wide_vector if self.kernel.wide else VECTOR

    def member(self, base: ir.Value, name: str, node: ast.AST) -> ir.Value:
        """The address of a record's member, or, of a reference, the address stored in it.

        A number gives a pointer to it, any other member the array or record itself.
        """
        record = base.type
        if not isinstance(record, StructPointer) or record.rows:
            raise self.fail(node, f"a {spelt(record)} has no names")
        place = record.of.places.get(name)
        if place is None:
            known = ", ".join(record.of.places)
            raise self.fail(node, f"record {record.of.__name__} has no {name}; it has {known}")
        at = self.word(base, name)
        if place.elsewhere:
            return self.b.load(self.seen(at, self.unit.address(self.referred(place))))
        if place.of is not None:
            return self.seen(at, StructPointer(place.of, record.pointee, record.stride, place.kind == "Rows"))
        return self.seen(at, INDICES) if place.kind in ("int", "Indices") else at

    def constant(self, value: Constant, name: str) -> ir.Value:
        """A constant of the unit as a value, a list as the address of its numbers."""
        if name in self.unit.shape:
            number = self.length(name, 0)
            return self.bit(number) if isinstance(value, bool) else number
        if isinstance(value, bool):
            return ir.Constant(BIT, int(value))
        if isinstance(value, int):
            return ir.Constant(LONG, value)
        if isinstance(value, float):
            return ir.Constant(DOUBLE, value)
        return self.unit.table(name, value)

    def intrinsic(self, name: str, values: Sequence[ir.Value]) -> ir.Value:
        """A function of LLVM's own, such as llvm.sqrt, on doubles."""
        if any(value.type == self.wide for value in values):
            values = [value if value.type == self.wide else self.splat(value) for value in values]
        of = values[0].type
        suffix = f"v{self.unit.width}f64" if of == self.wide else "f64"
        kind = ir.FunctionType(of, [of] * len(values))
        return self.b.call(self.unit.intrinsic(name, kind, suffix), values)

    def choose(self, values: Sequence[ir.Value], sign: str) -> ir.Value:
        """The least (sign "<") or greatest (">") of values."""
        whole = all(value.type in (LONG, self.wide_long) for value in values)
        best = values[0] if whole else self.double(values[0])
        for given in values[1:]:
            best, value = self.alike(best, given if whole else self.double(given))
            # Written so that min and max with a NaN agree with Python's: the first operand is kept.
            test = self.b.icmp_signed(sign, value, best) if whole else self.b.fcmp_ordered(sign, value, best)
            best = self.b.select(test, value, best)
        return best

    def each(self, name: str, values: Sequence[ir.Value]) -> ir.Value:
        """A function of the C library, lane by lane."""
        function = self.unit.external(name, len(values))
        values = [value if value.type == self.wide else self.splat(self.double(value)) for value in values]
        result: ir.Value = ir.Constant(self.wide, ir.Undefined)
        for lane in range(self.unit.width):
            place = ir.Constant(LONG, lane)
            one = self.b.call(function, [self.b.extract_element(value, place) for value in values])
            result = self.b.insert_element(result, one, place)
        return result

    def ask(self, name: str, mask: ir.Value) -> ir.Value:
        """A mask reduced to one condition, or as the bits of an integer."""
        kind = ir.IntType(self.unit.width)
        bits = self.b.bitcast(self.splat(mask) if mask.type == BIT else mask, kind)
        if name == "mask_bits":
            return self.b.zext(bits, LONG)
        if name == "anywhere":
            return self.b.icmp_unsigned("!=", bits, ir.Constant(kind, 0))
        return self.b.icmp_unsigned("==", bits, ir.Constant(kind, 2**self.unit.width - 1))
