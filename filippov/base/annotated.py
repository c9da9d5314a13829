"""What the annotation of a keyword says of its value: read from its text, checked where the value is given.

So `rtol: float` is refused as text or True, `throw: bool` as 0 or "no", and `modes: Sequence[str]` given as
"+0" is one name, for every function that is marked with `filippov.base.keywords`. An annotation that is
not in the table, or names a type that is not loaded, is left to the function.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import partial
from typing import Any, Literal, cast, get_args, get_origin

from filippov.base import given
from filippov.base.errors import UsageError
from filippov.base.given import shown
from filippov.base.signature import check_signature

Check = Callable[[Any], Any]


def check_of(
    name: str, annotation: object, default: object, known: Mapping[str, Any],
    error: type[Exception] = UsageError,
) -> Check | None:  # fmt: skip
    """A function from what is given for a keyword to its value, or None where nothing is known of it.

    known   the names of the module of the function, for the types among its annotations
    """
    if not isinstance(annotation, str):
        return None
    everything = _parts(annotation)
    open_too = "None" in everything or default is None
    parts = {part for part in everything if part != "None"}
    checked: Check | None = None
    if parts in ({"str", "Path"}, {"str", "FilePath"}):
        checked = partial(given.path, name, error=error)
    elif parts == {"Sequence[str]", "str"}:
        checked = partial(given.names, name, error=error)
    elif all(_is_text(part, known) for part in parts):
        checked = partial(given.text, name, error=error)
    else:
        each = [_single(part, name, default, known, error) for part in everything if part != "None"]
        if None not in each:
            checked = each[0] if len(each) == 1 else _any_of(name, cast(list[Check], each), error)
    if checked is None or not open_too:
        return checked
    return lambda value: None if value is None else checked(value)


def _is_text(part: str, known: Mapping[str, Any]) -> bool:
    """Whether a member of a union is text: str, words to choose from, an enumeration, a symbol's name."""
    kind = known.get(part)
    words = get_origin(kind) is Literal and all(isinstance(word, str) for word in get_args(kind))
    return part in ("str", "Symbol") or words or (isinstance(kind, type) and issubclass(kind, StrEnum))


def _any_of(name: str, checks: Sequence[Check], error: type[Exception]) -> Check:
    """What the first that takes a value makes of it."""

    def check(value: Any) -> Any:
        expected = []
        for one in checks:
            try:
                return one(value)
            except error as refused:
                expected.append(str(refused).rpartition(", expected ")[2].rstrip("."))
        raise error(f"{name} is {shown(value)}, expected {' or '.join(expected)}.")

    return check


def _single(
    part: str, name: str, default: object, known: Mapping[str, Any], error: type[Exception]
) -> Check | None:
    endless = isinstance(default, float) and default in (float("inf"), float("-inf"))
    table: dict[str, Check] = {
        "float": lambda value: given.number(value, name, endless, error),
        "Positive": lambda value: given.positive(name, value, endless, error),
        "NonNegative": lambda value: given.not_negative(name, value, error),
        "int": lambda value: given.whole(name, value, error=error),
        "Count": lambda value: given.whole(name, value, 1, error),
        "Natural": lambda value: given.whole(name, value, 0, error),
        "Amount": lambda value: given.whole(name, value, 1, error, given.MOST_KEPT),
        "AmountOrZero": lambda value: given.whole(name, value, 0, error, given.MOST_KEPT),
        "Edge": lambda value: given.whole(name, value, 1, error, given.LONGEST_EDGE),
        "Array": lambda value: given.number_array(name, value, error),
        "Interval": lambda value: given.interval(name, value, error),
        "Values": lambda value: given.values(name, value, error),
        "Axis": lambda value: given.axis(name, value, error),
        "Figure": lambda value: _figure(name, value, error),
        "bool": lambda value: given.flag(name, value, error),
        "str": lambda value: given.text(name, value, error),
        "Sequence[str]": lambda value: given.names(name, value, error),
        "Iterable[str]": lambda value: given.names(name, value, error),
        "Sequence[float]": lambda value: given.some_numbers(name, value, error),
        "tuple[float, float]": lambda value: given.row(name, value, 2, error),
    }
    if part in table:
        return table[part]
    head = part.partition("[")[0]
    if head == "Mapping":
        return lambda value: _of(name, value, Mapping, "a dict: {name: value}", error)
    if head == "Callable":
        count = _arguments(part)
        return lambda value: _called(name, value, count, error)
    if head in ("Sequence", "Iterable"):
        kind = _class(part[len(head) + 1 : -1], known)
        return lambda value: _each(name, given.several(name, value, error), kind, error)
    kind = _class(part, known)
    if kind is None:
        return None
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    wanted = f"{article} {kind.__name__}{getattr(kind, '_write', '')}"
    return lambda value: _of(name, value, kind, wanted, error)


