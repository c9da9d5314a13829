"""Readers of settings: from a flag's text, or from what TOML has, to a value. Each raises UsageError.

Formulas in text (pi/2) are read by `filippov.model.expression`; nothing is run as code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.names import parts, unknown

# As in `filippov.solving.state.options`, which is not imported for a help text.
SIGNAL = ("kind", "outside", "period", "time", "value")
POLICIES = ("raise", "stick", "slip", "branch")
# So many values are listed at most: as in `filippov.base.given`, which would import numpy here.
MOST_KEPT = 10**8


def number(value: Any, name: str) -> float:
    """A finite number: 0.5, "1e-3", "pi/2"."""
    if isinstance(value, str):
        result = _calculated(value, name)
    elif isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{name} is {value!r}, expected a number.")
    else:
        try:
            result = float(value)
        except OverflowError:
            result = math.inf
    if not math.isfinite(result):
        raise UsageError(f"{name} is {value!r}, expected a finite number.")
    return result


def _calculated(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        pass
    from filippov.model.expression import parse_expression

    try:
        return float(parse_expression(text))
    except ModelError as error:
        raise UsageError(f"{name} is {text[:80]!r}, expected a number or a formula: {error}") from None
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"{name} is {text[:80]!r}, which is not a real number.") from None


def number_or_formula(value: Any, name: str) -> float | str:
    """A number, or a formula in parameters as text, which is kept."""
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return number(value, name)


def whole(value: Any, name: str, least: int = 1, most: int | None = None) -> int:
    """A whole number of at least 1, and at most so many."""
    result = number(value, name)
    if result != int(result) or result < least or (most is not None and result > most):
        value = value.strip() if isinstance(value, str) else value
        bound = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise UsageError(f"{name} is {value!r}, expected a whole number {bound}.")
    return int(result)


def any_whole(value: Any, name: str) -> int:
    """A whole number, negative ones too."""
    result = number(value, name)
    if result != int(result):
        raise UsageError(f"{name} is {value!r}, expected a whole number.")
    return int(result)


def numbers(value: Any, name: str) -> list[float]:
    """One or more numbers: a list, or text with commas."""
    items = value if isinstance(value, list | tuple) else [value]
    pieces: list[Any] = []
    for item in items:
        pieces += parts(item) if isinstance(item, str) else [item]
    if not pieces:
        raise UsageError(f"{name} is empty, expected at least one number.")
    return [number(piece, name) for piece in pieces]


def pair(value: Any, name: str) -> tuple[float, float]:
    """Two numbers."""
    found = numbers(value, name)
    if len(found) != 2:
        raise UsageError(f"{name} has {len(found)} numbers, expected 2.")
    return found[0], found[1]


def tolerance(value: Any, name: str) -> float | list[float]:
    """One number, or one per state."""
    found = numbers(value, name)
    return found[0] if len(found) == 1 and not isinstance(value, list) else found


def named_numbers(value: Any, name: str) -> dict[str, float]:
    """Numbers by name: a table, "P=20", or ["P=20", "D=2"]."""
    return {key: number(item, f"{name}: {key}") for key, item in named(value, name).items()}


def named_ranges(value: Any, name: str) -> dict[str, tuple[float, float]]:
    """Ranges by name: a table of pairs, "P=5:60", or ["P=5:60", "D=1:2"]."""
    return {key: _ends(item, key, name) for key, item in named(value, name).items()}


def sampled_ranges(value: Any, name: str) -> dict[str, tuple[float, float]]:
    """The same, of ranges from which samples are drawn."""
    return {key: _ends(item, key, name, "--samples") for key, item in named(value, name).items()}


def counted_ranges(value: Any, name: str) -> dict[str, tuple[float, float, int | None]]:
    """Ranges by name, each with the number of its values or None: "P=5:60:12", "P=5:60", or a table."""
    out: dict[str, tuple[float, float, int | None]] = {}
    for key, item in named(value, name).items():
        parted = item.split(":") if isinstance(item, str) else item
        counted = isinstance(parted, list | tuple) and len(parted) == 3
        low, high = _ends(parted[:2] if counted else item, key, name, form="LOW:HIGH or LOW:HIGH:COUNT")
        out[key] = (low, high, whole(parted[2], f"{name}: {key}", most=MOST_KEPT) if counted else None)
    return out


def _ends(item: Any, key: str, name: str, draws: str = "", form: str = "LOW:HIGH") -> tuple[float, float]:
    """LOW:HIGH, or two numbers; draws: the flag that says how many samples are drawn from it."""
    ends = item.split(":") if isinstance(item, str) else item
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        cure = ""
        if isinstance(ends, list) and len(ends) == 3:
            cure = f" Here it has no number of values: write {key}={ends[0]}:{ends[1]}" + (
                f" {draws} {ends[2]}." if draws else "."
            )
        raise UsageError(f"{name}: {key} is {item!r}, expected {form}.{cure}")
    low, high = (number(end, f"{name}: {key}") for end in ends)
    if not low <= high:
        raise UsageError(f"{name}: {key} is {item!r}, expected LOW <= HIGH.")
    return low, high


def varied(value: Any, name: str) -> dict[str, list[float]]:
    """Values by name: lists in a table, or text: "P=5:60:12" (twelve values), "P=5:60" (both ends), "P=5"."""
    out = {}
    for key, item in named(value, name).items():
        if not isinstance(item, str):
            out[key] = numbers(item, f"{name}: {key}")
            continue
        ends = item.split(":")
        if len(ends) > 3:
            raise UsageError(f"{name}: {key} is {item!r}, expected LOW:HIGH or LOW:HIGH:COUNT.")
        found = [number(end, f"{name}: {key}") for end in ends[:2]]
        if len(ends) == 3:
            count = whole(ends[2], f"{name}: {key}", most=MOST_KEPT)
            step = (found[1] - found[0]) / max(count - 1, 1)
            found = [found[0] + k * step for k in range(count)]
        out[key] = found
    return out


def whole_or_zero(value: Any, name: str) -> int:
    """A whole number of at least 0."""
    return whole(value, name, 0)


def state(value: Any, name: str) -> dict[str, float] | list[float]:
    """A state: "x=0.1,v=0" or a table by name; "0.1,0,0" or a list in order."""
    if isinstance(value, Mapping) or (isinstance(value, str) and "=" in value):
        return named_numbers(value, name)
    return numbers(value, name)


def named(value: Any, name: str) -> dict[str, Any]:
    """Values by name, not read yet: a table, or text such as "x=d,v=0"."""
    if isinstance(value, Mapping):
        return dict(value)
    items = value if isinstance(value, list | tuple) else [value]
    found: dict[str, Any] = {}
    for item in items:
        for piece in parts(item) if isinstance(item, str) else [str(item)]:
            key, equals, text = piece.partition("=")
            if not equals or not key.strip() or not text.strip():
                several = isinstance(item, str) and piece != item and not equals
                cure = (
                    " Names stand before every value, several with commas; a number has a decimal point, and "
                    "values of a sweep are LOW:HIGH:COUNT." if several else ""
                )
                what = f"{item!r}, in which {piece!r} has no name" if several else repr(piece)
                if name == "--over" and not equals and not cure:
                    word = piece.strip() or "NAME"
                    cure = f" Write --over {word}=LOW:HIGH or {word}=LOW:HIGH:COUNT."
                raise UsageError(f"{name} is {what}, expected name=value.{cure}")
            if key.strip() in found:
                raise UsageError(f"{name}: {key.strip()} is given twice. Leave one of them out.")
            found[key.strip()] = text.strip()
    return found


def formulas(value: Any, name: str) -> dict[str, str]:
    """Formulas by name, as text or numbers; read by what uses them."""
    found = named(value, name)
    for key, item in found.items():
        if isinstance(item, bool) or not isinstance(item, str | int | float):
            raise UsageError(f"{name}: {key} is {item!r}, expected a formula as text.")
    return {key: str(item) for key, item in found.items()}


def signals(value: Any, name: str) -> dict[str, tuple[str, dict[str, Any]]]:
    """Files and options by name: "r=steps.csv,kind=hold", or a table {r = {file = ..., kind = ...}}."""
    items = list(value.items()) if isinstance(value, Mapping) else []
    for item in texts(value, name) if not items else ():
        key, equals, rest = item.partition("=")
        if not equals or not key.strip():
            raise UsageError(f"{name} is {item!r}, expected NAME=FILE.csv.")
        items.append((key.strip(), rest))
    out = {}
    for key, given in items:
        where = f"{name}: {key}"
        if isinstance(given, Mapping):
            options = dict(given)
        else:
            parted = [piece.strip() for piece in text(given, where).split(",")]
            options = {"file": parted[0], **named(parted[1:], where)}
        for option in options:
            if option not in ("file", *SIGNAL):
                raise UsageError(f"{where}: {unknown('setting', option, SIGNAL)}")
        if "period" in options:
            options["period"] = number(options["period"], f"{where}: period")
        out[key] = text(options.pop("file", ""), where), options
    return out


def text(value: Any, name: str) -> str:
    """A text that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise UsageError(f"{name} is {value!r}, expected text.")
    return value.strip()


