"""The cases of a match statement, as conditions on what is matched."""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

import numpy as np

from filippov.analysis.programs.assignments import Assignments
from filippov.analysis.programs.outside import opened

Then = Callable[[], Any]


class Matching(Assignments):
    """Part of the reader: patterns of numbers, texts, names and tuples of them, with guards."""

    def forked(self, condition: Any, yes: Then, no: Then) -> Any:
        """Follow both sides of a condition; the value is what they give, the state what they leave."""
        raise NotImplementedError

    def cases(self, node: ast.Match, body: Callable[[ast.match_case], Any], none: Then) -> Any:
        """Do the body of the first case that holds, or what comes where none does."""
        subject = opened(self.value(node.subject), self.parameters)

        def case(k: int) -> Any:
            if k == len(node.cases):
                return none()
            part = node.cases[k]
            names: dict[str, Any] = {}
            held = self._pattern(part.pattern, subject, names)

            def matched() -> Any:
                # As Python does: names have their values where the pattern holds, the guard or not.
                for name, value in names.items():
                    self.assign(ast.copy_location(ast.Name(name, ast.Store()), part.pattern), value)
                if part.guard is None:
                    return body(part)
                fits = self.truth(part.guard, self.value(part.guard))
                if isinstance(fits, bool):
                    return body(part) if fits else case(k + 1)
                return self.forked(fits, lambda: body(part), lambda: case(k + 1))

            if isinstance(held, bool):
                return matched() if held else case(k + 1)
            return self.forked(held, matched, lambda: case(k + 1))

        return case(0)

    def _pattern(self, pattern: ast.pattern, subject: Any, names: dict[str, Any]) -> Any:
        """Whether a pattern holds for a value; names: what the names in it stand for."""
        if isinstance(pattern, ast.MatchValue):
            if isinstance(subject, (list, tuple, dict, np.ndarray)):
                return False if not isinstance(subject, np.ndarray) else self._of_array(pattern)
            return self.compare(pattern, "==", subject, opened(self.value(pattern.value), self.parameters))
        if isinstance(pattern, ast.MatchSingleton):
            if pattern.value is not None and not isinstance(subject, (str, type(None))):
                raise self.fail(
                    pattern, f"case {pattern.value} asks for Python's own {pattern.value}, which no number "
                    "and no condition of numpy is; write its cases with if"
                )  # fmt: skip
            return subject is pattern.value
        if isinstance(pattern, ast.MatchOr):
            inside: dict[str, Any] = {}
            held = self.any_of(pattern, *(self._pattern(q, subject, inside) for q in pattern.patterns))
            if inside:
                raise self.fail(pattern, "a case with | and names is not followed; write its cases with if")
            return held
        if isinstance(pattern, ast.MatchAs):
            held = True if pattern.pattern is None else self._pattern(pattern.pattern, subject, names)
            if pattern.name is not None and held is not False:
                names[pattern.name] = subject
            return held
        if isinstance(pattern, ast.MatchSequence):
            return self._sequence(pattern, subject, names)
        kind = type(pattern).__name__.removeprefix("Match").lower()
        raise self.fail(pattern, f"a case of a {kind} is not followed; write its cases with if")

    def _sequence(self, pattern: ast.MatchSequence, subject: Any, names: dict[str, Any]) -> Any:
        if any(isinstance(q, ast.MatchStar) for q in pattern.patterns):
            raise self.fail(pattern, "a case with * is not followed; write its cases with if")
        if isinstance(subject, np.ndarray):
            return self._of_array(pattern)
        if not isinstance(subject, (list, tuple)) or len(subject) != len(pattern.patterns):
            return False
        held = [self._pattern(q, part, names) for q, part in zip(pattern.patterns, subject, strict=True)]
        return self.all_of(pattern, *held, True)

    def _of_array(self, pattern: ast.pattern) -> Any:
        raise self.fail(
            pattern, "an array is no sequence and no number to match; match a tuple of its entries, such as "
            "(y[0], y[1]), or write its cases with if"
        )  # fmt: skip
