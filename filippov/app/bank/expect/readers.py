"""All readers of expectations, in the order in which their patterns are tried."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from filippov.app.bank.expect import averages as expect_averages
from filippov.app.bank.expect import cycle as expect_cycle
from filippov.app.bank.expect import events as expect_events
from filippov.app.bank.expect import formula as expect_formula
from filippov.app.bank.expect import gains as expect_gains
from filippov.app.bank.expect import model as expect_model
from filippov.app.bank.expect import places as expect_places
from filippov.app.bank.expect import roots as expect_roots
from filippov.app.bank.expect import rules as expect_rules
from filippov.app.bank.expect import sets as expect_sets
from filippov.app.bank.expect import slide as expect_slide
from filippov.app.bank.expect import state as expect_state
from filippov.app.bank.expect import zeno as expect_zeno
from filippov.app.bank.outcome import ENTERED, Pattern

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
