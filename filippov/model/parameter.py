"""Parameters: their defaults, units and bounds, and their values in a run."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from filippov.base.errors import ModelError
from filippov.base.given import as_float, shown
from filippov.base.keywords import constructor
from filippov.base.names import check_name, unknown
from filippov.base.quantity import is_quantity, plain
from filippov.base.symbolic_value import is_expression, is_symbol


def as_number(value: object, what: str) -> float:
    """Return `value` as a finite float; raise ModelError for text, booleans, complex numbers, NaN and inf."""
    number = as_float(value)
    if number is None:
        if isinstance(value, (bool, np.bool_)):
            raise ModelError(f"{what} is {value!r}, expected a number. Write 1.0 or 0.0.")
        if isinstance(value, numbers.Real) or is_expression(value):
            raise ModelError(f"{what} is {value!s}, expected a finite real number.")
        kind = type(value).__name__
        raise ModelError(f"{what} is {shown(value)} ({kind}), expected a real number. {_cure(value)}")
    if not math.isfinite(number):
        raise ModelError(f"{what} is {number}, expected a finite number.")
    return number


def _cure(value: object) -> str:
    if callable(value):
        return "What changes in time is an Input in its place: system.with_inputs({name: Input(...)})."
    if isinstance(value, Mapping | Sequence | np.ndarray) and not isinstance(value, str):
        return "Several values are as many runs: Sweep(problem, over={name: values}, ...)."
    return "Convert text and quantities with units to a float first."


# What the bounds and texts are called elsewhere.
_BOUNDS = "are lower= and upper=: Parameter(1, lower=0, upper=2)."
_ANSWERS = {
    **dict.fromkeys(("min", "minimum", "low", "lb", "ge"), "the least is lower=: Parameter(1, lower=0)."),
    **dict.fromkeys(("max", "maximum", "high", "ub", "le"), "the greatest is upper=: Parameter(1, upper=2)."),
    **dict.fromkeys(("bounds", "range", "limits"), f"bounds {_BOUNDS}"),
    **dict.fromkeys(("value", "val"), "the value is default=, or the first: Parameter(1, 'kg')."),
    "units": "the unit is unit=: Parameter(1, unit='kg').",
    "name": "the name is that in parameters(...): parameters(m=Parameter(1, 'kg')).",
    **dict.fromkeys(("label", "doc", "help", "comment"), "words are description='...'."),
}


@constructor(error=ModelError, answers=_ANSWERS, own=("default", "unit", "lower", "upper", "description"))
@dataclass(frozen=True)
class Parameter:
    """A number of the model: default, unit, closed bounds [lower, upper] and a description."""

    default: float
    unit: str = ""
    lower: float | None = None
    upper: float | None = None
    description: str = ""

    def __post_init__(self) -> None:
        first: Any = self.default
        if isinstance(first, str) and as_float(self.unit) is not None:
            raise ModelError(
                f"a parameter is given as {first!r}, {self.unit!r}; the number goes first: "
                f"Parameter({self.unit!r}, {first!r})."
            )
        for name in ("default", "lower", "upper"):
            value = plain(getattr(self, name), self.unit, f"the {name} of a parameter")
            object.__setattr__(self, name, value)
        object.__setattr__(self, "default", as_number(self.default, "the default of a parameter"))
        for side in ("lower", "upper"):
            bound = getattr(self, side)
            endless = as_float(bound)
            if bound is not None and (endless is None or not math.isinf(endless)):
                object.__setattr__(self, side, as_number(bound, f"the bound {side!r} of a parameter"))
            elif endless is not None:
                outward = endless < 0 if side == "lower" else endless > 0
                if not outward:
                    raise ModelError(f"the bound {side!r} of a parameter is {bound}, which admits no value.")
                object.__setattr__(self, side, None)
        for text in ("unit", "description"):
            if not isinstance(getattr(self, text), str):
                raise ModelError(
                    f"the {text} of a parameter is {getattr(self, text)!r}, expected text: "
                    "Parameter(1, 'kg', lower=0, description='mass')."
                )
        if self.lower is not None and self.upper is not None and self.lower > self.upper:
            raise ModelError(f"parameter bounds [{self.lower}, {self.upper}] are empty: lower exceeds upper.")
        self.check(self.default, "the default of a parameter")

    def check(self, value: object, what: str) -> float:
        """Return `value` as a float within the bounds, or raise ModelError naming `what`.

        A quantity of pint is converted to the unit of the parameter.
        """
        usual = type(value) is float and math.isfinite(value)
        number: Any = value if usual else as_number(plain(value, self.unit, what), what)
        if (self.lower is not None and number < self.lower) or (
            self.upper is not None and number > self.upper
        ):
            low = "-inf" if self.lower is None else f"{self.lower:g}"
            high = "inf" if self.upper is None else f"{self.upper:g}"
            unit = f" {self.unit}" if self.unit else ""
            raise ModelError(f"{what} is {number!r}, outside its bounds [{low}, {high}]{unit}.")
        return float(number)


class Declaration:
    """Declared parameters in order; what `parameters(...)` returns is one, with their symbols."""

    __slots__ = ("_symbols",)
    _symbols: dict[str, Any]


def as_parameter(name: str, value: object) -> Parameter:
    """A default (a finite real number, or a quantity of pint) or a Parameter, as a Parameter.

    Raises ModelError.
    """
    if isinstance(value, Parameter):
        return value
    if is_quantity(value):
        given: Any = value
        return Parameter(given.magnitude, f"{given.units:~}")
    return Parameter(as_number(value, f"the default of parameter {name!r}"))


class ParameterRecord:
    """The values of one run, read-only: p.m, p["m"] and p[0]. This is the `p` of f(t, x, p, s)."""

    __slots__ = ("_index", "_values")
    _index: Mapping[str, int]
    _values: tuple[float, ...]

    def __init__(self, index: Mapping[str, int], values: Sequence[float]) -> None:
        object.__setattr__(self, "_index", index)
        object.__setattr__(self, "_values", tuple(float(v) for v in values))

    def holding(self, values: Sequence[Any]) -> ParameterRecord:
        """The same names with numbers of any kind, as dual ones."""
        other = ParameterRecord(self._index, ())
        object.__setattr__(other, "_values", tuple(values))
        return other

    def __getattr__(self, name: str) -> float:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._values[self._index[name]]
        except KeyError:
            raise AttributeError(unknown("parameter", name, self._index)) from None

    def __getitem__(self, key: str | int) -> float:
        if isinstance(key, str):
            try:
                return self._values[self._index[key]]
            except KeyError:
                raise KeyError(unknown("parameter", key, self._index)) from None
        return self._values[key]

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"the parameters of a run are read-only: {name!r} cannot be set to {value!r}.")

    def __iter__(self) -> Iterator[float]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self._values, dtype=float if dtype is None else dtype)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ParameterRecord):
            return NotImplemented
        return dict(self._index) == dict(other._index) and self._values == other._values

    def __hash__(self) -> int:
        return hash(self._values)

    def __dir__(self) -> list[str]:
        return list(self._index)

    def __repr__(self) -> str:
        return "(" + ", ".join(f"{n}={self._values[i]:g}" for n, i in self._index.items()) + ")"

    def __reduce__(self) -> tuple[Any, ...]:
        return ParameterRecord, (dict(self._index), self._values)


class ParameterSet:
    """The parameters of a system in order: `names`, `defaults`, and `resolve` for the values of a run."""

    __slots__ = ("_defaults", "_hash", "_index", "_items", "names")
    _items: dict[str, Parameter]
    names: tuple[str, ...]
    _index: dict[str, int]
    _defaults: npt.NDArray[np.float64]
    _hash: int

    def __init__(self, items: Mapping[str, object] | Declaration | ParameterSet | None = None) -> None:
        if isinstance(items, ParameterSet):
            found: dict[str, Parameter] = dict(items._items)
        elif isinstance(items, Declaration):
            found = {name: symbol.parameter for name, symbol in items._symbols.items()}
        elif items is None or isinstance(items, Mapping):
            found = {}
            for given, value in (items or {}).items():
                name = check_name(given, "parameter")
                if name in found:
                    raise ModelError(f"parameter {name!r} is given twice.")
                found[name] = as_parameter(name, value)
        else:
            raise ModelError(
                f"parameters are {items!r}, expected parameters(m=1, ...) or a dict of name: number or "
                "Parameter."
            )
        object.__setattr__(self, "_items", found)
        object.__setattr__(self, "_index", {name: i for i, name in enumerate(found)})
        object.__setattr__(self, "names", tuple(found))
        object.__setattr__(self, "_defaults", np.array([q.default for q in found.values()], dtype=float))
        # Runs look systems up by their parameters again and again.
        object.__setattr__(self, "_hash", hash(tuple(found.items())))

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError("the parameters of a system are read-only; give other values to the run.")

    @property
    def defaults(self) -> npt.NDArray[np.float64]:
        """The default values in order, shape (number of parameters,)."""
        return self._defaults.copy()

    def __getitem__(self, name: str) -> Parameter:
        try:
            return self._items[name]
        except KeyError:
            raise KeyError(unknown("parameter", name, self._items)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __contains__(self, name: object) -> bool:
        return name in self._items

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ParameterSet):
            return NotImplemented
        return list(self._items.items()) == list(other._items.items())

    def __hash__(self) -> int:
        return self._hash

    def __repr__(self) -> str:
        return "ParameterSet(" + ", ".join(f"{n}={q.default:g}" for n, q in self._items.items()) + ")"

    def __reduce__(self) -> tuple[Any, ...]:
        return ParameterSet, (dict(self._items),)

    def index(self, name: object) -> int:
        """Return the place of a parameter given by name or by symbol; ModelError with a suggestion if "
        "unknown."""
        key = name.name if is_symbol(name) else name
        if isinstance(key, str) and key in self._index:
            return self._index[key]
        raise ModelError(unknown("parameter", key, self._items))

    def resolve(
        self, values: Any = None, base: npt.NDArray[np.float64] | None = None
    ) -> npt.NDArray[np.float64]:
        """Return the values of a run in order: the defaults (or those of `base`), replaced by `values`.

        `values` maps names (or symbols) to numbers, or holds all values in order. Raises ModelError for an
        unknown name, a value that is not a finite real number, or one outside its bounds.
        """
        out = self.defaults if base is None else base.copy()
        if values is None:
            return out
        if isinstance(values, Mapping):
            pairs = [(self.index(name), value) for name, value in values.items()]
            if len(dict(pairs)) < len(pairs):
                keys = ", ".join(map(str, values))
                raise ModelError(f"a parameter is given twice, by name and as a symbol: {keys}.")
        elif isinstance(values, str) or not isinstance(values, (Sequence, np.ndarray, ParameterRecord)):
            raise ModelError(f"parameter values are {values!r}, expected a dict of name: number.")
        else:
            if isinstance(values, np.ndarray) and values.ndim != 1:
                raise ModelError(f"parameter values have shape {values.shape}, expected ({len(self)},).")
            pairs = list(enumerate(values))
            if len(pairs) != len(self):
                raise ModelError(
                    f"{len(pairs)} parameter values were given, expected {len(self)} "
                    f"({', '.join(self._items)}). "
                    "Give a dict to set some of them."
                )
        names = self.names
        for place, value in pairs:
            out[place] = self._items[names[place]].check(value, f"parameter {names[place]!r}")
        return out

    def others(self, values: Any, names: Sequence[str] = ()) -> dict[str, float]:
        """Return the values of a run by name, without those of `names`, which vary in it."""
        resolved = zip(self.names, self.resolve(values).tolist(), strict=True)
        return {name: value for name, value in resolved if name not in names}

    def record(self, values: Sequence[float] | npt.NDArray[np.float64]) -> ParameterRecord:
        """Return resolved values as the read-only record p of f(t, x, p, s)."""
        return ParameterRecord(self._index, [float(v) for v in values])
