"""Records: named members of a flat array, declared once for compiled code and for Python.

A record is a class of annotated names. `float` and `int` are single numbers; `Vector`, `Indices`, `Rows[R]`
(one R behind the other) and another record stand in the record itself where `part(length)` says how long they
are, and are the addresses of arrays elsewhere where it does not. Every place is a word of 8 bytes, in the
order written.

    class Clock(Struct):            class Scratch(Struct):
        t: float                        k: Vector = part(lambda of: of.stages * of.n)
        step: float                     mult: Rows[Multiplier] = part(lambda of: of.m)

`Scratch.sized(of)` is the class whose lengths are known, `Scratch.sized(of).new()` a record in zeros.
Compiled code takes its address; Python takes the object, whose names read and write the same array.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from inspect import get_annotations
from typing import Any, ClassVar, Generic, Self, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from filippov.kernel.language.primitives import Indices, KernelError, Vector

R = TypeVar("R", bound="Struct")
_FLOAT, _WHOLE = np.dtype(np.float64), np.dtype(np.int64)
_BYTE = ctypes.c_char.from_buffer


@dataclass(frozen=True)
class Place:
    """The location of a member: its kind (of which record), first word, words, whether it is a reference.

    varies: its first word depends on the sizes
    """

    kind: str  # float, int, Vector, Indices, Rows, Struct, Lanes
    of: type[Struct] | None
    offset: int
    size: int
    elsewhere: bool
    varies: bool = False

    @cached_property
    def dtype(self) -> np.dtype[Any] | None:
        """The type of the numbers of a referenced array; None for a record or rows of it."""
        if self.kind in ("Vector", "Lanes"):
            return _FLOAT
        return _WHOLE if self.kind == "Indices" else None


@dataclass(frozen=True)
class _Part:
    length: int | Callable[[Any], int]


def part(length: int | Callable[[Any], int] = 1) -> Any:
    """An embedded array: its number of entries (of Rows: of records), a number or a function of the sizes."""
    return _Part(length)


class Rows(Generic[R]):
    """Records of one kind, one after the other."""

    def __init__(self, kind: type[R], array: npt.NDArray[Any]) -> None:
        self.kind, self.array, self._flat = kind, array, array.reshape(-1)

    def __getitem__(self, i: int) -> R:
        size = self.kind.size
        return self.kind(self._flat[i * size : (i + 1) * size])

    def column(self, name: str) -> npt.NDArray[Any]:
        """One member of every record."""
        place = self.kind.places[name]
        return self._flat.reshape(-1, self.kind.size)[:, place.offset]


class Lanes(Generic[R]):
    """Records of trajectories side by side, as a plain kernel sees them: every name is an array of doubles.

    A number is followed by that of the next lane; Rows consist of Lanes of their records.
    """

    def __getattr__(self, name: str) -> Any:
        raise RuntimeError("lanes exist in compiled code only")


def side_by_side(records: Lanes[R]) -> R:
    """The record of a lane kernel: all lanes at once (compiled code only)."""
    raise RuntimeError("lanes exist in compiled code only")


def shift_rows(rows: Rows[R], offset: int) -> Rows[R]:
    """The rows from an offset on."""
    return Rows(rows.kind, rows.array.reshape(-1)[offset * rows.kind.size :])


def all_of(record: Struct | Lanes[Any]) -> Vector:
    """The numbers of a record of doubles, one after the other."""
    return cast(Vector, record.array)


def size_of(record: Struct | Lanes[Any]) -> int:
    """How many numbers a record holds."""
    return int(record.size)


class _Declaring(type):
    """Moves the lengths out of a declaration, and lays it out where no sizes are needed."""

    def __new__(cls, name: str, bases: tuple[type, ...], space: dict[str, Any]) -> Any:
        lengths = {key: value for key, value in space.items() if isinstance(value, _Part)}
        left = {key: value for key, value in space.items() if key not in lengths}
        # Without slots, records would accept any attribute.
        made: Any = super().__new__(cls, name, bases, {"__slots__": (), "places": {}, "size": 0} | left)
        if bases and "places" not in space:
            made.lengths = lengths
            if not any(callable(value.length) for value in lengths.values()):
                _lay_out(made, made, None)
        return made


class Struct(metaclass=_Declaring):
    """A record over an array of its size; see the module. Subclasses declare, and are not initialised."""

    __slots__ = ("_floats", "_held", "_wholes", "array")
    places: ClassVar[dict[str, Place]]
    lengths: ClassVar[dict[str, _Part]]
    size: ClassVar[int]
    varies: ClassVar[bool]
    doubles: ClassVar[bool]
    array: npt.NDArray[Any]

    def __init__(self, array: npt.NDArray[Any]) -> None:
        kind = type(self)
        if not kind.places:
            raise KernelError(
                f"record {kind.__name__}: its lengths are not known; take {kind.__name__}.sized(...)"
            )
        expected = _FLOAT if kind.doubles else _WHOLE
        if array.dtype != expected or array.size != kind.size:
            said = f"an array of {array.size} {array.dtype}, expected {kind.size} of {expected}"
            raise KernelError(f"record {kind.__name__}: given {said}")
        self.array: npt.NDArray[Any] = array
        self._floats: Vector = array if kind.doubles else array.view(_FLOAT)
        self._wholes: Indices = array.view(_WHOLE) if kind.doubles else array
        self._held: dict[str, Any] = {}

    @classmethod
    def new(cls) -> Self:
        """A record in zeros."""
        return cls(np.zeros(cls.size, _FLOAT if cls.doubles else _WHOLE))

    @classmethod
    def sized(cls, sizes: Any) -> type[Self]:
        """The record with the lengths that follow from these sizes (hashable)."""
        return cast(type[Self], _sized(cls, sizes))

    def refer(self, **arrays: Any) -> None:
        """Bind references to arrays and records. Raises KernelError for one of the wrong kind."""
        places, held, words = type(self).places, self._held, self._wholes
        for name, value in arrays.items():
            place = places.get(name)
            if place is None or not place.elsewhere:
                raise KernelError(f"record {type(self).__name__} has no reference {name}")
            # The usual case first: a short run binds many.
            usual = type(value) is np.ndarray and value.dtype is place.dtype
            array = value if usual else _referred(type(self).__name__, name, place, value)
            held[name] = array.reshape(-1) if usual and array.ndim > 1 else value
            words[place.offset] = address_of(array)


@lru_cache(maxsize=512)
def _sized(cls: type[Struct], sizes: Any) -> type[Struct]:
    if cls.places:
        return cls
    own = _Declaring(cls.__name__, (cls,), {"places": {}, "__module__": cls.__module__})
    _lay_out(own, cls, sizes)
    return cast(type[Struct], own)


def _lay_out(own: Any, declared: type[Struct], sizes: Any) -> None:
    """Lay out a record and give it properties, from the declaration (or itself)."""
    offset, places, varies = 0, {}, False
    hints = get_type_hints(declared)
    for name in get_annotations(declared):
        hint, where = hints[name], f"record {own.__name__}: {name}"
        if hasattr(Struct, name) or name in get_annotations(Struct):
            raise KernelError(f"{where} is a name that every record has; take another")
        if name in vars(declared) and not isinstance(vars(declared)[name], property):
            raise KernelError(f"{where} is {vars(declared)[name]!r}, expected part(...) or nothing")
        length = declared.lengths.get(name)
        kind, inner = _kind(hint, where)
        if kind in ("float", "int"):
            if length is not None:
                raise KernelError(f"{where} is a number: it has no length")
            place = Place(kind, None, offset, 1, False, varies)
        elif length is None:
            place = Place(kind, inner, offset, 1, True, varies)
        else:
            entries = length.length(sizes) if callable(length.length) else length.length
            inner = inner.sized(sizes) if inner is not None else None
            words = entries * (inner.size if inner is not None else 1)
            place = Place(kind, inner, offset, words, False, varies)
            varies = varies or callable(length.length) or (inner is not None and inner.varies)
        places[name], offset = place, offset + place.size
        setattr(own, name, _property(name, place))
    own.places, own.size, own.varies = places, offset, varies
    own.doubles = all(_of_doubles(place) for place in places.values())


def _property(name: str, place: Place) -> property:
    """The property by which Python reads and writes a member."""
    offset, last, inner = place.offset, place.offset + place.size, place.of

    def refuse(self: Struct, value: object) -> None:
        raise AttributeError(f"record {type(self).__name__}: {name} is a part of it; assign to its entries")

    if place.elsewhere:

        def read_reference(self: Struct) -> Any:
            return self._held[name]

        return property(read_reference, lambda self, value: self.refer(**{name: value}))
    if place.kind == "float":

        def write_float(self: Struct, value: float) -> None:
            self._floats[offset] = value

        return property(lambda self: self._floats[offset], write_float)
    if place.kind == "int":

        def write_int(self: Struct, value: int) -> None:
            self._wholes[offset] = value

        return property(lambda self: self._wholes[offset], write_int)
    if place.kind == "Vector":
        return property(lambda self: self._floats[offset:last], refuse)
    if place.kind == "Indices":
        return property(lambda self: self._wholes[offset:last], refuse)
    assert inner is not None
    of: type[Struct] = inner

    def read_record(self: Struct) -> Any:
        array = (self._floats if of.doubles else self._wholes)[offset:last]
        return Rows(of, array) if place.kind == "Rows" else of(array)

    return property(read_record, refuse)


def _of_doubles(place: Place) -> bool:
    inner = place.of is not None and place.of.doubles
    return not place.elsewhere and (place.kind in ("float", "Vector") or inner)


def _kind(hint: Any, where: str) -> tuple[str, type[Struct] | None]:
    plain = {float: "float", int: "int", Vector: "Vector", Indices: "Indices"}
    if hint in plain:
        return plain[hint], None
    if isinstance(hint, type) and issubclass(hint, Struct):
        return "Struct", hint
    if get_origin(hint) in (Rows, Lanes):
        (inner,) = get_args(hint)
        return get_origin(hint).__name__, inner
    raise KernelError(
        f"{where} is a {hint}, expected float, int, Vector, Indices, a record, Rows or Lanes of one"
    )


def _referred(record: str, name: str, place: Place, value: Any) -> npt.NDArray[Any]:
    """The array to which a reference is bound; refuses what is not of the declared kind."""
    kind: Any = value.kind if isinstance(value, Rows) and place.kind == "Rows" else type(value)
    if place.dtype is not None:
        if isinstance(value, np.ndarray) and value.dtype == place.dtype:
            return value
        given = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else f"a {kind.__name__}"
        raise KernelError(f"record {record}: {name} is given {given}, expected an array of {place.dtype}")
    if place.of is None or kind.__name__ != place.of.__name__:
        raise KernelError(f"record {record}: {name} is given a {kind.__name__}, expected {place.of}")
    array: npt.NDArray[Any] = value.array
    return array


def address_of(array: Any) -> int:
    """The address of an array's numbers; `array.ctypes.data` takes four times as long.

    Raises KernelError for an array that is not contiguous.
    """
    try:
        return ctypes.addressof(_BYTE(array))
    except (BufferError, TypeError, ValueError):  # read-only, empty, or not contiguous
        if not array.flags.c_contiguous:
            raise KernelError("an array for a kernel is in one piece; give a copy") from None
        return int(array.ctypes.data)
