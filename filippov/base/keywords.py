"""Keywords of a function that users call: one that it has not is answered with what to write instead."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

from filippov.base.errors import UsageError
from filippov.base.names import unknown

P = ParamSpec("P")
T = TypeVar("T")


def keywords(
    kind: str = "option", same: Mapping[str, str] | None = None, answers: Mapping[str, str] | None = None,
    error: type[Exception] = UsageError,
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Make a function refuse unknown keywords, and too many values in order, with an error.

    kind      what its keywords are called in messages
    same      other names of its keywords, which are taken as well: {"y0": "x0"}
    answers   what to say of a keyword that others have and this function has not
    """
    others, sentences = dict(same or {}), dict(answers or {})

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        shown = function.__qualname__.removesuffix(".__init__")
        everything = list(inspect.signature(function).parameters.values())
        parameters = [q for q in everything if q.name != "self"]
        self = len(everything) - len(parameters)
        names = [q.name for q in parameters]
        places = [q.name for q in parameters if q.kind is not q.KEYWORD_ONLY]
        needed = [q.name for q in parameters if q.default is q.empty]
        further = [f"{name}=..." for name in names if name not in places][:2]
        known, least = frozenset(names), len([name for name in places if name in needed]) + self
        most = len(places) + self if len(needed) == least - self else -1

        @functools.wraps(function)
        def called(*args: P.args, **given: P.kwargs) -> T:
            # The usual call first: all that is needed in order, the rest by names that there are.
            if least <= len(args) <= most and known.issuperset(given):
                return function(*args, **given)
            for name in [name for name in given if name not in names]:
                own = others.get(name)
                if own is None:
                    raise error(sentences.get(name) or unknown(kind, name, names))
                if own in given or own in places[: len(args) - self]:
                    raise error(f"{name} and {own} mean the same, and both are given. Leave {name} out.")
                given[own] = given.pop(name)
            if len(args) - self > len(places):
                raise error(
                    f"{shown} was given {len(args) - self} values in order, expected at most {len(places)} "
                    f"({', '.join(places)}). Write the others by name: {', '.join((*further, '...'))}"
                )
            filled = {*places[: len(args) - self], *given}
            missing = [name for name in needed if name not in filled]
            if missing:
                raise error(f"{shown} needs {', '.join(missing)}: {shown}({', '.join(needed)}).")
            return function(*args, **given)

        return called

    return decorate