def names(value: Any, name: str) -> list[str]:
    """One name or several: a list, or text with commas."""
    return [piece for item in texts(value, name) for piece in parts(item)]


def texts(value: Any, name: str) -> list[str]:
    """One text or several."""
    return [text(item, name) for item in (value if isinstance(value, list | tuple) else [value])]


def words(value: Any, name: str) -> list[str]:
    """One text or several: a list, or text with commas."""
    found = [piece for item in texts(value, name) for piece in parts(item)]
    if not found:
        raise UsageError(f"{name} is empty, expected at least one name.")
    return found


def destination(value: Any, name: str) -> str | bool:
    """A file for JSON; true or no file for stdout, false for none."""
    if value is None:
        return True
    return value if isinstance(value, bool) else text(value, name)


def policy(value: Any, name: str) -> str | list[str]:
    """A policy by name, or modes with commas (or a list of them)."""
    if isinstance(value, str) and value in POLICIES:
        return value
    found = [piece for item in texts(value, name) for piece in parts(item)]
    if not found or any(set(mode) - set("+0-") for mode in found):
        raise UsageError(f"{unknown(f'value of {name}:', value, POLICIES)}; or modes with commas: +,0")
    return found


def releases(value: Any, name: str) -> int | list[float]:
    """One whole number, or times."""
    found = numbers(value, name)
    alone = len(found) == 1 and not isinstance(value, list) and "." not in str(value)
    return whole(found[0], name) if alone else found


def switch(value: Any, name: str) -> bool:
    """Yes or no."""
    if not isinstance(value, bool):
        raise UsageError(f"{name} is {value!r}, expected true or false.")
    return value


def one_of(*known: str) -> Callable[[Any, str], str]:
    """A reader for one of the known words."""

    def read(value: Any, name: str) -> str:
        if isinstance(value, str) and value in known:
            return value
        if "DP5" in known and isinstance(value, str):
            return _method(value, name, known)
        raise UsageError(unknown(f"value of {name}:", value, known))

    return read


def _method(value: str, name: str, known: Sequence[str]) -> str:
    """A method by the name that scipy or MATLAB gives it, as `solve` takes it."""
    from filippov.solving.state.option_types import METHODS_OF_OTHERS

    if value == "RK45":
        return "DP5"
    if value in METHODS_OF_OTHERS:
        instead = METHODS_OF_OTHERS[value].replace("method=", f"{name} ")
        raise UsageError(f"{name} is {value!r}, not among {', '.join(known)}: use {instead}.")
    raise UsageError(unknown(f"value of {name}:", value, known))
