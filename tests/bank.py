"""Cases of the bank in data/cases.json, built through the safe expression reader."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from sympy import Symbol

from filippov import Solution, Surface, System, solve
from filippov.expression import parse_expression

CASES: dict[str, dict[str, Any]] = {
    case["id"]: case
    for case in json.loads((Path(__file__).parent / "data" / "cases.json").read_text(encoding="utf-8"))[
        "cases"
    ]
}
_WORDS = {"crossing": "cross", "sliding entry": "slide", "sliding exit": "exit", "grazing": "graze"}
_SIGNS = {1: "+", -1: "-", 0: ""}


@dataclass(frozen=True)
class Case:
    """One initial-value problem of the bank."""

    system: System
    x0: tuple[float, ...]
    t_span: tuple[float, float]
    expected: dict[str, Any]
    n_events: int | None


def number(text: object) -> float:
    """A number of the bank: text with a formula, or a number."""
    return float(parse_expression(str(text)))


@cache
def case(name: str) -> Case:
    """The case of this id, its parameters substituted as exact numbers."""
    raw = CASES[name]
    states = [Symbol(state, real=True) for state in raw["states"]]
    names: dict[str, Any] = {symbol.name: symbol for symbol in states}
    for key, value in (raw["params"] or {}).items():
        names[key] = parse_expression(value, names)
    surfaces = [Surface(f"h{i}", parse_expression(text, names)) for i, text in enumerate(raw["h"])]
    fields = {
        signs: [parse_expression(text, names) for text in texts] for signs, texts in raw["fields"].items()
    }
    expected = {entry["name"]: entry for entry in raw["expected"]}
    start, end = (number(text) for text in raw["t_span"])
    return Case(
        System.from_modes(surfaces, fields, states),
        tuple(number(text) for text in raw["x0"]),
        (start, end),
        expected,
        raw.get("n_events"),
    )


@cache
def solved(name: str) -> Solution:
    """The case's solution at rtol 1e-11 over its own span."""
    item = case(name)
    return solve(item.system, item.x0, item.t_span, rtol=1e-11, atol=1e-13)


def event_word(event: Any) -> str:
    """An event's kind in the bank's words: cross+, slide, exit-."""
    return _WORDS[str(event.kind)] + _SIGNS[event.direction]
