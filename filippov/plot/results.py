"""What a figure is drawn of: a result of another kind is answered with what draws it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from filippov.base.errors import UsageError
from filippov.base.given import shown


def result_of(maker: str, *attributes: str, several: bool = False, **of: str) -> Callable[[str, Any], None]:
    """A check for `keywords(first=...)`: the first value is what `maker` returns, told by its attributes.

    By attributes, not by class: figures are below the analysis, and maps of others are drawn as well.

    maker    what makes it, as it is written: "regions"
    several  a sequence of such results is meant
    of       what makes it of an object of another class: Solution="observed_graph(solution)"
    """

    def fits(value: Any) -> bool:
        # Of a class the attributes would be there as well.
        return not isinstance(value, type) and all(hasattr(value, name) for name in attributes)

    def check(function: str, value: Any) -> None:
        if several and isinstance(value, Iterator):
            return  # looking at it would use it up
        held = _held(value)
        if fits(value) if not several else held is not None and all(fits(one) for one in held):
            return
        wanted = f"{'a list of ' if several else ''}what {maker}(...) returns"
        raise UsageError(f"{function} was given {_kind(value)}, expected {wanted}. {cure(function, value)}")

    def cure(function: str, value: Any) -> str:
        held = _held(value) or []
        if several and fits(value):
            return f"Write {function}([result])."
        if not several and any(fits(one) for one in held):
            return f"A figure shows one of them: write {function}(results[0])."
        other = next((one for one in held if not fits(one)), value) if several else value
        kind = type(other).__name__
        if kind in of:
            return f"Write {function}({of[kind]})."
        if not isinstance(other, type) and callable(getattr(other, "plot", None)):
            return f"A {kind} has a figure of its own: write .plot() behind it."
        return f"Write {function}({f'[{maker}(...)]' if several else f'{maker}(...)'})."

    return check


def _held(value: Any) -> list[Any] | None:
    """The members of a sequence; None for text, a dict and what is no sequence."""
    if isinstance(value, str | Mapping | type) or not isinstance(value, Iterable):
        return None
    try:
        return list(value)
    except TypeError:  # an array of no dimension
        return None


def _kind(value: Any) -> str:
    """What was given in a few words: a result by its class, a list by what it holds."""
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    if value is None or isinstance(value, str | int | float):
        return shown(value)
    held = _held(value) if isinstance(value, list | tuple) else None
    inside = " and ".join(sorted({type(one).__name__ for one in held})[:3]) if held else ""
    name = type(value).__name__
    article = "an" if name[0] in "AEIOaeio" or name == "ndarray" else "a"
    return f"{article} {name} of {inside}" if inside else f"{article} {name}"
