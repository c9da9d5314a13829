"""Names: which are legal, and what to say about one that is not known."""

from __future__ import annotations

import difflib
import keyword
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from filippov.base.errors import ModelError
from filippov.base.symbolic_value import is_symbol, single

if TYPE_CHECKING:
    from sympy import Symbol

TIME = "t"
LONGEST = 120


def closest(name: str, known: Iterable[str]) -> str:
    """Return "did you mean 'mu_s'?", or "" where nothing known is near to `name`."""
    candidates = list(known)
    folded: dict[str, str] = {}
    for candidate in candidates:
        folded.setdefault(candidate.casefold().replace("_", ""), candidate)
    target = str(name).casefold().replace("_", "")
    if target in folded:
        return f"did you mean {folded[target]!r}?"
    near = difflib.get_close_matches(str(name), candidates, n=1, cutoff=0.6)
    if not near:
        near = [folded[k] for k in difflib.get_close_matches(target, list(folded), n=1, cutoff=0.6)]
    return f"did you mean {near[0]!r}?" if near else ""


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """Return the sentence "unknown parameter 'mus'; did you mean 'mu_s'? known: m, mu_s"."""
    names = list(dict.fromkeys(known))
    hint = closest(str(name), names)
    listing = ", ".join(names) if names else "(none)"
    said = repr(name)
    said = said if len(said) <= LONGEST else f"{said[:LONGEST]}..."
    return f"unknown {kind} {said}; {hint + ' ' if hint else ''}known: {listing}"


def no_attribute(owner: str, name: str, known: Iterable[str], answers: Mapping[str, str]) -> str:
    """What to say of an attribute that is not there: what to write in its place, or the nearest that is."""
    hint = answers.get(name, "")
    if not hint and not name.startswith("_"):
        hint = closest(name, sorted(one for one in known if not one.startswith("_")))
    article = "an" if owner[0] in "AEIO" else "a"
    return f"{article} {owner} has no attribute {name!r}{': ' + hint if hint else '.'}"


class Answering:
    """What is asked of it and is not there is answered; `_elsewhere`: what to write for names of others."""

    __slots__ = ()
    _elsewhere: ClassVar[Mapping[str, str]] = {}

    if not TYPE_CHECKING:  # what is not there is an error for the type checker

        def __getattr__(self, name: str) -> Any:
            kind = type(self)
            if hasattr(kind, name):  # it is there, and what it does has raised
                return object.__getattribute__(self, name)
            known = {*dir(kind), *getattr(kind, "__dataclass_fields__", getattr(kind, "_fields", ()))}
            answers = getattr(kind, "_elsewhere", {})
            raise AttributeError(no_attribute(kind.__name__, name, known, answers))


def check_known(
    kind: str, given: Iterable[object], known: Iterable[str], error: type[Exception] = ModelError
) -> None:
    """Raise `error`, with a suggestion, for the first of `given` that is not among `known`."""
    names = list(known)
    for name in given:
        if not isinstance(name, str) or name not in names:
            raise error(unknown(kind, name, names))


def check_name(name: object, kind: str) -> str:
    """Return `name` in Unicode form NFKC if it can name a state or a parameter, else raise ModelError.

    A legal name is a Python identifier (letters of any alphabet) that is no keyword, does not begin with
    an underscore and is not `t`, which is time. `E`, `I`, `S`, `N` are ordinary names.
    """
    if not isinstance(name, str):
        raise ModelError(f"{kind} name {name!r} is a {type(name).__name__}, expected a str")
    # Python normalises identifiers in source text the same way, so p.µ finds the name given as a string.
    normal = unicodedata.normalize("NFKC", name)
    if not normal.isidentifier():
        raise ModelError(
            f"{kind} name {name!r} is not an identifier. Use letters, digits and underscores, "
            "beginning with a letter."
        )
    if keyword.iskeyword(normal):
        raise ModelError(f"{kind} name {name!r} is a Python keyword. Write {normal + '_'!r} instead.")
    if normal.startswith("_"):
        raise ModelError(
            f"{kind} name {name!r} begins with an underscore, which is kept for the package. "
            f"Write {(normal.strip('_') or 'x')!r} instead."
        )
    if normal == TIME:
        raise ModelError(f"{kind} name 't' is taken by time (filippov.t). Give the {kind} another name.")
    return normal


def check_unique(names: Iterable[str], kind: str) -> tuple[str, ...]:
    """Return the names as a tuple; raise ModelError if one of them occurs twice."""
    seen: list[str] = []
    for name in names:
        if name in seen:
            raise ModelError(f"{kind} name {name!r} is given twice. Every {kind} needs its own name.")
        seen.append(name)
    return tuple(seen)


def state_names(names: str | Sequence[str | Symbol]) -> tuple[str, ...]:
    """Return checked, different names from "x v z", "x, v, z" or a sequence of names or symbols."""
    if is_symbol(names):
        names = [names]
    if isinstance(names, str):
        parts: list[object] = list(re.split(r"[\s,]+", names.strip(" ,\t\n")))
    elif isinstance(names, Sequence):
        parts = [getattr(n, "name", n) for n in map(single, names)]
    else:
        raise ModelError(f"states are {names!r}, expected text such as 'x v z' or a list of names.")
    if not parts or parts == [""]:
        raise ModelError("no state was named, expected at least one, for instance states('x v').")
    return check_unique((check_name(part, "state") for part in parts), "state")


def parts(value: str) -> list[str]:
    """The pieces of a text between its commas, not counting commas within brackets."""
    pieces, depth = [""], 0
    for character in value:
        depth += (character in "([{") - (character in ")]}")
        if character == "," and depth == 0:
            pieces.append("")
        else:
            pieces[-1] += character
    return [piece.strip() for piece in pieces if piece.strip()]
