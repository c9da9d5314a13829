"""What users give: a number, a flag, a word or a list is taken for what it says, or refused by name.

A number is what Python calls one: of numpy, of fractions, decimal and sympy as well, and arrays of no
dimension. Text is none ("1e-9"), and neither is True. A flag is True or False, not 0, 1 or "no"; a text in
the place of names is one name, not its letters.
"""

from __future__ import annotations

import math
import numbers
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from decimal import Decimal
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from filippov.base.errors import UsageError
from filippov.base.names import unknown
from filippov.base.quantity import is_quantity
from filippov.base.symbolic_value import is_expression, is_symbol, single

# What annotations of public functions say beside float and int: a number > 0, >= 0; a whole one >= 1, >= 0;
# the lowest and the highest of a range; numbers by name; a name with its numbers.
Positive = float
NonNegative = float
Count = int
Natural = int
# Of what is kept in memory: so many things, 0 too, or so many along each edge of a square.
Amount = int
AmountOrZero = int
Edge = int
MOST_KEPT, LONGEST_EDGE = 10**8, 10**4
Interval = tuple[float, float]
Values = Mapping[str, float]
Axis = tuple[str, Sequence[float]]
LONGEST = 120
LARGEST = 2**63 - 1


def shown(value: object) -> str:
    """A value as messages show it, cut where it is long."""
    try:
        said = repr(value)
    except Exception:  # noqa: BLE001  # a class of the user's may raise anything; a number of 5,000 digits
        said = f"a {type(value).__name__}"
    said = " ".join(said.split())
    return said if len(said) <= LONGEST else f"{said[: LONGEST - 20]} ... ({type(value).__name__})"


def as_float(value: object) -> float | None:
    """A real number as a float, nan and infinities too; None for anything else."""
    if isinstance(value, float):
        return float(value)
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.isMaskedArray(value):
        value = value.item()
    if isinstance(value, bool | np.bool_):
        return None
    if not isinstance(value, numbers.Real | Decimal) and not is_expression(value):
        return None
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):  # an expression with symbols, beyond the range of numbers
        return None


def number(
    value: object, what: str, infinite: bool = False, error: type[Exception] = UsageError
) -> float:  # fmt: skip
    """A real number, finite unless `infinite`; raises `error` for text, flags, complex numbers and nan."""
    found = as_float(value)
    if found is None:
        raise error(f"{what} is {shown(value)}, expected a number.{_cure(value)}")
    if math.isnan(found) or (math.isinf(found) and not infinite):
        raise error(f"{what} is {found}, expected a {'' if infinite else 'finite '}number.")
    return found


def positive(name: str, value: object, infinite: bool = False, error: type[Exception] = UsageError) -> float:
    """A number > 0, or an error naming the option."""
    found = as_float(value)
    if found is None:
        raise error(f"{name} is {shown(value)}, expected a number > 0.{_cure(value)}")
    if not found > 0 or (math.isinf(found) and not infinite):
        kind = "" if infinite else "finite "
        raise error(f"{name} is {shown(value)}, expected a {kind}number > 0.")
    return found


def not_negative(name: str, value: object, error: type[Exception] = UsageError) -> float:
    """A finite number >= 0, or an error naming the option."""
    found = number(value, name, error=error)
    if found < 0:
        raise error(f"{name} is {shown(value)}, expected a number >= 0.")
    return found


def level(value: object, error: type[Exception] = UsageError) -> float:
    """A level of confidence, between 0 and 1; raises `error`."""
    found = as_float(value)
    if found is None or not 0 < found < 1:
        raise error(f"level is {shown(value)}, expected a number between 0 and 1, such as 0.95.")
    return found


def whole(
    name: str, value: object, least: int | None = None, error: type[Exception] = UsageError,
    most: int = LARGEST,
) -> int:  # fmt: skip
    """A whole number, 1e6 too, from `least` to `most`; raises `error`."""
    plain = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    found: Any = int(value) if plain else as_float(value)  # type: ignore[call-overload]
    low = -LARGEST if least is None else least
    if found is None or (not plain and not found.is_integer()) or not low <= found <= most:
        bound = "" if least is None else f" of at least {least}"
        bound = bound if most == LARGEST and (found is None or found < most) else f" from {low} to {most}"
        raise error(f"{name} is {shown(value)}, expected a whole number{bound}.{_cure(value)}")
    return int(found)


def check_count(name: str, value: object) -> int:
    """A whole number of at least 1, or a UsageError naming the option."""
    return whole(name, value, 1)


