"""An LLVM module in the making: its kernels as syntax trees and functions, and the constants they share."""

import ast
from dataclasses import dataclass, field

from llvmlite import ir

DOUBLE, LONG, BIT, VOID = ir.DoubleType(), ir.IntType(64), ir.IntType(1), ir.VoidType()
VECTOR, INDICES = DOUBLE.as_pointer(), LONG.as_pointer()
_ANNOTATED = {"float": DOUBLE, "int": LONG, "bool": BIT, "Vector": VECTOR, "Indices": INDICES}

Constant = int | float | bool | list[float] | list[int]


class KernelError(TypeError):
    """A kernel uses something outside the language."""


@dataclass
class Kernel:
    """A parsed kernel with the LLVM function that stands for it."""

    node: ast.FunctionDef
    function: ir.Function
    flags: tuple[str, ...]


@dataclass
class Unit:
    """One LLVM module: kernels by name and the constants they share."""

    constants: dict[str, Constant] = field(default_factory=dict)
    kernels: dict[str, Kernel] = field(default_factory=dict)
    tables: dict[str, ir.GlobalVariable] = field(default_factory=dict)
    module: ir.Module = field(default_factory=lambda: ir.Module("filippov"))

    def external(self, name: str, count: int) -> ir.Function:
        """A function of the C library on doubles."""
        known = self.module.globals.get(name)
        if isinstance(known, ir.Function):
            return known
        return ir.Function(self.module, ir.FunctionType(DOUBLE, [DOUBLE] * count), name)


def _annotation(node: ast.expr | None, where: str) -> ir.Type:
    if isinstance(node, ast.Name) and node.id in _ANNOTATED:
        return _ANNOTATED[node.id]
    raise KernelError(f"{where}: annotate with float, int, bool, Vector or Indices")


def _result(node: ast.expr | None, where: str) -> ir.Type:
    if node is None or (isinstance(node, ast.Constant) and node.value is None):
        return VOID
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
        return ir.LiteralStructType([_annotation(item, where) for item in node.slice.elts])
    return _annotation(node, where)


def add_kernels(unit: Unit, text: str) -> None:
    """Declare every decorated function of a source text; its constants may come later."""
    for node in ast.parse(text).body:
        if not isinstance(node, ast.FunctionDef):
            continue
        marks = {mark.id for mark in node.decorator_list if isinstance(mark, ast.Name)}
        if "kernel" not in marks and "contract" not in marks:
            continue
        arguments = [_annotation(a.annotation, f"{node.name}({a.arg})") for a in node.args.args]
        kind = ir.FunctionType(_result(node.returns, node.name), arguments)
        function = ir.Function(unit.module, kind, node.name)
        function.linkage = "internal"
        function.attributes.add("nounwind")
        if "inline" in marks:
            function.attributes.add("alwaysinline")
        for argument, value in zip(node.args.args, function.args, strict=True):
            # Parameters and modes are only read while stages are computed: no other name writes to them.
            if "contract" in marks and argument.arg in ("p", "m"):
                value.add_attribute("noalias")
        flags = ("contract",) if "contract" in marks else ()
        unit.kernels[node.name] = Kernel(node, function, flags)
