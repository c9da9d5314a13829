"""What users give to a function: keywords that it has not, and values of another kind, are answered."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from filippov.base.errors import UsageError
from filippov.base.names import unknown

P = ParamSpec("P")
T = TypeVar("T")
LONGEST, MOST = 60, 4  # characters of a value, and values, that an answer repeats
# What is said of a keyword: a sentence, or a function from the value that was given to it.
Answer = str | Callable[[Any], str]


def renamed(former: str, present: str, example: str) -> Callable[[Any], str]:
    """The answer to the former name of a keyword of values by name: what was given, under the present one.

    example   what is shown where something else was given
    """

    def answer(value: Any) -> str:
        from filippov.base.given import shown

        if not isinstance(value, Mapping) or not value:
            return f"{former} is {present} now: write {present}={example}."
        said = [f"{key!r}: {q if len(q := shown(one)) <= LONGEST else '...'}" for key, one in value.items()]
        text = ", ".join([*said[:MOST], *(["..."] if len(said) > MOST else [])])
        return f"{former} is {present} now: write {present}={{{text}}}."

    return answer


def keywords(
    kind: str = "option", same: Mapping[str, str] | None = None, answers: Mapping[str, Answer] | None = None,
    error: type[Exception] = UsageError, own: Sequence[str] = (),
    first: Callable[[str, Any], None] | None = None,
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Make a function refuse unknown keywords, too many values in order, and values of another kind.

    The kinds are those of its annotations, see `filippov.base.annotated`.

    kind      what its keywords are called in messages
    same      other names of its keywords, which are taken as well: {"y0": "x0"}
    answers   what to say of a keyword that others have and this function has not, or a function from its
              value to that; "*": of too many values
    own       keywords whose values the function checks itself, with more to say
    first     called with the function's name and its first value before all else: what is wrong with that
              one explains what is wrong with the others
    """
    others, sentences = dict(same or {}), dict(answers or {})

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        shown = function.__qualname__.removesuffix(".__init__")
        everything = list(inspect.signature(function).parameters.values())
        # What a function hands on to another one is checked there.
        further_ones = any(q.kind is q.VAR_KEYWORD for q in everything)
        everything = [q for q in everything if q.kind is not q.VAR_KEYWORD]
        parameters = [q for q in everything if q.name not in ("self", "cls")]
        self = len(everything) - len(parameters)
        names = [q.name for q in parameters]
        places = [q.name for q in parameters if q.kind is not q.KEYWORD_ONLY]
        needed = [q.name for q in parameters if q.default is q.empty]
        further = [f"{name}=..." for name in names if name not in places][:2]
        known, least = frozenset(names), len([name for name in places if name in needed]) + self
        most = len(places) + self if len(needed) == least - self else -1
        defaults = {q.name: q.default for q in parameters}

        @functools.cache
        def checks() -> dict[str, Callable[[Any], Any]]:
            # Made at the first call: the types of the annotations may be loaded after the function. And the
            # checks load numpy, which the command does without as long as it is asked for help.
            from filippov.base.annotated import check_of

            scope = inspect.unwrap(function).__globals__
            found = {q.name: check_of(q.name, q.annotation, q.default, scope, error) for q in parameters}
            return {name: check for name, check in found.items() if check is not None and name not in own}

        def run(args: Any, given: Any) -> T:
            checked = checks()
            for name, value in given.items():
                if name in checked and value is not defaults[name]:
                    given[name] = checked[name](value)
            args = [*args]
            for place, name in enumerate(places[: len(args) - self], self):
                if name in checked and args[place] is not defaults[name]:
                    args[place] = checked[name](args[place])
            return function(*args, **given)

        @functools.wraps(function)
        def called(*args: P.args, **given: P.kwargs) -> T:
            if first is not None and (len(args) > self or names[0] in given):
                first(shown, args[self] if len(args) > self else given[names[0]])
            # The usual call next: all that is needed in order, the rest by names that there are.
            twice = given.keys() & places[: len(args) - self] if given else ()
            if least <= len(args) <= most and known.issuperset(given) and not twice:
                return run(args, given)
            for name in [name for name in given if name not in names]:
                own = others.get(name)
                if own is None and further_ones:
                    continue
                if own is None:
                    told = sentences.get(name)
                    said = told(given[name]) if callable(told) else told
                    if said is None and args:
                        said = _of_system(args[min(self, len(args) - 1)], name, given[name], known)
                    raise error(said or unknown(kind, name, names))
                open_place = any(q not in given for q in places[len(args) - self :])
                if own in given or (own in places[: len(args) - self] and not open_place):
                    raise error(f"{name} and {own} mean the same, and both are given. Leave {name} out.")
                if own in places[: len(args) - self]:
                    raise error(_twice(shown, places, args[self:], given, own, name))
                given[own] = given.pop(name)
            if len(args) - self > len(places):
                more = f" Write the others by name: {', '.join((*further, '...'))}" if further else ""
                said = f"{shown} was given {len(args) - self} values in order, expected at most {len(places)}"
                own_words = sentences.get("*")
                raise error(
                    own_words if isinstance(own_words, str) else f"{said} ({', '.join(places)}).{more}"
                )
            for name in sorted(twice):
                raise error(_twice(shown, places, args[self:], given, name, name))
            filled = {*places[: len(args) - self], *given}
            missing = [name for name in needed if name not in filled]
            if missing:
                raise error(f"{shown} needs {', '.join(missing)}: {shown}({', '.join(needed)}).")
            return run(args, given)

        return called

    return decorate


def _of_system(owner: Any, name: str, value: Any, known: frozenset[str]) -> str:
    """What is said of a keyword that is a parameter or a state of the system, or problem, given first."""
    from filippov.base.given import shown

    owner = getattr(owner, "system", owner)
    if "parameters" in known and name in getattr(getattr(owner, "parameters", None), "names", ()):
        return f"{name} is a parameter of the system: write parameters={{{name!r}: {shown(value)}}}."
    if "x0" in known and name in getattr(owner, "states", ()):
        return f"{name} is a state of the system: write x0={{{name!r}: {shown(value)}, ...}}."
    return ""


def _twice(
    function: str, places: Sequence[str], args: Sequence[Any], given: Mapping[str, Any], own: str, name: str
) -> str:  # fmt: skip
    """What is said of a value given in order and by name; where a later place is open, that may be meant."""
    from filippov.base.given import shown

    value = shown(args[places.index(own)])
    said = f"{own} is given twice, as {value} in order and as {name}={shown(given[name])}"
    if name != own:
        said = f"{name} and {own} mean the same, and both are given: {value} in order, {name} by name"
    open_places = [q for q in places[len(args) :] if q not in given]
    if not open_places:
        return f"{said}. Leave one out."
    order = f"The order is {function}({', '.join(places)})"
    return f"{said}. {order}: if {value} is {open_places[0]}, write {open_places[0]}={value}."


def constructor(
    kind: str = "keyword", same: Mapping[str, str] | None = None, answers: Mapping[str, Answer] | None = None,
    error: type[Exception] = UsageError, own: Sequence[str] = (),
) -> Callable[[type[T]], type[T]]:  # fmt: skip
    """The same for the arguments of a class, over @dataclass."""

    def decorate(made: type[T]) -> type[T]:
        made.__init__ = keywords(kind, same, answers, error, own)(made.__init__)  # type: ignore[method-assign]
        return made

    return decorate