def _class(part: str, known: Mapping[str, Any]) -> type | None:
    """The class of the package's, or of its graphs, that an annotation names."""
    module, _, inner = part.rpartition(".")
    kind = getattr(known.get(module), inner, None) if module else known.get(part)
    own = isinstance(kind, type) and kind.__module__.startswith(("filippov.", "networkx."))
    return kind if own and not getattr(kind, "_is_protocol", False) else None


def _parts(annotation: str) -> list[str]:
    """The members of a union, apart from what stands inside brackets."""
    out, depth, start = [], 0, 0
    for place, character in enumerate(annotation):
        depth += (character == "[") - (character == "]")
        if character == "|" and not depth:
            out.append(annotation[start:place].strip())
            start = place + 1
    return [*out, annotation[start:].strip()]


def _of(name: str, value: Any, kind: type, expected: str, error: type[Exception]) -> Any:
    if isinstance(value, kind):
        return value
    inside = next((one for one in ("system", "section") if isinstance(getattr(value, one, None), kind)), "")
    cure = f" Give its .{inside}." if inside else ""
    if kind is Mapping and hasattr(value, "keys"):
        cure = f" Write {name}=dict(...) around it."
    if kind.__name__ == "System" and callable(getattr(value, "build", None)):
        cure = " Give its .build()."
    said, made_by = shown(value), f"({type(value).__name__})"
    said = said if said.endswith(made_by) else f"{said} {made_by}"
    raise error(f"{name} is {said}, expected {expected}.{cure}")


def _figure(name: str, value: Any, error: type[Exception]) -> Any:
    """A figure of matplotlib, or a part of one: told by what is drawn into, without loading matplotlib."""
    if not isinstance(value, type) and hasattr(value, "add_gridspec"):
        return value
    axes = ": axes are made in it, give that of yours without axes" if hasattr(value, "get_figure") else ""
    expected = f"a Figure or SubFigure of matplotlib{axes or ', plt.figure()'}"
    raise error(f"{name} is {shown(value)} ({type(value).__name__}), expected {expected}.")


def _each(name: str, values: Any, kind: type | None, error: type[Exception]) -> Any:
    if kind is not None and isinstance(values, Mapping):
        raise error(f"{name} is {shown(values)}, expected a list.")
    for value in values:
        if kind is not None and not isinstance(value, kind):
            raise error(f"{name} holds {shown(value)}, expected a {kind.__name__} each.")
    return values


def _called(name: str, value: Any, wanted: Sequence[str], error: type[Exception]) -> Any:
    if not callable(value):
        raise error(f"{name} is {shown(value)}, expected a function.")
    if wanted:
        check_signature(value, wanted, name, "...", error)
    return value


def _arguments(part: str) -> list[str]:
    """Names for the arguments of a Callable[[int, int], None]; none where they are not listed."""
    listed = part.partition("[")[2].partition("]")[0].lstrip("[")
    kinds = [] if listed.startswith("...") or not listed else listed.split(",")
    return [f"{kind.strip().strip('.').lower()[:1]}{place}" for place, kind in enumerate(kinds, 1)]
