"""All readers of expectations, in the order in which their patterns are tried."""

from __future__ import annotations

from filippov.bank import (
    expect_cycle,
    expect_events,
    expect_formula,
    expect_roots,
    expect_sets,
    expect_slide,
    expect_state,
    expect_zeno,
)
from filippov.bank.outcome import matching, patterns

__all__ = ["READERS", "matching", "patterns"]

READERS = (
    expect_events,
    expect_state,
    expect_slide,
    expect_cycle,
    expect_zeno,
    expect_sets,
    expect_formula,
    expect_roots,
)
