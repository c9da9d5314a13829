"""Kernels of many statements in pieces: an optimiser's time grows with the square of a function's length."""

from __future__ import annotations

from collections.abc import Sequence

from sympy import Expr

# Statements and distinct expressions that a piece should hold; twice as many, and so on, where pieces share
# too much.
LENGTH = 800
LONGEST = 16 * LENGTH
# The total length of all pieces, as a multiple of their distinct content.
MOST = 1.5


def pieces(results: Sequence[tuple[str, Expr]]) -> list[Sequence[tuple[str, Expr]]]:
    """The statements in pieces of about one length; in one where they are few or have too much in common."""
    whole: set[Expr] = set()
    for _, e in results:
        _note(e, whole)
    length = LENGTH
    size = len(whole) + len(results)
    while length <= min(LONGEST, size / 2):
        parts, held = _cut(results, length)
        if held <= MOST * size:
            return parts
        length *= 2
    return [results]


def _cut(results: Sequence[tuple[str, Expr]], length: int) -> tuple[list[Sequence[tuple[str, Expr]]], int]:
    """Pieces of at least a length, and the length of all of them."""
    parts: list[Sequence[tuple[str, Expr]]] = []
    first, held, seen = 0, 0, set[Expr]()
    for k, (_, e) in enumerate(results, 1):
        _note(e, seen)
        if (size := len(seen) + k - first) >= length or k == len(results):
            parts.append(results[first:k])
            first, held, seen = k, held + size, set()
    return parts, held


def _note(e: Expr, seen: set[Expr]) -> None:
    """Note an expression with all its subexpressions."""
    waiting = [e]
    while waiting:
        part = waiting.pop()
        if part not in seen:
            seen.add(part)
            waiting.extend(part.args)