def flag(name: str, value: object, error: type[Exception] = UsageError, open_too: bool = False) -> Any:
    """True or False (or None, where `open_too`); raises `error` for 0, 1 and "no"."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if value is None and open_too:
        return None
    kinds = "True, False or None" if open_too else "True or False"
    raise error(f"{name} is {shown(value)}, expected {kinds}.")


def several(name: str, value: object, error: type[Exception] = UsageError) -> Any:
    """Things in a row, what a generator gives too; raises `error` for one thing and for text."""
    if isinstance(value, list | tuple | Mapping):
        return value
    if not isinstance(value, str | bytes) and isinstance(value, Iterable):
        with suppress(TypeError):  # an array of no dimension
            return tuple(value)
    raise error(f"{name} is {shown(value)} ({type(value).__name__}), expected a list or another sequence.")


def text(name: str, value: object, error: type[Exception] = UsageError) -> str:
    """Text, or the name of a symbol; raises `error`."""
    value = single(value)
    if isinstance(value, str):
        return value
    if is_symbol(value):
        return str(value.name)
    raise error(f"{name} is {shown(value)}, expected text.")


def choice(name: str, value: object, known: tuple[str, ...], or_function: bool = False) -> None:
    """One of the known words (or a function), or a UsageError."""
    if or_function and callable(value):
        return
    if not isinstance(value, str) or value not in known:
        raise UsageError(unknown(f"value of {name}:", value, known))


def number_array(name: str, value: object, error: type[Exception] = UsageError) -> npt.NDArray[np.float64]:
    """Real numbers as a new array of float64; raises `error` for text, flags, complex and masked numbers."""
    if type(value) is float:
        return np.array(value)
    if type(value) is not np.ndarray or value.dtype == object:
        _refuse_unit(name, value, error)
    # What has no mask need not load numpy.ma.
    if hasattr(value, "_mask") and np.ma.is_masked(value):
        raise error(f"{name} has masked entries, expected numbers. Leave them out, or fill them.")
    listed: Any = list(cast(Iterable[Any], value)) if _is_stream(value) else value
    try:
        array = np.asarray(listed)
    except TypeError as why:  # as of pint, for quantities inside rows
        raise error(f"{name} is {shown(listed)}, expected numbers: {why}.") from None
    except ValueError:
        said = f"{name} is {shown(listed)}, expected numbers in rows of one length.{_inside(value)}"
        raise error(said) from None
    if array.dtype.kind in "fiu" and (isinstance(value, np.ndarray) or not _has_flag(listed)):
        return np.array(array, dtype=np.float64)
    entries = None
    if array.dtype.kind == "O" and not isinstance(value, Mapping | set | frozenset):
        entries = [as_float(entry) for entry in array.ravel().tolist()]
    if entries is None or None in entries:
        raise error(
            f"{name} is {shown(listed)} (type {array.dtype}), expected real numbers"
            f"{_inside(value).replace(' ', '. ', 1) or _as_numbers(name, array)}"
        )
    return np.array(entries, dtype=np.float64).reshape(array.shape)


def _inside(value: object) -> str:
    """Where a result has the state that may be meant."""
    found = [part for part in ("x_end", "x0", "x") if isinstance(getattr(value, part, None), np.ndarray)]
    return f" Give its .{found[0]}." if found else ""


def _as_numbers(name: str, array: npt.NDArray[Any]) -> str:
    """How numbers are made of what was given."""
    if array.dtype.kind == "M":
        return ". Give times in seconds: (stamps - stamps[0]) / np.timedelta64(1, 's')."
    if array.dtype.kind == "m":
        return ". Give times in seconds: durations / np.timedelta64(1, 's')."
    if array.dtype.kind == "U" and array.ndim:
        try:
            array.astype(np.float64)
        except ValueError:
            return f": {name}=(0.1, 0), no text."
        return ", no text. Convert it: np.asarray(given, dtype=float)."
    if array.dtype.kind == "c":
        return ". Take .real where the imaginary parts are 0."
    if any(map(is_expression, array.ravel().tolist() if array.dtype.kind == "O" else ())):
        return f": values in place of symbols, {name}=(0.1, 0)."
    return f": {name}=(0.1, 0){', no text' if array.dtype.kind in 'US' else ''}."


def _refuse_unit(name: str, value: object, error: type[Exception]) -> None:
    """Raise `error` for a quantity with a unit, whose magnitude numpy would take without a word."""
    if isinstance(value, list | tuple):
        given: Iterable[Any] = value
    elif isinstance(value, np.ndarray) and value.dtype == object:
        given = value.ravel().tolist()
    else:
        given = (value,)
    for entry in given:
        if type(entry) is float or type(entry) is int:
            continue
        if entry is not value and isinstance(entry, list | tuple | np.ndarray):
            _refuse_unit(name, entry, error)
        elif is_quantity(entry) and not getattr(entry, "dimensionless", False):
            break
    else:
        return
    raise error(
        f"{name} is {shown(value)}, a quantity whose unit cannot be converted here. Give its magnitude in "
        "the unit of the model: q.to(unit).magnitude."
    )


def row(
    name: str, value: object, length: int | None = None, error: type[Exception] = UsageError
) -> tuple[float, ...]:  # fmt: skip
    """Finite numbers in a row, so many of them where `length` says it; raises `error`."""
    array = number_array(name, value, error)
    if array.ndim != 1 or (length is not None and array.size != length):
        count = "numbers in a row" if length is None else f"{length} numbers"
        one = f": {name}=({shown(value)},)" if array.ndim == 0 and length is None else ""
        pair = f": {name}=(low, high)" if length == 2 else ""
        raise error(f"{name} is {shown(value)}, expected {count}{one or pair}.")
    if not np.all(np.isfinite(array)):
        raise error(f"{name} is {shown(value)}, expected finite numbers.")
    return tuple(array.tolist())


def some_numbers(name: str, value: object, error: type[Exception] = UsageError) -> tuple[float, ...]:
    """Finite numbers in a row, one at least; raises `error`."""
    found = row(name, value, error=error)
    if not found:
        raise error(f"{name} is {shown(value)}, expected one number or more.")
    return found


def interval(name: str, value: object, error: type[Exception] = UsageError) -> tuple[float, float]:
    """Two finite numbers, the first below the second; raises `error`."""
    found = row(name, value, 2, error)
    if not found[0] < found[1]:
        raise error(f"{name} is {shown(value)}, expected (lowest, highest).")
    return found[0], found[1]


def values(name: str, value: object, error: type[Exception] = UsageError) -> dict[str, float]:
    """Finite numbers by name, or by symbol; raises `error`."""
    if not isinstance(value, Mapping):
        raise error(f"{name} is {shown(value)}, expected a dict: {{name: number}}.")
    out: dict[str, float] = {}
    for key, entry in value.items():
        (named,) = names(f"{name}: a name", key, error)
        if named in out:
            raise error(f"{name} names {named!r} twice.")
        out[named] = number(entry, f"{name}: {named!r}", error=error)
    return out


def axis(name: str, value: object, error: type[Exception] = UsageError) -> tuple[str, tuple[float, ...]]:
    """A name and its numbers, one at least; raises `error`."""
    if not isinstance(value, tuple | list) or len(value) != 2 or as_float(value[0]) is not None:
        raise error(f"{name} is {shown(value)}, expected a name and its values: {name}=('P', [10, 20]).")
    (named,) = names(name, value[0], error)
    return named, some_numbers(f"{name}: {named}", value[1], error)


def names(name: str, value: object, error: type[Exception] = UsageError) -> tuple[str, ...]:
    """Names in order, of texts or symbols; a text or symbol alone is one name. Raises `error`."""
    value = single(value)
    if isinstance(value, str):
        return (str(value),)
    if is_symbol(value):
        return (str(value.name),)
    found = [None] if isinstance(value, Mapping) else several(name, value, error)
    out = [getattr(entry, "name", entry) if is_symbol(entry) else entry for entry in map(single, found)]
    for entry in out:
        if not isinstance(entry, str):
            raise error(f"{name} is {shown(value)}, expected a list of names: ['a', 'b'].")
    return tuple(str(entry) for entry in out)


def path(name: str, value: object, error: type[Exception] = UsageError) -> Any:
    """A path as text or as a Path, without characters that no path has; raises `error`."""
    given = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if isinstance(given, str) and given and "\0" not in given:
        with suppress(UnicodeEncodeError):
            os.fsencode(given)
            return value
    raise error(f"{name} is {shown(value)}, expected the path of a file or folder.")


def _cure(value: object) -> str:
    """What to write in place of something that is no number."""
    if isinstance(value, str):
        with suppress(ValueError):
            return f" Write {value.strip()} without quotes." if math.isfinite(float(value)) else ""
        return ""
    if isinstance(value, np.datetime64 | np.timedelta64 | datetime | timedelta):
        return " Give seconds: (stamp - first).total_seconds()."
    return " Write 1.0 or 0.0." if isinstance(value, bool | np.bool_) else ""


def _is_stream(value: object) -> bool:
    """Whether a value is a generator, a range or the like, which numpy does not read as numbers."""
    return isinstance(value, Iterable) and not hasattr(value, "__len__") and not hasattr(value, "__array__")


def _has_flag(value: object) -> bool:
    if isinstance(value, list | tuple):
        return any(map(_has_flag, value))
    return isinstance(value, bool | np.bool_) or (isinstance(value, np.ndarray) and value.dtype.kind == "b")
