"""All readers of expectations, in the order in which their patterns are tried."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from filippov.bank import (
    expect_averages,
    expect_cycle,
    expect_events,
    expect_formula,
    expect_gains,
    expect_model,
    expect_places,
    expect_roots,
    expect_rules,
    expect_sets,
    expect_slide,
    expect_state,
    expect_zeno,
)
from filippov.bank.outcome import ENTERED, Pattern

READERS = (
    expect_events,
    expect_state,
    expect_slide,
    expect_cycle,
    expect_zeno,
    expect_sets,
    expect_formula,
    expect_rules,
    expect_averages,
    expect_places,
    expect_model,
    expect_roots,
    expect_gains,
)
_PLACES = {module.__name__: place for place, module in enumerate(READERS)}
_PATTERNS = tuple(sorted(ENTERED, key=lambda entry: _PLACES[entry.reader.__module__]))


def patterns() -> tuple[Pattern, ...]:
    """All patterns, in the order in which they are tried."""
    return _PATTERNS


def matching(name: str, states: Sequence[str], about: str) -> Iterator[tuple[Pattern, re.Match[str]]]:
    """The patterns that fit a name."""
    for entry in _PATTERNS:
        match = entry.match(name, states) if entry.about == about else None
        if match is not None:
            yield entry, match
