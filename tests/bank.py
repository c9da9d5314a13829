"""Cases of the bank in data/cases.json, built and solved by filippov.app.bank."""

import json
from functools import cache
from pathlib import Path
from typing import Any

from filippov import Solution, solve
from filippov.app.bank.build import Built, build
from filippov.app.bank.notation import number

__all__ = ["CASES", "FILE", "case", "event_word", "expected", "number", "solved"]

FILE = Path(__file__).parent / "data" / "cases.json"
CASES: dict[str, dict[str, Any]] = {
    case["id"]: case for case in json.loads(FILE.read_text(encoding="utf-8"))["cases"]
}
_WORDS = {"crossing": "cross", "sliding entry": "slide", "sliding exit": "exit", "grazing": "graze"}
_SIGNS = {1: "+", -1: "-", 0: ""}


@cache
def case(name: str) -> Built:
    """The problem of the case of this id."""
    return build(CASES[name])


def expected(name: str) -> dict[str, dict[str, Any]]:
    """What the case expects, by name."""
    return {entry["name"]: entry for entry in CASES[name]["expected"]}


@cache
def solved(name: str) -> Solution:
    """The case's solution at rtol 1e-11 over its own span."""
    item = case(name)
    return solve(item.system, item.x0, item.t_span, rtol=1e-11, atol=1e-13)


def event_word(event: Any) -> str:
    """An event's kind in the bank's words: cross+, slide, exit-."""
    return _WORDS[str(event.kind)] + _SIGNS[event.direction]
