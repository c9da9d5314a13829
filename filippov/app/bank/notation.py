"""Formulas as people write them (2 t, x^2, e1 l1 R1, ln C, 1.5(t-te)) as expressions."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Mapping
from typing import Any

from sympy import E, Expr

from filippov.base.errors import ModelError
from filippov.model.expression import FUNCTIONS, parse_expression

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[^\W\d]\w*)"
    r"|(?P<open>[({])|(?P<close>[)}])|(?P<operator>\*\*|[-+*/^,]))"
)
WORD = re.compile(r"[^\W\d]\w*")
LONGEST = 2_000
# A number, or a formula in the case's parameters.
Number = float | str


def formula(given: Number, names: Mapping[str, Any]) -> Expr:
    """The expression that a number, or a formula in loose notation, stands for; E is exp(1) unless a name.

    Raises ModelError.
    """
    text, names = given if isinstance(given, str) else repr(given), {"E": E, **names}
    try:
        return parse_expression(text, names)
    except ModelError as error:
        try:
            return parse_expression(strict(text, names), names)
        except ModelError:
            raise error from None


def words(given: Any) -> list[str]:
    """The names in a formula, in order; a number has none."""
    return WORD.findall(given) if isinstance(given, str) else []


def number(value: Any, names: Mapping[str, Any] | None = None) -> float:
    """A finite number: itself, or text with a formula. Raises ModelError."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ModelError(f"{value!r} is not a number or a formula.")
    try:
        result = float(value)
    except ValueError:
        result = math.nan
    if math.isnan(result):
        try:
            result = float(formula(str(value), names or {}))
        except (TypeError, OverflowError):
            raise ModelError(f"{str(value)[:80]!r} is not a real number.") from None
    if not math.isfinite(result):
        raise ModelError(f"{str(value)[:80]!r} is not a finite number.")
    return result


def strict(text: str, names: Collection[str]) -> str:
    """The formula with every product written out, ^ as **, and arguments of functions in brackets."""
    tokens = _tokens(text)
    out: list[str] = []
    pending = False  # a function whose bare argument follows
    factor = False  # whether a factor has ended
    for (kind, word), (after, _) in itertools.pairwise([*tokens, ("", "")]):
        function = kind == "name" and word in FUNCTIONS and word not in names
        if factor and kind in ("number", "name", "open") and not pending:
            out.append("*")
        out.append({"^": "**", "{": "(", "}": ")"}.get(word, word) + ")" * pending)
        factor = kind in ("number", "close") or (kind == "name" and not function)
        pending = function and after in ("name", "number")
        out += ["("] * pending
    return "".join(out)


def _tokens(text: str) -> list[tuple[str, str]]:
    if len(text) > LONGEST:
        raise ModelError(f"the formula has {len(text)} characters, expected at most {LONGEST}.")
    found: list[tuple[str, str]] = []
    place, end = 0, len(text.rstrip())
    while place < end:
        match = _TOKEN.match(text, place)
        if match is None:
            raise ModelError(f"cannot read the formula {text[:80]!r} at {text[place : place + 10]!r}.")
        place, kind = match.end(), str(match.lastgroup)
        found.append((kind, match[kind]))
    return found
