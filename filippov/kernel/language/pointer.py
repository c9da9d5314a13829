"""Types of values that stand for records: addresses with the type of their target."""

from __future__ import annotations

from typing import Any, Self

from llvmlite import ir

from filippov.kernel.language.records import Struct

_Typed: Any = type(ir.DoubleType().as_pointer())


class StructPointer(_Typed):
    """The address of a record (rows: of the first of several).

    element  the type of its members: a double, or a vector with one for each lane
    stride   words from one member to the next: the number of lanes where a plain kernel reads lanes
    """

    def __init__(self, of: type[Struct], element: ir.Type, stride: int = 1, rows: bool = False) -> None:
        super().__init__(element)
        self.of, self.stride, self.rows = of, stride, rows

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """As any object; the constructor of llvmlite inspects the element."""
        return object.__new__(cls)

    @property
    def label(self) -> str:
        """The type as it is written."""
        shape = f"Rows[{self.of.__name__}]" if self.rows else self.of.__name__
        return shape if self.stride == 1 else f"Lanes[{shape}]"

    def _key(self) -> tuple[Any, ...]:
        return self.of.__name__, str(self.pointee), self.stride, self.rows

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StructPointer) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())


def spelt(kind: ir.Type) -> str:
    """A type as it is written in a kernel, if it has a name there."""
    names = {"double": "float", "i64": "int", "i1": "bool"}
    if isinstance(kind, StructPointer):
        return kind.label
    if isinstance(kind, _Typed):
        return {"i64": "Indices"}.get(str(kind.pointee), "Vector")
    return names.get(str(kind), str(kind))
